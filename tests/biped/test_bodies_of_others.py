"""Bipeds as others build them: other names, axes, zeros, servos and time steps, and things lying around."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import cache

import mujoco
import numpy as np
import pytest
import yaml
from biped.nao_files import rename_everything, shipped_file, shipped_mjcf
from walking import nao_body, nao_joint

from circuitkit.base.errors import InputError, SimulationError
from circuitkit.biped.dynamics import generalised_positions
from circuitkit.biped.gait import LEG_JOINTS
from circuitkit.biped.robot import biped_of
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation import load_scenario, make_plan, simulate

FLIPPED = ("LHipPitch", "LKneePitch", "RHipRoll", "RAnklePitch", "RAnkleRoll")
BENT = {"LKneePitch": 0.3, "RHipPitch": -0.2, "LAnkleRoll": 0.1}  # the MJCF's angle where ours is 0
AHEAD_M, TABLE_M, START_X_M = 0.06, 0.4, 1.5


def numbers(text):
    return [float(word) for word in text.split()]


def shifted(element, key, way):
    element.attrib[key] = " ".join(
        f"{a + b:.9g}" for a, b in zip(numbers(element.get(key, "0 0 0")), way, strict=True)
    )


def other_nao(folder, **biped):
    """A NAO that another author might have written, and a robot file that says as little as it can.

    Five axes of the legs point the other way, three joints are not 0 where ours are, the hips are ahead of
    the torso's frame, servos are the MJCF's own with limits by default, steps take 3 ms, the ground is a box
    in a body, a heavy ball and sites with the names of force cells lie around.
    """
    tree = shipped_mjcf()
    root, file = tree.getroot(), shipped_file()
    names = [joint.attrib["name"] for joint in root.find("worldbody").iter("joint")]
    new = rename_everything(tree)
    old = {new[name]: name for name in names}
    for joint in root.find("worldbody").iter("joint"):
        name = old[joint.attrib["name"]]
        low, high = numbers(joint.attrib["range"])
        if name in FLIPPED:
            joint.attrib["axis"] = " ".join(f"{-value:g}" for value in numbers(joint.attrib["axis"]))
            low, high = -high, -low
        ref = BENT.get(name, 0.0)
        joint.attrib["ref"], joint.attrib["range"] = f"{ref}", f"{low + ref} {high + ref}"
    root.find("option").attrib["timestep"] = "0.003"
    world = root.find("worldbody")
    world.remove(world.find("geom"))
    table = ET.SubElement(world, "body", {"name": "table", "pos": f"0 0 {TABLE_M - 0.1}"})
    ET.SubElement(table, "geom", {"type": "box", "size": "50 50 0.1", "friction": "1 0.005 0.0001"})
    torso = next(body for body in world.iter("body") if body.get("name") == new["torso"])
    for part in torso:
        if part.tag in {"body", "inertial", "site", "geom"}:
            if "fromto" in part.attrib:
                ends = numbers(part.attrib["fromto"])
                part.attrib["fromto"] = " ".join(
                    f"{v + AHEAD_M * (i % 3 == 0):.9g}" for i, v in enumerate(ends)
                )
            else:
                shifted(part, "pos", (AHEAD_M, 0, 0))
    shifted(torso, "pos", (START_X_M, 0, TABLE_M))
    ball = ET.SubElement(world, "body", {"name": "ball", "pos": f"{START_X_M + 2} 2 {TABLE_M + 0.1}"})
    ET.SubElement(ball, "freejoint")
    ET.SubElement(ball, "geom", {"size": "0.1", "mass": "9"})
    for body in world.iter("body"):
        if body.get("name") == new["l_ankle"]:
            ET.SubElement(body, "site", {"name": "LFsrFL"})
    defaults = {"ctrllimited": "true", "forcelimited": "true", "kp": "1"}
    ET.SubElement(root.find("default"), "position", defaults)
    actuators = ET.SubElement(root, "actuator")
    for name, (stiffness, damping, torque) in _servos().items():
        joint = next(j for j in world.iter("joint") if j.get("name") == new[name])
        own = {"kp": f"{stiffness}", "kv": f"{damping}", "forcerange": f"-{torque} {torque}"}
        ET.SubElement(actuators, "position", {"joint": new[name], "ctrlrange": joint.attrib["range"], **own})
    folder.mkdir(parents=True, exist_ok=True)
    tree.write(folder / "other.xml")
    joints = {role: new[nao_joint(role)] for role in LEG_JOINTS}
    bent = {role: BENT[nao_joint(role)] for role in LEG_JOINTS if nao_joint(role) in BENT}
    block = {
        "torso": new["torso"],
        "feet": {"left": {"body": new["l_ankle"]}, "right": {"body": new["r_ankle"]}},
        "joints": joints
        | {role: {"joint": joints[role], "offset": f"{angle} rad"} for role, angle in bent.items()},
    }
    hold = {new[name]: angle for name, angle in file["hold"].items()}
    robot = {"robot": "other", "mjcf": "other.xml", "timestep": "2 ms", "hold": hold, "biped": block | biped}
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


def _servos():
    """Stiffness, damping and largest torque of each joint of the shipped NAO."""
    model = nao_body().model
    found = {}
    for i in range(model.nu):
        name = model.joint(int(model.actuator_trnid[i, 0])).name
        found[name] = (
            model.actuator_gainprm[i, 0],
            -model.actuator_biasprm[i, 2],
            model.actuator_forcerange[i, 1],
        )
    return found


@cache
def other(folder):
    """The robot, compiled."""
    return build_model(load_robot(other_nao(folder)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("other")


# --- what is read off the MJCF ------------------------------------------------------------------------------


def test_signs_lengths_and_soles_are_measured(folder):
    """Those of the shipped NAO, whose robot file gives them as published."""
    found, ours = biped_of(other(folder)), nao_body()
    signs = {nao_joint(role): sign for role, sign in zip(found.block.roles, found.leg_sign, strict=True)}
    assert {name for name, sign in signs.items() if sign < 0} == set(FLIPPED)
    for name in ("thigh", "tibia", "ankle_height", "hip_offset_y", "hip_offset_z"):
        assert getattr(found.block.legs, name) == pytest.approx(getattr(ours.block.legs, name), abs=2e-5)
    assert found.block.legs.hip_offset_x == pytest.approx(AHEAD_M)
    for side in ("left", "right"):
        sole, published = (getattr(body.block.feet, side).sole for body in (found, ours))
        for edge in ("back", "front", "left", "right"):
            assert getattr(sole, edge) == pytest.approx(getattr(published, edge), abs=1e-4)
    np.testing.assert_allclose(found.origin_m, [START_X_M + AHEAD_M, 0, TABLE_M], atol=1e-6)
    assert found.mass_kg == pytest.approx(ours.mass_kg)


def test_the_cells_of_a_foot_share_its_load(folder):
    """Whatever the sole's shape, every contact is in one cell: standing, they carry the weight."""
    robot = other(folder)
    recording = standing(folder).recording
    names = [name for side in ("left", "right") for name in getattr(biped_of(robot).block.feet, side).cells]
    assert names[0] == "left_cell_front_left"
    total = sum(recording.channel(name)[-1, 0] for name in names)
    assert total == pytest.approx(robot.mass_kg * 9.81, rel=0.01)
    assert recording.channel("load_left")[-1, 0] == pytest.approx(total / 2, rel=0.05)


