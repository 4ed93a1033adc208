"""A walk on the body of an MJCF: where its legs put the feet, the whole body's ZMP, and its servos' torques.

Eqs. 3-10 of the paper are for legs whose hip axes meet in a point, with thigh and tibia in one plane. Legs of
others have axes that stand apart or are tilted, and hips that turn about z between roll and knee. So the
angles of the equations are a first guess, and Newton's method finds those of the legs as they are.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import SimulationError
from circuitkit.biped.gait import SIDES, Walk
from circuitkit.biped.gait.pattern import ticks_that_count
from circuitkit.biped.robot import BipedBody

Array = NDArray[np.float64]

_EXACT = 1e-6  # [m] and [rad]: legs that are off by less are those of the equations
_CLOSE_M, _CLOSE_RAD = 2e-3, 0.02
_ROUNDS = 24
_BOLD = 1e-9  # least damping of a step, for legs with a joint too many
_FREE = 1e-3  # weight of a direction that the leg has no joint for
_BASE_DOFS = 6
_BEYOND_RAD = 0.03  # so far past a joint's stop is still nothing


@lru_cache(maxsize=8)
def legs_of(robot: BipedBody) -> LegKinematics:
    """The legs of a compiled biped; made once for each."""
    return LegKinematics(robot)


class LegKinematics:
    """The legs of a compiled biped."""

    def __init__(self, robot: BipedBody) -> None:
        """Take stock of the joints between torso and feet."""
        self._robot = robot
        self._model = model = copy.deepcopy(robot.model)
        self._data = mujoco.MjData(model)
        chains = [_hinges(model, foot, robot.torso_id) for foot in robot.feet_id]
        shared = set(chains[0]) & set(chains[1])
        driven = {int(place) for place in robot.qpos_index}
        tied = {int(j) for e in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)) for j in (
            model.eq_obj1id[e], model.eq_obj2id[e])}  # fmt: skip
        self._joints = [
            [j for j in chain if j not in shared and j not in tied and int(model.jnt_qposadr[j]) in driven]
            for chain in chains
        ]
        self._level = self._level_feet()
        self._weights = [self._weights_of(side) for side in range(2)]

    def _level_feet(self) -> list[Array]:
        """Axes of each foot's body when the foot is level."""
        robot, data = self._robot, self._data
        data.qpos[:] = robot.start_qpos
        data.qpos[robot.base_qpos + 3 : robot.base_qpos + 7] = robot.upright
        data.qpos[robot.qpos_index[robot.leg_servo]] = robot.leg_offset
        mujoco.mj_kinematics(self._model, data)
        return [data.xmat[foot].reshape(3, 3).copy() for foot in robot.feet_id]

    def corrected(self, positions: Array, walk: Walk) -> Array:
        """Positions with other angles of the legs, where those of the equations miss; shape (T, nq).

        Args:
            positions: Along the walk, with the angles of the equations.
            walk: The walk.

        Raises:
            SimulationError: A foot cannot be where it shall be.
        """
        wanted = self._wanted(walk)
        looks = np.unique(np.linspace(0, walk.ticks - 1, 12).astype(int))
        if all(self._miss(positions[tick], wanted[tick]) < _EXACT for tick in looks):
            return positions
        found = positions.copy()
        ahead: Array | None = None
        counts = ticks_that_count(walk.gait)
        places = np.concatenate([self._model.jnt_qposadr[joints] for joints in self._joints])
        for tick, row in enumerate(found):
            if ahead is not None:  # as far from the equations as a tick ago is a good guess
                row[places] += ahead
            self._solve(row, wanted[tick])
            if tick < counts:
                self._check(row, wanted[tick], tick * walk.gait.control_step)
            ahead = row[places] - positions[tick, places]
        return found

    def _wanted(self, walk: Walk) -> Array:
        """Where the ankles shall be; shape (T, 2, 3)."""
        robot, legs, plan = self._robot, self._robot.block.legs, walk.schedule
        height = walk.pelvis_m[:, 2] - legs.ankle_height
        slope = walk.pelvis_m[:, 1] / height  # tangent of the roll
        wanted = np.empty((walk.ticks, 2, 3))
        for side, sign in enumerate((1.0, -1.0)):
            lift = plan.lift_m[:, side]
            wanted[:, side, 0] = plan.feet_x_m[:, side]
            wanted[:, side, 1] = sign * legs.hip_offset_y + lift * slope
            wanted[:, side, 2] = legs.ankle_height + lift
        return wanted + robot.origin_m

    def _errors(self, side: int, wanted: Array) -> Array:
        """How far a foot is from where it shall be and from level; shape (6,), [m] and [rad]."""
        foot = self._robot.feet_id[side]
        turn = self._level[side] @ self._data.xmat[foot].reshape(3, 3).T
        axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        return np.concatenate([wanted[side] - self._data.xpos[foot], axis])

    def _miss(self, row: Array, wanted: Array) -> float:
        self._data.qpos[:] = row
        mujoco.mj_kinematics(self._model, self._data)
        return max(float(np.abs(self._weighted(side, wanted)).max()) for side in range(2))

    def _weighted(self, side: int, wanted: Array) -> Array:
        """The errors of a foot, each with its weight; shape (6,)."""
        return self._errors(side, wanted) * self._weights[side]

    def _weights_of(self, side: int) -> Array:
        """1 for what a leg can put right, next to nothing for the rest; shape (6,)."""
        weights = np.ones(6)
        if f"{SIDES[side]}_ankle_roll" not in self._robot.block.roles:
            weights[3] = _FREE
        if len(self._joints[side]) < weights.sum():
            weights[5] = _FREE
        return weights

    def _solve(self, row: Array, wanted: Array) -> None:
        """Find the angles of both legs, in place; those that come nearest where a foot is out of reach.

        Newton's method, by the rule of Levenberg and Marquardt: a step that takes a foot further away, as
        those of a straight leg do, is taken back and made shorter.
        """
        model, data, robot = self._model, self._data, self._robot
        point, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        places = [model.jnt_qposadr[joints] for joints in self._joints]
        best = [_Nearest(row[place].copy()) for place in places]
        for _ in range(_ROUNDS):
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            errors = [self._weighted(side, wanted) for side in range(2)]
            # A second time, so that a direction without a joint keeps nobody from being done.
            if all(np.abs(errors[side] * self._weights[side]).max() < _EXACT / 10 for side in range(2)):
                return
            for side, joints in enumerate(self._joints):
                mujoco.mj_jacBody(model, data, point, turn, robot.feet_id[side])
                columns = model.jnt_dofadr[joints]
                slopes = np.vstack([point[:, columns], turn[:, columns]]) * self._weights[side][:, None]
                row[places[side]] = best[side].next(row[places[side]], errors[side], slopes)
        for place, found in zip(places, best, strict=True):
            row[place] = found.angles

    def _check(self, row: Array, wanted: Array, time_s: float) -> None:
        self._data.qpos[:] = row
        mujoco.mj_kinematics(self._model, self._data)
        for side, name in enumerate(SIDES):
            errors = np.abs(self._weighted(side, wanted))
            if errors[:3].max() > _CLOSE_M or errors[3:].max() > _CLOSE_RAD:
                message = (
                    f"the {name} foot cannot be where the walk wants it at {time_s:.2f} s: it misses by "
                    f"{errors[:3].max() * 1e3:.1f} mm and {np.degrees(errors[3:].max()):.1f} deg; bend the "
                    "knee more, step shorter, or give the legs' joints in the robot file an offset"
                )
                raise SimulationError(message)

    def check_stops(self, positions: Array, walk: Walk) -> None:
        """Complain about a joint of the legs that would have to turn past its stop.

        Args:
            positions: Along the walk; shape (T, nq).
            walk: The walk.

        Raises:
            SimulationError: One would.
        """
        model = self._model
        for joint in (j for joints in self._joints for j in joints if model.jnt_limited[j]):
            angles = positions[: ticks_that_count(walk.gait), model.jnt_qposadr[joint]]
            low, high = model.jnt_range[joint]
            if angles.min() < low - _BEYOND_RAD or angles.max() > high + _BEYOND_RAD:
                message = (
                    f"the walk turns '{model.joint(joint).name}' from {np.degrees(angles.min()):.1f} to "
                    f"{np.degrees(angles.max()):.1f} deg; allowed by the MJCF: {np.degrees(low):.1f} to "
                    f"{np.degrees(high):.1f} deg; another knee, a shorter step, or an offset in the robot "
                    "file"
                )
                raise SimulationError(message)


