"""The main claim on small cuts of the studies: the circuit holds the pushed robot, the open loop does not."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from circuitkit.circuit import load_circuit, resolve
from circuitkit.gait.lipm import natural_frequency
from circuitkit.simulate import Plan, load_scenario
from circuitkit.study import gait_search, lateral_grid
from circuitkit.study.gait_figures import GaitFigures
from circuitkit.study.push_limits import (
    PUSH_KINDS,
    PushKind,
    dcm_bounds,
    dcm_bounds_around,
    largest_survived,
    mean_ratio,
    plan_for_pushes,
    standing,
)

INWARD = PushKind("inward", 0.2)
OUTWARD = PushKind("outward", 0.2)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_for_pushes(load_scenario("nao_push"), "gait_march")


def test_20_newtons_inward_fell_the_open_loop_and_not_the_circuit():
    scenario = load_scenario("nao_push")
    seeds = range(3)
    assert standing(scenario, "open_loop", "inward", seeds) == 0
    assert standing(scenario, "circuit", "inward", seeds) == len(seeds)


def test_20_newtons_outward_are_more_than_ankles_can_hold(plan: Plan):
    assert dcm_bounds(plan)[OUTWARD] < 20.0
    assert standing(plan.scenario, "circuit", "outward", range(2)) == 0


def test_the_largest_force_counts_from_below(plan: Plan):
    # 9 and 18 N are survived by the circuit, 27 N is not; the open loop does not survive 9 N.
    found = largest_survived(plan, "circuit", [INWARD], seeds=[0], grid_n=9.0)
    assert found == {INWARD: 18.0}
    assert largest_survived(plan, "open_loop", [INWARD], seeds=[0], grid_n=9.0) == {INWARD: 0.0}


def test_the_sign_of_the_paper_does_not_hold_what_the_other_one_holds(plan: Plan):
    other = dataclasses.replace(plan, circuit=resolve(load_circuit("binn_lateral_tuned"), {"w": "0.5 deg"}))
    assert largest_survived(other, "circuit", [INWARD], seeds=[0], grid_n=9.0) == {INWARD: 0.0}


def test_bounds_follow_the_duration_as_the_closed_form_says(plan: Plan):
    bounds = dcm_bounds(plan)
    omega = natural_frequency(0.27)
    for direction in ("inward", "outward"):
        forces = [bounds[PushKind(direction, duration)] for duration in (0.1, 0.2, 0.4)]
        impulse_like = [
            force * -math.expm1(-omega * d) for force, d in zip(forces, (0.1, 0.2, 0.4), strict=True)
        ]
        assert impulse_like == pytest.approx(
            [impulse_like[0]] * 3, rel=0.02
        )  # the height is not quite 0.27 m
        assert forces == sorted(forces, reverse=True)


def test_bounds_count_the_height_of_the_push(plan: Plan):
    """On the torso, whose centre of mass is 98 mm above the robot's; and a push 98 mm lower is at the CoM."""
    upright, point_mass = dcm_bounds(plan)[OUTWARD], dcm_bounds(plan, at_com_height=True)[OUTWARD]
    assert upright / point_mass == pytest.approx(0.268 / 0.366, abs=0.005)
    lower = plan.scenario.pushes[0].model_copy(update={"height": -0.0976})
    scenario = plan.scenario.model_copy(update={"pushes": (lower,)})
    assert dcm_bounds(dataclasses.replace(plan, scenario=scenario))[OUTWARD] == pytest.approx(
        point_mass, rel=0.005
    )


def test_bounds_around_are_those_of_the_sides_and_forward_those_of_the_sole(plan: Plan):
    found = dcm_bounds_around(plan, np.radians([0, 90, 180, 270]), 0.2)
    sides = dcm_bounds(plan, [OUTWARD, INWARD])
    assert found.upright_n[[1, 3]] == pytest.approx([sides[OUTWARD], sides[INWARD]], rel=0.01)
    # The CoM stands at zmp.forward, 25.7 mm before the ankles, between heel and toes of the sole.
    sole = plan.robot.spec.feet.left.sole
    ways = np.array([sole.front - 0.0257, 0.0257 - sole.back])
    omega = natural_frequency(0.268)
    closed_form = plan.robot.mass_kg * omega**2 * ways / -math.expm1(-omega * 0.2)
    assert found.point_mass_n[[0, 2]] == pytest.approx(closed_form, rel=0.03)


def test_mean_ratio_is_the_mean_of_ratios():
    limits = dict.fromkeys(PUSH_KINDS, 6.0)
    baseline = {kind: 2.0 if kind.direction == "inward" else 3.0 for kind in PUSH_KINDS}
    assert mean_ratio(limits, baseline) == pytest.approx(2.5)
    assert mean_ratio(limits, dict.fromkeys(PUSH_KINDS, 0.0)) == math.inf


def test_the_search_charges_a_fall_more_than_anything_else():
    clean = GaitFigures(False, 1.0, 1.0, 0.044, 1.0, 0.0, 0.0, 0.0)
    assert gait_search.cost(clean) == 0.0
    dirty = dataclasses.replace(clean, margin_5pct_m=-0.01, swing_free=0.0, drift_per_2m_m=1.0)
    fallen = dataclasses.replace(clean, fell=True)
    assert 0.0 < gait_search.cost(dirty) < gait_search.cost(fallen)


def test_the_shipped_gaits_share_the_numbers_of_the_search():
    found = {
        "zmp_forward": 0.0257,
        "zmp_sideways": 0.059,
        "lift_start": 0.0,
        "lift_end": 1.0,
        "swing_start": 0.24,
        "swing_end": 0.65,
    }
    for name in gait_search.GAITS:
        gait = gait_search.load_gait(name)
        assert gait_search.with_numbers(gait, found) == gait


def test_the_tuned_circuit_is_a_point_of_the_grid(plan: Plan):
    tuned = resolve(load_circuit(lateral_grid.CIRCUIT))
    values = {name: str(tuned.parameters[name]) for name in lateral_grid.GRID}
    assert values in list(lateral_grid.combinations())
    assert lateral_grid.score([plan], values, seeds=[100]) > lateral_grid.score(
        [plan], {"w": "0.5 deg"}, seeds=[100]
    )
