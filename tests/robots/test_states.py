"""How robots start: keyframes, what is held by which actuator, bases on rails; and what an MJCF disables."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from small_robots import Told, robot_file, run, small_model, small_robot

from circuitkit.base.errors import InputError
from circuitkit.robots import build_model, load_robot
from circuitkit.robots.mobile_base import MobileBase
from circuitkit.robots.starter import write_robot_starter
from circuitkit.simulation.disturbances.actuator import Actuator
from circuitkit.simulation.disturbances.jitter import Jitter
from circuitkit.simulation.references.hold import Hold
from circuitkit.simulation.references.key import Key


def complaint(tmp_path, mjcf, **sections):
    with pytest.raises(InputError) as caught:
        build_model(load_robot(robot_file(tmp_path, mjcf, **sections)))
    return str(caught.value).replace(str(tmp_path) + "/", "")


# --- keyframes ----------------------------------------------------------------------------------------------

KEYED = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="mark" mocap="true" pos="0 0 3"><geom size=".1" contype="0" conaffinity="0"/></body>
    <body name="b"><joint name="s" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/></body>
  </worldbody>
  <actuator><general name="a" joint="s" dyntype="filter" dynprm="0.3"/></actuator>
  <keyframe>
    <key name="rest"/>
    <key name="k" qpos="0.5" qvel="2" act="0.7" ctrl="0.4" mpos="1 1 1" mquat="0 1 0 0"/>
  </keyframe>
</mujoco>
"""
READ = {
    "s": {"unit": "m", "is": "joint(s)"},
    **{axis: {"unit": "m", "is": f"position(mark, {axis})"} for axis in "xyz"},
    "up": {"unit": "1", "is": "up(mark, z)"},
}


@pytest.mark.parametrize("by", ["robot", "reference", "hold"])
def test_a_run_from_a_keyframe_is_mujocos_own(tmp_path, by):
    """Positions, velocities, states of actuators, controls and mocap bodies: to the last bit."""
    robot = small_robot(tmp_path, KEYED, channels=READ, **({} if by == "reference" else {"key": "k"}))
    reference = {"robot": None, "reference": Key("k"), "hold": Hold({})}[by]
    recording = run(robot, reference=reference, seeds=(0, 1), step_s=0.004)
    model = mujoco.MjModel.from_xml_string(KEYED)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 1)
    expected = []
    for _ in range(recording.ticks):
        mujoco.mj_step(model, data, nstep=2)
        expected.append(data.qpos.copy())
    for each in (0, 1):
        np.testing.assert_array_equal(recording.qpos[:, each], expected)
    for axis in "xyz":
        np.testing.assert_array_equal(recording.channel(axis), 1.0)
    np.testing.assert_allclose(recording.channel("up"), -1.0)


# --- what is held -------------------------------------------------------------------------------------------

HELD = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="b"><joint name="h" axis="0 0 1" damping="1"/><geom size=".1" mass="1"/></body>
  </worldbody>
  <actuator>%s</actuator>
