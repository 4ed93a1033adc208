"""Three networks at 120 degrees: what is turned comes out turned, for either foot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run
from circuitkit.robots import load_robot

MIDDLE = np.array(
    [0.02015, 0.0534]
)  # of the cells of the left foot: before the ankle, left of the body's middle
W = math.radians(1.63)


@pytest.fixture(scope="module")
def program():
    return compile_circuit(load_circuit("binn_omnidirectional"))


def _moved(program, within_m, force=0.0):
    """How the body is turned to the front and to the left, for the ZMP within the foot; (T, 2) to (T, 2)."""
    inputs = np.zeros((len(within_m), 1, 3))
    inputs[:, 0, program.input_index["force_difference"]] = force
    inputs[:, 0, program.input_index["zmp_x"]] = within_m[:, 0] + MIDDLE[0]
    inputs[:, 0, program.input_index["zmp_y"]] = within_m[:, 1] + MIDDLE[1] * force
    readout = run(program, inputs).readout[:, 0]
    forward, left = (
        -readout[:, program.output_index["ankle_pitch"]],
        readout[:, program.output_index["ankle_roll"]],
    )
    return np.stack([forward, left], axis=-1)


def _turned(points, degrees):
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return points @ np.array([[cosine, sine], [-sine, cosine]])


_PLACES = st.lists(st.tuples(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08)), min_size=1, max_size=12)


def test_there_are_no_errors_and_no_warnings():
    assert check("binn_omnidirectional") == ((), ())


@pytest.mark.parametrize("degrees", [60, 120, 180, 240, 300])
@settings(max_examples=40, deadline=None)
@given(places=_PLACES)
def test_a_turned_zmp_gives_the_turned_response(program, degrees, places):
    """By 120 degrees the networks change places; by 180 each exchanges its ends; by 60 both."""
    within = np.array(places)
    expected = _turned(_moved(program, within), degrees)
    np.testing.assert_allclose(_moved(program, _turned(within, degrees)), expected, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(places=_PLACES)
def test_a_mirrored_zmp_gives_the_mirrored_response(program, places):
    within = np.array(places)
    mirror = np.array([1.0, -1.0])
    np.testing.assert_allclose(_moved(program, within * mirror), _moved(program, within) * mirror, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(places=_PLACES, force=st.floats(-1, 1))
def test_within_the_foot_it_is_the_same_for_either_foot_and_for_both(program, places, force):
    within = np.array(places)
    np.testing.assert_allclose(_moved(program, within, force), _moved(program, within), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_weighted_sum_of_the_inputs_is_the_zmp_within_the_foot(seed):
    """For any loads of the eight cells: the mean of the cells' places from the middle of their own foot."""
    feet = load_robot("nao").biped.feet
    places = np.array([*feet.left.cells.values(), *feet.right.cells.values()])
    loads = np.random.default_rng(seed).uniform(0, 20, 8)
    side = np.repeat([1.0, -1.0], 4)
    zmp_y = loads @ (places[:, 1] + 0.05 * side) / loads.sum()
    within = loads @ (places[:, 1] + (0.05 - MIDDLE[1]) * side) / loads.sum()
    assert zmp_y - MIDDLE[1] * (loads @ side) / loads.sum() == pytest.approx(within, abs=1e-15)


@pytest.mark.parametrize("degrees", range(0, 360, 15))
def test_the_body_moves_away_from_where_the_zmp_is(program, degrees):
    """Against the ZMP up to half a sector; along an axis of a network, exactly."""
    direction = _turned(np.array([[1.0, 0.0]]), degrees)[0]
    moved = _moved(program, 0.06 * direction[np.newaxis])[0]
    cosine = moved @ direction / np.linalg.norm(moved)
    assert cosine < -math.cos(math.radians(16))
    if degrees % 30 == 0:
        assert cosine == pytest.approx(-1, abs=1e-9)


def test_along_an_axis_the_step_is_two_thirds_of_what_three_networks_add_up_to(program):
    """ZMP 50 mm beyond an edge: of the network whose axis it is, q = sigmoid(5) = 0.9933 and
    p = sigmoid(4.933) = 0.99285. Along the other two axes it is 38.25 mm out, 11.75 mm beyond the edge:
    q = 0.7640, p = 0.9334; half of what each does is along the first axis. All: 2/3 w (0.99285 + 0.9334)."""
    moved = _moved(program, np.array([[0.0, 0.0765]]))[0]
    assert moved == pytest.approx([0.0, -2 / 3 * W * (0.99285 + 0.9334)], abs=1e-4 * W)


def test_in_the_middle_of_the_foot_it_is_silent(program):
    """q = sigmoid(-2.65) = 0.0660 at all six edges: no h fires, p = sigmoid(-4.34) = 0.0129, in balance."""
    assert np.abs(_moved(program, np.zeros((50, 2)))).max() < 1e-12
