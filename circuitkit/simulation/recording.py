"""What a simulation leaves: every tick of every robot, and what follows from it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import MissingDependencyError, UnknownNameError
from circuitkit.base.files import replacing
from circuitkit.base.netcdf import write_netcdf
from circuitkit.base.tables import csv_lines
from circuitkit.base.units import Unit, parse_unit
from circuitkit.circuit import CircuitGraph
from circuitkit.circuit.expressions.dimensions import named_symbol
from circuitkit.control import Array
from circuitkit.robots import Observer, RobotModel, TickLog
from circuitkit.robots.mjcf import HINGE, SLIDE
from circuitkit.simulation.disturbance import RunSpec
from circuitkit.simulation.effects import Effects
from circuitkit.simulation.formulas import Value
from circuitkit.simulation.measures import Judge
from circuitkit.simulation.reference import Motion

_NO_WORD = re.compile(r"\W+")


@dataclass(frozen=True, eq=False)
class Recording:
    """T ticks of B robots; row t is the end of tick t.

    Sensors are those of the beginning of the last time step of a tick, since MuJoCo works them out before it
    moves: readings, and channels, are one time step of the model older than positions in the same row.

    Attributes:
        robot: What they are, as simulated.
        motion: What the reference wanted.
        specs: What was special to each.
        effects: What befell them.
        controller: Name of the controller.
        circuit: The circuit, in use or not; None without one.
        step_s: The control step.
        judge: How they were judged.
        readings: True sensor readings, one time step before the end of the tick; shape (T, B, s).
        qpos: Positions at the end of the tick; shape (T, B, nq).
        observations: What the controller read at the start of the tick, by channel; shape (T, B, k).
        commands: What reached the robot of what it wrote, by command: after delays, before limits, and where
            none came what was sent for it; shape (T, B, m).
        trace: What it recorded of itself; shape (T, B, n).
        observation_names: The k channels.
        command_names: The m commands.
        trace_names: The n names.
        measures: The measures of each robot.
        end_tick: In which tick `until` ended it, or it became invalid; -1 if neither; shape (B,).
        interrupted: Whether the run was stopped before its end.
        invalid: When and why a robot's run became invalid, which ended it; None where it did not. Its rows
            after that are no numbers.
        warnings: How often MuJoCo warned of each robot, by kind.
        cut: When a command was cut to its limits or rate, or a control to its range, by name.
        held: When no command came and the last one was sent again, by command.
        replaced: When no command came and the fallback took its place, by command.
    """

    robot: RobotModel
    motion: Motion
    specs: tuple[RunSpec, ...]
    effects: Effects
    controller: str
    circuit: CircuitGraph | None
    step_s: float
    judge: Judge
    readings: Array
    qpos: Array
    observations: Array
    commands: Array
    trace: Array
    observation_names: tuple[str, ...]
    command_names: tuple[str, ...]
    trace_names: tuple[str, ...]
    measures: tuple[Mapping[str, Value], ...]
    end_tick: NDArray[np.int64]
    interrupted: bool = False
    invalid: tuple[str | None, ...] = (None,)
    warnings: tuple[Mapping[str, int], ...] = ({},)
    cut: TickLog = field(default_factory=TickLog)
    held: TickLog = field(default_factory=TickLog)
    replaced: TickLog = field(default_factory=TickLog)

    @property
    def ticks(self) -> int:
        """T."""
        return len(self.readings)

    @cached_property
    def time_s(self) -> Array:
        """End of each tick; shape (T,)."""
        return np.arange(1.0, self.ticks + 1) * self.step_s

    def ended_s(self, robot: int = 0) -> float | None:
        """When `until` ended a robot's run, or it became invalid; None if neither."""
        tick = int(self.end_tick[robot])
        return None if tick < 0 else (tick + 1) * self.step_s

    def channel(self, name: str) -> Array:
        """A channel without noise, of the robot or of its reference; shape (T, B), SI unit.

        One of the robot is one time step of MuJoCo older than the end of the tick.

        Raises:
            UnknownNameError: There is no such channel; lists those there are.
        """
        if name in self.motion.planned:
            values = self.motion.planned[name].values[: self.ticks, np.newaxis]
            return np.broadcast_to(values, self.readings.shape[:2])
        return Observer(self.robot.channels, [name])(self.readings)[..., 0]

    def command(self, name: str) -> Array:
        """What the controller wrote, as it reached the robot after delays; shape (T, B), SI unit.

        A command that a disturbance delays by n ticks was written n ticks earlier: `command(name)[n:]`. The
        first n rows are the first command.

        Raises:
            UnknownNameError: It writes no such command; lists those that it writes.
        """
        if name not in self.command_names:
            kind = "command of the controller"
            raise UnknownNameError(kind, name, self.command_names)
        return self.commands[..., self.command_names.index(name)]

    @cached_property
    def joints(self) -> dict[str, tuple[int, Unit]]:
        """Hinges and slides with a name: place in `qpos`, and unit."""
        model = self.robot.model
        found = {}
        for i in range(model.njnt):
            kind, name = int(model.jnt_type[i]), model.joint(i).name
            if kind in {HINGE, SLIDE} and name:
                found[name] = (int(model.jnt_qposadr[i]), parse_unit("rad" if kind == HINGE else "m"))
        return found

    def columns(self, robot: int = 0) -> dict[str, Array]:
        """Everything of one robot as columns by name; each of shape (T,), SI units."""
        return {name: values for name, (values, _) in self._columns(robot).items()}

    def to_xarray(self, robot: int = 0) -> Any:  # noqa: ANN401 - an extra
        """The same as an `xarray.Dataset` over `time_s`, with the unit of each column among its attributes.

        Raises:
            MissingDependencyError: xarray is not installed.
        """
        try:
            import xarray as xr  # an extra
        except ImportError as error:
            package, extra, purpose = "xarray", "data", "to_xarray"
            raise MissingDependencyError(package, extra, purpose) from error
        columns = self._columns(robot)
        time_s, unit = columns.pop("time_s")
        data = {name: ("time_s", values, {"units": each}) for name, (values, each) in columns.items()}
        attributes = {"controller": self.controller, "seed": self.specs[robot].seed}
        return xr.Dataset(data, {"time_s": ("time_s", time_s, {"units": unit})}, attributes)

    def _columns(self, robot: int) -> dict[str, tuple[Array, str]]:
        """The columns with their units: names end in the unit where there is one."""
        plain = {name: values[: self.ticks] for name, values in self.motion.columns.items()}
        columns: dict[str, tuple[Array, str]] = {"time_s": (self.time_s, "s")}
        columns |= {name: (np.asarray(values, dtype=np.float64), "1") for name, values in plain.items()}
        columns["push_n"] = (self.push_n[:, robot], "N")
        for name, channel in self.robot.channels.items():
            values = Observer(self.robot.channels, [name])(self.readings[:, robot])[:, 0]
            columns[column_name(name, channel.unit)] = (values, named_symbol(channel.unit.dimension))
        for name, planned in self.motion.planned.items():
            columns[column_name(name, planned.unit)] = (
                planned.values[: self.ticks],
                named_symbol(planned.unit.dimension),
            )
        for block in self.robot.blocks.values():
            for name, (values, unit) in getattr(block, "columns", lambda _: {})(self).items():
                columns[column_name(name, unit)] = (values[:, robot], named_symbol(unit.dimension))
        for name, (place, unit) in self.joints.items():
            columns.setdefault(column_name(name, unit), (self.qpos[:, robot, place], unit.symbol))
        for kind, names, values in (
            ("input", self.observation_names, self.observations),
            ("neuron", self.trace_names, self.trace),
            ("output", self.command_names, self.commands),
        ):
            units = self.robot.channel_units if kind == "input" else self.robot.command_units
            for i, name in enumerate(names):
                unit = named_symbol(units[name].dimension) if name in units and kind != "neuron" else "1"
                columns[f"{kind}_{name}"] = (values[:, robot, i], unit)
        if self.observation_names:
            missing = (~np.isfinite(self.observations[:, robot])).any(axis=1).astype(float)
            columns["input_missing"] = (missing, "1")
        return columns | {name: (values, "1") for name, values in self._flags(robot)}

    def _flags(self, robot: int) -> Iterator[tuple[str, Array]]:
        """Columns of what was cut, held and replaced; of what never happened there is none."""
        for kind, log in (("clamped", self.cut), ("held", self.held), ("fallback", self.replaced)):
            flags = log.of(robot, self.ticks)
            for i in np.flatnonzero(flags.any(axis=0)).tolist():
                yield f"{kind}_{log.names[i]}", flags[:, i].astype(float)

    def interventions(self, robot: int = 0) -> dict[str, dict[str, tuple[float, float]]]:
        """What did not come through between robot and controller, up to the end of a robot's run.

        Returns:
            By what happened, and by the name of what it happened to: when first, and how long in all, [s].
            `clamped`: a command was cut to its limits or rate, or its controls to their range; or, where no
            such command has a part in it, an actuator's control. `missing`: a channel had no reading.
            `held`: a command did not come, and the last one was sent again. `fallback`: the scenario's
            fallback took its place.
        """
        end = int(self.end_tick[robot]) + 1 if self.end_tick[robot] >= 0 else self.ticks
        cut = self.cut.of(robot, end)
        count = len(self.command_names)
        cut[:, count:] &= ~cut[:, :count].any(axis=1, keepdims=True)
        missing = ~np.isfinite(self.observations[:end, robot])
        found = {
            "clamped": (self.cut.names, cut),
            "missing": (self.observation_names, missing),
            "held": (self.held.names, self.held.of(robot, end)),
            "fallback": (self.replaced.names, self.replaced.of(robot, end)),
        }
        return {
            kind: {
                names[i]: (float(flags[:, i].argmax() * self.step_s), float(flags[:, i].sum() * self.step_s))
                for i in np.flatnonzero(flags.any(axis=0))
            }
            for kind, (names, flags) in found.items()
        }

    @cached_property
    def push_n(self) -> Array:
        """Size of the force on each robot; shape (T, B), [N]."""
        total = np.zeros((self.ticks, len(self.specs), 3))
        for push in self.effects.forces:
            stop = min(push.first_tick + len(push.forces), self.ticks)
            if stop > push.first_tick:
                total[push.first_tick : stop] += push.forces[: stop - push.first_tick]
        size: Array = np.linalg.norm(total, axis=-1)
        return size

    def save(self, folder: Path, robot: int = 0) -> Path:
        """Write `recording.nc` (xarray opens it) and `recording.csv` (pandas and spreadsheets do).

        Raises:
            OutputError: A file cannot be written.

        Returns:
            The path of `recording.nc`.
        """
        columns = self._columns(robot)
        path = folder / "recording.nc"
        attributes: dict[str, Any] = {"title": f"circuitkit recording, controller {self.controller}"}
        for block in self.robot.blocks.values():
            attributes |= getattr(block, "attributes", {})
        # NetCDF 3 has no whole numbers beyond 2^31, which a seed may be.
        attributes |= {"interrupted": int(self.interrupted), "seed": str(self.specs[robot].seed)}
        if (why := self.invalid[robot]) is not None:
            attributes["invalid"] = why
        write_netcdf(
            path, attributes, {name: (values, {"units": unit}) for name, (values, unit) in columns.items()}
        )
        with (
            replacing(folder / "recording.csv") as part,
            part.open("w", encoding="utf-8", newline="") as file,
        ):
            file.writelines(csv_lines({name: values for name, (values, _) in columns.items()}))
        return path


def column_name(name: str, unit: Unit) -> str:
    """A name that ends in its SI unit, such as `zmp_y_m`; a plain number's name stays as it is."""
    symbol = named_symbol(unit.dimension)
    word = _NO_WORD.sub("_", name)
    return word if symbol == "1" else f"{word}_{_NO_WORD.sub('_', symbol).lower().strip('_')}"
