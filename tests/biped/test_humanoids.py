"""Robots of human size that are no NAO: turned frames, canted hips, stops, legs out of reach, soft servos."""

from __future__ import annotations

import logging
import re
from dataclasses import replace

import numpy as np
import pytest
from biped.humanoid import Humanoid, turned, write_gait

from circuitkit.base.errors import InputError
from circuitkit.biped.robot import biped_of
from circuitkit.robots import build_model, load_robot
from circuitkit.simulation import load_scenario, simulate
from circuitkit.simulation.plan import make_plan

FLIPPED = (
    "left_hip_pitch", "right_hip_roll", "right_knee_pitch", "left_ankle_roll", "right_ankle_pitch",
    "left_hip_yaw",
)  # fmt: skip
_SLANT = 0.5**0.5
# Yaw and roll cross between forward and up, as those of the Berkeley Humanoid do.
CANTED = {
    f"{side}_hip_{kind}": axis
    for side in ("left", "right")
    for kind, axis in (("yaw", (_SLANT, 0.0, _SLANT)), ("roll", (-_SLANT, 0.0, _SLANT)))
}
HARD = Humanoid(
    hips=("yaw", "pitch", "roll"), flipped=FLIPPED, hip_ahead=-0.05, hip_aside=0.12, bent=0.35,
    sole="parts", frame=turned((0.6, 0.0, 0.8), 0.5),
)  # fmt: skip


def scenario_of(folder, humanoid, duration_s=10.0, **gait):
    """The robot on its walk."""
    humanoid.write(folder)
    write_gait(folder, **gait)
    path = folder / "walk.yaml"
    path.write_text(
        f"scenario: walk\nrobot: robot.yaml\nreference: {{gait: gait.yaml}}\nduration: {duration_s} s\n"
        "until: upright < 0.7 or com_z < 0.6 * first(com_z)\n"
        "measures:\n  x: last(position(trunk, x))\n  y: last(position(trunk, y))\n"
        "  start: first(position(trunk, x))\n  lean: max(abs(tilt_y))\n",
        encoding="utf-8",
    )
    return path


# --- frames -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "frame",
    [
        turned((0, 0, 1), np.pi / 2),
        turned((0, 0, 1), np.pi),
        turned((1, 0, 0), np.pi / 2),
        turned((3, 1, 2), 2.0),
    ],
    ids=["faces left", "faces back", "lies", "any"],
)
def test_a_trunk_in_a_frame_of_its_own_is_upright_as_it_stands_in_the_mjcf(tmp_path, frame):
    """The plan is that of the same body whose frame is the world's, and so are tilt and gyro."""
    found, wanted = [], []
    for name, given, into in (("turned", frame, found), ("plain", turned((0, 0, 1), 0.0), wanted)):
        plan = make_plan(load_scenario(scenario_of(tmp_path / name, Humanoid(frame=given), 3.0)))
        into += [biped_of(plan.robot), plan.body.motion.targets]
        result = simulate(tmp_path / name / "walk.yaml")
        into += [result.recording]
    assert found[0].block.legs.hip_offset_x == pytest.approx(wanted[0].block.legs.hip_offset_x, abs=1e-6)
    np.testing.assert_allclose(found[1], wanted[1], atol=1e-5)
    for channel in ("upright", "tilt_x", "tilt_y", "gyro_x", "gyro_y", "gyro_z", "acceleration_z"):
        ours, theirs = (each[2].channel(channel)[50, 0] for each in (found, wanted))
        assert ours == pytest.approx(theirs, abs=2e-2), channel
    assert found[2].channel("upright")[:, 0].min() > 0.99


def test_a_start_that_leans_does_not_make_the_walk_lean(tmp_path):
    """An MJCF that starts two degrees out of the upright has its trunk's frame for upright all the same."""
    humanoid = Humanoid()
    path = humanoid.write(tmp_path)
    mjcf = tmp_path / "humanoid.xml"
    leaning = " ".join(f"{value:.9g}" for value in turned((0, 1, 0), np.radians(2)))
    text = mjcf.read_text(encoding="utf-8")
    assert text.count('quat="1 0 0 0">\n      <freejoint/>') == 1
    changed = text.replace('quat="1 0 0 0">\n      <freejoint/>', f'quat="{leaning}">\n      <freejoint/>')
    mjcf.write_text(changed, encoding="utf-8")
    np.testing.assert_array_equal(biped_of(build_model(load_robot(path))).upright, [1.0, 0.0, 0.0, 0.0])


