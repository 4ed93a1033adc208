"""An MJCF as its author wrote it, and position servos in the place of its actuators.

Every part gets a name, and what MuJoCo says reaches the user.
"""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import mujoco

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.patterns import matches
from circuitkit.base.reading import not_a_name
from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Unit, parse_unit
from circuitkit.robots.mjcf_files import require_files
from circuitkit.robots.spec import Robot, Servo

HINGE, SLIDE, FREE = (
    int(kind)
    for kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE)
)
_LOG = logging.getLogger(__name__)
_Made = TypeVar("_Made")
_NAMED = ("bodies", "joints", "sites", "tendons", "actuators", "sensors", "keys")
_SINGULAR = {"bodies": "body"}
_LINE = re.compile(r"\b[Ll]ine (?:number=)?(\d+)")
_GONE = dict.fromkeys(  # what MuJoCo had before version 4, by how its complaints name it
    ("'composite'", "mujoco.elasticity"),
    "MuJoCo 4 has neither; a flexcomp with <elasticity> takes their place",
)


def read_mjcf(path: Path) -> Any:  # noqa: ANN401 - MjSpec is not typed
    """Read an MJCF; its files are found from its own folder. Parts without a name get one, see `name_parts`.

    Raises:
        InputError: It cannot be read; says why.
    """
    require_files(path)
    # MuJoCo keeps assets by name and by the second of their last change: an edited mesh may be the old one.
    mujoco.mj_clearCache(mujoco.mj_getCache())
    with _said_by_mujoco(path):
        what = f"MuJoCo {mujoco.__version__} cannot read it"
        spec = _or_complain(path, what, lambda: mujoco.MjSpec.from_file(str(path)))
    _or_complain(path, "found a name that is not text in UTF-8", lambda: _read_names(spec))
    name_parts(spec)
    for plural in _NAMED:
        for part in getattr(spec, plural):
            if complaint := not_a_name(part.name):
                raise InputError(Problem(str(path), 1, 1, plural, complaint))
    return spec


def compile_mjcf(spec: Any, path: Path) -> mujoco.MjModel:  # noqa: ANN401 - as above
    """Compile what was read; the model never sets an exploded state back by itself.

    Raises:
        InputError: MuJoCo refuses it; says why.
    """
    with _said_by_mujoco(path):
        model = _or_complain(path, "MuJoCo refuses the model", spec.compile)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def _read_names(spec: Any) -> list[str]:  # noqa: ANN401 - as above
    """The names of all parts, which MuJoCo takes as bytes of any kind and decodes when they are asked for."""
    return [part.name for plural in (*_NAMED, "geoms", "cameras") for part in getattr(spec, plural)]


def name_parts(spec: Any) -> None:  # noqa: ANN401 - as above
    """Give a name to every body, joint, site, tendon, actuator, sensor and keyframe that has none.

    An actuator is called like the part that it drives, and everything else by kind and number from 0, such as
    `joint_3`; where that is taken, an underscore follows. Names change nothing in the physics.
    """
    for plural in _NAMED:
        kind = _SINGULAR.get(plural, plural.removesuffix("s"))
        parts = list(getattr(spec, plural))
        taken = {part.name for part in parts}
        for number, part in enumerate(parts):
            if not part.name:
                name = (plural == "actuators" and part.target) or f"{kind}_{number}"
                while name in taken:
                    name += "_"
                part.name = name
                taken.add(name)


def flex_bodies(model: mujoco.MjModel) -> set[int]:
    """Numbers of the bodies that are no more than the vertices of something soft."""
    vertices = {*model.flex_vertbodyid.tolist(), *model.flex_nodebodyid.tolist()}
    return {body for body in vertices if body >= 0 and not model.body_geomnum[body]}


def _or_complain(path: Path, what: str, make: Callable[[], _Made]) -> _Made:
    try:
        return make()
    except (ValueError, TypeError, OverflowError, mujoco.FatalError) as error:
        text = "; ".join(line.strip() for line in str(error).splitlines() if line.strip())
        hint = next((words for part, words in _GONE.items() if part in text), "")
        lines = [int(number) for number in _LINE.findall(text)]  # 0 for what another file includes
        raise InputError(Problem(str(path), max([1, *lines[-1:]]), 1, "", f"{what}: {text}", hint)) from error


