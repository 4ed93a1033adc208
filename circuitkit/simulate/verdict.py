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


def judge(recording: Recording, thresholds: Thresholds, robot: int = 0) -> Verdict:
    """Judge one robot of a recording."""
    dt = recording.walk.gait.control_step
    first = recording.readings[0]
    fallen = np.flatnonzero(has_fallen(recording.readings, recording.robot, first)[:, robot])
    fell = len(fallen) > 0
    start = recording.fates.windows_s[robot, 0]
    begin = 0 if np.isnan(start) else round(start / dt)
    end = int(fallen[0]) if fell else recording.ticks
    lines = threshold_lines(recording.yardstick or recording.circuit, thresholds)[
        recording.support[begin:end, robot]
    ]
    zmp = recording.channel(thresholds.channel)[begin:end, robot]
    beyond = np.maximum(lines[:, 0] - zmp, zmp - lines[:, 1])
    return Verdict(
        survived=not fell,
        time_of_fall_s=float(recording.time_s[fallen[0]]) if fell else None,
        max_zmp_excursion_m=float(max(beyond.max(initial=0.0), 0.0)),
        recovery_time_s=_recovery_s(beyond > _NOTHING_M, recording.walk.gait),
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
