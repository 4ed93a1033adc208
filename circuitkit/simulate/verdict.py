"""The verdict on a run: did it stand, how far did the ZMP go, when was it back inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.circuit import CircuitGraph
from circuitkit.errors import InputError, Problem, listing, suggest
from circuitkit.gait import GaitSpec
from circuitkit.simulate.loop import has_fallen
from circuitkit.simulate.recording import Recording
from circuitkit.simulate.scenario import Thresholds

Array = NDArray[np.float64]

_NOTHING_M = 1e-9  # rounding, not a crossing


@dataclass(frozen=True)
class Verdict:
    """What became of one robot.

    Attributes:
        survived: Whether it stood at the end.
        time_of_fall_s: When it leaned by more than 45 degrees; None if it did not.
        max_zmp_excursion_m: How far the ZMP was outside the circuit's thresholds after the push began, at
            most; 0 if it never was.
        recovery_time_s: From the first time outside to being back inside for at least a whole step; None if
            it never was outside, or never came back.
    """

    survived: bool
    time_of_fall_s: float | None
    max_zmp_excursion_m: float
    recovery_time_s: float | None


def threshold_lines(circuit: CircuitGraph, thresholds: Thresholds) -> Array:
    """Where the ZMP crosses the circuit's thresholds, by who carries.

    A neuron with shift s that takes the ZMP with weight w is half active where w times the ZMP is s.

    Returns:
        Shape (3, 2): left foot, right foot, both; right edge, left edge; [m].

    Raises:
        InputError: The circuit has no such neuron, or it does not take the ZMP.
    """
    neurons = {neuron.name: neuron for neuron in circuit.neurons}
    weights = {s.target: s.weight for s in circuit.synapses if s.source == thresholds.channel}
    lines = np.zeros((3, 2))
    for i, part in enumerate(("left_foot", "right_foot", "both_feet")):
        edges = getattr(thresholds, part)
        for j, name in enumerate((edges.right, edges.left)):
            neuron = neurons.get(name)
            if neuron is None or name not in weights or "shift" not in neuron.parameters:
                allowed = [n for n in weights if "shift" in neurons[n].parameters]
                found = (
                    f"'{name}': no neuron of '{circuit.name}' with a shift that reads '{thresholds.channel}'"
                )
                message = f"found {found}; allowed: {listing(allowed)}"
                raise InputError(Problem("", 0, 0, f"thresholds.{part}", message, suggest(name, allowed)))
            lines[i, j] = neuron.parameters["shift"] / weights[name]
    return lines


@dataclass(frozen=True)
class Verdicts:
    """What became of B robots; each array of shape (B,), not a number where a `Verdict` has None."""

    survived: NDArray[np.bool_]
    time_of_fall_s: Array
    max_zmp_excursion_m: Array
    recovery_time_s: Array

    def __getitem__(self, robot: int) -> Verdict:
        """The verdict on one robot."""
        fall, recovery = float(self.time_of_fall_s[robot]), float(self.recovery_time_s[robot])
        return Verdict(
            survived=bool(self.survived[robot]),
            time_of_fall_s=None if np.isnan(fall) else fall,
            max_zmp_excursion_m=float(self.max_zmp_excursion_m[robot]),
            recovery_time_s=None if np.isnan(recovery) else recovery,
        )


def judge(recording: Recording, thresholds: Thresholds, robot: int = 0) -> Verdict:
    """Judge one robot of a recording."""
    return judge_all(recording, thresholds)[robot]


def judge_all(recording: Recording, thresholds: Thresholds) -> Verdicts:
    """Judge all robots of a recording at once."""
    gait = recording.walk.gait
    fallen = has_fallen(recording.readings, recording.robot, recording.readings[0])
    fell = fallen.any(axis=0)
    end = np.where(fell, fallen.argmax(axis=0), recording.ticks)
    starts = recording.fates.windows_s[:, 0]
    begin = np.round(np.where(np.isnan(starts), 0.0, starts) / gait.control_step)
    tick = np.arange(recording.ticks)[:, None]
    counted = (tick >= begin) & (tick < end)

    lines = threshold_lines(recording.yardstick or recording.circuit, thresholds)
    right, left = (edge[recording.support] for edge in lines.T)
    zmp = recording.channel(thresholds.channel)
    beyond = np.where(counted, np.maximum(right - zmp, zmp - left), 0.0)
    ends = np.minimum(end, recording.ticks)
    outside = beyond > _NOTHING_M
    recovery = [_recovery_s(column[:stop], gait) for column, stop in zip(outside.T, ends, strict=True)]
    return Verdicts(
        survived=~fell,
        time_of_fall_s=np.where(fell, recording.time_s[np.minimum(end, recording.ticks - 1)], np.nan),
        max_zmp_excursion_m=np.maximum(beyond.max(axis=0, initial=0.0), 0.0),
        recovery_time_s=np.array([np.nan if each is None else each for each in recovery]),
    )


def _recovery_s(outside: NDArray[np.bool_], gait: GaitSpec) -> float | None:
    """From the first tick outside to the first after which a whole step is spent inside."""
    crossings = np.flatnonzero(outside)
    if len(crossings) == 0:
        return None
    quiet = np.diff(np.append(crossings, len(outside))) > gait.step_ticks
    if not quiet.any():
        return None
    back = crossings[quiet.argmax()] + 1
    return float((back - crossings[0]) * gait.control_step)
