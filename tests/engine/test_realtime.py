"""The loop at a fixed rate: its counts, its times, and what it refuses."""

from __future__ import annotations

import gc
import os
import time

import numpy as np
import pytest

from circuitkit.base.errors import InputError, SimulationError
from circuitkit.circuit import load_circuit
from circuitkit.engine import Stepper, compile_circuit
from circuitkit.engine.realtime import PERCENTILES, realtime


@pytest.fixture(scope="module")
def program():
    return compile_circuit(load_circuit("binn_lateral"), backend="numpy")


def test_a_run_takes_its_time_and_counts_its_ticks(program):
    start = time.perf_counter()
    report = realtime(program, rate_hz=500.0, seconds=0.2)
    assert 0.2 <= time.perf_counter() - start < 2.0
    assert report.ticks == 100
    assert (report.name, report.rate_hz, report.seconds) == ("binn_lateral", 500.0, 0.2)
    assert 0 <= report.missed <= 100
    assert gc.isenabled()


def test_percentiles_ascend_up_to_the_largest(program):
    report = realtime(program, rate_hz=1000.0, seconds=0.1)
    for found, largest in (
        (report.lateness_s, report.most_late_s),
        (report.duration_s, report.longest_s),
    ):
        values = [found[percentile] for percentile in PERCENTILES]
        assert values == sorted(values)
        assert 0.0 <= values[0] <= values[-1] <= largest


class Clock:
    """Stands for `time` where the loop reads it: nothing passes but what sleeps, waits and steps take."""

    def __init__(self):
        self.now = 5.0

    def perf_counter(self):
        self.now += 1e-6
        return self.now

    def sleep(self, seconds):
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr("circuitkit.engine.realtime.time", clock)
    return clock


def stepping(program, monkeypatch, befalls):
    """Let every step of a real-time run call something first, with its number from 0; the warm-up has -1."""
    stepper, numbers = Stepper(program, 1), iter(range(-1, 10**6))
    quiet = stepper.step

    def step(inputs=None):
        befalls(next(numbers), stepper.inputs)
        return quiet(inputs)

    stepper.step = step
    monkeypatch.setattr("circuitkit.engine.realtime.Stepper", lambda _program, _batch: stepper)


def test_steps_longer_than_the_period_miss_all_deadlines(program, monkeypatch, clock):
    """A step that takes 3.5 ms at 1 kHz: begun at 0, 3.5 and 7 ms; the ticks between are left out."""
    stepping(program, monkeypatch, lambda _number, _inputs: clock.sleep(3.5e-3))
    report = realtime(program, rate_hz=1000.0, seconds=0.02)
    assert report.missed == report.ticks == 20
    assert report.skipped == 20 - 6  # done are 0, 3, 7, 10, 14, 17
    assert report.longest_s == pytest.approx(3.5e-3, abs=1e-4)
    assert report.most_late_s == pytest.approx(0.5e-3, abs=1e-4)


def test_a_stop_of_a_second_is_not_made_up_for(program, monkeypatch, clock):
    """The clock goes on by 1.0004 s in step 100 of a run at 1 kHz; later ticks keep times and inputs."""
    inputs = np.arange(2000.0).reshape(-1, 1, 1).repeat(2, axis=2) * 1e-6
    begun = []

    def befall(number, row):
        begun.append((clock.now, round(row[0, 0] * 1e6)))
        if number == 100:
            clock.sleep(1.0004)

    stepping(program, monkeypatch, befall)
    report = realtime(program, rate_hz=1000.0, seconds=2.0, inputs=inputs)
    assert (report.ticks, report.skipped, report.missed) == (2000, 999, 1000)  # 101 to 1099, and 100 itself
    times_s, ticks = zip(*begun[1:], strict=True)
    assert ticks == (*range(101), *range(1100, 2000))
    start = times_s[0]
    for time_s, tick in zip(times_s[:101] + times_s[102:], ticks[:101] + ticks[102:], strict=True):
        assert time_s - start == pytest.approx(tick * 1e-3, abs=1e-4)
    assert report.most_late_s == pytest.approx(0.4e-3, abs=1e-4)


