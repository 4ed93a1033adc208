"""The `biped` block of a robot file: which parts of an MJCF are torso, feet and legs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.source import FileModel
from circuitkit.base.source.fields import Metres, Newtons
from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.gait import LEG_JOINTS, PHASES, SIDES, LegGeometry
from circuitkit.biped.sensing import Array, SensorLayout, channels
from circuitkit.biped.view import BipedView
from circuitkit.robots import Command, Robot, RobotModel
from circuitkit.robots.model import Brought, drives_position
from circuitkit.robots.spec import BlockSpec

_CELL_HALF_SIZE = (
    0.06  # larger than the foot: a cell's volume reaches from the middle of the sole past its edge
)
_CELL_HALF_HEIGHT = 0.02
_NET_FORCE = 3  # of mjtContactReduce: one wrench for all contacts of the foot
_OPTIONAL = frozenset({"left_ankle_roll", "right_ankle_roll"})

Pair = Annotated[
    tuple[Metres, Metres], BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
]

# What a controller may add to the legs, by role: factors of the command's angle.
COMMANDS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "ankle_roll": (
        "Ankle roll of both legs; the hips turn back, so that the torso stays upright (eq. 5).",
        {"left_ankle_roll": 1.0, "right_ankle_roll": 1.0, "left_hip_roll": -1.0, "right_hip_roll": -1.0},
    ),
    "ankle_pitch": (
        "Ankle pitch of both legs; the hips turn back.",
        {"left_ankle_pitch": 1.0, "right_ankle_pitch": 1.0, "left_hip_pitch": -1.0, "right_hip_pitch": -1.0},
    ),
    "torso_roll": (
        "Hip roll of both legs; the torso turns about x, positive to the right, the feet stay.",
        {"left_hip_roll": -1.0, "right_hip_roll": -1.0},
    ),
    "torso_pitch": (
        "Hip pitch of both legs; the torso turns about y, positive forward, the feet stay.",
        {"left_hip_pitch": -1.0, "right_hip_pitch": -1.0},
    ),
    "left_foot_y": (
        "The left leg swings about its hip, positive to the left; the sole stays parallel.",
        {"left_hip_roll": 1.0, "left_ankle_roll": -1.0},
    ),
    "right_foot_y": (
        "The right leg swings about its hip, positive to the left; the sole stays parallel.",
        {"right_hip_roll": 1.0, "right_ankle_roll": -1.0},
    ),
    "left_foot_x": (
        "The left leg swings about its hip, positive forward; the sole stays parallel.",
        {"left_hip_pitch": -1.0, "left_ankle_pitch": 1.0},
    ),
    "right_foot_x": (
        "The right leg swings about its hip, positive forward; the sole stays parallel.",
        {"right_hip_pitch": -1.0, "right_ankle_pitch": 1.0},
    ),
    "left_leg_lift": (
        "Thigh and tibia of the left leg turn by the angle against each other, which shortens the leg.",
        {"left_hip_pitch": -1.0, "left_knee_pitch": 2.0, "left_ankle_pitch": -1.0},
    ),
    "right_leg_lift": (
        "Thigh and tibia of the right leg turn by the angle against each other, which shortens the leg.",
        {"right_hip_pitch": -1.0, "right_knee_pitch": 2.0, "right_ankle_pitch": -1.0},
    ),
}


class Sole(FileModel):
    """Extent of a sole from its ankle."""

    back: Metres
    front: Metres
    right: Metres
    left: Metres

    @model_validator(mode="after")
    def _ordered(self) -> Sole:
        for low, high in (("back", "front"), ("right", "left")):
            found = getattr(self, low), getattr(self, high)
            if found[0] >= found[1]:
                numbers = f"found {low} {found[0]:g} and {high} {found[1]:g}"
                message = f"{numbers}; allowed: {low} before {high}"
                raise ValueError(message)
        return self


class Foot(FileModel):
    """One foot."""

    body: str = Field(description="Body of the foot in the MJCF; its frame sits in the ankle.")
    sole: Sole = Field(description="Extent of the sole, for the support polygon.")
    cells: Mapping[str, Pair] = Field(
        min_length=4, max_length=4, description="The four force cells: forward and left of the ankle."
    )


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
    """Lengths of the legs."""

    thigh: Metres = Field(gt=0)
    tibia: Metres = Field(gt=0)
    ankle_height: Metres = Field(gt=0)
    hip_offset_x: Metres = Field(default=0.0, description="Hips ahead of the torso's origin.")
    hip_offset_y: Metres = Field(gt=0)
    hip_offset_z: Metres = Field(description="Hips below the torso's origin.")

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
    sign: int = Field(default=1, description="-1 if it turns the other way: pitch about -y, roll about -x.")

    @model_validator(mode="after")
    def _is_a_sign(self) -> LegJoint:
        if self.sign not in {1, -1}:
            message = f"found the sign {self.sign}; allowed: 1 or -1"
            raise ValueError(message)
        return self


class BipedBlock(BlockSpec):
    """Torso, feet and legs of a robot that walks on two legs."""

    kind: ClassVar[str] = "biped"

    torso: str = Field(description="Body that carries the head and hangs from a free joint.")
    imu: str = Field(description="Site of the inertial measurement unit.")
    feet: Feet
    legs: Legs
    joints: Mapping[str, str | LegJoint] = Field(
        description="The MJCF's joint by role; {joint: NAME, sign: -1} where it turns the other way."
    )
    force_cells: ForceCells = ForceCells(range=(0.0, 1e6))

    @model_validator(mode="after")
    def _complete(self) -> BipedBlock:
        needed = [name for name in LEG_JOINTS if name not in _OPTIONAL]
        if missing := [name for name in needed if name not in self.joints]:
            message = f"joints: missing {listing(missing)}; required: {listing(needed)}"
            raise ValueError(message)
        if unknown := [name for name in self.joints if name not in LEG_JOINTS]:
            hint = suggest(unknown[0], LEG_JOINTS)
            message = f"joints: unknown '{unknown[0]}'; allowed: {listing(LEG_JOINTS)}{'; ' if hint else ''}{hint}"
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

    def prepare(self, mj: Any, robot: Robot) -> _Prepared:  # noqa: ANN401 - MjSpec is not typed
        """Check that the parts are there, and add the sensors."""
        _check_parts(self, mj, robot)
        return _Prepared(self, _add_sensors(self, mj))


@dataclass(frozen=True)
class _Prepared:
    block: BipedBlock
    sensors: tuple[str, ...]

    def finish(self, robot: RobotModel) -> Brought:
        """What a biped brings: channels, commands, and itself."""
        block, model = self.block, robot.model
        first = int(model.sensor(self.sensors[0]).adr[0])
        cells = (*block.feet.left.cells, *block.feet.right.cells)
        layout = SensorLayout(cells, block.roles, first, int(model.nsensordata))
        body = make_body(robot, block, layout)
        positions = np.array([*block.feet.left.cells.values(), *block.feet.right.cells.values()])
        signs = [float(block.joint(role).sign) for role in block.roles]
        found = channels(layout, positions, block.legs.hip_offset_y, signs, block.force_cells.range)
        return Brought(found, body.commands(), body)


def _check_parts(block: BipedBlock, mj: Any, robot: Robot) -> None:  # noqa: ANN401 - MjSpec is not typed
    """Complain about every part of the block that the MJCF does not have, or not as it must be."""
    hinge, free = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE
    there = {
        "body": [body.name for body in mj.bodies if body.name != "world"],
        "hinge": [joint.name for joint in mj.joints if joint.type == hinge],
        "site": [site.name for site in mj.sites],
    }
    wanted = [
        ("body", block.torso, ("torso",)),
        ("site", block.imu, ("imu",)),
        *(("body", getattr(block.feet, side).body, ("feet", side, "body")) for side in SIDES),
        *(("hinge", block.joint(role).joint, ("joints", role)) for role in block.roles),
    ]
    problems: list[Problem] = []
    for kind, name, where in wanted:
        if name not in there[kind]:
            message = f"the MJCF has no {kind} '{name}'; allowed: {listing(n for n in there[kind] if n)}"
            problems.append(robot.problem(("biped", *where), message, suggest(name, there[kind])))
    if block.torso in there["body"] and not any(joint.type == free for joint in mj.body(block.torso).joints):
        message = f"'{block.torso}' does not hang from a free joint; allowed: the body that does"
        problems.append(robot.problem(("biped", "torso"), message))
    for side in SIDES:
        name = getattr(block.feet, side).body
        if name in there["body"] and not any(g.contype or g.conaffinity for g in mj.body(name).geoms):
            message = f"'{name}' has no geom that can touch the ground; allowed: a body with a sole"
            problems.append(robot.problem(("biped", "feet", side, "body"), message))
    if problems:
        raise InputError(*problems)


def _add_sensors(block: BipedBlock, mj: Any) -> tuple[str, ...]:  # noqa: ANN401 - MjSpec is not typed
    """Force cells, contact wrenches, CoM, IMU and joints, in the order in which `SensorLayout` reads them."""
    kind, names = mujoco.mjtSensor, list[str]()
    body, site = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE

    def sensor(name: str, **more: Any) -> Any:  # noqa: ANN401 - as above
        names.append(f"biped {name}")  # names of their own, whatever the MJCF calls its parts
        return mj.add_sensor(name=names[-1], **more)

    for side in SIDES:
        foot = getattr(block.feet, side)
        _add_cells(mj, foot, block.legs.ankle_height)
    for side in SIDES:
        for name in getattr(block.feet, side).cells:
            sensor(name, type=kind.mjSENS_TOUCH, objtype=site, objname=f"biped {name}")
    for side in SIDES:
        wrench = sensor(
            f"{side}_wrench", type=kind.mjSENS_CONTACT, objtype=mujoco.mjtObj.mjOBJ_UNKNOWN, objname="",
            reftype=body, refname=getattr(block.feet, side).body,
        )  # fmt: skip
        data = mujoco.mjtConDataField
        wanted = (data.mjCONDATA_FORCE, data.mjCONDATA_TORQUE, data.mjCONDATA_POS)
        wrench.intprm[:3] = [sum(1 << int(field) for field in wanted), _NET_FORCE, 1]
    sensor("com", type=kind.mjSENS_SUBTREECOM, objtype=body, objname=block.torso)
    sensor("com_velocity", type=kind.mjSENS_SUBTREELINVEL, objtype=body, objname=block.torso)
    sensor("gyro", type=kind.mjSENS_GYRO, objtype=site, objname=block.imu)
    sensor("accelerometer", type=kind.mjSENS_ACCELEROMETER, objtype=site, objname=block.imu)
    # XBODY is the body's own frame; BODY would be that of its principal axes of inertia.
    frame = mujoco.mjtObj.mjOBJ_XBODY
    sensor("torso_up", type=kind.mjSENS_FRAMEZAXIS, objtype=frame, objname=block.torso)
    for name in (block.torso, block.feet.left.body, block.feet.right.body):
        sensor(f"{name}_position", type=kind.mjSENS_FRAMEPOS, objtype=frame, objname=name)
    for role in block.roles:
        joint = block.joint(role).joint
        sensor(f"{role}_angle", type=kind.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint)
    return tuple(names)


def _add_cells(mj: Any, foot: Foot, ankle_height_m: float) -> None:  # noqa: ANN401 - MjSpec is not typed
    """The four cells of a foot share its sole: each takes the contacts of its own quarter."""
    positions = np.array(list(foot.cells.values()))
    middle = positions.mean(axis=0)
    for name, position in zip(foot.cells, positions, strict=True):
        quarter = middle + np.sign(position - middle) * _CELL_HALF_SIZE
        mj.body(foot.body).add_site(
            name=f"biped {name}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[_CELL_HALF_SIZE, _CELL_HALF_SIZE, _CELL_HALF_HEIGHT],
            pos=[*quarter, -ankle_height_m],
            group=4,
        )


@dataclass(frozen=True, eq=False)
class BipedBody:
    """A compiled biped, with every name of its block bound to an index.

    Attributes:
        model: The MuJoCo model.
        block: The block of the robot file.
        layout: Where in `sensordata` each sensor stands.
        servos: Numbers of the position actuators, in the order of `ctrl`; n of them.
        qpos_index: Places of their joints in `qpos`; shape (n,).
        dof_index: Their places in `qvel`; shape (n,).
        gear: Control for one radian; shape (n,).
        stiffness: Of the servos, shape (n,), [N m/rad].
        leg_servo: For each of `block.roles` its place among the n servos.
        leg_sign: For each of them, 1 or -1.
        leg_column: For each of them, its column of `LEG_JOINTS`.
        start_qpos: Positions at the start of the robot file; shape (nq,).
        held: Controls that hold them; shape (nu,).
        base_qpos: Place of the torso's position in `qpos`; its quaternion follows.
        base_dof: Place of its velocity in `qvel`.
        torso_id: Body number of the torso.
        feet_id: Body numbers of the feet, left and right.
        mass_kg: Mass of the robot.
    """

    model: mujoco.MjModel
    block: BipedBlock
    layout: SensorLayout
    servos: NDArray[np.int64]
    qpos_index: NDArray[np.int64]
    dof_index: NDArray[np.int64]
    gear: Array
    stiffness: Array
    leg_servo: NDArray[np.int64]
    leg_sign: Array
    leg_column: NDArray[np.int64]
    start_qpos: Array
    held: Array
    base_qpos: int
    base_dof: int
    torso_id: int
    feet_id: tuple[int, int]
    mass_kg: float

    stands: ClassVar[bool] = True

    @cached_property
    def body_roles(self) -> dict[str, int]:
        """Bodies by what they are."""
        return {"torso": self.torso_id, "left_foot": self.feet_id[0], "right_foot": self.feet_id[1]}

    @cached_property
    def sensor_roles(self) -> dict[str, range]:
        """Sensors of several numbers, as columns of `sensordata`: noise in them is noise in all channels of them."""
        places = {"com": self.layout.com, "com_velocity": self.layout.com_velocity}
        return {name: range(place.start, place.stop) for name, place in places.items()}

    @property
    def attributes(self) -> dict[str, str]:
        """What the numbers in a recording mean."""
        return {
            "phases": ", ".join(f"{i} {name}" for i, name in enumerate(PHASES)),
            "feet": ", ".join(SIDES),
        }

    def columns(self, recording: Any) -> dict[str, tuple[Array, Unit]]:  # noqa: ANN401 - a recording, which is above
        """What is recorded beside the channels; shape (T, B) each."""
        return BipedView(recording).columns()

    def figures(self, result: Any, summary: Any) -> dict[str, Any]:  # noqa: ANN401 - of packages that are above
        """Figs. 9 and 10 of a run, by the name of their file."""
        from circuitkit.biped.plots import biped_figures  # brings matplotlib

        return biped_figures(result, summary)

    def comparison(self, results: Any) -> Any:  # noqa: ANN401 - as above
        """A picture of several runs side by side."""
        from circuitkit.biped.plots import comparison_figure  # brings matplotlib

        return comparison_figure(results)

    def commands(self) -> dict[str, Command]:
        """The commands of `COMMANDS` whose joints the robot has."""
        place = {role: i for i, role in enumerate(self.block.roles)}
        found = {}
        for name, (description, joints) in COMMANDS.items():
            if all(role in place for role in joints):
                factors = np.zeros(self.model.nu)
                for role, factor in joints.items():
                    k = self.leg_servo[place[role]]
                    factors[self.servos[k]] = factor * self.leg_sign[place[role]] * self.gear[k]
                found[name] = Command(name, parse_unit("deg"), factors, None, description)
        return found


def make_body(robot: RobotModel, block: BipedBlock, layout: SensorLayout) -> BipedBody:
    """Bind the names of a block to a compiled model.

    Raises:
        InputError: A joint of the legs has no position servo.
    """
    model = robot.model
    joint_type = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    servos = [
        i
        for i in range(model.nu)
        if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        and int(model.jnt_type[model.actuator_trnid[i, 0]]) in joint_type
        and drives_position(model, i)
    ]
    joints = [int(model.actuator_trnid[i, 0]) for i in servos]
    names = [model.joint(j).name for j in joints]
    if missing := [role for role in block.roles if block.joint(role).joint not in names]:
        name = block.joint(missing[0]).joint
        message = f"the joint '{name}' has no position servo; allowed: {listing(names)}; or give it one by servos"
        raise InputError(robot.robot.problem(("biped", "joints", missing[0]), message))
    torso = int(model.body(block.torso).id)
    base = int(model.body_jntadr[torso])
    gear = np.array([float(model.actuator_gear[i, 0]) for i in servos])
    gain = np.array([float(model.actuator_gainprm[i, 0]) for i in servos])
    return BipedBody(
        model=model,
        block=block,
        layout=layout,
        servos=np.array(servos, dtype=np.int64),
        qpos_index=np.array([model.jnt_qposadr[j] for j in joints], dtype=np.int64),
        dof_index=np.array([model.jnt_dofadr[j] for j in joints], dtype=np.int64),
        gear=gear,
        stiffness=gain * gear * gear,
        leg_servo=np.array([names.index(block.joint(role).joint) for role in block.roles], dtype=np.int64),
        leg_sign=np.array([float(block.joint(role).sign) for role in block.roles]),
        leg_column=np.array([LEG_JOINTS.index(role) for role in block.roles], dtype=np.int64),
        start_qpos=robot.start_qpos,
        held=robot.held,
        base_qpos=int(model.jnt_qposadr[base]),
        base_dof=int(model.jnt_dofadr[base]),
        torso_id=torso,
        feet_id=(int(model.body(block.feet.left.body).id), int(model.body(block.feet.right.body).id)),
        mass_kg=float(model.body_subtreemass[torso]),
    )


def biped_of(robot: RobotModel) -> BipedBody:
    """The biped of a robot.

    Raises:
        InputError: Its file has no `biped` block.
    """
    if (found := robot.blocks.get(BipedBlock.kind)) is None:
        message = "the robot file has no block 'biped', which says what are torso, feet and legs"
        raise InputError(robot.robot.problem((), message))
    body: BipedBody = found
    return body
