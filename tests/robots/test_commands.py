"""Commands, servos, what is held, keyframes and time steps: what reaches the actuators, and what is said."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_robots import CART, CART_FILE, PUCK, robot_file, small_model

from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.robots import Observer, Worlds, build_model, load_robot
from circuitkit.robots.model import servo_numbers
from circuitkit.robots.spec import Servo
from circuitkit.robots.starter import write_robot_starter
from circuitkit.robots.worlds import substeps_of

# Two joints, of which one has a position actuator with a gear, and another one a motor; all are limited.
ARM = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <default>
    <general ctrllimited="true" ctrlrange="-.1 .1" forcerange="-1 1"/><position ctrlrange="-1 1"/>
  </default>
  <worldbody>
    <body name="upper"><joint name="shoulder" axis="0 1 0" damping="1"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
      <body name="lower" pos=".3 0 0"><joint name="elbow" axis="0 1 0" damping="1"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
        <body name="hand" pos=".3 0 0">
          <joint name="reach" type="slide" axis="1 0 0" damping="5"/><geom size=".05"/>
        </body>
      </body>
    </body>
    <body name="ball" pos="2 0 0"><freejoint/><geom size=".1"/></body>
  </worldbody>
  <actuator>
    <position name="lift" joint="shoulder" kp="40" gear="2"/><motor name="bend" joint="elbow"/>
    <velocity name="glide" joint="reach" kv="3"/>
  </actuator>
  <keyframe>
    <key name="up" qpos="1 -.5 .1  2 0 0 1 0 0 0" ctrl=".7 .05 .2"/>
  </keyframe>
</mujoco>
"""


def arm(tmp_path, **sections):
    return small_model(tmp_path, ARM, **sections)


def complaint(tmp_path, mjcf=ARM, **sections):
    with pytest.raises(InputError) as caught:
        build_model(load_robot(robot_file(tmp_path, mjcf, **sections)))
    return str(caught.value).replace(str(tmp_path) + "/", "")


def controls(model, commands, values, targets=None):
    """The controls that reach the actuators; shape (B, nu)."""
    held = model.held[np.newaxis] if targets is None else targets
    worlds = Worlds(model, 0.01, held, model.start_qpos, commands, len(values))
    worlds.advance(0, np.asarray(values, dtype=float))
    return np.array(worlds.physics.bind("ctrl"))


# --- commands -----------------------------------------------------------------------------------------------


@given(one=st.floats(-5, 5), two=st.floats(-5, 5))
def test_a_control_is_what_is_held_plus_the_commands_by_their_factors(mixed, one, two):
    found = controls(mixed, ("both", "turn"), [[one, two]])
    expected = mixed.held + np.clip(one, -2, 2) * np.array([3, 0, -0.5]) + two * np.array([1, -1, 0])
    expected = np.clip(expected, *mixed.model.actuator_ctrlrange.T)
    np.testing.assert_allclose(found, [expected], atol=1e-12)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    commands = {
        "both": {"unit": "m/s", "to": {"lift": 3, "glide": -0.5}, "limits": ["-200 cm/s", "2 m/s"]},
        "turn": {"unit": "deg", "to": {"lift": 1, "bend": -1}},
    }
    return arm(tmp_path_factory.mktemp("mixed"), commands=commands, hold={"shoulder": "20 deg"})


def test_the_values_of_a_command_are_in_si_units_whatever_its_unit(mixed):
    assert mixed.commands["turn"].unit.symbol == "deg"
    np.testing.assert_array_equal(mixed.commands["turn"].factors, [1, -1, 0])
    assert mixed.commands["both"].limits == (-2, 2)


def test_each_robot_of_a_batch_gets_its_own(mixed):
    found = controls(mixed, ("turn",), [[0.1], [0.2], [-0.3]])
    np.testing.assert_allclose(found[:, 1], [-0.1, -0.2, 0.3])


