"""Channels: each reference against MuJoCo's own data, or geometry; and what is said of a wrong one."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from small_robots import CART, robot_file, small_model

from circuitkit.base.errors import InputError
from circuitkit.robots import Observer, build_model, load_robot

# Names with spaces, a sliding and a turning joint, a limb, a muscle on a tendon, and a block beside.
BEAST = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <geom name="the floor" type="plane" size="5 5 .1"/>
    <body name="main body" pos="0.1 -0.2 0.9">
      <freejoint name="root"/>
      <geom name="hull" type="box" size=".2 .15 .1" mass="3"/>
      <site name="nose tip" pos=".2 0 .05" euler="10 20 30"/>
      <body name="left-arm" pos="0 .2 0">
        <joint name="el bow" type="hinge" axis="1 0 0"/>
        <geom type="capsule" fromto="0 0 0 0 .3 0" size=".03" mass=".5"/>
        <site name="hand" pos="0 .3 0"/>
        <body name="finger" pos="0 .3 0">
          <joint name="push" type="slide" axis="0 1 0"/>
          <geom type="sphere" size=".03" mass=".1"/>
        </body>
      </body>
    </body>
    <body name="block" pos="1 1 .2"><freejoint/><geom name="lump" type="box" size=".2 .2 .2" mass="7"/></body>
  </worldbody>
  <tendon><spatial name="cord"><site site="nose tip"/><site site="hand"/></spatial></tendon>
  <actuator>
    <motor name="turn" joint="el bow"/>
    <position name="poke" joint="push" kp="50"/>
    <muscle name="biceps" tendon="cord" lengthrange=".1 .6"/>
  </actuator>
  <sensor>
    <gyro name="gy ro" site="nose tip"/><jointpos name="jp" joint="push"/>
    <framequat name="q" objtype="site" objname="hand"/>
    <user name="own" dim="2"/><clock name="now"/>
  </sensor>
</mujoco>
"""


@pytest.fixture(scope="module")
def beast(tmp_path_factory):
    """Works out expressions in a random state of motion, beside MuJoCo's data of that state."""
    place = tmp_path_factory.mktemp("beast")

    def compute(units, seed=1, settle=0):
        channels = {f"c{i}": {"unit": unit, "is": text} for i, (text, unit) in enumerate(units.items())}
        model = small_model(place, BEAST, channels=channels)
        data = mujoco.MjData(model.model)
        rng = np.random.default_rng(seed)
        data.qpos[:] = model.start_qpos
        if not settle:
            data.qpos[2] = 1.2
            data.qpos[3:7] = Rotation.random(random_state=seed).as_quat(scalar_first=True)
            data.qpos[7:9] = rng.uniform(-0.4, 0.4, 2)
            data.qvel[:] = rng.normal(size=model.model.nv)
            data.ctrl[:] = rng.uniform(0, 1, 3)
        mujoco.mj_step(model.model, data, nstep=settle)
        mujoco.mj_forward(model.model, data)
        found = Observer(model.channels, tuple(channels))(data.sensordata)
        return dict(zip(units, found, strict=True)), model.model, data

    return compute


def axes(text, unit):
    """An expression with x, y and z in turn."""
    return {text.replace("AXIS", axis): unit for axis in "xyz"}


# --- against MuJoCo's own data ------------------------------------------------------------------------------


def test_joints_hinge_in_radians_and_slide_in_metres(beast):
    found, _, data = beast(
        {'joint("el bow")': "deg", "joint(push)": "mm", 'rate("el bow")': "rad/s", "rate(push)": "m/s"}
    )
    expected = [data.joint(j).qpos[0] for j in ("el bow", "push")]
    expected += [data.joint(j).qvel[0] for j in ("el bow", "push")]
    np.testing.assert_allclose(list(found.values()), expected, atol=1e-15)


def test_sensors_of_one_and_of_several_numbers(beast):
    found, _, data = beast(
        {
            **axes('sensor("gy ro", AXIS)', "rad/s"),
            "sensor(jp)": "m",
            "sensor(q, 3)": "1",
            "sensor(own, 1)": "N",
            "sensor(now)": "s",
        }
    )
    expected = [
        *data.sensor("gy ro").data,
        data.joint("push").qpos[0],
        data.sensor("q").data[3],
        0.0,
        data.time,
    ]
    np.testing.assert_allclose(list(found.values()), expected, atol=1e-15)


