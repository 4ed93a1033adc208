"""What a controller may know of the walk beforehand: its point mass, footsteps, and what can carry it.

Positions are in the frame of the plan: x forward and y to the left from the middle between the feet as they
stand at first, in metres. Axis 0 is forward, axis 1 sideways; feet are in the order left, right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.gait import LEFT, LEG_JOINTS, LegGeometry, Walk
from circuitkit.biped.gait.lipm import com_from_zmp, dcm, natural_frequency
from circuitkit.biped.gait.pattern import support_leg_length
from circuitkit.biped.gait.schedule import EXTEND, LIFT, Schedule, plan_steps
from circuitkit.control import PlannedChannel

Array = NDArray[np.float64]

AHEAD_S = 3.0  # how much further than the walk a controller may look
_TAIL_STEPS = 5  # so that the CoM does not feel the end, as in `gait.pattern`


@dataclass(frozen=True)
class Body:
    """What a controller may know of the robot.

    Attributes:
        mass_kg: m.
        legs: Lengths of the legs.
        soles_m: Extent of each sole from its ankle: foot, axis, lower and upper end; shape (2, 2, 2).
        stiffness: Of the ankle's servos, forward and sideways; shape (2,), [N m/rad].
        lag_s: By which these servos stay behind a moving target: damping over stiffness; shape (2,).
        observations: Channels of the robot that can be read, with their units.
        commands: Channels that can be written, with their units.
    """

    mass_kg: float
    legs: LegGeometry
    soles_m: Array
    stiffness: Array
    lag_s: Array
    observations: Mapping[str, Unit]
    commands: Mapping[str, Unit]


@dataclass(frozen=True)
class Footstep:
    """One footstep of the plan.

    Attributes:
        number: Of the step, from 0.
        side: The foot that carries, `LEFT` or `RIGHT`.
        ankle_m: Where its ankle stands: forward and left.
        first_tick: First tick of single support.
        last_tick: One past its last tick.
    """

    number: int
    side: int
    ankle_m: tuple[float, float]
    first_tick: int
    last_tick: int


@dataclass(frozen=True)
class WalkReference:
    """The plan of a walk, tick by tick; T ticks of the walk and `AHEAD_S` more, R in all.

    Attributes:
        walk: The walk.
        body: The robot.
        schedule: Time plan; R ticks.
        zmp_m: The ZMP; shape (R, 2).
        com_m: The CoM of the point mass with this ZMP (eq. 2); shape (R, 2).
        com_velocity: Its velocity; shape (R, 2), [m/s].
        com_acceleration: Its acceleration; shape (R, 2), [m/s^2].
        ankles_m: Where the ankles are: foot, axis; shape (R, 2, 2).
        low_m: Lower end of the support, forward and sideways; shape (R, 2).
        high_m: Upper end; shape (R, 2).
    """

    walk: Walk
    body: Body
    schedule: Schedule
    zmp_m: Array
    com_m: Array
    com_velocity: Array
    com_acceleration: Array
    ankles_m: Array
    low_m: Array
    high_m: Array

    @property
    def step_s(self) -> float:
        """The control step."""
        return self.walk.gait.control_step

    @property
    def com_height_m(self) -> float:
        """z_CoM of the point mass."""
        return self.walk.gait.com_height

    @property
    def omega(self) -> float:
        """sqrt(g / z_CoM), [rad/s]."""
        return natural_frequency(self.com_height_m)

    @property
    def dcm_m(self) -> Array:
        """Xi = y + y' / omega; shape (R, 2)."""
        return dcm(self.com_m, self.com_velocity, self.com_height_m)

    @property
    def feet_apart_m(self) -> Array:
        """Left ankle from the right one; shape (R, 2)."""
        return self.ankles_m[:, 0] - self.ankles_m[:, 1]

    @property
    def sensed_com_offset_m(self) -> Array:
        """What lies between the sensed CoM and the plan's frame: the middle between the ankles; (R, 2)."""
        middle: Array = self.ankles_m.mean(axis=1)
        return middle

    @property
    def carrying_side(self) -> Array:
        """1 where the plan has all weight on the left foot, -1 on the right one, between in passing; (R,)."""
        share: Array = 2.0 * self.schedule.left_load - 1.0
        return share

    @property
    def footsteps(self) -> tuple[Footstep, ...]:
        """All steps, in the order of time."""
        single = np.isin(self.schedule.phase, (LIFT, EXTEND))
        steps = []
        for number in range(int(self.schedule.step.max()) + 1):
            ticks = np.flatnonzero(single & (self.schedule.step == number))
            if len(ticks):
                side = int(self.schedule.support[ticks[0]])
                x, y = self.ankles_m[ticks[0], side]
                steps.append(Footstep(number, side, (float(x), float(y)), int(ticks[0]), int(ticks[-1]) + 1))
        return tuple(steps)

    def com_per_pelvis(self) -> float:
        """How far the CoM goes sideways for each metre that the pelvis goes, in the walk as planned.

        The legs stay behind, so it is less than 1; least squares over the walk. A pelvis that keeps
        still tells nothing of it: then it is 1.
        """
        pelvis = self.walk.pelvis_m[:, 1]
        if np.ptp(pelvis) == 0:
            return 1.0
        return float(self.com_m[: len(pelvis), 1] @ pelvis) / float(pelvis @ pelvis)

    def com_per_lean_m(self) -> float:
        """How far the CoM goes for each sine of the ankle's angle: eq. 3, less what the legs lack."""
        walk, names = self.walk, LEG_JOINTS
        pitch, knee = (walk.joints_rad[0, names.index(f"left_{joint}_pitch")] for joint in ("ankle", "knee"))
        return self.com_per_pelvis() * float(support_leg_length(pitch, knee, self.body.legs))

    def joint_angles(self, names: Sequence[str]) -> Array:
        """Planned angles of joints; shape (T, n), [rad]."""
        angles: Array = self.walk.joints_rad[:, [LEG_JOINTS.index(name) for name in names]]
        return angles

    def planned_channels(self) -> dict[str, PlannedChannel]:
        """`planned_com_*` and `planned_com_velocity_*`, the CoM of the plan's point mass (eq. 2).

        In the frame of the sensed channels `com_*`, the middle between the ankles, so that the difference of
        the two is how far the robot is from its plan. With the velocities over omega = sqrt(g / z_CoM) added
        it is the error of the DCM (capture point).
        """
        ticks = self.walk.ticks
        com = self.com_m - self.sensed_com_offset_m
        found = {}
        for axis, letter in enumerate("xy"):
            found[f"planned_com_{letter}"] = PlannedChannel(parse_unit("m"), com[:ticks, axis])
            found[f"planned_com_velocity_{letter}"] = PlannedChannel(
                parse_unit("m/s"), self.com_velocity[:ticks, axis]
            )
        return found

    def delayed_rows(self, delay_s: float) -> NDArray[np.int64]:
        """For each row, the row that was `delay_s` earlier, and the first one before there was any; (R,)."""
        rows: NDArray[np.int64] = np.maximum(np.arange(len(self.com_m)) - round(delay_s / self.step_s), 0)
        return rows


