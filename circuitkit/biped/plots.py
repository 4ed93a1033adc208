"""Plots of bipeds: the ZMP over time (Fig. 10), the centre of mass (Fig. 9), and a comparison of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from circuitkit.biped.gait.lipm import natural_frequency
from circuitkit.biped.sensing import LEAST_LOAD_N, SETTLED_S, BipedView, support_edges_m
from circuitkit.biped.thresholds import ThresholdMeasure
from circuitkit.control import Array
from circuitkit.draw.style import (
    DASHES,
    EXCITATORY,
    GREY,
    INHIBITORY,
    INK,
    NORMAL,
    SMALL,
    house_style,
    new_figure,
    plain_legend,
    tidy,
    widened,
)
from circuitkit.simulation.formulas import Formula
from circuitkit.simulation.result import PushSpan, Result, RunSummary, summarise

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM = 1e3  # lengths are shown in millimetres

PUSHED = "#c8201a"  # from the push on, as in the paper
CYCLE_GREY = "#a6a6a6"
BAND, PUSH_FILL, WINDOW_FILL = "#dcdcdc", "#f6c945", "#eef3f8"
_WIDTH_IN = 7.2
_MOST_IN_A_ROW = 4  # entries of a legend
_LYING_DEG = 90.0
_LEAST_FRAME = 1.0  # of the centre of mass, [mm] and [mm/s]


@dataclass(frozen=True, eq=False)
class BipedSummary:
    """What the plots of a biped show of a run; T ticks. Positions are from the middle between the feet.

    Attributes:
        run: The general summary.
        zmp_mm: ZMP_y by the force cells, not a number where no foot carries; shape (T,).
        pressure_mm: True centre of pressure, y; shape (T,).
        band_mm: Right and left edge of the support polygon by the measured load; shape (T, 2).
        lines_mm: Right and left threshold of a circuit; shape (T, 2); not numbers without any.
        lines_of: The circuit whose they are, which need not be the controller's; empty without any.
        edges_mm: Edges of the soles for feet side by side; shape (3, 2).
        com_mm: y of the centre of mass; shape (T,).
        com_velocity_mm_s: Its velocity; shape (T,).
        com_height_m: Its mean height.
        tilt_deg: How far the torso leans from the vertical; shape (T,).
        fall_deg: From which lean on the scenario's `until` ends a run; None if it asks for another thing.
    """

    run: RunSummary
    zmp_mm: Array
    pressure_mm: Array
    band_mm: Array
    lines_mm: Array
    lines_of: str
    edges_mm: Array
    com_mm: Array
    com_velocity_mm_s: Array
    com_height_m: float
    tilt_deg: Array
    fall_deg: float | None

    @property
    def fall_s(self) -> float | None:
        """When it fell; None if it did not."""
        return self.run.ended_s


def summarise_biped(result: Result, run: RunSummary, robot: int = 0) -> BipedSummary:
    """What the plots of a biped show of one robot of a result."""
    recording = result.recording
    view = BipedView(recording)
    support = view.support[:, robot]
    measure = next((each for each in recording.judge.kinds if isinstance(each, ThresholdMeasure)), None)
    lines = np.full((3, 2), np.nan) if measure is None else measure.lines_m
    channel = "zmp_y" if measure is None else measure.channel
    edges = support_edges_m(view.block) * MM
    carried = view.loads_n[:, robot].sum(axis=-1) > LEAST_LOAD_N
    com = view.com_m[:, robot]
    upward = recording.channel("upright")[:, robot]
    return BipedSummary(
        run=run,
        zmp_mm=np.where(carried, recording.channel(channel)[:, robot] * MM, np.nan),
        pressure_mm=view.centre_of_pressure_m[:, robot, 1] * MM,
        band_mm=edges[support],
        lines_mm=lines[support] * MM,
        lines_of="" if measure is None else measure.circuit,
        edges_mm=edges,
        com_mm=com[:, 1] * MM,
        com_velocity_mm_s=view.com_velocity[:, robot, 1] * MM,
        com_height_m=float(com[: max(len(support) // 4, 1), 2].mean()),
        tilt_deg=np.degrees(np.arccos(np.clip(upward, -1.0, 1.0))),
        fall_deg=_fall_deg(recording.judge.until),
    )


def _fall_deg(until: Formula | None) -> float | None:
    """The lean from which on a condition holds, acos of the bound below which `upright` is; None if none."""
    bound = None if until is None else until.true_below("upright")
    return None if bound is None or not -1.0 <= bound <= 1.0 else float(np.degrees(np.arccos(bound)))


def biped_figures(result: Result, summary: RunSummary) -> dict[str, Figure]:
    """`zmp` as Fig. 10 and `com_phase` as Fig. 9, by the name of their file."""
    biped = summarise_biped(result, summary)
    return {"zmp": zmp_figure(biped), "com_phase": phase_figure(biped)}


def zmp_figure(story: BipedSummary) -> Figure:
    """The ZMP against the support polygon and the circuit's thresholds, as Fig. 10; above, the whole run."""
    closer = bool(story.run.pushes)
    with house_style():
        figure = new_figure(_WIDTH_IN, 4.9 if closer else 3.4)
        figure.set_layout_engine("constrained")
        figure.suptitle(f"{story.run.scenario}, {story.run.title}", fontsize=NORMAL + 1)
        if closer:
            above, axes = figure.subplots(2, 1, height_ratios=[1, 3])
            _zmp_axes(above, story, (0.0, story.run.end_s))
            above.axvspan(*story.run.window_s, color=WINDOW_FILL, zorder=-5, linewidth=0)
            above.set_ylabel("y [mm]")
        else:
            axes = figure.subplots()
        _zmp_axes(axes, story, story.run.window_s)
        _zmp_details(axes, story)
        axes.set(xlabel="time [s]", ylabel="ZMP, y [mm]   (left foot: positive)")
        _name_push(axes, story)
        figure.legend(*_legend(axes), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _zmp_axes(axes: Axes, story: BipedSummary, window: tuple[float, float]) -> None:
    """The ZMP, the support polygon and what happened, until the fall."""
    edges = story.edges_mm
    margin = 0.12 * (edges.max() - edges.min())
    tidy(axes, grid=False)
    axes.set(xlim=window, ylim=(edges.min() - margin, edges.max() + margin))
    seen = story.run.before_end()
    right, left = story.band_mm[seen].T
    axes.fill_between(
        story.run.time_s[seen],
        right,
        left,
        step="pre",
        color=BAND,
        linewidth=0,
        label="support polygon",
        gid="support",
    )
    before, after = _before_and_after(story, story.zmp_mm)
    axes.plot(
        story.run.time_s, before, color=INK, linewidth=1.1, label="ZMP by force cells", gid="zmp_before"
    )
    if story.run.pushes:
        label = "ZMP from the push on"
        axes.plot(story.run.time_s, after, color=PUSHED, linewidth=1.5, label=label, gid="zmp_after")
    _mark_events(axes, story, window)
    _mark_missing(axes, story)


def _zmp_details(axes: Axes, story: BipedSummary) -> None:
    """A circuit's thresholds and the true centre of pressure."""
    seen = story.run.before_end()
    changed = np.any(np.diff(story.lines_mm, axis=0, prepend=story.lines_mm[:1]) != 0, axis=1)
    labels = (f"threshold of {story.lines_of}", None) if story.lines_of else ()
    for side, label in enumerate(labels):
        axes.plot(
            story.run.time_s, np.where(seen & ~changed, story.lines_mm[:, side], np.nan),
            drawstyle="steps-pre",
            color=INK, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1.5, label=label, gid=f"threshold_{side}",
        )  # fmt: skip
    axes.plot(
        story.run.time_s, np.where(seen, story.pressure_mm, np.nan), color=EXCITATORY, linewidth=0.7,
        zorder=1.6, label="centre of pressure", gid="pressure",
    )  # fmt: skip


def _before_and_after(story: BipedSummary, values: Array) -> tuple[Array, Array]:
    """The curve until the push, and from the push on; they share the last point before it."""
    pushed = story.run.pushed()
    joint = pushed | np.append(pushed[1:], False)
    seen = story.run.before_end()
    before = np.where(~pushed & seen, values, np.nan)
    return before, np.where(joint & seen, values, np.nan)


def _mark_events(axes: Axes, story: BipedSummary, window: tuple[float, float]) -> None:
    """The pushes as coloured spans, the fall as a line."""
    for number, push in enumerate(story.run.pushes):
        axes.axvspan(
            push.start_s, push.end_s, facecolor=PUSH_FILL, edgecolor=INK, linewidth=0.8, alpha=0.55,
            zorder=0.5, label="push" if number == 0 else None, gid=f"push_{number}",
        )  # fmt: skip
    if story.fall_s is not None and story.fall_s <= window[1]:
        axes.axvline(
            story.fall_s, color=PUSHED, linewidth=1.4, linestyle=":", label=story.run.ending, gid="fall"
        )


def _mark_missing(axes: Axes, story: BipedSummary) -> None:
    """Crosses at the lower edge where the controller lacked a reading."""
    missing = story.run.time_s[story.run.missing]
    if len(missing):
        axes.plot(
            missing, np.full(len(missing), 0.03), "x", transform=axes.get_xaxis_transform(), color=PUSHED,
            markersize=3.5, markeredgewidth=0.8, label="reading missing", gid="missing",
        )  # fmt: skip


def _name_push(axes: Axes, story: BipedSummary) -> None:
    """The first push in words, above the axes."""
    if story.run.pushes:
        push = story.run.pushes[0]
        axes.annotate(
            _push_text(push), ((push.start_s + push.end_s) / 2, 1.0), xycoords=("data", "axes fraction"),
            xytext=(0, 2), textcoords="offset points", ha="center", va="bottom", fontsize=SMALL, color=INK,
        )  # fmt: skip


def _push_text(push: PushSpan) -> str:
    """Such as `20 N to the left, 200 ms`."""
    return f"{push.text}, {(push.end_s - push.start_s) * 1e3:.0f} ms"


def _legend(axes: Axes) -> tuple[list[Any], list[str]]:
    handles, labels = axes.get_legend_handles_labels()
    return list(handles), list(labels)


def phase_figure(story: BipedSummary) -> Figure:
    """Position and velocity of the centre of mass, as Fig. 9; beyond the dotted lines no stance can hold it.

    On them the capture point y + v / omega, with omega^2 = g / z, is at the outer edge of a sole.
    """
    with house_style():
        figure = new_figure(5.2, 4.6)
        figure.set_layout_engine("constrained")
        figure.suptitle(f"{story.run.scenario}, {story.run.title}", fontsize=NORMAL + 1)
        axes = figure.subplots()
        tidy(axes)
        y, v = story.com_mm, story.com_velocity_mm_s
        settled = story.run.time_s >= min(SETTLED_S, story.run.time_s[-1] / 2)
        before, after = _before_and_after(story, y)
        before[~settled] = np.nan
        cycle: dict[str, Any] = {"color": CYCLE_GREY, "linewidth": 1.7, "zorder": 2.5, "gid": "com_before"}
        axes.plot(before, v, label="limit cycle", **cycle)
        seen = np.isfinite(before) | np.isfinite(after)
        if story.run.pushes:
            axes.plot(after, v, color=PUSHED, linewidth=1.3, label="from the push on", gid="com_after")
            _mark_moments(axes, story)
        _arrows(axes, after if story.run.pushes else before, v, PUSHED if story.run.pushes else GREY)
        _frame(axes, y[seen], v[seen])
        _capture_lines(axes, story)
        axes.set(xlabel="position y of the CoM [mm]", ylabel="velocity of the CoM, y [mm/s]")
        figure.legend(*_legend(axes), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _mark_moments(axes: Axes, story: BipedSummary) -> None:
    """Where the first push began and ended, and the fall."""
    push = story.run.pushes[0]
    moments = [(push.start_s, "o", "push begins"), (push.end_s, "s", "push ends")]
    if story.fall_s is not None:
        moments.append((story.fall_s, "X", story.run.ending))
    for time, marker, label in moments:
        if time <= story.run.end_s:
            y, v = (
                np.interp([time], story.run.time_s, curve)
                for curve in (story.com_mm, story.com_velocity_mm_s)
            )
            axes.plot(
                y, v, marker, color=PUSH_FILL, markeredgecolor=INK, markersize=6.5, linestyle="none",
                zorder=4, label=label, gid=label.replace(" ", "_"),
            )  # fmt: skip


def _arrows(axes: Axes, x: Array, y: Array, colour: str) -> None:
    """The direction of time on a curve: heads at equal distances along its first second and a half."""
    head = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 12, "shrinkA": 0, "shrinkB": 0}
    rows = np.flatnonzero(np.isfinite(x))[:150]
    if len(rows) < 2:  # noqa: PLR2004 - a direction needs two points
        return
    scale = np.ptp(x[rows]) or 1.0, np.ptp(y[rows]) or 1.0
    length = np.cumsum(np.hypot(np.diff(x[rows]) / scale[0], np.diff(y[rows]) / scale[1]))
    for part in (0.12, 0.37, 0.62, 0.87):
        i = rows[int(np.searchsorted(length, part * length[-1]))]
        axes.annotate("", (x[i + 1], y[i + 1]), (x[i], y[i]), zorder=3, arrowprops=head)


def _frame(axes: Axes, x: Array, y: Array) -> None:
    """Limits around the curve with a margin."""
    for values, setter in ((x, axes.set_xlim), (y, axes.set_ylim)):
        known = values[np.isfinite(values)]
        if not len(known):
            continue
        low, high = widened(float(known.min()), float(known.max()), _LEAST_FRAME)
        margin = 0.08 * (high - low)
        setter(low - margin, high + margin)


def _capture_lines(axes: Axes, story: BipedSummary) -> None:
    """Where the capture point reaches the outer edges of the soles, as far as that is in the picture."""
    edges = story.edges_mm
    omega = natural_frequency(story.com_height_m)
    x = np.array(axes.get_xlim())
    low, high = axes.get_ylim()
    label: str | None = "capture point at the outer edge of a foot"
    for side, edge in (("right", edges.min()), ("left", edges.max())):
        v = omega * (edge - x)
        if v.min() < high and v.max() > low:
            axes.plot(x, v, color=INK, linewidth=1.0, linestyle=":", label=label, gid=f"capture_{side}")
            label = None


def comparison_figure(results: Sequence[Result]) -> Figure:
    """A column for each controller with its ZMP; below, how far the torso leans under all of them."""
    stories = [summarise_biped(result, summarise(result)) for result in results]
    window = min(s.run.window_s[0] for s in stories), max(s.run.window_s[1] for s in stories)
    count = len(results)
    with house_style():
        figure = new_figure(max(3.6 * count, _WIDTH_IN), 5.2)
        figure.set_layout_engine("constrained")
        push = f": {_push_text(stories[0].run.pushes[0])}" if stories[0].run.pushes else ""
        figure.suptitle(f"{results[0].scenario.scenario}{push}", fontsize=NORMAL + 1)
        grid = figure.add_gridspec(2, count, height_ratios=[3, 2])
        first: Axes | None = None
        for column, story in enumerate(stories):
            axes = figure.add_subplot(grid[0, column], sharey=first)
            _zmp_axes(axes, story, window)
            _zmp_details(axes, story)
            axes.set_title(story.run.title, fontweight="bold")
            axes.set_xlabel("time [s]")
            if first is None:
                first = axes
                axes.set_ylabel("ZMP, y [mm]   (left foot: positive)")
            else:
                axes.tick_params(labelleft=False)
        _tilt_axes(figure.add_subplot(grid[1, :]), stories, window)
        pairs = [pair for axes in figure.axes[:-1] for pair in zip(*_legend(axes), strict=True)]
        every = {label: handle for handle, label in pairs}
        figure.legend(list(every.values()), list(every), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _tilt_axes(axes: Axes, stories: Sequence[BipedSummary], window: tuple[float, float]) -> None:
    """How far the torso leans under each controller, and from where on this counts as a fall."""
    tidy(axes)
    colours = (INK, EXCITATORY, "#e6a100", INHIBITORY, GREY)
    for number, story in enumerate(stories):
        dash, colour = DASHES[number % len(DASHES)], colours[number % len(colours)]
        axes.plot(
            story.run.time_s, story.tilt_deg, linestyle=dash, color=colour, linewidth=1.4,
            label=story.run.title, gid=f"tilt_{number}",
        )  # fmt: skip
    if (bound := stories[0].fall_deg) is not None:
        axes.axhline(
            bound, color=PUSHED, linewidth=0.9, linestyle=":", label="counts as a fall", gid="fall_bound"
        )
    for push in stories[0].run.pushes:
        axes.axvspan(push.start_s, push.end_s, facecolor=PUSH_FILL, edgecolor=GREY, linewidth=0.5, alpha=0.55)
    axes.set(xlabel="time [s]", ylabel="lean of the torso [deg]", xlim=window)
    axes.set_ylim(0, _LYING_DEG)
    plain_legend(axes, "lower right", (1.0, 1.0), ncols=min(len(stories) + 1, _MOST_IN_A_ROW))
