"""The CoM as sensed, in the frame of the plan, along the axes that a controller acts on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from circuitkit.biped.control.reference import WalkReference
from circuitkit.control.controller import Array

AxisName = Literal["lateral", "sagittal"]

# For each axis its letter, its column in the plan, the command that leans along it, and the command's sign: a
# positive roll of the ankles moves the body to the left (eq. 3), a positive pitch moves it backward.
AXES: Mapping[AxisName, tuple[str, int, str, float]] = {
    "lateral": ("y", 1, "ankle_roll", 1.0),
    "sagittal": ("x", 0, "ankle_pitch", -1.0),
}


class CommandAxis:
    """An axis that a controller acts on.

    Attributes:
        letter: x or y.
        column: In arrays of the plan.
        ankle: The command that leans the body along it.
        sign: Of the command, for a lean towards the positive end.
    """

    def __init__(self, name: AxisName) -> None:
        self.letter, self.column, self.ankle, self.sign = AXES[name]


class SensedCom:
    """Position and velocity of the CoM from the channels `com_*`, `com_velocity_*` and `feet_*`.

    The channels give the CoM from the middle between the ankles, where they are. The plan's frame is anchored
    in the foot that carries, wherever the other one dangles: c = c_sensed + middle - s (f - f_plan) / 2. Here
    f is the left ankle from the right one and s the carrying side, 1 left, -1 right, linear in the load.
    """

    def __init__(self, reference: WalkReference, axes: Sequence[CommandAxis]) -> None:
        """Choose axes."""
        self.observations = tuple(
            f"{channel}_{axis.letter}" for channel in ("com", "com_velocity", "feet") for axis in axes
        )
        columns = [axis.column for axis in axes]
        self._count = len(columns)
        self._half_side = reference.carrying_side / 2
        plan = reference.feet_apart_m[:, columns]
        self._offset = reference.sensed_com_offset_m[:, columns] + self._half_side[:, None] * plan

    def read(self, tick: int, observation: Array) -> tuple[Array, Array]:
        """Position [m] and velocity [m/s] of the CoM; each of shape (B, axes).

        Args:
            tick: Of the walk.
            observation: Channels in the order of `observations`; further columns are not looked at.
        """
        n = self._count
        com, velocity, feet = observation[:, :n], observation[:, n : 2 * n], observation[:, 2 * n : 3 * n]
        return com + self._offset[tick] - self._half_side[tick] * feet, np.asarray(velocity)
