"""Robots and floors that differ from the plan: weights, levers, slopes, friction and servos by their laws."""

from __future__ import annotations

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from walking import nao

from circuitkit.base.errors import UnknownNameError
from circuitkit.biped.gait import LEG_JOINTS, load_gait
from circuitkit.robots import MujocoRobot, Plant, build_model, load_robot, plan_robot_walk
from circuitkit.biped.dynamics import BodyDynamics
from circuitkit.biped.sensing import centre_of_pressure, total_centre_of_pressure

LAYOUT = nao().layout
GRAVITY = 9.81


@cache
def still():
    """A NAO that is to stand, planned without knowing of any plant."""
    gait = load_gait("gait_march").model_copy(update={"stand": 4.0})
    return plan_robot_walk(nao(), gait, 200)


def varied(**changes):
    """The NAO with such a plant, as a scenario file has it."""
    return build_model(load_robot("nao"), Plant.model_validate(changes))


def standing(model, ticks=200):
    """The robot after a while of standing."""
    robot = MujocoRobot(model, *still())
    for tick in range(ticks):
        robot.advance(tick, np.zeros((1, 0)))
    return robot


def ground_force(readings):
    """Force of the ground on both feet; shape (3,)."""
    return sum(readings[LAYOUT.wrench(side)][:3] for side in range(2))


def centre(model):
    """Centre of mass in the model's own pose."""
    data = mujoco.MjData(model.model)
    mujoco.mj_forward(model.model, data)
    return data.subtree_com[model.torso_id].copy()


def test_without_a_change_the_model_is_the_same_to_the_bit():
    plain, same = nao().model, varied().model
    for name in ("body_mass", "body_inertia", "body_subtreemass", "dof_invweight0", "geom_friction"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(same, name))
    np.testing.assert_array_equal(plain.opt.gravity, same.opt.gravity)


# --- mass ---------------------------------------------------------------------------------------------------


def test_mass_is_a_factor_for_weight_and_inertia():
    heavy = varied(mass="110 %")
    assert heavy.mass_kg == pytest.approx(1.1 * nao().mass_kg, rel=1e-12)
    np.testing.assert_allclose(heavy.model.body_inertia, 1.1 * nao().model.body_inertia, rtol=1e-12)
    np.testing.assert_allclose(centre(heavy), centre(nao()), atol=1e-12)
    force = ground_force(standing(heavy).readings[0])
    np.testing.assert_allclose(force, [0, 0, 1.1 * nao().mass_kg * GRAVITY], atol=0.3)


def test_a_payload_adds_its_weight_and_draws_the_centre_of_mass_to_itself():
    """(m c + p h) / (m + p), with h the centre of the hand."""
    loaded = varied(payload={"body": "r_wrist", "mass": "300 g"})
    assert loaded.mass_kg == pytest.approx(nao().mass_kg + 0.3, rel=1e-12)
    data = mujoco.MjData(nao().model)
    mujoco.mj_forward(nao().model, data)
    hand = data.body("r_wrist").xipos
    expected = (nao().mass_kg * centre(nao()) + 0.3 * hand) / (nao().mass_kg + 0.3)
    np.testing.assert_allclose(centre(loaded), expected, atol=1e-12)
    readings = standing(loaded).readings[0]
    assert ground_force(readings)[2] == pytest.approx(loaded.mass_kg * GRAVITY, rel=0.005)
    assert centre_of_pressure(readings, LAYOUT, 1)[1] > centre_of_pressure(readings, LAYOUT, 0)[1] + 3


def test_a_payload_comes_after_the_factor():
    both = varied(mass="90 %", payload={"body": "torso", "mass": "1 kg"})
    assert both.mass_kg == pytest.approx(0.9 * nao().mass_kg + 1.0, rel=1e-12)


def test_a_payload_on_a_body_that_does_not_exist_is_refused():
    with pytest.raises(UnknownNameError) as caught:
        varied(payload={"body": "r_hand", "mass": "0.3 kg"})
    said = str(caught.value)
    assert said.startswith("unknown body 'r_hand'; allowed: torso, Neck, Head, ")


