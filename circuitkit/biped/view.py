"""What follows from a recording of a biped: loads, support, centre of pressure, centre of mass, ZMP."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.gait.lipm import GRAVITY_M_S2, zmp_from_com
from circuitkit.biped.sensing import Array, centre_of_pressure, total_centre_of_pressure
from circuitkit.simulation.recording import Recording

SETTLED_S = 2.0  # until then a walk that begins from standing is not on its limit cycle
_ALONE = 0.95  # a foot that carries more than this part of the weight carries it alone


class BipedView:
    """A recording as a biped's; T ticks of B robots.

    Attributes:
        recording: The recording.
        layout: Where in `sensordata` each sensor stands.
        block: The block of the robot file.
    """

    def __init__(self, recording: Recording) -> None:
        """Look at a recording of a robot with a `biped` block."""
        self.recording = recording
        body: Any = recording.robot.blocks["biped"]
        self.layout = body.layout
        self.block = body.block

    @property
    def _readings(self) -> Array:
        return self.recording.readings

    @cached_property
    def loads_n(self) -> Array:
        """Weight on each foot, left and right, from the contacts; shape (T, B, 2)."""
        return np.stack([centre_of_pressure(self._readings, self.layout, s)[1] for s in range(2)], axis=-1)

    @cached_property
    def support(self) -> NDArray[np.int64]:
        """Who carries, by the measured load: 0 the left foot alone, 1 the right, 2 both; shape (T, B)."""
        return support_by_load(self.loads_n)

    @cached_property
    def centre_of_pressure_m(self) -> Array:
        """Centre of pressure by contacts, from the middle between the feet; (T, B, 2); nan in the air."""
        feet = np.stack([self._readings[..., self.layout.foot(s)] for s in range(2)])
        middle: Array = total_centre_of_pressure(self._readings, self.layout) - feet[..., :2].mean(axis=0)
        return middle

    @cached_property
    def com_m(self) -> Array:
        """Centre of mass from the middle between the feet, up from the ground; shape (T, B, 3)."""
        com = self._readings[..., self.layout.com].copy()
        for side in range(2):
            com[..., :2] -= self._readings[..., self.layout.foot(side)][..., :2] / 2
        return com

    @cached_property
    def com_velocity(self) -> Array:
        """Its velocity in the world; shape (T, B, 3), [m/s]."""
        return self._readings[..., self.layout.com_velocity]

    @cached_property
    def zmp_by_com_m(self) -> Array:
        """ZMP by eq. 2 from the centre of mass, from the middle between the feet; shape (T, B, 2).

        On a slope gravity accelerates along the floor as well, and presses on it with less.
        """
        velocity = self.com_velocity[..., :2]
        if self.recording.ticks == 1:  # no difference can be taken
            acceleration = np.zeros_like(velocity)
        else:
            acceleration = np.gradient(velocity, self.recording.step_s, axis=0)
        gravity = self.recording.robot.model.opt.gravity
        felt = (acceleration - gravity[:2]) * (GRAVITY_M_S2 / -gravity[2])
        return zmp_from_com(self.com_m[..., :2], felt, self.com_m[..., 2:])

    def columns(self) -> dict[str, tuple[Array, Unit]]:
        """What is recorded beside the channels; shape (T, B) each."""
        metre, speed = parse_unit("m"), parse_unit("m/s")
        found: dict[str, tuple[Array, Unit]] = {}
        for axis, letter in enumerate("xy"):
            found[f"cop_{letter}"] = (self.centre_of_pressure_m[..., axis], metre)
            found[f"zmp_by_com_{letter}"] = (self.zmp_by_com_m[..., axis], metre)
        for axis, letter in enumerate("xyz"):
            found[f"com_{letter}"] = (self.com_m[..., axis], metre)
            found[f"com_velocity_{letter}"] = (self.com_velocity[..., axis], speed)
            found[f"torso_{letter}"] = (self._readings[..., self.layout.torso][..., axis], metre)
        return found


def support_by_load(loads_n: Array) -> NDArray[np.int64]:
    """Who carries: 0 the left foot alone, 1 the right, 2 both; shape (...).

    Args:
        loads_n: Weight on each foot, left and right; shape (..., 2).
    """
    total = loads_n.sum(axis=-1)
    share = loads_n / np.maximum(total, 1e-9)[..., None]
    alone = share > _ALONE
    return np.where(alone[..., 0], 0, np.where(alone[..., 1], 1, 2))


def support_edges_m(block: Any) -> Array:  # noqa: ANN401 - the block of a robot file
    """Edges of the support polygon for feet side by side at the hips' distance, sideways.

    Returns:
        Shape (3, 2): on the left foot, on the right foot, on both; right edge, left edge; [m].
    """
    offset = block.legs.hip_offset_y
    left, right = block.feet.left.sole, block.feet.right.sole
    left_foot = (offset + left.right, offset + left.left)
    right_foot = (-offset + right.right, -offset + right.left)
    return np.array([left_foot, right_foot, (right_foot[0], left_foot[1])])