</mujoco>
"""
HOLDERS = [
    '<position name="a" joint="h" kp="100" gear="-2"/>',
    '<position name="a" jointinparent="h" kp="100"/>',
    '<position name="a" joint="h" kp="100" kv="5" timeconst="0.2"/>',
    '<general name="a" joint="h" gainprm="50" biastype="affine" biasprm="3 -50 -1" '
    'dyntype="filter" dynprm="1"/>',
    '<intvelocity name="a" joint="h" kp="100" actrange="-10 10" gear="3"/>',
    '<pid name="a" joint="h" kp="100" ki="3"/>',
    '<pid name="a" joint="h" kp="100" ki="3" slewmax="0.1" input="pos"/>',
]


@pytest.mark.parametrize("actuator", HOLDERS)
@pytest.mark.parametrize("by", ["robot", "reference"])
def test_a_held_joint_stays_where_it_is_from_the_first_moment_on(tmp_path, actuator, by):
    mjcf = HELD % actuator
    hold = {"h": "30 deg"}
    robot = small_robot(
        tmp_path,
        mjcf,
        channels={"h": {"unit": "deg", "is": "joint(h)"}},
        **({"hold": hold} if by == "robot" else {}),
    )
    recording = run(robot, reference=Hold(hold) if by == "reference" else None, duration_s=3.0)
    np.testing.assert_allclose(recording.channel("h"), np.radians(30), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("actuator", "said"),
    [
        (
            '<position name="a" joint="h" kp="100" ctrlrange="-.5 .5"/>',
            "its actuator 'a' would have to be told 0.523599, and its ctrlrange is -0.5 to 0.5; allowed: "
            "what lies within; or give the joint a servo by servos",
        ),
        (
            '<intvelocity name="a" joint="h" kp="100" actrange="-.5 .5"/>',
            "its actuator 'a' would have to be told 0.523599, and its actrange is -0.5 to 0.5; allowed: what "
            "lies within; or give the joint a servo by servos",
        ),
        (
            '<position name="a" joint="h" kp="100" delay="0.01" nsample="6"/>',
            "its actuator 'a' gets its controls late and would let go at first; allowed: an actuator "
            "without delay; or give the joint a servo by servos",
        ),
    ],
)
def test_what_an_actuator_cannot_hold_is_refused(tmp_path, actuator, said):
    found = complaint(tmp_path, HELD % actuator, hold={"h": "30 deg"})
    assert found == f"robot.yaml:4:6: hold.h: {said}"


# --- actuators with more than one control, or with more than one force --------------------------------------

MANY = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="ball"><joint name="ball" type="ball"/><geom size=".1" mass="1"/></body>
    <body name="b" pos="1 0 0"><joint name="h" axis="0 0 1"/><geom size=".1" mass="1"/></body>
    <body name="c" pos="2 0 0"><joint name="g" axis="0 0 1" damping="1"/><geom size=".1" mass="1"/></body>
  </worldbody>
  <actuator>
    <orientation name="turn" joint="ball" kp="10"/>
    <pid name="both" joint="h" kp="10"/>
    <position name="last" joint="g" kp="10" gear="2" ctrlrange="-3 3"/>
  </actuator>
</mujoco>
"""


def test_actuators_are_counted_as_actuators_and_not_as_controls(tmp_path):
    """The third actuator has the sixth control and the fifth force: 10 (2 * 0.3 - length) times its gear."""
    commands = {"c": {"unit": "rad", "to": {"last": 1}}}
    channels = {"f": {"unit": "N*m", "is": "force(g)"}}
    robot = small_robot(tmp_path, MANY, commands=commands, channels=channels, hold={"g": "0.3 rad"})
    model = build_model(robot)
    assert model.names("actuator") == ["turn", "both", "last"]
    np.testing.assert_array_equal(model.held, [0, 0, 0, 0, 0, 0.6])
    recording = run(robot, Told(c=0.1), step_s=0.002, duration_s=0.004)
    assert recording.channel("f")[0, 0] == pytest.approx(2 * 10 * 0.1)
    assert not run(robot, Told(c=0.1), [Actuator(actuator="last", strength=0.0)]).channel("f").any()


@pytest.mark.parametrize(("name", "count"), [("turn", 3), ("both", 2)])
def test_a_command_writes_one_control(tmp_path, name, count):
    said = complaint(tmp_path, MANY, commands={"c": {"unit": "1", "to": {name: 1}}})
    place = f"robot.yaml:7:13: commands.c.to.{name}: "
    assert said == (
        f"{place}the actuator '{name}' has {count} controls; allowed: one that has one; a pid has one with "
        'input="pos"'
    )


def test_a_started_file_leaves_out_what_no_command_can_write(tmp_path):
    (tmp_path / "model.xml").write_text(MANY, encoding="utf-8")
    path = write_robot_starter(tmp_path / "model.xml", tmp_path / "robot.yaml", force=True)
    text = path.read_text(encoding="utf-8")
    assert "limits: [-3 rad, 3 rad]" in text
    assert "  # both: {" in text
    assert list(build_model(load_robot(path)).commands) == ["last"]


# --- what an MJCF disables ----------------------------------------------------------------------------------

POLE = """
<mujoco>
  <option timestep="0.002"%s>%s</option>
  <worldbody>
    <body name="b"><joint name="h" axis="0 1 0"/><geom size=".1" mass="1" pos="0 0 -1"/></body>
  </worldbody>
  <actuator><motor name="m" joint="h" group="2"/></actuator>
</mujoco>
"""
READS = {"lean": {"unit": "rad", "is": "joint(h)"}}
WRITES = {"c": {"unit": "N*m", "to": {"m": 1}}}
SERVOS = [{"joints": ["h"], "stiffness": "9 N*m/rad", "damping": "1 N*m*s/rad", "torque": "9 N*m"}]