def test_a_stop_between_two_ticks_is_not_made_up_for(program, monkeypatch, clock):
    stopped = clock.sleep

    def sleep(seconds):
        stopped(1.0 if 5.0505 < clock.now < 5.5 else seconds)

    monkeypatch.setattr(clock, "sleep", sleep)
    report = realtime(program, rate_hz=1000.0, seconds=2.0)
    assert 998 <= report.skipped == report.missed <= 1000


def test_a_run_that_was_stopped_from_its_beginning_to_its_end_is_none(program, monkeypatch, clock):
    monkeypatch.setattr(clock, "sleep", lambda _seconds: setattr(clock, "now", clock.now + 9.0))
    with pytest.raises(SimulationError, match="none of 1000 ticks began in its time"):
        realtime(program, rate_hz=1000.0, seconds=1.0)


def test_inputs_are_repeated(program, monkeypatch, clock):  # noqa: ARG001 - steps take no time
    inputs = np.random.default_rng(0).normal(size=(3, 2, 2)) * 0.1
    watched, seen = Stepper(program, 2), []
    quiet = watched.step

    def step(given=None):
        seen.append(watched.inputs.copy())
        return quiet(given)

    watched.step = step
    monkeypatch.setattr("circuitkit.engine.realtime.Stepper", lambda _program, _batch: watched)
    assert realtime(program, rate_hz=2000.0, seconds=0.01, inputs=inputs).ticks == 20
    np.testing.assert_array_equal(seen[1:], [inputs[tick % 3] for tick in range(20)])  # the first warms up


@pytest.mark.parametrize(
    ("rate", "seconds", "message"),
    [
        (0.0, 1.0, "rate: found 0; allowed: numbers above 0, up to 100000"),
        (1e9, 1.0, "rate: found 1e+09; allowed: numbers above 0, up to 100000"),
        (1000.0, -1.0, "seconds: found -1; allowed: numbers above 0, up to 86400"),
        (1000.0, 1e300, "seconds: found 1e+300; allowed: numbers above 0, up to 86400"),
        (1000.0, float("nan"), "seconds: found nan; allowed: numbers above 0, up to 86400"),
    ],
)
def test_rates_and_durations_that_no_run_can_have_are_refused(program, rate, seconds, message):
    with pytest.raises(InputError) as error:
        realtime(program, rate, seconds)
    assert str(error.value) == message


@pytest.mark.parametrize("priority", [0, 100, -1])
def test_a_priority_that_the_scheduler_does_not_have_is_refused(program, priority):
    with pytest.raises(InputError, match=f"priority: found {priority}; allowed: 1 to 99"):
        realtime(program, priority=priority)


def test_scheduling_that_is_refused_is_told_and_the_run_goes_on(program, monkeypatch, clock):  # noqa: ARG001 - steps take no time
    def refuse(*_arguments):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("os.sched_setscheduler", refuse, raising=False)
    monkeypatch.setattr(
        "circuitkit.engine.scheduling._lock_memory", lambda: "mlockall: Cannot allocate memory"
    )
    report = realtime(program, rate_hz=1000.0, seconds=0.01, priority=50)
    assert (report.scheduling.priority, report.scheduling.is_locked) == (None, False)
    assert report.scheduling.refusals == (
        "SCHED_FIFO: Operation not permitted",
        "mlockall: Cannot allocate memory",
    )


def test_scheduling_that_is_granted_ends_with_the_run(program, monkeypatch, clock):  # noqa: ARG001 - the same
    asked = []
    monkeypatch.setattr("os.sched_setscheduler", lambda *words: asked.append(words[1]), raising=False)
    monkeypatch.setattr("circuitkit.engine.scheduling._lock_memory", lambda: "mlockall: this system has none")
    report = realtime(program, rate_hz=1000.0, seconds=0.01, priority=50)
    assert (report.scheduling.priority, report.scheduling.is_locked) == (50, False)
    assert asked == [os.SCHED_FIFO, os.SCHED_OTHER]


def test_inputs_that_are_not_finite_are_refused(program):
    with pytest.raises(InputError, match=r"inputs.zmp_y: found nan at step 0, batch member 0"):
        realtime(program, inputs=np.array([[[0.0, np.nan]]]))