def _hinges(model: mujoco.MjModel, body: int, torso: int) -> list[int]:
    """Hinges from a torso down to a body."""
    found: list[int] = []
    while body not in {0, torso}:
        first = int(model.body_jntadr[body])
        joints = range(first, first + int(model.body_jntnum[body]))
        found = [j for j in joints if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_HINGE)] + found
        body = int(model.body_parentid[body])
    return found


@dataclass
class _Nearest:
    """The angles of a leg that brought its foot nearest so far, and how bold the next step from them is."""

    angles: Array
    cost: float = math.inf
    damping: float = _BOLD
    errors: Array = field(default_factory=lambda: np.zeros(6))
    slopes: Array = field(default_factory=lambda: np.zeros((6, 0)))

    def next(self, angles: Array, errors: Array, slopes: Array) -> Array:
        """Angles to try next, after those that were tried last and what came of them."""
        cost = float(errors @ errors)
        if cost < self.cost:
            self.angles, self.cost, self.errors, self.slopes = angles.copy(), cost, errors, slopes
            self.damping = max(self.damping / 10, _BOLD)
        else:
            self.damping *= 30
        square = self.slopes.T @ self.slopes + self.damping * np.eye(len(self.angles))
        step = np.linalg.solve(square, self.slopes.T @ self.errors)
        return np.asarray(self.angles + step, dtype=np.float64)


