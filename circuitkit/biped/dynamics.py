"""Rigid-body dynamics along a walk: the ZMP of the whole body, and the torques that its servos must hold."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.biped.gait import Walk
from circuitkit.biped.kinematics import legs_of
from circuitkit.biped.robot import BipedBody

Array = NDArray[np.float64]

_BASE_DOFS = 6


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
        """Positions, shape (T, nq), and the generalised forces that they need, shape (T, nv)."""
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
    positions[:, place + 3 : place + 7] = [1.0, 0.0, 0.0, 0.0]
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
    controls[:, robot.servos] = (targets + torques / robot.stiffness) * robot.gear
    return controls
