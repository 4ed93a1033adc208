"""The linear inverted pendulum against closed forms, its own inverse and numerical integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from circuitkit.biped.gait.lipm import (
    com_from_zmp,
    dcm,
    largest_push_force,
    natural_frequency,
    zmp_from_com,
)

HEIGHT = 0.27
OMEGA = math.sqrt(9.81 / 0.27)
DT = 0.01


def test_natural_frequency_of_the_papers_height():
    assert natural_frequency(HEIGHT) == pytest.approx(6.0277, abs=1e-4)


def test_eq_2_by_hand():
    """0.27 m high, 3.27 m/s² to the left: the ZMP is 9 cm to the right of the CoM."""
    assert zmp_from_com(np.array([0.05]), np.array([3.27]), 0.27) == pytest.approx(0.05 - 0.09)


def test_the_pendulum_falls_as_cosh():
    """Over a fixed ZMP p: y = p + a cosh(omega t)."""
    time = np.linspace(0.0, 0.5, 51)
    com = 0.04 + 0.01 * np.cosh(OMEGA * time)
    np.testing.assert_allclose(zmp_from_com(com, OMEGA**2 * (com - 0.04), HEIGHT), 0.04, atol=1e-15)


@given(st.lists(st.floats(-0.06, 0.06), min_size=3, max_size=40))
def test_com_from_zmp_is_the_inverse_of_zmp_from_com(reference):
    zmp = np.repeat(reference, 5)
    com = com_from_zmp(zmp, HEIGHT, DT)
    acceleration = (com[2:] - 2 * com[1:-1] + com[:-2]) / DT**2
    np.testing.assert_allclose(zmp_from_com(com[1:-1], acceleration, HEIGHT), zmp[1:-1], atol=1e-12)


def test_a_zmp_at_rest_is_a_com_at_rest():
    np.testing.assert_allclose(com_from_zmp(np.full((300, 2), 0.03), HEIGHT, DT), 0.03, atol=1e-12)


def test_the_com_starts_and_ends_at_rest():
    """The sway begins before the ZMP moves; far from its steps nothing moves."""
    zmp = np.concatenate([np.zeros(300), np.full(300, 0.05)])
    com = com_from_zmp(zmp, HEIGHT, DT)
    velocity = np.diff(com) / DT
    np.testing.assert_allclose(velocity[[0, -1]], 0.0, atol=1e-6)
    np.testing.assert_allclose(com[[0, -1]], [0.0, 0.05], atol=1e-6)
    np.testing.assert_allclose(com[299:301].mean(), 0.025, atol=1e-9)


def periodic_steps(step_s):
    """A ZMP that jumps between two feet every T, and the CoM of the closed form.

    Over the left foot y = p - a cosh(omega (t - T/2)) with a = p / cosh(omega T / 2), so that y is 0 at the
    jumps; mirrored over the right one.
    """
    period, p = 0.55, 0.05
    time = (np.arange(round(16 * period / step_s)) + 0.5) * step_s
    number, within = np.divmod(time, period)
    foot = np.where(number % 2 == 0, 1.0, -1.0)
    com = foot * p * (1 - np.cosh(OMEGA * (within - period / 2)) / np.cosh(OMEGA * period / 2))
    return foot * p, com


def test_stepping_follows_the_closed_form():
    zmp, exact = periodic_steps(1e-3)
    com = com_from_zmp(zmp, HEIGHT, 1e-3)
    inner = slice(len(zmp) * 3 // 8, len(zmp) * 5 // 8)
    np.testing.assert_allclose(com[inner], exact[inner], atol=1e-6)


def test_halving_the_step_quarters_the_error():
    errors = []
    for step_s in (0.025, 0.0125, 0.00625, 0.003125):
        zmp, exact = periodic_steps(step_s)
        inner = slice(len(zmp) * 3 // 8, len(zmp) * 5 // 8)
        errors.append(np.abs(com_from_zmp(zmp, HEIGHT, step_s) - exact)[inner].max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_the_com_height_sets_how_much_of_a_sway_remains():
    """A ZMP A cos(k t) needs a CoM of A / (1 + k² z / g)."""
    time = (np.arange(2000) + 0.5) * 1e-3
    k = 2 * math.pi
    com = com_from_zmp(np.cos(k * time), HEIGHT, 1e-3)
    np.testing.assert_allclose(com, np.cos(k * time) / (1 + k**2 * HEIGHT / 9.81), atol=1e-5)


def test_the_dcm_runs_away_from_the_zmp_at_omega():
    """With p fixed, xi - p grows as exp(omega t), whatever y and y' are."""
    solution = solve_ivp(
        lambda _, s: [s[1], OMEGA**2 * (s[0] - 0.02)], (0.0, 0.4), [0.03, 0.05], rtol=1e-10, atol=1e-12
    )
    xi = dcm(*solution.y[:, [0, -1]], HEIGHT) - 0.02
    assert xi[1] / xi[0] == pytest.approx(math.exp(OMEGA * 0.4), rel=1e-7)


