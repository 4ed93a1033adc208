"""The walking pattern by forward kinematics in MuJoCo, and by the symmetries of a walk."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from walking import GAITS, NAO_LEG_JOINTS, bare_nao

from circuitkit.base.errors import SimulationError
from circuitkit.biped.gait import LEG_JOINTS, SIDES, LegGeometry, Schedule, load_gait, plan_walk
from circuitkit.biped.gait.pattern import joint_angles
from circuitkit.robots import load_robot

LEGS = load_robot("nao").biped.legs.geometry()
DT = 0.01


def one_posture(feet_x, lift):
    """A time plan of one tick."""
    nothing, zero = np.zeros(1, dtype=int), np.zeros(1)
    return Schedule(
        nothing, nothing, nothing, zero, np.array([feet_x]), np.array([lift]), np.zeros((1, 2)), zero
    )


def stand_in_mujoco(walk, tick=0):
    """The NAO with its torso upright over the pelvis and the walk's joint angles."""
    model = bare_nao()
    data = mujoco.MjData(model)
    data.qpos[:3] = walk.pelvis_m[tick] + [0.0, 0.0, LEGS.hip_offset_z_m]
    data.qpos[3:7] = [1.0, 0.0, 0.0, 0.0]
    for name, angle in zip(NAO_LEG_JOINTS, walk.joints_rad[tick], strict=True):
        data.joint(name).qpos = angle
    mujoco.mj_kinematics(model, data)
    return data


@given(
    knee_deg=st.floats(15, 60),
    pelvis=st.tuples(st.floats(-0.03, 0.03), st.floats(-0.06, 0.06)),
    feet_x=st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)),
    lift=st.tuples(st.floats(0, 0.03), st.floats(0, 0.03)),
)
def test_any_posture_stands_on_flat_feet_under_an_upright_torso(knee_deg, pelvis, feet_x, lift):
    """Soles parallel to the ground and dz above it, feet ahead as asked for, hips above as the pelvis says.

    A lifted leg is shorter and leans as much as the other, so by eq. 9 its foot is dz tan(roll) further out.
    """
    gait = load_gait("gait_march").model_copy(update={"knee": math.radians(knee_deg)})
    straight = math.sqrt(0.1**2 + 0.1029**2 + 2 * 0.1 * 0.1029 * math.cos(gait.knee))
    roll = math.asin(pelvis[1] / straight)
    ahead = max(abs(x - pelvis[0]) for x in feet_x)
    assume(math.hypot(ahead, straight) < 0.2028)

    walk = joint_angles(gait, one_posture(feet_x, lift), np.array([pelvis]), LEGS)
    data = stand_in_mujoco(walk)
    for side, (name, sign) in enumerate((("l_ankle", 1), ("r_ankle", -1))):
        np.testing.assert_allclose(data.body(name).xmat, np.eye(3).ravel(), atol=1e-9)
        sideways = sign * 0.05 + lift[side] * math.tan(roll)
        expected = [feet_x[side], sideways, 0.04519 + lift[side]]
        np.testing.assert_allclose(data.body(name).xpos, expected, atol=1e-7)
    hips = (data.body("LThigh").xpos + data.body("RThigh").xpos) / 2
    np.testing.assert_allclose(hips[:2], pelvis, atol=1e-12)
    assert hips[2] == pytest.approx(0.04519 + straight * math.cos(roll), abs=1e-9)


def test_the_soles_touch_the_ground_with_their_whole_face():
    walk = joint_angles(load_gait("gait_march"), one_posture((0, 0), (0, 0.01)), np.zeros((1, 2)), LEGS)
    data = stand_in_mujoco(walk)
    model = bare_nao()
    for name, height in (("l_sole", 0.0), ("r_sole", 0.01)):
        bottom = data.geom(name).xpos[2] - model.geom(name).size[2]
        assert bottom == pytest.approx(height, abs=1e-9)


def test_joints_are_named_by_side_and_place():
    assert LEG_JOINTS[:2] == ("left_hip_roll", "left_hip_pitch")
    assert LEG_JOINTS[5:] == tuple(name.replace("left", "right") for name in LEG_JOINTS[:5])
    assert SIDES == ("left", "right")


def test_a_walk_that_the_legs_cannot_do_is_refused():
    gait = load_gait("gait_walk_4cm").model_copy(update={"step_length": 0.5})
    with pytest.raises(SimulationError, match=r"bend the knee more or step shorter$"):
        plan_walk(gait, LEGS, 400)


# --- a walk of a point mass ---------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=GAITS)
def walk(request):
    """Fourteen seconds: standing, then 23 steps."""
    return plan_walk(load_gait(request.param), LEGS, 1400)[0]


LEAD = 100 + 4 * 55  # ticks before the repeating part
CYCLE = 110


