"""The walking pattern: from the time plan to joint angles, with the CoM motion that suits the real body.

The order of things: plan_steps -> ZMP reference -> CoM of a point mass (eq. 2 solved for all ticks) -> joint
angles (eqs. 3-10) -> ZMP of the whole body along these angles, which a robot's model gives -> what it misses
goes back into the CoM motion, until nothing is missed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from circuitkit.biped.gait import legs as eq
from circuitkit.biped.gait.legs import LegGeometry
from circuitkit.biped.gait.lipm import com_from_zmp
from circuitkit.biped.gait.schedule import Schedule, plan_steps
from circuitkit.biped.gait.spec import GaitSpec

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
    roll = eq.ankle_roll(pelvis_xy_m[:, 1], straight)
    torso = np.zeros_like(roll)
    columns = []
    for side in range(2):
        length = eq.moving_leg_length(straight, roll, eq.hip_roll(roll), schedule.lift_m[:, side])
        ahead = schedule.feet_x_m[:, side] - pelvis_xy_m[:, 0]
        alpha = eq.alpha_for_foot(ahead, length, torso, legs)
        hip = eq.hip_pitch(length, alpha, torso, legs, eq.knee_is_behind(ahead, alpha, torso, legs))
        knee = eq.knee_pitch(alpha, hip)
        columns += [eq.hip_roll(roll), hip, knee, eq.ankle_pitch(torso, hip, knee), roll]
    height = legs.ankle_height_m + straight * np.cos(roll)
    pelvis = np.column_stack([pelvis_xy_m, height])
    return Walk(gait, schedule, pelvis, np.column_stack(columns))


def standing_leg_length(knee_rad: float, legs: LegGeometry) -> float:
    """Distance from hip to ankle with the knee bent, in metres; eq. 4 with the ankle under the hip."""
    thigh, tibia = legs.thigh_m, legs.tibia_m
    return float(np.sqrt(thigh**2 + tibia**2 + 2 * thigh * tibia * np.cos(knee_rad)))


def plan_walk(
    gait: GaitSpec,
    legs: LegGeometry,
    ticks: int,
    whole_body_zmp: Callable[[Walk], Array] | None = None,
    then: Callable[[Walk], Array] | None = None,
) -> tuple[Walk, Array | None]:
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
        The walk, and what `then` gave, shape (T, k).

    Raises:
        SimulationError: A leg cannot reach its foot.
    """
    steps = _LEAD_STEPS + _CYCLE_STEPS + _TAIL_STEPS
    schedule = plan_steps(gait, steps)
    sway = com_from_zmp(schedule.zmp_m, gait.com_height, gait.control_step)
    walk = joint_angles(gait, schedule, sway, legs)
    for _ in range(_PASSES if whole_body_zmp else 0):
        missing = schedule.zmp_m - whole_body_zmp(walk)  # type: ignore[misc]  # not None in this loop
        sway = sway + _PELVIS_PER_COM * com_from_zmp(missing, gait.com_height, gait.control_step)
        walk = joint_angles(gait, schedule, sway, legs)
    extra = then(walk) if then else None
    rows, turns = _periodic_rows(gait, ticks)
    return _repeat(walk, rows, turns), None if extra is None else extra[rows]


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
