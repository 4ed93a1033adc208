"""The model predictive controller of Wieber (2006), on a robot whose joints are position-controlled.

The walk as planned goes on underneath. At each update the state of a pendulum is corrected by what is sensed,
and the optimum over the footsteps ahead says where the CoM and the ZMP shall be. What it wants beyond what it
would want undisturbed becomes a lean of the ankles, the hips turning back.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source.fields import (
    Metres,
    PerSecondToTheSixth,
    Radians,
    RadiansPerMetre,
    Ratio,
    Seconds,
)
from circuitkit.biped.control.jerk_mpc import OWN, Jerk, JerkMpc
from circuitkit.biped.control.reference import WalkReference, gait_knowledge
from circuitkit.biped.control.sensed_com import AxisName, CommandAxis
from circuitkit.biped.control.state_feedback import AngleFeedback, Calibration, ComFeedback
from circuitkit.control import Array, ControllerSpec, Interface

_TINY = 1e-6  # far below a step
_LONGEST_S = 2.0  # the ZMPs as unknowns cost digits by e^(2 omega N T)
_LOST_M = 0.2  # a DCM so far outside the soles is beyond all help: that robot's command stays


class WieberMpcSpec(ControllerSpec):
    """Leans the ankles by Wieber's model predictive control."""

    kind: ClassVar[str] = "wieber_mpc"

    axes: tuple[AxisName, ...] = Field(
        default=("lateral",),
        min_length=1,
        description="lateral (ankle_roll), sagittal (ankle_pitch), or both.",
    )
    feedback: Literal["joint_angles", "com"] = Field(
        description="joint_angles: the support foot taken as flat, as NAO's own walk does; com: the true CoM."
    )
    position_gain: Ratio = Field(ge=0, le=1, description="Part of the sensed position that is believed.")
    velocity_gain: Ratio = Field(
        default=0.0, ge=0, le=1, description="The same of the sensed velocity; feedback com only."
    )
    preview_step: Seconds = Field(gt=0, description="T, also the time between two updates.")
    preview_steps: int = Field(ge=1, le=1000, description="N.")
    zmp_weight: PerSecondToTheSixth = Field(
        ge=0, description="Weight of the ZMP's squared distance from the plan against the squared jerk."
    )
    margin: Metres = Field(ge=0, description="By which the ZMP's bounds lie inside the soles.")
    follow: Ratio = Field(
        description="Part of the CoM's wanted shift that the ankles make by leaning (eq. 3)."
    )
    lean_per_zmp: RadiansPerMetre = Field(
        description="Lean against each metre by which the ZMP shall be beyond the plan; yields if negative."
    )
    limit: Radians = Field(gt=0, description="Largest lean.")
    walk_delay: Seconds = Field(
        default=0.0, ge=0, description="By how much the robot is known to walk behind its plan."
    )
    walk_sway: Ratio = Field(
        default=1.0, gt=0, description="Part of the planned sway that the robot is known to make."
    )
    solver: str = Field(default=OWN, description="daqp, or any solver of qpsolvers.")

    @model_validator(mode="after")
    def _horizon(self) -> WieberMpcSpec:
        horizon = self.preview_step * self.preview_steps
        if horizon > _LONGEST_S:
            message = (
                f"preview_steps of preview_step are {horizon:g} s; allowed: up to {_LONGEST_S:g} s, "
                "beyond which rounding errors grow and nothing is gained"
            )
            raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _is_sensed(self) -> WieberMpcSpec:
        if self.feedback == "joint_angles" and self.velocity_gain > 0:
            message = (
                f"found velocity_gain {self.velocity_gain:g} with feedback joint_angles; allowed: 0, "
                "or feedback com"
            )
            raise ValueError(message)
        if self.feedback == "joint_angles" and "sagittal" in self.axes:
            message = (
                "found the axis sagittal with feedback joint_angles; allowed: lateral, of which eq. 3 "
                "speaks, or feedback com"
            )
            raise ValueError(message)
        return self

    def packages(self) -> tuple[str, ...]:
        """The solver, and what calls all but daqp."""
        return (OWN,) if self.solver == OWN else ("qpsolvers", self.solver)

    def bind(self, interface: Interface) -> WieberMpc:
        """The controller for a walk.

        Raises:
            InputError: The preview's step is no multiple of the walk's control step.
            MissingDependencyError: The solver is not installed.
        """
        return WieberMpc(self, gait_knowledge(interface.reference, self.controller))