def test_targets_go_on_with_the_last_one(mixed):
    targets = np.arange(6.0).reshape(2, 3) / 100
    worlds = Worlds(mixed, 0.01, targets, mixed.start_qpos)
    for tick, row in ((0, 0), (1, 1), (5, 1)):
        worlds.advance(tick, np.zeros((1, 0)))
        np.testing.assert_array_equal(worlds.physics.bind("ctrl")[0], targets[row])


def test_a_limit_of_a_command_that_is_not_used_binds_nobody(mixed):
    assert controls(mixed, ("both",), [[0.01]])[0, 1] == 0.0
    assert controls(mixed, ("turn",), [[0.09]])[0, 1] == -0.09


def test_a_command_that_the_robot_does_not_have(mixed):
    with pytest.raises(UnknownNameError) as caught:
        controls(mixed, ("turns",), [[0.0]])
    assert (
        str(caught.value) == "unknown command of the robot 'turns'; allowed: both, turn; did you mean 'turn'?"
    )


@pytest.mark.parametrize(
    ("commands", "said"),
    [
        (
            {"c": {"unit": "N", "to": {"bemd": 1}}},
            "robot.yaml:7:13: commands.c.to.bemd: the robot has no actuator 'bemd'; allowed: lift, bend, "
            "glide; "
            "did you mean 'bend'?",
        ),
        (
            {"c": {"unit": "N", "to": {}}},
            "robot.yaml:6:9: commands.c.to: found a mapping of 0; allowed: at least 1",
        ),
        (
            {"c": {"unit": "N", "to": {"bend": 1}, "limits": ["1 N", "-1 N"]}},
            "robot.yaml:5:5: commands.c: limits: found 1 N and -1 N; allowed: the lower end first",
        ),
        (
            {"c": {"unit": "N", "to": {"bend": 1}, "limits": ["-1 m", "1 m"]}},
            "robot.yaml:5:5: commands.c: limits: found '-1 m', which is length; allowed: a quantity in N",
        ),
        (
            {"c": {"unit": "N", "to": {"bend": 1}, "limits": ["1 N"]}},
            "robot.yaml:9:5: commands.c.limits: found a list of 1; allowed: a list of 2",
        ),
        (
            {"c": {"unit": "newton", "to": {"bend": 1}}},
            "robot.yaml:5:11: commands.c.unit: unknown unit 'newton'; allowed: ",
        ),
    ],
)  # fmt: skip
def test_a_wrong_command(tmp_path, commands, said):
    assert complaint(tmp_path, commands=commands).startswith(said)


# --- what is held -------------------------------------------------------------------------------------------


def test_a_held_joint_starts_there_and_its_position_actuator_is_told(tmp_path):
    """Its gear turns the angle of the joint into that of the actuator."""
    model = arm(tmp_path, hold={"shoulder": "20 deg", "elbow": "0.2 rad", "reach": "5 cm"})
    np.testing.assert_allclose(model.start_qpos[:3], [np.radians(20), 0.2, 0.05])
    np.testing.assert_allclose(
        model.held, [2 * np.radians(20), 0, 0]
    )  # a motor and a velocity are told nothing
    data = mujoco.MjData(model.model)
    data.qpos[:], data.ctrl[:] = model.start_qpos, model.held
    mujoco.mj_forward(model.model, data)
    assert data.actuator("lift").force[0] == pytest.approx(0, abs=1e-12)


