"""Plots of runs of any robot: channels, neurons and commands over time, the path from above, a comparison."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from circuitkit.base.units import Unit, parse_unit
from circuitkit.control import Array
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    GREY,
    INK,
    NORMAL,
    PALE,
    house_style,
    new_figure,
    save_figure,
    tidy,
)
from circuitkit.draw.traces import Activity, Line, Panel, Span, traces_figure
from circuitkit.simulation.result import Result
from circuitkit.simulation.summary import RunSummary, summarise

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FEWEST_TICKS = 2  # with fewer there is no line to draw
_LEAST_WAY_M = 0.05  # a base that moves less has no path
_MOST_LINES = 6  # in one panel
_MOST_PANELS = 12
_SHOWN_IN = {"rad": "deg", "rad/s": "deg/s", "m": "mm", "m/s": "mm/s"}  # where the values are small


def draw_result(result: Result, folder: Path) -> None:
    """Write `channels.png`, `neurons.png` where the controller has some, `path.png` of a robot that goes somewhere,
    and what the blocks of the robot's file add.

    Of a run that was stopped at once nothing is drawn.

    Raises:
        OutputError: A file cannot be written.
    """  # noqa: D205 - the summary is a list
    if result.recording.ticks < _FEWEST_TICKS:
        return
    summary = summarise(result)
    for name, figure in result_figures(result, summary).items():
        save_figure(figure, folder / f"{name}.png")


def result_figures(result: Result, summary: RunSummary) -> dict[str, Figure]:
    """The plots of a run by the name of their file."""
    found = {}
    if panels := _panels(result):
        found["channels"] = _titled(traces_figure(result.recording.time_s, panels, None, _spans(summary)), summary)
    if result.recording.trace_names:
        found["neurons"] = neuron_figure(result, summary)
    if (path := path_figure([result])) is not None:
        found["path"] = path
    for block in result.recording.robot.blocks.values():
        found |= getattr(block, "figures", lambda *_: {})(result, summary)
    return found


def draw_comparison(results: Sequence[Result], folder: Path) -> None:
    """Write `compare.png`: what the controllers read and wrote side by side; and `path.png` of robots that move.

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
    longest = max(results, key=lambda result: result.recording.ticks)
    panels = []
    for name, unit in channels_of_interest(results).items():
        scale, shown = shown_unit(np.concatenate([values_of(r, name) for r in results]), unit)
        lines = [
            Line(result.recording.controller, _padded(values_of(result, name) / scale, longest), CYCLE[i % len(CYCLE)],
                 DASHES[i % len(DASHES)])
            for i, result in enumerate(results)
        ]  # fmt: skip
        panels.append(Panel(f"{name} [{shown}]", lines))
    summary = summarise(longest)
    figure = traces_figure(longest.recording.time_s, panels[:_MOST_PANELS], None, _spans(summary))
    words = "; ".join(f"{result.recording.controller}: {result.outcome}" for result in results)
    figure.suptitle(f"{summary.scenario}: {words}", fontsize=NORMAL, y=0.995)
    return figure


def neuron_figure(result: Result, summary: RunSummary) -> Figure:
    """Every neuron's output over time as a raster; above, what the circuit commands."""
    recording = result.recording
    roles: dict[str, str] = {}
    if recording.circuit is not None:
        roles = {neuron.name: neuron.role for neuron in recording.circuit.neurons}
        for population in recording.circuit.populations:
            roles |= {f"{population.name}[{i}]": population.role for i in range(population.size)}
    trace = recording.trace[:, 0]
    full = float(np.nanmax(np.abs(trace), initial=0.0)) or 1.0
    activity = Activity(recording.trace_names, np.abs(trace), roles, full)
    panels = _command_panels(result)
    return _titled(traces_figure(recording.time_s, panels, activity, _spans(summary)), summary)


def path_figure(results: Sequence[Result]) -> Figure | None:
    """The way of each robot from above, among what stands around; None if none of them moves."""
    ways = [_way(result) for result in results]
    if all(way is None or np.ptp(way, axis=0).max() < _LEAST_WAY_M for way in ways):
        return None
    with house_style():
        figure = new_figure(5.2, 5.0)
        axes = figure.add_axes((0.13, 0.11, 0.82, 0.8))
        tidy(axes)
        _surroundings(axes, results[0])
        for i, (result, way) in enumerate(zip(results, ways, strict=True)):
            if way is not None:
                colour = INK if len(results) == 1 else CYCLE[i % len(CYCLE)]
                label = f"{result.recording.controller}: {result.outcome}"
                axes.plot(*way.T, color=colour, linestyle=DASHES[i % len(DASHES)], linewidth=1.3, label=label)
                axes.plot(*way[0], "o", color=colour, markersize=6)
                axes.plot(*way[-1], "s", color=colour, markersize=6)
        axes.set(xlabel="x [m]   (circle: start, square: end)", ylabel="y [m]", aspect="equal")
        axes.margins(0.08)
        axes.set_title(results[0].scenario.scenario)
        axes.legend(loc="best", frameon=True, framealpha=0.9, edgecolor="none")
    return figure


