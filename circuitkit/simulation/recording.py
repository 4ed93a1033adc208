"""What a simulation leaves: every tick of every robot, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import netcdf_file

from circuitkit.base.files import replacing, write_text
from circuitkit.circuit import CircuitGraph
from circuitkit.biped.gait import PHASES, SIDES, Walk
from circuitkit.biped.gait.lipm import GRAVITY_M_S2, zmp_from_com
from circuitkit.robots import RobotModel, command_units, robot_channels
from circuitkit.biped.sensing import Observer, centre_of_pressure, total_centre_of_pressure
from circuitkit.simulation.disturbance import Fates, Trial

Array = NDArray[np.float64]

_ALONE = 0.95  # a foot that carries more than this part of the weight carries it alone


@dataclass(frozen=True)
class Recording:
    """T ticks of B robots; row t is the end of tick t.

    Attributes:
        walk: What they were to do.
        robot: What they are.
        trials: Their fates.
        fates: The same as arrays.
        controller: Name of the controller.
        circuit: The circuit, in use or not.
        readings: True sensor readings; shape (T, B, s).
        qpos: Positions; shape (T, B, nq).
        observations: What the controller read at the start of the tick, by channel; shape (T, B, k).
        commands: What it wrote, by channel; shape (T, B, m).
        trace: What it recorded of itself; shape (T, B, n).
        observation_names: The k channels.
        command_names: The m channels.
        trace_names: The n names.
        interrupted: Whether the run was stopped before its end.
        yardstick: The circuit whose thresholds count if this one has none.
    """

    walk: Walk
    robot: RobotModel
    trials: tuple[Trial, ...]
    fates: Fates
    controller: str
    circuit: CircuitGraph
    readings: Array
    qpos: Array
    observations: Array
    commands: Array
    trace: Array
    observation_names: tuple[str, ...]
    command_names: tuple[str, ...]
    trace_names: tuple[str, ...]
    interrupted: bool = False
    yardstick: CircuitGraph | None = None

    @property
    def ticks(self) -> int:
        """T."""
        return len(self.readings)

    @cached_property
    def time_s(self) -> Array:
        """End of each tick; shape (T,)."""
        return np.arange(1.0, self.ticks + 1) * self.walk.gait.control_step

    def channel(self, name: str) -> Array:
        """A sensor channel without noise; shape (T, B), SI unit."""
        observer = Observer(self.robot.layout, robot_channels(self.robot), [name])
        flat = self.readings.reshape(-1, self.readings.shape[-1])
        values: Array = observer(flat)[:, 0].reshape(self.readings.shape[:2])
        return values

    @cached_property
    def loads_n(self) -> Array:
        """Weight on each foot, left and right, from the contacts; shape (T, B, 2)."""
        return np.stack(
            [centre_of_pressure(self.readings, self.robot.layout, s)[1] for s in range(2)], axis=-1
        )

    @cached_property
    def support(self) -> NDArray[np.int64]:
        """Who carries, by the measured load: 0 the left foot alone, 1 the right, 2 both; shape (T, B)."""
        return support_by_load(self.loads_n)

    @cached_property
    def centre_of_pressure_m(self) -> Array:
        """Centre of pressure by contacts, from the middle between the feet; (T, B, 2); nan in the air."""
        layout = self.robot.layout
        feet = np.stack([self.readings[..., layout.foot(s)] for s in range(2)])
        middle: Array = total_centre_of_pressure(self.readings, layout) - feet[..., :2].mean(axis=0)
        return middle

    @cached_property
    def com_m(self) -> Array:
        """Centre of mass from the middle between the feet, up from the ground; shape (T, B, 3)."""
        com = self.readings[..., self.robot.layout.com].copy()
        for side in range(2):
            com[..., :2] -= self.readings[..., self.robot.layout.foot(side)][..., :2] / 2
        return com

    @cached_property
    def com_velocity(self) -> Array:
        """Its velocity in the world; shape (T, B, 3), [m/s]."""
        return self.readings[..., self.robot.layout.com_velocity]

    @cached_property
    def zmp_by_com_m(self) -> Array:
        """ZMP by eq. 2 from the centre of mass, from the middle between the feet; shape (T, B, 2).

        On a slope gravity accelerates along the floor as well, and presses on it with less.
        """
        velocity = self.com_velocity[..., :2]
        if self.ticks == 1:  # no difference can be taken
            acceleration = np.zeros_like(velocity)
        else:
            acceleration = np.gradient(velocity, self.walk.gait.control_step, axis=0)
        gravity = self.robot.model.opt.gravity
        felt = (acceleration - gravity[:2]) * (GRAVITY_M_S2 / -gravity[2])
        return zmp_from_com(self.com_m[..., :2], felt, self.com_m[..., 2:])

    def columns(self, robot: int = 0) -> dict[str, Array]:
        """Everything of one robot as columns by name; each of shape (T,), SI units."""
        s, layout = slice(0, self.ticks), self.robot.layout
        readings = self.readings[:, robot]
        columns = {
            "time_s": self.time_s,
            "step": self.walk.schedule.step[s].astype(float),
            "phase": self.walk.schedule.phase[s].astype(float),
            "push_n": self.push_n[:, robot],
            "zmp_x_m": self.channel("zmp_x")[:, robot],
            "zmp_y_m": self.channel("zmp_y")[:, robot],
            "force_difference": self.channel("force_difference")[:, robot],
            "cop_x_m": self.centre_of_pressure_m[:, robot, 0],
            "cop_y_m": self.centre_of_pressure_m[:, robot, 1],
            "zmp_by_com_x_m": self.zmp_by_com_m[:, robot, 0],
            "zmp_by_com_y_m": self.zmp_by_com_m[:, robot, 1],
            "load_left_n": self.loads_n[:, robot, 0],
            "load_right_n": self.loads_n[:, robot, 1],
        }
        for axis, letter in enumerate("xyz"):
            columns[f"com_{letter}_m"] = self.com_m[:, robot, axis]
            columns[f"com_velocity_{letter}_m_s"] = self.com_velocity[:, robot, axis]
            columns[f"torso_{letter}_m"] = readings[:, layout.torso][:, axis]
            columns[f"gyro_{letter}_rad_s"] = readings[:, layout.gyro][:, axis]
        for i, cell in enumerate(layout.cells):
            columns[f"{cell}_n"] = readings[:, i]
        for joint, place in zip(self.robot.actuated, self.robot.qpos_index, strict=True):
            columns[f"{joint}_rad"] = self.qpos[:, robot, place]
        for kind, names, values in (
            ("input", self.observation_names, self.observations),
            ("neuron", self.trace_names, self.trace),
            ("output", self.command_names, self.commands),
        ):
            columns |= {f"{kind}_{name}": values[:, robot, i] for i, name in enumerate(names)}
        if self.observation_names:
            columns["input_missing"] = (~np.isfinite(self.observations[:, robot])).any(axis=1).astype(float)
        return columns

    @cached_property
    def push_n(self) -> Array:
        """Size of the force on each robot; shape (T, B), [N]."""
        total = np.zeros((self.ticks, len(self.trials), 3))
        for push in self.fates.pushes:
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
        columns, units = self.columns(robot), self._channel_units()
        path = folder / "recording.nc"
        with replacing(path) as part, netcdf_file(str(part), "w") as file:
            file.title = f"circuitkit recording, controller {self.controller}"
            file.phases = ", ".join(f"{i} {name}" for i, name in enumerate(PHASES))
            file.feet = ", ".join(SIDES)
            file.interrupted = int(self.interrupted)
            file.seed = str(self.trials[robot].seed)  # NetCDF 3 has no whole numbers beyond 2^31
            file.createDimension("time_s", self.ticks)
            for name, values in columns.items():
                variable = file.createVariable(name, "f8", ("time_s",))
                variable[:] = values
                variable.units = units.get(name) or _unit_of(name)
        table = np.column_stack(list(columns.values()))
        lines = [",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in table)]
        write_text(folder / "recording.csv", "\n".join(lines) + "\n")
        return path

    def _channel_units(self) -> dict[str, str]:
        """SI unit of each column of the controller's inputs and outputs, whose names do not tell it."""
        read = {f"input_{name}": channel.unit for name, channel in robot_channels(self.robot).items()}
        written = {f"output_{name}": unit for name, unit in command_units(self.robot).items()}
        return {name: unit.dimension.si_symbol for name, unit in (read | written).items()}


def support_by_load(loads_n: Array) -> NDArray[np.int64]:
    """Who carries: 0 the left foot alone, 1 the right, 2 both; shape (...).

    Args:
        loads_n: Weight on each foot, left and right; shape (..., 2).
    """
    total = loads_n.sum(axis=-1)
    share = loads_n / np.maximum(total, 1e-9)[..., None]
    alone = share > _ALONE
    return np.where(alone[..., 0], 0, np.where(alone[..., 1], 1, 2))


def _unit_of(column: str) -> str:
    """The unit that a column's name ends in."""
    for ending, unit in (
        ("_m_s", "m/s"),
        ("_rad_s", "rad/s"),
        ("_rad", "rad"),
        ("_m", "m"),
        ("_n", "N"),
        ("_s", "s"),
    ):
        if column.endswith(ending):
            return unit
    return "1"
