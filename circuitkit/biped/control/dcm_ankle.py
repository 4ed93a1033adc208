"""The plain engineer's answer: the ankles lean against the error of the DCM and against its rate."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from circuitkit.base.source import FileModel
from circuitkit.base.source.fields import Radians, RadianSecondsPerMetre, RadiansPerMetre, Ratio, Seconds
from circuitkit.biped.control.reference import WalkReference, gait_knowledge
from circuitkit.biped.control.sensed_com import AxisName, CommandAxis
from circuitkit.biped.control.state_feedback import Calibration, ComFeedback
from circuitkit.control import Array, ControllerSpec, Interface


class AxisGains(FileModel):
    """The numbers of one axis."""

    proportional: RadiansPerMetre = Field(
        ge=0, description="Lean of the ankle for each metre of the DCM's error."
    )
    derivative: RadianSecondsPerMetre = Field(
        default=0.0, ge=0, description="Lean for each metre a second by which the error grows."
    )
    derivative_filter: Seconds = Field(
        default=0.02, ge=0, description="Time constant of the low-pass on the rate."
    )
    limit: Radians = Field(gt=0, description="Largest lean.")
    walk_delay: Seconds = Field(
        default=0.0, ge=0, description="By how much the robot is known to walk behind its plan."
    )
    walk_sway: Ratio = Field(
        default=1.0, gt=0, description="Part of the planned motion that the robot is known to make."
    )


class DcmAnkleSpec(ControllerSpec):
    """Leans the ankles against the error of the DCM (capture point) by a PD law."""

    kind: ClassVar[str] = "dcm_ankle"

    lateral: AxisGains | None = Field(default=None, description="Acts on ankle_roll.")
    sagittal: AxisGains | None = Field(default=None, description="Acts on ankle_pitch.")

    @model_validator(mode="after")
    def _acts(self) -> DcmAnkleSpec:
        if not self.gains:
            message = "neither lateral nor sagittal is there; allowed: one of them, or both"
            raise ValueError(message)
        return self

    @property
    def gains(self) -> dict[AxisName, AxisGains]:
        """The axes that it acts on."""
        both: dict[AxisName, AxisGains | None] = {"lateral": self.lateral, "sagittal": self.sagittal}
        return {name: gains for name, gains in both.items() if gains is not None}

    def bind(self, interface: Interface) -> DcmAnkle:
        """The controller for a walk."""
        return DcmAnkle(self, gait_knowledge(interface.reference, self.controller))


class DcmAnkle:
    """PD on the DCM: theta = -(K_p e + K_d e'), e = xi - xi_walk, xi = y + y' / omega.

    Theta is the lean that moves the body towards +y; the rate e' is a difference over one control step behind
    a low-pass; xi_walk is the DCM of the undisturbed walk, see `ComFeedback`. Where a reading is missing (not
    a number), so is the command.
    """

    def __init__(self, spec: DcmAnkleSpec, reference: WalkReference) -> None:
        """Bind the numbers to a walk."""
        self.name = spec.controller
        axes, gains = [CommandAxis(name) for name in spec.gains], list(spec.gains.values())
        known = [Calibration(each.walk_delay, each.walk_sway) for each in gains]
        self._feedback = ComFeedback(reference, axes, known)
        self.observations = self._feedback.observations
        self.commands = tuple(axis.ankle for axis in axes)
        self.trace_names = tuple(f"dcm_error_{axis.letter}" for axis in axes)
        self._omega, self._step_s = reference.omega, reference.step_s
        self._signs = np.array([axis.sign for axis in axes])
        self._proportional = np.array([each.proportional for each in gains])
        self._derivative = np.array([each.derivative for each in gains])
        self._limit = np.array([each.limit for each in gains])
        tau = np.array([each.derivative_filter for each in gains])
        self._keep = np.exp(-reference.step_s / np.maximum(tau, np.finfo(float).tiny))
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        shape = (batch, len(self.commands))
        self._tick = 0
        self._error, self._rate = np.full(shape, np.nan), np.zeros(shape)

    def step(self, observation: Array) -> Array:
        """The ankles' angles; shape (B, m), [rad]."""
        position, velocity = self._feedback.read(self._tick, observation)
        error = position + velocity / self._omega
        there = np.isfinite(error)
        grown = np.where(there & np.isfinite(self._error), error - self._error, 0.0) / self._step_s
        rate = self._keep * self._rate + (1.0 - self._keep) * grown
        lean = -(self._proportional * error + self._derivative * rate)
        command: Array = self._signs * np.clip(lean, -self._limit, self._limit)
        self._rate = np.where(there, rate, self._rate)
        self._error = np.where(there, error, self._error)
        self._tick += 1
        self._shown = error
        return command

    def store_trace(self, row: Array) -> None:
        """Write the errors of the DCM; shape (B, n), [m]."""
        row[...] = self._shown
