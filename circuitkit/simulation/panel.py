"""What stands below the robot in a film: the circuit with its active neurons, and channels' last moments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from circuitkit.base.units import Unit
from circuitkit.circuit import CircuitGraph
from circuitkit.control import Array
from circuitkit.draw.lit import lit_network, node_columns
from circuitkit.draw.network import Node, make_network
from circuitkit.draw.style import CYCLE, GREY, INK, KIND_COLOUR, PAPER, ROLE_FILL, widened
from circuitkit.simulation.plots import channels_of_interest, least_span, shown_unit, values_of
from circuitkit.simulation.result import Result, RunSummary

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

PANEL_WIDTH, PANEL_HEIGHT = 640, 200

_FINE = 2  # drawn so much larger and then reduced
_NETWORK = (8, 24, 404, 162)  # left, top, width, height, [pixels]
_CHART = (432.0, 26.0, 630.0, 192.0)  # left, top, right, bottom
_TEXT, _SMALL_TEXT, _VALUE_TEXT = 11.0, 9.5, 8.5
_AROUND = 1.2  # between a value and the boxes above and below it, at least
_FURTHEST = 6.5  # from a box to the middle of the value below it, at most
_MARKED = "#f8e3b0"  # the ground of a chart while something befalls the robot
_RED = "#c8201a"
_LEAST_LETTERS = 3.5  # of a network, in the film; with smaller ones there are cells in its place
_CELL_HEIGHT = 12.4
_INK_TURNS = 0.5  # from this activity on, words on a cell are white
_SHOWN_S = 2.0
_MOST_ROWS = 3


@lru_cache(maxsize=32)
def font(size: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which comes with matplotlib; [pixels]."""
    from PIL import ImageFont  # an extra

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / name), size)


def _value_font() -> ImageFont.FreeTypeFont:
    return font(_VALUE_TEXT * _FINE, bold=True)


