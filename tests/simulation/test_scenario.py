"""The scenario file and the text of a push: what they say, and every complaint word for word."""

from __future__ import annotations

import math

import pytest
import yaml
from walking import scenario

from circuitkit.base.errors import InputError, listing
from circuitkit.base.source import data_folder
from circuitkit.simulation import load_scenario, make_plan, parse_push
from circuitkit.simulation.disturbance import DISTURBANCES
from circuitkit.simulation.reference import REFERENCES

SHIPPED = data_folder("sims") / "nao_push.yaml"
TEXT = """\
scenario: mine
robot: nao
reference: {gait: gait_march}
circuit: binn_lateral
duration: 4 s
disturbances:
  - push:
      body: torso
      force: 20 N
      direction: inward
      duration: 200 ms
      start: {step: 1, phase: lift, at: 20 %}
  - fault: {channel: LFsrFL, reading: missing, start: 1 s, duration: 100 ms}
  - noise: {channel: "*Fsr*", std: 0.2 N}
  - jitter: {start: 20 ms, velocity: 1 cm/s}
seed: 0
until: upright < 0.7 or com_z < 0.6 * first(com_z)
measures:
  time_of_fall_s: time_of(ended)
  thresholds:
    channel: zmp_y
    left_foot: {right: q3, left: q4}
    right_foot: {right: q1, left: q2}
    both_feet: {right: q1, left: q4}
"""