def _titled(figure: Figure, summary: RunSummary) -> Figure:
    figure.suptitle(f"{summary.scenario}, {summary.title}", fontsize=NORMAL, x=0.02, y=0.995, ha="left")
    return figure


def _spans(summary: RunSummary) -> list[Span]:
    spans = [Span(push.start_s, push.end_s, push.text) for push in summary.pushes]
    spans += [Span(begin, max(end, begin + summary.step_s), text) for text, begin, end in summary.spans]
    if summary.ended_s is not None:
        spans.append(Span(summary.ended_s, float(summary.time_s[-1]), "ended"))
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
        for start in range(0, len(group), _MOST_LINES):
            part = group[start : start + _MOST_LINES]
            values = {name: values_of(result, name) for name, _ in part}
            scale, shown = shown_unit(np.concatenate(list(values.values())), part[0][1])
            lines = [Line(name, array / scale) for name, array in values.items()]
            one = part[0][0] if len(part) == 1 else "channels"
            panels.append(Panel(f"{one} [{shown}]", lines if len(part) > 1 else [Line("", lines[0].values)]))
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
            unit = recording.robot.commands[part[0]].unit
            lines = [Line(name if len(part) > 1 else "", values_of(result, name) / unit.scale) for name in part]
            label = part[0] if len(part) == 1 else "commands"
            panels.append(Panel(f"{label} [{unit}]", lines, height=1.1))
    return panels


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
    recording = result.recording
    if name in recording.command_names:
        return recording.command(name)[:, 0]
    if name in recording.robot.channels or name in recording.motion.planned:
        return recording.channel(name)[:, 0]
    return np.full(recording.ticks, np.nan)


def _padded(values: Array, longest: Result) -> Array:
    return np.concatenate([values, np.full(longest.recording.ticks - len(values), np.nan)])


def shown_unit(values: Array, unit: Unit) -> tuple[float, str]:
    """A unit in which values are easy to read: angles in degrees, small lengths in millimetres."""
    symbol = unit.dimension.si_symbol
    small = float(np.nanmax(np.abs(values), initial=0.0)) < 1
    if unit.symbol != symbol:
        return float(unit.scale), unit.symbol
    if symbol in _SHOWN_IN and (small or symbol.startswith("rad")):
        shown = parse_unit(_SHOWN_IN[symbol])
        return float(shown.scale), shown.symbol
    return 1.0, symbol


def _way(result: Result) -> Array | None:
    """Where the robot's base went, forward and left; shape (T, 2)."""
    recording = result.recording
    model = recording.robot.model
    if recording.robot.base is not None:
        place = int(model.jnt_qposadr[recording.robot.base])
        return recording.qpos[:, 0, place : place + 2]
    places: dict[int, int] = {}
    for joint in range(model.njnt):
        on_ground = int(model.body_parentid[model.jnt_bodyid[joint]]) == 0
        axis = np.abs(model.jnt_axis[joint])
        if on_ground and int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE) and axis[:2].max() > 0.9:  # noqa: PLR2004 - along x or y
            places[int(axis[:2].argmax())] = int(model.jnt_qposadr[joint])
    if not places:
        return None
    columns = [recording.qpos[:, 0, places[axis]] if axis in places else np.zeros(recording.ticks) for axis in (0, 1)]
    return np.column_stack(columns)


def _surroundings(axes: Axes, result: Result) -> None:
    """Outlines of what stands still in the world: boxes, cylinders, spheres."""
    from matplotlib.patches import Circle, Polygon  # only plots need it

    model = result.recording.robot.model
    kinds = mujoco.mjtGeom
    style: Any = {"facecolor": PALE, "edgecolor": GREY, "linewidth": 0.8, "zorder": 0.5}
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0):
        kind, centre = int(model.geom_type[geom]), data.geom_xpos[geom]
        if kind == int(kinds.mjGEOM_BOX):
            half = model.geom_size[geom]
            corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]) * half
            around = centre + corners @ data.geom_xmat[geom].reshape(3, 3).T
            axes.add_patch(Polygon(around[:, :2], closed=True, **style))
        elif kind in {int(kinds.mjGEOM_CYLINDER), int(kinds.mjGEOM_SPHERE), int(kinds.mjGEOM_CAPSULE)}:
            axes.add_patch(Circle((centre[0], centre[1]), model.geom_size[geom, 0], **style))
