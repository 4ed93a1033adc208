"""The loop at a fixed rate: its counts, its times, and what it refuses."""

from __future__ import annotations

import gc
import time

import numpy as np
import pytest

from circuitkit.base.errors import InputError
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


def test_steps_longer_than_the_period_miss_all_deadlines(program, monkeypatch):
    """A step that takes 4 ms at 1 kHz: all ticks are missed, and each begins 3 ms later than the last."""
    slow = Stepper(program, 1)
    fast = slow.step

    def step(inputs=None):
        end = time.perf_counter() + 4e-3
        while time.perf_counter() < end:
            pass
        return fast(inputs)

    monkeypatch.setattr("circuitkit.engine.realtime.Stepper", lambda _program, _batch: slow)
    slow.step = step
    report = realtime(program, rate_hz=1000.0, seconds=0.02)
    assert report.missed == report.ticks == 20
    assert report.duration_s[50.0] >= 4e-3
    assert report.most_late_s >= 19 * 3e-3


def test_inputs_are_repeated(program, monkeypatch):
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


def test_inputs_that_are_not_finite_are_refused(program):
    with pytest.raises(InputError, match=r"inputs.zmp_y: found nan at step 0, batch member 0"):
        realtime(program, inputs=np.array([[[0.0, np.nan]]]))
