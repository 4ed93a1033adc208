"""What a biped stands on: where it is, and whether it carries the robot."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError
from circuitkit.biped.gait.lipm import GRAVITY_M_S2
from circuitkit.robots import RobotModel

Array = NDArray[np.float64]

_ABOVE_M = 0.3  # the ground is looked for from so far above the torso's origin
_MICRON = 6  # decimals of a measured length, [m]
_LIKE_EARTH = 0.05  # part by which gravity may be another than that of plans and controllers without a word
_SETTLED_S = 0.5  # how long a robot that falls on its ground may take beyond the fall itself
_MOST_STEPS = 20_000


def ground_below(model: mujoco.MjModel, torso: int, qpos: Array) -> float | None:
    """Height of what lies under a robot and may touch it; None if there is nothing. To a micron, [m]."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    at, hit, normal = data.xpos[torso] + [0.0, 0.0, _ABOVE_M], np.zeros(1, dtype=np.int32), np.zeros(3)
    down = np.array([0.0, 0.0, -1.0])
    for _ in range(model.ngeom):
        way = mujoco.mj_ray(model, data, at, down, None, 1, -1, hit, normal)
        geom = int(hit[0])
        if geom < 0:
            break
        at = at + (way + 1e-9) * down
        solid = model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in paired
        if solid and int(model.body_rootid[model.geom_bodyid[geom]]) != torso:
            return round(float(at[2]), _MICRON) + 0.0
    return None


def checked_ground(robot: RobotModel, torso: int, place: tuple[str, ...]) -> float:
    """Height of the ground that carries a biped, [m]: it is let go, and has to land.

    Plans and controllers are those of the inverted pendulum under `GRAVITY_M_S2`; other gravity is warned of.

    Args:
        robot: The compiled robot.
        torso: Its body with the free joint.
        place: Where in the robot file what is wrong is told.

    Raises:
        InputError: Gravity does not press it on the ground, there is no ground, or it falls through.
    """
    gravity, size = _gravity(robot, place)
    if abs(size / GRAVITY_M_S2 - 1) > _LIKE_EARTH:
        planned = f"gaits and the controllers of bipeds are worked out for {GRAVITY_M_S2:g} m/s^2"
        robot.robot.warn(place, f"{gravity}; {planned}")
    ground = ground_below(robot.model, torso, robot.start_qpos)
    if ground is None:
        message = "there is no ground under the robot; allowed: a floor that it can touch"
        raise InputError(robot.robot.problem(place, message))
    if not _lands(robot, torso, ground, size):
        allowed = (
            "a floor that its feet can touch, by contype and conaffinity or a pair, without an exclude, and "
            "without a flag that disables contacts or constraints"
        )
        message = f"nothing carries the robot: it falls through the ground; allowed: {allowed}"
        raise InputError(robot.robot.problem(place, message))
    return ground


def _gravity(robot: RobotModel, place: tuple[str, ...]) -> tuple[str, float]:
    """Gravity in words, and its size, [m/s^2]."""
    option = robot.model.opt
    off = option.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    x, y, z = gravity = np.zeros(3) if off else option.gravity
    found = f"the MJCF's gravity is {x:g} {y:g} {z:g} m/s^2"
    if z >= 0:
        message = f"{found}; allowed: gravity along -z, which presses the feet on the ground"
        raise InputError(robot.robot.problem(place, message))
    return found, float(np.linalg.norm(gravity))


def _lands(robot: RobotModel, torso: int, ground: float, gravity: float) -> bool:
    """Whether something that is no part of the robot touches it, and pushes it, when it is let go."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:], data.ctrl[:] = robot.start_qpos, robot.held
    own = model.body_rootid[model.geom_bodyid] == torso
    height = max(float(data.qpos[model.jnt_qposadr[model.body_jntadr[torso]] + 2]) - ground, 0.0)
    limit_s = (2 * height / gravity) ** 0.5 + _SETTLED_S
    for _ in range(min(int(limit_s / model.opt.timestep) + 1, _MOST_STEPS)):
        mujoco.mj_step(model, data)
        pushing = data.contact.geom[data.contact.efc_address >= 0]
        if own[pushing].any(axis=1).sum() > own[pushing].all(axis=1).sum():
            return True
    return False
