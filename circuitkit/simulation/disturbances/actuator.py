"""Actuators that are weak, dead or soft."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from circuitkit.base.source.fields import Ratio, Seconds
from circuitkit.control import Array
from circuitkit.robots import RobotModel, Worlds
from circuitkit.robots.model import drives_position
from circuitkit.simulation.disturbance import Disturbance, Effects, Hook, Start, placed


class Actuator(Disturbance):
    """Makes actuators weak or dead, or servos softer, for a while or for the whole run."""

    kind: ClassVar[str] = "actuator"

    actuator: str = Field(default="*", description="Name of an actuator, with * for any letters.")
    strength: Ratio = Field(default=1.0, ge=0, le=10, description="Factor for its force; 0 % is dead.")
    stiffness: Ratio = Field(
        default=1.0, gt=0, le=10, description="Factor for a position servo's stiffness; its damping stays."
    )
    start: Start = Field(default=0.0, description="A time such as 5 s, or a moment of the reference.")
    duration: Seconds | None = Field(default=None, gt=0, description="To the end of the run if absent.")

    @property
    def _always(self) -> bool:
        return self.start == 0.0 and self.duration is None

    @property
    def changes_model(self) -> bool:
        """If it lasts for the whole run."""
        return self._always and (self.strength != 1.0 or self.stiffness != 1.0)

    def change(self, robot: RobotModel) -> None:
        """Change gains of the compiled model."""
        model = robot.model
        if self.changes_model:
            with placed("actuator"):
                self._scale(robot, model.actuator_gainprm, model.actuator_biasprm)

    def _scale(self, robot: RobotModel, gains: Array, biases: Array) -> None:
        """Scale gains, shape (..., nu, n), and biases, in place."""
        for i in robot.matching("actuator", self.actuator):
            if self.stiffness != 1.0 and drives_position(robot.model, i):
                gains[..., i, 0] *= self.stiffness
                biases[..., i, 1] *= self.stiffness
            if self.strength != 1.0:
                if robot.model.actuator_gaintype[i] == 2:  # noqa: PLR2004 - a muscle, whose peak force stands third
                    gains[..., i, 2] *= self.strength
                    biases[..., i, 2] *= self.strength
                    if gains[..., i, 2].flat[0] < 0:  # then MuJoCo takes scale / acc0, which is the fourth
                        gains[..., i, 3] *= self.strength
                        biases[..., i, 3] *= self.strength
                else:
                    gains[..., i, :] *= self.strength
                    biases[..., i, :] *= self.strength

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:  # noqa: ARG002 - all robots
        """Change the gains of every world when it starts, and back when it ends."""
        if self._always:
            return
        first, last = effects.window(self.start, self.duration, where)
        words = f"{self.actuator} dead" if self.strength == 0 else f"{self.actuator} weak"
        effects.spans.append((words, first * effects.step_s, last * effects.step_s))
        with placed(f"{where}.actuator"):  # before the run
            effects.robot.matching("actuator", self.actuator)
        spells: list[tuple[int, int, Actuator]] = effects.collected("actuators", list)
        spells.append((first, last, self))

        def change(tick: int, worlds: Worlds) -> None:
            """Begin with what the model has, for others may begin or end between."""
            gains, biases = (
                worlds.physics.expand("actuator_gainprm"),
                worlds.physics.expand("actuator_biasprm"),
            )
            gains[:], biases[:] = worlds.robot.model.actuator_gainprm, worlds.robot.model.actuator_biasprm
            for begin, end, each in spells:
                if begin <= tick < end:
                    each._scale(worlds.robot, gains, biases)

        effects.on_worlds += [Hook(tick, tick + 1, change) for tick in (first, last) if tick < effects.ticks]
