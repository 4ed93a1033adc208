"""Limits, rates and ranges: what reaches the actuators, by hand, and what MuJoCo itself would be told."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_robots import Told, robot_file, run, small_model, small_robot

from circuitkit.base.errors import InputError
from circuitkit.robots import Worlds, build_model, control_ranges, load_robot
from circuitkit.robots.limits import Limits, TickLog, control_names

# A joint of +-30 degrees with a position servo of gear 2 and an offset, a limited motor, and a free one.
JOINTS = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="bent" axis="0 1 0" range="-30 30" damping="1"/><geom size=".1" mass="1"/></body>
    <body pos="1 0 0"><joint name="spun" axis="0 1 0" damping="1"/><geom size=".1" mass="1"/></body>
    <body pos="2 0 0"><joint name="free" axis="0 1 0" damping="1"/><geom size=".1" mass="1"/></body>
  </worldbody>
  <actuator>
    <position name="aim" joint="bent" kp="40" gear="2"/>
    <motor name="spin" joint="spun" ctrlrange="-3 3"/><motor name="any" joint="free"/>
  </actuator>
</mujoco>
"""
COMMANDS = {
    "bend": {"unit": "deg", "to": {"aim": 2}},
    "spin_it": {"unit": "N*m", "to": {"spin": 1}, "limits": ["-5 N*m", "1 N*m"]},
    "slow": {"unit": "N*m", "to": {"any": 1}, "rate": "50 N*m/s"},
    "any_it": {"unit": "N*m", "to": {"any": 1}},
}
BEND = 2 * np.radians(30)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return small_model(tmp_path_factory.mktemp("joints"), JOINTS, commands=COMMANDS)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("joints"), JOINTS, commands=COMMANDS)


def sent(model, rows, names=tuple(COMMANDS)):
    """MuJoCo's own controls after each tick, shape (T, nu), and the worlds."""
    worlds = Worlds(model, 0.01, model.held[np.newaxis], model.start_qpos, names)
    found = []
    for tick, row in enumerate(rows):
        worlds.advance(tick, np.array([row], dtype=float))
        found.append(np.array(worlds.physics.bind("ctrl"))[0])
    return np.array(found), worlds


def test_ranges_are_those_of_the_actuator_else_of_the_joint_else_of_mujoco(model):
    low, high = control_ranges(model)
    np.testing.assert_allclose(high, [BEND, 3, mujoco.mjMAXVAL])
    np.testing.assert_array_equal(low, -high)


def test_each_control_is_cut_to_its_range_and_each_command_to_its_limits(model):
    limits, found = Limits(model, tuple(COMMANDS), 1, 0.01, model.held[np.newaxis]), []
    for row in ([10, 9, 0, 1e11], [-10, -9, 0, -1e300], [0.1, 0.5, 0, 7]):
        limits(np.array([row], dtype=float), model.held[np.newaxis], ctrl := np.zeros((1, 3)))
        found.append(ctrl[0])
    np.testing.assert_allclose(found[0], [BEND, 1, mujoco.mjMAXVAL])
    np.testing.assert_allclose(found[1], [-BEND, -3, -mujoco.mjMAXVAL])
    np.testing.assert_allclose(found[2], [0.2, 0.5, 7])
    flags = dict(zip(limits.cut.names, limits.cut.of(0, 3).T.tolist(), strict=True))
    cut, never = [True, True, False], [False] * 3
    assert flags == {
        "bend": cut, "spin_it": cut, "slow": never, "any_it": cut,
        "aim": cut, "spin": [False, True, False], "any": never,
    }  # fmt: skip


def test_a_command_takes_part_in_a_control_that_is_cut(model):
    """1 turns `aim` beyond its range, and -4 N m are within the command's limits, not within the motor's."""
    limits = Limits(model, tuple(COMMANDS), 1, 0.01, model.held[np.newaxis])
    limits(np.array([[1.0, -4.0, 0, 0]]), model.held[np.newaxis], ctrl := np.zeros((1, 3)))
    np.testing.assert_allclose(ctrl, [[BEND, -3, 0]])
    flags = zip(limits.cut.names, limits.cut.of(0, 1)[0], strict=True)
    assert [name for name, is_cut in flags if is_cut] == ["bend", "spin_it", "aim", "spin"]


def test_what_befell_a_robot_is_known_tick_by_tick():
    log = TickLog(["a", "b"])
    log.add(0, np.array([[True, False], [False, False]]))
    log.add(2, np.array([[False, True], [False, True]]))
    assert log.of(0, 3).tolist() == [[True, False], [False, False], [False, True]]
    assert log.of(1, 2).tolist() == [[False, False], [False, False]]
    assert log.shares(np.array([4, 2])).tolist() == [0.5, 0.0]
    assert TickLog(["a"]).shares(np.array([4, 0])).tolist() == [0.0, 0.0]