@cache
def standing(folder):
    path = folder / "robot.yaml"
    scenario = load_scenario("nao_stands").with_disturbances(())
    return simulate(
        scenario.model_copy(update={"robot": str(path), "duration": 2.0, "measures": {}, "circuit": None})
    )


def test_the_plan_is_that_of_the_shipped_nao(folder):
    """Same walk, in the other robot's own angles: sign times ours, plus the offset."""
    mine, theirs = (walk_of(robot) for robot in ("nao", str(folder / "robot.yaml")))
    ours, found = nao_body(), biped_of(theirs.robot)
    planned = mine.body.motion.targets[:, ours.servos][:, ours.leg_servo]
    made = theirs.body.motion.targets[:, found.servos][:, found.leg_servo]
    np.testing.assert_allclose((made - found.leg_offset) * found.leg_sign, planned, atol=1e-4)
    np.testing.assert_allclose(
        theirs.interface.planned["planned_com_y"].values,
        mine.interface.planned["planned_com_y"].values,
        atol=1e-5,
    )


def walk_of(robot):
    scenario = load_scenario("nao_push").with_disturbances(())
    return make_plan(
        scenario.model_copy(update={"robot": robot, "duration": 4.0, "circuit": None, "measures": {}})
    )


# --- it walks and is pushed ---------------------------------------------------------------------------------