def test_a_key_brings_positions_and_controls_and_hold_comes_after(tmp_path):
    model = arm(tmp_path, key="up", hold={"elbow": "0 deg"})
    np.testing.assert_allclose(model.start_qpos, [1, 0, 0.1, 2, 0, 0, 1, 0, 0, 0])
    np.testing.assert_allclose(model.held, [0.7, 0.05, 0.2])


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"key": "uo"}, "key: the MJCF has no keyframe 'uo'; allowed: up; did you mean 'up'?"),
        (
            {"hold": {"elbo": "1 deg"}},
            "hold.elbo: the MJCF has no hinge or slide 'elbo'; allowed: shoulder, elbow, reach; did you mean "
            "'elbow'?",
        ),
        (
            {"hold": {"reach": "30 deg"}},
            "hold.reach: found '30 deg', but reach is a slide; allowed: a quantity in m or like it",
        ),
        (
            {"hold": {"elbow": "1 cm"}},
            "hold.elbow: found '1 cm', but elbow is a hinge; allowed: a quantity in rad or like it",
        ),
        (
            {"hold": {"reach": 0.1}},
            "hold.reach: found '0.1', but reach is a slide; allowed: a quantity in m or like it",
        ),
    ],
)
def test_what_cannot_be_held(tmp_path, sections, said):
    found = complaint(tmp_path, **sections)
    assert found.partition(": ")[2] == said
    line, column = (int(each) for each in found.removeprefix("robot.yaml:").split(":")[:2])
    text = (tmp_path / "robot.yaml").read_text(encoding="utf-8").splitlines()[line - 1][column - 1 :]
    value = sections.get("key") or next(iter(sections["hold"].values()))
    assert text.startswith(str(value))


# --- servos -------------------------------------------------------------------------------------------------

SERVO = {
    "joints": ["shoulder", "*bow"],
    "stiffness": "50 N*m/rad",
    "damping": "2 N*m*s/rad",
    "torque": "6 N*m",
}


def test_servos_stand_in_for_the_actuators_of_their_joints_and_no_other(tmp_path):
    model = arm(tmp_path, servos=[SERVO]).model
    names = [model.actuator(i).name for i in range(model.nu)]
    assert sorted(names) == ["elbow", "glide", "shoulder"]
    with pytest.raises(UnknownNameError) as caught:
        servo_numbers(arm(tmp_path, servos=[SERVO]), ["reach"])
    assert "unknown joint with a position servo 'reach'; allowed: " in str(caught.value)


@given(target=st.floats(-1, 1), angle=st.floats(-1, 1), rate=st.floats(-3, 3))
def test_a_servo_pulls_by_its_law_whatever_the_defaults_of_the_mjcf(servoed, target, angle, rate):
    """Torque = k (target - angle) - d rate within its torque; the target is not limited as motors are."""
    model, data = servoed
    data.actuator("elbow").ctrl, data.joint("elbow").qpos, data.joint("elbow").qvel = target, angle, rate
    mujoco.mj_forward(model, data)
    expected = np.clip(50 * (target - angle) - 2 * rate, -6, 6)
    assert data.actuator("elbow").force[0] == pytest.approx(expected, abs=1e-9)


@pytest.fixture(scope="module")
def servoed(tmp_path_factory):
    model = arm(tmp_path_factory.mktemp("servoed"), servos=[SERVO]).model
    return model, mujoco.MjData(model)


def test_a_held_joint_with_a_servo_settles_where_it_is_held(tmp_path):
    model = arm(tmp_path, servos=[SERVO], hold={"elbow": "40 deg"})
    worlds = Worlds(model, 0.01, model.held[np.newaxis], model.start_qpos)
    worlds.qvel[:, 1] = 3.0
    for tick in range(200):
        worlds.advance(tick, np.zeros((1, 0)))
    np.testing.assert_allclose(worlds.qpos[0, :2], [0, np.radians(40)], atol=1e-3)


def test_servos_hold_the_positions_of_a_keyframe(tmp_path):
    model = arm(tmp_path, servos=[SERVO], key="up")
    held = dict(zip((model.model.actuator(i).name for i in range(3)), model.held, strict=True))
    assert held == pytest.approx({"shoulder": 1.0, "elbow": -0.5, "glide": 0.2})


SLIDING = {"joints": ["reach"], "stiffness": "50 N/m", "damping": "20 N*s/cm", "torque": "6 N"}


def test_a_servo_of_a_slide_is_in_newtons_and_metres(tmp_path):
    servo = arm(tmp_path, servos=[SERVO, SLIDING]).model.actuator("reach")
    found = (*servo.gainprm[:1], *servo.biasprm[1:3], *servo.forcerange)
    assert found == pytest.approx((50, -50, -2000, -6, 6))


