"""MJCFs that were written without circuitkit in mind: nothing is changed, and everything can be named."""

from __future__ import annotations

import logging

import mujoco
import numpy as np
import pytest
from small_robots import Told, run

from circuitkit.base.errors import InputError
from circuitkit.robots import Worlds, build_model, load_robot
from circuitkit.robots.mobile_base import MobileBase
from circuitkit.robots.starter import write_robot_starter
from circuitkit.simulation import simulate

# Names with spaces, slashes and letters beyond ASCII, words of YAML and Python, no names at all; every kind
# of sensor and actuator; several free bodies, of which a loose one is the heaviest; mocap; height field;
# camera.
ODD = """
<mujoco model="a/b c">
  <option timestep="0.003" integrator="implicitfast"/>
  <default>
    <general ctrllimited="true" ctrlrange="-1 1"/><joint armature=".1"/><geom contype="1"/>
    <site type="capsule" fromto="0 0 0 0 0 .1" size=".01"/>
  </default>
  <asset><hfield name="hf" nrow="3" ncol="3" size="5 5 .1 .1" elevation="0 0 0 0 1 0 0 0 0"/></asset>
  <worldbody>
    <geom type="hfield" hfield="hf"/>
    <body mocap="true" name="moc"><geom size=".02" contype="0" conaffinity="0"/></body>
    <body pos="0 0 1"><freejoint/><geom size=".1"/>
      <body name="arm/1 left" pos=".2 0 0">
        <joint name="no" range="-1 1" limited="true"/><geom size=".05" pos=".1 0 0"/><site name="s it"/>
        <body pos=".2 0 0"><joint type="ball" name="ball"/><geom size=".05" pos=".1 0 0"/></body>
      </body>
      <body name="é" pos="-.2 0 0"><joint type="slide" name="lambda" ref=".1"/>
        <geom size=".05"/><site name="t1"/></body>
    </body>
    <body pos="1 0 1"><freejoint/><geom size=".3"/></body>
    <body pos="2 0 1"><freejoint name="y"/><geom size=".1" name="obj"/></body>
    <camera name="cam" pos="0 -2 1" resolution="4 3"/>
  </worldbody>
  <tendon>
    <spatial name="ten don"><site site="s it"/><site site="t1"/></spatial>
    <fixed><joint joint="lambda" coef="1"/></fixed>
  </tendon>
  <actuator>
    <motor joint="no"/><motor joint="no"/><position joint="lambda" kp="5"/>
    <velocity joint="lambda" name="on"/>
    <intvelocity joint="no" actrange="-1 1" actlimited="true" name="iv"/><damper joint="no" ctrlrange="0 1"/>
    <cylinder joint="lambda"/><muscle tendon="ten don" name="mu scle" lengthrange=".2 1.2"/>
    <adhesion body="é" ctrlrange="0 1"/><general tendon="ten don"/>
    <motor joint="ball" gear="1 0 0" name="bb"/>
    <motor site="t1" gear="0 0 1 0 0 0"/>
  </actuator>
  <sensor>
    <touch site="s it"/><gyro site="t1" name="gy ro"/><magnetometer site="t1" name="mag"/>
    <force site="t1" name="f"/><torque site="t1" name="tq"/><rangefinder site="t1" name="rf"/>
    <rangefinder camera="cam" name="rfc"/><camprojection site="t1" camera="cam" name="cp"/>
    <jointpos joint="no" name="jp"/><jointlimitfrc joint="no" name="jl"/>
    <tendonpos tendon="ten don" name="tp"/>
    <tendonactuatorfrc tendon="ten don" name="taf"/><actuatorfrc actuator="iv" name="af"/>
    <ballquat joint="ball" name="bq"/><ballangvel joint="ball" name="bv"/>
    <framequat objtype="site" objname="t1" name="fq"/><framelinacc objtype="body" objname="é" name="fa"/>
    <subtreeangmom body="é" name="sa"/><insidesite site="t1" objtype="body" objname="é" name="is"/>
    <distance geom1="obj" body2="é" cutoff="5" name="di"/>
    <fromto geom1="obj" body2="é" cutoff="5" name="ft"/>
    <normal geom1="obj" body2="é" cutoff="5" name="no"/><e_potential name="ep"/><e_kinetic name="ek"/>
    <clock name="cl"/><user dim="3" name="us"/><contact subtree1="é" name="con" data="found force" num="2"/>
    <jointactuatorfrc joint="no" name="jaf"/><accelerometer site="t1"/><accelerometer site="t1"/>
  </sensor>
  <keyframe><key/></keyframe>
</mujoco>
"""

