"""From a robot file to a MuJoCo model with floor, servos and sensors, whatever the MJCF calls its parts."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.biped.gait import LEG_JOINTS, SIDES
from circuitkit.robots.plant import Plant
from circuitkit.biped.sensing import SensorLayout
from circuitkit.robots.spec import RobotSpec

_FLOOR = "floor"
_CELL_HALF_SIZE = (
    0.06  # larger than the foot: a cell's volume reaches from the middle of the sole past its edge
)
_CELL_HALF_HEIGHT = 0.02


@dataclass(frozen=True)
class RobotModel:
    """A compiled robot, with every name bound to an index.

    Attributes:
        spec: The robot file.
        model: The MuJoCo model.
        layout: Where in `sensordata` each sensor stands.
        actuated: Names of the joints that have a servo, in the order of `ctrl`; n of them.
        qpos_index: Their places in `qpos`; shape (n,).
        dof_index: Their places in `qvel`; shape (n,).
        leg_index: Columns of `ctrl` of `LEG_JOINTS`; shape (10,).
        stiffness: Of the servos as they are simulated, shape (n,), [N m/rad].
        posture: Angles of all servos when the legs are straight; shape (n,), [rad].
        torso_id: Body number of the torso.
        feet_id: Body numbers of the feet, left and right.
    """

    spec: RobotSpec
    model: mujoco.MjModel
    layout: SensorLayout
    actuated: tuple[str, ...]
    qpos_index: NDArray[np.int64]
    dof_index: NDArray[np.int64]
    leg_index: NDArray[np.int64]
    stiffness: NDArray[np.float64]
    posture: NDArray[np.float64]
    torso_id: int
    feet_id: tuple[int, int]

    @property
    def mass_kg(self) -> float:
        """Mass of the robot."""
        return float(self.model.body_subtreemass[self.torso_id])


def build_model(spec: RobotSpec, plant: Plant | None = None, *, looks: bool = False) -> RobotModel:
    """Load the MJCF and add floor, servos and sensors.

    Args:
        spec: The robot file.
        plant: How it differs from that; not at all if None.
        looks: Keep geoms that are only seen; physics is the same to the last bit without them, and faster.

    Raises:
        InputError: The MJCF cannot be read, or lacks parts that the robot file names; lists them all.
        UnknownNameError: The plant loads a body that the MJCF does not have.
    """
    plant = Plant() if plant is None else plant
    path = spec.mjcf_path
    if not path.is_file():
        raise InputError(Problem(str(path), 1, 1, "mjcf", "no such file; allowed: the path of an MJCF file"))
    try:
        mj = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise InputError(Problem(str(path), 1, 1, "", f"not an MJCF file: {error}")) from error
    _check_parts(spec, mj)
    mj.compiler.discardvisual = not looks
    _take_out(mj)
    try:
        _add_floor(mj, spec, plant.friction)
        servos = _add_servos(mj, spec, plant.servo_stiffness)
        layout = _add_sensors(mj, spec)
        model = mj.compile()
    except ValueError as error:
        raise InputError(Problem(str(path), 1, 1, "", f"MuJoCo refuses the model: {error}")) from error

    plant.change(model)
    joints = [model.joint(name) for name in servos]
    posture = np.zeros(len(joints))
    for name, angle in spec.posture.items():
        posture[list(servos).index(name)] = angle
    return RobotModel(
        spec=spec,
        model=model,
        layout=layout,
        actuated=tuple(servos),
        qpos_index=np.array([joint.qposadr[0] for joint in joints]),
        dof_index=np.array([joint.dofadr[0] for joint in joints]),
        leg_index=np.array([list(servos).index(spec.joints[role]) for role in LEG_JOINTS]),
        stiffness=np.array(list(servos.values())),
        posture=posture,
        torso_id=model.body(spec.torso).id,
        feet_id=(model.body(spec.feet.left.body).id, model.body(spec.feet.right.body).id),
    )


def _check_parts(spec: RobotSpec, mj: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
    """Complain about every part of the robot file that the MJCF does not have, or not as it must be."""
    hinge, free = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE
    there = {
        "body": [body.name for body in mj.bodies if body.name != "world"],
        "hinge": [joint.name for joint in mj.joints if joint.type == hinge],
        "site": [site.name for site in mj.sites],
    }
    wanted = [
        ("body", spec.torso, "torso"),
        ("site", spec.imu, "imu"),
        *(("body", getattr(spec.feet, side).body, f"feet.{side}.body") for side in SIDES),
        *(("hinge", name, f"joints.{role}") for role, name in spec.joints.items()),
        *(("hinge", name, f"posture.{name}") for name in spec.posture),
    ]
    problems = []
    for kind, name, where in wanted:
        if name not in there[kind]:
            message = f"the MJCF has no {kind} '{name}'; allowed: {listing(there[kind])}"
            problems.append((where, message, suggest(name, there[kind])))
    if spec.torso in there["body"] and [j for j in mj.joints if j.type == free] != mj.body(spec.torso).joints:
        message = f"'{spec.torso}' does not hang from the model's only free joint"
        problems.append(("torso", f"{message}; allowed: the body that does", ""))
    for side in SIDES:
        name = getattr(spec.feet, side).body
        if name in there["body"] and not _soles(mj, name):
            message = f"'{name}' has no geom that can touch the ground; allowed: a body with a sole"
            problems.append((f"feet.{side}.body", message, ""))
    if problems:
        raise InputError(*(Problem(str(spec.mjcf_path), 1, 1, *problem) for problem in problems))


def _soles(mj: Any, foot: str) -> list[Any]:  # noqa: ANN401 - MjSpec is not typed
    """The geoms of a foot that collide."""
    return [geom for geom in mj.body(foot).geoms if geom.contype or geom.conaffinity]


def _take_out(mj: Any) -> None:  # noqa: ANN401 - MjSpec is not typed
    """Remove what is added afresh: servos, sensors, floor; and keyframes, which hold targets of servos."""
    floors = [geom for geom in mj.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
    for part in (*mj.actuators, *mj.sensors, *mj.keys, *floors):
        mj.delete(part)


def _add_floor(mj: Any, spec: RobotSpec, friction: float | None) -> None:  # noqa: ANN401 - MjSpec is not typed
    """A plane that only the robot's colliding geoms touch; their friction is the floor's as well."""
    soles = [geom for side in SIDES for geom in _soles(mj, getattr(spec.feet, side).body)]
    sliding = float(soles[0].friction[0]) if friction is None else friction
    for sole in soles:
        sole.friction[0] = sliding
    floor = mj.worldbody.add_geom(name=_FLOOR, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1])
    floor.friction[0] = sliding
    floor.condim = 3
    floor.contype, floor.conaffinity = 1, 1
    for sole in soles:
        sole.contype, sole.conaffinity = 0, 1


def _add_servos(mj: Any, spec: RobotSpec, factor: float) -> dict[str, float]:  # noqa: ANN401 - MjSpec is not typed
    """A position servo for every hinge, `factor` times as stiff as in the profile; returns how stiff."""
    profile = spec.servo_profiles[spec.servo_profile]
    servos = {}
    for joint in mj.joints:
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
            continue
        servo = next((s for s in profile if any(fnmatchcase(joint.name, p) for p in s.joints)), None)
        if servo is None:
            where = f"servo_profiles.{spec.servo_profile}"
            message = f"no servo for the joint '{joint.name}'; allowed: patterns that match every joint"
            raise InputError(Problem(str(spec.mjcf_path), 1, 1, where, message))
        actuator = mj.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=servo.stiffness * factor, kv=servo.damping)
        actuator.forcelimited = True
        actuator.forcerange = [-servo.torque, servo.torque]
        servos[joint.name] = servo.stiffness * factor
    return servos


def _add_sensors(mj: Any, spec: RobotSpec) -> SensorLayout:  # noqa: ANN401 - MjSpec is not typed
    """Force cells, contact wrenches, CoM, IMU and joints, in the order in which `SensorLayout` reads them."""
    sensor, kind = mj.add_sensor, mujoco.mjtSensor
    body, site = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
    cells: list[str] = []
    for side in SIDES:
        foot = getattr(spec.feet, side)
        cells += foot.cells
        _add_cells(mj, foot, spec.legs.ankle_height)
    for name in cells:
        sensor(name=name, type=kind.mjSENS_TOUCH, objtype=site, objname=name)
    for side in SIDES:
        wrench = sensor(
            name=f"{side}_wrench", type=kind.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM, objname=_FLOOR,
            reftype=body, refname=getattr(spec.feet, side).body,
        )  # fmt: skip
        data = mujoco.mjtConDataField
        wanted = (data.mjCONDATA_FORCE, data.mjCONDATA_TORQUE, data.mjCONDATA_POS)
        wrench.intprm[:3] = [sum(1 << int(field) for field in wanted), _NET_FORCE, 1]
    sensor(name="com", type=kind.mjSENS_SUBTREECOM, objtype=body, objname=spec.torso)
    sensor(name="com_velocity", type=kind.mjSENS_SUBTREELINVEL, objtype=body, objname=spec.torso)
    sensor(name="gyro", type=kind.mjSENS_GYRO, objtype=site, objname=spec.imu)
    sensor(name="accelerometer", type=kind.mjSENS_ACCELEROMETER, objtype=site, objname=spec.imu)
    # XBODY is the body's own frame; BODY would be that of its principal axes of inertia.
    frame = mujoco.mjtObj.mjOBJ_XBODY
    sensor(name="torso_up", type=kind.mjSENS_FRAMEZAXIS, objtype=frame, objname=spec.torso)
    for name in (spec.torso, spec.feet.left.body, spec.feet.right.body):
        sensor(name=f"{name}_position", type=kind.mjSENS_FRAMEPOS, objtype=frame, objname=name)
    for role in LEG_JOINTS:
        joint = spec.joints[role]
        sensor(
            name=f"{joint}_angle", type=kind.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint
        )
    return SensorLayout(cells=tuple(cells))


# Third entry of mjtContactReduce; the sensor then gives one wrench for all contacts of the foot.
_NET_FORCE = 3


def _add_cells(mj: Any, foot: Any, ankle_height_m: float) -> None:  # noqa: ANN401 - MjSpec is not typed
    """The four cells of a foot share its sole: each takes the contacts of its own quarter."""
    positions = np.array(list(foot.cells.values()))
    middle = positions.mean(axis=0)
    for name, position in zip(foot.cells, positions, strict=True):
        quarter = middle + np.sign(position - middle) * _CELL_HALF_SIZE
        mj.body(foot.body).add_site(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[_CELL_HALF_SIZE, _CELL_HALF_SIZE, _CELL_HALF_HEIGHT],
            pos=[*quarter, -ankle_height_m],
            group=4,
        )
