"""Robots in physics: standing, following a walk, being pushed; sensors against weight and momentum."""

from __future__ import annotations

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from walking import GAITS, joint_targets, nao, nao_body, naos, walk_of_nao

from circuitkit.base.errors import SimulationError, UnknownNameError
from circuitkit.biped.dynamics import BodyDynamics
from circuitkit.biped.gait import LEG_JOINTS, load_gait
from circuitkit.biped.gait.lipm import zmp_from_com
from circuitkit.biped.robot import COMMANDS
from circuitkit.biped.sensing import centre_of_pressure, total_centre_of_pressure
from circuitkit.robots import Observer

LAYOUT = nao_body().layout
WEIGHT = 5.19539 * 9.81
LEAD, CYCLE = 320, 110  # ticks before the repeating part, and of one of its turns


@cache
def walk_of(name):
    """A walk of the NAO with its targets, 13 steps."""
    return walk_of_nao(load_gait(name), 820)


@cache
def marching():
    """Readings and positions of a march, (T, s) and (T, nq)."""
    walk, motion = walk_of("gait_march")
    robot = naos(motion)
    rows = []
    for tick in range(walk.ticks):
        robot.advance(tick, np.zeros((1, 0)))
        rows.append((robot.readings[0].copy(), robot.qpos[0].copy()))
    return tuple(np.array(part) for part in zip(*rows, strict=True))


@cache
def still():
    """A NAO that stands for three seconds before it would step."""
    gait = load_gait("gait_march").model_copy(update={"stand": 4.0})
    return walk_of_nao(gait, 300)


def standing(commands=(), values=(), ticks=250):
    """The robot after a while of standing, its commands reached by and by."""
    robot = naos(still()[1], commands)
    for tick in range(ticks):
        robot.advance(tick, np.array([values], dtype=float) * min(tick / 100, 1.0))
    return robot


# --- the planned walk ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GAITS)
def test_the_whole_body_has_its_zmp_on_the_reference(name):
    """Within half a millimetre over three turns of the repeating part, also where it meets itself."""
    walk, _ = walk_of(name)
    missed = np.abs(BodyDynamics(nao_body()).zmp(walk) - walk.schedule.zmp_m)[LEAD:-1]
    assert len(missed) > 4 * CYCLE
    assert missed.max() < 5e-4


@pytest.mark.parametrize("name", GAITS)
def test_the_walk_of_a_nao_is_nearly_its_own_mirror_image(name):
    """Only nearly: the published inertias of its left and right differ a little."""
    walk, _ = walk_of(name)
    now, later = walk.pelvis_m[LEAD:-55], walk.pelvis_m[LEAD + 55 :]
    np.testing.assert_allclose(
        later - now * [1, -1, 1], [[walk.gait.step_length, 0, 0]] * len(now), atol=5e-4
    )


def test_targets_are_ahead_of_the_walk_by_what_the_servos_sag():
    walk, motion = walk_of("gait_march")
    torques = BodyDynamics(nao_body()).torques(walk)[200:300]
    ahead = (motion.targets - joint_targets(walk))[200:300] * nao_body().stiffness
    np.testing.assert_allclose(ahead, torques, atol=1e-9)


def test_standing_pitches_do_not_sag_because_their_load_is_known():
    walk, _ = still()
    left = standing().qpos[0, nao_body().qpos_index] - joint_targets(walk)[250]
    sag = BodyDynamics(nao_body()).torques(walk)[250] / nao_body().stiffness
    pitches = [i for i, role in zip(nao_body().leg_servo, LEG_JOINTS, strict=True) if "pitch" in role]
    left, sag = (np.degrees(np.abs(angles[pitches]).max()) for angles in (left, sag))
    assert left < 0.02
    assert sag > 10 * left


