"""What is learnt, how fast, and what is not: Hebb's rule in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

RATE, DECAY, START, LIMIT = 0.002, 0.0002, 0.01, 10.0  # limit: rate / decay


@pytest.fixture(scope="module")
def program():
    return compile_circuit(load_circuit("conditioned_reflex"))


def _run(program, *phases):
    """Phases of (touch, sound, awake, steps): the weight and the joint [rad] after each step."""
    rows = []
    for touch, sound, awake, steps in phases:
        rows += [program.pack_inputs({"touch": touch, "sound": sound, "awake": awake})] * steps
    trace = run(program, np.array(rows), states=True)
    return trace.states[:, 0, 0], trace.readout[:, 0, 0]


def test_there_are_no_errors_and_no_warnings():
    assert check("conditioned_reflex") == ((), ())


def test_a_touch_makes_it_withdraw_and_a_sound_does_not(program):
    _, bent = _run(program, (1, 0, 1, 5), (0, 0, 1, 5), (0, 1, 1, 5))
    assert bent.tolist() == pytest.approx([np.radians(30)] * 5 + [0] * 10)


def test_paired_with_touches_the_weight_grows_as_the_closed_form_says(program):
    weight, _ = _run(program, (1, 1, 1, 800))
    t = np.arange(1, 801)
    expected = np.minimum(LIMIT - (LIMIT - START) * (1 - DECAY) ** t, 1)
    np.testing.assert_allclose(weight, expected, rtol=1e-9)


@pytest.mark.parametrize(("paired", "answers"), [(251, False), (252, True)])
def test_then_the_sound_alone_makes_it_withdraw(program, paired, answers):
    """Past the threshold of 0.5 after ln(9.99 / 9.5) / 0.0002 = 251.5 steps."""
    _, bent = _run(program, (1, 1, 1, paired), (0, 1, 1, 1))
    assert (bent[-1] > 0) == answers


def test_sound_and_touch_one_after_the_other_teach_nothing(program):
    weight, bent = _run(program, *[(1, 0, 1, 10), (0, 1, 1, 10)] * 40)
    assert weight[-1] == pytest.approx(START * (1 - DECAY) ** 800)
    assert not bent.reshape(40, 2, 10)[:, 1].any()


def test_what_was_learnt_is_forgotten_when_nothing_is_heard(program):
    weight, _ = _run(program, (1, 1, 1, 300), (0, 0, 1, 1000))
    np.testing.assert_allclose(weight[300:], weight[299] * (1 - DECAY) ** np.arange(1, 1001), rtol=1e-9)


def test_while_it_is_not_awake_it_learns_but_does_not_act(program):
    weight, bent = _run(program, (1, 1, 0, 300), (0, 1, 0, 5), (0, 1, 1, 5))
    assert weight[299] > 0.5
    assert not bent[:305].any()
    assert bent[305:] == pytest.approx(np.radians(30))
