"""How clean the shipped walks are, by the bounds that were set for them; and the figures of made-up walks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from circuitkit.base.source import shipped_names
from circuitkit.biped.gait import load_gait
from circuitkit.biped.gait.schedule import FOLDER
from circuitkit.biped.references import GaitReference
from circuitkit.biped.sensing import BipedView
from circuitkit.paper.gait_figures import gait_figures, measure_gait
from circuitkit.paper.runs import record, without_pushes
from circuitkit.simulation import Plan, Recording, load_scenario, make_plan

WEIGHT_N = 50.0


def plan_of(gait, duration) -> Plan:
    """A walk without pushes, noise and jitter."""
    calm = load_scenario("nao_push").with_disturbances(())
    return make_plan(
        calm.model_copy(update={"reference": GaitReference(load_gait(gait)), "duration": duration})
    )


def gait_of(plan):
    return plan.reference.gait


@pytest.fixture(scope="module", params=shipped_names(FOLDER))
def plan(request):
    """Twelve seconds undisturbed."""
    return plan_of(request.param, 12.0)


@pytest.mark.parametrize("controller", ["open_loop", "circuit"])
def test_a_shipped_walk_is_clean(plan, controller):
    """15 mm inside the edges for 95 % of the time that one foot carries; walking, 10 mm for 90 %."""
    found = measure_gait(plan, controller)
    assert not found.fell
    if gait_of(plan).step_length == 0:
        assert found.inside_15mm >= 0.95
        assert found.margin_5pct_m >= 0.015
        assert abs(found.way_m) < 0.02  # it marches on the spot
        assert found.drift_per_2m_m == 0
    else:
        assert found.inside_10mm >= 0.90
        assert found.drift_per_2m_m <= 0.10
        steps = (12.0 - 1.0) / 0.55
        assert found.way_m == pytest.approx(steps * gait_of(plan).step_length, rel=0.15)
    assert found.swing_free >= 0.60


def test_the_circuit_leaves_an_undisturbed_walk_alone(plan):
    found = measure_gait(plan, "circuit")
    assert found.ankle_rms_deg < (0.3 if gait_of(plan).step_length == 0 else 0.6)
    assert found.ankle_rms_deg > 0


# --- figures of made-up walks -------------------------------------------------------------------------------


@cache
def march() -> Recording:
    """Six seconds of marching."""
    plan = plan_of("gait_march", 6.0)
    return record(plan, "open_loop", [without_pushes(plan)])


def recording(left_load=0.5, ticks=300, **parts) -> Recording:
    """A robot that marches with a part of its weight on the left foot, all the time; the soles end at 38.8 mm
    to the right and 50 mm to the left of the left ankle.
    """
    layout = BipedView(march()).layout
    readings = np.zeros((ticks, 1, march().readings.shape[-1]))
    for side, part in ((0, left_load), (1, 1 - left_load)):
        readings[:, 0, layout.wrench(side)][:, 2] = WEIGHT_N * part
        readings[:, 0, layout.wrench(side)][:, 7] = 0.05 - 0.1 * side
        readings[:, 0, layout.foot(side)] = [0, 0.05 - 0.1 * side, 0.045]
    readings[:, 0, layout.com] = [0, 0, 0.27]
    for name, value in parts.items():
        readings[:, 0, getattr(layout, name)] = value
    return replace(march(), readings=readings, commands=np.zeros((ticks, 1, 0)))


def figures(cop_mm, swing_share, ticks=300):
    """A walk whose left foot carries all but a share, its centre of pressure `cop_mm` left of the ankle."""
    made = recording(1 - swing_share, ticks)
    torque = made.readings[:, 0, BipedView(made).layout.wrench(0)]
    torque[:, 3] = cop_mm * 1e-3 * WEIGHT_N * (1 - swing_share)  # M_x = y F_z
    return gait_figures(made)


@pytest.mark.parametrize(
    ("cop_mm", "margin_mm"), [(0, 38.8), (5.6, 44.4), (-20, 18.8), (30, 20.0), (38, 12.0), (60, -10.0)]
)
def test_the_margin_is_the_way_to_the_nearer_edge(cop_mm, margin_mm):
    found = figures(cop_mm, 0.02)
    assert found.margin_5pct_m == pytest.approx(margin_mm * 1e-3, abs=1e-9)
    assert found.inside_15mm == (margin_mm >= 15)
    assert found.inside_10mm == (margin_mm >= 10)


def test_both_feet_on_the_ground_have_no_margin_to_measure():
    assert figures(0, 0.5).margin_5pct_m == -1.0


def test_a_swing_foot_is_free_below_a_twentieth_of_the_weight():
    """Steps 2 and on count, of which the left foot supports one of two in the three seconds there are."""
    schedule, first = march().motion.knowledge.walk.schedule, np.arange(600) < 300
    counted = first & (schedule.step >= 2) & (schedule.single_support > 0)
    on_left = (counted & (schedule.support == 0)).sum() / counted.sum()
    assert figures(0, 0.04).swing_free == pytest.approx(on_left)
    assert figures(0, 0.06).swing_free == 0


def test_a_fall_is_a_fall():
    assert gait_figures(replace(recording(), end_tick=np.array([40]))).fell
    assert not gait_figures(recording()).fell


def test_the_way_and_the_drift_are_those_of_the_torso():
    """Half a metre a second forward, a hundredth of it sideways: 2 cm on 2 m. The sway does not count."""
    time = np.arange(1, 501) * 0.01
    sway = 0.02 * np.sin(2 * np.pi * time / 1.1)
    made = recording(ticks=500, torso=np.stack([0.5 * time, 0.005 * time + sway, 0 * time], axis=1))
    knowledge = made.motion.knowledge
    gait = knowledge.walk.gait.model_copy(update={"step_length": 0.02})
    knowledge = replace(knowledge, walk=replace(knowledge.walk, gait=gait))
    found = gait_figures(replace(made, motion=replace(made.motion, knowledge=knowledge)))
    assert found.way_m == pytest.approx(0.5 * 4.99)
    assert found.drift_per_2m_m == pytest.approx(0.02)


def test_a_run_that_ends_at_once_has_figures():
    assert figures(0, 0.02, ticks=30).drift_per_2m_m == 0


def test_the_ankle_is_what_the_controller_added():
    made = recording()
    commands = np.where(np.arange(300) % 2, 1.0, -1.0)[:, None, None] * np.radians(0.25)
    assert gait_figures(replace(made, commands=commands)).ankle_rms_deg == pytest.approx(0.25)
    assert gait_figures(made).ankle_rms_deg == 0