def test_marching_joints_follow_the_walk():
    """Within 0.6 degrees, root mean square, but that rolls lag by damping over stiffness times their rate."""
    walk, _ = walk_of("gait_march")
    _, qpos = marching()
    wanted = joint_targets(walk)
    error = np.degrees(qpos[:, nao_body().qpos_index] - wanted)[LEAD:, nao_body().leg_servo]
    lag = np.degrees(3.55 / 100 * np.gradient(wanted, 0.01, axis=0))[LEAD:, nao_body().leg_servo]
    for i, role in enumerate(LEG_JOINTS):
        if "pitch" in role:
            assert np.sqrt((error[:, i] ** 2).mean()) < 0.6
        else:
            assert np.sqrt(((error + lag)[:, i] ** 2).mean()) < 0.6


def test_a_walk_beyond_the_legs_reach_is_refused():
    gait = load_gait("gait_march").model_copy(update={"step_length": 0.4})
    with pytest.raises(SimulationError, match="bend the knee more or step shorter"):
        walk_of_nao(gait, 100)


# --- standing -----------------------------------------------------------------------------------------------


def test_the_force_cells_of_a_standing_robot_carry_its_weight():
    readings = standing().readings[0]
    assert readings[LAYOUT.forces].sum() == pytest.approx(WEIGHT, rel=0.01)
    assert sum(centre_of_pressure(readings, LAYOUT, side)[1] for side in (0, 1)) == pytest.approx(
        WEIGHT, rel=0.01
    )
    assert readings[LAYOUT.torso_up] == pytest.approx([0, 0, 1], abs=2e-3)
    assert readings[LAYOUT.com][2] == pytest.approx(0.27, abs=0.005)


def through_the_cells(point, sole, cells):
    """What force cells make of a centre of pressure if each takes the load of its corner of the sole.

    A load at (x, y) of a plate rests on its four corners as (front or rear) times (left or right) part.
    """
    forward = (point[0] - sole.back) / (sole.front - sole.back)
    left = (point[1] - sole.right) / (sole.left - sole.right)
    parts = [forward * left, forward * (1 - left), (1 - forward) * left, (1 - forward) * (1 - left)]
    return np.array(parts) @ np.array(list(cells.values()))


def test_three_estimators_of_the_zmp_agree_on_a_standing_robot():
    """Contacts, eq. 2 from the CoM, and the cells, which lie within the sole and see a part of the way."""
    robot = standing(("ankle_roll",), (math.radians(3),))
    readings = robot.readings[0]
    feet = [readings[LAYOUT.foot(side)] for side in (0, 1)]
    middle = (feet[0] + feet[1])[:2] / 2
    by_contacts = total_centre_of_pressure(readings, LAYOUT) - middle
    by_com = zmp_from_com(readings[LAYOUT.com][:2], np.zeros(2), readings[LAYOUT.com][2]) - middle
    np.testing.assert_allclose(by_contacts, by_com, atol=1e-3)
    assert by_com[1] > 0.005

    expected, loads = np.zeros(2), []
    for side, name in enumerate(("left", "right")):
        foot = getattr(nao_body().block.feet, name)
        point, load = centre_of_pressure(readings, LAYOUT, side)
        seen = through_the_cells(point - feet[side][:2], foot.sole, foot.cells)
        expected += load * (seen + np.array([0.0, 0.05 - 0.1 * side]))
        loads.append(load)
    by_cells = Observer(nao().channels, ["zmp_x", "zmp_y"])(robot.readings)[0]
    np.testing.assert_allclose(by_cells, expected / sum(loads), atol=5e-4)


def test_the_cells_of_a_marching_robot_see_three_fifths_of_the_way_across_the_sole():
    """Cells 53 and 49 mm apart on a sole 88.8 mm wide, while one foot carries."""
    readings, _ = marching()
    for side, name in ((0, "left"), (1, "right")):
        foot = getattr(nao_body().block.feet, name)
        point, load = centre_of_pressure(readings, LAYOUT, side)
        alone = (load > 0.95 * WEIGHT) & (np.arange(len(load)) > LEAD)
        true = (point - readings[:, LAYOUT.foot(side)][:, :2])[alone]
        loads = readings[:, LAYOUT.forces][alone, 4 * side : 4 * side + 4]
        seen = loads @ np.array(list(foot.cells.values())) / loads.sum(axis=1, keepdims=True)
        slope = np.polyfit(true[:, 1], seen[:, 1], 1)[0]
        assert 49 / 88.8 < slope < 53 / 88.8
        expected = [through_the_cells(point, foot.sole, foot.cells) for point in true]
        np.testing.assert_allclose(seen, expected, atol=1e-3)