@pytest.mark.parametrize(
    ("servo", "said"),
    [
        (
            {"stiffness": "100 N*m/rad"},
            "stiffness: found '100 N*m/rad', but reach is a slide; allowed: a quantity in N/m",
        ),
        (
            {"damping": "3 N*m*s/rad"},
            "damping: found '3 N*m*s/rad', but reach is a slide; allowed: a quantity in N*s/m",
        ),
        ({"torque": "1 N*m"}, "torque: found '1 N*m', but reach is a slide; allowed: a quantity in N"),
        (
            {"joints": ["re*", "elbow", "shoulder"], "torque": "6 N"},
            "stiffness: found '50 N/m', but shoulder is a hinge; allowed: a quantity in N*m/rad",
        ),
        (
            {"stiffness": "1 N"},
            "stiffness: found '1 N', which is force; allowed: a quantity such as '100 N*m/rad', of a slide "
            "'100 N/m'",
        ),
        ({"stiffness": "0 N/m"}, "stiffness: found '0 N/m'; allowed: more than 0"),
        ({"damping": "-1 N*s/m"}, "damping: found '-1 N*s/m'; allowed: 0 or more"),
    ],
)
@pytest.mark.parametrize("in_sets", [False, True])
def test_units_of_a_servo_follow_the_type_of_its_joint(tmp_path, servo, said, in_sets):
    servos = [{**SLIDING, **servo}]
    found = complaint(tmp_path, servos={"own": servos} if in_sets else servos)
    first = next(line for line in found.splitlines() if said.partition(":")[0] in line)
    assert first.partition(": ")[2] == f"servos{'.own' if in_sets else ''}[0].{said}"
    line, column = (int(each) for each in first.removeprefix("robot.yaml:").split(":")[:2])
    text = (tmp_path / "robot.yaml").read_text(encoding="utf-8").splitlines()[line - 1][column - 1 :]
    assert text.startswith(said.partition("found '")[2].partition("'")[0])


def test_init_suggests_servos_in_the_units_of_each_joint(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM, encoding="utf-8")
    path = write_robot_starter(tmp_path / "arm.xml", tmp_path / "robot.yaml")
    lines = path.read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("# servos:"))
    used = [line.removeprefix("# ") if start <= i <= start + 2 else line for i, line in enumerate(lines)]
    path.write_text("\n".join(used), encoding="utf-8")
    hinges, slide = load_robot(path).servos_in_use
    assert (hinges.joints, str(hinges.stiffness)) == (("shoulder", "elbow"), "100 N*m/rad")
    assert (slide.joints, str(slide.stiffness), str(slide.torque)) == (("reach",), "100 N/m", "10 N")
    robot = load_robot(path).model_copy(update={"commands": {}})
    assert set(build_model(robot).servo_joints) == {"shoulder", "elbow", "reach"}


def test_numbers_of_python_are_in_the_si_unit_of_the_joint(tmp_path):
    numbers = Servo(joints=("reach", "elbow"), stiffness=7.0, damping=0.5, torque=3.0)
    robot = load_robot(robot_file(tmp_path, ARM)).model_copy(update={"servos": (numbers,)})
    model = build_model(robot).model
    assert [model.actuator(name).gainprm[0] for name in ("reach", "elbow")] == [7.0, 7.0]


def test_a_keyframe_of_an_mjcf_without_any(tmp_path):
    said = complaint(tmp_path, PUCK, key="home")
    assert said.partition(": ")[2] == (
        "key: found 'home', but the MJCF has no keyframes; allowed: no key; hold, such as "
        "hold: {JOINT: 10 deg}, puts joints where they start"
    )


def test_servos_may_be_sets_by_name(tmp_path):
    sets = {"weak": [{**SERVO, "torque": "1 N*m"}], "strong": [SERVO]}
    robot = load_robot(robot_file(tmp_path, ARM, servos=sets, servo_profile="weak"))
    torques = [
        build_model(each).model.actuator("elbow").forcerange[1]
        for each in (robot, robot.with_servos("strong"))
    ]
    assert torques == [1, 6]
    said = complaint(tmp_path, servos=sets)
    assert said == "robot.yaml:1:1: servo_profile is missing; allowed: weak, strong"