def test_it_walks_and_is_held_as_the_shipped_one(folder):
    """20 N inward for 0.2 s fell the walk alone and not the circuit, whose edges are those of these cells."""
    path = folder / "robot.yaml"
    other(folder)
    circuit = folder / "circuit.yaml"
    circuit.write_text(
        "circuit: mine\ncontrol_step: 10 ms\ntiming: ordered\ninclude: [binn_lateral]\nparameters:\n"
        "  left_edge_left_foot: 77 mm\n  right_edge_left_foot: 27 mm\n"
        "  w: -0.5 deg\n  leak: 4 %\n  margin: 4 mm\n  one_foot: 0.9\n",
        encoding="utf-8",
    )
    scenario = load_scenario("nao_push").model_copy(
        update={"robot": str(path), "circuit": str(circuit), "duration": 11.0, "measures": {}}
    )
    scenario = scenario.with_disturbances(scenario.pushes)
    calm = scenario.with_disturbances(())
    assert simulate(calm, controller="open_loop").survived
    assert simulate(calm, controller="circuit").survived
    assert not simulate(scenario, controller="open_loop").survived
    assert simulate(scenario, controller="circuit").survived


# --- what is said -------------------------------------------------------------------------------------------


def said(folder, **joints):
    """The complaint about a robot file whose joints differ so."""
    path = other_nao(folder)
    file = yaml.safe_load(path.read_text(encoding="utf-8"))
    file["biped"]["joints"] |= joints
    path.write_text(yaml.safe_dump(file, sort_keys=False), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        build_model(load_robot(path))
    return str(caught.value).replace(str(folder) + "/", "")


def test_a_sign_that_the_axis_contradicts_is_refused(tmp_path):
    name = yaml.safe_load(other_nao(tmp_path).read_text(encoding="utf-8"))["biped"]["joints"][
        "left_hip_pitch"
    ]
    message = said(tmp_path, left_hip_pitch={"joint": name, "sign": 1})
    assert message.endswith(
        f"biped.joints.left_hip_pitch: '{name}' turns about (0, -1, 0), found sign: 1; "
        "allowed: sign: -1, or none"
    )


def test_a_joint_about_another_axis_is_refused(tmp_path):
    joints = yaml.safe_load(other_nao(tmp_path).read_text(encoding="utf-8"))["biped"]["joints"]
    name = joints["left_hip_roll"]
    message = said(tmp_path, left_hip_pitch=name, left_hip_roll=joints["left_hip_pitch"])
    assert f"biped.joints.left_hip_pitch: '{name}' turns about (1, 0, 0) when the leg is straight" in message
    assert "allowed: a hinge about y; a leg that is bent at 0 needs an offset" in message


def test_a_walk_past_a_stop_is_refused(folder):
    """The NAO's knee bends to 121 degrees; a MJCF that stops it at 20 cannot walk with 33."""
    other(folder)
    text = (folder / "other.xml").read_text(encoding="utf-8")
    narrow = folder / "narrow"
    narrow.mkdir(exist_ok=True)
    names = yaml.safe_load((folder / "robot.yaml").read_text(encoding="utf-8"))["biped"]["joints"]
    tree = ET.fromstring(text)
    for joint in tree.iter("joint"):
        if joint.get("name") == names["right_knee_pitch"]:
            joint.attrib["range"] = "-0.1 0.35"
    (narrow / "other.xml").write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
    (narrow / "robot.yaml").write_text((folder / "robot.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(SimulationError) as caught:
        walk_of(str(narrow / "robot.yaml"))
    assert f"the walk turns '{names['right_knee_pitch']}' from " in str(caught.value)
    assert "allowed by the MJCF: -5.7 to 20.1 deg" in str(caught.value)


# --- legs that are not those of the equations ---------------------------------------------------------------


def test_feet_go_where_the_walk_wants_them_on_legs_of_another_build(folder, tmp_path):
    """Hip axes 20 mm apart, the knee 10 mm ahead: eqs. 3-10 miss, Newton's method by nothing."""
    other(folder)
    tree = ET.parse(folder / "other.xml")
    names = yaml.safe_load((folder / "robot.yaml").read_text(encoding="utf-8"))["biped"]["joints"]
    for side in ("left", "right"):
        hip, knee = (
            joint if isinstance(joint, str) else joint["joint"]
            for joint in (names[f"{side}_hip_pitch"], names[f"{side}_knee_pitch"])
        )
        for body in tree.getroot().iter("body"):
            own = [joint.get("name") for joint in body.findall("joint")]
            if hip in own:
                shifted(body, "pos", (0, 0, -0.02))
            if knee in own:
                shifted(body, "pos", (0.01, 0, 0.02))
    tree.write(tmp_path / "other.xml")
    (tmp_path / "robot.yaml").write_text(
        (folder / "robot.yaml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    plan = walk_of(str(tmp_path / "robot.yaml"))
    body, walk = biped_of(plan.robot), plan.body.motion.knowledge.walk
    data = mujoco.MjData(body.model)
    for tick in (0, 150, 230, 300):
        data.qpos[:] = generalised_positions(body, walk)[tick]
        mujoco.mj_kinematics(body.model, data)
        for side in range(2):
            foot = data.xpos[body.feet_id[side]] - body.origin_m
            wanted = walk.schedule.feet_x_m[tick, side], walk.schedule.lift_m[tick, side]
            np.testing.assert_allclose(
                foot[[0, 2]], [wanted[0], body.block.legs.ankle_height + wanted[1]], atol=1e-6
            )
            assert data.xmat[body.feet_id[side]].reshape(3, 3)[2, 2] == pytest.approx(1, abs=1e-9)
    scenario = load_scenario("nao_push").with_disturbances(())
    calm = scenario.model_copy(
        update={
            "robot": str(tmp_path / "robot.yaml"),
            "duration": 6.0,
            "circuit": None,
            "controller": None,
            "measures": {},
        }
    )
    assert simulate(calm).survived


def test_feet_without_an_ankle_roll_stand_where_they_shall_and_level_fore_and_aft(folder, tmp_path):
    """Five joints a leg: the sole rolls with the leg; the rest is as the walk wants it, to ten microns."""
    other(folder)
    tree = ET.parse(folder / "other.xml")
    file = yaml.safe_load((folder / "robot.yaml").read_text(encoding="utf-8"))
    gone = set()
    for side in ("left", "right"):
        joint = file["biped"]["joints"].pop(f"{side}_ankle_roll")
        gone.add(joint if isinstance(joint, str) else joint["joint"])
    for parent in tree.getroot().iter():
        for part in list(parent):
            if (part.tag == "joint" and part.get("name") in gone) or part.get("joint") in gone:
                parent.remove(part)
    file["hold"] = {name: angle for name, angle in file["hold"].items() if name not in gone}
    tree.write(tmp_path / "other.xml")
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(file), encoding="utf-8")
    plan = walk_of(str(tmp_path / "robot.yaml"))
    body, walk = biped_of(plan.robot), plan.body.motion.knowledge.walk
    legs, positions = body.block.legs, generalised_positions(body, walk)
    data = mujoco.MjData(body.model)
    rolled = []
    for tick in (0, 150, 230, 300):
        data.qpos[:] = positions[tick]
        mujoco.mj_kinematics(body.model, data)
        slope = walk.pelvis_m[tick, 1] / (walk.pelvis_m[tick, 2] - legs.ankle_height)
        for side, sign in enumerate((1.0, -1.0)):
            lift = walk.schedule.lift_m[tick, side]
            wanted = [
                walk.schedule.feet_x_m[tick, side],
                sign * legs.hip_offset_y + lift * slope,
                legs.ankle_height + lift,
            ]
            np.testing.assert_allclose(data.xpos[body.feet_id[side]] - body.origin_m, wanted, atol=1e-5)
            forward, left, _ = data.xmat[body.feet_id[side]].reshape(3, 3)[2]
            assert forward == pytest.approx(0, abs=1e-4)
            rolled.append(abs(left))
    assert max(rolled) > np.radians(3)
