"""Bodies that differ from what is known of the robot."""

from __future__ import annotations

from typing import ClassVar

import mujoco
from pydantic import Field, model_validator

from circuitkit.base.source.fields import Kilograms, Ratio
from circuitkit.robots import RobotModel
from circuitkit.simulation.disturbance import Disturbance
from circuitkit.simulation.effects import placed
from circuitkit.simulation.friction import rub


class Body(Disturbance):
    """Changes mass or friction of bodies for the whole run; controllers and references do not know."""

    kind: ClassVar[str] = "body"

    body: str = Field(default="*", description="Name of a body, with * for any letters; * is all of them.")
    mass: Ratio = Field(default=1.0, gt=0, le=10, description="Factor for its mass and inertia.")
    payload: Kilograms | None = Field(default=None, ge=0, description="A point mass at its centre of mass.")
    friction: Ratio | None = Field(
        default=None, gt=0, le=10, description="Sliding friction of what touches it; of everything for *."
    )

    @model_validator(mode="after")
    def _one_for_payload(self) -> Body:
        if self.payload is not None and "*" in self.body:
            message = f"found a payload for '{self.body}'; allowed: the name of one body"
            raise ValueError(message)
        return self

    @property
    def changes_model(self) -> bool:
        """Unless it changes nothing."""
        return self.mass != 1.0 or self.payload is not None or self.friction is not None

    def change(self, robot: RobotModel) -> None:
        """Change masses and friction of the compiled model."""
        model = robot.model
        with placed("body"):
            bodies = (
                [robot.number("body", self.body)]
                if "*" not in self.body
                else robot.matching("body", self.body)
            )
        if self.mass != 1.0:
            model.body_mass[bodies] *= self.mass
            model.body_inertia[bodies] *= self.mass
        if self.payload is not None:
            model.body_mass[bodies[0]] += self.payload
        if self.mass != 1.0 or self.payload is not None:
            strengths = (
                model.actuator_acc0.copy()
            )  # a muscle's peak force may be made of it: no load changes that
            mujoco.mj_setConst(model, mujoco.MjData(model))
            model.actuator_acc0[:] = strengths
        if self.friction is not None:
            rub(model, None if self.body == "*" else bodies, self.friction)
