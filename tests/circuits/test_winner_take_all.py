"""Lateral inhibition: what is known of it in closed form; see circuits/winner_take_all.yaml."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

N = 8


def _compiled(**changes):
    return compile_circuit(load_circuit("winner_take_all", changes))


@pytest.fixture(scope="module")
def program():
    return _compiled()


def _held(program, *phases):
    """Run phases of (inputs, control steps), one after the other; the trace of all."""
    table = np.concatenate([np.tile(inputs, (steps, 1, 1)) for inputs, steps in phases])
    return run(program, table)


def _choices(program, trace):
    first = program.neuron_index["choice[0]"]
    return trace.output[:, 0, first : first + N]


def test_there_are_no_errors_and_no_warnings():
    assert check("winner_take_all") == ((), ())


@settings(max_examples=60, deadline=None)
@given(inputs=st.lists(st.floats(0.05, 1), min_size=N, max_size=N))
def test_the_largest_input_wins_and_alone_is_left(program, inputs):
    second, first = sorted(inputs)[-2:]
    assume(second < 0.97 * first)
    trace = _held(program, (inputs, 150))
    winner = int(np.argmax(inputs))
    expected = np.zeros(N)
    expected[winner] = first
    np.testing.assert_allclose(_choices(program, trace)[-1], expected, atol=1e-6)
    towards = first * np.array([np.cos(2 * np.pi * winner / N), np.sin(2 * np.pi * winner / N)])
    np.testing.assert_allclose(trace.readout[-1, 0], towards, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(inputs=st.lists(st.floats(0, 1), min_size=N, max_size=N))
def test_nobody_overtakes_whom_has_more(program, inputs):
    """Where two are equal the one with the larger input is driven ahead, from the first step on."""
    choices = _choices(program, _held(program, (inputs, 30)))
    order = np.argsort(inputs, kind="stable")
    assert (np.diff(choices[:, order], axis=1) >= -1e-12).all()


@pytest.mark.parametrize(("other", "taken_over"), [(0.59, False), (0.61, True)])
def test_a_choice_is_held_until_another_input_is_w_times_as_large(program, other, taken_over):
    """w = 1.2: the silent ones see b - w x_k, so 0.6 takes the lead from 0.5."""
    before = np.full(N, 0.1)
    before[2] = 0.5
    after = before.copy()
    after[5] = other
    choices = _choices(program, _held(program, (before, 60), (after, 300)))
    assert choices[59].argmax() == 2
    winner = 5 if taken_over else 2
    expected = np.zeros(N)
    expected[winner] = after[winner]
    np.testing.assert_allclose(choices[-1], expected, atol=1e-6)


@pytest.mark.parametrize("w", [0.3, 0.9])
def test_weak_inhibition_does_not_choose(w):
    """Equal inputs b: x = b / (1 + (n - 1) w) for all."""
    program = _compiled(w=w)
    inputs = np.full(N, 0.8) + 1e-9 * np.arange(N)
    choices = _choices(program, _held(program, (inputs, 200)))
    np.testing.assert_allclose(choices[-1], 0.8 / (1 + (N - 1) * w), rtol=1e-6)


@pytest.mark.parametrize(("w", "grows"), [(0.9, False), (1.1, True)])
def test_from_w_1_on_a_small_difference_grows(w, grows):
    """While all are active a difference of potentials goes as exp((w - 1) t / tau)."""
    program = _compiled(w=w)
    inputs = np.full(N, 0.8)
    inputs[3] += 1e-6
    choices = _choices(program, _held(program, (inputs, 40)))
    difference = choices[:, 3] - choices[:, 0]
    rate = (
        np.log(difference[39] - 1e-6 / (1 - w)) - np.log(difference[19] - 1e-6 / (1 - w)) if grows else -1.0
    )
    if grows:
        assert rate == pytest.approx((w - 1) / 0.02 * 0.2, rel=0.03)
    else:
        assert difference[39] == pytest.approx(1e-6 / (1 - w), rel=0.2)
