"""The `biped` block of a robot file: which parts of an MJCF are torso, feet and legs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.anatomy import BipedSpec, measured, quarters
from circuitkit.biped.gait import LEG_JOINTS, PHASES, SIDES
from circuitkit.biped.ground import checked_ground
from circuitkit.biped.sensing import Array, BipedView, SensorLayout, channels
from circuitkit.robots import Command, Robot, RobotModel
from circuitkit.robots.model import Brought
from circuitkit.robots.start import drives_position

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from circuitkit.simulation.recording import Recording
    from circuitkit.simulation.result import Result, RunSummary

_UPRIGHT = (
    "biped upright"  # site of the torso whose axes are the world's when it is upright and faces along x
)
_ENOUGH = 1.5  # an ankle of less than so many times m g h hardly carries a walk
_NET_FORCE = 3  # of mjtContactReduce: one wrench for all contacts of the foot

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


class BipedBlock(BipedSpec):
    """Says which parts of an MJCF are torso, feet and legs of a robot that walks on two legs."""

    kind: ClassVar[str] = "biped"

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
        model, (block, upright) = robot.model, measured(self.block, robot)
        first = int(model.sensor(self.sensors[0]).adr[0])
        _turn_imu(model, upright)
        cells = (*block.feet.left.cells, *block.feet.right.cells)
        layout = SensorLayout(cells, block.roles, first, int(model.nsensordata))
        body = make_body(robot, block, layout, upright)
        _warn_of_soft_ankles(robot, body)
        positions = np.array([*block.feet.left.cells.values(), *block.feet.right.cells.values()])
        joints = [block.joint(role) for role in block.roles]
        zeros = [(float(joint.sign or 1), joint.offset) for joint in joints]
        found = channels(
            layout, positions, block.legs.hip_offset_y, zeros, block.force_cells.range, body.ground_m
        )
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
        *((("site", block.imu, ("imu",)),) if block.imu is not None else ()),
        *(("body", getattr(block.feet, side).body, ("feet", side, "body")) for side in SIDES),
        *(("hinge", block.joint(role).joint, ("joints", role)) for role in block.roles),
    ]
    paired = {name for pair in mj.pairs for name in (pair.geomname1, pair.geomname2)}
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
        if name in there["body"] and not any(_touches(geom, paired) for geom in mj.body(name).geoms):
            message = f"'{name}' has no geom that can touch the ground; allowed: a body with a sole"
            problems.append(robot.problem(("biped", "feet", side, "body"), message))
    if problems:
        raise InputError(*problems)


def _touches(geom: Any, paired: Set[str]) -> bool:  # noqa: ANN401 - MjSpec is not typed
    return bool(geom.contype or geom.conaffinity or geom.name in paired)


def _add_sensors(block: BipedBlock, mj: Any) -> tuple[str, ...]:  # noqa: ANN401 - MjSpec is not typed
    """Force cells, contact wrenches, CoM, IMU and joints, in the order in which `SensorLayout` reads them."""
    kind, names = mujoco.mjtSensor, list[str]()
    body, site = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE

    def sensor(name: str, **more: Any) -> Any:  # noqa: ANN401 - as above
        names.append(f"biped {name}")  # names of their own, whatever the MJCF calls its parts
        return mj.add_sensor(name=names[-1], **more)

    for side in SIDES:
        _add_cells(mj, getattr(block.feet, side).body, block.cells(side), block.legs.ankle_height)
    upright = mj.body(block.torso).add_site(name=_UPRIGHT, group=4).name
    imu = upright if block.imu is None else block.imu
    for side in SIDES:
        for name in block.cells(side):
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
    sensor("gyro", type=kind.mjSENS_GYRO, objtype=site, objname=imu)
    sensor("accelerometer", type=kind.mjSENS_ACCELEROMETER, objtype=site, objname=imu)
    # XBODY is the body's own frame; BODY would be that of its principal axes of inertia.
    frame = mujoco.mjtObj.mjOBJ_XBODY
    sensor("torso_up", type=kind.mjSENS_FRAMEZAXIS, objtype=frame, objname=block.torso)
    for name in (block.torso, block.feet.left.body, block.feet.right.body):
        sensor(f"{name}_position", type=kind.mjSENS_FRAMEPOS, objtype=frame, objname=name)
    for role in block.roles:
        joint = block.joint(role).joint
        sensor(f"{role}_angle", type=kind.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint)
    return tuple(names)


def _add_cells(
    mj: Any,  # noqa: ANN401 - as above
    body: str,
    cells: Mapping[str, tuple[float, float]],
    ankle_height_m: float,
) -> None:
    """The four cells of a foot share its sole: each takes the contacts of its own quarter."""
    positions = np.array(list(cells.values()))
    for name, (centre, size) in zip(cells, quarters(positions), strict=True):
        mj.body(body).add_site(
            name=f"biped {name}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=size,
            pos=[*centre, -ankle_height_m],
            group=4,
        )


def _turn_imu(model: mujoco.MjModel, upright: Array) -> None:
    """Where the torso's frame is turned, measure in axes that are the world's when it is upright."""
    if upright[0] == 1.0:
        return
    site, up = int(model.site(_UPRIGHT).id), int(model.sensor("biped torso_up").id)
    mujoco.mju_negQuat(model.site_quat[site], upright)
    model.site_sameframe[site] = int(mujoco.mjtSameFrame.mjSAMEFRAME_NONE)
    model.sensor_objtype[up], model.sensor_objid[up] = int(mujoco.mjtObj.mjOBJ_SITE), site


@dataclass(frozen=True, eq=False)
class BipedBody:
    """A compiled biped, with every name of its block bound to an index.

    Attributes:
        model: The MuJoCo model.
        block: The block of the robot file.
        layout: Where in `sensordata` each sensor stands.
        servos: Numbers of the position actuators; n of them.
        controls: Their places in `ctrl`; shape (n,).
        qpos_index: Places of their joints in `qpos`; shape (n,).
        dof_index: Their places in `qvel`; shape (n,).
        gear: Control for one radian; shape (n,).
        stiffness: Of the servos, shape (n,), [N m/rad].
        leg_servo: For each of `block.roles` its place among the n servos.
        leg_sign: For each of them, 1 or -1.
        leg_offset: For each of them, the MJCF's angle at our zero, [rad].
        leg_column: For each of them, its column of `LEG_JOINTS`.
        upright: Quaternion of the torso when it is upright and faces along x; shape (4,).
        start_qpos: Positions at the start of the robot file; shape (nq,).
        held: Controls that hold them; shape (nu,).
        base_qpos: Place of the torso's position in `qpos`; its quaternion follows.
        base_dof: Place of its velocity in `qvel`.
        torso_id: Body number of the torso.
        feet_id: Body numbers of the feet, left and right.
        mass_kg: Mass of the robot.
        ground_m: Height of what it stands on at first, [m].
        outcomes: Words for a run that got to its end, and for one that `until` ended.
    """

    model: mujoco.MjModel
    block: BipedBlock
    layout: SensorLayout
    servos: NDArray[np.int64]
    controls: NDArray[np.int64]
    qpos_index: NDArray[np.int64]
    dof_index: NDArray[np.int64]
    gear: Array
    stiffness: Array
    leg_servo: NDArray[np.int64]
    leg_sign: Array
    leg_column: NDArray[np.int64]
    leg_offset: Array
    upright: Array
    start_qpos: Array
    held: Array
    base_qpos: int
    base_dof: int
    torso_id: int
    feet_id: tuple[int, int]
    mass_kg: float
    ground_m: float

    outcomes: ClassVar[tuple[str, str]] = ("stood", "fell")

    @cached_property
    def body_roles(self) -> dict[str, int]:
        """Bodies by what they are."""
        return {"torso": self.torso_id, "left_foot": self.feet_id[0], "right_foot": self.feet_id[1]}

    @cached_property
    def sensor_roles(self) -> dict[str, range]:
        """Sensors of several numbers, as columns of `sensordata`: noise in them is in all their channels."""
        places = {"com": self.layout.com, "com_velocity": self.layout.com_velocity}
        return {name: range(place.start, place.stop) for name, place in places.items()}

    @cached_property
    def origin_m(self) -> Array:
        """Where in the world the middle between the feet is at first: on the ground, under the hips; (3,)."""
        x, y = self.start_qpos[self.base_qpos : self.base_qpos + 2]
        return np.array([x + self.block.legs.hip_offset_x, y, self.ground_m])

    @property
    def attributes(self) -> dict[str, str]:
        """What the numbers in a recording mean."""
        return {
            "phases": ", ".join(f"{i} {name}" for i, name in enumerate(PHASES)),
            "feet": ", ".join(SIDES),
        }

    def columns(self, recording: Recording) -> dict[str, tuple[Array, Unit]]:
        """What is recorded beside the channels; shape (T, B) each."""
        return BipedView(recording).columns()

    def figures(self, result: Result, summary: RunSummary) -> dict[str, Figure]:
        """Figs. 9 and 10 of a run, by the name of their file."""
        from circuitkit.biped.plots import biped_figures  # brings matplotlib

        return biped_figures(result, summary)

    def comparison(self, results: Sequence[Result]) -> Figure:
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
                    factors[self.controls[k]] = factor * self.leg_sign[place[role]] * self.gear[k]
                found[name] = Command(name, parse_unit("deg"), factors, None, description)
        return found


def make_body(robot: RobotModel, block: BipedBlock, layout: SensorLayout, upright: Array) -> BipedBody:
    """Bind the names of a block to a compiled model.

    Args:
        robot: The compiled robot.
        block: Its block, measured.
        layout: Where its sensors are.
        upright: Quaternion of the torso when it is upright.

    Raises:
        InputError: A joint of the legs has no position servo, or no ground carries the robot.
    """
    model = robot.model
    joint_type = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    servos = [
        i
        for i in range(model.nactuator)
        if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        and int(model.jnt_type[model.actuator_trnid[i, 0]]) in joint_type
        and drives_position(model, i)
    ]
    joints = [int(model.actuator_trnid[i, 0]) for i in servos]
    names = [model.joint(j).name for j in joints]
    if missing := [role for role in block.roles if block.joint(role).joint not in names]:
        name = block.joint(missing[0]).joint
        message = (
            f"the joint '{name}' has no position servo; allowed: {listing(names)}; or give it one by servos"
        )
        raise InputError(robot.robot.problem(("biped", "joints", missing[0]), message))
    torso = int(model.body(block.torso).id)
    base = int(model.body_jntadr[torso])
    gear = np.array([float(model.actuator_gear[model.actuator_outadr[i], 0]) for i in servos])
    gain = np.array([float(model.actuator_gainprm[i, 0]) for i in servos])
    return BipedBody(
        model=model,
        block=block,
        layout=layout,
        servos=np.array(servos, dtype=np.int64),
        controls=np.array([model.actuator_ctrladr[i] for i in servos], dtype=np.int64),
        qpos_index=np.array([model.jnt_qposadr[j] for j in joints], dtype=np.int64),
        dof_index=np.array([model.jnt_dofadr[j] for j in joints], dtype=np.int64),
        gear=gear,
        stiffness=gain * gear * gear,
        leg_servo=np.array([names.index(block.joint(role).joint) for role in block.roles], dtype=np.int64),
        leg_sign=np.array([float(block.joint(role).sign or 1) for role in block.roles]),
        leg_offset=np.array([block.joint(role).offset for role in block.roles]),
        leg_column=np.array([LEG_JOINTS.index(role) for role in block.roles], dtype=np.int64),
        upright=upright,
        start_qpos=robot.start_qpos,
        held=robot.held,
        base_qpos=int(model.jnt_qposadr[base]),
        base_dof=int(model.jnt_dofadr[base]),
        torso_id=torso,
        feet_id=(int(model.body(block.feet.left.body).id), int(model.body(block.feet.right.body).id)),
        mass_kg=float(model.body_subtreemass[torso]),
        ground_m=checked_ground(robot, torso, (block.kind,)),
    )


def _warn_of_soft_ankles(robot: RobotModel, body: BipedBody) -> None:
    """Warn of ankles over which the body falls, whatever their targets are.

    A body of mass m whose centre of mass is h above an ankle of stiffness k is an inverted pendulum on a
    spring: it stands on that leg if k is more than m g h.
    """
    model, data = body.model, mujoco.MjData(body.model)
    data.qpos[:] = body.start_qpos
    data.qpos[body.base_qpos + 3 : body.base_qpos + 7] = body.upright
    data.qpos[body.qpos_index[body.leg_servo]] = body.leg_offset
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    height = data.subtree_com[body.torso_id][2] - data.xpos[body.feet_id[0]][2]
    falls = body.mass_kg * float(np.linalg.norm(model.opt.gravity)) * float(height)
    for role in (name for name in body.block.roles if "ankle" in name):
        stiffness = float(body.stiffness[body.leg_servo[body.block.roles.index(role)]])
        if stiffness < _ENOUGH * falls:
            robot.robot.warn(
                ("biped", "joints", role),
                f"the servo of '{body.block.joint(role).joint}' has {stiffness:.4g} N*m/rad, and the body "
                f"falls over this ankle with m g h = {falls:.3g} N*m/rad; walking takes 5 to 10 times that",
            )
            return


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
