"""The biped's block of a robot file: what it says, and every complaint word for word."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from biped.nao_files import shipped_file
from small_robots import CART, CART_FILE, robot_file

from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.biped.gait import LEG_JOINTS
from circuitkit.robots import load_robot, shipped_robots
from circuitkit.simulation import Scenario, make_plan

DATA = yaml.safe_load((Path(__file__).parent / "nao_v4_data.yaml").read_text(encoding="utf-8"))


def changed_robot(tmp_path, whole=None, **sections):
    """The NAO's file with some sections of its biped replaced, as a path; or with some of the file."""
    robot = shipped_file()
    robot |= whole or {}
    robot["biped"] |= sections
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return path


def complaints(path):
    with pytest.raises(InputError) as caught:
        load_robot(path)
    return str(caught.value).replace(str(path), path.name)


def test_the_nao_comes_with_the_toolkit():
    assert "nao" in shipped_robots()
    assert load_robot("nao").robot == "nao"
    assert load_robot("nao").mjcf_path.name == "nao.xml"


def test_legs_are_those_of_the_published_data():
    """Joint origins: the knee under the hip, the ankle under the knee."""
    legs = load_robot("nao").biped.legs.geometry()
    joints = DATA["joints"]
    assert legs.thigh_m == pytest.approx(-joints["LKneePitch"]["origin"][2])
    assert legs.tibia_m == pytest.approx(-joints["LAnklePitch"]["origin"][2])
    assert legs.ankle_height_m == pytest.approx(DATA["foot_height"])
    hip = joints["LHipYawPitch"]["origin"]
    assert (legs.hip_offset_y_m, legs.hip_offset_z_m) == pytest.approx((hip[1], -hip[2]))


def test_cells_lie_within_their_sole_and_feet_mirror_each_other():
    """Aldebaran's table breaks the mirror at the rear cells by 0 mm sideways; forward they are the same."""
    feet = load_robot("nao").biped.feet
    for foot in (feet.left, feet.right):
        for forward, left in foot.cells.values():
            assert foot.sole.back < forward < foot.sole.front
            assert foot.sole.right < left < foot.sole.left
    mirrored = {
        name.replace("L", "R", 1)[:-1] + {"L": "R", "R": "L"}[name[-1]]: (x, -y)
        for name, (x, y) in feet.left.cells.items()
    }
    assert {name: y for name, (_, y) in mirrored.items()} == {
        name: y for name, (_, y) in feet.right.cells.items()
    }
    assert (feet.right.sole.left, feet.right.sole.right) == (-feet.left.sole.right, -feet.left.sole.left)


@pytest.mark.parametrize("torque", [("stall", 14.8), ("bhuman", 5.0), ("urdf", 3.348)])
def test_servo_profiles_are_chosen_by_name(torque):
    name, ankle_roll = torque
    robot = load_robot("nao").with_servos(name)
    profile = robot.servos_in_use
    assert profile[0].joints[2] == "*AnkleRoll"
    assert profile[0].torque.value_si == pytest.approx(ankle_roll)


def test_no_profile_means_the_robots_own():
    robot = load_robot("nao")
    assert robot.with_servos(None) is robot


def test_an_unknown_profile():
    with pytest.raises(UnknownNameError) as caught:
        load_robot("nao").with_servos("stal")
    assert str(caught.value) == (
        "unknown servo profile 'stal'; allowed: stall, bhuman, urdf; did you mean 'stall'?"
    )


def test_an_unknown_robot():
    with pytest.raises(UnknownNameError) as caught:
        load_robot("noa")
    assert str(caught.value) == (
        "unknown robot (a path to a robot.yaml is allowed as well) 'noa'; "
        f"allowed: {', '.join(shipped_robots())}; did you mean 'nao'?"
    )


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_robot(tmp_path / "robot.yaml")


def test_an_unknown_profile_in_the_file(tmp_path):
    path = changed_robot(tmp_path, {"servo_profile": "fast"})
    assert complaints(path) == ("robot.yaml:1:1: unknown servo profile 'fast'; allowed: bhuman, stall, urdf")


def test_a_joint_of_the_legs_that_is_missing(tmp_path):
    joints = {role: "x" for role in LEG_JOINTS if role != "left_knee_pitch"}
    path = changed_robot(tmp_path, joints=joints)
    needed = [role for role in LEG_JOINTS if not role.endswith("ankle_roll")]
    assert complaints(path) == (
        f"robot.yaml:2:3: biped: joints: missing left_knee_pitch; required: {', '.join(needed)}"
    )


def test_a_joint_that_legs_do_not_have(tmp_path):
    path = changed_robot(tmp_path, joints=dict.fromkeys((*LEG_JOINTS, "left_toe"), "x"))
    said = complaints(path)
    assert said == f"robot.yaml:2:3: biped: joints: unknown 'left_toe'; allowed: {', '.join(LEG_JOINTS)}"


def test_a_foot_has_four_cells(tmp_path):
    nao = load_robot("nao")
    foot = {
        "body": "l_ankle",
        "sole": {"back": "-50 mm", "front": "99 mm", "right": "-38 mm", "left": "50 mm"},
        "cells": {key: ["1 mm", "2 mm"] for key in list(nao.biped.feet.left.cells)[:3]},
    }
    said = complaints(changed_robot(tmp_path, feet={"left": foot, "right": foot}))
    assert "biped.feet.left: cells: found 3; allowed: 4, or none" in said


def test_two_cells_of_one_name(tmp_path):
    nao = load_robot("nao")
    sole = {"back": "-50 mm", "front": "99 mm", "right": "-38 mm", "left": "50 mm"}
    cells = {name: [f"{x} m", f"{y} m"] for name, (x, y) in nao.biped.feet.left.cells.items()}
    feet = {side: {"body": f"{side[0]}_ankle", "sole": sole, "cells": cells} for side in ("left", "right")}
    assert complaints(changed_robot(tmp_path, feet=feet)).endswith(
        ": biped.feet: the cell 'LFsrFL' is in both feet; allowed: names of their own"
    )


def test_a_sole_the_wrong_way_round(tmp_path):
    nao = load_robot("nao")
    cells = {name: [f"{x} m", f"{y} m"] for name, (x, y) in nao.biped.feet.left.cells.items()}
    sole = {"back": "99 mm", "front": "-50 mm", "right": "-38 mm", "left": "50 mm"}
    foot = {"body": "l_ankle", "sole": sole, "cells": cells}
    said = complaints(changed_robot(tmp_path, feet={"left": foot, "right": foot}))
    assert "feet.left.sole: found back 0.099 and front -0.05; allowed: back before front" in said


def test_a_range_the_wrong_way_round(tmp_path):
    said = complaints(changed_robot(tmp_path, force_cells={"range": ["25 N", "0 N"]}))
    assert "force_cells: found a range from 25 to 0; allowed: the lower end first" in said


@pytest.mark.parametrize("reference", [{"gait": "gait_march"}, {"stand": {}}])
def test_a_robot_that_is_no_biped_is_told_so_before_its_time_step(tmp_path, reference):
    """No multiple of 3 ms is the 10 ms of the reference; but that is not why it cannot walk."""
    robot = load_robot(robot_file(tmp_path, CART, **CART_FILE, timestep="3 ms"))
    with pytest.raises(InputError) as caught:
        make_plan(Scenario(robot=robot, reference=reference, duration=1.0))
    assert str(caught.value) == (
        f"{tmp_path / 'robot.yaml'}:1:1: the robot file has no block 'biped', which says what are torso, "
        "feet and legs"
    )
