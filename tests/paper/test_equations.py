"""The design equations: the paper's own numbers, inverses, monotony, limits, scaling of units."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from circuitkit.base.errors import InputError
from circuitkit.paper import equations as eq

MASS, HEIGHT, STEP = 5.18, 0.27, 0.01  # section 4.2 and 5.1
ROBOT = (MASS, HEIGHT, STEP)

forces = st.floats(0.5, 60.0)
durations = st.floats(0.02, 0.99)
masses = st.floats(1.0, 90.0)
heights = st.floats(0.1, 1.2)
distances = st.floats(0.005, 0.3)


def deg(angle_rad):
    return math.degrees(angle_rad)


# The numbers that the paper prints, or that follow from those it prints.


def test_eq_13_of_the_paper():
    """Section 4.2: 73.44 mN m move the ZMP by 0.0014 m, a 42nd of the 0.06 m that the CoM can shift."""
    shift = eq.zmp_shift_from_acceleration(eq.com_acceleration_from_torque(73.44e-3, MASS, HEIGHT), HEIGHT)
    assert shift == pytest.approx(0.0014, abs=5e-5)
    assert 0.06 / shift == pytest.approx(42, abs=0.5)


def test_eq_13_with_the_gear():
    """14.8 N m at the joint; the sole's edge, 50 mm from the ankle at most, ends at a sixth of it."""
    torque = eq.joint_torque(73.44e-3, 201.3)
    assert torque == pytest.approx(14.8, abs=0.05)
    assert eq.torque_at_edge(0.05, MASS) < torque / 5
    acceleration = eq.com_acceleration_from_torque(eq.torque_at_edge(0.05, MASS), MASS, HEIGHT)
    assert eq.zmp_shift_from_acceleration(acceleration, HEIGHT) == pytest.approx(0.05, rel=1e-12)


def test_eq_16_at_the_ankles_limit():
    """Section 4.2 has 0.06 m at 22 degrees. That is a lever of 0.16 m; with z_CoM it would be 0.10 m."""
    assert eq.com_shift_from_angle(math.radians(22), HEIGHT) == pytest.approx(0.101, abs=5e-4)
    assert eq.com_shift_from_angle(math.radians(22), 0.16) == pytest.approx(0.06, abs=1e-4)


def test_eq_21_for_the_push_of_the_paper():
    """20 N for 0.2 s: 1.655 degrees with Fig. 7's factor; the printed 1.63 has a factor of 0.995."""
    assert deg(eq.weight_against_push(20.0, 0.2, *ROBOT, gamma=1.01)) == pytest.approx(1.655, abs=5e-4)
    assert deg(eq.weight_against_push(20.0, 0.2, *ROBOT, gamma=0.995)) == pytest.approx(1.63, abs=5e-3)
    assert eq.gamma_of_weight(math.radians(1.63), 20.0, 0.2, *ROBOT) == pytest.approx(0.995, abs=5e-4)


def test_eq_22_of_the_paper():
    """With the CoM at 0.06 m and the edge at -0.06 m: 22.58 N, where the paper prints 22.48."""
    assert eq.largest_lasting_force(0.12, MASS, HEIGHT) == pytest.approx(22.58, abs=5e-3)


# Inverses.


@given(st.floats(-50.0, 50.0), masses, heights)
def test_eq_13_and_back(torque, mass, height):
    acceleration = eq.com_acceleration_from_torque(torque, mass, height)
    assert eq.torque_from_com_acceleration(acceleration, mass, height) == pytest.approx(torque, abs=1e-12)


@given(st.floats(-1.5, 1.5), heights)
def test_eqs_16_and_17_undo_each_other(angle, height):
    shift = eq.com_shift_from_angle(angle, height)
    assert eq.weight_from_com_shift(shift, height) == pytest.approx(angle, abs=1e-7)


@given(st.floats(-0.1, 0.1), st.floats(1e-3, 0.1))
def test_eq_20_and_back(shift, step):
    velocity = eq.com_velocity_from_shift(shift, step)
    assert eq.com_shift_from_velocity(velocity, step) == pytest.approx(shift, abs=1e-15)