SCENARIO = "scenario: any\nrobot: robot.yaml\ncontrol_step: 15 ms\nduration: 0.3 s\n"


def started(folder, mjcf, scenario=SCENARIO):
    """A robot file as `circuitkit init --robot` writes it for an MJCF, and a scenario beside it."""
    (folder / "model.xml").write_text(mjcf, encoding="utf-8")
    (folder / "scenario.yaml").write_text(scenario, encoding="utf-8")
    return write_robot_starter(folder / "model.xml", folder / "robot.yaml", force=True)


def built(folder, mjcf, robot):
    (folder / "model.xml").write_text(mjcf, encoding="utf-8")
    (folder / "robot.yaml").write_text(f"robot: any\nmjcf: model.xml\n{robot}", encoding="utf-8")
    return build_model(load_robot(folder / "robot.yaml"))


def complaint(folder, mjcf, robot):
    with pytest.raises(InputError) as caught:
        built(folder, mjcf, robot)
    return str(caught.value).replace(str(folder) + "/", "")


# --- as it is -----------------------------------------------------------------------------------------------


def test_a_started_file_of_anything_is_valid_runs_and_names_every_part(tmp_path):
    text = started(tmp_path, ODD).read_text(encoding="utf-8")
    result = simulate(tmp_path / "scenario.yaml", output=tmp_path / "out")
    model = result.recording.robot.model
    assert result.survived
    assert result.recording.ticks == 20
    for i in range(model.nsensor):
        assert (
            f"sensor({model.sensor(i).name}" in text.replace('"', "") or "circuitkit" in model.sensor(i).name
        )
    for i in range(model.nu):
        name = model.actuator(i).name
        assert f"to: {{{name}: 1}}" in text.replace("'", "")
    assert (
        "  lambda_: {unit: m, is: 'joint(\"lambda\")'}" in text
    )  # a word of the expressions is no name in them
    assert "#   lambda: 100 mm" in text  # where it starts
    assert "  lambda__command: {unit: m, to: {lambda: 1}, limits: [-1 m, 1 m]}" in text


def test_the_robot_is_what_carries_most_parts_not_the_heaviest_object(tmp_path):
    robot = build_model(load_robot(started(tmp_path, ODD)))
    assert robot.base == 0
    assert robot.mass_kg < robot.model.body_mass.max()


@pytest.mark.parametrize("compiler", ["", '<compiler inertiafromgeom="true"/>'])
def test_motion_is_that_of_the_mjcf_to_the_last_bit(tmp_path, compiler):
    """With names, with sensors for channels, and without geoms that are only seen."""
    mjcf = ODD.replace("<option", f"{compiler}<option", 1)
    robot = build_model(load_robot(started(tmp_path, mjcf)))
    plain = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(plain)
    worlds = Worlds(robot, 0.015, robot.held[np.newaxis], robot.start_qpos)
    worlds.begin()
    for _ in range(10):
        worlds.advance(0, np.zeros((1, 0)))
    mujoco.mj_step(plain, data, nstep=50)
    np.testing.assert_array_equal(worlds.qpos[0], data.qpos)


def test_geoms_without_a_mass_of_their_own_do_not_stop_a_body_from_having_one(tmp_path):
    """Where inertia comes from geoms alone, those only seen count, and MuJoCo refuses to drop them."""
    mjcf = """<mujoco><compiler inertiafromgeom="true"/><worldbody><body name="b"><joint name="j"/>
      <geom size=".1" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
    robot = built(tmp_path, mjcf, "")
    assert robot.model.body("b").mass == pytest.approx(1000 * 4 / 3 * np.pi * 0.1**3)


def test_a_body_that_sleeps_may(tmp_path):
    mjcf = ODD.replace("<default>", '<option><flag sleep="enable"/></option><default>', 1)
    started(tmp_path, mjcf)
    assert simulate(tmp_path / "scenario.yaml").survived


# --- names --------------------------------------------------------------------------------------------------


NAMELESS = """
<mujoco><worldbody>
  <body><joint type="slide"/><geom size=".1"/><site/>
    <body><joint name="elbow"/><geom size=".1" pos=".1 0 0"/></body></body>