def written(tmp_path, text=TEXT):
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def complaints(tmp_path, old, new):
    assert old in TEXT
    path = written(tmp_path, TEXT.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    return str(caught.value).replace(str(path), "mine.yaml")


def test_a_scenario_is_read_in_si_units(tmp_path):
    found = load_scenario(written(tmp_path))
    push, fault, noise, jitter = found.befalling
    assert (found.duration, found.seed, found.controller) == (4.0, 0, None)
    assert (push.force, push.duration) == pytest.approx((20.0, 0.2))
    assert push.start == {"step": 1, "phase": "lift", "at": "20 %"}
    assert (fault.start, fault.duration) == pytest.approx((1.0, 0.1))
    assert (noise.channel, noise.std) == ("*Fsr*", "0.2 N")
    assert (jitter.start, jitter.velocity) == pytest.approx((0.02, 0.01))
    assert found.pushes == (push,)


def test_what_differs_from_the_robot_is_read_in_si_units(tmp_path):
    more = """\
  - delay: {channel: "*", by: 20 ms}
  - body: {mass: 110 %, friction: 0.4}
  - body: {body: r_wrist, payload: 300 g}
  - actuator: {stiffness: 70 %}
  - slope: {forward: 3 deg, left: -1 deg}
  - current: {velocity: [1 cm/s, 0 m/s, -2 mm/s], start: 1 s, duration: 500 ms}
  - move: {body: torso, position: [1 m, 2 cm, 0 m], start: 100 ms}
"""
    *_, delay, body, payload, actuator, slope, current, move = load_scenario(
        written(tmp_path, TEXT.replace("seed: 0\n", more + "seed: 0\n"))
    ).befalling
    assert (delay.channel, delay.command, delay.by) == ("*", None, pytest.approx(0.02))
    assert (body.friction, body.mass, body.body) == (pytest.approx(0.4), pytest.approx(1.1), "*")
    assert (payload.body, payload.payload) == ("r_wrist", pytest.approx(0.3))
    assert (actuator.actuator, actuator.stiffness, actuator.strength) == ("*", pytest.approx(0.7), 1.0)
    assert (slope.forward, slope.left) == pytest.approx((math.radians(3), math.radians(-1)))
    assert current.velocity == pytest.approx((0.01, 0.0, -0.002))
    assert (current.start, current.duration) == pytest.approx((1.0, 0.5))
    assert move.position == pytest.approx((1.0, 0.02, 0.0))
    assert move.velocity is None


def test_a_fault_without_times_lasts_for_the_whole_run(tmp_path):
    text = TEXT.replace("reading: missing, start: 1 s, duration: 100 ms", "reading: zero")
    found = load_scenario(written(tmp_path, text)).befalling[1]
    assert (found.start, found.duration) == (0.0, None)


def test_a_push_may_have_an_angle_and_a_height(tmp_path):
    text = TEXT.replace("direction: inward", "direction: -15 deg\n      height: 50 mm")
    (push,) = load_scenario(written(tmp_path, text)).pushes
    assert (push.direction, push.height) == ("-15 deg", pytest.approx(0.05))
    assert parse_push("20N,200ms,165deg", load_scenario("nao_push")).direction == "165deg"


def test_the_shipped_push_is_the_papers():
    """Section 5.2: 20 N for 0.2 s at the torso during the lift, to the side."""
    (push,) = load_scenario("nao_push").pushes
    assert (push.force, push.duration, push.start["phase"]) == (20.0, 0.2, "lift")
    assert push.direction in {"inward", "outward"}
    assert load_scenario(SHIPPED).pushes == (push,)


def test_what_is_absent_does_not_happen(tmp_path):
    data = yaml.safe_load(TEXT)
    for key in ("disturbances", "seed", "until", "measures"):
        del data[key]
    found = load_scenario(written(tmp_path, yaml.safe_dump(data)))
    assert found.befalling == found.pushes == ()
    assert (found.seed, found.until) == (0, None)
    assert found.formulas == {"survived": "not ended"}


WAYS = "forward, backward, left, right, up, down"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "direction: inward", "direction: 15",
            f"10:18: disturbances[0].push.direction: unknown direction 15; allowed: {WAYS}, or an angle such "
            "as "
            "'15 deg'",
        ),
        (
            "force: 20 N", "force: 20 kg",
            "9:14: disturbances[0].push.force: found '20 kg', which is mass; allowed: a quantity such as '20 "
            "N'",
        ),
        ("force: 20 N", "force: -20 N", "9:14: disturbances[0].push.force: found '-20 N'; allowed: at least "
            "0 N"),
        (
            "force: 20 N", "force: 20 N\n      torque: 1 N*m",
            "8:7: disturbances[0].push: found both force and torque; allowed: one of them",
        ),
        (
            "duration: 200 ms", "duration: 0 ms",
            "11:17: disturbances[0].push.duration: found '0 ms'; allowed: more than 0 ms",
        ),
        (
            "{step: 1, phase: lift, at: 20 %}", "soon",
            "12:14: disturbances[0].push.start: found 'soon'; allowed: a time such as '5 s', or a moment of "
            "the "
            "reference",
        ),
        (
            "reading: missing", "reading: broken",
            "13:39: disturbances[1].fault.reading: found 'broken'; allowed: missing, zero, stuck, spike, "
            "dropped",
        ),
        (
            "reading: missing", "reading: spike",
            "13:12: disturbances[1].fault: found the reading spike without value; "
            "allowed: value with the reading spike, and only there",
        ),
        (
            'channel: "*Fsr*", std', "std",
            "14:12: disturbances[2].noise: found neither a channel nor names in std; "
            "allowed: channel: NAME with std: AMOUNT, or std: {NAME: AMOUNT}",
        ),
        (
            "- jitter", "- jiter",
            "15:5: disturbances[3].jiter: unknown key 'jiter'; "
            f"allowed: {listing(DISTURBANCES.kinds)}; did you mean 'jitter'?",
        ),
        (
            "seed: 0", "  - {}",
            "16:5: disturbances[4]: found nothing; allowed: one kind of disturbance, such as push: {…}",
        ),
        ("seed: 0", "  - body: {mass: 0 %}", "16:18: disturbances[4].body.mass: found '0 %'; allowed: more "
            "than 0 %"),
        (
            "seed: 0", "  - slope: {forward: 45 deg}",
            "16:22: disturbances[4].slope.forward: found '45 deg'; allowed: at most 30 deg",
        ),
        (
            "seed: 0", "  - body: {body: r_wrist, payload: 300}",
            "16:36: disturbances[4].body.payload: found 300, which is dimensionless; "
            "allowed: a quantity such as '0.3 kg'",
        ),
        (
            "seed: 0", '  - body: {body: "*", payload: 1 kg}',
            "16:11: disturbances[4].body: found a payload for '*'; allowed: the name of one body",
        ),
        (
            "seed: 0", '  - delay: {channel: "*", by: -20 ms}',
            "16:31: disturbances[4].delay.by: found '-20 ms'; allowed: at least 0 ms",
        ),
        (
            "seed: 0", "  - delay: {by: 20 ms}",
            "16:12: disturbances[4].delay: found both channel and command, or neither; allowed: one of them",
        ),
        (
            "seed: 0", "  - current: {velocity: [1 m/s]}",
            "16:25: disturbances[4].current.velocity: found a list of 1; allowed: a list of 3",
        ),
        (
            "seed: 0", "  - move: {body: torso}",
            "16:11: disturbances[4].move: found neither position nor velocity; allowed: one of them, or both",
        ),
        ("duration: 4 s", "duration: 2 h", "5:11: duration: found '2 h'; allowed: at most 1 h"),
        ("robot: nao\n", "", "1:1: missing key 'robot'; required: robot, duration"),
        (
            "robot: nao", "robot: 3",
            "2:8: robot: found 3; allowed: the name of a robot, the path of a robot file, or a Robot",
        ),
        (
            "circuit: binn_lateral", "circuit: {w: 1}",
            "4:10: circuit: found a mapping of 1; allowed: the name of a circuit, a path, or a CircuitGraph",
        ),
        (
            "circuit: binn_lateral", "controller: [1, 2]",
            "4:13: controller: found a list of 2; allowed: a name, a path, or a Controller",
        ),
        (
            "{gait: gait_march}", "{gait: gait_march, hold: {}}",
            "3:12: reference: found gait, hold; allowed: one kind of reference",
        ),
        (
            "{gait: gait_march}", "{gat: gait_march}",
            "3:13: reference.gat: unknown key 'gat'; "
            f"allowed: {listing(REFERENCES.kinds)}; did you mean 'gait'?",
        ),
        ("seed: 0", "seed: -1", "16:7: seed: found -1; allowed: at least 0"),
        (
            "time_of(ended)", "{above: 3}",
            "19:19: measures.time_of_fall_s: found a mapping of 1; "
            "allowed: an expression, such as max(abs(roll)); kinds with settings are thresholds",
        ),
    ],
)  # fmt: skip
def test_a_complaint(tmp_path, old, new, said):
    assert complaints(tmp_path, old, new) == f"mine.yaml:{said}"