class Panel:
    """Pictures of the circuit and of some channels of one robot, tick by tick."""

    def __init__(
        self, result: Result, summary: RunSummary, robot: int = 0, chart: Sequence[ChartRow] | None = None
    ) -> None:
        """Prepare a run's pictures.

        Args:
            result: The run.
            summary: Of it.
            robot: Which of its robots.
            chart: The channels, from top to bottom; by default those of this run alone.
        """
        recording = result.recording
        self._summary, self._recording, self._robot = summary, recording, robot
        left, top, width, height = _NETWORK
        self._at = (left * _FINE, top * _FINE)
        graph = recording.circuit
        self._lit = self._cells = None
        if graph is not None:
            self._columns = node_columns(graph, recording.trace_names)
            self._lit = lit_network(graph, width * _FINE, height * _FINE, _LEAST_LETTERS * _FINE)
            self._cells = _Cells(graph) if self._lit is None else None
        self._peaks = np.nanmax(np.abs(recording.trace[:, robot]), axis=0, initial=0.0)
        self._peaks = np.maximum(self._peaks, 1.0)
        names = (*recording.observation_names, *recording.command_names)
        values = np.concatenate([recording.observations[:, robot], recording.commands[:, robot]], axis=1)
        self._shown = dict(zip(names, values.T, strict=True))
        units = channels_of_interest([result])
        self._units = {name: shown_unit(self._shown[name], units[name]) for name in names if name in units}
        self._rows = chart_of([result]) if chart is None else tuple(chart)
        self._values = [values_of(result, row.name) for row in self._rows]
        befell = [(push.start_s, push.end_s) for push in summary.pushes]
        befell += [(begin, end) for _, begin, end in summary.spans]
        self._befell = tuple((begin, max(end, begin + summary.step_s)) for begin, end in befell)
        self._places = {} if self._lit is None else self._room_below(self._lit.boxes)
        self._title = _title(result)

    def _room_below(
        self, boxes: Mapping[str, tuple[float, float, float, float]]
    ) -> dict[str, tuple[float, float]]:
        """Where values stand: below each box of a side, if all of them have room; [pixels].

        They are in the middle between a box and the next one, and nowhere near the one above if that is far.
        """
        _, above, _, below = (edge / _FINE for edge in _value_font().getbbox("0 rad/s", anchor="mm"))
        _, top, _, bottom = (edge / _FINE for edge in _value_font().getbbox("0", anchor="mm"))
        half = self._lit.width / 2 if self._lit is not None else 0.0
        places = {}
        for right in (False, True):  # inputs stand on the left, outputs on the right
            side = [name for name, box in boxes.items() if (box[0] > half) == right and name in self._units]
            side.sort(key=lambda name: boxes[name][1])
            gaps = [(boxes[b][1] - boxes[a][3]) / _FINE for a, b in pairwise(side)]
            if any(gap < below - above + 2 * _AROUND for gap in gaps):
                continue
            for name, gap in zip(side, [*gaps, np.inf][: len(side)], strict=True):
                x0, _, x1, y1 = boxes[name]
                y = (self._at[1] + y1) / _FINE + min(gap / 2, _FURTHEST) - (top + bottom) / 2
                places[name] = ((self._at[0] + (x0 + x1) / 2) / _FINE, y)
        return places

    def picture(self, tick: int) -> Image.Image:
        """The panel after a tick."""
        from PIL import Image, ImageDraw  # an extra

        image = Image.new("RGB", (PANEL_WIDTH * _FINE, PANEL_HEIGHT * _FINE), PAPER)
        pen = ImageDraw.Draw(image)
        _write(pen, (_NETWORK[0], 12.0), self._title, _TEXT, anchor="lm", bold=True)
        if self._lit is not None:
            shares = {name: float(members.mean()) for name, members in self._activity(tick).items()}
            image.paste(Image.fromarray(self._lit.picture(shares)), self._at)
            self._write_values(pen, tick)
        if self._cells is not None:
            self._cells.paint(pen, self._activity(tick))
        self._paint_chart(pen, tick)
        return image.reduce(_FINE)

    def _activity(self, tick: int) -> dict[str, Array]:
        """How active each node is, from 0 to 1; of a population each member."""
        shares = np.clip(np.nan_to_num(self._recording.trace[tick, self._robot] / self._peaks), 0.0, 1.0)
        return {name: shares[columns] for name, columns in self._columns.items()}

    def _write_values(self, pen: ImageDraw.ImageDraw, tick: int) -> None:
        """The value of every input and output below its box, where there is room."""
        for name, (x, y) in self._places.items():
            text = _valued(float(self._shown[name][tick]), *self._units[name])
            colour = _RED if text == "missing" else INK
            half = pen.textlength(text, font=_value_font()) / (2 * _FINE)
            at = (min(max(x, half + 2), _CHART[0] - half - 4), y)
            _write(pen, at, text, _VALUE_TEXT, anchor="mm", bold=True, fill=colour)

    def _paint_chart(self, pen: ImageDraw.ImageDraw, tick: int) -> None:
        """Some channels over the last moments, the newest on the right."""
        if not self._rows:
            return
        left, top, right, bottom = _CHART
        height = (bottom - top) / len(self._rows)
        step_s = self._summary.step_s
        first = max(tick - round(_SHOWN_S / step_s), 0)
        scale = (right - left) / _SHOWN_S
        for i, (row, values) in enumerate(zip(self._rows, self._values, strict=True)):
            low, high = top + i * height + 15, top + (i + 1) * height - 3
            pen.line([_fine(left, high), _fine(right, high)], fill=GREY, width=1)
            _write(pen, (left, low - 8), row.name, _SMALL_TEXT, anchor="lm", bold=True)
            text = _valued(float(values[tick]), *row.unit) if np.isfinite(values).any() else "none"
            _write(pen, (right, low - 8), text, _SMALL_TEXT, anchor="rm")
            for span in self._befell:
                begin, end = (right - (tick * step_s - t) * scale for t in span)
                if begin < right and end > left:
                    pen.rectangle([_fine(max(begin, left), low), _fine(min(end, right), high)], fill=_MARKED)
            xs = right - (tick - np.arange(first, tick + 1)) * step_s * scale
            ys = high - (values[first : tick + 1] - row.low) / (row.high - row.low) * (high - low)
            points = [_fine(x, y) for x, y in zip(xs, ys, strict=True) if np.isfinite(y)]
            if len(points) > 1:
                pen.line(points, fill=CYCLE[i % len(CYCLE)], width=2 * _FINE)


