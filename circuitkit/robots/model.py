"""From a robot file to a compiled MuJoCo model, with every name bound to an index."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import ExpressionError, InputError, Problem, UnknownNameError, listing, suggest
from circuitkit.base.patterns import matches
from circuitkit.base.units import Unit, parse_unit
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
    add_servos,
    compile_mjcf,
    read_mjcf,
    warn_of_servos,
)
from circuitkit.robots.parts import ARITIES, bind
from circuitkit.robots.sensors import Sensors, column_index
from circuitkit.robots.spec import RESERVED, ChannelSpec, Robot
from circuitkit.robots.start import StartState, aim, drives_position, of_joint, start_of

_LAST_GROUP = 30  # of actuators that can be disabled, as MuJoCo says

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
        rate: By how much it may change in a second, [SI/s]; None without.
    """

    name: str
    unit: Unit
    factors: Array
    limits: tuple[float, float] | None = None
    description: str = ""
    rate: float | None = None


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
        start: What it starts with beside them.
        held: Controls that hold the start, or those of its keyframe; shape (nu,).
        blocks: What blocks of plug-ins made of the model, by the key of the block.
        base: Number of the free joint that carries the robot; None if it has none.
        servo_joints: Joints that have a servo of the robot file, in the order of the MJCF.
    """

    robot: Robot
    model: mujoco.MjModel
    channels: Mapping[str, Channel]
    commands: Mapping[str, Command]
    start_qpos: Array
    start: StartState
    held: Array
    blocks: Mapping[str, Any]
    base: int | None
    servo_joints: tuple[str, ...] = ()

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
        counts = {"body": "nbody", "actuator": "nactuator", "joint": "njnt", "geom": "ngeom", "site": "nsite"}
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
            int(getattr(self.model, kind)(name).id) for name in self.names(kind) if matches(name, pattern)
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
    problems += _names_with_another_meaning(robot, robot.channels, robot.commands)
    if problems:
        raise InputError(*problems)
    sees = any(sensor.type == mujoco.mjtSensor.mjSENS_RANGEFINDER for sensor in mj.sensors)
    # Where geoms give a body its inertia whatever it says itself, MuJoCo refuses to leave any out.
    weighs = mj.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    mj.compiler.discardvisual = not (looks or sees or weighs or len(mj.cameras) > 0)
    model = compile_mjcf(mj, robot.mjcf_path)
    warn_of_servos(model, robot)
    _require_effects(robot, model, servos, problems)
    qpos, held, start = start_of(robot, model, servos, problems)
    channels = {name: _channel(name, parts, model) for name, parts in bound.items()}
    commands = _commands(robot, model, problems)
    if problems:
        raise InputError(*problems)
    made = RobotModel(robot, model, channels, commands, qpos, start, held, {}, _base(model), tuple(servos))
    for kind, block in prepared.items():
        brought = block.finish(made)
        made = RobotModel(
            robot, model, {**brought.channels, **made.channels}, {**brought.commands, **made.commands},
            qpos, start, held, {**made.blocks, kind: brought.body}, made.base, made.servo_joints,
        )  # fmt: skip
    if clashes := _names_with_another_meaning(robot, made.channels, made.commands):
        raise InputError(*clashes)
    for change in changes:
        change(made)
    return made


def _names_with_another_meaning(
    robot: Robot, channels: Iterable[str], commands: Iterable[str]
) -> list[Problem]:
    """Complaints about channels and commands that a measure could not tell from something else."""
    found, there = [], set(channels)
    for section, names in (("channels", channels), ("commands", commands)):
        for name in names:
            if name in RESERVED:
                message = f"found the name '{name}', which is {RESERVED[name]} in measures"
            elif section == "commands" and name in there:
                message = f"found the name '{name}' for a command and for a channel"
            else:
                continue
            kind = section if name in getattr(robot, section) else "channels"
            found.append(robot.problem((kind, name), f"{message}; allowed: another name", at_key=True))
    return found


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
    try:
        return read_mjcf(path)
    except InputError as error:
        problems = (each if each.is_placed else _named_by(robot, each) for each in error.problems)
        raise InputError(*problems) from error


def _named_by(robot: Robot, problem: Problem) -> Problem:
    """What is wrong with the file of the MJCF itself, where the robot file names it."""
    found, _, _ = problem.message.partition("; allowed")
    said = "no such file" if found.startswith("there is no") else found
    allowed = "the path of an MJCF file, from the folder of the robot file"
    return robot.problem(("mjcf",), f"{said} '{robot.mjcf_path}'; allowed: {allowed}", problem.hint)


def moving_parts(model: mujoco.MjModel) -> NDArray[np.int64]:
    """How many degrees of freedom what hangs on each body of the world has; shape (nbody,)."""
    return np.bincount(model.body_rootid[model.dof_bodyid], minlength=model.nbody)


def _base(model: mujoco.MjModel) -> int | None:
    """The free joint that carries most: more moving parts than a loose object, or the heavier of equals."""
    moving = moving_parts(model)

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
    actuators = [model.actuator(i).name for i in range(model.nactuator)]
    found = {}
    for name, spec in robot.commands.items():
        factors = np.zeros(model.nu)
        for actuator, factor in spec.to.items():
            where = ("commands", name, "to", actuator)
            if actuator not in actuators:
                message = f"the robot has no actuator '{actuator}'; allowed: {listing(actuators)}"
                problems.append(robot.problem(where, message, suggest(actuator, actuators)))
            elif message := not_for_commands(model, actuators.index(actuator)):
                problems.append(robot.problem(where, message))
            else:
                factors[model.actuator_ctrladr[actuators.index(actuator)]] = factor
        found[name] = Command(
            name, parse_unit(spec.unit), factors, spec.pair("limits"), spec.description, spec.rate_si
        )
    return found


def not_for_commands(model: mujoco.MjModel, actuator: int) -> str:
    """Why no command can write an actuator; empty if one can."""
    name, count = model.actuator(actuator).name, int(model.actuator_ctrlnum[actuator])
    if is_off(model, actuator):
        return (
            f"the MJCF disables the actuator '{name}'; allowed: one that acts; take actuation=\"disable\" or "
            "actuatorgroupdisable out of the MJCF's option"
        )
    if count != 1:
        return (
            f"the actuator '{name}' has {count} controls; allowed: one that has one; a pid has one with "
            'input="pos"'
        )
    return ""


def is_off(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the MJCF's options disable an actuator."""
    group = int(model.actuator_group[actuator])
    grouped = 0 <= group <= _LAST_GROUP and bool(int(model.opt.disableactuator) >> group & 1)
    return grouped or bool(int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_ACTUATION))


