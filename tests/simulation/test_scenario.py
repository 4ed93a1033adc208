"""The scenario file and the text of a push: what they say, and every complaint word for word."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml
from walking import scenario

from circuitkit.base.errors import InputError
from circuitkit.base.source import data_files
from circuitkit.robots import Payload, Plant
from circuitkit.simulation import load_scenario, parse_push

SHIPPED = Path(data_files.data_folder("sims")) / "nao_push.yaml"
TEXT = """\
scenario: mine
robot: nao
gait: gait_march
circuit: binn_lateral
duration: 4 s
pushes:
  - body: torso
    force: 20 N
    direction: inward
    duration: 200 ms
    start: {step: 1, phase: lift, at: 20 %}
faults:
  - {cell: LFsrFL, reading: missing, start: 1 s, duration: 100 ms}
seed: 0
sensor_noise: {force_cells: 0.2 N}
jitter: {push_start: 20 ms, base_velocity: 1 cm/s}
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
    push, fault = found.pushes[0], found.faults[0]
    assert (found.duration, found.seed, found.controller) == (4.0, 0, "circuit")
    assert (push.force, push.duration, push.start.at) == pytest.approx((20.0, 0.2, 0.2))
    assert (fault.start, fault.duration) == pytest.approx((1.0, 0.1))
    assert found.sensor_noise.force_cells == pytest.approx(0.2)
    assert (found.jitter.push_start, found.jitter.base_velocity) == pytest.approx((0.02, 0.01))


def test_a_plant_is_read_in_si_units(tmp_path):
    plant = """\
sensor_delay: 20 ms
plant:
  friction: 0.4
  mass: 110 %
  payload: {body: r_wrist, mass: 300 g}
  servo_stiffness: 70 %
  slope: {forward: 3 deg, left: -1 deg}
"""
    found = load_scenario(written(tmp_path, TEXT + plant))
    assert found.sensor_delay == pytest.approx(0.02)
    assert (found.plant.friction, found.plant.mass, found.plant.servo_stiffness) == pytest.approx(
        (0.4, 1.1, 0.7)
    )
    assert found.plant.payload == Payload(body="r_wrist", mass="0.3 kg")
    assert found.plant.slope.forward == pytest.approx(math.radians(3))
    assert found.plant.slope.left == pytest.approx(math.radians(-1))


def test_a_fault_without_times_lasts_for_the_whole_run(tmp_path):
    text = TEXT.replace("reading: missing, start: 1 s, duration: 100 ms", "reading: zero")
    (found,) = load_scenario(written(tmp_path, text)).faults
    assert (found.start, found.duration) == (0.0, None)


def test_a_push_may_have_an_angle_and_a_height(tmp_path):
    text = TEXT.replace("direction: inward", "direction: -15 deg\n    height: 50 mm")
    (push,) = load_scenario(written(tmp_path, text)).pushes
    assert (push.direction, push.height) == ("-15 deg", pytest.approx(0.05))
    assert parse_push("20N,200ms,165deg", load_scenario("nao_push")).direction == "165deg"


def test_the_shipped_push_is_the_papers():
    """Section 5.2: 20 N for 0.2 s at the torso during the lift, to the side."""
    (push,) = load_scenario("nao_push").pushes
    assert (push.force, push.duration, push.start.phase) == (20.0, 0.2, "lift")
    assert push.direction in {"inward", "outward"}
    assert load_scenario(SHIPPED).pushes == (push,)


