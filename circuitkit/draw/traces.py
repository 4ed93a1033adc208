"""`draw_traces`: what happened over time, from plain arrays: curves, bands, spans, and neurons' activity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import InputError, Problem
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    FONT,
    GREY,
    INK,
    KIND_COLOUR,
    NORMAL,
    POINTS_PER_INCH,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    number,
    plain_legend,
    plain_ticks,
    tidy,
    widened,
    write_picture,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 7.2  # [in]
_LEFT, _RIGHT, _TOP, _BOTTOM, _BETWEEN = 0.95, 0.2, 0.1, 0.5, 0.22  # [in]
_WORDS = 0.18  # a line of words above the first panel, [in]
_APART = 0.08  # between words of a line, [in]
# What befell is coloured, what came after the end is hatched: they stay apart in grey.
_MARKED: Mapping[str, Any] = {"color": "#e6a100", "alpha": 0.25, "linewidth": 0}
_OVER: Mapping[str, Any] = {"facecolor": "#eeeeee", "edgecolor": "#a6a6a6", "hatch": "////", "linewidth": 0}
_ROW_HEIGHT = 0.17  # of a neuron, [in]
_MOST_COLUMNS = 4000  # of the raster; more are not seen


@dataclass(frozen=True, eq=False)
class Line:
    """A curve over time.

    Attributes:
        name: For the legend; empty for none.
        values: Shape (T,), in the unit of the panel; NaN leaves a hole.
        colour: Of the curve; empty takes the next one.
        dashes: Line style of matplotlib; empty takes the next one.
        width: [pt].
    """

    name: str
    values: npt.ArrayLike
    colour: str = ""
    dashes: str = ""
    width: float = 1.3


@dataclass(frozen=True, eq=False)
class Band:
    """The area between two curves, such as the range that is allowed.

    Attributes:
        name: For the legend; empty for none.
        low: Shape (T,) or a number, in the unit of the panel; NaN leaves a hole.
        high: As `low`.
        colour: Of the area.
    """

    name: str
    low: npt.ArrayLike
    high: npt.ArrayLike
    colour: str = "#e8e8e8"


@dataclass(frozen=True, eq=False)
class Panel:
    """One axes.

    Attributes:
        label: Of the vertical axis, with its unit, such as `speed [m/s]`.
        lines: The curves.
        bands: The areas behind them.
        height: [in].
        least_span: What the axis spans at least, in its unit; it also spans a hundredth of its values' size.
    """

    label: str
    lines: Sequence[Line] = ()
    bands: Sequence[Band] = ()
    height: float = 1.6
    least_span: float = 0.0


@dataclass(frozen=True, eq=False)
class Activity:
    """Outputs of neurons, shown as a raster: one row a neuron, the darker the more active.

    Attributes:
        names: Of the neurons.
        outputs: Shape (T, n), dimensionless.
        roles: "excitatory" or "inhibitory" by name; colours the names.
        full: Output that is shown darkest: one for all, or one for each neuron.
    """

    names: Sequence[str]
    outputs: npt.ArrayLike
    roles: Mapping[str, str] = field(default_factory=dict)
    full: float | Sequence[float] = 1.0


@dataclass(frozen=True)
class Span:
    """A stretch of time that is marked in every panel, such as a fault, [s].

    Attributes:
        start_s: From when.
        stop_s: To when.
        text: Stands above the first panel.
        over: Whether it is what came after the end, which is hatched and not coloured.
    """

    start_s: float
    stop_s: float
    text: str = ""
    over: bool = False


def draw_traces(
    path: str | Path,
    time_s: npt.ArrayLike,
    panels: Sequence[Panel] = (),
    activity: Activity | None = None,
    spans: Sequence[Span] = (),
    title: str = "",
) -> None:
    """Draw panels above each other over the same time, the neurons' activity last.

    Args:
        path: Where the picture goes: .png, .svg or .pdf.
        time_s: Shape (T,), ascending, [s].
        panels: From top to bottom.
        activity: Neurons to show.
        spans: Stretches of time to mark.
        title: Stands above all.

    Raises:
        InputError: Another suffix, or a curve that is not as long as the time.
        OutputError: The file cannot be written.
    """
    write_picture(path, lambda: traces_figure(time_s, panels, activity, spans, title))


def traces_figure(
    time_s: npt.ArrayLike,
    panels: Sequence[Panel] = (),
    activity: Activity | None = None,
    spans: Sequence[Span] = (),
    title: str = "",
) -> Figure:
    """As `draw_traces`, but the figure itself."""
    time = np.asarray(time_s, dtype=np.float64)
    # Above the first panel, from the top: the title, the panel's legend, and what the spans say.
    words = _placed_words(spans, time)
    told = 1 + max((row for _, _, row in words), default=-1)
    named = activity is not None if not panels else any(line.name for line in panels[0].lines)
    above = _TOP + _WORDS * (bool(title) + told + (named or not told))
    heights = [panel.height for panel in panels]
    if activity is not None:
        heights.append(_ROW_HEIGHT * max(2, len(activity.names)))
    total = above + sum(heights) + _BETWEEN * max(0, len(heights) - 1) + _BOTTOM
    with house_style():
        figure = new_figure(_WIDTH, total)
        shared: Axes | None = None
        top = above
        if title:
            figure.text(_TOP / _WIDTH, 1 - _TOP / total, title, va="top", fontsize=NORMAL, parse_math=False)
        for i, height in enumerate(heights):
            axes = axes_at(figure, _LEFT, top, _WIDTH - _LEFT - _RIGHT, height, sharex=shared)
            shared = shared or axes
            if i < len(panels):
                paint_panel(axes, time, panels[i], 0.0 if i else told * _WORDS)
            elif activity is not None:
                paint_activity(axes, time, activity, 0.0 if i else told * _WORDS)
            _paint_spans(axes, spans, () if i else words)
            axes.tick_params(labelbottom=i == len(heights) - 1)
            top += height + _BETWEEN
        if shared is not None and len(time):
            shared.set_xlim(float(time[0]), max(float(time[-1]), float(time[0]) + 1e-9))
            figure.axes[-1].set_xlabel("time [s]")
        figure.align_ylabels()
    return figure


def paint_panel(axes: Axes, time_s: npt.NDArray[np.float64], panel: Panel, lift_in: float = 0.0) -> None:
    """Bands and curves with their legend above them.

    Args:
        axes: Where.
        time_s: Shape (T,), [s].
        panel: What.
        lift_in: How far above the axes the legend begins, [in].

    Raises:
        InputError: A curve is not as long as the time.
    """
    for band in panel.bands:
        low, high = (_as_long(edge, time_s, band.name) for edge in (band.low, band.high))
        label = band.name or None
        axes.fill_between(time_s, low, high, color=band.colour, linewidth=0, label=label, zorder=0.5)
    for i, line in enumerate(panel.lines):
        axes.plot(
            time_s,
            _as_long(line.values, time_s, line.name),
            color=line.colour or CYCLE[i % len(CYCLE)],
            linestyle=line.dashes or DASHES[i // 2 % len(DASHES)],  # two tones apart in grey, then dashes
            linewidth=line.width,
            label=line.name or None,
        )
    axes.set_ylabel(panel.label)
    axes.set_ylim(*widened(*axes.get_ylim(), panel.least_span))
    plain_ticks(axes)
    tidy(axes)
    entries = axes.get_legend_handles_labels()[1]
    if entries:
        columns: Any = {"ncols": len(entries), "columnspacing": 1.2, "handlelength": 1.6}
        at = 1.0, 1.0 + lift_in * axes.figure.dpi / axes.bbox.height
        plain_legend(axes, "lower right", at, borderaxespad=0.1, **columns)


def paint_activity(
    axes: Axes, time_s: npt.NDArray[np.float64], activity: Activity, lift_in: float = 0.0
) -> None:
    """Paint a raster: the first neuron on top.

    Args:
        axes: Where.
        time_s: Shape (T,), [s].
        activity: What.
        lift_in: How far above the axes its key stands, [in].

    Raises:
        InputError: The outputs are not one row for each time and one column for each neuron.
    """
    outputs = np.asarray(activity.outputs, dtype=np.float64)
    wanted = (len(time_s), len(activity.names))
    if outputs.shape != wanted:
        message = f"found shape {outputs.shape}; allowed: {wanted}, a row a time and a column a neuron"
        raise InputError(Problem("", 0, 0, "activity", message))
    full = np.asarray(activity.full, dtype=np.float64)
    if len(time_s):
        edges, shown = _columns(time_s, outputs / full)
        rows = np.arange(len(activity.names) + 1) - 0.5
        axes.pcolormesh(edges, rows, shown.T, cmap="Greys", vmin=0.0, vmax=1.0, rasterized=True)
    for row in range(1, len(activity.names)):
        axes.axhline(row - 0.5, color="white", linewidth=1.2)
    axes.set_ylim(max(len(activity.names), 1) - 0.5, -0.5)
    axes.set_yticks(range(len(activity.names)), list(activity.names))
    tidy(axes, grid=False)
    axes.tick_params(axis="y", length=0)
    darkest = number(float(full)) if full.ndim == 0 else "the largest of each"
    words: Any = {"ha": "right", "va": "bottom", "fontsize": SMALL, "color": GREY}
    above = (0, lift_in * POINTS_PER_INCH)
    place: Any = {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(f"neuron outputs: white 0, black {darkest}", (1.0, 1.0), above, **place, **words)
    for tick, name in zip(axes.get_yticklabels(), activity.names, strict=True):
        tick.set(color=KIND_COLOUR.get(activity.roles.get(name, ""), INK), fontsize=SMALL)


def _columns(
    time_s: npt.NDArray[np.float64], outputs: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return edges in time and outputs, thinned to the largest of neighbours if there are too many."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    edges = np.append(time_s, time_s[-1] + step)
    every = -(-len(time_s) // _MOST_COLUMNS)
    if every == 1:
        return edges, outputs
    starts = np.arange(0, len(time_s), every)
    return np.append(edges[starts], edges[-1]), np.maximum.reduceat(outputs, starts, axis=0)


def _placed_words(spans: Sequence[Span], time_s: npt.NDArray[np.float64]) -> list[tuple[str, float, int]]:
    """What spans say, where it begins as a share of the axes' width, and in which row above them.

    Words begin where their span does, or so much earlier that they do not leave the axes; where they would
    touch others they stand in the next row.
    """
    if len(time_s) == 0 or time_s[-1] <= time_s[0]:
        return []
    inches = _WIDTH - _LEFT - _RIGHT
    rows: list[float] = []  # where the last words of each row end, [in]
    placed = []
    for span in sorted(spans, key=lambda span: span.start_s):
        if not span.text or span.start_s > time_s[-1] or span.stop_s < time_s[0]:
            continue
        wide = _wide_in(span.text)
        begin = (span.start_s - time_s[0]) / (time_s[-1] - time_s[0]) * inches
        begin = max(0.0, min(begin, inches - wide))
        row = next((i for i, end in enumerate(rows) if end + _APART <= begin), len(rows))
        rows[row : row + 1] = [begin + wide]
        placed.append((span.text, begin / inches, row))
    return placed


def _wide_in(text: str) -> float:
    """How wide words are, [in]."""
    from matplotlib.font_manager import FontProperties  # brings matplotlib
    from matplotlib.textpath import TextToPath  # brings matplotlib

    font = FontProperties(family=FONT, size=SMALL)
    return float(TextToPath().get_text_width_height_descent(text, font, ismath=False)[0]) / POINTS_PER_INCH


def _paint_spans(axes: Axes, spans: Sequence[Span], words: Sequence[tuple[str, float, int]]) -> None:
    for span in spans:
        look: Any = _OVER if span.over else _MARKED
        axes.axvspan(span.start_s, span.stop_s, zorder=0.2, **look)
    for text, begin, row in words:
        axes.annotate(
            text,
            (begin, 1.0),
            (0, 2 + row * _WORDS * POINTS_PER_INCH),
            xycoords="axes fraction",
            textcoords="offset points",
            fontsize=SMALL,
            color=GREY,
            parse_math=False,
        )


def _as_long(values: npt.ArrayLike, time_s: npt.NDArray[np.float64], name: str) -> npt.NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in {(), time_s.shape}:
        message = f"found shape {array.shape}; allowed: {time_s.shape}, as the time, or a number"
        raise InputError(Problem("", 0, 0, name, message))
    return np.broadcast_to(array, time_s.shape)
