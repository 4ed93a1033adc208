"""Eqs. 3-10 against numbers worked out by hand, and against a leg drawn with ruler and compass."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from circuitkit.base.errors import SimulationError
from circuitkit.biped.gait import LegGeometry
from circuitkit.biped.gait import pattern as eq

LEGS = LegGeometry(
    thigh_m=0.1, tibia_m=0.1029, ankle_height_m=0.04519, hip_offset_y_m=0.05, hip_offset_z_m=0.085
)
angles = st.floats(-1.2, 1.2)


def degrees(value):
    return np.radians(np.asarray(value, dtype=float))


def test_eq_3_ankle_roll():
    roll = eq.ankle_roll(np.array([0.1, 0.0, -0.12]), np.array([0.2, 0.2, 0.2]))
    np.testing.assert_allclose(np.degrees(roll), [30.0, 0.0, -36.8698976], rtol=1e-8)


def test_eq_3_has_no_solution_beyond_the_length_of_the_leg():
    with pytest.raises(SimulationError) as caught:
        eq.ankle_roll(np.array([0.05, 0.25]), np.array(0.2))
    assert str(caught.value) == (
        "eq. 3 has no solution: a shift of 0.250 m with a leg of 0.200 m; allowed: less than that; "
        "lower the sideways ZMP"
    )


def test_eq_4_support_leg_length():
    """Ankle -30°, knee 60°: thigh and tibia both 30° from the vertical."""
    length = eq.support_leg_length(degrees([-30, 0]), degrees([60, 60]), LEGS)
    np.testing.assert_allclose(length, [0.2029 * math.sqrt(3) / 2, 0.1029 + 0.05], rtol=1e-12)


def test_eq_5_hip_roll():
    np.testing.assert_array_equal(eq.hip_roll(np.array([0.2, -0.1])), [-0.2, 0.1])


def test_eq_6_hip_pitch():
    """60° from the vertical is the thigh whose vertical part is half its length."""
    torso, alpha = degrees([0, 10]), degrees([20, 70])
    length = 0.1 * 0.5 + 0.1029 * np.cos(degrees([20, 60]))
    np.testing.assert_allclose(np.degrees(eq.hip_pitch(length, alpha, torso, LEGS)), [-60.0, -50.0])
    behind = eq.hip_pitch(length, alpha, torso, LEGS, thigh_back=np.array([True, True]))
    np.testing.assert_allclose(np.degrees(behind), [60.0, 70.0])


def test_eq_6_has_no_solution_for_a_leg_that_is_too_short():
    with pytest.raises(SimulationError) as caught:
        eq.hip_pitch(np.array([0.19, 0.21]), np.zeros(2), np.zeros(2), LEGS)
    assert str(caught.value) == (
        "eq. 6 has no solution: the leg is too short for this step; bend the knee more or step shorter"
    )


def test_eq_7_knee_pitch():
    np.testing.assert_allclose(eq.knee_pitch(np.array([0.4]), np.array([-0.5])), [0.9])


def test_eq_8_torso_pitch():
    np.testing.assert_allclose(eq.torso_pitch(*np.array([[-0.5], [0.9], [-0.3]])), [0.1])


def test_eq_9_moving_leg_length():
    length = eq.moving_leg_length(np.array(0.2), degrees([0, 60]), degrees([0, -60]), np.array([0.0, 0.02]))
    np.testing.assert_allclose(length, [0.2, (0.1 - 0.02) / 0.5], rtol=1e-12)


@given(angles, angles, angles)
def test_eqs_8_and_10_keep_the_foot_parallel_to_the_ground(torso, hip, knee):
    """The moving foot has the pitch of the supporting one, which stands flat."""
    ankle = eq.ankle_pitch(torso, hip, knee)
    assert eq.torso_pitch(hip, knee, ankle) == pytest.approx(torso, abs=1e-12)


@given(st.floats(-0.12, 0.12), st.floats(0.08, 0.2), st.floats(-0.4, 0.4))
def test_alpha_puts_the_foot_where_it_shall_be(forward, length, torso):
    """Thigh and tibia, one after the other, end at the ankle; the knee bends forward."""
    assume(math.hypot(forward, length) < 0.2029)
    forward, length, torso = (np.array([value]) for value in (forward, length, torso))
    alpha = eq.alpha_for_foot(forward, length, torso, LEGS)
    behind = eq.knee_is_behind(forward, alpha, torso, LEGS)
    hip = eq.hip_pitch(length, alpha, torso, LEGS, behind)
    knee = eq.knee_pitch(alpha, hip)
    thigh, tibia = hip - torso, hip + knee - torso  # pitch in the world, where the torso leans by -torso
    np.testing.assert_allclose(0.1 * np.cos(thigh) + 0.1029 * np.cos(tibia), length, atol=1e-9)
    np.testing.assert_allclose(-0.1 * np.sin(thigh) - 0.1029 * np.sin(tibia), forward, atol=1e-7)
    assert knee >= -1e-9


def test_a_foot_out_of_reach_is_refused():
    with pytest.raises(SimulationError) as caught:
        eq.alpha_for_foot(np.array([0.0, 0.15]), np.array([0.15, 0.2]), np.zeros(2), LEGS)
    assert str(caught.value) == (
        "the foot is 0.250 m from the hip, and the leg is 0.203 m long; bend the knee more or step shorter"
    )


def test_the_equations_take_arrays_of_any_shape():
    rng = np.random.default_rng(1)
    shift, lift, ahead = rng.uniform(-0.05, 0.05, (3, 4, 2))
    length = np.full((4, 2), 0.19)
    roll = eq.ankle_roll(shift, length)
    moving = eq.moving_leg_length(length, roll, eq.hip_roll(roll), np.abs(lift) / 3)
    torso = np.zeros((4, 2))
    alpha = eq.alpha_for_foot(ahead, moving, torso, LEGS)
    hip = eq.hip_pitch(moving, alpha, torso, LEGS, eq.knee_is_behind(ahead, alpha, torso, LEGS))
    assert hip.shape == (4, 2)
    one = eq.alpha_for_foot(ahead[2, 1], moving[2, 1], torso[2, 1], LEGS)
    assert alpha[2, 1] == one
