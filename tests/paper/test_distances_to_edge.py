"""Ways to the edge of a support polygon, against plane geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.paper.push_bounds import distances_to_edge

SQUARE = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
EIGHTHS = np.radians(np.arange(0, 360, 45))
angles = st.floats(0.0, 2 * math.pi)


def test_from_the_middle_of_a_square_it_is_one_to_the_sides_and_the_root_of_two_to_the_corners():
    expected = [1.0, math.sqrt(2.0)] * 4
    np.testing.assert_allclose(distances_to_edge(np.zeros(2), EIGHTHS, SQUARE), expected)


def test_forward_is_zero_degrees_and_left_is_ninety():
    found = distances_to_edge(np.array([0.25, 0.5]), np.radians([0, 90, 180, 270]), SQUARE)
    np.testing.assert_allclose(found, [0.75, 0.5, 1.25, 1.5])


@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), angles)
def test_the_end_of_the_way_is_on_the_edge_and_no_point_before_is_outside(x, y, angle):
    way = np.array([math.cos(angle), math.sin(angle)])
    (length,) = distances_to_edge(np.array([x, y]), np.array([angle]), SQUARE)
    assert np.abs(np.array([x, y]) + length * way).max() == pytest.approx(1.0)


@given(angles)
def test_two_feet_reach_where_a_rope_around_them_does(angle):
    """The hull of two soles is what counts, and a corner inside it changes nothing."""
    feet = np.concatenate([SQUARE * [1.5, 0.5] + [0, 1], SQUARE * [1.5, 0.5] - [0, 1], [[0.1, 0.2]]])
    around = np.array([[-1.5, -1.5], [-1.5, 1.5], [1.5, -1.5], [1.5, 1.5]])
    one, other = (distances_to_edge(np.array([0.3, 0.4]), np.array([angle]), c) for c in (feet, around))
    np.testing.assert_allclose(one, other)


def test_who_is_outside_has_no_way_further_out():
    found = distances_to_edge(np.array([1.2, 0.0]), np.array([0.0, math.pi]), SQUARE)
    np.testing.assert_allclose(found, [0.0, 2.2])
