"""What stands below the robot in a film: the circuit with its active neurons, and the ZMP and the soles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Unit
from circuitkit.circuit import CircuitGraph
from circuitkit.draw.layers import Layers, make_layers
from circuitkit.draw.network import make_network
from circuitkit.draw.style import GREY, INK, KIND_COLOUR, PALE, PAPER, ROLE_FILL, number
from circuitkit.simulation.story import MM, Story, support_edges_m

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

    from circuitkit.simulation.run import Result

    Font = ImageFont.FreeTypeFont

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

PANEL_WIDTH, PANEL_HEIGHT = 640, 200

_FINE = 2  # drawn so much larger and then reduced
_NETWORK = (10.0, 26.0, 410.0, 192.0)  # left, top, right, bottom, [pixels]
_CHART = (432.0, 26.0, 630.0, 140.0)
_SOLES = (143.0, 163.0)  # top and bottom
_BOX_WIDTH, _BOX_HEIGHT, _RADIUS = 92.0, 30.0, 11.5
_TEXT, _SMALL_TEXT = 11.0, 9.5
_RED, _BAND, _LOADED = "#c8201a", "#dcdcdc", "#8a8a8a"
_PIXELS_PER_S = 57.0  # two seconds fill the chart
_SHOWN_HALF_MM = 125.0
_CORNER = 0.41421356  # tangent of 22.5 degrees: where an octagon is cut


def rgb(colour: str) -> Colour:
    """`#rrggbb` as numbers."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def mixed(one: str, other: str, share: float) -> Colour:
    """A colour between two; 0 is the first one."""
    part = min(max(share, 0.0), 1.0) if np.isfinite(share) else 0.0
    first, second = rgb(one), rgb(other)
    return tuple(round(a + (b - a) * part) for a, b in zip(first, second, strict=True))  # type: ignore[return-value]  # three of them


@lru_cache(maxsize=32)
def font(size: float, *, bold: bool = False) -> Font:
    """DejaVu Sans, which comes with matplotlib; [pixels]."""
    import matplotlib as mpl
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / name), size)


class Panel:
    """Pictures of the circuit and of the ZMP of one robot, tick by tick."""

    def __init__(self, result: Result, story: Story, robot: int = 0) -> None:
        recording = result.recording
        self._story = story
        self._network = _Network(recording.circuit, _NETWORK)
        self._chart = _Chart(result, story)
        places = {name: i for i, name in enumerate(recording.trace_names)}
        self._trace = recording.trace[:, robot]
        self._place = places
        names = (*recording.observation_names, *recording.command_names)
        values = np.concatenate([recording.observations[:, robot], recording.commands[:, robot]], axis=1)
        self._shown = dict(zip(names, values.T, strict=True))
        self._loads = recording.loads_n[:, robot]
        self._still = self._background(bool(places))

    def picture(self, tick: int) -> Image.Image:
        """The panel after a tick."""
        from PIL import ImageDraw

        image = self._still.copy()
        pen = ImageDraw.Draw(image)
        activity = {name: float(self._trace[tick, i]) for name, i in self._place.items()}
        values = {name: float(column[tick]) for name, column in self._shown.items()}
        if activity:
            self._network.light(pen, activity)
        self._network.write(pen, values)
        self._chart.paint(image, pen, tick, self._loads[tick])
        return image.reduce(_FINE)

    def _background(self, active: bool) -> Image.Image:
        from PIL import Image, ImageDraw

        image = Image.new("RGB", (PANEL_WIDTH * _FINE, PANEL_HEIGHT * _FINE), PAPER)
        pen = ImageDraw.Draw(image)
        circuit = self._network.graph.name
        title = f"circuit {circuit}" if active else f"no feedback; the circuit {circuit} is not connected"
        _write(pen, (_NETWORK[0], 13.0), title, _TEXT, anchor="lm", bold=active)
        _write(pen, (_CHART[0], 13.0), "ZMP, last 2 s", _TEXT, anchor="lm", bold=True)
        self._network.light(pen, {})
        return image