def test_a_servo_of_no_joint(tmp_path):
    said = complaint(tmp_path, servos=[{**SERVO, "joints": ["elbow", "wrist*"]}])
    assert said.partition(": ")[2] == (
        "servos[0].joints: the MJCF has no hinge or slide 'wrist*'; allowed: shoulder, elbow, reach, "
        "or a pattern with *"
    )


# --- time ---------------------------------------------------------------------------------------------------


def test_a_time_step_of_the_robot_file_takes_the_place_of_the_mjcfs(tmp_path):
    assert arm(tmp_path).model.opt.timestep == 0.001
    assert arm(tmp_path, timestep="2500 us").model.opt.timestep == 0.0025


@pytest.mark.parametrize(
    ("step_ms", "timestep_ms", "count"), [(10, 2, 5), (5, 5, 1), (3, 0.1, 30), (15, 2.5, 6)]
)
def test_a_control_step_is_a_multiple_of_the_time_step(tmp_path, step_ms, timestep_ms, count):
    assert substeps_of(arm(tmp_path, timestep=f"{timestep_ms} ms"), step_ms * 1e-3) == count


@pytest.mark.parametrize(("step_s", "said"), [(0.005, "5 ms"), (0.0011, "1.1 ms")])
def test_a_control_step_that_is_none(tmp_path, step_s, said):
    with pytest.raises(InputError) as caught:
        substeps_of(arm(tmp_path, timestep="2 ms"), step_s)
    assert str(caught.value).startswith(
        f"control_step: found a control step of {said}; allowed: a multiple of the model's time step of 2 "
        "ms, such as "
    )


# --- what else the MJCF has ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ground",
    ['<geom name="ground" type="box" size="3 3 .1" pos="0 0 -.1"/>',
     '<body name="island" pos="0 0 -.1"><geom name="ground" type="box" size="3 3 .1"/></body>',
     '<body><body pos="0 0 -1"><geom name="ground" type="plane" size="3 3 .1" pos="0 0 1"/></body></body>'],
)  # fmt: skip
def test_the_ground_is_whatever_the_mjcf_has(tmp_path, ground):
    """A box, or something inside bodies: a block that falls on it comes to rest, and weighs on it."""
    mjcf = f"""<mujoco><worldbody>{ground}
      <body name="block" pos="0 0 .3"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body>
    </worldbody></mujoco>"""
    channels = {
        "height": {"unit": "m", "is": "position(block, z)"},
        "load": {"unit": "N", "is": "contact(block, ground, z)"},
        "all": {"unit": "N", "is": "contact(block)"},
    }  # fmt: skip
    model = small_model(tmp_path, mjcf, channels=channels)
    worlds = Worlds(model, 0.01, model.held[np.newaxis], model.start_qpos)
    for tick in range(150):
        worlds.advance(tick, np.zeros((1, 0)))
    height, load, every = Observer(model.channels, tuple(channels))(worlds.readings)[0]
    assert height == pytest.approx(0.1, abs=2e-3)
    assert load == pytest.approx(2 * 9.81, rel=1e-2)
    assert every == pytest.approx(load)


def test_loose_objects_are_no_robot(tmp_path):
    """The arm does not move about, and its ball is the only free body."""
    model = arm(tmp_path)
    assert model.mass_kg == pytest.approx(model.model.body_subtreemass[model.model.body("ball").id])
    assert model.names("body") == ["upper", "lower", "hand", "ball"]
    assert model.number("body", "hand") == model.model.body("hand").id
    assert model.matching("actuator", "*l*") == [model.model.actuator(n).id for n in ("lift", "glide")]
    with pytest.raises(UnknownNameError, match="unknown actuator 'x'; allowed: lift, bend, glide"):
        model.matching("actuator", "x")


def test_changes_of_the_compiled_model_come_last(tmp_path):
    robot = load_robot(robot_file(tmp_path, CART, **CART_FILE))
    seen = []
    build_model(
        robot, [lambda model: seen.append(sorted(model.commands)), lambda model: seen.append(model.base)]
    )
    assert seen == [["force"], None]