def _require_effects(
    robot: Robot, model: mujoco.MjModel, servos: Mapping[str, float], problems: list[Problem]
) -> None:
    """Refuse an MJCF whose options disable what the robot file needs of it."""
    if model.nsensordata and int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_SENSOR):
        message = (
            "the MJCF disables sensors, so that every channel would be 0; allowed: an MJCF without <flag "
            'sensor="disable"/>'
        )
        problems.append(robot.problem(("mjcf",), message))
    of_servos = {int(model.joint(name).id): name for name in servos}
    for i in range(model.nactuator):
        joint = int(model.actuator_trnid[i, 0])
        if of_joint(model, i) and joint in of_servos and is_off(model, i):
            message = (
                f"the MJCF disables the servo of the joint '{of_servos[joint]}'; allowed: an MJCF "
                f'without actuation="disable", and without group {int(model.actuator_group[i])} in '
                "actuatorgroupdisable"
            )
            problems.append(robot.problem(("mjcf",), message))


def hold_at(robot: RobotModel, qpos: Array, ctrl: Array, act: Array) -> Array:
    """The controls of a keyframe; servos that the robot file brings get its positions. Shape (nu,)."""
    held = ctrl.copy()
    if robot.robot.servos_in_use:
        of_servos = [int(robot.model.joint(name).id) for name in robot.servo_joints]
        aim(robot.model, of_servos, qpos, held, act)
    return held


def servo_numbers(robot: RobotModel, joints: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of the position actuators of joints, one each; shape (n,).

    Raises:
        UnknownNameError: A joint has none; lists those that have.
    """
    model = robot.model
    found: dict[str, int] = {}
    for i in range(model.nactuator):
        if of_joint(model, i) and drives_position(model, i):
            found.setdefault(model.joint(int(model.actuator_trnid[i, 0])).name, i)
    for name in joints:
        if name not in found:
            kind = "joint with a position servo"
            raise UnknownNameError(kind, name, found)
    return np.array([found[name] for name in joints], dtype=np.int64)
