"""The plain engineer's answer: the ankles lean against the error of the DCM and against its rate."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import Field

from circuitkit.control.controller import Array
from circuitkit.control.reference import WalkReference
from circuitkit.control.sensed_com import AXES, AxisName, CommandAxis, SensedCom
from circuitkit.source import FileModel
from circuitkit.source.fields import Radians, RadianSecondsPerMetre, RadiansPerMetre, Seconds


class DcmAnkleSpec(FileModel):
    """A controller file of the kind `dcm_ankle`."""

    controller: str = Field(description="Name.")
    description: str = ""
    kind: Literal["dcm_ankle"]
    axes: tuple[AxisName, ...] = Field(
        default=("lateral",), min_length=1, description="lateral (ankle_roll), sagittal (ankle_pitch)."
    )
    proportional: RadiansPerMetre = Field(
        ge=0, description="Lean of the ankle for each metre of the DCM's error."
    )
    derivative: RadianSecondsPerMetre = Field(
        default=0.0, ge=0, description="Lean for each metre a second by which the error grows."
    )
    derivative_filter: Seconds = Field(
        default=0.02, ge=0, description="Time constant of the low-pass on the rate."
    )
    reference_delay: Seconds = Field(
        default=0.0, ge=0, description="By how much the robot is known to walk behind its plan."
    )
    limit: Radians = Field(gt=0, description="Largest lean.")

    def build(self, reference: WalkReference) -> DcmAnkle:
        """The controller for a walk."""
        return DcmAnkle(self, reference)


class DcmAnkle:
    """PD on the DCM: theta = -(K_p e + K_d e'), e = xi - xi_ref, xi = y + y' / omega.

    Theta is the lean that moves the body towards +y; the rate e' is a difference over one control step behind
    a low-pass. The reference is the DCM of the point mass whose ZMP is that of the plan. Where a reading is
    missing (not a number), that robot's command stays what it was.
    """

    def __init__(self, spec: DcmAnkleSpec, reference: WalkReference) -> None:
        """Bind the numbers to a walk."""
        self.name = spec.controller
        self._axes = [CommandAxis(name) for name in spec.axes]
        self._sensed = SensedCom(reference, self._axes)
        self.observations = self._sensed.observations
        self.commands = tuple(axis.ankle for axis in self._axes)
        self.trace_names = tuple(f"dcm_error_{axis.letter}" for axis in self._axes)
        self._spec, self._omega = spec, reference.omega
        self._step_s = reference.step_s
        delay = round(spec.reference_delay / reference.step_s)
        columns = [axis.column for axis in self._axes]
        rows = np.maximum(np.arange(reference.walk.ticks) - delay, 0)
        self._reference = reference.dcm_m[rows][:, columns]
        self._sign = np.array([axis.sign for axis in self._axes])
        tau = spec.derivative_filter
        self._keep = math.exp(-reference.step_s / tau) if tau > 0 else 0.0
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        shape = (batch, len(self._axes))
        self._tick = 0
        self._error, self._rate, self._command = np.full(shape, np.nan), np.zeros(shape), np.zeros(shape)

    def step(self, observation: Array, trace: Array) -> Array:
        """The ankles' angles; shape (B, m), [rad]; the DCM's errors go to `trace`."""
        spec = self._spec
        position, velocity = self._sensed.read(self._tick, observation)
        error = position + velocity / self._omega - self._reference[self._tick]
        there = np.isfinite(error)
        grown = np.where(there & np.isfinite(self._error), error - self._error, 0.0) / self._step_s
        rate = self._keep * self._rate + (1.0 - self._keep) * grown
        lean = -(spec.proportional * error + spec.derivative * rate)
        command = self._sign * np.clip(lean, -spec.limit, spec.limit)
        self._command = np.where(there, command, self._command)
        self._rate = np.where(there, rate, self._rate)
        self._error = np.where(there, error, self._error)
        self._tick += 1
        trace[...] = error
        return self._command


__all__ = ["AXES", "DcmAnkle", "DcmAnkleSpec"]