</worldbody>
<actuator><motor joint="elbow"/><motor joint="elbow"/></actuator>
<sensor><jointpos joint="elbow"/></sensor></mujoco>
"""


def test_parts_without_a_name_get_one(tmp_path):
    robot = built(tmp_path, NAMELESS, "")
    assert {kind: robot.names(kind) for kind in ("body", "joint", "actuator", "site")} == {
        "body": ["body_1", "body_2"],
        "joint": ["joint_0", "elbow"],
        "actuator": ["elbow", "elbow_"],
        "site": ["site_0"],
    }
    channels = "channels:\n  a: {unit: m, is: joint(joint_0)}\n  b: {unit: rad, is: sensor(sensor_0)}\n"
    commands = "commands:\n  push: {unit: 1, to: {elbow: 1, elbow_: -1}}\n"
    np.testing.assert_array_equal(
        built(tmp_path, NAMELESS, channels + commands).commands["push"].factors, [1, -1]
    )


def test_a_component_is_one_that_the_sensor_has(tmp_path):
    """The next sensor's numbers are no components of this one."""
    mjcf = NAMELESS.replace("<sensor>", '<sensor><user name="u" dim="2"/>')
    said = complaint(tmp_path, mjcf, 'channels: {a: {unit: 1, is: "sensor(u, 2)"}}\n')
    assert said.endswith("found the component '2' of the sensor 'u'; allowed: a number from 0 to 1")
    said = complaint(tmp_path, mjcf, "channels: {a: {unit: 1, is: sensor(u)}}\n")
    assert said.endswith("the sensor 'u' has 2 numbers; allowed: one of them, such as sensor(u, 0)")


# --- servos -------------------------------------------------------------------------------------------------

SERVO = "servos: [{joints: [elbow], stiffness: 20 N*m/rad, damping: 0.5 N*m*s/rad, torque: 5 N*m}]\n"


def test_defaults_of_the_mjcf_do_not_touch_servos_of_the_robot_file(tmp_path):
    defaults = """<mujoco><default><general gear="100" ctrllimited="true" ctrlrange="-.1 .1" forcerange="-9 9"
      dyntype="integrator" actlimited="true" actrange="-1 1" armature=".3"/></default>"""
    plain = built(tmp_path, NAMELESS, SERVO).model
    odd = built(tmp_path, NAMELESS.replace("<mujoco>", defaults, 1), SERVO).model
    assert plain.nu == 1
    for name in dir(plain):
        if name.startswith("actuator_") and name != "actuator_user":
            np.testing.assert_array_equal(getattr(odd, name), getattr(plain, name), err_msg=name)


def test_a_sensor_of_a_replaced_actuator_reads_the_servo(tmp_path):
    mjcf = NAMELESS.replace('<motor joint="elbow"/>', '<motor name="m" joint="elbow"/>', 1)
    mjcf = mjcf.replace("<sensor>", '<sensor><actuatorfrc name="torque" actuator="m"/>')
    channels = (
        "channels: {torque: {unit: N*m, is: sensor(torque)}, force: {unit: N*m, is: actuator_force(elbow)}}\n"
    )
    robot = built(tmp_path, mjcf, SERVO + channels)
    data = mujoco.MjData(robot.model)
    data.ctrl[:] = 0.1
    mujoco.mj_forward(robot.model, data)
    assert data.sensor("torque").data[0] == pytest.approx(2.0)


def test_a_keyframe_keeps_the_controls_of_actuators_that_stay(tmp_path):
    mjcf = NAMELESS.replace('<motor joint="elbow"/>', '<muscle joint="elbow" lengthrange="0 1"/>', 1)
    mjcf = mjcf.replace("</actuator>", '<intvelocity name="drive" joint="slide" actrange="-1 1"/></actuator>')
    mjcf = mjcf.replace('<joint type="slide"/>', '<joint type="slide" name="slide"/>')
    key = '<keyframe><key name="home" qpos=".1 .2" ctrl=".3 .4 .5" act=".6 .7"/></keyframe></mujoco>'
    robot = built(tmp_path, mjcf.replace("</mujoco>", key), SERVO + "key: home\n")
    assert robot.names("actuator") == ["drive", "elbow"]
    np.testing.assert_allclose(robot.held, [0.5, 0.2])
    np.testing.assert_allclose(robot.start.act, [0.7])


