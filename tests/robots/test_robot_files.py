"""The robot file: what it says, and every complaint word for word; and files that `init --robot` starts."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_robots import CART, CART_FILE, robot_file, small_model

from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.robots import Observer, build_model, load_robot, shipped_robots
from circuitkit.robots.starter import write_robot_starter


def complaints(path):
    with pytest.raises(InputError) as caught:
        build_model(load_robot(path))
    return str(caught.value).replace(str(path.parent) + "/", "")


@pytest.mark.parametrize("name", shipped_robots())
def test_every_shipped_robot_is_named_after_its_folder_and_can_be_built(name):
    robot = load_robot(name)
    assert robot.robot == name
    assert robot.description
    model = build_model(robot)
    assert model.channels
    assert model.commands


def test_a_robot_is_found_by_name_by_file_and_by_folder(tmp_path):
    path = robot_file(tmp_path, CART, **CART_FILE)
    assert load_robot(path).mjcf_path == load_robot(tmp_path).mjcf_path == tmp_path / "model.xml"
    with pytest.raises(
        UnknownNameError, match=r"unknown robot .* 'cartpol'; allowed: .*; did you mean 'cartpole'"
    ):
        load_robot("cartpol")


def test_a_mjcf_that_is_not_there(tmp_path):
    path = robot_file(tmp_path, CART, **CART_FILE)
    (tmp_path / "model.xml").unlink()
    assert complaints(path) == (
        "robot.yaml:2:7: mjcf: no such file 'model.xml'; "
        "allowed: the path of an MJCF file, from the folder of the robot file"
    )


def test_a_file_that_is_no_mjcf_and_one_that_mujoco_refuses(tmp_path):
    assert complaints(robot_file(tmp_path, "<mujoco><worldbody><body>")).startswith("model.xml:1:1: ")
    weightless = "<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>"
    said = complaints(robot_file(tmp_path, weightless))
    assert said.startswith("model.xml:1:1: ")
    assert "mass and inertia of moving bodies must be larger than mjMINVAL" in said
    misspelt = complaints(robot_file(tmp_path, "<mujoco>\n<worldbody>\n<geom siz='1'/></worldbody></mujoco>"))
    assert misspelt.startswith("model.xml:3:1: ")


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"chanels": {}}, "unknown key 'chanels'; allowed: "),
        ({"timestep": "0 s"}, "timestep: found '0 s'; allowed: more than 0 s"),
        (
            {"timestep": "2 mm"},
            "timestep: found '2 mm', which is length; allowed: a quantity such as '200 ms'",
        ),
        ({"channels": {"a": {"is": "joint(slide)"}}}, "missing key 'unit'; required: unit, is"),
        ({"channels": {"a": {"unit": "m", "of": "x", "is": "joint(slide)"}}}, "unknown key 'of'; allowed: "),
        (
            {"channels": {"a": {"unit": "m", "is": "joint(slide)", "range": ["1 m", "0 m"]}}},
            "range: found 1 m and 0 m; allowed: the lower end first",
        ),
        (
            {
                "servos": [
                    {"joints": [], "stiffness": "1 N*m/rad", "damping": "0 N*m*s/rad", "torque": "1 N*m"}
                ]
            },
            "servos[0].joints: found a list of 0; allowed: at least 1",
        ),
    ],
)
def test_a_wrong_file(tmp_path, sections, said):
    found = complaints(robot_file(tmp_path, CART, **CART_FILE | sections))
    assert said in found
    assert found.startswith("robot.yaml:")


_METRES = {"unit": "m", "is": "joint(slide)"}
_FORCE = {"unit": "N", "to": {"motor": 1}}


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"channels": {"t": _METRES}}, "robot.yaml:4:3: channels.t: found the name 't', which is the time in "
            "measures; allowed: another name"),
        ({"channels": {"a": _METRES, "ended": _METRES}}, "robot.yaml:7:3: channels.ended: found the name "
            "'ended', which is whether until ended the run in measures; allowed: another name"),
        ({"commands": {"t": _FORCE}}, "robot.yaml:4:3: commands.t: found the name 't', which is the time in "
            "measures; allowed: another name"),
        ({"channels": {"force": _METRES}, "commands": {"force": _FORCE}}, "robot.yaml:8:3: commands.force: "
            "found the name 'force' for a command and for a channel; allowed: another name"),
    ],
)  # fmt: skip
def test_a_name_that_measures_could_not_tell_apart(tmp_path, sections, said):
    assert complaints(robot_file(tmp_path, CART, **sections)) == said


def test_a_started_file_takes_no_name_that_means_something_else(tmp_path):
    (tmp_path / "m.xml").write_text(CART.replace('"slide"', '"t"').replace('type="t"', 'type="slide"'))
    write_robot_starter(tmp_path / "m.xml", tmp_path / "robot.yaml")
    robot = build_model(load_robot(tmp_path / "robot.yaml"))
    assert "t" not in robot.channels
    assert robot.channels["t_"].unit.symbol == "m"


def test_all_that_is_wrong_is_said_at_once(tmp_path):
    sections = {
        "channels": {"a": {"unit": "m", "is": "joint(slid)"}},
        "servos": [
            {"joints": ["pole"], "stiffness": "1 N*m/rad", "damping": "0 N*m*s/rad", "torque": "1 N*m"}
        ],
    }
    said = complaints(robot_file(tmp_path, CART, **sections)).splitlines()
    assert [line.split(": ")[1] for line in said] == ["servos[0].joints", "channels.a.is"]


# --- files that are started for an MJCF ---------------------------------------------------------------------

ARM = """
<mujoco>
  <worldbody>
    <body name="forearm"><joint name="elbow" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
      <site name="in" pos=".1 0 .03"/></body>
    <site name="out" pos="-.2 0 .05"/>
  </worldbody>
  <tendon><spatial name="cord"><site site="in"/><site site="out"/></spatial></tendon>
  <actuator><muscle name="flexor" tendon="cord" lengthrange=".2 .4"/></actuator>
  <sensor><tendonpos name="stretch" tendon="cord"/><actuatorfrc name="pull" actuator="flexor"/></sensor>
