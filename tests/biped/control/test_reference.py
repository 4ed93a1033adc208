"""What a controller knows of the walk: the plan's own numbers, a point mass that obeys eq. 2, real soles."""

from __future__ import annotations

import numpy as np
import pytest
from walking import known_of, plan_of

from circuitkit.biped.gait import LEFT, RIGHT
from circuitkit.biped.gait.lipm import zmp_from_com
from circuitkit.simulation import load_scenario, make_plan


@pytest.fixture(scope="module")
def plan():
    return plan_of(gait="gait_walk_2cm", duration=5.0)


@pytest.fixture(scope="module")
def reference(plan):
    return known_of(plan)


def test_it_is_the_walks_own_plan_and_goes_on_after_its_end(plan, reference):
    ticks = known_of(plan).walk.ticks
    for name in ("zmp_m", "left_load", "phase", "support", "feet_x_m"):
        np.testing.assert_allclose(
            getattr(reference.schedule, name)[:ticks], getattr(known_of(plan).walk.schedule, name), atol=1e-12
        )
    assert len(reference.com_m) == len(reference.low_m) == ticks + 300


def test_the_point_mass_has_the_zmp_of_the_plan(reference):
    dt, height = reference.step_s, reference.com_height_m
    acceleration = np.diff(reference.com_m, 2, axis=0) / dt**2
    zmp = zmp_from_com(reference.com_m[1:-1], acceleration, height)
    np.testing.assert_allclose(zmp, reference.zmp_m[1:-1], atol=1e-9)
    np.testing.assert_allclose(reference.com_acceleration[1:-1], acceleration, atol=1e-7)


def test_the_dcm_runs_away_from_the_zmp(reference):
    """Xi' = omega (xi - p); between two ticks exactly where p keeps still."""
    still = np.abs(np.diff(reference.zmp_m[:, 1])) < 1e-12
    still = still[1:] & still[:-1]
    inner = slice(1, -1)
    rate = (reference.dcm_m[2:, 1] - reference.dcm_m[:-2, 1]) / (2 * reference.step_s)
    expected = reference.omega * (reference.dcm_m - reference.zmp_m)[inner, 1]
    np.testing.assert_allclose(rate[2:-2][still[2:-2]], expected[2:-2][still[2:-2]], atol=2e-3)


def test_support_is_one_sole_in_single_support_and_from_sole_to_sole_in_double_support(reference):
    first, second = reference.footsteps[4:6]
    assert (first.side, second.side) == (LEFT, RIGHT)
    left = first.first_tick + 5
    np.testing.assert_allclose([reference.low_m[left, 1], reference.high_m[left, 1]], [0.0112, 0.1])
    np.testing.assert_allclose(
        [reference.low_m[left, 0], reference.high_m[left, 0]],
        [first.ankle_m[0] - 0.0507, first.ankle_m[0] + 0.0994],
    )
    between = (first.last_tick + second.first_tick) // 2
    np.testing.assert_allclose([reference.low_m[between, 1], reference.high_m[between, 1]], [-0.1, 0.1])


def test_footsteps_alternate_and_go_forward(reference):
    steps = reference.footsteps
    assert [step.side for step in steps[:4]] == [LEFT, RIGHT, LEFT, RIGHT]
    assert [step.ankle_m[1] for step in steps[:2]] == [0.05, -0.05]
    np.testing.assert_allclose(np.diff([step.ankle_m[0] for step in steps]), 0.02, atol=1e-12)
    assert all(step.last_tick - step.first_tick == 50 for step in steps[:4])


def test_the_planned_zmp_stays_on_what_carries(reference):
    assert (reference.low_m <= reference.zmp_m).all()
    assert (reference.zmp_m <= reference.high_m).all()


def test_the_com_moves_less_than_the_pelvis(reference):
    assert 0.7 < reference.com_per_pelvis() < 0.95


@pytest.mark.parametrize("duration", [0.05, 6.0, 8.0])
def test_standing_is_planned_as_standing_at_every_tick_and_after_the_end(duration):
    """However long a run is: whoever only stands leans towards no first step."""
    plan = make_plan(load_scenario("nao_stands").model_copy(update={"duration": duration}))
    known = known_of(plan)
    expected = {"com_x": 0.0257, "com_y": 0.0, "com_velocity_x": 0.0, "com_velocity_y": 0.0}
    planned = plan.body.motion.planned
    assert {f"planned_{name}" for name in expected} == set(planned)
    for name, value in expected.items():
        np.testing.assert_allclose(planned[f"planned_{name}"].values, value, atol=1e-12, err_msg=name)
    assert len(known.com_m) == known.walk.ticks + 300
    assert known.footsteps == ()
    np.testing.assert_allclose(known.com_acceleration, 0.0, atol=1e-10)
    np.testing.assert_allclose(known.low_m, np.tile([-0.0507, -0.1], (len(known.com_m), 1)))
    np.testing.assert_allclose(known.high_m, np.tile([0.0994, 0.1], (len(known.com_m), 1)))


def test_a_walk_does_not_feel_the_end_of_its_plan():
    """The last half second of 3 s is that of a walk which goes on for as long again."""
    short, long = (plan_of(gait="gait_walk_2cm", duration=seconds).body.motion for seconds in (3.0, 6.0))
    for name, channel in short.planned.items():
        np.testing.assert_allclose(channel.values, long.planned[name].values[:300], atol=1e-12)
    np.testing.assert_allclose(short.targets, long.targets[:300], atol=1e-12)