class _Network:
    """The circuit in the layers of its drawing: a dot for each neuron, a box for each input and output."""

    def __init__(self, graph: CircuitGraph, area: tuple[float, float, float, float]) -> None:
        self.graph = graph
        self._layers = make_layers(make_network(graph))
        self._at = _places(self._layers, area)
        self._unit: dict[str, Unit] = {node.name: node.unit for node in graph.inputs}
        self._unit |= {node.name: node.unit for node in graph.outputs}
        self._role = {neuron.name: neuron.role for neuron in graph.neurons}
        self._role |= {population.name: population.role for population in graph.populations}
        self._inputs = {node.name for node in graph.inputs}
        self._members = {
            each.name: [f"{each.name}[{i}]" for i in range(each.size)] for each in graph.populations
        }

    def light(self, pen: ImageDraw.ImageDraw, activity: Mapping[str, float]) -> None:
        """Draw lines and dots; the more active a neuron is, the stronger are it and its lines.

        A population is as active as its members are in the mean; more than 1 is shown as 1.
        """
        if activity:
            members = {name: [activity[each] for each in names] for name, names in self._members.items()}
            means = {name: sum(values) / len(values) for name, values in members.items()}
            activity = {name: min(max(value, 0.0), 1.0) for name, value in {**activity, **means}.items()}
        for link in sorted(self._layers.links, key=lambda link: activity.get(link.source, 0.0)):
            share = activity.get(link.source, 0.0)
            start, end = self._at[link.source], self._at[link.target]
            colour = mixed(PALE, KIND_COLOUR[link.kind], share)
            pen.line([_fine(*start), _fine(*end)], fill=colour, width=round(_FINE * (1 + share)))
        for name in self._unit:
            self._box(pen, name)
        for name, role in self._role.items():
            _dot(pen, self._at[name], name, role, activity.get(name, 0.0))

    def _box(self, pen: ImageDraw.ImageDraw, name: str) -> None:
        x, y = self._at[name]
        half = (_BOX_WIDTH / 2, _BOX_HEIGHT / 2)
        corners = [_fine(x - half[0], y - half[1]), _fine(x + half[0], y + half[1])]
        fill = ROLE_FILL["input" if name in self._inputs else "output"]
        pen.rounded_rectangle(corners, radius=4 * _FINE, fill=fill, outline=GREY, width=_FINE)
        shown = _fitting(name, _BOX_WIDTH - 6, _SMALL_TEXT)
        _write(pen, (x, y - 7), shown, _SMALL_TEXT, anchor="mm")

    def write(self, pen: ImageDraw.ImageDraw, values: dict[str, float]) -> None:
        """Write the values of inputs and outputs into their boxes; without one, a dash."""
        for name, unit in self._unit.items():
            value = values.get(name)
            text = "–" if value is None else "missing" if not np.isfinite(value) else _valued(value, unit)
            colour = _RED if text == "missing" else INK
            x, y = self._at[name]
            _write(pen, (x, y + 6), text, _SMALL_TEXT, anchor="mm", bold=True, fill=colour)


class _Chart:
    """The ZMP over the last moments, the newest at the bottom, above the soles as seen from the front."""

    def __init__(self, result: Result, story: Story) -> None:
        self._story = story
        left, top, right, bottom = _CHART
        self._scale = (right - left) / (2 * _SHOWN_HALF_MM)
        self._rows = round((bottom - top) * _FINE)
        self._roll = self._draw_roll()
        edges = support_edges_m(result.recording.robot.spec) * MM
        self._soles = (edges[0], edges[1])

    def paint(self, image: Image.Image, pen: ImageDraw.ImageDraw, tick: int, loads: Array) -> None:
        """Paint the chart after a tick.

        Args:
            image: Takes the roll.
            pen: Of this image.
            tick: The tick.
            loads: On the left and on the right foot, [N].
        """
        story = self._story
        newest = self._row(tick)
        left, top, _, bottom = _CHART
        part = self._roll.crop((0, newest, self._roll.width, newest + self._rows))
        image.paste(part, _fine(left, top))
        total = max(float(loads.sum()), 1e-9)
        for side, name in enumerate(("left foot", "right foot")):
            low, high = (self._x(edge) for edge in self._soles[side])
            share = float(loads[side]) / total
            corners = [_fine(low, _SOLES[0]), _fine(high, _SOLES[1])]
            pen.rounded_rectangle(corners, 5 * _FINE, mixed(PAPER, _LOADED, share), GREY, _FINE)
            _write(pen, ((low + high) / 2, _SOLES[1] + 10), name, _SMALL_TEXT, anchor="mm")
        zmp = story.zmp_mm[tick]
        for line in story.lines_mm[tick]:
            x = self._x(line)
            pen.line([_fine(x, _SOLES[0] - 2), _fine(x, _SOLES[1] + 2)], fill=INK, width=_FINE)
        if np.isfinite(zmp):
            x = self._x(zmp)
            colour = _RED if story.pushed()[tick] else INK
            corners = [_fine(x - 6, bottom + 7), _fine(x + 6, bottom + 19)]
            pen.ellipse(corners, fill=colour, outline=PAPER, width=_FINE)
            text = f"{number(round(float(zmp)) + 0.0)} mm"
            _write(pen, (_CHART[2], 13.0), text, _TEXT, anchor="rm", bold=True, fill=colour)

    def _x(self, y_mm: float) -> float:
        """The robot's left is on the right, for we see it from the front."""
        return (_CHART[0] + _CHART[2]) / 2 + float(y_mm) * self._scale

    def _row(self, tick: int) -> int:
        return round(tick * self._story.step_s * _PIXELS_PER_S * _FINE)

    def _draw_roll(self) -> Image.Image:
        """The whole run from top to bottom; above it, room for the moments before the start."""
        from PIL import Image, ImageDraw

        story = self._story
        last = len(story.time_s) - 1
        size = (round((_CHART[2] - _CHART[0]) * _FINE), self._row(last) + self._rows)
        image = Image.new("RGB", size, PAPER)
        pen = ImageDraw.Draw(image)

        def x(y_mm: float) -> float:
            return (self._x(y_mm) - _CHART[0]) * _FINE

        rows = [self._row(tick) + self._rows for tick in range(last + 1)]
        for tick, row in enumerate(rows):
            before = rows[tick - 1] if tick else row - 1
            pen.rectangle([x(story.band_mm[tick, 0]), before, x(story.band_mm[tick, 1]), row], fill=_BAND)
            if tick % 8 < 4:  # noqa: PLR2004 - half of it, so that the line is dashed
                for line in story.lines_mm[tick]:
                    pen.line([x(line), before, x(line), row], fill=INK, width=_FINE)
        for push in story.pushes:
            moments = (round(moment / story.step_s) for moment in (push.start_s, push.end_s))
            begin, end = (self._row(moment) + self._rows for moment in moments)
            pen.rectangle([0, begin, 5 * _FINE, end], fill=_RED)
            pen.rectangle([image.width - 5 * _FINE, begin, image.width, end], fill=_RED)
        pushed = story.pushed()
        for tick in range(1, last + 1):
            pair = story.zmp_mm[tick - 1 : tick + 1]
            if np.isfinite(pair).all():
                points = [(x(pair[0]), rows[tick - 1]), (x(pair[1]), rows[tick])]
                pen.line(points, fill=_RED if pushed[tick] else INK, width=2 * _FINE)
        return image


