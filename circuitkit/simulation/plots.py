"""Plots of runs of any robot: channels, neurons and commands over time, the path from above, a comparison."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Unit, parse_unit
from circuitkit.control import Array
from circuitkit.draw.style import (
    CYCLE,
    GREY,
    INK,
    NORMAL,
    PALE,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
    save_figure,
    tidy,
)
from circuitkit.draw.traces import Activity, Line, Panel, Span, traces_figure
from circuitkit.robots.mobile_base import MobileBase
from circuitkit.simulation.result import Result, RunSummary, summarise

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FEWEST_TICKS = 2  # with fewer there is no line to draw
_LEAST_WAY_M = 0.05  # a base that moves less has no path
_MOST_LINES = 6  # in one panel
_MOST_PANELS = 12
_MOST_COMPARED = 8  # panels of a comparison
_HIGH_IN, _LOW_IN = 1.6, 1.0  # of a panel of a comparison: of up to four, of more
_FEW = 4
_SHOWN_IN = {"m": "mm", "m/s": "mm/s"}  # where the values are small
_SMALL = 0.3  # up to which values are
# What an axis spans at least, [SI]: less is of no account, and rounding errors would fill a panel.
_LEAST_SPAN = {
    parse_unit(unit).dimension: span
    for unit, span in (
        ("m", 1e-3), ("m/s", 1e-3), ("rad", 2e-3), ("rad/s", 2e-3), ("N", 1e-2), ("N*m", 1e-3), ("1", 1e-3),
    )
}  # fmt: skip
_PATH_IN = 4.2  # longer side of the picture of a path
_NARROWEST = 0.45  # shorter side of it, at least, as a share of the longer one
_BOX = int(mujoco.mjtGeom.mjGEOM_BOX)
_ROUND = frozenset(
    map(int, (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE))
)
_SQUARE = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
_NUMBERS = re.compile(r"(\d+)")


def draw_result(result: Result, folder: Path) -> None:
    """Write the plots of a run; of one that was stopped at once nothing.

    These are `channels.png`, `neurons.png` where the controller has some, `path.png` of a robot that goes
    somewhere, and what the blocks of the robot's file add.

    Raises:
        OutputError: A file cannot be written.
    """
    if result.recording.ticks < _FEWEST_TICKS:
        return
    summary = summarise(result)
    for name, figure in result_figures(result, summary).items():
        save_figure(figure, folder / f"{name}.png")


def result_figures(result: Result, summary: RunSummary) -> dict[str, Figure]:
    """The plots of a run by the name of their file."""
    found = {}
    if panels := _panels(result):
        found["channels"] = traces_figure(_time(result), panels, None, _spans(summary), _headline(summary))
    if result.recording.trace_names:
        found["neurons"] = neuron_figure(result, summary)
    if (path := path_figure([result])) is not None:
        found["path"] = path
    for block in result.recording.robot.blocks.values():
        found |= getattr(block, "figures", lambda *_: {})(result, summary)
    return found


def draw_comparison(results: Sequence[Result], folder: Path) -> None:
    """Write `compare.png`: what the controllers read and wrote, and `path.png` of robots that move.

    Raises:
        OutputError: A file cannot be written.
    """
    drawable = [result for result in results if result.recording.ticks >= _FEWEST_TICKS]
    if not drawable:
        return
    save_figure(comparison_figure(drawable), folder / "compare.png")
    if (path := path_figure(drawable)) is not None:
        save_figure(path, folder / "path.png")


def comparison_figure(results: Sequence[Result]) -> Figure:
    """The channels that are read or measured, a panel each, with a curve for every controller."""
    for block in results[0].recording.robot.blocks.values():
        if (drawn := getattr(block, "comparison", lambda _: None)(results)) is not None:
            figure: Figure = drawn
            return figure
    longest = max(results, key=lambda result: len(_time(result)))
    time = _time(longest)
    chosen = list(channels_of_interest(results).items())[:_MOST_COMPARED]
    height = _HIGH_IN if len(chosen) <= _FEW else _LOW_IN
    panels = []
    for number, (name, unit) in enumerate(chosen):
        curves = [_shown(result, name) for result in results]
        scale, shown = shown_unit(np.concatenate(curves), unit)
        # The first is broad and behind, the last thin and in front: both are seen where they agree.
        lines = [
            Line("" if number else result.recording.controller, _padded(curve, len(time)) / scale,
                 CYCLE[i % len(CYCLE)], "-", max(2.2 - 0.9 * i, 0.7))
            for i, (result, curve) in enumerate(zip(results, curves, strict=True))
        ]  # fmt: skip
        panels.append(_panel(name, (scale, shown), unit, lines, height))
    words = "; ".join(f"{result.recording.controller}: {result.outcome}" for result in results)
    summary = summarise(longest)
    return traces_figure(time, panels, None, _spans(summary), f"{summary.scenario}   {words}")


def neuron_figure(result: Result, summary: RunSummary) -> Figure:
    """Every neuron's output over time as a raster; above, what the circuit commands."""
    recording = result.recording
    roles: dict[str, str] = {}
    if recording.circuit is not None:
        roles = {neuron.name: neuron.role for neuron in recording.circuit.neurons}
        for population in recording.circuit.populations:
            roles |= {f"{population.name}[{i}]": population.role for i in range(population.size)}
    ticks = len(_time(result))
    trace = np.abs(recording.trace[:ticks, 0])
    activity = Activity(recording.trace_names, trace, roles, _darkest(recording.trace_names, trace))
    panels = _command_panels(result)
    return traces_figure(_time(result), panels, activity, _spans(summary), _headline(summary))