# --- walks --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("humanoid", "sideways_mm"),
    [(HARD, 120.0), (Humanoid(hips=("yaw", "roll", "pitch"), axes=CANTED), 90.0)],
    ids=["hard", "canted"],
)
def test_it_walks_straight_on(tmp_path, humanoid, sideways_mm):
    """16 steps of 60 mm, but for the first and last, within a tenth; a hand's breadth to the side at most."""
    measures = simulate(scenario_of(tmp_path, humanoid, sideways_mm=sideways_mm)).measures
    assert measures["x"] - measures["start"] == pytest.approx(0.06 * 9.0 / 0.55, rel=0.1)
    assert abs(measures["y"]) < 0.05
    assert measures["lean"] < np.radians(4)


# --- what is only there for the mathematics -----------------------------------------------------------------


def test_stops_count_where_the_robot_walks_and_not_where_the_computed_walk_ends(tmp_path):
    """The computed walk ends at rest over one foot, 5 degrees to the side; the robot never goes there."""
    narrow = Humanoid(ranges={"hip_roll": (-0.04, 0.04), "ankle_roll": (-0.04, 0.04)})
    plan = make_plan(load_scenario(scenario_of(tmp_path, narrow, 6.0)))
    body = biped_of(plan.robot)
    rolls = [i for i, role in enumerate(body.block.roles) if role.endswith("roll")]
    angles = plan.body.motion.knowledge.walk.joints_rad[:, body.leg_column[rolls]]
    assert 0.02 < np.abs(angles).max() < 0.04 + 0.03


def test_a_straight_leg_that_is_a_millimetre_short_is_as_near_as_it_can_be(tmp_path):
    """The file says that the thigh is 5 mm longer than it is; steps from a straight leg go anywhere."""
    path = scenario_of(
        tmp_path, Humanoid(hips=("yaw", "roll", "pitch"), axes=CANTED), 6.0, single_support_ms=600
    )
    robot, gait = tmp_path / "robot.yaml", tmp_path / "gait.yaml"
    lengths = "  torso: trunk\n  legs: {thigh: 425 mm}\n"
    robot.write_text(robot.read_text(encoding="utf-8").replace("  torso: trunk\n", lengths), encoding="utf-8")
    straight = gait.read_text(encoding="utf-8").replace("knee: 25 deg", "knee: 15 deg")
    gait.write_text(straight, encoding="utf-8")
    plan = make_plan(load_scenario(path))
    targets = np.diff(plan.body.motion.knowledge.walk.joints_rad, axis=0)
    assert np.abs(targets).max() < np.radians(5)


# --- what is said -------------------------------------------------------------------------------------------


def said(tmp_path, caplog, humanoid):
    """What is said of a robot when it is compiled, without the folder."""
    path = humanoid.write(tmp_path)
    with caplog.at_level(logging.WARNING, "circuitkit"):
        build_model(load_robot(path))
    return caplog.text.replace(f"{tmp_path}/", "")


def test_a_sound_robot_is_not_warned_of(tmp_path, caplog):
    assert said(tmp_path, caplog, HARD) == ""


def test_ankles_softer_than_the_body_falls_are_warned_of(tmp_path, caplog):
    text = said(tmp_path, caplog, Humanoid(stiffness=0.9))
    found = "biped.joints.left_ankle_pitch: the servo of 'left_ankle_pitch' has 574.8 N*m/rad"
    assert f"robot.yaml:13:23: {found}, and the body falls over this ankle with m g h = " in text
    assert "walking takes 5 to 10 times that" in text
    assert text.count("m g h") == 1


def under(x, y, z):
    """A humanoid in a world of this gravity."""
    return Humanoid(option=f'timestep="0.002" integrator="implicitfast" gravity="{x} {y} {z}"')


@pytest.mark.parametrize("gravity", [(0, 0, 0), (0, 0, 9.81), (9.81, 0, 0)])
def test_gravity_that_does_not_press_on_the_ground_is_refused(tmp_path, gravity):
    with pytest.raises(InputError) as caught:
        build_model(load_robot(under(*gravity).write(tmp_path)))
    found = "biped: the MJCF's gravity is {:g} {:g} {:g} m/s^2; allowed: gravity along -z".format(*gravity)
    assert found in str(caught.value)


PLANE = '<geom type="plane" size="0 0 1" {}/>'
EXCLUDED = "".join(f'<exclude body1="world" body2="{side}_foot"/>' for side in ("left", "right"))


