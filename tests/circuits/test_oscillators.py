"""The half-centre and Taga's pair against Matsuoka's published relation and against an independent solver."""

from __future__ import annotations

import numpy as np
import pytest
from oscillators import frequency, published_frequency, solved

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

HALF = {"tau": 0.132, "adaptation": 0.264, "b": 2.5}
PAIR = {"tau": 0.125, "adaptation": 0.156, "b": 2.5}
# Order: left flexor, left extensor, right flexor, right extensor.
TAGA = np.array([[0, 2, 1, 0], [2, 0, 0, 1], [1, 0, 0, 2], [0, 1, 2, 0]], dtype=float)
HALF_CENTRE = np.array([[0, 2], [2, 0]], dtype=float)


def _run(name, duration_s, overrides=None, inputs=None):
    """Time and trace; inputs by name are functions of time."""
    program = compile_circuit(load_circuit(name, overrides or {}))
    time_s = np.arange(round(duration_s / program.step_s)) * program.step_s
    table = np.zeros((len(time_s), 1, len(program.input_names)))
    for key, function in (inputs or {}).items():
        table[:, 0, program.input_index[key]] = function(time_s)
    return time_s + program.step_s, program, run(program, table)


def _rates(states):
    n = len(states) // 2
    return np.maximum(states[:n], 0)


@pytest.mark.parametrize("name", ["matsuoka_half_centre", "taga_oscillator"])
def test_there_are_no_errors_and_no_warnings(name):
    assert check(name) == ((), ())


# As shipped, and with an eighth of the substep. Where an output begins there is a kink: second order.
SUBSTEPS = pytest.mark.parametrize(("substeps", "tolerance"), [(2, 1e-4), (16, 2e-6)])


@SUBSTEPS
def test_the_half_centre_follows_the_solution_of_an_independent_solver(substeps, tolerance):
    time_s, program, trace = _run("matsuoka_half_centre", 5, {"substeps": substeps})
    solution = solved(HALF_CENTRE, **HALF, drive=1, start=[0.1, 0, 0, 0], duration_s=5)
    assert program.neuron_names[:2] == ("flexor", "extensor")
    np.testing.assert_allclose(trace.output[:, 0], _rates(solution(time_s)).T, atol=tolerance)


@SUBSTEPS
def test_taga_s_pair_follows_the_solution_of_an_independent_solver(substeps, tolerance):
    time_s, program, trace = _run("taga_oscillator", 5, {"substeps": substeps})
    solution = solved(TAGA, **PAIR, drive=1, start=[0.1, 0, 0, 0, 0, 0, 0, 0], duration_s=5)
    names = ["left.flexor", "left.extensor", "right.flexor", "right.extensor"]
    ours = trace.output[:, 0, [program.neuron_index[name] for name in names]]
    np.testing.assert_allclose(ours, _rates(solution(time_s)).T, atol=tolerance)


@pytest.mark.parametrize(
    ("a", "tau_ms", "tolerance"),
    [
        (2, 132, 0.01),
        (1.65, 132, 0.01),
        (2.4, 132, 0.01),
        (2.15, 264, 0.01),
        (2.4, 264, 0.01),
        (1.65, 66, 0.01),
    ],
)
def test_the_frequency_is_the_published_one(a, tau_ms, tolerance):
    """Where a is well below 1 + b; nearer to it the oscillation is no sine any more, and slower."""
    changes = {"inhibition": a, "tau": f"{tau_ms} ms"}
    time_s, _, trace = _run("matsuoka_half_centre", 24, changes)
    later = time_s > 8
    found = frequency(time_s[later], trace.readout[later, 0, 0])
    expected = published_frequency(a, tau=tau_ms * 1e-3, adaptation=0.264, b=2.5)
    assert found == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize(("coupling", "tolerance"), [(0.25, 0.01), (0.5, 0.01), (1, 0.06)])
def test_the_frequency_of_the_pair_is_that_of_the_sum_of_both_inhibitions(coupling, tolerance):
    time_s, _, trace = _run("taga_oscillator", 24, {"coupling": coupling})
    later = time_s > 8
    found = frequency(time_s[later], trace.readout[later, 0, 0])
    assert found == pytest.approx(published_frequency(2 + coupling, **PAIR), rel=tolerance)


def test_a_cycle_of_the_pair_takes_as_long_as_two_steps_of_the_nao():
    time_s, _, trace = _run("taga_oscillator", 24)
    later = time_s > 8
    assert 1 / frequency(time_s[later], trace.readout[later, 0, 0]) == pytest.approx(1.1, rel=0.01)


def test_left_and_right_alternate():
    """By half a cycle: once settled, each does what the other did half a cycle ago, and the sum vanishes."""
    _, program, trace = _run("taga_oscillator", 20)
    left, right = (trace.readout[1000:, 0, program.output_index[f"{side}_hip"]] for side in ("left", "right"))
    assert np.abs(left).max() > np.radians(5)
    np.testing.assert_allclose(left, -right, atol=1e-6)


@pytest.mark.parametrize("a", [1.4, 3.6])
def test_outside_the_published_bounds_it_comes_to_rest(a):
    """1 + tau / T = 1.5 < a < 1 + b = 3.5. Below, both rest at c / (1 + a + b); above, the first one keeps
    the other silent and rests at c / (1 + b)."""
    _, _, trace = _run("matsuoka_half_centre", 30, {"inhibition": a})
    rest = [1 / (1 + a + 2.5)] * 2 if a < 1.5 else [1 / 3.5, 0]
    np.testing.assert_allclose(trace.output[-1, 0], rest, atol=1e-4)


def test_twice_the_drive_is_twice_the_amplitude_and_the_same_time_course():
    _, _, once = _run("matsuoka_half_centre", 6)
    _, _, twice = _run("matsuoka_half_centre", 6, {"drive": 2, "start": 0.2})
    np.testing.assert_allclose(twice.readout, 2 * once.readout, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("ratio", [0.85, 1.15])
def test_it_follows_a_rhythm_that_is_not_far_from_its_own(ratio):
    own = published_frequency(2, **HALF)
    rhythm = {"feedback": lambda t: 0.3 * np.sin(2 * np.pi * ratio * own * t)}
    time_s, _, trace = _run("matsuoka_half_centre", 40, inputs=rhythm)
    later = time_s > 20
    assert frequency(time_s[later], trace.readout[later, 0, 0]) == pytest.approx(ratio * own, rel=2e-3)