@pytest.mark.parametrize("part", ["main body", "left-arm", "finger", "hand", "nose tip", "hull"])
def test_position_and_axes_are_those_of_the_part(beast, part):
    found, _, data = beast(
        {
            **axes(f'position("{part}", AXIS)', "m"),
            **axes(f'ahead("{part}", AXIS)', "1"),
            **axes(f'side("{part}", AXIS)', "1"),
            **axes(f'up("{part}", AXIS)', "1"),
        }
    )
    if part in {"hand", "nose tip"}:
        place, frame = data.site(part).xpos, data.site(part).xmat
    elif part == "hull":
        place, frame = data.geom(part).xpos, data.geom(part).xmat
    else:
        place, frame = data.body(part).xpos, data.body(part).xmat
    np.testing.assert_allclose(list(found.values()), [*place, *frame.reshape(3, 3).T.ravel()], atol=1e-12)


@pytest.mark.parametrize("part", ["main body", "left-arm", "hand"])
def test_velocities_are_those_of_the_parts_point_in_the_world(beast, part):
    found, model, data = beast(
        {**axes(f'velocity("{part}", AXIS)', "m/s"), **axes(f'angular_velocity("{part}", AXIS)', "rad/s")}
    )
    site = part == "hand"
    place = data.site(part).xpos if site else data.body(part).xpos
    body = model.site(part).bodyid[0] if site else model.body(part).id
    moved, turned = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, moved, turned, place, body)
    np.testing.assert_allclose(list(found.values()), [*moved @ data.qvel, *turned @ data.qvel], atol=1e-12)


def test_acceleration_is_the_rate_of_the_velocity(tmp_path):
    """On a robot that is in free flight, and turned by its motor; by differences between two time steps."""
    channels = {f"a{x}": {"unit": "m/s^2", "is": f"acceleration(hand, {x})"} for x in "xyz"}
    channels |= {f"v{x}": {"unit": "m/s", "is": f"velocity(hand, {x})"} for x in "xyz"}
    model = small_model(tmp_path, BEAST, channels=channels, timestep="10 us")
    data = mujoco.MjData(model.model)
    data.qpos[2], data.ctrl[:2] = 3.0, [0.5, 0.1]
    data.qvel[:8] = [0.1, 0.2, 0.3, 0.5, -0.4, 0.3, 1.0, 0.1]
    observe = Observer(model.channels, tuple(channels))
    seen = []
    for _ in range(3):
        mujoco.mj_step(model.model, data)
        mujoco.mj_forward(model.model, data)
        seen.append(observe(data.sensordata))
    rate = (seen[2][3:] - seen[0][3:]) / 2e-5
    np.testing.assert_allclose(seen[1][:3], rate, rtol=1e-3, atol=1e-3)
    assert np.abs(rate).max() > 1


def test_at_rest_nothing_accelerates(beast):
    both = axes('acceleration("main body", AXIS)', "m/s^2") | axes("acceleration(block, AXIS)", "m/s^2")
    found, _, _ = beast(both, settle=4000)
    np.testing.assert_allclose(list(found.values()), 0, atol=0.05)


def test_the_centre_of_mass_is_that_of_all_that_a_body_carries(beast):
    found, model, data = beast(
        {**axes('com("main body", AXIS)', "m"), **axes('com_velocity("main body", AXIS)', "m/s")}
    )
    mine = [model.body(name).id for name in ("main body", "left-arm", "finger")]
    mass = model.body_mass[mine]
    centre = mass @ data.xipos[mine] / mass.sum()
    velocity = np.zeros(3)
    for body in mine:
        moved = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, moved, None, data.xipos[body], body)
        velocity += model.body_mass[body] * (moved @ data.qvel) / mass.sum()
    np.testing.assert_allclose(list(found.values()), [*centre, *velocity], atol=1e-12)


def test_distance_is_between_the_two_points(beast):
    found, _, data = beast({'distance("nose tip", block)': "m"})
    expected = np.linalg.norm(data.site("nose tip").xpos - data.body("block").xpos)
    np.testing.assert_allclose(list(found.values()), expected)


