"""What differs from seed to seed beside the noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import mujoco
import numpy as np
from pydantic import Field, model_validator

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import Metres, MetresPerSecond, Radians, Seconds
from circuitkit.robots import Worlds
from circuitkit.robots.mjcf import HINGE
from circuitkit.robots.mobile_base import MobileBase
from circuitkit.simulation.disturbance import Disturbance
from circuitkit.simulation.effects import Effects

_STREAM = 2**16  # of its own, so that it leaves the seeds' other numbers alone


class Jitter(Disturbance):
    """Lets seeds differ in when pushes begin and in how the robot starts."""

    kind: ClassVar[str] = "jitter"
    early: ClassVar[bool] = True

    start: Seconds = Field(default=0.0, ge=0, description="Pushes begin up to this much earlier or later.")
    velocity: MetresPerSecond = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of the base's velocity at first, forward and sideways.",
    )
    position: Metres | tuple[Metres, Metres] = Field(
        default=0.0,
        description="The base starts up to this much further forward or back, left or right; one for both, "
        "or two.",
    )
    yaw: Radians = Field(
        default=0.0, ge=0, description="The base starts turned by up to this, to either side."
    )
    joints: Radians = Field(
        default=0.0, ge=0, description="Standard deviation of the joints' angles at first."
    )

    @model_validator(mode="after")
    def _not_negative(self) -> Jitter:
        if min(self.reach_m) < 0:
            message = f"position: found {min(self.reach_m):g} m; allowed: 0 or more"
            raise ValueError(message)
        return self

    @property
    def begins(self) -> None:
        """It has no beginning: `start` is by how much that of pushes differs."""

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far the base may start from its place, forward and to the left."""
        return self.position if isinstance(self.position, tuple) else (self.position, self.position)

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:
        """Draw the shift of the pushes and the start of each robot."""
        velocity = np.zeros((effects.batch, 2))
        for i in robots:
            random = effects.generator(i)
            effects.shift_s[i] = random.uniform(-self.start, self.start)
            velocity[i] = random.normal(0.0, self.velocity, 2)
        base = MobileBase(effects.robot)
        if (self.velocity or any(self.reach_m)) and not base.dofs:
            message = "the robot has no base that can move; allowed: a jitter of joints"
            raise InputError(Problem("", 0, 0, where, message))
        if self.yaw and base.turn is None and base.free is None:
            message = "the robot has no base that can turn; allowed: a jitter of joints"
            raise InputError(Problem("", 0, 0, f"{where}.yaw", message))
        if self.velocity:
            effects.at_once.append(lambda worlds: _kick(base, worlds, velocity))
        if any(self.reach_m) or self.yaw or self.joints:
            self._place(effects, robots, base)

    def _place(self, effects: Effects, robots: Sequence[int], base: MobileBase) -> None:
        moved, turned = np.zeros((effects.batch, 2)), np.zeros(effects.batch)
        hinges = [j for j in range(effects.robot.model.njnt) if effects.robot.model.jnt_type[j] == HINGE]
        hinges = [j for j in hinges if j != base.turn]
        bent = np.zeros((effects.batch, len(hinges)))
        for i in robots:
            random = effects.generator(i, _STREAM)
            moved[i] = random.uniform(-1.0, 1.0, 2) * self.reach_m
            turned[i] = random.uniform(-self.yaw, self.yaw)
            bent[i] = random.normal(0.0, self.joints, len(hinges))
        places = effects.robot.model.jnt_qposadr[hinges]

        def place(worlds: Worlds) -> None:
            _move(base, worlds, moved, turned)
            worlds.qpos[:, places] += bent

        effects.at_rest.append(place)


def _kick(base: MobileBase, worlds: Worlds, velocity: np.ndarray) -> None:
    """Give the bases a velocity; shape (B, 2)."""
    for axis, dof in base.dofs.items():
        worlds.qvel[:, dof] += base.signs[axis] * velocity[:, axis]


def _move(base: MobileBase, worlds: Worlds, moved: np.ndarray, turned: np.ndarray) -> None:
    """Put the bases elsewhere, by (B, 2) metres and turned by (B,) radians about the vertical."""
    for axis, place in base.places.items():
        worlds.qpos[:, place] += base.signs[axis] * moved[:, axis]
    model = worlds.robot.model
    if base.free is not None:
        start = int(model.jnt_qposadr[base.free]) + 3
        for i, angle in enumerate(turned):
            half = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
            product = np.zeros(4)
            mujoco.mju_mulQuat(product, half, worlds.qpos[i, start : start + 4].copy())
            worlds.qpos[i, start : start + 4] = product
    elif base.turn is not None:
        worlds.qpos[:, model.jnt_qposadr[base.turn]] += base.turn_sign * turned