def _darkest(names: Sequence[str], trace: Array) -> float | list[float]:
    """Output that is shown darkest: 1, or where some is larger the largest of each neuron or population."""
    largest = np.nanmax(trace, axis=0, initial=0.0)
    if largest.max(initial=0.0) <= 1:
        return 1.0
    groups: dict[str, float] = {}
    for name, value in zip(names, largest, strict=True):
        whole = name.partition("[")[0]
        groups[whole] = max(groups.get(whole, 0.0), float(value))
    return [groups[name.partition("[")[0]] or 1.0 for name in names]


def path_figure(results: Sequence[Result]) -> Figure | None:
    """The way of each robot from above, among what stands around; None if none of them moves."""
    ways = [_way(result) for result in results]
    if all(way is None or np.ptp(way, axis=0).max() < _LEAST_WAY_M for way in ways):
        return None
    with house_style():
        low, high = _extent(results[0], ways)
        size = (high - low) * (_PATH_IN / (high - low).max())
        above = 0.35 + 0.18 * len(results)
        figure = new_figure(size[0] + 1.0, size[1] + above + 0.55)
        axes = axes_at(figure, 0.75, above, *size)
        tidy(axes)
        draw_paths(axes, results)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set(xlabel="x [m]   (circle: start, square: end)", ylabel="y [m]")
        plain_legend(axes, "lower left", (0.0, 1.0), borderaxespad=0.2)
        width, height = figure.get_size_inches()
        figure.text(0.1 / width, 1 - 0.1 / height, results[0].scenario.scenario, va="top", fontsize=NORMAL)
    return figure


def draw_paths(axes: Axes, results: Sequence[Result]) -> None:
    """The way of each robot from above, from its circle to its square, among what stands around."""
    _surroundings(axes, results[0])
    for i, result in enumerate(results):
        if (way := _way(result)) is not None:
            colour = INK if len(results) == 1 else CYCLE[i % len(CYCLE)]
            label = f"{result.recording.controller}: {result.outcome}"
            width = 1.3 if len(results) == 1 else max(2.2 - 0.9 * i, 0.7)
            axes.plot(*way.T, color=colour, linewidth=width, label=label)
            axes.plot(*way[0], "o", color=colour, markersize=6)
            axes.plot(*way[-1], "s", color=colour, markersize=6)