def test_actuators_and_tendons(beast):
    found, _, data = beast(
        {
            "actuator_length(biceps)": "m",
            "actuator_velocity(biceps)": "m/s",
            "actuator_force(biceps)": "N",
            "actuator_force(turn)": "N*m",
            "tendon(cord)": "m",
            "tendon_rate(cord)": "m/s",
            'force("el bow")': "N*m",
            "force(push)": "N",
        }
    )
    biceps, turn, cord = data.actuator("biceps"), data.actuator("turn"), data.tendon("cord")
    expected = [
        biceps.length[0], biceps.velocity[0], biceps.force[0], turn.force[0],
        cord.length[0], cord.velocity[0],
        data.joint("el bow").qfrc_actuator[0], data.joint("push").qfrc_actuator[0],
    ]  # fmt: skip
    np.testing.assert_allclose(list(found.values()), expected, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(yaw=st.floats(-3.1, 3.1), pitch=st.floats(-1.5, 1.5), roll=st.floats(-3.1, 3.1))
def test_roll_pitch_and_yaw_are_the_angles_of_the_turn(spun, yaw, pitch, roll):
    """Yaw about z, then pitch about the new y, then roll about the new x, by scipy's Rotation."""
    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    np.testing.assert_allclose(spun(turn.as_quat(scalar_first=True)), [roll, pitch, yaw], atol=1e-9)


@pytest.fixture(scope="module")
def spun(tmp_path_factory):
    """The three angles of a body that is turned."""
    channels = {name: {"unit": "rad", "is": f'{name}("main body")'} for name in ("roll", "pitch", "yaw")}
    model = small_model(tmp_path_factory.mktemp("spun"), BEAST, channels=channels)
    data = mujoco.MjData(model.model)
    observe = Observer(model.channels, tuple(channels))

    def angles(quaternion):
        data.qpos[3:7] = quaternion
        mujoco.mj_forward(model.model, data)
        return observe(data.sensordata)

    return angles


def test_at_rest_the_contact_force_is_the_weight(beast):
    found, _, _ = beast(
        {
            "contact(block)": "N",
            "contact(block, world)": "N",
            'contact(block, "the floor")': "N",
            'contact(block, "main body")': "N",
            **axes("contact(block, AXIS)", "N"),
            'contact(block, "the floor", z)': "N",
        },
        settle=1500,
    )
    weight = 7 * 9.81
    expected = [weight, weight, weight, 0, 0, 0, weight, weight]
    np.testing.assert_allclose(list(found.values()), expected, atol=0.02 * weight)


def test_what_a_body_carries_touches_for_it(beast):
    """The arm is a part of the main body: all of both lies on the floor."""
    found, _, _ = beast({'contact("main body", z)': "N", 'contact("left-arm", z)': "N"}, settle=4000)
    assert found['contact("main body", z)'] == pytest.approx(3.6 * 9.81, rel=0.02)
    assert 0 <= found['contact("left-arm", z)'] < 3.6 * 9.81


STACK = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="lo" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="3"/></body>
    <body name="hi" pos="0 0 .3"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body>
    <body name="shelf" pos="3 0 .5">
      <geom type="box" size=".3 .3 .05"/>
      <body pos="0 0 .1"><geom type="box" size=".15 .15 .05"/>
        <body name="tray" pos="0 0 .06"><joint type="slide" axis="1 0 0"/>
          <geom name="tray" type="box" size=".1 .1 .01" mass="1" pos="0 0 .01" contype="2"/></body></body>
    </body>
    <body name="top" pos="3.13 0 .73"><freejoint/><geom type="box" size=".02 .02 .08" mass=".5"/></body>
    <body name="lift" mocap="true" pos="6 0 1"><geom type="box" size=".3 .3 .05"/></body>
    <body name="up" pos="6 0 1.15"><freejoint/><geom type="box" size=".1 .1 .1" mass="4"/></body>
  </worldbody>
</mujoco>
"""


def test_the_world_that_touches_is_what_is_fixed_to_it(tmp_path):
    """Boxes at rest: on the floor, on each other, on what stands on a shelf, and on a mocap body."""
    weight = {
        "contact(lo, world, z)": 5, "contact(hi, world, z)": 0, "contact(hi, world)": 0,
        "contact(hi, lo, z)": 2, "contact(lo, hi, z)": -2, "contact(hi, z)": 2, "contact(lo, z)": 3,
        "contact(top, world, z)": 0.5, "contact(top, shelf, z)": 0.5, "contact(up, z)": 4,
        "contact(up, lift, z)": 4, "contact(up, world, z)": 0,
    }  # fmt: skip
    for fused in ("false", "true"):
        mjcf = STACK.replace("<mujoco>", f'<mujoco><compiler fusestatic="{fused}"/>')
        channels = {f"c{i}": {"unit": "N", "is": text} for i, text in enumerate(weight)}
        model = small_model(tmp_path, mjcf, channels=channels)
        data = mujoco.MjData(model.model)
        mujoco.mj_step(model.model, data, nstep=2000)
        found = Observer(model.channels, tuple(channels))(data.sensordata)
        np.testing.assert_allclose(found, np.array(list(weight.values())) * 9.81, atol=0.05)


def test_a_part_is_a_body_before_a_site_and_a_site_before_a_geom(tmp_path):
    """All of one name: the frame of the body stands at 1 m, and the others above it."""
    mjcf = """<mujoco><worldbody><body name="a" pos="0 0 1"><freejoint/>
      <site name="a" pos="0 0 .1"/><site name="b" pos="0 0 .1"/>
      <geom name="a" size=".01" pos="0 0 .2"/><geom name="b" size=".01" pos="0 0 .2"/>
      <geom name="c" size=".01" pos="0 0 .2"/><camera name="c" pos="0 0 .3"/></body></worldbody>
      <sensor><framepos name="which" objtype="geom" objname="a"/></sensor></mujoco>"""
    heights = {"position(a, z)": 1, "position(b, z)": 1.1, "position(c, z)": 1.2, "sensor(which, z)": 1.2}
    channels = {f"c{i}": {"unit": "m", "is": text} for i, text in enumerate(heights)}
    model = small_model(tmp_path, mjcf, channels=channels)
    data = mujoco.MjData(model.model)
    mujoco.mj_forward(model.model, data)
    found = Observer(model.channels, tuple(channels))(data.sensordata)
    np.testing.assert_allclose(found, list(heights.values()))


def test_expressions_join_references_as_they_are_written(beast):
    text = (
        "hypot(position(finger, x) - position(block, x), position(finger, y) - position(block, y)) + 2 * "
        "joint(push)"
    )
    found, _, data = beast({text: "m", "where(joint(push) > 0, 1, -1)": "1"})
    away = (data.body("finger").xpos - data.body("block").xpos)[:2]
    angle = data.joint("push").qpos[0]
    np.testing.assert_allclose(list(found.values()), [np.hypot(*away) + 2 * angle, 1 if angle > 0 else -1])


def test_adding_sensors_changes_no_bit_of_the_motion(tmp_path):
    """The MJCF alone, stepped by MuJoCo, against the robot with a channel of every kind."""
    channels = {
        "a": {"unit": "m", "is": 'position("main body", x)'}, "b": {"unit": "N", "is": "contact(block)"},
        "c": {"unit": "m", "is": 'com("main body", z)'}, "d": {"unit": "rad", "is": 'joint("el bow")'},
        "e": {"unit": "m/s^2", "is": "acceleration(hand, z)"},
    }  # fmt: skip
    with_channels = small_model(tmp_path, BEAST, channels=channels).model
    states = []
    for model in (mujoco.MjModel.from_xml_string(BEAST), with_channels):
        data = mujoco.MjData(model)
        data.ctrl[:] = [0.1, 0.05, 0.5]
        mujoco.mj_step(model, data, nstep=700)
        states.append(np.concatenate([data.qpos, data.qvel, data.act]))
    np.testing.assert_array_equal(*states)


# --- what is said of a wrong one ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("is_", "unit", "said"),
    [
        (
            "joint(hing)", "rad",
            "6:9: channels.c.is: the MJCF has no joint 'hing'; allowed: slide, hinge; did you mean 'hinge'?",
        ),
        ("2 * joint(hinge)", "m", "6:9: channels.c.is: found '2 * joint(hinge)', which is rad; allowed: m"),
        (
            "joint(slide) + joint(hinge)", "m",
            "6:9: channels.c.is: found 'joint(slide) + joint(hinge)', which joins m and rad; "
            "allowed: the same on all sides",
        ),
        ("1 + position(tip, w)", "m", "6:13: channels.c.is: found the axis 'w'; allowed: x, y or z"),
        (
            "position(tips, x)", "m",
            "6:9: channels.c.is: the MJCF has no body or site or geom or camera 'tips'; "
            "allowed: world, cart, pole, tip, box; did you mean 'tip'?",
        ),
        (
            "sensor(felt)", "m/s^2",
            "6:9: channels.c.is: the sensor 'felt' has 3 numbers; allowed: one of them, such as sensor(felt, "
            "x)",
        ),
        (
            "sensor(felt, 3)", "m/s^2",
            "6:9: channels.c.is: found the component '3' of the sensor 'felt'; "
            "allowed: x, y, z, or a number from 0 to 2",
        ),
        ("sensor(rails)", "m", "6:9: channels.c.is: the MJCF has no sensor 'rails'; allowed: rail, felt; "
         "did you mean 'rail'?"),
        ("tendon(cord)", "m", "6:9: channels.c.is: the MJCF has no tendon 'cord'; allowed: nothing"),
        (
            "joint(slide, x)", "m",
            "6:9: channels.c.is: found joint with 2 arguments; allowed: 1",
        ),
        ("joint(slide) + speed", "m", "6:24: channels.c.is: unknown name 'speed'; allowed: nothing"),
        ("jiont(slide)", "m", "6:9: channels.c.is: unknown function 'jiont'; allowed: "),
    ],
)  # fmt: skip
def test_a_wrong_expression_is_told_with_line_and_column(tmp_path, is_, unit, said):
    path = robot_file(tmp_path, CART, channels={"c": {"unit": unit, "is": is_}})
    with pytest.raises(InputError) as caught:
        build_model(load_robot(path))
    assert str(caught.value).removeprefix(f"{path}:").startswith(said)
    line, column = (int(number) for number in str(caught.value).removeprefix(f"{path}:").split(":")[:2])
    assert path.read_text(encoding="utf-8").splitlines()[line - 1][column - 1 :][:1].strip()


def test_a_free_joint_has_no_angle(tmp_path):
    path = robot_file(tmp_path, BEAST, channels={"c": {"unit": "rad", "is": "joint(root)"}})
    with pytest.raises(InputError, match=r"'root' is a free joint; allowed: a hinge or a slide$"):
        build_model(load_robot(path))


def test_all_wrong_channels_are_told_at_once(tmp_path):
    channels = {
        "one": {"unit": "m", "is": "joint(slid)"},
        "two": {"unit": "m", "is": "joint(slide)"},
        "three": {"unit": "s", "is": "joint(slide)"},
    }
    with pytest.raises(InputError) as caught:
        build_model(load_robot(robot_file(tmp_path, CART, channels=channels)))
    assert [each.where for each in caught.value.problems] == ["channels.one.is", "channels.three.is"]


def test_the_column_is_right_behind_a_quoted_name(tmp_path):
    path = robot_file(tmp_path, CART)
    path.write_text(
        path.read_text(encoding="utf-8")
        + 'channels:\n  c: {unit: m, is: \'position("cart", x) + position("pol", x)\'}\n',
        encoding="utf-8",
    )
    with pytest.raises(InputError) as caught:
        build_model(load_robot(path))
    problem = caught.value.problems[0]
    line = path.read_text(encoding="utf-8").splitlines()[problem.line - 1]
    assert line[problem.column - 1 :].startswith('position("pol", x)')


def test_angles_wrap_where_mathematics_says(spun):
    """Upside down: roll is half a turn, and so is yaw of a body that looks back."""
    upside_down = Rotation.from_euler("x", math.pi).as_quat(scalar_first=True)
    assert abs(spun(upside_down)[0]) == pytest.approx(math.pi)
