"""What the design equations need to know of a robot and its walk, from the robot's model and the gait."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.biped.dynamics import generalised_positions
from circuitkit.biped.gait import SIDES, GaitSpec, load_gait
from circuitkit.biped.gait.lipm import com_from_zmp, dcm
from circuitkit.biped.gait.pattern import joint_angles
from circuitkit.biped.gait.schedule import plan_steps
from circuitkit.paper.design_sheet import Body, Reach
from circuitkit.robots import RobotModel, build_model, load_robot

PUSHED_AT = 0.2  # of single support: 40 % of `lift`, as in sims/nao_push.yaml
_LEAN_RAD = math.radians(5.0)  # the CoM shifts in proportion to the sine; any angle gives the same lever
_STEPS = 12  # of the walk; the one in the middle feels neither its beginning nor its end
_MIDDLE = 6  # a step in which the left foot carries


def robot_and_reaches(
    robot: str, gait: str = "gait_march", moment: float = PUSHED_AT
) -> tuple[Body, tuple[Reach, Reach]]:
    """A robot as the design equations see it, and how far it can be pushed while it walks.

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
    """Mass, height of the CoM, ankle and sole of a robot that stands as the gait has it.

    The lever is measured: both ankles roll, the hips turn back (eq. 5), and the CoM moves in proportion to
    the sine of the angle.

    Args:
        robot: The robot.
        gait: Its walk; counts for how it bends the knees.

    Raises:
        SimulationError: The legs cannot stand so.
    """
    leaning, _ = _standing(robot, gait, _LEAN_RAD)
    upright, torso_height = _standing(robot, gait, 0.0)
    rolls = [f"{side}_ankle_roll" for side in SIDES]
    joints = [robot.model.joint(robot.spec.joints[role]) for role in rolls]
    servos = [robot.model.actuator(robot.spec.joints[role]) for role in rolls]
    soles = [getattr(robot.spec.feet, side).sole for side in SIDES]
    return Body(
        name=robot.spec.robot,
        mass_kg=robot.mass_kg,
        com_height_m=float(upright[2]),
        ankle_limit_rad=min(float(np.abs(joint.range).min()) for joint in joints),
        joint_torque_nm=min(float(servo.forcerange[1]) for servo in servos),
        joint_speed_rad_s=_no_load_speed(robot, rolls),
        sole_edge_m=min(min(sole.left, -sole.right) for sole in soles),
        lever_m=float(leaning[1] - upright[1]) / math.sin(_LEAN_RAD),
        torso_height_m=torso_height,
    )


def _no_load_speed(robot: RobotModel, rolls: list[str]) -> float | None:
    """Torque over damping, where the servos damp like their motors do; None without damping."""
    speeds = []
    for role in rolls:
        servo = robot.model.actuator(robot.spec.joints[role])
        damping = -float(servo.biasprm[2])
        if damping <= 0:
            return None
        speeds.append(float(servo.forcerange[1]) / damping)
    return min(speeds)


def _standing(robot: RobotModel, gait: GaitSpec, ankle_roll_rad: float) -> tuple[NDArray[np.float64], float]:
    """The robot on both feet with its ankles rolled.

    Returns:
        CoM from the middle between the feet, shape (3,), [m]; height of the torso's own CoM, [m].
    """
    legs = robot.spec.legs.geometry()
    schedule = plan_steps(gait, 1)
    length = math.sqrt(
        legs.thigh_m**2 + legs.tibia_m**2 + 2 * legs.thigh_m * legs.tibia_m * math.cos(gait.knee)
    )
    pelvis = np.zeros((len(schedule.step), 2))
    pelvis[:, 1] = length * math.sin(ankle_roll_rad)  # eq. 3
    positions = generalised_positions(robot, joint_angles(gait, schedule, pelvis, legs))
    data = mujoco.MjData(robot.model)
    data.qpos = positions[0]
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    com: NDArray[np.float64] = data.subtree_com[robot.torso_id].copy()
    return com, float(data.xipos[robot.torso_id, 2])


def reaches_of(robot: RobotModel, gait: GaitSpec, moment: float) -> tuple[Reach, Reach]:
    """How far the DCM of the walking point mass is from the last edge, outward and inward.

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
    hip = robot.spec.legs.hip_offset_y
    feet = robot.spec.feet
    return (
        Reach("outward", max(hip + feet.left.sole.left - start, 0.0)),
        Reach("inward", max(start + hip - feet.right.sole.right, 0.0)),
    )