# --- slope --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("forward", "left"), [(3, 0), (0, 3), (0, -3), (-2, 2)])
def test_on_a_slope_gravity_turns_and_the_zmp_moves_by_height_times_tangent(forward, left):
    """Downhill, from below the centre of mass by z tan(slope); the ground holds against the weight's part."""
    model = varied(slope={"forward": f"{forward} deg", "left": f"{left} deg"})
    rise = np.sin(np.radians([forward, left]))
    up = math.sqrt(1 - (rise**2).sum())
    np.testing.assert_allclose(model.model.opt.gravity, -GRAVITY * np.array([*rise, up]), atol=1e-12)
    readings = standing(model).readings[0]
    weight = model.mass_kg * GRAVITY
    np.testing.assert_allclose(ground_force(readings), weight * np.array([*rise, up]), atol=0.15)
    com = readings[LAYOUT.com]
    below = total_centre_of_pressure(readings, LAYOUT) - com[:2]
    np.testing.assert_allclose(below, -com[2] * rise / up, atol=1e-3)
    assert np.linalg.norm(below) > 0.01


def test_a_slope_in_one_direction_is_the_angle_between_floor_and_gravity():
    for slope in ({"forward": "5 deg"}, {"left": "-5 deg"}):
        gravity = varied(slope=slope).model.opt.gravity
        assert math.degrees(math.acos(-gravity[2] / np.linalg.norm(gravity))) == pytest.approx(5)


# --- friction -----------------------------------------------------------------------------------------------


def test_friction_limits_the_force_along_the_floor():
    """Pushed with 12 N on friction 0.1, a robot of 51 N slides: its feet hold with a tenth of their load."""
    model = varied(friction=0.1)
    robot = MujocoRobot(model, *still())
    shares = []
    for tick in range(60):
        robot.push(model.torso_id, np.array([[12.0 * (tick >= 50), 0.0, 0.0]]))
        robot.advance(tick, np.zeros((1, 0)))
        for side in range(2):
            forward, left, load = robot.readings[0, LAYOUT.wrench(side)][:3]
            shares.append(math.hypot(forward, left) / load if load > 1 else 0.0)
    assert max(shares) <= 0.1 * (1 + 1e-6)
    assert max(shares[-10:]) > 0.095


def test_down_a_slope_steeper_than_its_friction_a_robot_slides():
    """After t seconds it is faster by g (sin a - mu cos a) t."""
    model = varied(friction=0.05, slope={"forward": "10 deg"})
    robot = standing(model, 20)
    before = robot.readings[0, LAYOUT.com_velocity][0]
    for tick in range(20, 40):
        robot.advance(tick, np.zeros((1, 0)))
    faster = robot.readings[0, LAYOUT.com_velocity][0] - before
    a = math.radians(10)
    assert faster == pytest.approx(-GRAVITY * (math.sin(a) - 0.05 * math.cos(a)) * 0.2, rel=0.05)


# --- servos -------------------------------------------------------------------------------------------------


def test_weak_servos_sag_more_by_torque_over_stiffness():
    """Targets are ahead by torque / k; servos of 0.7 k stay behind the walk by torque / k (1 / 0.7 - 1)."""
    weak = varied(servo_stiffness="70 %")
    np.testing.assert_allclose(weak.stiffness, 0.7 * nao().stiffness, rtol=1e-12)
    np.testing.assert_array_equal(weak.model.actuator_biasprm[:, 2], nao().model.actuator_biasprm[:, 2])
    np.testing.assert_array_equal(weak.model.actuator_forcerange, nao().model.actuator_forcerange)
    knees = [nao().leg_index[LEG_JOINTS.index(f"{side}_knee_pitch")] for side in ("left", "right")]
    walk, targets = still()
    torque = BodyDynamics(nao()).torques(walk)[199, knees]
    found = standing(weak).qpos[0, nao().qpos_index[knees]]
    planned = targets[199, knees] - torque / nao().stiffness[knees]
    np.testing.assert_allclose(planned - found, torque / nao().stiffness[knees] * (1 / 0.7 - 1), rtol=0.15)
    assert np.abs(planned - found).min() > math.radians(0.04)
