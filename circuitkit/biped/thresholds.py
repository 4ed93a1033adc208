"""The verdict on a run: did it stand, how far did the ZMP go, when was it back inside."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.circuit import CircuitGraph
from circuitkit.biped.gait import GaitSpec
from circuitkit.robots import robot_channels
from circuitkit.biped.sensing import Observer
from circuitkit.simulation.loop import Setup, has_fallen, run_and_watch
from circuitkit.simulation.recording import Recording, support_by_load
from circuitkit.simulation.scenario import Thresholds

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
    fallen = has_fallen(recording.readings, recording.robot, recording.readings[0])[:, robot]
    return _verdict(
        fallen,
        recording.channel(thresholds.channel)[:, robot],
        threshold_lines(recording.yardstick or recording.circuit, thresholds)[recording.support[:, robot]],
        recording.fates.windows_s[robot, 0],
        recording.walk.gait,
    )


@dataclass(frozen=True)
class Judged:
    """What became of one robot, and what its controller did about it.

    Attributes:
        verdict: What became of it.
        rms: Of each command up to the end or to the fall, by name; SI units.
    """

    verdict: Verdict
    rms: Mapping[str, float]


def run_and_judge(
    setup: Setup,
    thresholds: Thresholds,
    progress: Callable[[int], object] | None = None,
    threads: int | None = None,
) -> tuple[Judged, ...]:
    """Run B robots for their verdicts alone: those of `run_loop` and `judge`, with less memory and time.

    Args:
        setup: What runs.
        thresholds: Where the ZMP counts as having crossed.
        progress: Is told the number of ticks that are done.
        threads: For the physics; by default all processors, one for one robot.

    Returns:
        One for each robot, the same to the last bit whatever the batch.

    Raises:
        InputError: The circuit has no such thresholds, or the robot no such channel.
    """
    lines = threshold_lines(setup.yardstick or setup.circuit, thresholds)
    available, name = robot_channels(setup.robot), thresholds.channel
    layout, observer = setup.robot.layout, Observer(setup.robot.layout, available, [name])
    used = np.flatnonzero((available[name].numerator != 0) | (available[name].denominator != 0))
    marks = [layout.torso_up.start + 2, layout.com.start + 2, *(layout.wrench(s).start + 2 for s in range(2))]
    columns = np.union1d(used, marks)
    watched = run_and_watch(setup, columns.tolist(), progress, threads)
    judged = []
    for i in range(len(setup.trials)):
        readings = np.zeros((len(watched.readings), layout.width))
        readings[:, columns] = watched.readings[:, i]
        fallen = has_fallen(readings, setup.robot, watched.first[i])
        zmp = observer(readings)[:, 0]
        loads = np.stack([readings[:, layout.wrench(s)][:, 2] for s in range(2)], axis=-1)
        start, gait = setup.fates.windows_s[i, 0], setup.walk.gait
        verdict = _verdict(fallen, zmp, lines[support_by_load(loads)], start, gait)
        end = int(fallen.argmax()) if fallen.any() else len(fallen)
        spent = np.ascontiguousarray(watched.commands[:end, i].T)
        rms = {
            command: math.sqrt(np.square(values).mean()) if end else 0.0
            for command, values in zip(setup.controller.commands, spent, strict=True)
        }
        judged.append(Judged(verdict, rms))
    return tuple(judged)


def _verdict(fallen: NDArray[np.bool_], zmp: Array, lines: Array, push_s: float, gait: GaitSpec) -> Verdict:
    """Judge a robot by where it had fallen, its ZMP and the lines for it; shapes (T,), (T,) and (T, 2)."""
    down = np.flatnonzero(fallen)
    fell = len(down) > 0
    dt = gait.control_step
    begin = 0 if np.isnan(push_s) else round(push_s / dt)
    end = int(down[0]) if fell else len(fallen)
    zmp, lines = zmp[begin:end], lines[begin:end]
    beyond = np.maximum(lines[:, 0] - zmp, zmp - lines[:, 1])
    return Verdict(
        survived=not fell,
        time_of_fall_s=(down[0] + 1.0) * dt if fell else None,
        max_zmp_excursion_m=float(max(beyond.max(initial=0.0), 0.0)),
        recovery_time_s=_recovery_s(beyond > _NOTHING_M, gait),
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