@contextmanager
def _said_by_mujoco(path: Path) -> Iterator[None]:
    """Pass on MuJoCo's warnings, each one once, as lines that name the file."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        yield
    for each in said:
        _tell(str(path), str(each.message))


@cache
def _tell(path: str, text: str) -> None:
    _LOG.warning("%s: MuJoCo says: %s", path, text)


# Units of a servo's numbers, and of what a joint is held at, by the joint's type.
SERVO_UNITS: Mapping[int, Mapping[str, Unit]] = {
    kind: {key: parse_unit(text) for key, text in units.items()}
    for kind, units in {
        HINGE: {"stiffness": "N*m/rad", "damping": "N*m*s/rad", "torque": "N*m"},
        SLIDE: {"stiffness": "N/m", "damping": "N*s/m", "torque": "N"},
    }.items()
}
HELD_UNITS: Mapping[int, Unit] = {HINGE: parse_unit("rad"), SLIDE: parse_unit("m")}
TYPE_NAMES: Mapping[int, str] = {HINGE: "hinge", SLIDE: "slide"}
_TURNING = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
OF_JOINT = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_OFF = mujoco.mjtLimited.mjLIMITED_FALSE
_STEPS = (2e-3, 1e-3, 0.5e-3, 0.2e-3, 0.1e-3)  # time steps to advise, [s]
_BOUND, _WELL_BELOW = 2.0, 1.5  # see warn_of_servos


def add_servos(mj: Any, robot: Robot, problems: list[Problem]) -> dict[str, float]:  # noqa: ANN401 - MjSpec is not typed
    """Put a position servo in the place of the actuators of every joint that the robot file gives one.

    Sensors of an actuator that goes become sensors of the servo that takes its place. Keyframes keep the
    controls of the actuators that stay.

    Args:
        mj: The MJCF, changed in place.
        robot: The robot file.
        problems: Takes what is wrong.

    Returns:
        Stiffness by joint.
    """
    wanted = robot.servos_in_use
    if not wanted:
        return {}
    chosen = _chosen(mj, robot, problems)
    replaced = [a for a in mj.actuators if a.trntype in OF_JOINT and a.target in chosen]
    target_of = {actuator.name: actuator.target for actuator in replaced}
    kept = [actuator.name for actuator in mj.actuators if actuator.name not in target_of]
    _keep_controls(mj, robot, kept, len(chosen))
    for actuator in replaced:
        mj.delete(actuator)
    names = {joint: joint if joint not in kept else f"{joint} servo" for joint in chosen}
    for joint, servo in chosen.items():
        _add_servo(mj, names[joint], joint, servo)
    for sensor in mj.sensors:
        if sensor.objtype == mujoco.mjtObj.mjOBJ_ACTUATOR and sensor.objname in target_of:
            sensor.objname = names[target_of[sensor.objname]]
    return {joint: servo.stiffness.value_si for joint, servo in chosen.items()}


def _servos_place(robot: Robot, number: int) -> Place:
    """Where in the robot file the servos in use have their entry of a number."""
    if isinstance(robot.servos, Mapping):
        return ("servos", robot.servo_profile or next(iter(robot.servos)), number)
    return ("servos", number)


def warn_of_servos(model: mujoco.MjModel, robot: Robot) -> None:
    """Warn of servos of the robot file that shake by themselves, because Euler's method takes too long steps.

    A servo of stiffness k and damping d on an inertia I, of which the next velocity is computed from the last
    one, is stable as long as d h / I + k h^2 / (2 I) < 2, with h the time step. Implicit methods compute the
    damping from the next velocity and have no such bound for it.
    """
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_EULER:
        return
    step = float(model.opt.timestep)
    for number, servo in enumerate(robot.servos_in_use):
        stiffness, damping = servo.stiffness.value_si, servo.damping.value_si
        shaking = []
        for joint in range(model.njnt):
            name = model.joint(joint).name
            owner = next((s for s in robot.servos_in_use if any(matches(name, p) for p in s.joints)), None)
            if owner is servo and int(model.jnt_type[joint]) in {HINGE, SLIDE}:
                agile = float(model.dof_invweight0[model.jnt_dofadr[joint]])
                shaking.append(((damping * step + stiffness * step**2 / 2) * agile, name, agile))
        gain, name, agile = max(shaking, default=(0.0, "", 0.0))
        if gain <= _BOUND:
            continue
        bearable = [h for h in _STEPS if (damping * h + stiffness * h**2 / 2) * agile < _WELL_BELOW]
        shorter = f"timestep: {bearable[0] * 1e3:g} ms, " if bearable else ""
        robot.warn(
            _servos_place(robot, number),
            f"the servo of '{name}' shakes by itself: Euler's method in steps of {step * 1e3:g} ms does not "
            f"bear a damping of {damping:g} and a stiffness of {stiffness:g} on an inertia of "
            f"{1 / agile:.2g} kg m^2; allowed: integrator: implicitfast in the robot file, {shorter}or less "
            "damping",
        )


def _chosen(mj: Any, robot: Robot, problems: list[Problem]) -> dict[str, Servo]:  # noqa: ANN401 - as above
    """The servo of each joint that gets one."""
    wanted = robot.servos_in_use
    kinds = {joint.name: int(joint.type) for joint in mj.joints if joint.type in _TURNING}
    names = list(kinds)
    chosen: dict[str, Servo] = {}
    for i, servo in enumerate(wanted):
        mine = [n for n in names if n not in chosen and any(matches(n, p) for p in servo.joints)]
        chosen |= dict.fromkeys(mine, servo)
        for key, message in _misfits(servo, {name: kinds[name] for name in mine}):
            problems.append(robot.problem((*_servos_place(robot, i), key), message))
    for i, servo in enumerate(wanted):
        for pattern in servo.joints:
            if not any(matches(name, pattern) for name in names):
                message = (
                    f"the MJCF has no hinge or slide '{pattern}'; allowed: {listing(names)}, or a pattern "
                    "with *"
                )
                where = (*_servos_place(robot, i), "joints")
                problems.append(robot.problem(where, message, suggest(pattern, names)))
    return {name: chosen[name] for name in names if name in chosen}


def _misfits(servo: Servo, kinds: Mapping[str, int]) -> Iterator[tuple[str, str]]:
    """The numbers of a servo whose unit is that of another type of joint, each once, and what is wrong."""
    for key in ("stiffness", "damping", "torque", "reach"):
        if (found := getattr(servo, key)) is None:
            continue
        for name, kind in kinds.items():
            unit = HELD_UNITS[kind] if key == "reach" else SERVO_UNITS[kind][key]
            if found.unit != DIMENSIONLESS and found.dimension != unit.dimension:
                yield (
                    key,
                    f"found '{found}', but {name} is a {TYPE_NAMES[kind]}; allowed: a quantity in {unit}",
                )
                break


def _add_servo(mj: Any, name: str, joint: str, servo: Servo) -> None:  # noqa: ANN401 - as above
    """Add a servo that is what the robot file says, whatever the MJCF's defaults for actuators are."""
    actuator = mj.add_actuator(name=name, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_position(kp=servo.stiffness.value_si, kv=servo.damping.value_si)
    actuator.gear = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    actuator.ctrllimited = actuator.actlimited = _OFF
    actuator.ctrlrange = actuator.actrange = [0.0, 0.0]
    actuator.inheritrange = 0.0
    actuator.armature = actuator.delay = 0.0
    actuator.damping = [0.0, 0.0, 0.0]
    actuator.nsample = 0
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    actuator.forcerange = [-servo.torque.value_si, servo.torque.value_si]


def _keep_controls(
    mj: Any,  # noqa: ANN401 - as above
    robot: Robot,
    kept: list[str],
    servos: int,
) -> None:
    """Leave in each keyframe what is for the actuators that stay; servos hold the keyframe's positions."""
    if not any(len(key.ctrl) or len(key.act) for key in mj.keys):
        return
    model = compile_mjcf(mj.copy(), robot.mjcf_path)
    numbers = [int(model.actuator(name).id) for name in kept]
    spans = [(int(model.actuator_actadr[i]), int(model.actuator_actnum[i])) for i in numbers]
    for number, key in enumerate(mj.keys):
        key.ctrl = [*model.key_ctrl[number][numbers], *[0.0] * servos]
        key.act = [
            value for start, count in spans for value in model.key_act[number][start : start + max(count, 0)]
        ]