class WieberMpc:
    """One pendulum an axis and a robot; see the module and `JerkMpc`.

    With d the wanted CoM and p the wanted ZMP, each less what the undisturbed pendulum wants, the lean is
    theta = follow asin(d / (k L_sl)) - lean_per_zmp p, k L_sl the CoM's shift for each sin theta.
    """

    def __init__(self, spec: WieberMpcSpec, reference: WalkReference) -> None:
        """Factorise and take the bounds from the walk."""
        self.name = spec.controller
        axes = [CommandAxis(name) for name in spec.axes]
        self._feedback = _feedback(spec, reference, axes)
        self.observations = self._feedback.observations
        self.commands = tuple(axis.ankle for axis in axes)
        self.trace_names = tuple(
            f"{name}_{axis.letter}" for axis in axes for name in ("com_wanted", "zmp_wanted", "zmp_bounded")
        )
        self._pendulums = [_Pendulum(spec, reference, axis) for axis in axes]
        self._stride = self._pendulums[0].stride
        self._signs = np.array([axis.sign for axis in axes])
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self._tick = 0
        self._command = np.zeros((batch, len(self.commands)))
        self._trace = np.zeros((batch, len(self.trace_names)))
        self._feedback.reset(batch)
        for pendulum in self._pendulums:
            pendulum.reset(batch)

    def step(self, observation: Array) -> Array:
        """The ankles' angles; shape (B, m), [rad]; not a number where a reading is missing."""
        trace = self._trace
        thought = np.stack([pendulum.deviation() for pendulum in self._pendulums], axis=-1)
        position, velocity = self._feedback.correction(
            self._tick, observation, thought[0], thought[1], self._command
        )
        there: NDArray[np.bool_] = np.all(np.isfinite(position + velocity), axis=1)
        for number, pendulum in enumerate(self._pendulums):
            if self._tick % self._stride == 0:
                pendulum.update(self._tick, position[:, number], velocity[:, number], there)
            lean = pendulum.advance(trace[:, 3 * number : 3 * number + 3])
            sign = self._signs[number]
            self._command[:, number] = np.where(there, sign * lean, self._command[:, number])
        self._tick += 1
        return np.where(there[:, None], self._command, np.nan)

    def store_trace(self, row: Array) -> None:
        """Write what is wanted of CoM and ZMP, an axis each; shape (B, n), [m]."""
        row[...] = self._trace


def _feedback(
    spec: WieberMpcSpec, reference: WalkReference, axes: list[CommandAxis]
) -> ComFeedback | AngleFeedback:
    if spec.feedback == "joint_angles":
        return AngleFeedback(reference, axes)
    known = [Calibration(spec.walk_delay, spec.walk_sway if axis.letter == "y" else 1.0) for axis in axes]
    return ComFeedback(reference, axes, known)


