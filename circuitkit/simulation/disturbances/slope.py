"""Ground that is not level."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import Radians
from circuitkit.control import Array
from circuitkit.robots import RobotModel
from circuitkit.simulation.disturbance import Disturbance

_STEEPEST = math.radians(30)


class Slope(Disturbance):
    """Tilts the ground; controllers and references do not know.

    The world stays that of the ground, and gravity is turned: u = (sin forward, sin left, z) with |u| = 1 is
    what points up as the ground sees it, and gravity is -g u. Without the slope it must point along -z.
    """

    kind: ClassVar[str] = "slope"

    forward: Radians = Field(
        default=0.0, ge=-_STEEPEST, le=_STEEPEST, description="How much the ground rises forward."
    )
    left: Radians = Field(
        default=0.0, ge=-_STEEPEST, le=_STEEPEST, description="How much it rises to the left."
    )

    def up(self) -> Array:
        """The unit vector against gravity in the ground's axes; shape (3,)."""
        forward, left = math.sin(self.forward), math.sin(self.left)
        return np.array([forward, left, math.sqrt(1.0 - forward**2 - left**2)])

    @property
    def changes_model(self) -> bool:
        """It turns gravity, unless it is level."""
        return bool(self.forward or self.left)

    def change(self, robot: RobotModel) -> None:
        """Turn gravity.

        Raises:
            InputError: It does not point down, so that nobody can tell what the ground is.
        """
        x, y, z = robot.model.opt.gravity
        if x or y or z > 0:
            message = (
                f"the MJCF's gravity is {x:g} {y:g} {z:g} m/s^2; allowed: gravity along -z, "
                "or none; a slope turns it from there"
            )
            raise InputError(Problem("", 0, 0, "", message))
        robot.model.opt.gravity = -np.linalg.norm(robot.model.opt.gravity) * self.up()