class BodyDynamics:
    """Inverse dynamics of a robot whose joints follow a walk exactly, feet flat on the ground.

    MuJoCo's inverse dynamics without contacts gives the force F and the moment M (about the torso's origin o)
    that the ground must exert on the floating base. Their ZMP is x = (o_x F_z - o_z F_x - M_y) / F_z and
    y = (o_y F_z - o_z F_y + M_x) / F_z. Put on the feet that carry the weight instead of on the base, they
    leave the torques of the joints.
    """

    def __init__(self, robot: BipedBody) -> None:
        self._robot = robot
        self._model = copy.deepcopy(robot.model)
        disable = mujoco.mjtDisableBit
        for flag in (disable.mjDSBL_CONSTRAINT, disable.mjDSBL_ACTUATION, disable.mjDSBL_SENSOR):
            self._model.opt.disableflags |= int(flag)
        self._data = mujoco.MjData(self._model)
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, robot.upright)
        self._axes = axes.reshape(3, 3)

    def zmp(self, walk: Walk) -> Array:
        """ZMP along the walk, forward and sideways; shape (T, 2), [m]."""
        positions, forces = self._inverse(walk)
        base = self._robot.base_dof
        origin = positions[:, self._robot.base_qpos : self._robot.base_qpos + 3] - self._robot.origin_m
        force, moment = forces[:, base : base + 3], forces[:, base + 3 : base + _BASE_DOFS]
        turned = np.column_stack([-moment[:, 1], moment[:, 0]])
        points: Array = origin[:, :2] + (turned - origin[:, 2:3] * force[:, :2]) / force[:, 2:3]
        return points

    def torques(self, walk: Walk) -> Array:
        """Torque of every servo along the walk, the ground's force shared by the feet as the ZMP says.

        Returns:
            Shape (T, n), [N m].
        """
        positions, forces = self._inverse(walk)
        left = walk.schedule.left_load
        point = np.zeros((3, self._model.nv))
        turn = np.zeros((3, self._model.nv))
        torques = forces[:, self._robot.dof_index]
        base, place = self._robot.base_dof, self._robot.base_qpos
        for tick, share in enumerate(left):
            self._data.qpos = positions[tick]
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_comPos(self._model, self._data)
            force, moment = forces[tick, base : base + 3], forces[tick, base + 3 : base + _BASE_DOFS]
            for part, foot in zip((share, 1.0 - share), self._robot.feet_id, strict=True):
                if part > 0:
                    mujoco.mj_jac(
                        self._model, self._data, point, turn, positions[tick, place : place + 3], foot
                    )
                    torques[tick] -= part * (force @ point + moment @ turn)[self._robot.dof_index]
        return torques

    def _inverse(self, walk: Walk) -> tuple[Array, Array]:
        """Positions, shape (T, nq), and the forces that they need, shape (T, nv), all in the world's axes."""
        model, data = self._model, self._data
        positions = generalised_positions(self._robot, walk)
        # The torso keeps upright, so the quaternion is constant and velocities are plain differences.
        moving = np.zeros((walk.ticks, model.nv))
        base, place = self._robot.base_dof, self._robot.base_qpos
        moving[:, base : base + 3] = positions[:, place : place + 3]
        moving[:, self._robot.dof_index] = positions[:, self._robot.qpos_index]
        dt = walk.gait.control_step
        velocity, acceleration = np.zeros_like(moving), np.zeros_like(moving)
        velocity[1:-1] = (moving[2:] - moving[:-2]) / (2 * dt)
        acceleration[1:-1] = (moving[2:] - 2 * moving[1:-1] + moving[:-2]) / dt**2
        forces = np.empty_like(moving)
        for tick in range(walk.ticks):
            data.qpos, data.qvel, data.qacc = positions[tick], velocity[tick], acceleration[tick]
            mujoco.mj_inverse(model, data)
            forces[tick] = data.qfrc_inverse
        # The moment on a free joint is in the axes of its body.
        forces[:, base + 3 : base + _BASE_DOFS] = forces[:, base + 3 : base + _BASE_DOFS] @ self._axes.T
        return positions, forces


