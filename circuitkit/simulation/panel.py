"""What stands below the robot in a film: the circuit with its active neurons, and channels' last moments."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from circuitkit.base.units import Unit
from circuitkit.control import Array
from circuitkit.draw.lit import LitNetwork
from circuitkit.draw.style import CYCLE, GREY, INK, PAPER
from circuitkit.simulation.plots import channels_of_interest, shown_unit, values_of
from circuitkit.simulation.result import Result
from circuitkit.simulation.summary import RunSummary

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

PANEL_WIDTH, PANEL_HEIGHT = 640, 200

_FINE = 2  # drawn so much larger and then reduced
_NETWORK = (8, 24, 404, 162)  # left, top, width, height, [pixels]
_CHART = (432.0, 26.0, 630.0, 192.0)  # left, top, right, bottom
_TEXT, _SMALL_TEXT = 11.0, 9.5
_RED = "#c8201a"
_SHOWN_S = 2.0
_MOST_ROWS = 3


@lru_cache(maxsize=32)
def font(size: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which comes with matplotlib; [pixels]."""
    from PIL import ImageFont  # an extra

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / name), size)


class Panel:
    """Pictures of the circuit and of some channels of one robot, tick by tick."""

    def __init__(self, result: Result, summary: RunSummary, robot: int = 0) -> None:
        recording = result.recording
        self._summary, self._recording, self._robot = summary, recording, robot
        left, top, width, height = _NETWORK
        self._at = (left * _FINE, top * _FINE)
        graph = recording.circuit
        self._lit = None if graph is None else LitNetwork(graph, width * _FINE, height * _FINE)
        self._peaks = np.nanmax(np.abs(recording.trace[:, robot]), axis=0, initial=0.0)
        self._peaks = np.maximum(self._peaks, 1.0)
        names = (*recording.observation_names, *recording.command_names)
        values = np.concatenate([recording.observations[:, robot], recording.commands[:, robot]], axis=1)
        self._shown = dict(zip(names, values.T, strict=True))
        units = channels_of_interest([result])
        self._units = {name: shown_unit(self._shown[name], units[name]) for name in names if name in units}
        wanted = () if graph is None else tuple(each.name for each in graph.inputs)
        chosen = [name for name in recording.observation_names or wanted if name in units][: _MOST_ROWS - 1]
        chosen += recording.command_names[:1]
        chosen += [name for name in units if name not in chosen]
        self._rows = [
            _Row(name, units[name], values_of(result, name)) for name in chosen[:_MOST_ROWS] if name in units
        ]
        self._places = {} if self._lit is None else self._room_below(self._lit.boxes)
        self._title = _title(result)

    def _room_below(
        self, boxes: Mapping[str, tuple[float, float, float, float]]
    ) -> dict[str, tuple[float, float]]:
        """Where values stand: below each box of a side, if all of them have room; [pixels]."""
        half = self._lit.width / 2 if self._lit is not None else 0.0
        places = {}
        for right in (False, True):  # inputs stand on the left, outputs on the right
            side = [name for name, box in boxes.items() if (box[0] > half) == right and name in self._units]
            side.sort(key=lambda name: boxes[name][1])
            if any(boxes[b][1] - boxes[a][3] < _SMALL_TEXT * _FINE for a, b in pairwise(side)):
                continue
            for name in side:
                x0, _, x1, y1 = boxes[name]
                places[name] = ((self._at[0] + (x0 + x1) / 2) / _FINE, (self._at[1] + y1) / _FINE + 5)
        return places

    def picture(self, tick: int) -> Image.Image:
        """The panel after a tick."""
        from PIL import Image, ImageDraw  # an extra

        image = Image.new("RGB", (PANEL_WIDTH * _FINE, PANEL_HEIGHT * _FINE), PAPER)
        pen = ImageDraw.Draw(image)
        _write(pen, (_NETWORK[0], 12.0), self._title, _TEXT, anchor="lm", bold=True)
        if self._lit is not None:
            trace = self._recording.trace[tick, self._robot] / self._peaks
            activity = dict(zip(self._recording.trace_names, map(float, trace), strict=True))
            image.paste(Image.fromarray(self._lit.picture(activity)), self._at)
            self._write_values(pen, tick)
        self._paint_chart(pen, tick)
        return image.reduce(_FINE)

    def _write_values(self, pen: ImageDraw.ImageDraw, tick: int) -> None:
        """The value of every input and output below its box, where there is room."""
        for name, (x, y) in self._places.items():
            text = _valued(float(self._shown[name][tick]), *self._units[name])
            colour = _RED if text == "missing" else INK
            half = pen.textlength(text, font=font(_SMALL_TEXT * _FINE, bold=True)) / (2 * _FINE)
            at = (min(max(x, half + 2), _CHART[0] - half - 4), y)
            _write(pen, at, text, _SMALL_TEXT, anchor="mm", bold=True, fill=colour)

    def _paint_chart(self, pen: ImageDraw.ImageDraw, tick: int) -> None:
        """Some channels over the last moments, the newest on the right."""
        if not self._rows:
            return
        left, top, right, bottom = _CHART
        height = (bottom - top) / len(self._rows)
        step_s = self._summary.step_s
        first = max(tick - round(_SHOWN_S / step_s), 0)
        scale = (right - left) / _SHOWN_S
        for i, row in enumerate(self._rows):
            low, high = top + i * height + 15, top + (i + 1) * height - 3
            pen.line([_fine(left, high), _fine(right, high)], fill=GREY, width=1)
            _write(pen, (left, low - 8), row.name, _SMALL_TEXT, anchor="lm", bold=True)
            text = _valued(float(row.values[tick]), *row.unit)
            _write(pen, (right, low - 8), text, _SMALL_TEXT, anchor="rm")
            for push in self._summary.pushes:
                begin, end = (right - (tick * step_s - t) * scale for t in (push.start_s, push.end_s))
                if begin < right and end > left:
                    pen.rectangle(
                        [_fine(max(begin, left), low), _fine(min(end, right), high)], fill="#f8e3b0"
                    )
            xs = right - (tick - np.arange(first, tick + 1)) * step_s * scale
            ys = high - (row.values[first : tick + 1] - row.low) / (row.high - row.low) * (high - low)
            points = [_fine(x, y) for x, y in zip(xs, ys, strict=True) if np.isfinite(y)]
            if len(points) > 1:
                pen.line(points, fill=CYCLE[i % len(CYCLE)], width=2 * _FINE)


class _Row:
    """A channel in the chart."""

    def __init__(self, name: str, unit: Unit, values: Array) -> None:
        self.name, self.unit, self.values = name, shown_unit(values, unit), values
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
        margin = 0.05 * (high - low) or 1.0
        self.low, self.high = low - margin, high + margin


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