def test_every_wrong_value_is_reported_at_once(tmp_path):
    said = complaints(tmp_path, "force: 20 N\n      direction: inward", "force: 20\n      direction: 7")
    assert [line.split(": ")[1] for line in said.splitlines()] == [
        "disturbances[0].push.force", "disturbances[0].push.direction",
    ]  # fmt: skip


# --- what only the robot, the reference or the circuit can tell ---------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "direction: inward", "direction: inwards",
            f"10:18: disturbances[0].push.direction: unknown direction 'inwards'; allowed: {WAYS}, outward, "
            "inward, "
            "or an angle such as '15 deg'; did you mean 'inward'?",
        ),
        (
            "phase: lift", "phase: lifted",
            "12:31: disturbances[0].push.start.phase: found 'lifted'; allowed: transfer, lift, extend; "
            "did you mean 'lift'?",
        ),
        (
            "at: 20 %", "at: 120 %",
            "12:41: disturbances[0].push.start.at: found '120 %'; allowed: at most 100 %",
        ),
        (
            "step: 1,", "step: -1,",
            "12:21: disturbances[0].push.start.step: found -1; allowed: at least 0",
        ),
        (
            "{step: 1, phase: lift, at: 20 %}", "{step: 1}",
            "12:14: disturbances[0].push.start: missing key 'phase'; required: step, phase, at\n"
            "mine.yaml:12:14: disturbances[0].push.start: missing key 'at'; required: step, phase, at",
        ),
        (
            "step: 1,", "step: 99,",
            "12:14: disturbances[0].push.start: found step 99, and the walk ends before that 'lift'; "
            "allowed: steps 0 to 4, or a longer duration",
        ),
        (
            "{gait: gait_march}", "{hold: {}}\ncontrol_step: 10 ms",
            "13:14: disturbances[0].push.start: found {'step': 1, 'phase': 'lift', 'at': '20 %'}; "
            "allowed: a time such as 5 s, for the reference 'hold' has no moments",
        ),
        (
            "start: 1 s, duration: 100 ms", "start: 5 s, duration: 100 ms",
            "13:55: disturbances[1].fault.start: found 5 s, and the run ends at 4 s; allowed: a start before "
            "the end; or a longer duration of the run",
        ),
        (
            "seed: 0", "  - noise: {channel: zmp_y, std: 1 N}",
            "16:34: disturbances[4].noise.std: found '1 N', and the channel 'zmp_y' has 'm'; allowed: a "
            "unit like it",
        ),
        (
            "seed: 0", '  - noise: {channel: "*Fsr*", std: -1 N}',
            "16:36: disturbances[4].noise.std: found '-1 N'; allowed: 0 or more",
        ),
        (
            "seed: 0", "  - fault: {channel: LFsrFL, reading: spike, value: 2 m}",
            "16:53: disturbances[4].fault.value: found '2 m', and the channel 'LFsrFL' has 'N'; allowed: a "
            "unit like it",
        ),
        (
            "seed: 0", "  - move: {body: Head, position: [0 m, 0 m, 0 m]}",
            "16:18: disturbances[4].move.body: 'Head' cannot be moved so; "
            "allowed: a body with a free joint, or the position of a mocap body",
        ),
        (
            "seed: 0", '  - delay: {channel: "*", by: 15 ms}',
            "16:31: disturbances[4].delay.by: found 15 ms; allowed: a multiple of the control step of 10 ms",
        ),
        (
            "time_of(ended)", "time_of(upright)",
            "19:19: measures.time_of_fall_s: found 'time_of(upright)'; "
            "allowed: a condition there, such as time_of(x > 0)",
        ),
        (
            "time_of(ended)", "max(outside(zmp_x))",
            "19:23: measures.time_of_fall_s: found 'outside(zmp_x)', whose bounds are not known; "
            "allowed: outside(x, low, high)",
        ),
        (
            "time_of(ended)", "max(zmp_x) + max(load)",
            "19:19: measures.time_of_fall_s: found 'max(zmp_x) + max(load)', which joins m and N; "
            "allowed: the same on all sides",
        ),
        (
            "time_of(ended)", "1 m + max(position(torso, w))",
            "19:29: measures.time_of_fall_s: found the axis 'w'; allowed: x, y or z",
        ),
        (
            "until: upright <", "until: load <",
            "17:8: until: found 'load < 0.7', which joins N and a plain number; allowed: the same on all "
            "sides",
        ),
        (
            "until: upright < 0.7 or com_z < 0.6 * first(com_z)", "until: upright",
            "17:8: until: found 'upright'; allowed: a condition, such as height < 0.2 m",
        ),
        (
            "time_of_fall_s: time_of(ended)", "survived: max(abs(zmp_y))",
            "19:13: measures.survived: found 'max(abs(zmp_y))', a number; allowed: a condition, such as "
            "max(speed) < 2 m/s",
        ),
        (
            "seed: 0", "  - actuator: {strength: 0 %, start: 50 s}",
            "16:38: disturbances[4].actuator.start: found 50 s, and the run ends at 4 s; allowed: a start "
            "before the end; or a longer duration of the run",
        ),
    ],
)  # fmt: skip
def test_a_complaint_about_the_run(tmp_path, old, new, said):
    assert refused(tmp_path, old, new) == f"mine.yaml:{said}"