</mujoco>
"""
NAMELESS = """
<mujoco>
  <worldbody>
    <body><freejoint/><geom size=".1"/><body pos=".2 0 0"><joint/><geom size=".1"/></body></body>
    <body pos="1 0 0"><joint type="ball"/><geom size=".1"/></body>
  </worldbody>
  <sensor><clock/><e_kinetic/></sensor>
</mujoco>
"""
NOTHING = '<mujoco><worldbody><body name="stone"><geom size=".1"/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    "mjcf", [CART, ARM, NAMELESS, NOTHING], ids=["cart", "muscle", "nameless", "nothing"]
)
def test_a_started_file_loads_and_reads_what_mujoco_says(tmp_path, mjcf):
    """Each channel of a joint or sensor is the number that MuJoCo has for it."""
    (tmp_path / "model.xml").write_text(mjcf, encoding="utf-8")
    model = build_model(load_robot(write_robot_starter(tmp_path / "model.xml", tmp_path / "robot.yaml")))
    data = mujoco.MjData(model.model)
    data.qvel[:] = 0.1
    mujoco.mj_forward(model.model, data)
    read = Observer(model.channels, tuple(model.channels))(data.sensordata)
    assert np.isfinite(read).all()
    seen = dict(zip(model.channels, read, strict=True))
    for joint in ("elbow", "hinge", "slide"):
        if joint in seen:
            assert seen[f"{joint}_rate"] == pytest.approx(0.1)
    assert len(model.commands) == model.model.nu


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(names=st.lists(st.text(st.characters(categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=12),
                      min_size=3, max_size=3, unique=True))  # fmt: skip
def test_any_names_can_be_started_from(tmp_path, names):
    """Of body, joint and actuator: letters of all languages, signs, quotes and spaces."""
    body, joint, motor = (quoteattr(name) for name in names)
    mjcf = f"""<mujoco><worldbody><body name={body}><joint name={joint}/><geom size=".1"/></body></worldbody>
      <actuator><motor name={motor} joint={joint}/></actuator></mujoco>"""
    (tmp_path / "model.xml").write_text(mjcf, encoding="utf-8")
    model = build_model(
        load_robot(write_robot_starter(tmp_path / "model.xml", tmp_path / "robot.yaml", force=True))
    )
    assert len(model.commands) == 1
    if not {"'", '"'} <= set(names[1]):  # which no expression can name
        assert len(model.channels) >= 2


def test_a_name_with_both_kinds_of_quotes_is_left_to_the_reader(tmp_path):
    body = """<body><joint name="it's &quot;it&quot;"/><geom size=".1"/></body>"""
    mjcf = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    (tmp_path / "model.xml").write_text(mjcf, encoding="utf-8")
    path = write_robot_starter(tmp_path / "model.xml", tmp_path / "robot.yaml")
    assert not any(name.startswith("it_s") for name in build_model(load_robot(path)).channels)
    assert "  # it_s_it: {unit: rad, is: " in path.read_text(encoding="utf-8")


def test_a_file_that_is_there_is_not_written_over(tmp_path):
    (tmp_path / "model.xml").write_text(CART, encoding="utf-8")
    path = write_robot_starter(tmp_path / "model.xml", tmp_path / "robot.yaml")
    with pytest.raises(InputError, match="is there already; allowed: another name, or --force"):
        write_robot_starter(tmp_path / "model.xml", path)
    with pytest.raises(InputError, match="no such file; allowed: the path of an MJCF file"):
        write_robot_starter(tmp_path / "other.xml", path, force=True)


def test_without_channels_and_commands_a_robot_is_one_too(tmp_path):
    model = small_model(tmp_path, CART)
    assert model.channels == {}
    assert model.commands == {}