@given(forces, durations, masses, heights, st.floats(0.5, 2.0))
def test_eq_21_and_its_inverses(force, duration, mass, height, gamma):
    robot = (mass, height, STEP)
    if gamma * duration * force * STEP / mass > 0.99 * height:
        return
    weight = eq.weight_against_push(force, duration, *robot, gamma=gamma)
    assert eq.force_for_weight(weight, duration, *robot, gamma=gamma) == pytest.approx(force, rel=1e-9)
    assert eq.duration_for_weight(weight, force, *robot, gamma=gamma) == pytest.approx(duration, rel=1e-9)
    assert eq.gamma_of_weight(weight, force, duration, *robot) == pytest.approx(gamma, rel=1e-9)


@given(distances, masses, heights)
def test_eq_22_and_back(distance, mass, height):
    force = eq.largest_lasting_force(distance, mass, height)
    assert eq.distance_for_lasting_force(force, mass, height) == pytest.approx(distance, rel=1e-12)


@given(distances, durations, masses, heights)
def test_the_bound_and_its_inverses(distance, duration, mass, height):
    force = eq.largest_force_for_duration(distance, duration, mass, height)
    assert eq.distance_for_push(force, duration, mass, height) == pytest.approx(distance, rel=1e-9)
    longest = eq.longest_duration_for_force(distance, force, mass, height)
    assert longest == pytest.approx(duration, rel=1e-2 if duration * math.sqrt(9.81 / height) > 8 else 1e-6)


@given(forces, heights, st.floats(0.05, 2.0))
def test_a_height_and_back(force, height, push_height):
    at_com = eq.force_at_com_height(force, push_height, height)
    assert eq.force_at_height(at_com, push_height, height) == pytest.approx(force, rel=1e-12)


# What follows from what.


@given(forces, durations, st.floats(0.5, 2.0))
def test_eq_21_is_made_of_17_19_and_20(force, duration, gamma):
    """The angle moves the CoM in one step as fast as the push has made it."""
    weight = eq.weight_against_push(force, duration, *ROBOT, gamma=gamma)
    velocity = eq.com_velocity_from_shift(eq.com_shift_from_angle(weight, HEIGHT), STEP)
    assert velocity == pytest.approx(gamma * force * duration / MASS, rel=1e-9)


@given(forces, durations, st.floats(1.01, 2.0))
def test_eq_21_grows_with_force_duration_and_factor(force, duration, more):
    weight = eq.weight_against_push(force, duration, *ROBOT)
    assert eq.weight_against_push(more * force, duration, *ROBOT) > weight
    assert eq.weight_against_push(force, more * duration, *ROBOT) > weight
    assert eq.weight_against_push(force, duration, *ROBOT, gamma=more) > weight
    assert eq.weight_against_push(force, duration, more * MASS, HEIGHT, STEP) < weight
    assert eq.weight_against_push(force, duration, MASS, more * HEIGHT, STEP) < weight


@given(distances, st.floats(0.02, 0.9), st.floats(1.01, 2.0))
def test_the_bound_falls_with_duration_towards_eq_22(distance, duration, longer):
    lasting = eq.largest_lasting_force(distance, MASS, HEIGHT)
    short = eq.largest_force_for_duration(distance, duration, MASS, HEIGHT)
    assert short > eq.largest_force_for_duration(distance, longer * duration, MASS, HEIGHT) > lasting
    assert eq.largest_force_for_duration(distance, 10.0, MASS, HEIGHT) == pytest.approx(lasting, rel=1e-12)
    assert eq.largest_force_for_duration(distance, math.inf, MASS, HEIGHT) == pytest.approx(lasting)


@given(distances)
def test_what_eq_22_allows_can_be_held_for_ever(distance):
    lasting = eq.largest_lasting_force(distance, MASS, HEIGHT)
    assert eq.longest_duration_for_force(distance, 0.999 * lasting, MASS, HEIGHT) == math.inf
    assert eq.longest_duration_for_force(distance, 1.001 * lasting, MASS, HEIGHT) < 2.0
    assert eq.distance_for_push(lasting, math.inf, MASS, HEIGHT) == pytest.approx(distance, rel=1e-12)


@given(st.floats(0.1, 10.0))
def test_the_equations_do_not_care_for_the_units(metres):
    """With another unit of length, forces scale with it where g does; angles and times stay."""
    weight = eq.weight_against_push(20.0, 0.2, *ROBOT)
    assert eq.weight_against_push(20.0 * metres, 0.2, MASS, metres * HEIGHT, STEP) == pytest.approx(weight)
    lasting = eq.largest_lasting_force(0.12, MASS, HEIGHT)
    assert eq.largest_lasting_force(metres * 0.12, MASS, metres * HEIGHT) == pytest.approx(lasting)