def _extent(result: Result, ways: Sequence[Array | None]) -> tuple[Array, Array]:
    """Corners of a picture from above: the ways, what stands around, and a margin; not too narrow."""
    seen = [way for way in ways if way is not None] + list(_outlines(result))
    points = np.concatenate(seen)
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    half = np.maximum(half, _NARROWEST * half.max()) + 0.04 * half.max()
    return middle - half, middle + half


def _time(result: Result) -> Array:
    """Its ticks, up to a moment after its end: later a robot may do anything."""
    summary = summarise(result)
    return summary.time_s[summary.time_s <= summary.end_s + 0.5 * summary.step_s]


def _headline(summary: RunSummary) -> str:
    return f"{summary.scenario}   {summary.title}"


def _label(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} [{unit}]"


def _natural(name: str) -> list[str | int]:
    """For sorting: `bend_2` before `bend_10`."""
    return [int(part) if i % 2 else part for i, part in enumerate(_NUMBERS.split(name))]


def _spans(summary: RunSummary) -> list[Span]:
    spans = [Span(push.start_s, push.end_s, push.text) for push in summary.pushes]
    spans += [Span(begin, max(end, begin + summary.step_s), text) for text, begin, end in summary.spans]
    if summary.ended_s is not None:
        spans.append(Span(summary.ended_s, summary.end_s, summary.ending, over=True))
    return spans


def _panels(result: Result) -> list[Panel]:
    """What the controller read and what was measured, by unit; and what it wrote."""
    groups: dict[str, list[tuple[str, Unit]]] = {}
    commands = set(result.recording.command_names)
    for name, unit in channels_of_interest([result]).items():
        if name not in commands:
            groups.setdefault(unit.dimension.si_symbol, []).append((name, unit))
    panels = []
    for group in groups.values():
        group.sort(key=lambda each: _natural(each[0]))
        for start in range(0, len(group), _MOST_LINES):
            part = group[start : start + _MOST_LINES]
            values = {name: _shown(result, name) for name, _ in part}
            scale, shown = shown_unit(np.concatenate(list(values.values())), part[0][1])
            lines = [Line(name, array / scale) for name, array in values.items()]
            one = part[0][0] if len(part) == 1 else "channels"
            lines = lines if len(part) > 1 else [Line("", lines[0].values)]
            panels.append(_panel(one, (scale, shown), part[0][1], lines))
    return [*panels, *_command_panels(result)][:_MOST_PANELS]


def _command_panels(result: Result) -> list[Panel]:
    recording = result.recording
    panels = []
    groups: dict[str, list[str]] = {}
    for name in recording.command_names:
        groups.setdefault(recording.robot.commands[name].unit.symbol, []).append(name)
    for names in groups.values():
        for start in range(0, len(names), _MOST_LINES):
            part = names[start : start + _MOST_LINES]
            values = [_shown(result, name) for name in part]
            unit = recording.robot.commands[part[0]].unit
            scale, shown = shown_unit(np.concatenate(values), unit)
            many = len(part) > 1
            pairs = zip(part, values, strict=True)
            lines = [Line(name if many else "", each / scale) for name, each in pairs]
            panels.append(_panel("commands" if many else part[0], (scale, shown), unit, lines, 1.1))
    return panels


def _panel(
    name: str, shown_in: tuple[float, str], unit: Unit, lines: Sequence[Line], height: float = _HIGH_IN
) -> Panel:
    """A panel of curves that are in a unit as `shown_unit` gives it."""
    scale, symbol = shown_in
    return Panel(_label(name, symbol), lines, (), height, least_span(unit) / scale)


def least_span(unit: Unit) -> float:
    """What an axis for values of a unit spans at least, [SI]."""
    return _LEAST_SPAN.get(unit.dimension, 0.0)