def generalised_positions(robot: BipedBody, walk: Walk) -> Array:
    """`qpos` along a walk: torso upright over the pelvis, loose objects where they are; shape (T, nq).

    Raises:
        SimulationError: The MJCF's legs cannot put a foot where the walk wants it.
    """
    positions = np.repeat(robot.start_qpos[None], walk.ticks, axis=0)
    place, legs = robot.base_qpos, robot.block.legs
    positions[:, place : place + 3] = walk.pelvis_m + robot.origin_m
    positions[:, place] -= legs.hip_offset_x
    positions[:, place + 2] += legs.hip_offset_z
    positions[:, place + 3 : place + 7] = robot.upright
    angles = walk.joints_rad[:, robot.leg_column] * robot.leg_sign
    if robot.leg_offset.any():
        angles += robot.leg_offset
    positions[:, robot.qpos_index[robot.leg_servo]] = angles
    return legs_of(robot).corrected(positions, walk)


def as_walked(robot: BipedBody, walk: Walk, targets: Array) -> Walk:
    """The walk with the angles that the MJCF's legs take.

    Args:
        robot: The robot.
        walk: The walk.
        targets: Angles of all joints with servos along it; shape (T, n), [rad].
    """
    angles = walk.joints_rad.copy()
    angles[:, robot.leg_column] = (targets[:, robot.leg_servo] - robot.leg_offset) * robot.leg_sign
    return replace(walk, joints_rad=angles)


def servo_targets(robot: BipedBody, targets: Array, torques: Array) -> Array:
    """Controls along a walk; shape (T, nu).

    A servo of stiffness k that must hold a torque stays behind its target by torque / k. The torques along
    the walk are known beforehand, so the targets are set ahead by as much: the joints then follow the walk,
    but for a lag of damping / stiffness times their rate, 1.8 degrees (root mean square) in the rolls.

    Args:
        robot: The robot.
        targets: Angles of all joints with servos; shape (T, n), [rad].
        torques: Of them; shape (T, n), [N m].
    """
    controls = np.repeat(robot.held[None], len(targets), axis=0)
    controls[:, robot.controls] = (targets + torques / robot.stiffness) * robot.gear
    return controls
