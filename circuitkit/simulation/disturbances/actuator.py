"""Actuators that are weak, dead or soft."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

import mujoco
from pydantic import Field

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import Ratio, Seconds
from circuitkit.control import Array
from circuitkit.robots import RobotModel, Worlds
from circuitkit.robots.start import holds_position
from circuitkit.simulation.disturbance import Disturbance, Start
from circuitkit.simulation.effects import Effects, Hook, placed

_GAIN, _BIAS, _INPUT = mujoco.mjtGain, mujoco.mjtBias, mujoco.mjtCtrlInput
_PEAK, _SCALE = 2, 3  # of a muscle: its peak force, and what gives it, over acc0, where that is negative
# Force = gain (control) + bias, and both are proportional to these parameters.
_PROPORTIONAL = (
    {int(kind) for kind in (_GAIN.mjGAIN_FIXED, _GAIN.mjGAIN_AFFINE, _GAIN.mjGAIN_SO3, _GAIN.mjGAIN_PID)},
    {int(kind) for kind in (_BIAS.mjBIAS_NONE, _BIAS.mjBIAS_AFFINE, _BIAS.mjBIAS_SO3)},
)
_MUSCLE = (int(_GAIN.mjGAIN_MUSCLE), int(_BIAS.mjBIAS_MUSCLE))
_FIELDS = ("actuator_gainprm", "actuator_biasprm", "actuator_forcerange")


class Actuator(Disturbance):
    """Makes actuators weak or dead, or servos softer, for a while or for the whole run.

    With the strength s an actuator's force is s times what it would be in the same state: MuJoCo's force is
    gain * control + bias within its range, and all three are scaled.
    """

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
        """Change the compiled model."""
        if self.changes_model:
            with placed("actuator"):
                self._scale(robot, lambda name: getattr(robot.model, name))

    def _scale(self, robot: RobotModel, array: Callable[[str], Array]) -> None:
        """Scale gains, shape (..., number of actuators, n), biases and limits of the force, in place."""
        gains, biases, limits = (array(name) for name in _FIELDS)
        model = robot.model
        for i in robot.matching("actuator", self.actuator):
            if self.stiffness != 1.0 and holds_position(model, i):
                if model.actuator_gaintype[i] == _GAIN.mjGAIN_FIXED:  # a pid's gain is that of its integral
                    gains[..., i, 0] *= self.stiffness
                biases[..., i, 1] *= self.stiffness
            if self.strength != 1.0:
                kinds = (model.actuator_gaintype[i], model.actuator_biastype[i])
                for values, kind, muscle in zip((gains, biases), kinds, _MUSCLE, strict=True):
                    if int(kind) != muscle:
                        values[..., i, :] *= self.strength
                        continue
                    values[..., i, _PEAK] *= self.strength
                    if values[..., i, _PEAK].flat[0] < 0:  # then MuJoCo takes scale / acc0
                        values[..., i, _SCALE] *= self.strength
                limits[..., i, :] *= self.strength

    def _require_sense(self, effects: Effects, where: str) -> None:
        """Refuse what could not be done exactly, or would do nothing."""
        robot = effects.robot
        model = robot.model
        with placed(f"{where}.actuator"):
            chosen = robot.matching("actuator", self.actuator)
        if self.stiffness != 1.0 and not any(holds_position(model, i) for i in chosen):
            servos = [model.actuator(i).name for i in range(model.nactuator) if holds_position(model, i)]
            message = (
                f"'{self.actuator}' is no position servo, and nothing else has a stiffness; allowed: "
                f"{', '.join(servos) or 'strength; the robot has no position servo'}"
            )
            raise InputError(Problem("", 0, 0, f"{where}.stiffness", message))
        for i in chosen if self.strength != 1.0 else ():
            if why := _disproportionate(model, i):
                name = model.actuator(i).name
                message = (
                    f"the force of the actuator '{name}' cannot be scaled, for {why}; allowed: "
                    "actuators whose force is proportional to their gains, such as motor, position, muscle"
                )
                raise InputError(Problem("", 0, 0, f"{where}.strength", message))

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:  # noqa: ARG002 - all robots
        """Change the gains of every world when it starts, and back when it ends."""
        self._require_sense(effects, where)
        if self._always:
            return
        first, last = effects.window(self.start, self.duration, where)
        words = f"{self.actuator} dead" if self.strength == 0 else f"{self.actuator} weak"
        effects.spans.append((words, first * effects.step_s, last * effects.step_s))
        spells: list[tuple[int, int, Actuator]] = effects.collected("actuators", list)
        spells.append((first, last, self))

        def change(tick: int, worlds: Worlds) -> None:
            """Begin with what the model has, for others may begin or end between."""
            for name in _FIELDS:
                worlds.physics.expand(name)[:] = getattr(worlds.robot.model, name)
            for begin, end, each in spells:
                if begin <= tick < end:
                    each._scale(worlds.robot, worlds.physics.expand)

        effects.on_worlds += [Hook(tick, tick + 1, change) for tick in (first, last) if tick < effects.ticks]


def _disproportionate(model: mujoco.MjModel, i: int) -> str:
    """Why scaling an actuator's parameters would not scale its force; empty if it does."""
    kinds = (int(model.actuator_gaintype[i]), int(model.actuator_biastype[i]))
    if model.actuator_plugin[i] >= 0:
        return "a plug-in of MuJoCo computes it"
    if kinds[0] == _GAIN.mjGAIN_DCMOTOR or kinds[1] == _BIAS.mjBIAS_DCMOTOR:
        return "that of a dcmotor follows from its current"
    if kinds[0] == _GAIN.mjGAIN_PID and int(model.actuator_ctrlspec[i]) & int(_INPUT.mjINPUT_FF):
        return "a control of it is a force"
    known = all(
        kind == muscle or kind in others
        for kind, muscle, others in zip(kinds, _MUSCLE, _PROPORTIONAL, strict=True)
    )
    return "" if known else "code of its own computes it"
