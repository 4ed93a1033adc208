"""A circuit in a loop at a fixed rate, as on a robot: how late its steps begin, and how long they take."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit.memory import require_memory
from circuitkit.engine.operations import FloatArray
from circuitkit.engine.program import Program
from circuitkit.engine.run import Stepper

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
        lateness_s: How long after its tick a step began, by percentile, [s].
        duration_s: How long a step took, by percentile, [s].
        most_late_s: The largest lateness, [s].
        longest_s: The longest step, [s].
    """

    name: str
    backend: str
    rate_hz: float
    seconds: float
    ticks: int
    missed: int
    lateness_s: dict[float, float]
    duration_s: dict[float, float]
    most_late_s: float
    longest_s: float


def realtime(
    program: Program, rate_hz: float = 1000.0, seconds: float = 60.0, inputs: FloatArray | None = None
) -> RealtimeReport:
    """Run a circuit at a fixed rate: every tick takes inputs and does one step.

    Between ticks the thread sleeps, and waits actively for the last part of the time. Nothing is allocated
    meanwhile, and the garbage collector is off. A tick that is missed is not made up for: the later ones keep
    their times.

    Args:
        program: The compiled circuit.
        rate_hz: Ticks per second, [Hz].
        seconds: Duration, [s].
        inputs: Shape (T, B, n_inputs), [SI]; repeated from the beginning when they end. Zeros by default.

    Raises:
        InputError: The rate is not above 0 and up to 100 kHz, the duration not above 0 and up to a day, or
            the inputs have a wrong shape.
        DivergedError: A number that is not finite came out.
    """
    ticks = _ticks(rate_hz, seconds)
    require_memory("seconds", f"{ticks} ticks", 8.0 * _TIMES * ticks)
    given = np.zeros((1, 1, len(program.input_names))) if inputs is None else np.asarray(inputs, np.float64)
    program.check_inputs(given)
    began, ended = _loop(program, rate_hz, ticks, given)
    due = np.arange(ticks) / rate_hz
    late, durations = began - due, ended - began
    return RealtimeReport(
        name=program.name,
        backend=program.backend,
        rate_hz=rate_hz,
        seconds=seconds,
        ticks=ticks,
        missed=int(np.count_nonzero(ended > due + 1.0 / rate_hz)),
        lateness_s=_percentiles(late),
        duration_s=_percentiles(durations),
        most_late_s=float(late.max()),
        longest_s=float(durations.max()),
    )


def _ticks(rate_hz: float, seconds: float) -> int:
    for where, value, most in (("rate", rate_hz, _FASTEST_HZ), ("seconds", seconds, _LONGEST_S)):
        if not 0.0 < value <= most:
            message = f"found {value:g}; allowed: numbers above 0, up to {most:g}"
            raise InputError(Problem("", 0, 0, where, message))
    return max(1, round(rate_hz * seconds))


def _loop(program: Program, rate_hz: float, ticks: int, inputs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times since the first tick at which each step began and ended, shape (ticks,), [s]."""
    stepper = Stepper(program, inputs.shape[1])
    own, step, rows = stepper.inputs, stepper.step, list(inputs)
    began, ended = np.zeros(ticks), np.zeros(ticks)  # written to here, so that the memory is there
    own[...] = rows[0]
    step()
    stepper.reset()
    clock, n_rows, period = time.perf_counter, len(rows), 1.0 / rate_hz
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        start = clock() + period
        for tick in range(ticks):
            due = start + tick * period
            pause = due - clock() - _SPIN_S
            if pause > 0.0:
                time.sleep(pause)
            while clock() < due:
                pass
            began[tick] = clock() - start
            own[...] = rows[tick % n_rows]
            step()
            ended[tick] = clock() - start
    finally:
        if was_enabled:
            gc.enable()
    return began, ended


def _percentiles(values: FloatArray) -> dict[float, float]:
    found = np.percentile(values, PERCENTILES)
    return {percentile: float(value) for percentile, value in zip(PERCENTILES, found, strict=True)}