class _Pendulum:
    """The pendulums of one axis: one a robot, and a last one that nothing disturbs.

    A pendulum's state is corrected by what is sensed, with a gain each for position and velocity; its
    acceleration is what the last jerks have made of it.
    """

    def __init__(self, spec: WieberMpcSpec, reference: WalkReference, axis: CommandAxis) -> None:
        dt = reference.step_s
        self.stride = round(spec.preview_step / dt)
        if self.stride < 1 or abs(self.stride * dt - spec.preview_step) > _TINY * dt:
            found = f"found {spec.preview_step * 1e3:g} ms"
            message = f"{found}; allowed: a multiple of the walk's control step, {dt * 1e3:g} ms"
            raise InputError(Problem("", 0, 0, f"{spec.controller}: preview_step", message))
        self._spec, self._dt = spec, dt
        self._mpc = JerkMpc(
            reference.com_height_m, spec.preview_step, spec.preview_steps, spec.zmp_weight, spec.solver
        )
        column = axis.column
        self._zmp = reference.zmp_m[:, column]
        self._low = reference.low_m[:, column] + spec.margin
        self._high = reference.high_m[:, column] - spec.margin
        if (self._low > self._zmp).any() or (self._high < self._zmp).any():
            room = min((self._zmp - self._low).min(), (self._high - self._zmp).min()) + spec.margin
            message = (
                f"found {spec.margin * 1e3:g} mm; allowed: at most {room * 1e3:.1f} mm, the planned ZMP's"
            )
            raise InputError(Problem("", 0, 0, f"{spec.controller}: margin", message))
        self._rows = reference.delayed_rows(spec.walk_delay)
        self._ahead = self.stride * np.arange(1, spec.preview_steps + 1)
        self._start = np.array(
            [
                reference.com_m[0, column],
                reference.com_velocity[0, column],
                reference.com_acceleration[0, column],
            ]
        )
        self._omega, self._reach = reference.omega, reference.com_per_lean_m()
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self._state = np.tile(self._start, (batch + 1, 1))
        self._optimum = Jerk(np.zeros(batch + 1), np.zeros(batch + 1), np.zeros(batch + 1, dtype=bool))

    def deviation(self) -> Array:
        """Position and velocity less those of the undisturbed walk; shape (2, B)."""
        deviation: Array = (self._state[:-1, :2] - self._state[-1, :2]).T
        return deviation

    def update(self, tick: int, position: Array, velocity: Array, there: NDArray[np.bool_]) -> None:
        """Correct the states and solve.

        Args:
            tick: Of the walk.
            position: By how much the CoM is further than thought; shape (B,), [m].
            velocity: By how much it is faster; shape (B,), [m/s].
            there: Which robots' readings are numbers; shape (B,).
        """
        calm, robots = self._state[-1], self._state[:-1]
        gains = (self._spec.position_gain, self._spec.velocity_gain)
        for k, (gain, error) in enumerate(zip(gains, (position, velocity), strict=True)):
            robots[:, k] += np.where(there, gain * error, 0.0)
        row = self._rows[tick]
        dcm = robots[:, 0] + robots[:, 1] / self._omega
        lost = np.abs(dcm - np.clip(dcm, self._low[row], self._high[row])) > _LOST_M
        robots[lost] = calm
        ahead = np.minimum(row + self._ahead, len(self._zmp) - 1)
        self._optimum = self._mpc.solve(self._state, self._zmp[ahead], self._low[ahead], self._high[ahead])

    def advance(self, trace: Array) -> Array:
        """Let a control step pass; the lean towards the positive end, shape (B,), [rad]."""
        spec, dt, jerk = self._spec, self._dt, self._optimum.jerk
        y, v, a = self._state.T.copy()
        self._state[:, 0] = y + dt * v + dt**2 / 2 * a + dt**3 / 6 * jerk
        self._state[:, 1] = v + dt * a + dt**2 / 2 * jerk
        self._state[:, 2] = a + dt * jerk
        com, zmp = self._state[:, 0], self._optimum.zmp_m
        trace[:, 0], trace[:, 1], trace[:, 2] = com[:-1], zmp[:-1], self._optimum.bounded[:-1]
        sine = np.clip((com[:-1] - com[-1]) / self._reach, -1.0, 1.0)
        lean = spec.follow * np.arcsin(sine) - spec.lean_per_zmp * (zmp[:-1] - zmp[-1])
        limited: Array = np.clip(lean, -spec.limit, spec.limit)
        return limited