def _places(layers: Layers, area: tuple[float, float, float, float]) -> dict[str, tuple[float, float]]:
    """Where the nodes stand: the columns of the drawing, each spread over the height."""
    left, top, right, bottom = area
    count = len(layers.order)
    begin, end = left + _BOX_WIDTH / 2, right - _BOX_WIDTH / 2
    inner = (begin + _BOX_WIDTH / 2 + 24, end - _BOX_WIDTH / 2 - 24)
    places = {}
    for column, items in enumerate(layers.order):
        names = [item for item in items if isinstance(item, str)]
        if column in (0, count - 1):
            x = begin if column == 0 else end
        else:
            x = inner[0] + (inner[1] - inner[0]) * (column - 1) / max(count - 3, 1)
        for row, name in enumerate(names):
            places[name] = (x, top + (bottom - top) * (row + 0.5) / len(names))
    return places


def _dot(pen: ImageDraw.ImageDraw, at: tuple[float, float], name: str, role: str, share: float) -> None:
    """A neuron: a circle if it excites, an octagon if it inhibits, as in the drawing."""
    fill = mixed(PAPER, KIND_COLOUR[role], share)
    outline = KIND_COLOUR[role]
    if role == "excitatory":
        corners = [_fine(at[0] - _RADIUS, at[1] - _RADIUS), _fine(at[0] + _RADIUS, at[1] + _RADIUS)]
        pen.ellipse(corners, fill=fill, outline=outline, width=round(1.5 * _FINE))
    else:
        corners = [_fine(*point) for point in _octagon(at)]
        pen.polygon(corners, fill=fill, outline=outline, width=round(1.5 * _FINE))
    inside = font(_TEXT).getlength(name) < 2 * _RADIUS - 2
    colour = PAPER if inside and share > 0.6 else INK  # noqa: PLR2004 - white on strong colours
    place = at if inside else (at[0], at[1] + _RADIUS + 6)
    size = _TEXT if inside else _SMALL_TEXT
    _write(pen, place, _fitting(name, 70.0, size), size, anchor="mm", bold=inside, fill=colour)


def _octagon(at: tuple[float, float]) -> Sequence[tuple[float, float]]:
    r, c = _RADIUS, _RADIUS * _CORNER
    turns = ((r, c), (c, r), (-c, r), (-r, c), (-r, -c), (-c, -r), (c, -r), (r, -c))
    return [(at[0] + dx, at[1] + dy) for dx, dy in turns]


def _valued(value: float, unit: Unit) -> str:
    """A value in its unit, with as many digits as one can follow in a film."""
    digits = 2 if unit.symbol == "1" else 1
    text = f"{round(value / unit.scale, digits) + 0.0:.{digits}f}"  # no negative zero
    return text.replace("-", "\N{MINUS SIGN}") + ("" if unit.symbol == "1" else f" {unit.symbol}")


def _fitting(text: str, width: float, size: float) -> str:
    """A text cut to a width, [pixels]."""
    if font(size).getlength(text) <= width:
        return text
    while text and font(size).getlength(text + "…") > width:
        text = text[:-1]
    return text + "…"


def _fine(x: float, y: float) -> tuple[int, int]:
    return round(x * _FINE), round(y * _FINE)


def _write(
    pen: ImageDraw.ImageDraw, at: tuple[float, float], text: str, size: float,
    *, anchor: str, bold: bool = False, fill: str | Colour = INK,
) -> None:  # fmt: skip
    pen.text(_fine(*at), text, fill=fill, font=font(size * _FINE, bold=bold), anchor=anchor)
