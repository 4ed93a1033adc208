"""The bound of the DCM against the closed form, and what becomes of pushes on either side of it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from circuitkit.gait.lipm import natural_frequency
from circuitkit.simulate import Plan
from circuitkit.study import load_study, make_study, open_pool, run_points
from circuitkit.study.push_bounds import PushKind, dcm_bounds, dcm_bounds_around

INWARD = PushKind("inward", 0.2)
OUTWARD = PushKind("outward", 0.2)


@pytest.fixture(scope="module")
def plan() -> Plan:
    study = load_study("push_limits")
    return study.point_of(study.cells[0], "20 N").plan()


def stood(study, points, seeds):
    """In how many runs of each point the robot stands."""
    with open_pool(1) as pool:
        return [sum(run.survived for run in runs) for runs in run_points(study, points, seeds, pool)]


def test_20_newtons_inward_fell_the_open_loop_and_not_the_circuit(plan: Plan):
    """The shipped scenario as it is; outward, 20 N are more than ankles can hold."""
    study = make_study({"study": "claim", "scenario": "nao_push", "seeds": {"count": 1}})
    points = [
        {"controller": "open_loop"},
        {"controller": "circuit"},
        {"controller": "circuit", "pushes[0].direction": "outward"},
    ]
    assert stood(study, points, range(3)) == [0, 3, 0]
    assert dcm_bounds(plan)[OUTWARD] < 20.0 < dcm_bounds(plan)[INWARD]


def test_the_tuned_circuit_is_a_point_of_its_grid_and_its_sign_matters():
    study = load_study("lateral_grid")
    tuned = study.point().circuit.parameters
    values = {axis: tuned[axis.partition(".")[2]].value_si for axis in study.axes if "circuit." in axis}
    wanted = values | {"gait": "gait_march"}
    cells = [cell for cell in study.cells if wanted.items() <= cell.labels.items()]
    assert len(cells) == len(study.axes["push"])
    inward = [dict(cell.settings) for cell in cells if cell.labels["push"].startswith("inward 2")]
    other_sign = [settings | {"circuit.w": "0.5 deg"} for settings in inward]
    counts = stood(study.with_({"watch": "3 s"}), inward + other_sign, [100])
    assert sum(counts[: len(inward)]) >= len(inward) - 1
    assert sum(counts[len(inward) :]) <= len(inward) // 2


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
