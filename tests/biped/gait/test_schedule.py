"""The time plan of a walk, by what a walk is: durations, feet that alternate, feet that stand still."""

from __future__ import annotations

import numpy as np
import pytest
from walking import GAITS

from circuitkit.biped.gait import LEFT, PHASES, RIGHT, load_gait
from circuitkit.biped.gait.schedule import EXTEND, LIFT, STAND, TRANSFER, plan_steps, smooth_step

STEPS = 6


@pytest.fixture(scope="module", params=GAITS)
def gait(request):
    return load_gait(request.param)


@pytest.fixture(scope="module")
def plan(gait):
    return plan_steps(gait, STEPS)


def swing_of(plan):
    """The foot that does not support; for the ticks of a step."""
    return 1 - plan.support


def test_phases_have_the_papers_names():
    assert PHASES == ("stand", "transfer", "lift", "extend")
    assert [PHASES[i] for i in (STAND, TRANSFER, LIFT, EXTEND)] == list(PHASES)


def test_every_step_takes_the_papers_times(gait, plan):
    """0.05 s on both feet, 0.5 s on one (section 5.2)."""
    assert (plan.step == -1).sum() == round(gait.stand / 0.01)
    for step in range(STEPS):
        phases = plan.phase[plan.step == step]
        assert len(phases) == 55
        assert (phases == TRANSFER).sum() == 5
        assert (phases != TRANSFER).sum() == 50
        assert (np.diff(phases) >= 0).all()  # transfer, lift, extend
        assert set(phases) == {TRANSFER, LIFT, EXTEND}


def test_feet_alternate_and_the_left_one_begins(plan):
    supports = [set(plan.support[plan.step == step]) for step in range(STEPS)]
    assert supports == [{LEFT}, {RIGHT}] * (STEPS // 2)
    assert set(plan.support[plan.step < 0]) == {-1}


def test_both_feet_stand_while_the_weight_is_transferred(plan):
    both = (plan.phase == TRANSFER) | (plan.phase == STAND)
    assert not plan.lift_m[both].any()
    moved = np.diff(plan.feet_x_m, axis=0)
    assert not moved[both[1:]].any()


def test_only_the_swing_foot_is_lifted_and_only_in_its_window(gait, plan):
    walking = plan.step >= 0
    support = np.maximum(plan.support, 0)
    lift_of = np.take_along_axis(plan.lift_m, np.stack([support, 1 - support], axis=1), axis=1)
    assert not lift_of[:, 0].any()
    raised = lift_of[:, 1]
    outside = (plan.single_support <= gait.lift.start) | (plan.single_support >= gait.lift.end) | ~walking
    np.testing.assert_allclose(raised[outside], 0.0, atol=1e-15)
    assert (raised[~outside] > 0).all()
    assert raised.max() == pytest.approx(gait.lift.height, rel=0.01)


def test_lift_goes_up_and_extend_goes_down(plan):
    raised = plan.lift_m.sum(axis=1)
    change = np.diff(raised)
    same = np.diff(plan.step) == 0
    assert (change[same & (plan.phase[1:] == LIFT)] >= 0).all()
    assert (change[same & (plan.phase[:-1] == EXTEND)] <= 0).all()


def test_a_foot_moves_forward_only_in_the_air(plan):
    """Moving it while it touches would drag the robot over."""
    moved = np.diff(plan.feet_x_m, axis=0)
    in_air = np.minimum(plan.lift_m[1:], plan.lift_m[:-1])
    assert (moved >= -1e-15).all()
    assert (in_air[np.abs(moved) > 1e-12] > 0).all()


def test_footprints_are_a_step_length_apart(gait, plan):
    """At the end of each step the foot that swung is one step length ahead of the other."""
    for step in range(STEPS):
        left, right = plan.feet_x_m[plan.step == step][-1]
        ahead = right - left if step % 2 == 0 else left - right
        assert ahead == pytest.approx(gait.step_length, abs=1e-12)
    assert plan.feet_x_m[-1].max() == pytest.approx(STEPS * gait.step_length, abs=1e-12)


def test_the_zmp_reference_is_under_the_foot_that_stands(gait, plan):
    for step in range(STEPS):
        ticks = (plan.step == step) & (plan.phase != TRANSFER)
        foot = step % 2
        side = 1.0 if foot == LEFT else -1.0
        expected = np.column_stack(
            [plan.feet_x_m[ticks, foot] + gait.zmp.forward, np.full(ticks.sum(), side * gait.zmp.sideways)]
        )
        np.testing.assert_allclose(plan.zmp_m[ticks], expected, atol=1e-12)


def test_the_zmp_reference_stands_in_the_middle_at_first(gait, plan):
    np.testing.assert_allclose(plan.zmp_m[plan.step < 0], [[gait.zmp.forward, 0.0]] * 100, atol=1e-12)


def test_the_zmp_reference_goes_straight_from_foot_to_foot(plan):
    """Equal steps within double support, none of them longer than a fifth of the way."""
    for step in range(1, STEPS):
        ticks = np.flatnonzero((plan.step == step) & (plan.phase == TRANSFER))
        moves = np.diff(plan.zmp_m[ticks[0] : ticks[-1] + 2], axis=0)
        way = plan.zmp_m[ticks[-1] + 1] - plan.zmp_m[ticks[0]]
        np.testing.assert_allclose(moves, np.tile(way / 5, (5, 1)), atol=1e-12)


def test_the_load_is_where_the_zmp_is(gait, plan):
    """Two feet at y = +-s share the weight so that the ZMP is s (left - right) / (left + right)."""
    np.testing.assert_allclose(gait.zmp.sideways * (2 * plan.left_load - 1), plan.zmp_m[:, 1], atol=1e-12)


def test_the_smooth_step_starts_and_stops_without_a_jerk():
    """0 to 1 with zero velocity and zero acceleration at both ends, symmetric about the middle."""
    s = np.linspace(-0.5, 1.5, 2001)
    y = smooth_step(s)
    assert (y[s <= 0] == 0).all()
    assert (y[s >= 1] == 1).all()
    np.testing.assert_allclose(y + y[::-1], 1.0, atol=1e-12)
    assert (np.diff(y) >= 0).all()
    h = 1e-4
    for end in (0.0, 1.0):
        first = (smooth_step(np.array(end + h)) - smooth_step(np.array(end - h))) / (2 * h)
        second = (smooth_step(np.array([end - h, end, end + h])) @ [1, -2, 1]) / h**2
        assert abs(first) < 1e-6
        assert abs(second) < 1e-2
