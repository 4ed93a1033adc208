"""Robots and floors that differ from the plan: weights, levers, slopes, friction and servos by their laws."""

from __future__ import annotations

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from walking import nao, nao_body, naos, walk_of_nao

from circuitkit.base.errors import InputError
from circuitkit.biped.dynamics import BodyDynamics
from circuitkit.biped.gait import LEG_JOINTS, load_gait
from circuitkit.biped.sensing import centre_of_pressure, total_centre_of_pressure
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation.disturbances.actuator import Actuator
from circuitkit.simulation.disturbances.body import Body
from circuitkit.simulation.disturbances.slope import Slope

LAYOUT, TORSO = nao_body().layout, nao_body().torso_id
GRAVITY = 9.81


@cache
def still():
    """A NAO that is to stand, planned without knowing of any change."""
    gait = load_gait("gait_march").model_copy(update={"stand": 4.0})
    return walk_of_nao(gait, 200)


def varied(*changes):
    """The NAO as these disturbances change it."""
    return build_model(load_robot("nao"), [each.change for each in changes])


def standing(model, ticks=200):
    """The robot after a while of standing."""
    robot = naos(still()[1], robot=model)
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
    return data.subtree_com[TORSO].copy()


def test_without_a_change_the_model_is_the_same_to_the_bit():
    plain, same = nao().model, varied(Body(), Slope(), Actuator()).model
    for name in ("body_mass", "body_inertia", "body_subtreemass", "dof_invweight0", "geom_friction"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(same, name))
    np.testing.assert_array_equal(plain.opt.gravity, same.opt.gravity)


# --- mass ---------------------------------------------------------------------------------------------------


def test_mass_is_a_factor_for_weight_and_inertia():
    heavy = varied(Body(mass=1.1))
    assert heavy.mass_kg == pytest.approx(1.1 * nao().mass_kg, rel=1e-12)
    np.testing.assert_allclose(heavy.model.body_inertia, 1.1 * nao().model.body_inertia, rtol=1e-12)
    np.testing.assert_allclose(centre(heavy), centre(nao()), atol=1e-12)
    force = ground_force(standing(heavy).readings[0])
    np.testing.assert_allclose(force, [0, 0, 1.1 * nao().mass_kg * GRAVITY], atol=0.3)


def test_a_payload_adds_its_weight_and_draws_the_centre_of_mass_to_itself():
    """(m c + p h) / (m + p), with h the centre of the hand."""
    loaded = varied(Body(body="r_wrist", payload=0.3))
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
    both = varied(Body(mass=0.9), Body(body="torso", payload=1.0))
    assert both.mass_kg == pytest.approx(0.9 * nao().mass_kg + 1.0, rel=1e-12)


def test_a_payload_on_a_body_that_does_not_exist_is_refused():
    with pytest.raises(InputError) as caught:
        varied(Body(body="r_hand", payload=0.3))
    said = str(caught.value)
    assert said.startswith("body: unknown body 'r_hand'; allowed: torso, left_foot, right_foot, Neck, Head, ")


# --- slope --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("forward", "left"), [(3, 0), (0, 3), (0, -3), (-2, 2)])
def test_on_a_slope_gravity_turns_and_the_zmp_moves_by_height_times_tangent(forward, left):
    """Downhill, from below the centre of mass by z tan(slope); the ground holds against the weight's part."""
    model = varied(Slope(forward=math.radians(forward), left=math.radians(left)))
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
    for slope in ({"forward": math.radians(5)}, {"left": math.radians(-5)}):
        gravity = varied(Slope(**slope)).model.opt.gravity
        assert math.degrees(math.acos(-gravity[2] / np.linalg.norm(gravity))) == pytest.approx(5)


# --- friction -----------------------------------------------------------------------------------------------


def test_friction_limits_the_force_along_the_floor():
    """Pushed with 12 N on friction 0.1, a robot of 51 N slides: its feet hold with a tenth of their load."""
    robot = naos(still()[1], robot=varied(Body(friction=0.1)))
    shares = []
    for tick in range(60):
        robot.push(TORSO, np.array([[12.0 * (tick >= 50), 0.0, 0.0]]))
        robot.advance(tick, np.zeros((1, 0)))
        for side in range(2):
            forward, left, load = robot.readings[0, LAYOUT.wrench(side)][:3]
            shares.append(math.hypot(forward, left) / load if load > 1 else 0.0)
    assert max(shares) <= 0.1 * (1 + 1e-6)
    assert max(shares[-10:]) > 0.095


def test_a_slippery_floor_lets_the_feet_slip():
    """Friction 0.02 holds a fiftieth of the weight, 1 N: a push of 3 N moves the feet."""
    slips = []
    for friction in (None, 0.02):
        robot = naos(still()[1], robot=varied(Body(friction=friction)))
        for tick in range(100):
            robot.push(TORSO, np.array([[3.0 * (tick > 50), 0.0, 0.0]]))
            robot.advance(tick, np.zeros((1, 0)))
        slips.append(robot.readings[0, LAYOUT.foot(0)][0])
    assert slips[0] < 0.002
    assert slips[1] > 0.01


def test_down_a_slope_steeper_than_its_friction_a_robot_slides():
    """After t seconds it is faster by g (sin a - mu cos a) t."""
    model = varied(Body(friction=0.05), Slope(forward=math.radians(10)))
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
    weak, body = varied(Actuator(stiffness=0.7)), nao_body()
    gains, biases = weak.model.actuator_gainprm, weak.model.actuator_biasprm
    np.testing.assert_allclose(gains[:, 0], 0.7 * body.stiffness, rtol=1e-12)
    np.testing.assert_allclose(biases[:, 1], -0.7 * body.stiffness, rtol=1e-12)
    np.testing.assert_array_equal(biases[:, 2], nao().model.actuator_biasprm[:, 2])
    np.testing.assert_array_equal(weak.model.actuator_forcerange, nao().model.actuator_forcerange)
    knees = [body.leg_servo[LEG_JOINTS.index(f"{side}_knee_pitch")] for side in ("left", "right")]
    walk, motion = still()
    torque = BodyDynamics(body).torques(walk)[199, knees]
    found = standing(weak).qpos[0, body.qpos_index[knees]]
    planned = motion.targets[199, knees] - torque / body.stiffness[knees]
    np.testing.assert_allclose(planned - found, torque / body.stiffness[knees] * (1 / 0.7 - 1), rtol=0.15)
    assert np.abs(planned - found).min() > math.radians(0.04)