@pytest.mark.parametrize(
    ("old", "new", "begins", "ends"),
    [
        (
            "body: torso", "body: belly",
            "8:13: disturbances[0].push.body: unknown body 'belly'; allowed: torso, left_foot, right_foot, "
            "Neck, ",
            " more",
        ),
        (
            "channel: LFsrFL", "channel: LFsrXL",
            "13:22: disturbances[1].fault.channel: unknown channel 'LFsrXL'; allowed: zmp_x, zmp_y, ",
            " more; did you mean 'LFsrFL'?",
        ),
        (
            "seed: 0", "  - actuator: {actuator: LKnee, strength: 0 %}",
            "16:26: disturbances[4].actuator.actuator: unknown actuator 'LKnee'; allowed: HeadYaw, ",
            "; did you mean 'LKneePitch'?",
        ),
        (
            "seed: 0", "  - actuator: {actuator: LKnee, strength: 0 %, start: 1 s}",
            "16:26: disturbances[4].actuator.actuator: unknown actuator 'LKnee'; allowed: HeadYaw, ",
            "; did you mean 'LKneePitch'?",
        ),
        (
            "seed: 0", "  - body: {body: r_hand, payload: 0.3 kg}",
            "16:18: disturbances[4].body.body: unknown body 'r_hand'; allowed: torso, ",
            "; did you mean 'r_ankle'?",
        ),
        (
            "seed: 0", "  - delay: {command: ankle, by: 10 ms}",
            "16:22: disturbances[4].delay.command: unknown command 'ankle'; allowed: ankle_roll, "
            "ankle_pitch, ",
            "; did you mean 'ankle_roll'?",
        ),
        (
            "time_of(ended)", "2 * max(position(ball, x))",
            "19:27: measures.time_of_fall_s: the MJCF has no body or site or geom or camera 'ball'; "
            "allowed: world, ",
            " more",
        ),
        (
            "com_z < 0.6", "distance(torso, ball) < 1 m",
            "17:25: until: the MJCF has no body or site or geom or camera 'ball'; allowed: world, ",
            " more",
        ),
        (
            "* first(com_z)", "* first(comz)",
            "17:45: until: unknown name 'comz'; allowed: ", " more; did you mean 'com_z'?",
        ),
        ("seed: 0", "silenced: [q1 -> p3]", "16:11: silenced: found 'q1 -> p3': no connection in "
            "", "'q1 -> p1'?"),
        (
            "seed: 0", "connect: {inputs: {zmp: com_y}}",
            "16:25: connect.inputs.zmp: the circuit has no input 'zmp'; ", "did you mean 'zmp_y'?",
        ),
        (
            "seed: 0", "connect: {inputs: {zmp_y: comy}}",
            "16:27: connect.inputs.zmp_y: the robot has no channel 'comy'; allowed: "
            "", "did you mean 'com_y'?",
        ),
        (
            "seed: 0", "connect: {outputs: {ankle_roll: ankle_rol}}",
            "16:33: connect.outputs.ankle_roll: the robot has no command 'ankle_rol'; allowed: ankle_roll, ",
            "did you mean 'ankle_roll'?",
        ),
        (
            "seed: 0", "control_step: 3 ms",
            "16:15: control_step: found a control step of 3 ms; allowed: a multiple of the model's time "
            "step of 2 ms",
            "; or set timestep: 1.5 ms in the robot file",
        ),
        (
            "circuit: binn_lateral", "controller: circuit",
            "4:13: controller: the scenario 'mine' names no circuit", "; allowed: circuit: NAME in its file",
        ),
        (
            "seed: 0", "controller: open_lop",
            "16:13: controller: unknown controller 'open_lop'; allowed: open_loop, circuit, ",
            "did you mean 'open_loop'?",
        ),
        ("robot: nao", "robot: noa", "2:8: robot: unknown robot (a path to a robot.yaml is "
            "", "did you mean 'nao'?"),
    ],
)  # fmt: skip
def test_a_complaint_about_the_run_lists_what_there_is(tmp_path, old, new, begins, ends):
    said = refused(tmp_path, old, new)
    assert said.startswith(f"mine.yaml:{begins}")
    assert said.endswith(ends)
    assert "\n" not in said