# --- time, and what MuJoCo says -----------------------------------------------------------------------------


def test_a_time_step_that_does_not_divide_is_answered_with_one_that_does(tmp_path):
    started(tmp_path, ODD, SCENARIO.replace("15 ms", "20 ms"))
    with pytest.raises(InputError) as caught:
        simulate(tmp_path / "scenario.yaml")
    assert str(caught.value).endswith(
        "scenario.yaml:3:15: control_step: found a control step of 20 ms; allowed: a multiple of the model's "
        "time "
        "step of 3 ms, such as 18 ms or 21 ms; or set timestep: 2.5 ms in the robot file"
    )


def test_warnings_of_mujoco_come_once_as_lines_that_name_the_file(tmp_path, caplog):
    mjcf = NAMELESS.replace("<mujoco>", '<mujoco><compiler settotalmass="3"/>')
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            built(tmp_path, mjcf, "")
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith(
        f"{tmp_path / 'model.xml'}: MuJoCo says: compiler attribute 'settotalmass' is deprecated"
    )


def test_an_unstable_simulation_is_said_and_ends_the_run(tmp_path, monkeypatch):
    """An integrator of 100 ms cannot hold a spring of 1e6 N/m on 4 kg."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log into the working directory
    mjcf = NAMELESS.replace("<mujoco>", '<mujoco><option timestep="0.1" integrator="Euler"/>')
    mjcf = mjcf.replace('<joint type="slide"/>', '<joint type="slide" stiffness="1e6" springref="1"/>')
    started(
        tmp_path,
        mjcf,
        SCENARIO.replace("15 ms", "100 ms").replace("0.3 s", "20 s") + "measures: {t: max(t)}\n",
    )
    result = simulate(tmp_path / "scenario.yaml")
    ended = result.recording.ended_s()
    assert not result.survived
    assert result.outcome == f"invalid at {ended:.2f} s"
    (note,) = result.notes
    assert note == (
        f"invalid {result.invalid}; what is recorded ends there; "
        "a smaller timestep, less stiff servos or more damping may help"
    )
    assert result.invalid.startswith(f"at {ended:.3f} s: the ")
    assert "of joint 'joint_" in result.invalid
    assert result.measures == {"survived": None, "t": None}
    assert list(tmp_path.glob("MUJOCO_LOG*")) == []


def test_a_channel_of_a_joints_name_is_recorded_as_what_it_is(tmp_path):
    started(tmp_path, NAMELESS, SCENARIO.replace("15 ms", "2 ms"))
    robot = "robot: any\nmjcf: model.xml\nchannels: {elbow: {unit: rad, is: joint(elbow) + 1 rad}}\n"
    (tmp_path / "robot.yaml").write_text(robot, encoding="utf-8")
    columns = simulate(tmp_path / "scenario.yaml").recording.columns()
    np.testing.assert_allclose(columns["elbow_rad"][0], 1.0, atol=0.01)


# --- soft things, cables, closed loops ----------------------------------------------------------------------

ARM = """
    <body name="arm" pos="0 0 2"><joint name="j" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".2"/></body>
"""
SOFT = f"""
<mujoco>
  <option timestep="0.001" solver="CG"/>
  <worldbody>{ARM}
    <flexcomp name="cube" type="grid" count="3 3 3" spacing=".05 .05 .05" dim="3" radius=".005" mass=".5">
      <contact selfcollide="none"/><elasticity young="1e4" poisson="0.1" damping="0.01"/>
    </flexcomp>
  </worldbody>
  <actuator><motor name="m" joint="j"/></actuator>
</mujoco>
"""
ROPE = """
<mujoco>
  <option timestep="0.001" integrator="discrete"/>
  <worldbody>
    <body name="cart"><joint name="slide" type="slide" axis="1 0 0"/><geom size=".03" mass="1"/>
      <flexcomp name="rope" type="grid" count="10 1 1" spacing=".05 .05 .05" dim="1" radius=".005" mass=".1">
        <elasticity young="1e6" damping="0.01"/><pin id="0"/></flexcomp></body>
  </worldbody>
  <actuator><motor name="m" joint="slide"/></actuator>
