"""The shipped BiNN against section 4.2 of the paper, worked out by hand.

Geometry of the file (y to the left): left foot 26.9 to 79.9 mm, right foot -79.9 to -26.9 mm, both feet from
-79.9 to 79.9 mm. Load: force_difference is 1 on the left foot, -1 on the right one, 0 on both.

First layer, "determine whether each foot is on the ground or not" (slope 500, thresholds +-0.1); at the
loads used here they are 0 or 1 to more than 20 digits:
    load  1: lf = sigmoid(500 (1 - 0.1)) = 1, the others silent
    load  0: bf = sigmoid(50)^2 = 1,          the others silent (sigmoid(-50) = 2e-22)
    load -1: rf = 1,                          the others silent
Second layer: lf silences q1, q2; bf silences q2, q3; rf silences q3, q4. So what may speak is
    left foot:  q3 (its right edge, 26.9 mm)   and q4 (its left edge, 79.9 mm)
    both feet:  q1 (right edge, -79.9 mm)      and q4 (left edge, 79.9 mm)
    right foot: q1 (its right edge, -79.9 mm)  and q2 (its left edge, -26.9 mm)
With the slope 100 /m a q at a distance d beyond its edge is sigmoid(100 d):
    at the edge      sigmoid(0)    = 0.5, exactly
    50 mm beyond     sigmoid(5)    = 0.99331
    26.5 mm inside   sigmoid(-2.65) = 0.06598 (the middle of one foot)
    53 mm inside     sigmoid(-5.3)  = 0.00497 (the other edge of the same foot)
    79.9 mm inside   sigmoid(-7.99) = 0.00034 (the middle between both feet)
Last layers, p1 for right edges (q1 + q3), p2 for left edges (q2 + q4), h1 silences p2, h2 silences p1. With
p = sigmoid(10 (q - 0.5 - h of the other side)) and h = sigmoid(500 (q + p - 0.1)):
    q = 0.99331: p = sigmoid(4.9331) = 0.99285, its h = 1, so the other p = sigmoid(-15) = 3e-7
    q = 0.5:     p = sigmoid(0)      = 0.5,     its h = 1 (sigmoid(200)), the other p = 3e-7
    inside:      no q reaches h's threshold of 0.1, p = sigmoid(10 (0.06598 - 0.5)) = 0.01286 on both sides
Eq. 14: the ankle turns by w (p1 - p2) in the first step, to the left (positive) if the ZMP is too far right.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.circuit.load import load_circuit
from circuitkit.engine import compile_circuit, run, step

W = np.radians(1.63)
EDGE_OUTER, EDGE_INNER, MIDDLE, BEYOND = 0.0799, 0.0269, 0.0534, 0.05
TIMINGS = ("as_printed", "synchronous", "ordered")
LEFT, BOTH, RIGHT = 1.0, 0.0, -1.0

# load, ZMP [m], neurons that are active, neurons at exactly one half, what the ankle turns by / w
TABLE = {
    "left foot, beyond its left edge": (LEFT, EDGE_OUTER + BEYOND, "lf q4 h2 p2", "", -0.99285),
    "left foot, at its left edge": (LEFT, EDGE_OUTER, "lf h2", "q4 p2", -0.5),
    "left foot, inside": (LEFT, MIDDLE, "lf", "", 0.0),
    "left foot, at its right edge": (LEFT, EDGE_INNER, "lf h1", "q3 p1", 0.5),
    "left foot, beyond its right edge": (LEFT, EDGE_INNER - BEYOND, "lf q3 h1 p1", "", 0.99285),
    "both feet, beyond the left edge": (BOTH, EDGE_OUTER + BEYOND, "bf q4 h2 p2", "", -0.99285),
    "both feet, at the left edge": (BOTH, EDGE_OUTER, "bf h2", "q4 p2", -0.5),
    "both feet, inside": (BOTH, 0.0, "bf", "", 0.0),
    "both feet, at the right edge": (BOTH, -EDGE_OUTER, "bf h1", "q1 p1", 0.5),
    "both feet, beyond the right edge": (BOTH, -EDGE_OUTER - BEYOND, "bf q1 h1 p1", "", 0.99285),
    "right foot, beyond its left edge": (RIGHT, -EDGE_INNER + BEYOND, "rf q2 h2 p2", "", -0.99285),
    "right foot, at its left edge": (RIGHT, -EDGE_INNER, "rf h2", "q2 p2", -0.5),
    "right foot, inside": (RIGHT, -MIDDLE, "rf", "", 0.0),
    "right foot, at its right edge": (RIGHT, -EDGE_OUTER, "rf h1", "q1 p1", 0.5),
    "right foot, beyond its right edge": (RIGHT, -EDGE_OUTER - BEYOND, "rf q1 h1 p1", "", 0.99285),
}


@pytest.fixture(scope="module")
def graph() -> CircuitGraph:
    return load_circuit("binn_lateral")


def _outputs(program, state, member=0):
    return dict(zip(program.neuron_names, state.output[member].tolist(), strict=True))


@pytest.mark.parametrize("row", TABLE)
def test_which_neurons_fire_and_what_comes_out(graph, row):
    load, zmp, active, half, turn = TABLE[row]
    program = compile_circuit(graph)
    state = step(program, program.initial_state(), np.array([[load, zmp]]))
    outputs = _outputs(program, state)
    assert {name for name, value in outputs.items() if value > 0.9} == set(active.split())
    assert {name for name, value in outputs.items() if value == 0.5} == set(half.split())
    assert all(value < 0.1 for name, value in outputs.items() if name not in f"{active} {half}".split())
    assert state.readout[0, 0] == pytest.approx(turn * W, abs=1e-5 * W)


@pytest.mark.parametrize("timing", TIMINGS)
@pytest.mark.parametrize("row", TABLE)
def test_in_every_timing_the_same_neurons_fire_once_the_signals_are_through(graph, row, timing):
    load, zmp, active, half, _ = TABLE[row]
    program = compile_circuit(replace(graph, timing=timing))
    state = run(program, np.tile([load, zmp], (40, 1, 1))).state
    outputs = _outputs(program, state)
    assert {name for name, value in outputs.items() if value > 0.9} == set(active.split())
    assert {name for name, value in outputs.items() if 0.4 < value < 0.6} == set(half.split())


def test_at_the_thresholds_of_the_load_both_neurons_are_at_one_half(graph):
    program = compile_circuit(graph)
    inputs = np.array([[0.1, 0.0], [-0.1, 0.0]])
    state = step(program, program.initial_state(2), inputs)
    towards_left, towards_right = (_outputs(program, state, member) for member in (0, 1))
    # At 0.1: lf = sigmoid(0); bf = sigmoid(100) sigmoid(0); rf = sigmoid(-100). At -0.1 the mirror image.
    assert (towards_left["lf"], towards_left["bf"], towards_right["rf"], towards_right["bf"]) == (0.5,) * 4
    assert towards_left["rf"] == towards_right["lf"] == pytest.approx(np.exp(-100), rel=1e-6)


def test_the_margin_shows_in_the_output_before_the_edge_is_reached(graph):
    # Section 4.2: "outputs are produced before the ZMP approaches the boundaries". 10 mm inside the left edge
    # q4 = sigmoid(-1) = 0.26894: above h's threshold, so h2 = 1; p2 = sigmoid(-2.3106) = 0.09025.
    program = compile_circuit(graph)
    state = step(program, program.initial_state(), np.array([[BOTH, EDGE_OUTER - 0.01]]))
    outputs = _outputs(program, state)
    assert outputs["q4"] == pytest.approx(0.26894, abs=1e-5)
    assert outputs["h2"] == pytest.approx(1.0, abs=1e-12)
    assert outputs["p2"] == pytest.approx(0.09025, abs=1e-5)
    assert state.readout[0, 0] == pytest.approx(-0.09025 * W, rel=1e-4)


def test_when_the_zmp_jumps_across_one_p_is_silenced_before_the_other_one_speaks(graph):
    # Feedback inhibition: in the tick of the jump h2 still sees p2's last output and silences p1, while h1
    # sees q1 and silences p2 (feedforward). One tick later h2 sees p2 silent and lets p1 speak.
    program = compile_circuit(graph)
    left, right = [BOTH, EDGE_OUTER + BEYOND], [BOTH, -EDGE_OUTER - BEYOND]
    output = run(program, np.array([[left], [left], [right], [right]])).output[:, 0]
    p1, p2 = output[:, program.neuron_index["p1"]], output[:, program.neuron_index["p2"]]
    assert (p1 > 0.9).tolist() == [False, False, False, True]
    assert (p2 > 0.9).tolist() == [True, True, False, False]


def test_the_increments_accumulate_leak_and_stop_at_22_degrees(graph):
    # Held beyond the edge each step adds w p and loses 5 %: y = w p (1 - 0.95^t) / 0.05, limit 22 degrees.
    program = compile_circuit(graph)
    y = run(program, np.tile([LEFT, EDGE_INNER - BEYOND], (60, 1, 1))).readout[:, 0, 0]
    increment = 0.992846 * W
    series = increment * (1 - 0.95 ** np.arange(1, 61)) / 0.05
    assert (series > np.radians(22)).any()
    np.testing.assert_allclose(y, np.minimum(series, np.radians(22)), rtol=1e-5)


_WALKS = st.lists(
    st.tuples(st.sampled_from([LEFT, BOTH, RIGHT]) | st.floats(-1, 1), st.floats(-0.15, 0.15)),
    min_size=1,
    max_size=30,
)


@settings(max_examples=150, deadline=None)
@given(walk=_WALKS)
def test_never_are_both_p_active(graph, walk):
    program = compile_circuit(graph)
    output = run(program, np.array(walk)[:, np.newaxis]).output[:, 0]
    p1, p2 = output[:, program.neuron_index["p1"]], output[:, program.neuron_index["p2"]]
    assert (np.minimum(p1, p2) < 0.5).all()


@pytest.mark.parametrize("timing", TIMINGS)
@settings(max_examples=80, deadline=None)
@given(walk=_WALKS)
def test_the_mirror_image_gives_the_mirror_image_to_the_last_bit(graph, timing, walk):
    program = compile_circuit(replace(graph, timing=timing))
    inputs = np.array(walk)[:, np.newaxis]
    trace = run(program, np.concatenate([inputs, -inputs], axis=1))
    assert (trace.readout[:, 0] == -trace.readout[:, 1]).all()
    mirrored = {"lf": "rf", "bf": "bf", "q1": "q4", "q2": "q3", "p1": "p2", "h1": "h2"}
    for name, image in mirrored.items():
        here, there = program.neuron_index[name], program.neuron_index[image]
        assert (trace.output[:, 0, here] == trace.output[:, 1, there]).all(), name
        assert (trace.output[:, 1, here] == trace.output[:, 0, there]).all(), name
