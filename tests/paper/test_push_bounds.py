"""The bound of the DCM against the closed form, and what becomes of pushes on either side of it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from circuitkit.biped.gait.lipm import natural_frequency
from circuitkit.biped.robot import biped_of
from circuitkit.biped.sensing import BipedView
from circuitkit.paper.push_bounds import PushKind, dcm_bounds_around
from circuitkit.paper.reproduce.forces import bounds
from circuitkit.paper.runs import push_moment, record, without_pushes
from circuitkit.simulation import Plan
from circuitkit.simulation.scenario import with_push
from circuitkit.study import CaseBuilder, load_study, make_study, open_workers, run_cases

INWARD = PushKind("inward", 0.2)
OUTWARD = PushKind("outward", 0.2)


@pytest.fixture(scope="module")
def plan() -> Plan:
    study = load_study("push_limits")
    return CaseBuilder(study).of_cell(study.cells[0], "20 N").plan()


def stood(study, cases, seeds):
    """In how many runs of each case the robot stands."""
    with open_workers(1) as workers:
        return [sum(run.survived for run in runs) for runs in run_cases(study, cases, seeds, workers)]


def test_20_newtons_inward_fell_the_open_loop_and_not_the_circuit(plan: Plan):
    """The shipped scenario as it is; outward, 20 N are more than ankles can hold."""
    study = make_study({"study": "claim", "scenario": "nao_push", "seeds": {"count": 1}})
    cases = [
        {"controller": "open_loop"},
        {"controller": "circuit"},
        {"controller": "circuit", "push.direction": "outward"},
    ]
    assert stood(study, cases, range(3)) == [0, 3, 0]
    upright, _ = bounds(plan, (OUTWARD, INWARD))
    assert upright[OUTWARD] < 20.0 < upright[INWARD]


def test_the_tuned_circuit_is_a_case_of_its_grid_and_its_sign_matters():
    study = load_study("lateral_grid")
    tuned = CaseBuilder(study).case().circuits.used.parameters
    values = {axis: tuned[axis.partition(".")[2]].value_si for axis in study.axes if "circuit." in axis}
    wanted = values | {"reference.gait": "gait_march"}
    cells = [cell for cell in study.cells if wanted.items() <= cell.labels.items()]
    assert len(cells) == len(study.axes["push"])
    inward = [dict(cell.settings) for cell in cells if cell.labels["push"].startswith("inward 2")]
    other_sign = [settings | {"circuit.w": "0.5 deg"} for settings in inward]
    counts = stood(study.with_({"watch": "3 s"}), inward + other_sign, [100])
    assert sum(counts[: len(inward)]) >= len(inward) - 1
    assert sum(counts[len(inward) :]) <= len(inward) // 2


def test_bounds_follow_the_duration_as_the_closed_form_says(plan: Plan):
    omega = natural_frequency(0.27)
    for direction in ("inward", "outward"):
        upright, _ = bounds(plan, [PushKind(direction, duration) for duration in (0.1, 0.2, 0.4)])
        forces = list(upright.values())
        impulse_like = [
            force * -math.expm1(-omega * d) for force, d in zip(forces, (0.1, 0.2, 0.4), strict=True)
        ]
        # The height is not quite 0.27 m.
        assert impulse_like == pytest.approx([impulse_like[0]] * 3, rel=0.02)
        assert forces == sorted(forces, reverse=True)


def test_bounds_count_the_height_of_the_push(plan: Plan):
    """On the torso, whose centre of mass is 98 mm above the robot's; and a push 98 mm lower is at the CoM."""
    upright, point_mass = (found[OUTWARD] for found in bounds(plan, [OUTWARD]))
    assert upright / point_mass == pytest.approx(0.268 / 0.366, abs=0.005)
    lower = plan.scenario.pushes[0].model_copy(update={"height": -0.0976})
    scenario = plan.scenario.with_disturbances(with_push(plan.scenario, lower))
    at_com, _ = bounds(dataclasses.replace(plan, scenario=scenario), [OUTWARD])
    assert at_com[OUTWARD] == pytest.approx(point_mass, rel=0.005)


def test_to_the_side_the_way_ends_at_the_outer_edge_of_a_foot(plan: Plan):
    """Outward at that of the foot that carries, inward at that of the other one, which catches the body."""
    view = BipedView(record(plan, "open_loop", [without_pushes(plan)]))
    tick = round(push_moment(plan.scenario, plan.reference).time_s / plan.body.step_s)
    com_y, velocity = view.com_m[tick, 0, 1], view.com_velocity[tick, 0, 1]
    omega = natural_frequency(float(view.com_m[tick, 0, 2]))
    biped = biped_of(plan.robot)
    hip, feet = biped.block.legs.hip_offset_y, biped.block.feet
    dcm_y = com_y + velocity / omega
    ways = np.array([hip + feet.left.sole.left - dcm_y, dcm_y + hip - feet.right.sole.right])
    closed_form = biped.mass_kg * omega**2 * ways / -math.expm1(-omega * 0.2)
    _, point_mass = bounds(plan, [OUTWARD, INWARD])
    assert list(point_mass.values()) == pytest.approx(closed_form, rel=0.01)


def test_forward_the_way_ends_at_the_edge_of_the_sole(plan: Plan):
    found = dcm_bounds_around(plan, np.radians([0, 180]), 0.2)
    # The CoM stands at zmp.forward, 25.7 mm before the ankles, between heel and toes of the sole.
    biped = biped_of(plan.robot)
    sole = biped.block.feet.left.sole
    ways = np.array([sole.front - 0.0257, 0.0257 - sole.back])
    omega = natural_frequency(0.268)
    closed_form = biped.mass_kg * omega**2 * ways / -math.expm1(-omega * 0.2)
    assert found.point_mass_n == pytest.approx(closed_form, rel=0.03)
