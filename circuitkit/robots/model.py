"""From a robot file to a compiled MuJoCo model, with every name bound to an index."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import ExpressionError, InputError, Problem, UnknownNameError, listing, suggest
from circuitkit.base.units import Unit, parse_quantity, parse_unit
from circuitkit.circuit.expressions.dimensions import (
    OpenDimension,
    check_dimension,
    dimension_of,
    named_symbol,
)
from circuitkit.circuit.expressions.expression import Call, Expression
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.robots.channels import Array, Channel, Formula
from circuitkit.robots.mjcf import (
    FREE,
    HINGE,
    SLIDE,
    add_servos,
    compile_mjcf,
    flex_bodies,
    read_mjcf,
    warn_of_servos,
)
from circuitkit.robots.parts import ARITIES, Sensors, bind, column_index
from circuitkit.robots.spec import ChannelSpec, Robot

_ALONG = 0.99  # cosine to an axis from which on a joint goes along it or about it

Complain: TypeAlias = Callable[[str, int], Problem]


@dataclass(frozen=True, eq=False)
class Command:
    """Something of a robot that can be written.

    Attributes:
        name: Name.
        unit: The unit in which it is shown; values are in SI units.
        factors: For each actuator, its control for one SI unit of the command; shape (nu,).
        limits: The command is clipped to these, [SI]; None without.
        description: What it does.
    """

    name: str
    unit: Unit
    factors: Array
    limits: tuple[float, float] | None = None
    description: str = ""


@dataclass(frozen=True)
class Brought:
    """What a block of a plug-in brings to a robot.

    Attributes:
        channels: Further channels.
        commands: Further commands.
        body: What the plug-in itself wants to know of the model.
    """

    channels: Mapping[str, Channel] = field(default_factory=dict)
    commands: Mapping[str, Command] = field(default_factory=dict)
    body: Any = None


class Prepared(Protocol):
    """A block that has added its sensors, and waits for the compiled model."""

    def finish(self, robot: RobotModel) -> Brought:
        """What the block brings; `robot` has no channels and commands of blocks yet."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A compiled robot, with every name bound to an index.

    Attributes:
        robot: The robot file.
        model: The MuJoCo model.
        channels: What can be read.
        commands: What can be written.
        start_qpos: Positions at the start; shape (nq,).
        held: Controls that hold the start, or those of its keyframe; shape (nu,).
        blocks: What blocks of plug-ins made of the model, by the key of the block.
        base: Number of the free joint that carries the robot; None if it has none.
        servo_joints: Joints that have a servo of the robot file, in the order of the MJCF.
        start_act: States of actuators, such as muscles, at the start; shape (na,).
    """

    robot: Robot
    model: mujoco.MjModel
    channels: Mapping[str, Channel]
    commands: Mapping[str, Command]
    start_qpos: Array
    held: Array
    blocks: Mapping[str, Any]
    base: int | None
    servo_joints: tuple[str, ...] = ()
    start_act: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def channel_units(self) -> dict[str, Unit]:
        """Unit of each channel."""
        return {name: channel.unit for name, channel in self.channels.items()}

    @property
    def command_units(self) -> dict[str, Unit]:
        """Unit of each command."""
        return {name: command.unit for name, command in self.commands.items()}

    @property
    def mass_kg(self) -> float:
        """Mass of what the base carries, or of everything without a free base."""
        body = 0 if self.base is None else int(self.model.jnt_bodyid[self.base])
        return float(self.model.body_subtreemass[body])

    def names(self, kind: str) -> list[str]:
        """Names of the parts of a kind, such as `body` or `actuator`; parts without one are left out."""
        counts = {"body": "nbody", "actuator": "nu", "joint": "njnt", "geom": "ngeom", "site": "nsite"}
        found = [getattr(self.model, kind)(i).name for i in range(getattr(self.model, counts[kind]))]
        return [name for name in found if name and not (kind == "body" and name == "world")]

    def number(self, kind: str, name: str) -> int:
        """Number of a part by its name.

        Raises:
            UnknownNameError: The model has none of this name; lists those it has.
        """
        roles: dict[str, int] = {}
        for block in self.blocks.values() if kind == "body" else ():
            roles |= getattr(block, "body_roles", {})
        if name in roles:
            return int(roles[name])
        names = self.names(kind)
        if name not in names:
            raise UnknownNameError(kind, name, dict.fromkeys([*roles, *names]))
        return int(getattr(self.model, kind)(name).id)

    def matching(self, kind: str, pattern: str) -> list[int]:
        """Numbers of the parts whose names match a pattern with `*`.

        Raises:
            UnknownNameError: There is none; lists those there are.
        """
        found = [
            int(getattr(self.model, kind)(name).id) for name in self.names(kind) if fnmatchcase(name, pattern)
        ]
        return found or [self.number(kind, pattern)]


def build_model(
    robot: Robot,
    changes: Iterable[Callable[[RobotModel], object]] = (),
    references: Mapping[str, tuple[Call, Complain]] = MappingProxyType({}),
    *,
    looks: bool = False,
) -> RobotModel:
    """Compile a robot.

    Args:
        robot: The robot file.
        changes: What differs in the compiled model, such as a heavier body; each is called with it.
        references: Of expressions elsewhere, such as a scenario's measures; each becomes a channel whose name
            is its text, such as `position(ball, x)`. With what makes a complaint of a message and an offset.
        looks: Keep geoms that are only seen; physics is the same to the last bit without them, and faster.

    Raises:
        InputError: The MJCF cannot be read, or lacks parts that the robot file names; lists them all.
    """
    mj = _read(robot)
    problems: list[Problem] = []
    if robot.timestep is not None:
        mj.option.timestep = robot.timestep
    if robot.integrator is not None:
        mj.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{robot.integrator.upper()}")
    servos = add_servos(mj, robot, problems)
    sensors = Sensors(mj)
    prepared = _prepared(mj, robot, problems)
    bound = _bind_channels(robot, sensors, problems)
    bound |= _bind_references(references, sensors, problems)
    if problems:
        raise InputError(*problems)
    sees = any(sensor.type == mujoco.mjtSensor.mjSENS_RANGEFINDER for sensor in mj.sensors)
    # Where geoms give a body its inertia whatever it says itself, MuJoCo refuses to leave any out.
    weighs = mj.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    mj.compiler.discardvisual = not (looks or sees or weighs or len(mj.cameras) > 0)
    model = compile_mjcf(mj, robot.mjcf_path)
    warn_of_servos(model, robot)
    start, held = _start(robot, model, servos, problems)
    act = model.key(robot.key).act.copy() if robot.key in _key_names(model) else np.zeros(model.na)
    channels = {name: _channel(name, parts, model) for name, parts in bound.items()}
    commands = _commands(robot, model, problems)
    if problems:
        raise InputError(*problems)
    made = RobotModel(robot, model, channels, commands, start, held, {}, _base(model), tuple(servos), act)
    for kind, block in prepared.items():
        brought = block.finish(made)
        made = RobotModel(
            robot, model, {**brought.channels, **made.channels}, {**brought.commands, **made.commands},
            start, held, {**made.blocks, kind: brought.body}, made.base, made.servo_joints, act,
        )  # fmt: skip
    for change in changes:
        change(made)
    return made


def _prepared(mj: Any, robot: Robot, problems: list[Problem]) -> dict[str, Prepared]:  # noqa: ANN401 - MjSpec is not typed
    """Let the blocks of plug-ins add their sensors."""
    found = {}
    for kind, block in robot.given_blocks.items():
        try:
            found[kind] = block.prepare(mj, robot)
        except InputError as error:  # all that is wrong is said at once
            problems += error.problems
    return found


def _read(robot: Robot) -> Any:  # noqa: ANN401 - as above
    path = robot.mjcf_path
    if not path.is_file():
        message = (
            f"no such file '{path}'; allowed: the path of an MJCF file, from the folder of the robot file"
        )
        raise InputError(robot.problem(("mjcf",), message))
    return read_mjcf(path)


def _base(model: mujoco.MjModel) -> int | None:
    """The free joint that carries most: more moving parts than a loose object, or the heavier of equals."""
    moving = np.bincount(model.body_rootid[model.dof_bodyid], minlength=model.nbody)

    def load(joint: int) -> tuple[int, float]:
        body = int(model.jnt_bodyid[joint])
        return int(moving[model.body_rootid[body]]), float(model.body_subtreemass[body])

    free = [i for i in range(model.njnt) if model.jnt_type[i] == FREE]
    return max(free, key=load, default=None)


@dataclass(frozen=True)
class _Bound:
    """A channel whose sensors are named, before the model is compiled."""

    unit: Unit
    expression: Expression
    description: str = ""
    range: tuple[float, float] | None = None


def _bind_channels(robot: Robot, sensors: Sensors, problems: list[Problem]) -> dict[str, _Bound]:
    found = {}
    for name, spec in robot.channels.items():
        try:
            found[name] = _bound(spec, sensors)
        except ExpressionError as error:
            where = ("channels", name, "is")
            problems.append(robot.problem(where, str(error), offset=error.offset))
    return found


def _bound(spec: ChannelSpec, sensors: Sensors) -> _Bound:
    unit = parse_unit(spec.unit)
    tree = parse_expression(spec.expression, (), units=True, references=ARITIES)
    dimensions: dict[str, OpenDimension] = {}
    shown, value = bind(tree, sensors, dimensions)
    check_dimension(shown, dimensions, OpenDimension(unit.dimension))
    return _Bound(unit, value, spec.description, spec.pair("range"))


def _bind_references(
    references: Mapping[str, tuple[Call, Complain]], sensors: Sensors, problems: list[Problem]
) -> dict[str, _Bound]:
    found = {}
    for text, (call, complain) in references.items():
        dimensions: dict[str, OpenDimension] = {}
        try:
            shown, value = bind(call, sensors, dimensions)
        except ExpressionError as error:
            problems.append(complain(str(error), error.offset))
            continue
        dimension = dimension_of(shown, dimensions)
        unit = parse_unit("1" if dimension is None else named_symbol(dimension.fixed))
        found[text] = _Bound(unit, value)
    return found


def _channel(name: str, parts: _Bound, model: mujoco.MjModel) -> Channel:
    columns = {column: column_index(model, column) for column in parts.expression.names()}
    return Channel(name, parts.unit, Formula(parts.expression, columns), parts.description, parts.range)


def _commands(robot: Robot, model: mujoco.MjModel, problems: list[Problem]) -> dict[str, Command]:
    actuators = [model.actuator(i).name for i in range(model.nu)]
    found = {}
    for name, spec in robot.commands.items():
        factors = np.zeros(model.nu)
        for actuator, factor in spec.to.items():
            if actuator in actuators:
                factors[actuators.index(actuator)] = factor
            else:
                message = f"the robot has no actuator '{actuator}'; allowed: {listing(actuators)}"
                where = ("commands", name, "to", actuator)
                problems.append(robot.problem(where, message, suggest(actuator, actuators)))
        found[name] = Command(name, parse_unit(spec.unit), factors, spec.pair("limits"), spec.description)
    return found


def _key_names(model: mujoco.MjModel) -> list[str]:
    return [model.key(i).name for i in range(model.nkey)]


def _start(
    robot: Robot, model: mujoco.MjModel, servos: Mapping[str, float], problems: list[Problem]
) -> tuple[Array, Array]:
    """Positions at the start, and the controls that hold them."""
    qpos, ctrl = model.qpos0.copy(), np.zeros(model.nu)
    if robot.key is not None:
        keys = _key_names(model)
        if robot.key in keys:
            qpos, ctrl = model.key(robot.key).qpos.copy(), model.key(robot.key).ctrl.copy()
        else:
            message = f"the MJCF has no keyframe '{robot.key}'; allowed: {listing(keys)}"
            problems.append(robot.problem(("key",), message, suggest(robot.key, keys)))
    held = hold_joints(
        model, robot.hold, qpos, ctrl, lambda name, *m: problems.append(robot.problem(("hold", name), *m))
    )
    held |= {int(model.joint(name).id) for name in servos}
    _aim(model, held, qpos, ctrl)
    return qpos, ctrl


def _aim(model: mujoco.MjModel, joints: Iterable[int], qpos: Array, ctrl: Array) -> None:
    """Give the position actuators of some joints the joint's position as target; changes `ctrl` in place."""
    chosen = set(joints)
    for i in range(model.nu):
        joint = int(model.actuator_trnid[i, 0])
        of_joint = model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        if of_joint and joint in chosen and drives_position(model, i):
            ctrl[i] = qpos[model.jnt_qposadr[joint]] * model.actuator_gear[i, 0]