def test_without_a_reference_and_a_circuit_there_must_be_a_control_step(tmp_path):
    said = refused(
        tmp_path, "reference: {gait: gait_march}\ncircuit: binn_lateral\n", "controller: open_loop\n"
    )
    assert said == (
        "mine.yaml:1:1: control_step: missing key 'control_step'; "
        "required where neither a reference nor a circuit has one"
    )


def refused(tmp_path, old, new):
    """What is said of a scenario that is read, but cannot be run."""
    assert old in TEXT
    path = written(tmp_path, TEXT.replace(old, new))
    loaded = load_scenario(path)
    with pytest.raises(InputError) as caught:
        ready(make_plan(loaded))
    return str(caught.value).replace(str(path), "mine.yaml")


def ready(plan):
    """Make everything that a run needs."""
    plan.setup(plan.controller(), [plan.own_spec()])


def test_an_unknown_scenario():
    with pytest.raises(InputError) as caught:
        load_scenario("nao_pusch")
    said = str(caught.value)
    assert said.startswith(
        "nao_pusch:1:1: unknown name 'nao_pusch'; allowed: a path, or one of the shipped sims: "
    )
    assert said.endswith("; did you mean 'nao_push'?")


def test_relative_files_are_looked_for_beside_the_scenario(tmp_path):
    (tmp_path / "my_gait.yaml").write_text("", encoding="utf-8")
    found = load_scenario(written(tmp_path))
    assert found.file("my_gait.yaml") == str(tmp_path / "my_gait.yaml")
    assert found.file("other_gait.yaml") == "other_gait.yaml"
    assert found.file("gait_march") == "gait_march"
    assert found.file("/somewhere/gait.yaml") == "/somewhere/gait.yaml"


