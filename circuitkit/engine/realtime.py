"""A circuit in a loop at a fixed rate, as on a robot: how late its steps begin, and how long they take."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass

import numpy as np

from circuitkit.base.errors import InputError, Problem, SimulationError
from circuitkit.circuit.memory import require_memory
from circuitkit.engine.operations import FloatArray
from circuitkit.engine.program import Program
from circuitkit.engine.run import Stepper
from circuitkit.engine.scheduling import PRIORITIES, Scheduling, scheduled

_FASTEST_HZ = 100e3  # the clock itself is read in some 0.1 us
_LONGEST_S = 86400.0  # a day
_TIMES = 6  # kept of each tick, or worked out
PERCENTILES = (50.0, 90.0, 99.0, 99.9, 99.99)
# Sleeping ends late by some 60 us on a quiet machine: so much before a tick, waiting takes over.
_SPIN_S = 300e-6


@dataclass(frozen=True, eq=False)
class RealtimeReport:
    """What a real-time run measured.

    Attributes:
        name: Name of the circuit.
        backend: Name of the backend.
        rate_hz: Ticks per second.
        seconds: Duration, [s].
        ticks: Number of ticks.
        missed: Number of ticks whose step was not done when the next tick was due.
        skipped: How many of these were left out, for their whole period had passed.
        lateness_s: How long after its tick a step began, by percentile, [s].
        duration_s: How long a step took, by percentile, [s].
        most_late_s: The largest lateness, [s].
        longest_s: The longest step, [s].
        scheduling: What the operating system granted.
    """

    name: str
    backend: str
    rate_hz: float
    seconds: float
    ticks: int
    missed: int
    skipped: int
    lateness_s: dict[float, float]
    duration_s: dict[float, float]
    most_late_s: float
    longest_s: float
    scheduling: Scheduling


def realtime(
    program: Program,
    rate_hz: float = 1000.0,
    seconds: float = 60.0,
    inputs: FloatArray | None = None,
    priority: int | None = None,
) -> RealtimeReport:
    """Run a circuit at a fixed rate: every tick takes inputs and does one step.

    Between ticks the thread sleeps, and waits actively for the last part of the time. Nothing is allocated
    meanwhile, and the garbage collector is off. A tick that is missed is not made up for: one whose period
    has passed is left out, and the later ones keep their times and their inputs.

    Args:
        program: The compiled circuit.
        rate_hz: Ticks per second, [Hz].
        seconds: Duration, [s].
        inputs: Shape (T, B, n_inputs), [SI]; repeated from the beginning when they end. Zeros by default.
        priority: Of SCHED_FIFO, from 1 to 99, with locked memory, where the operating system allows it; see
            `Scheduling`. None asks for neither.

    Raises:
        InputError: The rate is not above 0 and up to 100 kHz, the duration not above 0 and up to a day, the
            priority none of SCHED_FIFO, or the inputs have a wrong shape.
        DivergedError: A number that is not finite came out.
        SimulationError: The process stood still from the first tick to the last.
    """
    ticks = _ticks(rate_hz, seconds)
    if priority is not None and priority not in PRIORITIES:
        message = f"found {priority}; allowed: {PRIORITIES[0]} to {PRIORITIES[-1]}"
        raise InputError(Problem("", 0, 0, "priority", message))
    require_memory("seconds", f"{ticks} ticks", 8.0 * _TIMES * ticks)
    given = np.zeros((1, 1, len(program.input_names))) if inputs is None else np.asarray(inputs, np.float64)
    program.check_inputs(given)
    began, ended, scheduling = _loop(program, rate_hz, ticks, given, priority)
    done = np.flatnonzero(~np.isnan(began))
    if not len(done):
        message = f"none of {ticks} ticks began in its time: the process stood still for {seconds:g} s"
        raise SimulationError(message)
    due = done / rate_hz
    late, durations = began[done] - due, ended[done] - began[done]
    skipped = ticks - len(done)
    return RealtimeReport(
        name=program.name,
        backend=program.backend,
        rate_hz=rate_hz,
        seconds=seconds,
        ticks=ticks,
        missed=skipped + int(np.count_nonzero(ended[done] > due + 1.0 / rate_hz)),
        skipped=skipped,
        lateness_s=_percentiles(late),
        duration_s=_percentiles(durations),
        most_late_s=float(late.max()),
        longest_s=float(durations.max()),
        scheduling=scheduling,
    )


def _ticks(rate_hz: float, seconds: float) -> int:
    for where, value, most in (("rate", rate_hz, _FASTEST_HZ), ("seconds", seconds, _LONGEST_S)):
        if not 0.0 < value <= most:
            message = f"found {value:g}; allowed: numbers above 0, up to {most:g}"
            raise InputError(Problem("", 0, 0, where, message))
    return max(1, round(rate_hz * seconds))


def _loop(
    program: Program, rate_hz: float, ticks: int, inputs: FloatArray, priority: int | None
) -> tuple[FloatArray, FloatArray, Scheduling]:
    """Return times since the first tick at which each step began and ended, shape (ticks,), [s].

    They are NaN where a tick was left out.
    """
    stepper = Stepper(program, inputs.shape[1])
    own, step, rows = stepper.inputs, stepper.step, list(inputs)
    began, ended = np.full(ticks, np.nan), np.full(ticks, np.nan)  # written to, so that the memory is there
    own[...] = rows[0]
    step()
    stepper.reset()
    clock, n_rows, period = time.perf_counter, len(rows), 1.0 / rate_hz
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        with scheduled(priority) as scheduling:
            start = clock() + period
            tick = 0
            while tick < ticks:
                due = start + tick * period
                pause = due - clock() - _SPIN_S
                if pause > 0.0:
                    time.sleep(pause)
                while clock() < due:
                    pass
                now = clock() - start
                tick = max(tick, int(now * rate_hz))  # those before have passed
                if tick >= ticks:
                    break
                began[tick] = now
                own[...] = rows[tick % n_rows]
                step()
                ended[tick] = clock() - start
                tick += 1
    finally:
        if was_enabled:
            gc.enable()
    return began, ended, scheduling


def _percentiles(values: FloatArray) -> dict[float, float]:
    found = np.percentile(values, PERCENTILES)
    return {percentile: float(value) for percentile, value in zip(PERCENTILES, found, strict=True)}