def test_the_dcm_of_a_stop_is_the_zmp_to_stand_on():
    """Stepping with the ZMP on the capture point brings the CoM to rest there."""
    start = np.array([0.01, 0.2])
    point = float(dcm(*start, HEIGHT))
    solution = solve_ivp(
        lambda _, s: [s[1], OMEGA**2 * (s[0] - point)], (0.0, 1.5), start, rtol=1e-11, atol=1e-13
    )
    np.testing.assert_allclose(solution.y[:, -1], [point, 0.0], atol=1e-4)


def dcm_after_push(force_n, duration_s, mass_kg=5.18):
    """The DCM when the push ends; the ZMP stands at the edge, the origin, 5 cm from the DCM at first."""
    solution = solve_ivp(
        lambda _, s: [s[1], OMEGA**2 * s[0] + force_n / mass_kg],
        (0.0, duration_s),
        [-0.06, 0.01 * OMEGA],
        rtol=1e-10,
        atol=1e-12,
    )
    return float(dcm(*solution.y[:, -1], HEIGHT))


@given(st.floats(0.02, 0.8))
def test_the_largest_push_brings_the_dcm_to_the_edge_when_it_ends(duration_s):
    """Integrated numerically with the ZMP at the edge all the time, the most that an ankle can do."""
    force = largest_push_force(0.05, duration_s, 5.18, HEIGHT)
    assert dcm_after_push(force, duration_s) == pytest.approx(0.0, abs=1e-7)
    assert dcm_after_push(0.99 * force, duration_s) < 0 < dcm_after_push(1.01 * force, duration_s)


def test_a_lasting_push_is_held_up_to_eq_22():
    """m g (y_CoM - y_ZMP) / z_CoM with the paper's numbers: 22.58 N."""
    assert largest_push_force(0.12, 10.0, 5.18, HEIGHT) == pytest.approx(5.18 * 9.81 * 0.12 / 0.27, rel=1e-12)
    assert largest_push_force(0.12, 10.0, 5.18, HEIGHT) == pytest.approx(22.58, abs=0.01)


def test_a_short_push_is_held_by_its_impulse():
    """F d = m omega L: the impulse that brings the DCM to the edge at once."""
    assert largest_push_force(0.05, 1e-6, 5.18, HEIGHT) * 1e-6 == pytest.approx(5.18 * OMEGA * 0.05, rel=1e-5)


def dcm_after_high_push(force_n, duration_s, push_height_m, edge_m=0.05, mass_kg=5.18):
    """The DCM at the end of a push at some height, the torso upright, the ZMP at the edge; rigid body.

    Ground force (R, m g) at the edge and push F at h_p: no moment about the CoM, m x'' = R + F.
    """

    def rates(_, s):
        moment_of_push = force_n * (push_height_m - HEIGHT)
        ground = ((s[0] - edge_m) * mass_kg * 9.81 + moment_of_push) / HEIGHT
        return [s[1], (ground + force_n) / mass_kg]

    end = solve_ivp(rates, (0.0, duration_s), [0.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    return float(dcm(*end, HEIGHT))


@pytest.mark.parametrize("push_height_m", [0.2, HEIGHT, 0.366])
@pytest.mark.parametrize("duration_s", [0.1, 0.4])
def test_a_push_above_the_com_is_harder_to_hold_by_its_moment(push_height_m, duration_s):
    force = largest_push_force(0.05, duration_s, 5.18, HEIGHT, push_height_m)
    assert dcm_after_high_push(force, duration_s, push_height_m) == pytest.approx(0.05, abs=1e-7)


def test_a_push_at_the_com_is_that_of_the_point_mass():
    assert largest_push_force(0.05, 0.2, 5.18, HEIGHT, HEIGHT) == largest_push_force(0.05, 0.2, 5.18, HEIGHT)