FORM = "FORCE,DURATION,DIRECTION such as 20N,200ms,left"
DIRECTIONS = f"{WAYS}, or an angle such as '15 deg'"


# --- --push -------------------------------------------------------------------------------------------------


def test_a_push_as_text_changes_force_duration_and_direction_only():
    pushed = load_scenario("nao_push")
    push = parse_push(" 17.5 N, 150 ms ,outward", pushed)
    assert push.force == 17.5
    assert push.duration == pytest.approx(0.15)
    assert push.direction == "outward"
    assert (push.body, push.start) == (pushed.pushes[0].body, pushed.pushes[0].start)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("20N", f"found '20N'; allowed: {FORM}"),
        ("20N,200ms,inward,3", f"found '20N,200ms,inward,3'; allowed: {FORM}"),
        ("20,200ms,inward", "force: found '20'; allowed: more than 0, in a unit like N"),
        ("20kg,200ms,inward", "force: found '20kg'; allowed: more than 0, in a unit like N"),
        ("-20N,200ms,inward", "force: found '-20N'; allowed: more than 0, in a unit like N"),
        ("20N,0s,inward", "duration: found '0s'; allowed: more than 0, in a unit like s"),
        ("20N,200ms,up2", f"direction: unknown direction 'up2'; allowed: {DIRECTIONS}"),
    ],
)  # fmt: skip
def test_a_bad_push(text, said):
    with pytest.raises(InputError) as caught:
        parse_push(text, load_scenario("nao_push"))
    assert str(caught.value) == f"--push: {said}"


@pytest.mark.parametrize(
    "text", ["20Nm x,200ms,inward", "nanN,200ms,inward", ",200ms,inward", "twentyN,1s,left"]
)
def test_a_push_that_is_no_quantity_names_the_part(text):
    with pytest.raises(InputError, match=r"^--push: force: .*allowed"):
        parse_push(text, load_scenario("nao_push"))


def test_without_a_push_there_is_none_to_change():
    with pytest.raises(InputError) as caught:
        parse_push("20N,200ms,inward", scenario())
    assert str(caught.value) == (
        "--push: the scenario 'nao_push' has no push to change; allowed: a scenario with a push"
    )


@pytest.mark.parametrize(
    ("height", "allowed"), [("3 m", "at most 2 m"), ("-2001 mm", "at least -2000 mm"), ("50 km", "at most ")]
)
def test_a_push_acts_at_the_robot(tmp_path, height, allowed):
    told = complaints(tmp_path, "direction: inward", f"direction: inward\n      height: {height}")
    assert f"disturbances[0].push.height: found '{height}'; allowed: {allowed}" in told


@pytest.mark.parametrize("angle", ["400 deg", "-361 deg", "7 rad"])
def test_an_angle_goes_once_round_at_most(tmp_path, angle):
    told = complaints(tmp_path, "direction: inward", f"direction: {angle}")
    assert (
        f"disturbances[0].push.direction: found '{angle}'; allowed: an angle from -360 deg to 360 deg" in told
    )
    with pytest.raises(InputError, match="--push: direction: found '400 deg'; allowed: an angle from"):
        parse_push("20N,200ms,400 deg", load_scenario("nao_push"))


def test_the_ends_are_allowed(tmp_path):
    text = TEXT.replace("direction: inward", "direction: -360 deg\n      height: -2 m")
    (push,) = load_scenario(written(tmp_path, text)).pushes
    assert (push.direction, push.height) == ("-360 deg", -2.0)
