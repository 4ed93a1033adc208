"""How far the CoM is from where it is at this moment of the undisturbed walk, by two kinds of sensing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from circuitkit.biped.control.reference import WalkReference
from circuitkit.biped.control.sensed_com import CommandAxis, SensedCom
from circuitkit.control.controller import Array


class Calibration(NamedTuple):
    """How the robot is known to walk when nothing disturbs it, along one axis.

    Its joints lag behind the plan, and its CoM sways less than a point mass would: at tick t it is where the
    plan's CoM, times `sway`, was `delay_s` before.
    """

    delay_s: float = 0.0
    sway: float = 1.0


class ComFeedback:
    """The true CoM, position and velocity, less that of the undisturbed walk."""

    def __init__(
        self, reference: WalkReference, axes: Sequence[CommandAxis], known: Sequence[Calibration]
    ) -> None:
        """Choose axes, with what is known of the walk along each."""
        self._sensed = SensedCom(reference, axes)
        self.observations = self._sensed.observations
        self._com, self._velocity = (
            np.column_stack(
                [
                    each.sway * motion[reference.delayed_rows(each.delay_s), axis.column]
                    for axis, each in zip(axes, known, strict=True)
                ]
            )
            for motion in (reference.com_m, reference.com_velocity)
        )

    def read(self, tick: int, observation: Array) -> tuple[Array, Array]:
        """Deviation of position, [m], and velocity, [m/s]; each of shape (B, axes)."""
        position, velocity = self._sensed.read(tick, observation)
        return position - self._com[tick], velocity - self._velocity[tick]

    def reset(self, batch: int) -> None:
        """Start again; there is nothing to remember."""

    def correction(
        self,
        tick: int,
        observation: Array,
        position: Array,
        velocity: Array,
        command: Array,  # noqa: ARG002 - whoever sees the CoM need not know what was commanded
    ) -> tuple[Array, Array]:
        """What is sensed less what is thought.

        Args:
            tick: Of the walk.
            observation: Channels.
            position: Deviation from the undisturbed walk as it is thought; shape (B, axes), [m].
            velocity: The same; shape (B, axes), [m/s].
            command: Of the ankles since the tick before; shape (B, axes), [rad].

        Returns:
            Of position, [m], and velocity, [m/s]; each of shape (B, axes).
        """
        sensed, speed = self.read(tick, observation)
        return sensed - position, speed - velocity


class AngleFeedback:
    """The CoM as NAO's own walk senses it: by the angles of the legs, the support foot taken as flat.

    Eq. 3 turned round: the ankle's angle theta shifts the hip by L_sl sin(theta), the CoM by k times that.
    What counts is by how much the angle gives, beside the one that the servo has without a disturbance:
    theta' = (target - theta) / tau, tau its damping over its stiffness, target the walk's angle and the own
    lean. A foot that tips goes unnoticed, as do a velocity and whatever the servos hold against.
    """

    def __init__(self, reference: WalkReference, axes: Sequence[CommandAxis]) -> None:
        """Choose axes."""
        joints = [f"{side}_{axis.ankle}" for axis in axes for side in ("left", "right")]
        self.observations = tuple(joints)
        self._scale = np.array([axis.sign * reference.com_per_lean_m() for axis in axes])
        self._left = reference.schedule.left_load
        lag = np.array([reference.body.lag_s[axis.column] for axis in axes])
        self._keep = np.exp(-reference.step_s / lag)
        self._expected = _lagged(reference.joint_angles(joints), np.repeat(self._keep, 2))
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self._lean = np.zeros((batch, len(self._scale)))

    def correction(
        self,
        tick: int,
        observation: Array,
        position: Array,
        velocity: Array,  # noqa: ARG002 - no velocity is sensed
        command: Array,
    ) -> tuple[Array, Array]:
        """By how much the CoM has shifted more than was commanded; see `ComFeedback.correction`."""
        self._lean = command + self._keep * (self._lean - command)
        expected = self._expected[tick] + np.repeat(self._lean, 2, axis=1)
        given = np.sin(observation) - np.sin(expected)
        share = self._left[tick]
        shift = self._scale * (share * given[:, 0::2] + (1.0 - share) * given[:, 1::2])
        return shift, np.zeros_like(position)


def _lagged(target: Array, keep: Array) -> Array:
    """What a first-order lag makes of a target that is held for a step, at the start of each step."""
    angle = np.empty_like(target)
    angle[0] = target[0]
    for tick in range(1, len(target)):
        angle[tick] = target[tick - 1] + keep * (angle[tick - 1] - target[tick - 1])
    return angle