def channels_of_interest(results: Sequence[Result]) -> dict[str, Unit]:
    """Channels that a controller reads or a measure needs, and commands, with their units."""
    recording = results[0].recording
    units = {name: planned.unit for name, planned in recording.motion.planned.items()}
    units |= recording.robot.channel_units | recording.robot.command_units
    names: dict[str, None] = {}
    for result in results:
        names |= dict.fromkeys(result.recording.observation_names)
    names |= dict.fromkeys(recording.judge.channels)
    for result in results:
        names |= dict.fromkeys(result.recording.command_names)
    return {name: units[name] for name in names if name in units}


def values_of(result: Result, name: str) -> Array:
    """A channel or a command of the first robot; shape (T,), SI unit; not a number where it has neither."""
    recording = result.recording
    if name in recording.command_names:
        return recording.command(name)[:, 0]
    if name in recording.robot.channels or name in recording.motion.planned:
        return recording.channel(name)[:, 0]
    return np.full(recording.ticks, np.nan)


def _shown(result: Result, name: str) -> Array:
    """The same up to a moment after its end."""
    return values_of(result, name)[: len(_time(result))]


def _padded(values: Array, ticks: int) -> Array:
    return np.concatenate([values, np.full(ticks - len(values), np.nan)])


def shown_unit(values: Array, unit: Unit) -> tuple[float, str]:
    """A unit in which values are easy to read: its own, angles in degrees, small lengths in millimetres."""
    symbol = unit.dimension.si_symbol
    if unit.symbol != symbol:
        return float(unit.scale), unit.symbol
    small = float(np.nanmax(np.abs(values), initial=0.0)) < _SMALL
    wanted = "deg" if symbol == "rad" else _SHOWN_IN.get(symbol) if small else None
    if wanted is None:
        return 1.0, symbol
    shown = parse_unit(wanted)
    return float(shown.scale), shown.symbol


def _way(result: Result) -> Array | None:
    """Where the robot's base went, forward and left, as far as that is known; shape (T, 2).

    None of a robot that cannot go about, or of which it is never known.
    """
    base = MobileBase(result.recording.robot)
    if base.places.keys() != {0, 1}:
        return None
    positions = result.recording.qpos[: len(_time(result)), 0]
    way: Array = positions[:, [base.places[0], base.places[1]]] * [base.signs[0], base.signs[1]]
    known: Array = way[np.isfinite(way).all(axis=1)]
    return known if len(known) else None


def _obstacles(result: Result) -> Iterator[tuple[int, Array, Array]]:
    """What stands still in the world and can be touched: its number, centre and rotation."""
    model = result.recording.robot.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    touched = (model.geom_contype | model.geom_conaffinity) != 0
    for geom in np.flatnonzero((model.body_weldid[model.geom_bodyid] == 0) & touched):
        yield int(geom), data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)


def _outlines(result: Result) -> Iterator[Array]:
    """Corners, from above, of what stands in the world; shape (4, 2)."""
    model = result.recording.robot.model
    for geom, centre, turned in _obstacles(result):
        half: NDArray[np.float64] = np.array(model.geom_size[geom])
        if int(model.geom_type[geom]) in _ROUND:
            half = np.repeat(half[0], 3)
        if int(model.geom_type[geom]) in _ROUND | {_BOX}:
            yield (centre + (_SQUARE * half) @ turned.T)[:, :2]


def _surroundings(axes: Axes, result: Result) -> None:
    """Outlines of what stands in the world: boxes, cylinders, spheres."""
    from matplotlib.patches import Circle, Polygon  # brings matplotlib

    model = result.recording.robot.model
    style: Any = {"facecolor": PALE, "edgecolor": GREY, "linewidth": 0.8, "zorder": 0.5}
    for geom, centre, turned in _obstacles(result):
        if int(model.geom_type[geom]) == _BOX:
            corners = centre + (_SQUARE * model.geom_size[geom]) @ turned.T
            axes.add_patch(Polygon(corners[:, :2], closed=True, **style))
        elif int(model.geom_type[geom]) in _ROUND:
            axes.add_patch(Circle((centre[0], centre[1]), model.geom_size[geom, 0], **style))
