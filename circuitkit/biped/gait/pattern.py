"""The walking pattern: the paper's leg equations, and joint angles whose CoM motion suits the real body.

The leg equations (3-10) work element by element on arrays of any shape. Angles follow the robot's joints:
pitch turns about y (positive bends the knee), roll about x. The sum of a leg's pitch angles is the pitch of
its foot as seen from the torso, so an upright torso has a sum of zero.

The order of things: plan_steps -> ZMP reference -> CoM of a point mass (eq. 2 solved for all ticks) -> joint
angles (eqs. 3-10) -> ZMP of the whole body along these angles, which a robot's model gives -> what it misses
goes back into the CoM motion, until nothing is missed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import SimulationError
from circuitkit.biped.gait.lipm import com_from_zmp
from circuitkit.biped.gait.schedule import GaitSpec, Schedule, plan_steps

Array = NDArray[np.float64]

SIDES = ("left", "right")
LEG_JOINTS = tuple(
    f"{side}_{joint}"
    for side in SIDES
    for joint in ("hip_roll", "hip_pitch", "knee_pitch", "ankle_pitch", "ankle_roll")
)
# Steps that are computed one by one at the start, then one pair that is repeated, then some that only see to
# it that the pair does not feel the end: what an end forces upon the CoM decays by exp(-omega * 0.55 s), to a
# 27th, in each step. Where the pair meets itself, a jump of 1 um moves the ZMP by 0.3 mm (z / (g dt^2)).
_LEAD_STEPS, _CYCLE_STEPS, _TAIL_STEPS = 4, 2, 5
_PASSES = 6
# A pelvis shift moves the CoM by three quarters of itself, since the legs stay behind: take the inverse.
_PELVIS_PER_COM = 1.3


@dataclass(frozen=True)
class LegGeometry:
    """Lengths of a leg and where it hangs, all in metres.

    Attributes:
        thigh_m: Hip to knee, l_H of eq. 4.
        tibia_m: Knee to ankle, l_K of eq. 4.
        ankle_height_m: Ankle above the sole.
        hip_offset_y_m: Hip from the middle of the body, also half the distance between the feet.
        hip_offset_z_m: Hip below the origin of the torso.
    """

    thigh_m: float
    tibia_m: float
    ankle_height_m: float
    hip_offset_y_m: float
    hip_offset_z_m: float


def support_leg_length(ankle_pitch: Array, knee_pitch: Array, legs: LegGeometry) -> Array:
    """L_sl = l_K cos(theta_ap) + l_H cos(theta_ap + theta_kp), in metres (eq. 4)."""
    return legs.tibia_m * np.cos(ankle_pitch) + legs.thigh_m * np.cos(ankle_pitch + knee_pitch)


def standing_leg_length(knee_rad: float, legs: LegGeometry) -> float:
    """Distance from hip to ankle with the knee bent, in metres; eq. 4 with the ankle under the hip."""
    thigh, tibia = legs.thigh_m, legs.tibia_m
    return float(np.sqrt(thigh**2 + tibia**2 + 2 * thigh * tibia * np.cos(knee_rad)))


def ankle_roll(com_shift_m: Array, support_leg_length_m: Array) -> Array:
    """theta_ar = asin(dy_CoM / L_sl), in radians (eq. 3).

    A shift to the left (+y) gives a positive angle: the foot turns about +x as seen from the leg.

    Raises:
        SimulationError: The shift is longer than the leg.
    """
    ratio = np.asarray(com_shift_m) / support_leg_length_m
    if np.any(np.abs(ratio) > 1.0):
        message = (
            f"eq. 3 has no solution: a shift of {np.abs(com_shift_m).max():.3f} m with a leg of "
            f"{np.min(support_leg_length_m):.3f} m; allowed: less than that; lower the sideways ZMP"
        )
        raise SimulationError(message)
    return np.arcsin(ratio)


def hip_roll(ankle_roll_rad: Array) -> Array:
    """theta_hr = -theta_ar, which keeps the torso vertical (eq. 5)."""
    return -ankle_roll_rad


def moving_leg_length(
    support_leg_length_m: Array, ankle_roll_rad: Array, hip_roll_rad: Array, lift_m: Array
) -> Array:
    """L_ml = (L_sl cos(theta_ar) - dz) / cos(theta_hr), in metres (eq. 9)."""
    return (support_leg_length_m * np.cos(ankle_roll_rad) - lift_m) / np.cos(hip_roll_rad)


def hip_pitch(
    moving_leg_length_m: Array,
    alpha: Array,
    torso_pitch: Array,
    legs: LegGeometry,
    thigh_back: NDArray[np.bool_] | bool = False,
) -> Array:
    """theta_hp = -arccos((L_ml - l_K cos(alpha - theta_tp)) / l_H) + theta_tp, in radians (eq. 6).

    Eq. 6 has the thigh in front of the vertical. A trailing leg can have it behind, which is the other sign
    of the arccosine.

    Args:
        moving_leg_length_m: L_ml.
        alpha: The sum of hip and knee pitch.
        torso_pitch: theta_tp.
        legs: The lengths.
        thigh_back: Where the knee is behind its hip.

    Raises:
        SimulationError: The leg cannot reach: it would have to be longer than it is.
    """
    cosine = (moving_leg_length_m - legs.tibia_m * np.cos(alpha - torso_pitch)) / legs.thigh_m
    if np.any(np.abs(cosine) > 1.0):
        message = (
            "eq. 6 has no solution: the leg is too short for this step; bend the knee more or step shorter"
        )
        raise SimulationError(message)
    angle = np.arccos(cosine)
    return np.where(thigh_back, angle, -angle) + torso_pitch


def knee_pitch(alpha: Array, hip_pitch_rad: Array) -> Array:
    """theta_kp = alpha - theta_hp, in radians (eq. 7)."""
    return alpha - hip_pitch_rad


def torso_pitch(hip_pitch_rad: Array, knee_pitch_rad: Array, ankle_pitch_rad: Array) -> Array:
    """theta_tp = theta_hp + theta_kp + theta_ap of the support leg, in radians (eq. 8)."""
    return hip_pitch_rad + knee_pitch_rad + ankle_pitch_rad


def ankle_pitch(torso_pitch_rad: Array, hip_pitch_rad: Array, knee_pitch_rad: Array) -> Array:
    """theta_ap = theta_tp - (theta_hp + theta_kp), which keeps the foot parallel to the ground (eq. 10)."""
    return torso_pitch_rad - (hip_pitch_rad + knee_pitch_rad)


def alpha_for_foot(forward_m: Array, leg_length_m: Array, torso_pitch_rad: Array, legs: LegGeometry) -> Array:
    """The paper's free parameter alpha that puts the foot `forward_m` ahead of its hip.

    Thigh and tibia, turned by phi_t and phi_k from the vertical, must reach the ankle:
    l_H cos(phi_t) + l_K cos(phi_k) = L and l_H sin(phi_t) + l_K sin(phi_k) = -x. Of the two solutions this is
    the one with the knee in front; alpha = phi_k + theta_tp.

    Args:
        forward_m: x, ankle ahead of the hip.
        leg_length_m: L, ankle below the hip within the leg's plane.
        torso_pitch_rad: theta_tp.
        legs: The lengths.

    Raises:
        SimulationError: The ankle is out of the leg's reach.
    """
    distance = np.hypot(forward_m, leg_length_m)
    if np.any(distance > legs.thigh_m + legs.tibia_m):
        message = (
            f"the foot is {distance.max():.3f} m from the hip, and the leg is "
            f"{legs.thigh_m + legs.tibia_m:.3f} m long; bend the knee more or step shorter"
        )
        raise SimulationError(message)
    cosine = (distance**2 + legs.tibia_m**2 - legs.thigh_m**2) / (2 * distance * legs.tibia_m)
    return -np.arctan2(forward_m, leg_length_m) + np.arccos(np.clip(cosine, -1.0, 1.0)) + torso_pitch_rad


def knee_is_behind(
    forward_m: Array, alpha: Array, torso_pitch_rad: Array, legs: LegGeometry
) -> NDArray[np.bool_]:
    """Where the knee stands behind its hip: x + l_K sin(alpha - theta_tp) < 0."""
    behind: NDArray[np.bool_] = forward_m + legs.tibia_m * np.sin(alpha - torso_pitch_rad) < 0
    return behind


@dataclass(frozen=True)
class Walk:
    """A walk as joint angles, T ticks.

    Attributes:
        gait: Its numbers.
        schedule: Its time plan.
        pelvis_m: Middle between the hips, from where the feet stood at first: forward, left, up; (T, 3).
        joints_rad: Angles of `LEG_JOINTS`; shape (T, 10).
    """

    gait: GaitSpec
    schedule: Schedule
    pelvis_m: Array
    joints_rad: Array

    @property
    def ticks(self) -> int:
        """T."""
        return len(self.joints_rad)

    def rows(self, which: slice) -> Walk:
        """Some ticks of it."""
        return Walk(self.gait, self.schedule.rows(which), self.pelvis_m[which], self.joints_rad[which])


def joint_angles(gait: GaitSpec, schedule: Schedule, pelvis_xy_m: Array, legs: LegGeometry) -> Walk:
    """The walk whose pelvis moves as given, by eqs. 3-10.

    Both legs are treated as eqs. 6-10 treat the moving leg; the support leg is the one with a lift of zero.

    Args:
        gait: The walk's numbers.
        schedule: Its time plan.
        pelvis_xy_m: Forward and left; shape (T, 2).
        legs: The leg's lengths.

    Raises:
        SimulationError: A leg cannot reach its foot.
    """
    straight = np.asarray(standing_leg_length(gait.knee, legs))
    roll = ankle_roll(pelvis_xy_m[:, 1], straight)
    torso = np.zeros_like(roll)
    columns = []
    for side in range(2):
        length = moving_leg_length(straight, roll, hip_roll(roll), schedule.lift_m[:, side])
        ahead = schedule.feet_x_m[:, side] - pelvis_xy_m[:, 0]
        alpha = alpha_for_foot(ahead, length, torso, legs)
        hip = hip_pitch(length, alpha, torso, legs, knee_is_behind(ahead, alpha, torso, legs))
        knee = knee_pitch(alpha, hip)
        columns += [hip_roll(roll), hip, knee, ankle_pitch(torso, hip, knee), roll]
    height = legs.ankle_height_m + straight * np.cos(roll)
    pelvis = np.column_stack([pelvis_xy_m, height])
    return Walk(gait, schedule, pelvis, np.column_stack(columns))


def plan_walk(
    gait: GaitSpec,
    legs: LegGeometry,
    ticks: int,
    whole_body_zmp: Callable[[Walk], Array] | None = None,
    then: Callable[[Walk], Array] | None = None,
) -> tuple[Walk, Array]:
    """A walk of any duration whose ZMP follows the reference.

    Args:
        gait: The walk's numbers.
        legs: The leg's lengths.
        ticks: T, how many control steps.
        whole_body_zmp: Gives the ZMP of the real body along a walk, forward and sideways, shape (t, 2), [m];
            without it the body is taken as a point mass.
        then: Something to be worked out along the walk, shape (t, k), such as joint torques; it repeats with
            the walk, so it is only asked for one period.

    Returns:
        The walk, and what `then` gave, shape (T, k); k is 0 without it.

    Raises:
        SimulationError: A leg cannot reach its foot.
    """
    steps = _LEAD_STEPS + _CYCLE_STEPS + _TAIL_STEPS
    schedule = plan_steps(gait, steps)
    sway = com_from_zmp(schedule.zmp_m, gait.com_height, gait.control_step)
    walk = joint_angles(gait, schedule, sway, legs)
    if whole_body_zmp is not None:
        for _ in range(_PASSES):
            missing = schedule.zmp_m - whole_body_zmp(walk)
            sway = sway + _PELVIS_PER_COM * com_from_zmp(missing, gait.com_height, gait.control_step)
            walk = joint_angles(gait, schedule, sway, legs)
    extra = np.zeros((walk.ticks, 0)) if then is None else then(walk)
    rows, turns = _periodic_rows(gait, ticks)
    return _repeat(walk, rows, turns), extra[rows]


def plan_stand(
    gait: GaitSpec,
    legs: LegGeometry,
    whole_body_zmp: Callable[[Walk], Array],
    then: Callable[[Walk], Array],
) -> tuple[Walk, Array]:
    """Standing for as long as the gait stands before its first step, the whole body's ZMP at the reference.

    Args:
        gait: The numbers; only those of standing count.
        legs: The leg's lengths.
        whole_body_zmp: See `plan_walk`.
        then: See `plan_walk`; worked out for one tick.

    Returns:
        The walk, which does not move, and what `then` gave, shape (T, k).
    """
    schedule = plan_steps(gait, 0)
    few = schedule.rows(slice(3))
    sway = few.zmp_m.copy()
    walk = joint_angles(gait, few, sway, legs)
    for _ in range(_PASSES):
        sway = sway + _PELVIS_PER_COM * (few.zmp_m - whole_body_zmp(walk)[1])
        walk = joint_angles(gait, few, sway, legs)
    rows = np.ones(len(schedule.step), dtype=np.int64)
    return Walk(gait, schedule, walk.pelvis_m[rows], walk.joints_rad[rows]), then(walk)[rows]


def ticks_that_count(gait: GaitSpec) -> int:
    """How many ticks of the computed walk are ever walked.

    Behind them the body comes to rest over one foot, far to the side; whether legs reach is of no account.
    """
    return gait.stand_ticks + (_LEAD_STEPS + _CYCLE_STEPS) * gait.step_ticks


def _periodic_rows(gait: GaitSpec, ticks: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each tick of a long walk, its row in the computed one, and how many cycles it is further on."""
    lead = gait.stand_ticks + _LEAD_STEPS * gait.step_ticks
    cycle = _CYCLE_STEPS * gait.step_ticks
    tick = np.arange(ticks)
    turns = np.maximum(tick - lead, 0) // cycle
    return tick - turns * cycle, turns


def _repeat(walk: Walk, rows: NDArray[np.int64], turns: NDArray[np.int64]) -> Walk:
    """The walk at the given rows, carried forward by one cycle's way for every turn."""
    s = walk.schedule
    way = turns * _CYCLE_STEPS * walk.gait.step_length
    ahead = np.column_stack([way, np.zeros_like(way)])
    schedule = replace(
        s,
        step=s.step[rows] + turns * _CYCLE_STEPS,
        phase=s.phase[rows],
        support=s.support[rows],
        single_support=s.single_support[rows],
        feet_x_m=s.feet_x_m[rows] + way[:, None],
        lift_m=s.lift_m[rows],
        zmp_m=s.zmp_m[rows] + ahead,
        left_load=s.left_load[rows],
    )
    pelvis = walk.pelvis_m[rows] + np.column_stack([ahead, np.zeros_like(way)])
    return Walk(walk.gait, schedule, pelvis, walk.joints_rad[rows])