def hold_at(robot: RobotModel, qpos: Array, ctrl: Array) -> Array:
    """The controls of a keyframe; servos that the robot file brings get its positions. Shape (nu,)."""
    held = ctrl.copy()
    if robot.robot.servos_in_use:
        of_servos = [int(robot.model.joint(name).id) for name in robot.servo_joints]
        _aim(robot.model, of_servos, qpos, held)
    return held


def hold_joints(
    model: mujoco.MjModel,
    hold: Mapping[str, str],
    qpos: Array,
    ctrl: Array,
    complain: Callable[..., object],
) -> set[int]:
    """Put joints where they shall be held; position actuators that drive them get the target.

    Args:
        model: The model.
        hold: Angle or position by joint, as text with unit.
        qpos: Positions, changed in place; shape (nq,).
        ctrl: Controls, changed in place; shape (nu,).
        complain: Is told the joint, a message and a hint for each that cannot be held.

    Returns:
        Numbers of the joints.
    """
    names = [model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) in {HINGE, SLIDE}]
    numbers = set()
    for name, text in hold.items():
        if name not in names:
            complain(
                name,
                f"the MJCF has no hinge or slide '{name}'; allowed: {listing(names)}",
                suggest(name, names),
            )
            continue
        joint = int(model.joint(name).id)
        unit = parse_unit("rad" if model.jnt_type[joint] == HINGE else "m")
        quantity = parse_quantity(text)
        if quantity.dimension != unit.dimension:
            complain(name, f"found '{text}'; allowed: a quantity in {unit} or like it")
            continue
        qpos[model.jnt_qposadr[joint]] = quantity.value_si
        numbers.add(joint)
    _aim(model, numbers, qpos, ctrl)
    return numbers