@given(st.floats(0.05, 0.6), st.floats(0.15, 0.6))
def test_a_push_above_the_com_is_as_hard_as_its_moment_says(duration, push_height):
    """Integrated with the moment F (h - z) about the CoM and the ZMP at the edge, the origin."""
    omega = math.sqrt(9.81 / HEIGHT)
    at_com = eq.largest_force_for_duration(0.05, duration, MASS, HEIGHT)
    force = eq.force_at_height(at_com, push_height, HEIGHT)
    moment = force * (push_height - HEIGHT)
    solution = solve_ivp(
        lambda _, s: [s[1], omega**2 * s[0] + force / MASS + moment / (MASS * HEIGHT)],
        (0.0, duration),
        [-0.05, 0.0],
        rtol=1e-10,
        atol=1e-12,
    )
    y, velocity = solution.y[:, -1]
    assert y + velocity / omega == pytest.approx(0.0, abs=1e-7)


@given(st.floats(0.001, 0.1), st.integers(0, 60), st.floats(0.0, 1.0))
def test_increments_add_up_as_the_circuit_s_integrator_has_it(weight, steps, leak):
    """theta+ = (1 - l) theta + w, step by step."""
    angle = 0.0
    for _ in range(steps):
        angle = (1 - leak) * angle + weight
    assert eq.angle_after_steps(weight, steps, leak) == pytest.approx(angle, rel=1e-6, abs=1e-12)


def test_an_angle_that_leaks_ends_at_w_over_the_leak():
    assert eq.angle_after_steps(0.01, 5000, 0.04) == pytest.approx(0.25)
    with pytest.raises(InputError, match=r"^leak: found 1\.5; allowed: 0 to 1$"):
        eq.angle_after_steps(0.01, 5, 1.5)


# What is refused.


def test_a_push_beyond_asin():
    with pytest.raises(InputError) as caught:
        eq.weight_against_push(1000.0, 0.2, *ROBOT)
    assert str(caught.value) == (
        "com_shift_m: no angle shifts the CoM by 0.3861 m in a step: found more than its height; "
        "allowed: up to 0.27 m"
    )


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.inf, math.nan])
def test_numbers_that_no_robot_has(wrong):
    for call in (
        lambda: eq.com_acceleration_from_torque(1.0, wrong, HEIGHT),
        lambda: eq.zmp_shift_from_acceleration(1.0, wrong),
        lambda: eq.joint_torque(1.0, wrong),
        lambda: eq.torque_at_edge(wrong, MASS),
        lambda: eq.com_shift_from_angle(0.1, wrong),
        lambda: eq.com_velocity_against_push(1.0, 0.2, MASS, wrong),
        lambda: eq.com_velocity_from_shift(0.1, wrong),
        lambda: eq.force_for_weight(0.1, wrong, *ROBOT),
        lambda: eq.duration_for_weight(0.1, wrong, *ROBOT),
        lambda: eq.gamma_of_weight(0.1, wrong, 0.2, *ROBOT),
        lambda: eq.largest_lasting_force(0.1, wrong, HEIGHT),
        lambda: eq.longest_duration_for_force(0.1, wrong, MASS, HEIGHT),
        lambda: eq.force_at_height(1.0, wrong, HEIGHT),
    ):
        with pytest.raises(InputError, match=f"found {wrong:g}; allowed: more than 0$"):
            call()


def test_every_wrong_number_is_told_at_once():
    with pytest.raises(InputError) as caught:
        eq.largest_lasting_force(0.1, -1.0, 0.0)
    assert str(caught.value) == (
        "mass_kg: found -1; allowed: more than 0\ncom_height_m: found 0; allowed: more than 0"
    )


def test_signs_and_quarter_turns():
    with pytest.raises(InputError, match=r"^force_n: found -20; allowed: 0 or more$"):
        eq.weight_against_push(-20.0, 0.2, *ROBOT)
    with pytest.raises(InputError, match=r"^distance_m: found -0\.1; allowed: 0 or more$"):
        eq.largest_force_for_duration(-0.1, 0.2, MASS, HEIGHT)
    with pytest.raises(InputError, match=r"^angle_rad: found 114\.592 deg; allowed: -90 deg to 90 deg$"):
        eq.com_shift_from_angle(2.0, HEIGHT)
    with pytest.raises(InputError, match=r"^weight_rad: found -0\.01; allowed: 0 or more$"):
        eq.force_for_weight(-0.01, 0.2, *ROBOT)