def mirrored(joints):
    """Left and right change places, rolls change their sign."""
    other = np.concatenate([joints[:, 5:], joints[:, :5]], axis=1)
    return other * np.array([-1, 1, 1, 1, -1] * 2)


def test_a_walk_has_as_many_ticks_as_asked_for(walk):
    assert walk.ticks == 1400
    assert walk.joints_rad.shape == (1400, 10)
    assert walk.pelvis_m.shape == (1400, 3)
    assert all(len(getattr(walk.schedule, name)) == 1400 for name in Schedule.__dataclass_fields__)


def test_a_longer_walk_begins_as_a_shorter_one(walk):
    short = plan_walk(walk.gait, LEGS, 130)[0]
    np.testing.assert_array_equal(short.joints_rad, walk.joints_rad[:130])
    np.testing.assert_array_equal(short.schedule.zmp_m, walk.schedule.zmp_m[:130])


def test_a_walk_repeats_itself_every_two_steps(walk):
    first, second = slice(LEAD, -CYCLE), slice(LEAD + CYCLE, None)
    np.testing.assert_allclose(walk.joints_rad[second], walk.joints_rad[first], atol=1e-12)
    way = 2 * walk.gait.step_length
    np.testing.assert_allclose(walk.pelvis_m[second] - walk.pelvis_m[first], [[way, 0, 0]] * 970, atol=1e-12)
    np.testing.assert_array_equal(walk.schedule.step[second], walk.schedule.step[first] + 2)
    feet = walk.schedule.feet_x_m
    np.testing.assert_allclose(feet[second] - feet[first], way, atol=1e-12)


def test_half_a_cycle_later_a_walk_is_its_mirror_image(walk):
    now, later = slice(LEAD, -55), slice(LEAD + 55, None)
    np.testing.assert_allclose(walk.joints_rad[later], mirrored(walk.joints_rad[now]), atol=1e-5)
    step = walk.pelvis_m[later] - walk.pelvis_m[now] * [1, -1, 1]
    np.testing.assert_allclose(step, [[walk.gait.step_length, 0, 0]] * len(step), atol=1e-6)


def test_the_point_mass_has_its_zmp_on_the_reference_even_where_the_walk_repeats(walk):
    """Eq. 2 with second differences of the pelvis, which is where the point mass is."""
    p = walk.pelvis_m[:, :2]
    acceleration = (p[2:] - 2 * p[1:-1] + p[:-2]) / DT**2
    zmp = p[1:-1] - walk.gait.com_height / 9.81 * acceleration
    np.testing.assert_allclose(zmp, walk.schedule.zmp_m[1:-1], atol=1e-4)


def test_a_walk_advances_at_constant_speed_on_average(walk):
    pelvis = walk.pelvis_m[LEAD::CYCLE, 0]
    np.testing.assert_allclose(np.diff(pelvis), 2 * walk.gait.step_length, atol=1e-12)


def test_what_the_whole_body_misses_goes_back_into_the_motion(walk):
    """A body whose ZMP moves by three quarters of the point mass's, and elsewhere, ends on the reference."""
    gait, offset = walk.gait, np.array([0.005, 0.001])

    def body(found):
        p = found.pelvis_m[:, :2]
        acceleration = np.zeros_like(p)
        acceleration[1:-1] = (p[2:] - 2 * p[1:-1] + p[:-2]) / DT**2
        return 0.75 * (p - 0.27 / 9.81 * acceleration) + 0.25 * found.schedule.zmp_m + offset

    corrected, _ = plan_walk(gait, LEGS, 700, body)
    missed = body(corrected) - corrected.schedule.zmp_m
    np.testing.assert_allclose(missed[LEAD:-1], 0.0, atol=3e-4)


def test_what_is_worked_out_along_a_walk_repeats_with_it(walk):
    _, torques = plan_walk(walk.gait, LEGS, 1400, then=lambda found: found.joints_rad[:, :3] * 2)
    np.testing.assert_array_equal(torques, walk.joints_rad[:, :3] * 2)
    assert plan_walk(walk.gait, LEGS, 10)[1].shape == (10, 0)


def test_legs_come_in_as_data():
    """A robot twice as large sways with the same ZMP and bends its joints less."""
    gait = load_gait("gait_march")
    big = LegGeometry(*(2 * length for length in (0.1, 0.1029, 0.04519, 0.05, 0.085)))
    small, large = plan_walk(gait, LEGS, 400)[0], plan_walk(gait, big, 400)[0]
    np.testing.assert_allclose(large.pelvis_m[:, :2], small.pelvis_m[:, :2], atol=1e-12)
    rolls = [0, 4, 5, 9]
    np.testing.assert_allclose(
        2 * np.sin(large.joints_rad[:, rolls]), np.sin(small.joints_rad[:, rolls]), atol=1e-12
    )