</mujoco>
"""
CABLE = """
<mujoco>
  <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
  <worldbody><geom size=".1"/></worldbody>
</mujoco>
"""
COMPOSITE = """
<mujoco>
  <worldbody>
    <composite type="cable" curve="s" count="9 1 1" size=".5"><geom size=".005"/></composite>
  </worldbody>
</mujoco>
"""
# A crank of 0.1 m turns, and a rod of 0.3 m moves a slider: the loop is closed by an equality.
CRANK = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="crank"><joint name="crank" axis="0 1 0" damping=".05"/>
      <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01"/>
      <body name="rod" pos=".1 0 0"><joint name="rod" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".01"/></body></body>
    <body name="slider" pos=".4 0 0"><joint name="slide" type="slide" axis="1 0 0"/>
      <geom type="box" size=".03 .03 .03"/></body>
  </worldbody>
  <equality><connect body1="rod" body2="slider" anchor=".3 0 0"/></equality>
  <actuator><velocity name="turn" joint="crank" kv="2"/></actuator>
</mujoco>
"""


def begun(folder, mjcf):
    """A robot by the file that `init --robot` writes for an MJCF."""
    (folder / "model.xml").write_text(mjcf, encoding="utf-8")
    return load_robot(write_robot_starter(folder / "model.xml", folder / "robot.yaml"))


def test_a_soft_body_falls_and_its_vertices_are_comments(tmp_path):
    robot = begun(tmp_path, SOFT)
    text = (tmp_path / "robot.yaml").read_text(encoding="utf-8")
    assert list(robot.channels) == ["j", "j_rate"] + [
        f"arm_{x}" for x in ("x", "y", "z", "vx", "upright", "yaw")
    ]
    assert text.count("is: joint(") == 1 + 3 * 27
    recording = run(robot, Told(m=0.0), duration_s=0.4)
    heights = [place for name, (place, _) in recording.joints.items() if name != "j"][2::3]
    fallen = recording.qpos[-1, 0, heights].mean()
    assert fallen == pytest.approx(-9.81 / 2 * 0.4**2, rel=0.01)
    assert MobileBase(recording.robot).places == {}


def test_a_rope_hangs_from_a_cart_that_moves(tmp_path):
    """Cart and rope weigh 1.1 kg: a constant force moves their common centre of mass."""
    robot = begun(tmp_path, ROPE)
    assert "slide" in robot.channels
    recording = run(robot, Told(m=1.1), duration_s=0.5)
    assert recording.invalid == (None,)
    data = mujoco.MjData(recording.robot.model)
    data.qpos[:] = recording.qpos[-1, 0]
    mujoco.mj_kinematics(recording.robot.model, data)
    mujoco.mj_comPos(recording.robot.model, data)
    start = mujoco.MjData(recording.robot.model)
    mujoco.mj_kinematics(recording.robot.model, start)
    mujoco.mj_comPos(recording.robot.model, start)
    moved = data.subtree_com[0, 0] - start.subtree_com[0, 0]
    assert moved == pytest.approx(1.0 / 2 * 0.5**2, rel=0.02)


@pytest.mark.parametrize("mjcf", [CABLE, COMPOSITE])
def test_what_mujoco_no_longer_has_is_named(tmp_path, mjcf):
    with pytest.raises(InputError) as caught:
        begun(tmp_path, mjcf)
    (problem,) = caught.value.problems
    assert problem.message.startswith(f"MuJoCo {mujoco.__version__} cannot read it: XML Error: ")
    assert "'composite'" in problem.message or "mujoco.elasticity.cable" in problem.message
    assert problem.hint == "MuJoCo 4 has neither; a flexcomp with <elasticity> takes their place"


def test_a_loop_that_an_equality_closes_stays_closed(tmp_path):
    recording = run(begun(tmp_path, CRANK), Told(turn=4.0), duration_s=1.0)
    angle, place = recording.channel("crank")[:, 0], recording.channel("slide")[:, 0]
    assert angle[-1] > np.pi
    closed = 0.1 * np.cos(angle) + np.sqrt(0.3**2 - (0.1 * np.sin(angle)) ** 2) - 0.4
    np.testing.assert_allclose(place, closed, atol=2e-3)