@pytest.mark.parametrize(
    ("attributes", "flag", "sections", "said"),
    [
        (
            "", '<flag sensor="disable"/>', {"channels": READS},
            "robot.yaml:2:7: mjcf: the MJCF disables sensors, so that every channel would be 0; allowed: an "
            'MJCF without <flag sensor="disable"/>',
        ),
        (
            ' actuatorgroupdisable="0 5"', "", {"servos": SERVOS},
            "robot.yaml:2:7: mjcf: the MJCF disables the servo of the joint 'h'; allowed: an MJCF without "
            'actuation="disable", and without group 0 in actuatorgroupdisable',
        ),
        (
            "", '<flag actuation="disable"/>', {"servos": SERVOS},
            "robot.yaml:2:7: mjcf: the MJCF disables the servo of the joint 'h'; allowed: an MJCF without "
            'actuation="disable", and without group 0 in actuatorgroupdisable',
        ),
        (
            ' actuatorgroupdisable="2"', "", {"commands": WRITES},
            "robot.yaml:7:10: commands.c.to.m: the MJCF disables the actuator 'm'; allowed: one that acts; "
            'take actuation="disable" or actuatorgroupdisable out of the MJCF\'s option',
        ),
    ],
)  # fmt: skip
def test_what_is_disabled_and_needed_is_refused(tmp_path, attributes, flag, sections, said):
    assert complaint(tmp_path, POLE % (attributes, flag), **sections) == said


def test_what_is_disabled_and_not_needed_may_be(tmp_path):
    small_model(tmp_path, POLE % (' actuatorgroupdisable="3"', '<flag sensor="disable"/>'), commands=WRITES)


# --- bases on rails -----------------------------------------------------------------------------------------

GANTRY = """
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="a" euler="0 0 90">%s<geom size=".1" mass="1"/>
      <body name="b">%s<geom size=".1" mass="1"/></body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    ("outer", "inner"),
    [
        ('<joint type="slide" axis="1 0 0"/>', '<joint type="slide" axis="0 1 0"/>'),
        ('<joint type="slide" axis="0 -1 0"/>', '<joint type="slide" axis="-1 0 0"/>'),
        ('<joint type="slide" axis="0 1 0"/><joint type="slide" axis="1 0 0"/>', ""),
    ],
)
def test_a_base_is_moved_along_the_worlds_axes_whatever_its_own_are(tmp_path, outer, inner):
    channels = {axis: {"unit": "m", "is": f"position(b, {axis})"} for axis in "xy"}
    channels |= {f"v{axis}": {"unit": "m/s", "is": f"velocity(b, {axis})"} for axis in "xy"}
    robot = small_robot(tmp_path, GANTRY % (outer, inner), channels=channels)
    start = run(robot, disturbances=[Jitter(position=(1.0, 0.25))], seeds=range(40), duration_s=0.02)
    x, y = (start.channel(axis)[0] for axis in "xy")
    assert 0.5 < np.abs(x).max() <= 1.0
    assert 0.1 < np.abs(y).max() <= 0.25
    level = GANTRY.replace("0 0 90", "0 0 0") % (
        '<joint type="slide" axis="1 0 0"/>', '<joint type="slide" axis="0 1 0"/>',
    )  # fmt: skip
    plain = small_robot(tmp_path / "plain", level, channels=channels)
    for jitter in (Jitter(position=(1.0, 0.0)), Jitter(velocity=0.5)):
        one, other = (run(each, disturbances=[jitter], seeds=(3,), duration_s=0.2) for each in (robot, plain))
        for name in channels:
            np.testing.assert_allclose(one.channel(name), other.channel(name), atol=1e-12)


def test_a_base_is_that_of_what_has_most_parts_and_not_the_first_or_last(tmp_path):
    loose = '<body name="%s" pos="3 0 0"><joint type="slide" axis="1 0 0"/><geom size=".1"/></body>'
    mjcf = (GANTRY % ('<joint name="x" type="slide" axis="0 1 0"/>', '<joint axis="1 0 0"/>')).replace(
        "<worldbody>", "<worldbody>" + loose % "one"
    ).replace("</worldbody>", loose % "two" + "</worldbody>")  # fmt: skip
    base = MobileBase(small_model(tmp_path, mjcf))
    assert base.places == {0: 1}
    assert base.signs[0] == -1.0
