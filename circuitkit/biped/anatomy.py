"""Which parts of an MJCF are torso, feet and legs: what a `biped` block says, and measures for what it omits.

All of them are taken in one pose: torso upright, legs straight, every joint of them at its offset. A torso is
upright where its frame is that of the world, or, where its frame is another one, as it stands in the MJCF.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.source import FileModel
from circuitkit.base.source.fields import Metres, Newtons, Radians
from circuitkit.biped.gait import LEG_JOINTS, SIDES, LegGeometry
from circuitkit.biped.gait.schedule import require_order
from circuitkit.robots import RobotModel
from circuitkit.robots.spec import BlockSpec

Array = NDArray[np.float64]

_LEAST_CELL_M = 0.06  # half the width of a cell's volume: from the middle of the sole past its edge
_CELL_HALF_HEIGHT_M = 0.02
_CELL_INSET = 0.15  # a cell that nobody places is so much of the sole's length and width inside its corner
_ALONG = 0.5  # the least part of a joint's axis that must lie along x or y
_TILTED_RAD = (np.radians(2.0), np.radians(40.0))  # a sole tilted by so much is drawn so, and not meant so
_MICRON = 6  # decimals of a measured length, [m]
_TURNED = 0.01  # how much better a turned torso must fit the roles, for the MJCF's own posture to count

_OPTIONAL = frozenset({"left_ankle_roll", "right_ankle_roll"})
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")

Pair = Annotated[
    tuple[Metres, Metres], BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
]


class Sole(FileModel):
    """Extent of a sole from its ankle."""

    back: Metres
    front: Metres
    right: Metres
    left: Metres

    @model_validator(mode="after")
    def _ordered(self) -> Sole:
        require_order(self, "back", "front")
        require_order(self, "right", "left")
        return self


class Foot(FileModel):
    """One foot."""

    body: str = Field(description="Body of the foot in the MJCF; its frame is what is called the ankle.")
    sole: Sole | None = Field(
        default=None, description="Extent of the sole, for the support polygon; measured if not given."
    )
    cells: Mapping[str, Pair] = Field(
        default={},
        description="Four force cells: forward and left of the ankle; near the sole's corners if not given.",
    )

    @model_validator(mode="after")
    def _four_cells(self) -> Foot:
        if len(self.cells) not in {0, len(CORNERS)}:
            message = f"cells: found {len(self.cells)}; allowed: {len(CORNERS)}, or none"
            raise ValueError(message)
        return self

    @property
    def extent(self) -> Sole:
        """The sole of a compiled robot, where it is known in any case."""
        if self.sole is None:
            message = f"the sole of '{self.body}' is measured when the robot is compiled"
            raise ValueError(message)
        return self.sole


class Feet(FileModel):
    """Both feet."""

    left: Foot
    right: Foot

    @model_validator(mode="after")
    def _own_cells(self) -> Feet:
        for name in self.left.cells:
            if name in self.right.cells:
                message = f"the cell '{name}' is in both feet; allowed: names of their own"
                raise ValueError(message)
        return self


class Legs(FileModel):
    """Lengths of the legs; what is not given is measured in the MJCF, with straight legs."""

    thigh: Metres = Field(default=0.0, gt=0)
    tibia: Metres = Field(default=0.0, gt=0)
    ankle_height: Metres = Field(default=0.0, ge=0, description="Ankle above the sole.")
    hip_offset_x: Metres = Field(default=0.0, description="Hips ahead of the torso's origin.")
    hip_offset_y: Metres = Field(default=0.0, gt=0, description="Half the distance between the feet.")
    hip_offset_z: Metres = Field(default=0.0, description="Hips below the torso's origin.")

    def geometry(self) -> LegGeometry:
        """The same, as the walking pattern wants it."""
        return LegGeometry(self.thigh, self.tibia, self.ankle_height, self.hip_offset_y, self.hip_offset_z)


class ForceCells(FileModel):
    """What the force cells can measure."""

    range: tuple[Newtons, Newtons] = Field(description="Readings are clipped to this.")

    @model_validator(mode="after")
    def _ordered(self) -> ForceCells:
        low, high = self.range
        if low >= high:
            message = f"found a range from {low:g} to {high:g}; allowed: the lower end first"
            raise ValueError(message)
        return self


class LegJoint(FileModel):
    """A joint of a leg that turns the other way, or is measured from another angle, in the MJCF."""

    joint: str = Field(description="Name in the MJCF.")
    sign: int | None = Field(
        default=None,
        description="-1 if it turns the other way: pitch about -y, roll about -x; read off its axis if not "
        "given.",
    )
    offset: Radians = Field(
        default=0.0, description="Its angle in the MJCF when the leg is straight and the foot level."
    )

    @model_validator(mode="after")
    def _is_a_sign(self) -> LegJoint:
        if self.sign not in {None, 1, -1}:
            message = f"found the sign {self.sign}; allowed: 1 or -1"
            raise ValueError(message)
        return self


class BipedSpec(BlockSpec):
    """What the file says; `robot.BipedBlock` says what becomes of it."""

    torso: str = Field(description="Body that hangs from a free joint and carries everything.")
    imu: str | None = Field(
        default=None, description="Site of the inertial measurement unit; the torso's origin if not given."
    )
    feet: Feet = Field(description="For left and right: body, sole, cells.")
    legs: Legs = Field(
        default=Legs(), description="Lengths of the legs; what is not given is measured in the MJCF."
    )
    joints: Mapping[str, str | LegJoint] = Field(
        description="The MJCF's joint by role; {joint: NAME, sign: -1} where it turns the other way."
    )
    force_cells: ForceCells = Field(
        default=ForceCells(range=(0.0, 1e6)),
        description="The range of the force cells, to which readings are clipped.",
    )

    @model_validator(mode="after")
    def _complete(self) -> BipedSpec:
        needed = [name for name in LEG_JOINTS if name not in _OPTIONAL]
        if missing := [name for name in needed if name not in self.joints]:
            message = f"joints: missing {listing(missing)}; required: {listing(needed)}"
            raise ValueError(message)
        if unknown := [name for name in self.joints if name not in LEG_JOINTS]:
            hint = suggest(unknown[0], LEG_JOINTS)
            message = (
                f"joints: unknown '{unknown[0]}'; allowed: {listing(LEG_JOINTS)}{'; ' if hint else ''}{hint}"
            )
            raise ValueError(message)
        return self

    @property
    def roles(self) -> tuple[str, ...]:
        """The legs' joints that the robot has, in the order of `LEG_JOINTS`."""
        return tuple(role for role in LEG_JOINTS if role in self.joints)

    def joint(self, role: str) -> LegJoint:
        """A joint with its sign."""
        found = self.joints[role]
        return LegJoint(joint=found) if isinstance(found, str) else found

    def cells(self, side: str) -> Mapping[str, tuple[float, float]]:
        """The force cells of a foot; where the file gives none, our own names in places to be measured."""
        given = getattr(self.feet, side).cells
        return given or {f"{side}_cell_{corner}": (0.0, 0.0) for corner in CORNERS}