def test_what_is_absent_does_not_happen(tmp_path):
    data = yaml.safe_load(TEXT)
    for key in ("pushes", "faults", "seed", "sensor_noise", "jitter"):
        del data[key]
    found = load_scenario(written(tmp_path, yaml.safe_dump(data)))
    assert found.pushes == found.faults == ()
    assert found.sensor_noise.force_cells == 0
    assert (found.jitter.push_start, found.jitter.base_velocity) == (0, 0)
    assert (found.plant, found.sensor_delay) == (Plant(), 0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "direction: inward", "direction: inwards",
            "mine.yaml:9:16: pushes[0].direction: unknown direction 'inwards'; allowed: forward, backward, "
            "left, right, inward, outward, or an angle such as '15 deg'; did you mean 'inward'?",
        ),
        (
            "direction: inward", "direction: 15",
            "mine.yaml:9:16: pushes[0].direction: unknown direction 15; allowed: forward, backward, "
            "left, right, inward, outward, or an angle such as '15 deg'",
        ),
        (
            "seed: 0", "plant: {mass: 0 %}",
            "mine.yaml:14:15: plant.mass: found '0 %'; allowed: more than 0 %",
        ),
        (
            "seed: 0", "plant: {slope: {forward: 45 deg}}",
            "mine.yaml:14:26: plant.slope.forward: found '45 deg'; allowed: at most 30 deg",
        ),
        (
            "seed: 0", "plant: {payload: {body: r_wrist, mass: 300}}",
            "mine.yaml:14:40: plant.payload.mass: found 300, which is dimensionless; "
            "allowed: a quantity such as '0.3 kg'",
        ),
        (
            "seed: 0", "sensor_delay: -20 ms",
            "mine.yaml:14:15: sensor_delay: found '-20 ms'; allowed: at least 0 ms",
        ),
        (
            "force: 20 N", "force: 20 kg",
            "mine.yaml:8:12: pushes[0].force: found '20 kg', which is mass; "
            "allowed: a quantity such as '20 N'",
        ),
        (
            "force: 20 N", "force: -20 N",
            "mine.yaml:8:12: pushes[0].force: found '-20 N'; allowed: at least 0 N",
        ),
        (
            "duration: 200 ms", "duration: 0 ms",
            "mine.yaml:10:15: pushes[0].duration: found '0 ms'; allowed: more than 0 ms",
        ),
        (
            "phase: lift", "phase: lifted",
            "mine.yaml:11:29: pushes[0].start.phase: found 'lifted'; allowed: transfer, lift, extend; "
            "did you mean 'lift'?",
        ),
        (
            "at: 20 %", "at: 120 %",
            "mine.yaml:11:39: pushes[0].start.at: found '120 %'; allowed: at most 100 %",
        ),
        (
            "step: 1,", "step: -1,",
            "mine.yaml:11:19: pushes[0].start.step: found -1; allowed: at least 0",
        ),
        (
            "reading: missing", "reading: broken",
            "mine.yaml:13:29: faults[0].reading: found 'broken'; allowed: missing, zero",
        ),
        (
            "start: 1 s, duration: 100 ms", "start: 5 s, duration: 100 ms",
            "mine.yaml:1:1: the fault of LFsrFL starts after the end; allowed: before 4 s",
        ),
        (
            "duration: 4 s", "duration: 2 h",
            "mine.yaml:5:11: duration: found '2 h'; allowed: at most 1 h",
        ),
        (
            "robot: nao\n", "",
            "mine.yaml:1:1: missing key 'robot'; "
            "required: scenario, robot, gait, circuit, duration, thresholds",
        ),
    ],
)  # fmt: skip
def test_a_complaint(tmp_path, old, new, said):
    assert complaints(tmp_path, old, new) == said


def test_every_wrong_value_is_reported_at_once(tmp_path):
    said = complaints(tmp_path, "    force: 20 N\n    direction: inward", "    force: 20\n    direction: up")
    assert [line.split(": ")[1] for line in said.splitlines()] == ["pushes[0].force", "pushes[0].direction"]


def test_an_unknown_scenario():
    with pytest.raises(InputError) as caught:
        load_scenario("nao_pusch")
    said = str(caught.value)
    assert said.startswith(
        "nao_pusch:1:1: unknown name 'nao_pusch'; allowed: a path, or one of the shipped sims: nao_push"
    )
    assert said.endswith("; did you mean 'nao_push'?")


def test_relative_files_are_looked_for_beside_the_scenario(tmp_path):
    (tmp_path / "my_gait.yaml").write_text("", encoding="utf-8")
    found = load_scenario(written(tmp_path))
    assert found.file("my_gait.yaml") == str(tmp_path / "my_gait.yaml")
    assert found.file("other_gait.yaml") == "other_gait.yaml"
    assert found.file("gait_march") == "gait_march"
    assert found.file("/somewhere/gait.yaml") == "/somewhere/gait.yaml"


FORM = "FORCE,DURATION,DIRECTION such as 20N,200ms,inward"
DIRECTIONS = "forward, backward, left, right, inward, outward, or an angle such as '15 deg'"


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
        ("20N,200ms,up", f"direction: unknown direction 'up'; allowed: {DIRECTIONS}"),
        ("20N,200ms,Inward",
         f"direction: unknown direction 'Inward'; allowed: {DIRECTIONS}; did you mean 'inward'?"),
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
    told = complaints(tmp_path, "direction: inward", f"direction: inward\n    height: {height}")
    assert f"pushes[0].height: found '{height}'; allowed: {allowed}" in told


@pytest.mark.parametrize("angle", ["400 deg", "-361 deg", "7 rad"])
def test_an_angle_goes_once_round_at_most(tmp_path, angle):
    told = complaints(tmp_path, "direction: inward", f"direction: {angle}")
    assert f"pushes[0].direction: found '{angle}'; allowed: an angle from -360 deg to 360 deg" in told
    with pytest.raises(InputError, match="--push: direction: found '400 deg'; allowed: an angle from"):
        parse_push("20N,200ms,400 deg", load_scenario("nao_push"))


def test_the_ends_are_allowed(tmp_path):
    text = TEXT.replace("direction: inward", "direction: -360 deg\n    height: -2 m")
    (push,) = load_scenario(written(tmp_path, text)).pushes
    assert (push.direction, push.height) == ("-360 deg", -2.0)
