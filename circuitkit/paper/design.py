"""Measures what the design equations need to know of a robot and its walk, on the robot's model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.biped.dynamics import generalised_positions
from circuitkit.biped.gait import SIDES, GaitSpec, load_gait
from circuitkit.biped.gait.lipm import com_from_zmp, dcm
from circuitkit.biped.gait.pattern import joint_angles, standing_leg_length
from circuitkit.biped.gait.schedule import plan_steps
from circuitkit.biped.robot import BipedBlock, BipedBody, biped_of
from circuitkit.paper.design_sheet import Body, Reach
from circuitkit.robots import RobotModel, build_model, load_robot, shipped_robots

PUSHED_AT = 0.2  # of single support: 40 % of `lift`, as in sims/nao_push.yaml
_LEAN_RAD = math.radians(5.0)  # the CoM shifts in proportion to the sine; any angle gives the same lever
_STEPS = 12  # of the walk; the one in the middle feels neither its beginning nor its end
_MIDDLE = 6  # a step in which the left foot carries


def shipped_bipeds() -> tuple[str, ...]:
    """List the shipped robots to which the design equations apply."""
    names = shipped_robots()
    return tuple(name for name in names if getattr(load_robot(name), BipedBlock.kind, None) is not None)


def robot_and_reaches(
    robot: str, gait: str = "gait_march", moment: float = PUSHED_AT
) -> tuple[Body, tuple[Reach, Reach]]:
    """Measure a robot as the design equations see it, and how far it can be pushed while it walks.

    Args:
        robot: A path to a `robot.yaml`, or the name of a shipped robot.
        gait: A path to a gait file, or the name of a shipped one; its knee and its ZMP count.
        moment: When the push starts, from 0 to 1 of single support.

    Returns:
        The robot, and the distances outward and inward of the foot that carries.

    Raises:
        InputError: A file is wrong or missing, or the moment is outside single support.
    """
    walk = load_gait(gait)
    model = build_model(load_robot(robot))
    body = body_of(model, walk)
    return body, reaches_of(model, walk.model_copy(update={"com_height": body.com_height_m}), moment)


def body_of(robot: RobotModel, gait: GaitSpec) -> Body:
    """Measure mass, height of the CoM, ankle and sole of a robot that stands as the gait has it.

    The lever is measured: both ankles roll, the hips turn back (eq. 5), and the CoM moves in proportion to
    the sine of the angle.

    Args:
        robot: The robot.
        gait: Its walk; counts for how it bends the knees.

    Raises:
        InputError: The robot is no biped, or has no ankle roll.
        SimulationError: The legs cannot stand so.
    """
    biped = biped_of(robot)
    ankles = _ankle_rolls(robot, biped)
    leaning, _ = _standing(biped, gait, _LEAN_RAD)
    upright, torso_height = _standing(biped, gait, 0.0)
    soles = [getattr(biped.block.feet, side).sole for side in SIDES]
    return Body(
        name=robot.robot.robot,
        mass_kg=biped.mass_kg,
        com_height_m=float(upright[2]),
        ankle_limit_rad=min(ankle.limit_rad for ankle in ankles),
        joint_torque_nm=min(ankle.torque_nm for ankle in ankles),
        joint_speed_rad_s=min(ankle.no_load_speed for ankle in ankles)
        if all(a.damping > 0 for a in ankles)
        else None,
        sole_edge_m=min(min(sole.left, -sole.right) for sole in soles),
        lever_m=float(leaning[1] - upright[1]) / math.sin(_LEAN_RAD),
        torso_height_m=torso_height,
    )


@dataclass(frozen=True)
class _AnkleRoll:
    """The roll joint of an ankle with its servo.

    Attributes:
        limit_rad: How far it turns to the nearer side.
        torque_nm: Largest torque of the servo, at the joint.
        damping: Of the servo, at the joint, [N m s/rad].
    """

    limit_rad: float
    torque_nm: float
    damping: float

    @property
    def no_load_speed(self) -> float:
        """Torque over damping, [rad/s]: servos damp like their motors do."""
        return self.torque_nm / self.damping


def _ankle_rolls(robot: RobotModel, biped: BipedBody) -> list[_AnkleRoll]:
    """Find both ankles' roll joints.

    Raises:
        InputError: The robot has none.
    """
    found, block = [], biped.block
    for role in (f"{side}_ankle_roll" for side in SIDES):
        if role not in block.roles:
            message = f"missing {role}; required for the design equations, which turn the body about it"
            raise InputError(robot.robot.problem(("biped", "joints"), message))
        place = biped.leg_servo[block.roles.index(role)]
        joint, servo = robot.model.joint(block.joint(role).joint), robot.model.actuator(biped.servos[place])
        gear = abs(float(biped.gear[place]))
        offset = block.joint(role).offset  # what the MJCF has for a leg that stands straight
        found.append(
            _AnkleRoll(
                limit_rad=float(np.abs(joint.range - offset).min()) if joint.limited[0] else math.pi,
                torque_nm=float(servo.forcerange[1]) * gear if servo.forcelimited[0] else math.inf,
                damping=-float(servo.biasprm[2]) * gear**2,
            )
        )
    return found


def _standing(biped: BipedBody, gait: GaitSpec, ankle_roll_rad: float) -> tuple[NDArray[np.float64], float]:
    """Put the robot on both feet with its ankles rolled.

    Returns:
        CoM from the middle between the feet, shape (3,), [m]; height of the torso's own CoM, [m].
    """
    legs = biped.block.legs.geometry()
    schedule = plan_steps(gait, 1)
    pelvis = np.zeros((len(schedule.step), 2))
    pelvis[:, 1] = standing_leg_length(gait.knee, legs) * math.sin(ankle_roll_rad)  # eq. 3
    positions = generalised_positions(biped, joint_angles(gait, schedule, pelvis, legs))
    data = mujoco.MjData(biped.model)
    data.qpos = positions[0]
    mujoco.mj_kinematics(biped.model, data)
    mujoco.mj_comPos(biped.model, data)
    com: NDArray[np.float64] = data.subtree_com[biped.torso_id].copy()
    return com, float(data.xipos[biped.torso_id, 2])


def reaches_of(robot: RobotModel, gait: GaitSpec, moment: float) -> tuple[Reach, Reach]:
    """Work out how far the DCM of the walking point mass is from the last edge, outward and inward.

    Outward the sole that carries ends; inward the other foot catches the body, up to its own outer edge.

    Args:
        robot: The robot.
        gait: Its walk, with the height of the CoM that shall count.
        moment: From 0 to 1 of single support.

    Raises:
        InputError: The moment is outside single support.
    """
    if not 0.0 <= moment <= 1.0:
        message = f"found {moment:g}; allowed: 0 to 1, a part of single support"
        raise InputError(Problem("", 0, 0, "moment", message))
    schedule = plan_steps(gait, _STEPS)
    com = com_from_zmp(schedule.zmp_m[:, 1], gait.com_height, gait.control_step)
    xi = dcm(com, np.gradient(com, gait.control_step), gait.com_height)
    ticks = gait.stand / gait.control_step + _MIDDLE * gait.step_ticks
    begin = ticks + gait.double_support / gait.control_step
    at = begin + moment * gait.single_support / gait.control_step
    start = float(np.interp(at, np.arange(len(xi)), xi))
    block = biped_of(robot).block
    hip, feet = block.legs.hip_offset_y, block.feet
    return (
        Reach("outward", max(hip + feet.left.extent.left - start, 0.0)),
        Reach("inward", max(start + hip - feet.right.extent.right, 0.0)),
    )