class _Cells:
    """The neurons of a circuit that is too large for a drawing: cells with names, dark where one is active.

    They stand in the order of the file, those of an instance of a file below its name. The cell of a
    population has a stripe for each member.
    """

    def __init__(self, graph: CircuitGraph) -> None:
        left, top, width, height = _NETWORK
        groups: dict[str, list[Node]] = {}
        for node in make_network(graph).nodes:
            if node.role in KIND_COLOUR:
                groups.setdefault(node.group, []).append(node)
        rows = int(height / _CELL_HEIGHT)
        columns: list[list[Node | str]] = []
        for name, nodes in groups.items():
            block: list[Node | str] = [name, *nodes] if name else list(nodes)
            if not columns or not name or len(columns[-1]) + len(block) > rows:
                columns.append([])
            columns[-1] += block
        columns = [column[i : i + rows] for column in columns for i in range(0, len(column), rows)]
        self._width = width / max(len(columns), 1)
        self._placed = [
            (each, left + i * self._width, top + k * _CELL_HEIGHT)
            for i, column in enumerate(columns)
            for k, each in enumerate(column)
        ]

    def paint(self, pen: ImageDraw.ImageDraw, activity: Mapping[str, Array]) -> None:
        """Paint all cells under some activity by node, from 0 to 1, one value a member."""
        for each, x, y in self._placed:
            if isinstance(each, str):
                self._name(pen, each, x, y, bold=True)
                continue
            members = activity.get(each.name, np.zeros(1))
            stripes = np.array_split(members, min(len(members), int(self._width)))
            wide = (self._width - 2) / len(stripes)
            for i, stripe in enumerate(stripes):
                colour = _between(ROLE_FILL[each.role], KIND_COLOUR[each.role], float(stripe.mean()))
                low, high = _fine(x + i * wide, y + 0.5), _fine(x + (i + 1) * wide, y + _CELL_HEIGHT - 0.5)
                pen.rectangle([low, high], fill=colour)
            self._name(pen, each.lines[0], x, y, fill=PAPER if members.mean() > _INK_TURNS else INK)

    def _name(self, pen: ImageDraw.ImageDraw, text: str, x: float, y: float, **style: Any) -> None:  # noqa: ANN401 - see `_write`
        """As many of the letters as there is room for."""
        room = (self._width - 4) * _FINE
        while text and pen.textlength(text, font=font(_SMALL_TEXT * _FINE)) > room:
            text = text[:-1]
        _write(pen, (x + 2, y + _CELL_HEIGHT / 2), text, _SMALL_TEXT, anchor="lm", **style)


def _between(pale: str, dark: str, share: float) -> tuple[int, int, int]:
    """A colour between two of the form `#rrggbb`: the first for a share of 0, the other one for 1."""
    ends = ((int(pale[i : i + 2], 16), int(dark[i : i + 2], 16)) for i in (1, 3, 5))
    red, green, blue = (round(low + share * (high - low)) for low, high in ends)
    return red, green, blue


@dataclass(frozen=True)
class ChartRow:
    """A channel in the chart.

    Attributes:
        name: Of the channel or command.
        unit: In which it is shown: its scale and its symbol.
        low: Lower end of its axis, [SI].
        high: Upper end, [SI].
    """

    name: str
    unit: tuple[float, str]
    low: float
    high: float


def chart_of(results: Sequence[Result]) -> tuple[ChartRow, ...]:
    """The channels that a film shows of runs side by side: the same for all, on the same axes.

    They are the first that a controller reads, the first that one commands, and then what measures need.
    """
    units = channels_of_interest(results)
    recordings = [result.recording for result in results]
    graphs = [recording.circuit for recording in recordings if recording.circuit is not None]
    read = [name for recording in recordings for name in recording.observation_names]
    read = read or [each.name for graph in graphs for each in graph.inputs]
    chosen = list(dict.fromkeys(name for name in read if name in units))[: _MOST_ROWS - 1]
    commanded = [name for recording in recordings for name in recording.command_names]
    names = dict.fromkeys([*chosen, *commanded[:1], *units])
    return tuple(_row(name, units[name], results) for name in list(names)[:_MOST_ROWS])


def _row(name: str, unit: Unit, results: Sequence[Result]) -> ChartRow:
    values = np.concatenate([values_of(result, name) for result in results])
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    low, high = widened(low, high, least_span(unit))
    margin = 0.05 * (high - low) or 1.0
    return ChartRow(name, shown_unit(values, unit), low - margin, high + margin)


def _title(result: Result) -> str:
    graph, names = result.recording.circuit, result.recording.trace_names
    if graph is None:
        return "no circuit"
    known = {neuron.name for neuron in graph.neurons} | {f"{p.name}[0]" for p in graph.populations}
    return f"circuit {graph.name}" if known & set(names) else f"the circuit {graph.name} is not connected"


def _valued(value: float, scale: float, symbol: str) -> str:
    """A value in the unit of a symbol and a scale, with as many digits as one can follow in a film."""
    if not np.isfinite(value):
        return "missing"
    shown = value / scale
    text = f"{shown:.{0 if abs(shown) >= 100 else 1 if abs(shown) >= 10 else 2}f}"  # noqa: PLR2004 - three digits
    text = text.replace("-", "\N{MINUS SIGN}") if float(text) else text.removeprefix("-")
    return text if symbol == "1" else f"{text} {symbol}"


def _fine(x: float, y: float) -> tuple[int, int]:
    return round(x * _FINE), round(y * _FINE)


def _write(
    pen: ImageDraw.ImageDraw, at: tuple[float, float], text: str, size: float,
    *, anchor: str, bold: bool = False, fill: str = INK,
) -> None:  # fmt: skip
    pen.text(_fine(*at), text, fill=fill, font=font(size * _FINE, bold=bold), anchor=anchor)
