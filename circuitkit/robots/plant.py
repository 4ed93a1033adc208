"""How a simulated robot and its floor differ from those that the walk was planned for."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.source import FileModel
from circuitkit.base.source.fields import Kilograms, Radians, Ratio

_STEEPEST = math.radians(30)


class Payload(FileModel):
    """Something that the robot carries: a point mass at the centre of mass of a body."""

    body: str = Field(description="Body of the MJCF, such as r_wrist, the NAO's right hand.")
    mass: Kilograms = Field(gt=0)


class Slope(FileModel):
    """How much the floor rises, forward and to the left.

    The world stays that of the floor, and gravity is turned: u = (sin forward, sin left, z) with |u| = 1 is
    what points up as the floor sees it, and gravity is -g u.
    """

    forward: Radians = Field(default=0.0, ge=-_STEEPEST, le=_STEEPEST)
    left: Radians = Field(default=0.0, ge=-_STEEPEST, le=_STEEPEST)

    def up(self) -> NDArray[np.float64]:
        """The unit vector against gravity in the floor's axes; shape (3,)."""
        forward, left = math.sin(self.forward), math.sin(self.left)
        return np.array([forward, left, math.sqrt(1.0 - forward**2 - left**2)])


class Plant(FileModel):
    """What is simulated, as it differs from what the walk was planned for."""

    friction: Ratio | None = Field(
        default=None, gt=0, le=10, description="Sliding friction of the soles on the floor."
    )
    mass: Ratio = Field(default=1.0, gt=0, le=10, description="Factor for every body, and for its inertia.")
    payload: Payload | None = None
    servo_stiffness: Ratio = Field(
        default=1.0, gt=0, le=10, description="Factor for every servo; its damping and its torque stay."
    )
    slope: Slope = Slope()

    def change(self, model: mujoco.MjModel) -> None:
        """Change masses and gravity of a compiled model; friction and servos are made with the model.

        Raises:
            UnknownNameError: The body with the payload is not there; lists those there are.
        """
        if self.mass != 1.0:
            model.body_mass *= self.mass
            model.body_inertia *= self.mass
        if self.payload is not None:
            names = [model.body(index).name for index in range(1, model.nbody)]
            if self.payload.body not in names:
                kind = "body"
                raise UnknownNameError(kind, self.payload.body, names)
            model.body_mass[model.body(self.payload.body).id] += self.payload.mass
        if self.mass != 1.0 or self.payload is not None:
            mujoco.mj_setConst(model, mujoco.MjData(model))
        if self.slope != Slope():
            model.opt.gravity = -np.linalg.norm(model.opt.gravity) * self.slope.up()
