"""From robot file and MJCF to a model: names, servos, floor; and what is said when a part is not there."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from robots.nao_files import shipped_file, shipped_mjcf, write_robot
from walking import NAO_LEG_JOINTS, nao

from circuitkit.base.errors import InputError
from circuitkit.robots import Plant, build_model, load_robot


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
    robot = nao()
    model, data = robot.model, mujoco.MjData(robot.model)
    assert len(robot.actuated) == 24 == model.nu
    for i, name in enumerate(robot.actuated):
        joint = model.joint(name)
        assert model.actuator(i).trnid[0] == joint.id
        assert (joint.qposadr[0], joint.dofadr[0]) == (robot.qpos_index[i], robot.dof_index[i])
        data.joint(name).qpos = i
    np.testing.assert_array_equal(data.qpos[robot.qpos_index], np.arange(24))


def test_the_legs_columns_are_the_legs_servos():
    robot = nao()
    assert [robot.actuated[i] for i in robot.leg_index] == list(NAO_LEG_JOINTS)


def test_a_servo_pulls_as_its_profile_says():
    """Torque = stiffness (target - angle) - damping velocity, cut off at the largest."""
    robot = build_model(load_robot("nao").with_servos("bhuman"))
    model, data = robot.model, mujoco.MjData(robot.model)
    i = robot.actuated.index("LAnkleRoll")
    data.ctrl[i], data.qpos[robot.qpos_index[i]], data.qvel[robot.dof_index[i]] = 0.03, 0.01, 0.2
    mujoco.mj_forward(model, data)
    assert data.actuator_force[i] == pytest.approx(100 * 0.02 - 3.55 * 0.2)
    data.ctrl[i] = 1.0
    mujoco.mj_forward(model, data)
    assert data.actuator_force[i] == pytest.approx(5.0)
    assert robot.stiffness[i] == 100


def test_the_posture_hangs_the_arms_down():
    robot = nao()
    posture = dict(zip(robot.actuated, np.degrees(robot.posture), strict=True))
    assert posture.pop("LShoulderPitch") == posture.pop("RShoulderPitch") == pytest.approx(90)
    assert posture["LKneePitch"] == 0


def test_the_mass_is_the_robots():
    assert nao().mass_kg == pytest.approx(5.19539, abs=1e-4)


def test_friction_is_that_of_floor_and_soles():
    """MuJoCo takes the larger of both, so both are set."""
    model = build_model(load_robot("nao"), Plant(friction=0.3)).model
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


def test_an_mjcf_may_bring_its_own_floor_servos_sensors_and_keyframes(tmp_path, robot, mjcf):
    """They are replaced: the robot behaves to the bit as without them."""
    root = mjcf.getroot()
    floor = {"name": "floor", "type": "plane", "size": "1 1 1", "pos": "0 0 -0.5", "friction": "0.1"}
    ET.SubElement(root.find("worldbody"), "geom", floor)
    motor = {"name": "LKneePitch", "joint": "LKneePitch"}
    ET.SubElement(ET.SubElement(root, "actuator"), "motor", motor)
    ET.SubElement(ET.SubElement(root, "sensor"), "gyro", {"name": "com", "site": "imu"})
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", {"name": "home", "ctrl": "0.5"})
    model = built(tmp_path, robot, mjcf).model
    assert (model.nu, model.nkey, model.ngeom) == (24, 0, 3)
    assert model.nsensor == nao().model.nsensor
    np.testing.assert_array_equal(model.geom_friction, nao().model.geom_friction)


def test_every_name_that_is_not_there_is_listed_at_once(tmp_path, robot, mjcf):
    robot["torso"] = "Torso"
    robot["imu"] = "imus"
    robot["feet"]["left"]["body"] = "l_ankel"
    robot["joints"]["right_knee_pitch"] = "RKnee"
    robot["posture"]["LShoulderPich"] = "90 deg"
    bodies = "torso, Neck, Head, "
    said = complaints(tmp_path, robot, mjcf)
    assert len(said) == 5
    assert said[0].startswith(f"other.xml:1:1: torso: the MJCF has no body 'Torso'; allowed: {bodies}")
    assert said[0].endswith("; did you mean 'torso'?")
    assert said[1] == "other.xml:1:1: imu: the MJCF has no site 'imus'; allowed: imu; did you mean 'imu'?"
    assert said[2].startswith("other.xml:1:1: feet.left.body: the MJCF has no body 'l_ankel'; allowed: ")
    assert said[2].endswith("; did you mean 'l_ankle'?")
    assert said[3].startswith(
        "other.xml:1:1: joints.right_knee_pitch: the MJCF has no hinge 'RKnee'; allowed: "
    )
    assert said[3].endswith("; did you mean 'RKneePitch'?")
    assert said[4].startswith("other.xml:1:1: posture.LShoulderPich: the MJCF has no hinge 'LShoulderPich'; ")


def test_a_free_joint_is_no_joint_to_drive(tmp_path, robot, mjcf):
    robot["posture"]["root"] = "1 deg"
    (said,) = complaints(tmp_path, robot, mjcf)
    assert said.startswith("other.xml:1:1: posture.root: the MJCF has no hinge 'root'; allowed: HeadYaw, ")


def test_the_torso_must_be_what_floats(tmp_path, robot, mjcf):
    robot["torso"] = "Head"
    assert complaints(tmp_path, robot, mjcf) == [
        "other.xml:1:1: torso: 'Head' does not hang from the model's only free joint; "
        "allowed: the body that does"
    ]


def test_a_foot_must_be_able_to_touch(tmp_path, robot, mjcf):
    robot["feet"]["right"]["body"] = "RTibia"
    assert complaints(tmp_path, robot, mjcf) == [
        "other.xml:1:1: feet.right.body: 'RTibia' has no geom that can touch the ground; "
        "allowed: a body with a sole"
    ]


def test_every_joint_needs_a_servo(tmp_path, robot, mjcf):
    robot["servo_profiles"] = {"stall": robot["servo_profiles"]["stall"][:2]}
    assert complaints(tmp_path, robot, mjcf) == [
        "other.xml:1:1: servo_profiles.stall: no servo for the joint 'HeadYaw'; "
        "allowed: patterns that match every joint"
    ]


def test_a_model_that_mujoco_refuses_is_named(tmp_path, robot, mjcf):
    """Here a site already has the name of a force cell."""
    ET.SubElement(mjcf.getroot().find("worldbody"), "site", {"name": "LFsrFL"})
    said = complaints(tmp_path, robot, mjcf)
    assert said[0].startswith("other.xml:1:1: MuJoCo refuses the model: ")
    assert "LFsrFL" in " ".join(said)


def test_a_missing_mjcf(tmp_path, robot, mjcf):
    path = write_robot(tmp_path, robot, mjcf)
    (tmp_path / "other.xml").unlink()
    with pytest.raises(InputError) as caught:
        build_model(load_robot(path))
    assert str(caught.value) == (
        f"{tmp_path / 'other.xml'}:1:1: mjcf: no such file; allowed: the path of an MJCF file"
    )


def test_a_file_that_is_no_mjcf(tmp_path, robot, mjcf):
    path = write_robot(tmp_path, robot, mjcf)
    (tmp_path / "other.xml").write_text("<mujoco><worldbody><body>", encoding="utf-8")
    with pytest.raises(InputError, match=r"other\.xml:1:1: not an MJCF file: "):
        build_model(load_robot(path))
