"""Where the legs of an MJCF put the feet, and the angles that put them where a walk wants them.

Eqs. 3-10 of the paper are for legs whose hip axes meet in a point, with thigh and tibia in one plane. Legs of
others have axes that stand apart or are tilted, and hips that turn about z between roll and knee. So the
angles of the equations are a first guess, and Newton's method finds those of the legs as they are.
"""

from __future__ import annotations

import copy
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import SimulationError
from circuitkit.biped.gait import SIDES, Walk
from circuitkit.biped.robot import BipedBody

Array = NDArray[np.float64]

_EXACT = 1e-6  # [m] and [rad]: legs that are off by less are those of the equations
_CLOSE_M, _CLOSE_RAD = 2e-3, 0.02
_ROUNDS = 12
_FREE = 1e-3  # weight of a direction that the leg has no joint for
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
        data.qpos[robot.base_qpos + 3 : robot.base_qpos + 7] = [1.0, 0.0, 0.0, 0.0]
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
        places = np.concatenate([self._model.jnt_qposadr[joints] for joints in self._joints])
        for tick, row in enumerate(found):
            if ahead is not None:  # as far from the equations as a tick ago is a good guess
                row[places] += ahead
            self._solve(row, wanted[tick], tick * walk.gait.control_step)
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

    def _solve(self, row: Array, wanted: Array, time_s: float) -> None:
        """Find the angles of both legs, in place."""
        model, data, robot = self._model, self._data, self._robot
        point, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        for _ in range(_ROUNDS):
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            errors = [self._weighted(side, wanted) for side in range(2)]
            # A second time, so that a direction without a joint keeps nobody from being done.
            if all(np.abs(errors[side] * self._weights[side]).max() < _EXACT / 10 for side in range(2)):
                break
            for side, joints in enumerate(self._joints):
                mujoco.mj_jacBody(model, data, point, turn, robot.feet_id[side])
                columns = model.jnt_dofadr[joints]
                slopes = np.vstack([point[:, columns], turn[:, columns]]) * self._weights[side][:, None]
                square = slopes.T @ slopes + 1e-9 * np.eye(len(joints))
                row[model.jnt_qposadr[joints]] += np.linalg.solve(square, slopes.T @ errors[side])
        self._check(row, wanted, time_s)

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

    def check_stops(self, positions: Array) -> None:
        """Complain about a joint of the legs that would have to turn past its stop.

        Raises:
            SimulationError: One would.
        """
        model = self._model
        for joint in (j for joints in self._joints for j in joints if model.jnt_limited[j]):
            angles = positions[:, model.jnt_qposadr[joint]]
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
