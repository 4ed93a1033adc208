"""Who acts, ankles or step: the truth table, the loop of hysteresis, and that nobody acts twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

LEFT_LIMIT, RIGHT_LIMIT = 0.08, -0.06
MARGIN, HOLD, KEPT = 0.02, 0.01, 0.25


@pytest.fixture(scope="module")
def program():
    changes = {"margin": f"{MARGIN} m", "hold": f"{HOLD} m", "ankle_while_stepping": f"{KEPT}"}
    return compile_circuit(load_circuit("hand_over", changes))


def answers(program, dcm_m):
    """Outputs for a series of DCMs [m]; shape (t, 3): ankles, step to the left, to the right."""
    order = [program.input_names.index(name) for name in ("dcm_y", "left_limit", "right_limit")]
    table = np.zeros((len(dcm_m), 1, 3))
    table[:, 0, order] = [(dcm, LEFT_LIMIT, RIGHT_LIMIT) for dcm in dcm_m]
    trace = run(program, table)
    names = ("ankle_share", "step_share_left", "step_share_right")
    return np.stack([trace.readout[:, 0, program.output_names.index(name)] for name in names], axis=1)


def test_there_are_no_errors_and_no_warnings():
    assert check("hand_over") == ((), ())


ANKLES, TO_LEFT, TO_RIGHT = (1.0, 0.0, 0.0), (KEPT, 1.0, 0.0), (KEPT, 0.0, 1.0)
TRUTH = {
    "on the plan": (0.0, ANKLES),
    "a step begins a margin inside the left limit": (LEFT_LIMIT - MARGIN + 1e-6, TO_LEFT),
    "and not before": (LEFT_LIMIT - MARGIN - 1e-6, ANKLES),
    "far out on the left": (0.4, TO_LEFT),
    "the same on the right": (RIGHT_LIMIT + MARGIN - 1e-6, TO_RIGHT),
    "and not before on the right": (RIGHT_LIMIT + MARGIN + 1e-6, ANKLES),
    "far out on the right": (-0.4, TO_RIGHT),
}


@pytest.mark.parametrize(("dcm_m", "expected"), TRUTH.values(), ids=TRUTH)
def test_the_truth_table(program, dcm_m, expected):
    np.testing.assert_array_equal(answers(program, [dcm_m])[0], expected)


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
def test_a_step_that_has_begun_ends_only_further_inside(program, side):
    limit = {1: LEFT_LIMIT, -1: RIGHT_LIMIT}[side]
    begin, end = limit - side * MARGIN, limit - side * (MARGIN + HOLD)
    between = (begin + end) / 2
    series = [between, begin + side * 1e-6, between, end + side * 1e-6, end - side * 1e-6, between]
    stepping = answers(program, series)[:, 1 if side == 1 else 2]
    np.testing.assert_array_equal(stepping, [0, 1, 1, 1, 0, 0])


@settings(max_examples=25, deadline=None)
@given(dcm_m=st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=30))
def test_it_is_always_the_ankles_or_one_step(program, dcm_m):
    for row in answers(program, dcm_m):
        assert tuple(row) in {ANKLES, TO_LEFT, TO_RIGHT}


@settings(max_examples=25, deadline=None)
@given(dcm_m=st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=30))
def test_it_is_a_relay_with_hysteresis(program, dcm_m):
    """Against the definition: on from the threshold, off below it by `hold`, left asked first."""
    state, expected = "", []
    for x in dcm_m:
        past = {"left": x - LEFT_LIMIT + MARGIN, "right": RIGHT_LIMIT + MARGIN - x}
        if state and past[state] + HOLD < 0:
            left_it = state
            # The side that was left still silences `left` in this step: it is seen as it was in the last one.
            state = "right" if past["right"] >= 0 and left_it == "left" else ""
        elif not state:
            state = next((side for side in ("left", "right") if past[side] >= 0), "")
        expected.append({"": ANKLES, "left": TO_LEFT, "right": TO_RIGHT}[state])
    np.testing.assert_array_equal(answers(program, dcm_m), expected)


def test_swapping_the_sides_swaps_the_answers(program):
    dcm_m = np.linspace(-0.2, 0.2, 41)
    mirrored = -(dcm_m - LEFT_LIMIT) + RIGHT_LIMIT
    for x, y in zip(dcm_m, mirrored, strict=True):
        there, back = answers(program, [x])[0], answers(program, [y])[0]
        np.testing.assert_array_equal(there, back[[0, 2, 1]])