def test_eq_2_follows_the_contacts_of_a_marching_robot():
    """Within a centimetre half of the time: eq. 2 leaves out the turning of the limbs."""
    readings, _ = marching()
    velocity = readings[:, LAYOUT.com_velocity]
    acceleration = np.gradient(velocity[:, :2], 0.01, axis=0)
    com = readings[:, LAYOUT.com]
    by_com = zmp_from_com(com[:, :2], acceleration, com[:, 2:])[LEAD:]
    by_contacts = total_centre_of_pressure(readings, LAYOUT)[LEAD:]
    difference = np.abs(by_com - by_contacts)
    assert np.median(difference[:, 0]) < 0.003
    assert np.median(difference[:, 1]) < 0.01
    assert np.corrcoef(by_com[:, 1], by_contacts[:, 1])[0, 1] > 0.9


# --- commands -----------------------------------------------------------------------------------------------


def test_an_ankle_roll_shifts_the_body_and_leaves_it_upright():
    """Positive to the left, by 0.152 m sin(angle) as measured on the model; eq. 5 turns the hips back."""
    for angle in (math.radians(5), math.radians(-5)):
        readings = standing(("ankle_roll",), (angle,)).readings[0]
        sideways = readings[LAYOUT.com][1] - (readings[LAYOUT.foot(0)] + readings[LAYOUT.foot(1)])[1] / 2
        assert sideways == pytest.approx(0.152 * math.sin(angle), rel=0.1)
        assert readings[LAYOUT.torso_up][2] > math.cos(math.radians(0.5))


def test_an_ankle_pitch_shifts_the_body_forward_or_back_and_leaves_it_upright():
    middle = standing().readings[0][LAYOUT.com][0]
    for angle in (math.radians(4), math.radians(-4)):
        readings = standing(("ankle_pitch",), (angle,)).readings[0]
        shift = readings[LAYOUT.com][0] - middle
        assert np.sign(shift) == -np.sign(angle)  # toes down pushes the body back
        assert abs(shift) > 0.008
        assert readings[LAYOUT.torso_up][2] > math.cos(math.radians(1.0))


def test_commands_are_added_to_the_targets_by_the_robot_file():
    motion = still()[1]
    robot = naos(motion, ("ankle_pitch", "ankle_roll"), batch=2)
    robot.advance(3, np.array([[0.0, 0.1], [0.2, 0.0]]))
    added = dict(
        zip(nao().names("actuator"), (robot.physics.bind("ctrl") - motion.targets[3]).T, strict=True)
    )
    expected = {
        "LAnkleRoll": [0.1, 0], "RAnkleRoll": [0.1, 0], "LHipRoll": [-0.1, 0], "RHipRoll": [-0.1, 0],
        "LAnklePitch": [0, 0.2], "RAnklePitch": [0, 0.2], "LHipPitch": [0, -0.2], "RHipPitch": [0, -0.2],
    }  # fmt: skip
    for name, values in added.items():
        np.testing.assert_allclose(values, expected.get(name, [0, 0]), atol=1e-15)


def commanded(command, angle, bend_rad=0.5):
    """Body poses of a NAO with bent knees whose joints have turned as a command says; by `mj_kinematics`."""
    robot, data = nao_body(), mujoco.MjData(nao().model)
    joints = robot.start_qpos[robot.qpos_index]
    for side in (0, 5):
        joints[robot.leg_servo[side + 1 : side + 4]] = [-bend_rad, 2 * bend_rad, -bend_rad]
    for name, factor in COMMANDS[command][1].items():
        joints[robot.leg_servo[LEG_JOINTS.index(name)]] += factor * angle
    data.qpos[3] = 1.0
    data.qpos[robot.qpos_index] = joints
    mujoco.mj_kinematics(robot.model, data)
    return data