def test_a_servo_with_an_offset_reaches_the_ends_of_its_joint(tmp_path):
    """At both ends of the joint, and with the controls at theirs, MuJoCo's own force is 0."""
    offset = '<general name="aim" joint="bent" biastype="affine" gainprm="40" biasprm="8 -40 0" gear="-2"/>'
    made = small_model(
        tmp_path, JOINTS.replace('<position name="aim" joint="bent" kp="40" gear="2"/>', offset)
    )
    data = mujoco.MjData(made.model)
    for ends in zip(control_ranges(made)[0][:1], control_ranges(made)[1][:1], strict=True):
        for control, angle in zip(ends, np.radians([30, -30]), strict=True):
            data.ctrl[0], data.qpos[0] = control, angle
            mujoco.mj_forward(made.model, data)
            assert data.actuator_force[0] == pytest.approx(0, abs=1e-12)


def test_controls_are_called_as_their_actuators():
    model = mujoco.MjModel.from_xml_string(JOINTS.replace('name="any" ', ""))
    assert control_names(model) == ["aim", "spin", "actuator 2"]


def test_a_rate_is_the_largest_change_of_a_control_step(model):
    """50 N m/s are 0.5 N m in 10 ms, from zero on, up and down."""
    found, worlds = sent(model, [[0, 0, x, 0] for x in (2, 2, 0.7, 0.7, -2, -2)])
    np.testing.assert_allclose(found[:, 2], [0.5, 1.0, 0.7, 0.7, 0.2, -0.3], atol=1e-15)
    assert worlds.limits.cut.of(0, 6)[:, 2].tolist() == [True, True, False, False, True, True]


def test_a_robot_that_starts_again_starts_its_rates_again(model):
    worlds = Worlds(model, 0.01, model.held[np.newaxis], model.start_qpos, ("slow",), 2)
    worlds.begin()
    start = worlds.start_state()
    for _ in range(3):
        worlds.advance(0, np.full((2, 1), 9.0))
    worlds.restart(np.array([1]), start)
    worlds.advance(np.array([3, 0]), np.full((2, 1), 9.0))
    np.testing.assert_allclose(worlds.physics.bind("ctrl")[:, 2], [2.0, 0.5])


@given(values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=4, max_size=4))
def test_mujoco_never_refuses_a_control(model, values):
    """It would set all of them to zero and warn."""
    found, worlds = sent(model, [values])
    low, high = control_ranges(model)
    assert ((low <= found) & (found <= high)).all()
    assert not worlds.physics.warning[:, int(mujoco.mjtWarning.mjWARN_BADCTRL), 1].any()


def test_a_servo_reaches_as_far_beyond_its_joint_as_its_robot_says(tmp_path):
    servo = {"joints": ["bent"], "stiffness": "40 N*m/rad", "damping": "1 N*m*s/rad", "torque": "9 N*m"}
    for reach, allowed in ({}, 30), ({"reach": "15 deg"}, 45):
        made = small_model(tmp_path, JOINTS, servos=[{**servo, **reach}])
        low, high = control_ranges(made)
        place = [made.model.actuator(i).name for i in range(made.model.nu)].index("bent")
        np.testing.assert_allclose(np.degrees([low[place], high[place]]), [-allowed, allowed])


def test_an_mjcf_that_lets_controls_be_what_they_are(tmp_path):
    free = JOINTS.replace("<option", '<option><flag clampctrl="disable"/></option><option')
    assert control_ranges(small_model(tmp_path, free))[1][1] == mujoco.mjMAXVAL


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        ("50 N*m", "rate: found '50 N*m', which is length^2*mass/time^2; allowed: more than 0, in N*m/s"),
        ("0 N*m/s", "rate: found '0 N*m/s'; allowed: more than 0, in N*m/s"),
        ("-1 N*m/s", "rate: found '-1 N*m/s'; allowed: more than 0, in N*m/s"),
    ],
)
def test_a_wrong_rate(tmp_path, rate, said):
    path = robot_file(tmp_path, JOINTS, commands={"slow": {**COMMANDS["slow"], "rate": rate}})
    with pytest.raises(InputError) as caught:
        build_model(load_robot(path))
    assert str(caught.value).endswith(said)


# --- in a run -----------------------------------------------------------------------------------------------


def test_a_run_says_what_was_cut_and_how_long(robot):
    """A half of the ticks ask for more than 30 degrees."""
    asked = np.where(np.arange(50) < 25, np.radians(40), 0.1)
    recording = run(robot, Told(bend=asked))
    columns = recording.columns()
    np.testing.assert_array_equal(columns["clamped_bend"], np.arange(50) < 25)
    np.testing.assert_array_equal(columns["clamped_aim"], columns["clamped_bend"])
    assert recording.interventions()["clamped"] == {"bend": (0.0, 0.25)}
    assert not any(name.startswith("clamped") for name in run(robot, Told(bend=0.1)).columns())


def test_each_robot_of_a_batch_has_its_own_count(robot):
    class ByRobot(Told):
        def step(self, observation):
            return super().step(observation) * np.array([[1.0], [0.0], [-1.0]])

    recording = run(robot, ByRobot(bend=2.0), seeds=(0, 1, 2), duration_s=0.2)
    np.testing.assert_array_equal(recording.cut.shares(np.array([20, 20, 10])), [1.0, 0.0, 1.0])
    assert recording.interventions(1)["clamped"] == {}
