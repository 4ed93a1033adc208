"""What the MJCF itself says of a biped: which way its joints turn, how long legs are, where soles end.

All of it is read in one pose: torso upright, legs straight, every joint of them at its offset.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.biped.gait import SIDES
from circuitkit.biped.spec import CORNERS, BipedSpec, Foot, LegJoint, Legs, Sole
from circuitkit.robots import RobotModel

Array = NDArray[np.float64]
_Block = TypeVar("_Block", bound=BipedSpec)

_LEAST_CELL_M = 0.06  # half the width of a cell's volume: from the middle of the sole past its edge
_CELL_HALF_HEIGHT_M = 0.02
_CELL_INSET = 0.15  # a cell that nobody places is so much of the sole's length and width inside its corner
_ALONG = 0.5  # the least part of a joint's axis that must lie along x or y
_ABOVE_M = 0.3  # the ground is looked for from so far above the torso's origin
_MICRON = 6  # decimals of a measured length, [m]


def measured(block: _Block, robot: RobotModel) -> _Block:
    """The block with everything that it leaves open.

    Args:
        block: As the robot file has it.
        robot: The compiled robot; the places of its force cells are changed where the block has none.

    Raises:
        InputError: A joint turns about another axis than its role, or another way than the block says.
    """
    pose = _Straight(block, robot)
    joints = _joints(block, robot, pose)
    legs = _legs(block, pose)
    feet = {side: _foot(block, side, pose) for side in SIDES}
    made = block.model_copy(
        update={"joints": joints, "legs": legs, "feet": block.feet.model_copy(update=feet)}
    )
    _place_cells(made, robot.model, pose)
    return made


def quarters(cells_m: Array, sole: Sole | None = None) -> Iterator[tuple[Array, list[float]]]:
    """Centre and half sizes of each cell's volume: from the middle of all four to beyond the sole's edge.

    Args:
        cells_m: Where the cells are, forward and left of the ankle; shape (4, 2).
        sole: Where the sole ends; that of a small foot if None.
    """
    middle, half = cells_m.mean(axis=0), _LEAST_CELL_M
    if sole is not None:
        edges = np.array([[sole.back, sole.right], [sole.front, sole.left]])
        half = max(half, float(np.abs(edges - middle).max()) / 2 + 0.01)
    for cell in cells_m:
        yield middle + np.sign(cell - middle) * half, [half, half, _CELL_HALF_HEIGHT_M]


def ground_below(model: mujoco.MjModel, torso: int, qpos: Array) -> float:
    """Height of what lies under a robot and is no part of it; 0 if there is nothing. To a micron, [m]."""
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
    return 0.0


class _Straight:
    """The pose in which everything is measured, at the world's origin."""

    def __init__(self, block: BipedSpec, robot: RobotModel) -> None:
        self.model = model = robot.model
        self.data = data = mujoco.MjData(model)
        base = int(model.jnt_qposadr[model.body_jntadr[model.body(block.torso).id]])
        data.qpos[:] = robot.start_qpos
        data.qpos[base : base + 7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        for role in block.roles:
            joint = block.joint(role)
            data.qpos[model.jnt_qposadr[model.joint(joint.joint).id]] = joint.offset
        mujoco.mj_kinematics(model, data)

    def axis(self, joint: str) -> Array:
        found: Array = self.data.xaxis[self.model.joint(joint).id]
        return found

    def anchor(self, joint: str) -> Array:
        found: Array = self.data.xanchor[self.model.joint(joint).id]
        return found

    def foot(self, body: str) -> Array:
        found: Array = self.data.xpos[self.model.body(body).id]
        return found

    def turned(self, body: str) -> Array:
        """Rows: how much x, y, z of the level foot are along the body's own axes; shape (3, 3)."""
        found: Array = self.data.xmat[self.model.body(body).id].reshape(3, 3)
        return found

    def box(self, body: str) -> tuple[Array, Array]:
        """Lowest and highest coordinates of what of a body can touch the ground, from its origin."""
        model, number = self.model, int(self.model.body(body).id)
        paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
        lows, highs = [], []
        for geom in np.flatnonzero(model.geom_bodyid == number):
            if model.geom_contype[geom] or model.geom_conaffinity[geom] or int(geom) in paired:
                turn = self.data.geom_xmat[geom].reshape(3, 3)
                centre = self.data.geom_xpos[geom] + turn @ model.geom_aabb[geom, :3]
                half = np.abs(turn) @ model.geom_aabb[geom, 3:]
                lows.append(centre - half)
                highs.append(centre + half)
        origin = self.data.xpos[number]
        return np.min(lows, axis=0) - origin, np.max(highs, axis=0) - origin


def _joints(block: BipedSpec, robot: RobotModel, pose: _Straight) -> dict[str, LegJoint]:
    """Every joint with its sign."""
    found, problems = {}, list[Problem]()
    for role in block.roles:
        joint = block.joint(role)
        axis = pose.axis(joint.joint)
        letter, along = ("y", axis[1]) if role.endswith("pitch") else ("x", axis[0])
        sign = 1 if along > 0 else -1
        shown = ", ".join(f"{value + 0.0:.2g}" for value in axis)
        where = ("biped", "joints", role)
        if abs(along) < _ALONG:
            message = (
                f"'{joint.joint}' turns about ({shown}) when the leg is straight; allowed: a hinge about "
                f"{letter}"
            )
            problems.append(robot.robot.problem(where, message, "a leg that is bent at 0 needs an offset"))
        elif joint.sign not in {None, sign}:
            message = (
                f"'{joint.joint}' turns about ({shown}), found sign: {joint.sign}; allowed: sign: {sign}, or "
                "none"
            )
            problems.append(robot.robot.problem(where, message))
        found[role] = joint.model_copy(update={"sign": sign})
    if problems:
        raise InputError(*problems)
    return found


def _legs(block: BipedSpec, pose: _Straight) -> Legs:
    """The lengths, measured at the left leg where they are not given."""
    hip, knee = (pose.anchor(block.joint(f"left_{name}_pitch").joint) for name in ("hip", "knee"))
    ankle = pose.foot(block.feet.left.body)
    found = {
        "thigh": np.hypot(*(hip - knee)[[0, 2]]),
        "tibia": np.hypot(*(knee - ankle)[[0, 2]]),
        "ankle_height": -pose.box(block.feet.left.body)[0][2],
        "hip_offset_x": hip[0],
        "hip_offset_y": abs(ankle[1]),
        "hip_offset_z": -hip[2],
    }
    given = {name: getattr(block.legs, name) for name in block.legs.model_fields_set}
    return Legs(**{name: round(float(value), _MICRON) + 0.0 for name, value in found.items()} | given)


def _foot(block: BipedSpec, side: str, pose: _Straight) -> Foot:
    """A foot with its sole and its cells, measured where they are not given."""
    foot: Foot = getattr(block.feet, side)
    sole = foot.sole
    if sole is None:
        low, high = (np.round(end, _MICRON) + 0.0 for end in pose.box(foot.body))
        sole = Sole(back=float(low[0]), front=float(high[0]), right=float(low[1]), left=float(high[1]))
    cells = foot.cells
    if not cells:
        inset_x, inset_y = _CELL_INSET * (sole.front - sole.back), _CELL_INSET * (sole.left - sole.right)
        front, rear = sole.front - inset_x, sole.back + inset_x
        left, right = sole.left - inset_y, sole.right + inset_y
        places = [(front, left), (front, right), (rear, left), (rear, right)]  # as CORNERS
        cells = {f"{side}_cell_{corner}": place for corner, place in zip(CORNERS, places, strict=True)}
    return foot.model_copy(update={"sole": sole, "cells": cells})


def _place_cells(block: BipedSpec, model: mujoco.MjModel, pose: _Straight) -> None:
    """Put the volumes of the force cells where the sole is, level with it."""
    for side in SIDES:
        foot: Foot = getattr(block.feet, side)
        turn = pose.turned(foot.body)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, turn.T.flatten())
        places = quarters(np.array(list(foot.cells.values())), foot.sole)
        for name, (centre, size) in zip(foot.cells, places, strict=True):
            site = int(model.site(f"biped {name}").id)
            wanted = turn.T @ np.array([*centre, -block.legs.ankle_height])
            if not np.allclose(model.site_pos[site], wanted, atol=1e-9) or not np.allclose(turn, np.eye(3)):
                model.site_pos[site], model.site_quat[site] = wanted, quaternion
                model.site_sameframe[site] = int(mujoco.mjtSameFrame.mjSAMEFRAME_NONE)
            model.site_size[site] = size