def drives_position(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's control is a position: force = k (control - length) and damping."""
    gain, bias = float(model.actuator_gainprm[actuator, 0]), float(model.actuator_biasprm[actuator, 1])
    affine = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
    return bool(affine and gain > 0 and abs(gain + bias) <= 1e-9 * gain)


def servo_numbers(robot: RobotModel, joints: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of the position actuators of joints, one each; shape (n,).

    Raises:
        UnknownNameError: A joint has none; lists those that have.
    """
    model = robot.model
    of_joint: dict[str, int] = {}
    for i in range(model.nu):
        if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT and drives_position(model, i):
            of_joint.setdefault(model.joint(int(model.actuator_trnid[i, 0])).name, i)
    for name in joints:
        if name not in of_joint:
            kind = "joint with a position servo"
            raise UnknownNameError(kind, name, of_joint)
    return np.array([of_joint[name] for name in joints], dtype=np.int64)


class MobileBase:
    """What carries a robot through the world: a free joint, or slides along x and y and a hinge about z.

    Attributes:
        free: Number of the free joint, if any.
        dofs: Places in `qvel` of the velocity along x (0) and y (1), as far as there are any.
        places: Places in `qpos` of the same.
        turn: Number of the hinge about z, if it stands on one.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Find it."""
        model, self.free = robot.model, robot.base
        self.turn: int | None = None
        self.dofs: dict[int, int] = {}
        self.places: dict[int, int] = {}
        if self.free is not None:
            start, place = int(model.jnt_dofadr[self.free]), int(model.jnt_qposadr[self.free])
            self.dofs, self.places = {0: start, 1: start + 1}, {0: place, 1: place + 1}
            return
        soft = flex_bodies(model)
        for joint, body in enumerate(model.jnt_bodyid.tolist()):
            if model.body_parentid[body] != 0 or body in soft:
                continue
            axis = np.abs(model.jnt_axis[joint])
            if model.jnt_type[joint] == SLIDE and axis[:2].max() > _ALONG:
                self.dofs[int(axis[:2].argmax())] = int(model.jnt_dofadr[joint])
                self.places[int(axis[:2].argmax())] = int(model.jnt_qposadr[joint])
            elif model.jnt_type[joint] == HINGE and axis[2] > _ALONG:
                self.turn = joint
