"""Objects that are set down or thrown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import mujoco
import numpy as np
from pydantic import Field, model_validator

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import Metres, MetresPerSecond
from circuitkit.robots import Worlds
from circuitkit.simulation.disturbance import Disturbance, Start
from circuitkit.simulation.effects import Effects, Hook, placed


class Move(Disturbance):
    """Puts a loose object or a mocap body elsewhere, or throws it, at a moment."""

    kind: ClassVar[str] = "move"

    body: str = Field(description="A body with a free joint, or a mocap body.")
    position: tuple[Metres, Metres, Metres] | None = Field(
        default=None, description="Where it is put; x, y, z."
    )
    velocity: tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond] | None = Field(
        default=None, description="Its velocity then, along x, y and z; for a body with a free joint."
    )
    start: Start = Field(default=0.0, description="A time such as 5 s, or a moment of the reference.")

    @model_validator(mode="after")
    def _does_something(self) -> Move:
        if self.position is None and self.velocity is None:
            message = "found neither position nor velocity; allowed: one of them, or both"
            raise ValueError(message)
        return self

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:  # noqa: ARG002 - all robots
        """Find the body, and set its state when the time has come."""
        model = effects.robot.model
        with placed(f"{where}.body"):
            body = effects.robot.number("body", self.body)
        joint = int(model.body_jntadr[body])
        free = joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        mocap = int(model.body_mocapid[body])
        if not free and (mocap < 0 or self.velocity is not None):
            message = (
                f"'{self.body}' cannot be moved so; allowed: a body with a free joint, or the position of a "
                "mocap body"
            )
            raise InputError(Problem("", 0, 0, f"{where}.body", message))
        first, _ = effects.window(self.start, None, where)

        def act(_: int, worlds: Worlds) -> None:
            if self.position is not None and mocap >= 0:
                worlds.physics.bind("mocap_pos")[:, mocap] = self.position
            elif self.position is not None:
                place = int(model.jnt_qposadr[joint])
                worlds.qpos[:, place : place + 3] = self.position
            if self.velocity is not None:
                dof = int(model.jnt_dofadr[joint])
                worlds.qvel[:, dof : dof + 6] = np.array([*self.velocity, 0.0, 0.0, 0.0])

        effects.on_worlds.append(Hook(first, first + 1, act))
        effects.spans.append((f"{self.body} moved", first * effects.step_s, first * effects.step_s))