_Block = TypeVar("_Block", bound=BipedSpec)


def measured(block: _Block, robot: RobotModel) -> tuple[_Block, Array]:
    """The block with everything that it leaves open, and the torso's quaternion when it is upright.

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
    for side in SIDES:
        _warn_of_tilted_sole(made, side, robot, pose)
    return made, pose.upright


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


class _Straight:
    """The pose in which everything is measured, at the world's origin.

    Attributes:
        upright: Quaternion of the torso when it is upright and faces along x.
    """

    def __init__(self, block: BipedSpec, robot: RobotModel) -> None:
        self.model = model = robot.model
        self.data = data = mujoco.MjData(model)
        self._block = block
        self._base = base = int(model.jnt_qposadr[model.body_jntadr[model.body(block.torso).id]])
        data.qpos[:] = robot.start_qpos
        data.qpos[base : base + 3] = 0.0
        for role in block.roles:
            joint = block.joint(role)
            data.qpos[model.jnt_qposadr[model.joint(joint.joint).id]] = joint.offset
        self.upright = np.array([1.0, 0.0, 0.0, 0.0])
        plain = self._fit()
        turned = self._facing_x(model.qpos0[base + 3 : base + 7])
        if turned is not None:
            plain_frame, self.upright = self.upright, turned
            if self._fit() < plain + _TURNED:
                self.upright = plain_frame
        self._turn(self.upright)

    def _turn(self, quaternion: Array) -> None:
        self.data.qpos[self._base + 3 : self._base + 7] = quaternion
        mujoco.mj_kinematics(self.model, self.data)

    def _fit(self) -> float:
        """How well the legs are what their roles say: axes along x and y, left is left, feet are below."""
        self._turn(self.upright)
        block = self._block
        axes = [
            abs(float(self.axis(block.joint(role).joint)[1 if role.endswith("pitch") else 0]))
            for role in block.roles
        ]
        left, right = (self.foot(getattr(block.feet, side).body) for side in SIDES)
        hip = self.anchor(block.joint("left_hip_pitch").joint)
        across, down = left - right, hip - left
        lengths = max(float(np.linalg.norm(across)), 1e-9), max(float(np.linalg.norm(down)), 1e-9)
        return float(np.mean(axes)) + float(across[1]) / lengths[0] + float(down[2]) / lengths[1]

    def _facing_x(self, start: Array) -> Array | None:
        """The MJCF's own posture, turned about z so that the axes of the pitches point to the left foot."""
        self._turn(start)
        block = self._block
        left, right = (self.foot(getattr(block.feet, side).body) for side in SIDES)
        axes = [self.axis(block.joint(role).joint) for role in block.roles if role.endswith("pitch")]
        along = np.sum([axis * np.sign(axis @ (left - right)) for axis in axes], axis=0)
        if np.hypot(along[0], along[1]) < _ALONG:
            return None
        half = (np.pi / 2 - np.arctan2(along[1], along[0])) / 2
        found = np.zeros(4)
        mujoco.mju_mulQuat(found, np.array([np.cos(half), 0.0, 0.0, np.sin(half)]), start)
        return found

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

    def normal(self, body: str) -> Array | None:
        """Which way a box that is all that a body touches the ground with faces up; None if it is none."""
        model, number = self.model, int(self.model.body(body).id)
        solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        geoms = np.flatnonzero(solid & (model.geom_bodyid == number))
        if len(geoms) != 1 or model.geom_type[geoms[0]] != mujoco.mjtGeom.mjGEOM_BOX:
            return None
        axes = self.data.geom_xmat[geoms[0]].reshape(3, 3)
        upward = axes[:, np.abs(axes[2]).argmax()]
        found: Array = upward * np.sign(upward[2])
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


def _warn_of_tilted_sole(block: BipedSpec, side: str, robot: RobotModel, pose: _Straight) -> None:
    """Warn of a foot whose box is not level when it shall be: the robot would walk on its edge."""
    foot = getattr(block.feet, side).body
    up = pose.normal(foot)
    if up is None:
        return
    turns = {"pitch": -np.arctan2(up[0], up[2]), "roll": np.arctan2(up[1], up[2])}
    kind = max(turns, key=lambda name: abs(turns[name]))
    role = f"{side}_ankle_{kind}"
    if not _TILTED_RAD[0] < abs(turns[kind]) < _TILTED_RAD[1] or role not in block.joints:
        return
    joint = block.joint(role)
    offset = np.degrees(joint.offset + (joint.sign or 1) * turns[kind])
    robot.robot.warn(
        ("biped", "joints", role),
        f"the sole of '{foot}' is tilted by {abs(np.degrees(turns[kind])):.1f} deg when the leg is straight; "
        f"it is level with {{joint: {joint.joint}, offset: {offset:.1f} deg}}",
    )


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