def walk_reference(walk: Walk, body: Body) -> WalkReference:
    """The plan of a walk as a controller may know it; it walks on after the end.

    Args:
        walk: The walk.
        body: The robot.
    """
    rows = _rows_known(walk)
    return _known(walk, body, plan_steps(walk.gait, walk.gait.steps_within(rows) + _TAIL_STEPS))


def stand_reference(walk: Walk, body: Body) -> WalkReference:
    """The plan of a robot that only stands, as a controller may know it; it stands on after the end.

    A first step right after the end would be felt before it: its CoM leans towards it by exp(-omega t).

    Args:
        walk: The walk, which takes no step.
        body: The robot.
    """
    stand = walk.gait.model_copy(update={"stand": _rows_known(walk) * walk.gait.control_step})
    return _known(walk, body, plan_steps(stand, 0))


def _rows_known(walk: Walk) -> int:
    """R, the ticks of a walk that a controller may know."""
    return walk.ticks + round(AHEAD_S / walk.gait.control_step)


def _known(walk: Walk, body: Body, longer: Schedule) -> WalkReference:
    """The plan that follows from a walk's time plan of at least R ticks."""
    gait, dt = walk.gait, walk.gait.control_step
    rows = _rows_known(walk)
    com = com_from_zmp(longer.zmp_m, gait.com_height, dt)
    schedule = longer.rows(slice(rows))
    omega = natural_frequency(gait.com_height)
    sideways = np.array([1.0, -1.0]) * body.legs.hip_offset_y_m
    ankles = np.stack([schedule.feet_x_m, np.broadcast_to(sideways, (rows, 2))], axis=-1)
    low, high = _support(schedule, ankles, body.soles_m)
    return WalkReference(
        walk=walk,
        body=body,
        schedule=schedule,
        zmp_m=schedule.zmp_m,
        com_m=com[:rows],
        com_velocity=np.gradient(com, dt, axis=0)[:rows],
        com_acceleration=omega**2 * (com[:rows] - schedule.zmp_m),
        ankles_m=ankles,
        low_m=low,
        high_m=high,
    )


def _support(schedule: Schedule, ankles_m: Array, soles_m: Array) -> tuple[Array, Array]:
    """Lower and upper end of what can carry: one sole in single support, else from one to the other."""
    ends = ankles_m[..., None] + soles_m  # (R, foot, axis, end)
    low: Array = ends[..., 0].min(axis=1)
    high: Array = ends[..., 1].max(axis=1)
    single = np.isin(schedule.phase, (LIFT, EXTEND))
    foot = np.where(schedule.support == LEFT, 0, 1)
    alone = ends[np.arange(len(foot)), foot]
    one = single[:, None]
    return np.where(one, alone[:, :, 0], low), np.where(one, alone[:, :, 1], high)


def gait_knowledge(knowledge: object, controller: str) -> WalkReference:
    """What the reference tells a controller that is made for walks.

    Raises:
        InputError: The reference is another.
    """
    if not isinstance(knowledge, WalkReference):
        message = (
            f"the controller '{controller}' builds on a walk; allowed: a scenario with reference: "
            f"{{gait: NAME}} or stand"
        )
        raise InputError(Problem("", 0, 0, "controller", message))
    return knowledge