@pytest.mark.parametrize(
    ("humanoid", "found"),
    [
        (Humanoid(floor=""), "there is no ground under the robot"),
        (Humanoid(floor=PLANE.format('contype="4" conaffinity="2"')), "it falls through the ground"),
        (Humanoid(floor=f"{PLANE.format('')}</worldbody><contact>{EXCLUDED}</contact><worldbody>"),
            "it falls through the ground"),
        (Humanoid(option='timestep="0.002"><flag contact="disable"/></option><option'),
            "it falls through the ground"),
        (Humanoid(option='timestep="0.002"><flag constraint="disable"/></option><option'),
            "it falls through the ground"),
        (Humanoid(option='timestep="0.002"><flag gravity="disable"/></option><option'),
            "the MJCF's gravity is 0 0 0 m/s^2"),
    ],
)  # fmt: skip
def test_a_biped_that_nothing_carries_is_refused(tmp_path, humanoid, found):
    """It would fall for ever, upright, or float."""
    with pytest.raises(InputError, match=re.escape(found)):
        build_model(load_robot(humanoid.write(tmp_path)))


@pytest.mark.parametrize("height_m", [-1.0, 0.4])
def test_where_the_floor_is_changes_nothing(tmp_path, height_m):
    def outcome(floor):
        folder = tmp_path / str(len(floor))
        return simulate(load_scenario(scenario_of(folder, Humanoid(floor=floor), 2.0)))

    there, here = outcome(PLANE.format(f'pos="0 0 {height_m}"')), outcome(PLANE.format(""))
    assert there.measures["lean"] == pytest.approx(here.measures["lean"], rel=0.05)
    heights = [each.recording.channel("com_z").ravel() for each in (there, here)]
    np.testing.assert_allclose(heights[0], heights[1], atol=2e-4)


def test_another_gravity_than_that_of_plans_is_warned_of(tmp_path, caplog):
    """On the moon; at the poles and the equator it is 9.83 and 9.78 m/s^2."""
    assert said(tmp_path, caplog, under(0, 0, -9.78)) == ""
    text = said(tmp_path, caplog, under(0, 0, -1.62))
    assert "gravity is 0 0 -1.62 m/s^2; gaits and the controllers of bipeds are worked out for 9.81" in text


def test_a_sole_that_is_drawn_tilted_is_warned_of_and_level_with_the_offset_that_is_said(tmp_path, caplog):
    """Ten degrees toes up, as the feet of the Berkeley Humanoid: the ankle must turn them down again."""

    class Tilted(Humanoid):
        def _sole(self):
            quat = " ".join(f"{value:.9g}" for value in turned((0, 1, 0), np.radians(-10)))
            return super()._sole().replace('<geom type="box"', f'<geom type="box" quat="{quat}"')

    text = said(tmp_path, caplog, Tilted(flipped=("left_ankle_pitch",)))
    tilted = "the sole of '{0}_foot' is tilted by 10.0 deg when the leg is straight; it is level with "
    for side, offset in (("left", "-10.0"), ("right", "10.0")):
        found = tilted.format(side) + f"{{joint: {side}_ankle_pitch, offset: {offset} deg}}"
        assert f"biped.joints.{side}_ankle_pitch: {found}" in text
    file = tmp_path / "robot.yaml"
    for side, offset in (("left", "-10"), ("right", "10")):
        given = f"{side}_ankle_pitch, offset: "
        changed = file.read_text(encoding="utf-8").replace(f"{given}-0 rad", f"{given}{offset} deg")
        file.write_text(changed.replace(f"{given}0 rad", f"{given}{offset} deg"), encoding="utf-8")
    caplog.clear()
    legs = biped_of(build_model(load_robot(file))).block.legs
    assert caplog.text == ""
    lean = np.radians(10)
    assert legs.ankle_height == pytest.approx(0.065 * np.cos(lean) + 0.05 * np.sin(lean) + 0.015, abs=1e-5)


def test_damping_that_eulers_method_does_not_bear_is_warned_of(tmp_path, caplog):
    """And the warning's two ways out are ones: steps that short, or an implicit method, walk."""
    euler = Humanoid(option='timestep="0.002" integrator="Euler"')
    text = said(tmp_path / "shakes", caplog, euler).replace("shakes/", "")
    assert "robot.yaml:4:5: servos[0]: the servo of 'right_ankle_roll' shakes" in text
    assert (
        "Euler's method in steps of 2 ms does not bear a damping of 51.0905 and a stiffness of 5109.05"
        in text
    )
    assert "allowed: integrator: implicitfast in the robot file, timestep: 0.5 ms, or less damping" in text
    assert simulate(scenario_of(tmp_path / "shakes", euler)).recording.ended_s() is not None
    caplog.clear()
    for more in ("integrator: implicitfast\n", "timestep: 0.5 ms\n"):
        mended = replace(euler, more=more)
        assert said(tmp_path / "mended", caplog, mended) == ""
        assert simulate(scenario_of(tmp_path / "mended", mended)).survived