@pytest.mark.parametrize("angle", [0.1, -0.1])
@pytest.mark.parametrize(("command", "axis"), [("torso_roll", 0), ("torso_pitch", 1)])
def test_the_torso_turns_about_its_axis_over_feet_that_stay(command, axis, angle):
    """As the feet see it: the torso's turn is the inverse of theirs."""
    data = commanded(command, angle)
    expected = np.zeros(4)
    mujoco.mju_axisAngle2Quat(expected, -np.eye(3)[axis], angle)
    for foot in nao_body().feet_id:
        np.testing.assert_allclose(data.xquat[foot], expected, atol=1e-12)


@pytest.mark.parametrize("angle", [0.1, -0.1])
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("way", ["x", "y"])
def test_a_foot_moves_on_a_circle_about_its_hip_with_the_sole_parallel(side, way, angle):
    """Forward or to the left for a positive angle, whichever leg; the other leg stays."""
    before, after = commanded(f"{side}_foot_{way}", 0.0), commanded(f"{side}_foot_{way}", angle)
    moving, staying = nao_body().feet_id if side == "left" else nao_body().feet_id[::-1]
    hip = before.xanchor[nao().model.joint(f"{side[0].upper()}HipRoll").id]
    leg, turned = (data.xpos[moving] - hip for data in (before, after))
    c, s = math.cos(angle), math.sin(angle)
    turn = [[c, 0, -s], [0, 1, 0], [s, 0, c]] if way == "x" else [[1, 0, 0], [0, c, -s], [0, s, c]]
    np.testing.assert_allclose(turned, turn @ leg, atol=1e-12)
    assert np.sign((turned - leg)["xyz".index(way)]) == np.sign(angle)
    np.testing.assert_allclose(after.xquat[moving], [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(after.xpos[staying], before.xpos[staying])


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_lifted_leg_gets_shorter_with_the_sole_parallel(side):
    """By l_H cos a + l_K cos b of eq. 4, both angles from the vertical grown by the command."""
    before, after = (commanded(f"{side}_leg_lift", angle) for angle in (0.0, 0.2))
    moving, staying = nao_body().feet_id if side == "left" else nao_body().feet_id[::-1]
    rise = after.xpos[moving][2] - before.xpos[moving][2]
    assert rise == pytest.approx((0.1 + 0.1029) * (math.cos(0.5) - math.cos(0.7)), rel=1e-3)
    assert abs(after.xpos[moving][0] - before.xpos[moving][0]) < 0.001
    np.testing.assert_allclose(after.xquat[moving], [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(after.xpos[staying], before.xpos[staying])


def test_an_unknown_command():
    with pytest.raises(UnknownNameError) as caught:
        naos(still()[1], ("ankle_rol",))
    assert str(caught.value) == (
        f"unknown command of the robot 'ankle_rol'; allowed: {', '.join(nao().commands)}; "
        "did you mean 'ankle_roll'?"
    )


# --- pushes -------------------------------------------------------------------------------------------------


def test_bodies_are_known_by_their_part_and_by_their_name():
    assert nao().number("body", "torso") == nao_body().torso_id
    assert nao().number("body", "left_foot") == nao().number("body", "l_ankle") == nao_body().feet_id[0]
    assert nao().model.body(nao().number("body", "RTibia")).name == "RTibia"
    with pytest.raises(UnknownNameError) as caught:
        nao().number("body", "trunk")
    assert str(caught.value).startswith("unknown body 'trunk'; allowed: torso, left_foot, right_foot, Neck, ")


def test_a_push_in_free_flight_gives_its_impulse_to_the_body():
    """Momentum: m dv = F dt, and gravity alone otherwise."""
    robot = naos(still()[1], batch=2)
    robot.qpos[:, 2] += 1.0
    none = np.zeros((2, 0))
    robot.advance(0, none)
    before = robot.readings[:, LAYOUT.com_velocity].copy()
    robot.push(nao_body().torso_id, np.array([[0.0, 20.0, 0.0], [-7.0, 0.0, 3.0]]))
    robot.advance(1, none)
    robot.push(nao_body().torso_id, np.zeros((2, 3)))
    robot.advance(2, none)
    gained = robot.readings[:, LAYOUT.com_velocity] - before - [0, 0, -9.81 * 0.02]
    expected = np.array([[0.0, 20.0, 0.0], [-7.0, 0.0, 3.0]]) * 0.01 / nao().mass_kg
    np.testing.assert_allclose(gained, expected, atol=2e-5)


@pytest.mark.parametrize("height_m", [0.0, 0.1])
def test_a_push_at_a_body_acts_at_its_centre_of_mass_or_above(height_m):
    """In free flight the angular momentum about the CoM changes by lever times impulse."""
    robot = naos(still()[1], batch=1)
    robot.qpos[:, 2] += 1.0
    model, data = nao().model, mujoco.MjData(nao().model)
    head = nao().number("body", "Head")
    robot.push(head, np.array([[0.0, 5.0, 0.0]]), np.array([[-height_m * 5.0, 0.0, 0.0]]))
    robot.advance(0, np.zeros((1, 0)))
    data.qpos[:], data.qvel[:] = robot.qpos[0], robot.qvel[0]
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    lever = data.xipos[head] - data.body("torso").subtree_com
    assert data.body("torso").subtree_angmom[0] == pytest.approx(
        -(lever[2] + height_m) * 5.0 * 0.01, rel=0.05
    )


# --- batches ------------------------------------------------------------------------------------------------


def pushed_by_hand(batch, threads):
    """Robots that are all pushed differently, 60 ticks of marching."""
    robot = naos(walk_of("gait_march")[1], ("ankle_roll",), batch, threads)
    force = np.zeros((batch, 3))
    force[:, 1] = np.arange(batch) * 4.0
    for tick in range(120, 180):
        robot.push(nao_body().torso_id, force if tick < 130 else 0 * force)
        robot.advance(tick, np.full((batch, 1), 0.01))
    return robot.readings.copy(), robot.qpos.copy()


def test_threads_change_no_bit():
    for one, two in zip(pushed_by_hand(5, 1), pushed_by_hand(5, 2), strict=True):
        np.testing.assert_array_equal(one.view(np.int64), two.view(np.int64))


def test_a_robot_does_the_same_in_a_batch_of_any_size():
    (three, _), (five, _) = pushed_by_hand(3, None), pushed_by_hand(5, None)
    np.testing.assert_array_equal(three.view(np.int64), five[:3].view(np.int64))


def test_sensors_in_the_last_time_step_only_change_no_bit():
    """Against MuJoCo itself, stepped one by one with all sensors in every step."""
    robot, data = nao(), mujoco.MjData(nao().model)
    motion = walk_of("gait_march")[1]
    stepped = naos(motion)
    data.qpos[:] = stepped.qpos[0]
    mujoco.mj_forward(robot.model, data)
    for tick in range(160):
        data.ctrl[:] = motion.targets[tick]
        mujoco.mj_step(robot.model, data, nstep=5)
        stepped.advance(tick, np.zeros((1, 0)))
        np.testing.assert_array_equal(stepped.readings[0], data.sensordata)
    np.testing.assert_array_equal(stepped.qpos[0], data.qpos)


def test_robots_that_are_stopped_stay_and_the_others_go_on():
    some, all_ = (naos(walk_of("gait_march")[1], batch=3) for _ in range(2))
    for tick in range(120, 150):
        if tick == 130:
            some.stop(np.array([False, True, False]))
            held = some.qpos[1].copy()
        for robots in (some, all_):
            robots.advance(tick, np.zeros((3, 0)))
    np.testing.assert_array_equal(some.qpos[1], held)
    np.testing.assert_array_equal(some.qpos[[0, 2]], all_.qpos[[0, 2]])
    assert np.abs(all_.qpos[1] - held).max() > 0.01
