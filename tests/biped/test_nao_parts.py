"""From the NAO's files to a model: names, servos, floor; and what is said when a part is not there."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from biped.nao_files import shipped_file, shipped_mjcf, write_robot
from walking import NAO_LEG_JOINTS, nao, nao_body

from circuitkit.base.errors import InputError
from circuitkit.biped.robot import biped_of
from circuitkit.robots import Observer, build_model, load_robot
from circuitkit.simulation.disturbances.body import Body


@pytest.fixture
def robot():
    """The robot file as data, to be changed."""
    return shipped_file()


@pytest.fixture
def mjcf():
    """The MJCF, to be changed."""
    return shipped_mjcf()


def built(tmp_path, robot, mjcf):
    return build_model(load_robot(write_robot(tmp_path, robot, mjcf)))


def complaints(tmp_path, robot, mjcf):
    with pytest.raises(InputError) as caught:
        built(tmp_path, robot, mjcf)
    return str(caught.value).replace(str(tmp_path) + "/", "").splitlines()


# --- what is bound to what ----------------------------------------------------------------------------------


def test_each_servo_drives_its_joint():
    model, body = nao().model, nao_body()
    data = mujoco.MjData(model)
    assert len(body.servos) == 24 == model.nu
    for i, number in enumerate(body.servos):
        joint = model.joint(model.actuator(number).name)
        assert model.actuator(number).trnid[0] == joint.id
        assert (joint.qposadr[0], joint.dofadr[0]) == (body.qpos_index[i], body.dof_index[i])
        data.joint(joint.name).qpos = i
    np.testing.assert_array_equal(data.qpos[body.qpos_index], np.arange(24))


def test_the_legs_columns_are_the_legs_servos():
    body = nao_body()
    assert [nao().model.actuator(body.servos[i]).name for i in body.leg_servo] == list(NAO_LEG_JOINTS)


def test_a_servo_pulls_as_its_profile_says():
    """Torque = stiffness (target - angle) - damping velocity, cut off at the largest."""
    robot = build_model(load_robot("nao").with_servos("bhuman"))
    model, data = robot.model, mujoco.MjData(robot.model)
    servo, joint = (getattr(data, kind)("LAnkleRoll") for kind in ("actuator", "joint"))
    servo.ctrl, joint.qpos, joint.qvel = 0.03, 0.01, 0.2
    mujoco.mj_forward(model, data)
    assert servo.force[0] == pytest.approx(100 * 0.02 - 3.55 * 0.2)
    servo.ctrl = 1.0
    mujoco.mj_forward(model, data)
    assert servo.force[0] == pytest.approx(5.0)
    assert set(biped_of(robot).stiffness[biped_of(robot).leg_servo]) == {100.0}


def test_the_posture_hangs_the_arms_down():
    held = nao().held
    posture = {nao().model.actuator(i).name: angle for i, angle in enumerate(np.degrees(held))}
    assert posture.pop("LShoulderPitch") == posture.pop("RShoulderPitch") == pytest.approx(90)
    assert posture["LKneePitch"] == 0


def test_the_mass_is_the_robots():
    assert nao().mass_kg == pytest.approx(5.19539, abs=1e-4)


def test_friction_is_that_of_floor_and_soles():
    """MuJoCo takes the larger of both, so both are set."""
    model = build_model(load_robot("nao"), [Body(friction=0.3).change]).model
    assert {model.geom(name).friction[0] for name in ("floor", "l_sole", "r_sole")} == {0.3}
    assert {nao().model.geom(name).friction[0] for name in ("floor", "l_sole", "r_sole")} == {1.0}


def test_looks_change_nothing_but_the_looks():
    plain, dressed = nao().model, build_model(load_robot("nao"), looks=True).model
    assert dressed.ngeom > plain.ngeom == 3
    positions = []
    for model in (plain, dressed):
        data = mujoco.MjData(model)
        data.qpos[2] += 0.01
        mujoco.mj_step(model, data, nstep=100)
        positions.append(data.qpos.copy())
    np.testing.assert_array_equal(*positions)


# --- other MJCFs --------------------------------------------------------------------------------------------


def test_an_mjcf_may_bring_things_servos_sensors_and_keyframes_of_its_own(tmp_path, robot, mjcf):
    """They stay, but for a motor that a servo stands in for; the robot behaves to the bit as without them."""
    root = mjcf.getroot()
    post = {"name": "post", "type": "box", "size": "0.1 0.1 0.1", "pos": "5 0 0.1"}
    ET.SubElement(root.find("worldbody"), "geom", post)
    motor = {"name": "LKneePitch", "joint": "LKneePitch"}
    ET.SubElement(ET.SubElement(root, "actuator"), "motor", motor)
    ET.SubElement(ET.SubElement(root, "sensor"), "gyro", {"name": "com", "site": "imu"})
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", {"name": "home", "ctrl": "0.5"})
    other = built(tmp_path, robot, mjcf)
    assert (other.model.nu, other.model.nkey, other.model.ngeom) == (24, 1, nao().model.ngeom + 1)
    assert other.model.nsensor == nao().model.nsensor + 1
    np.testing.assert_array_equal(other.held, nao().held)
    found = []
    for each in (other, nao()):
        data = mujoco.MjData(each.model)
        data.qpos[:], data.ctrl[:] = each.start_qpos, each.held
        mujoco.mj_step(each.model, data, nstep=150)
        found.append((data.qpos.copy(), Observer(each.channels, tuple(nao().channels))(data.sensordata)))
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one, two)


def test_every_name_that_is_not_there_is_listed_at_once(tmp_path, robot, mjcf):
    biped = robot["biped"]
    biped["torso"] = "Torso"
    biped["imu"] = "imus"
    biped["feet"]["left"]["body"] = "l_ankel"
    biped["joints"]["right_knee_pitch"] = "RKnee"
    robot["channels"] = {"head": {"unit": "rad", "is": "joint(HeadYow)"}}
    bodies = "torso, Neck, Head, "
    said = [line.partition(": ")[2] for line in complaints(tmp_path, robot, mjcf)]
    assert len(said) == 5
    assert said[0].startswith(f"biped.torso: the MJCF has no body 'Torso'; allowed: {bodies}")
    assert said[0].endswith("; did you mean 'torso'?")
    assert said[1] == "biped.imu: the MJCF has no site 'imus'; allowed: imu; did you mean 'imu'?"
    assert said[2].startswith("biped.feet.left.body: the MJCF has no body 'l_ankel'; allowed: ")
    assert said[2].endswith("; did you mean 'l_ankle'?")
    assert said[3].startswith("biped.joints.right_knee_pitch: the MJCF has no hinge 'RKnee'; allowed: ")
    assert said[3].endswith("; did you mean 'RKneePitch'?")
    assert said[4].startswith("channels.head.is: the MJCF has no joint 'HeadYow'; allowed: ")
    assert said[4].endswith("; did you mean 'HeadYaw'?")


def test_a_free_joint_is_no_joint_to_hold(tmp_path, robot, mjcf):
    robot["hold"]["root"] = "1 deg"
    (said,) = complaints(tmp_path, robot, mjcf)
    assert "hold.root: the MJCF has no hinge or slide 'root'; allowed: HeadYaw, " in said


def test_the_torso_must_be_what_floats(tmp_path, robot, mjcf):
    robot["biped"]["torso"] = "Head"
    (said,) = complaints(tmp_path, robot, mjcf)
    assert said.endswith(": biped.torso: 'Head' does not hang from a free joint; allowed: the body that does")


def test_a_foot_must_be_able_to_touch(tmp_path, robot, mjcf):
    robot["biped"]["feet"]["right"]["body"] = "RTibia"
    (said,) = complaints(tmp_path, robot, mjcf)
    assert said.endswith(
        ": biped.feet.right.body: 'RTibia' has no geom that can touch the ground; allowed: a body with a sole"
    )


def test_every_joint_of_the_legs_needs_a_servo(tmp_path, robot, mjcf):
    robot["servos"] = {"stall": robot["servos"]["stall"][1:]}
    (said,) = complaints(tmp_path, robot, mjcf)
    assert (
        ": biped.joints.left_hip_roll: the joint 'LHipRoll' has no position servo; allowed: HeadYaw, " in said
    )
    assert said.endswith("; or give it one by servos")
