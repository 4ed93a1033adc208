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
    HELD_UNITS,
    HINGE,
    OF_JOINT,
    SLIDE,
    TYPE_NAMES,
    add_servos,
    compile_mjcf,
    flex_bodies,
    read_mjcf,
    warn_of_servos,
)
from circuitkit.robots.parts import ARITIES, Sensors, bind, column_index
from circuitkit.robots.spec import RESERVED, ChannelSpec, Robot

_LAST_GROUP = 30  # of actuators that can be disabled, as MuJoCo says
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


@dataclass(frozen=True, eq=False)
class StartState:
    """What a model starts with beside its positions.

    Attributes:
        qvel: Velocities; shape (nv,).
        act: States of actuators, such as muscles; shape (na,).
        mocap_pos: Places of the mocap bodies; shape (nmocap, 3), [m].
        mocap_quat: How they stand; shape (nmocap, 4).
    """

    qvel: Array
    act: Array
    mocap_pos: Array
    mocap_quat: Array


def start_state(model: mujoco.MjModel, key: str | None = None) -> StartState:
    """What a keyframe says beside positions and controls; rest without one."""
    data = mujoco.MjData(model)
    if key is not None:
        mujoco.mj_resetDataKeyframe(model, data, int(model.key(key).id))
    return StartState(data.qvel.copy(), data.act.copy(), data.mocap_pos.copy(), data.mocap_quat.copy())


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
    qpos, held, start = _start(robot, model, servos, problems)
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
    if not path.is_file():
        message = (
            f"no such file '{path}'; allowed: the path of an MJCF file, from the folder of the robot file"
        )
        raise InputError(robot.problem(("mjcf",), message))
    return read_mjcf(path)


def _moving_parts(model: mujoco.MjModel) -> NDArray[np.int64]:
    """How many degrees of freedom what hangs on each body of the world has; shape (nbody,)."""
    return np.bincount(model.body_rootid[model.dof_bodyid], minlength=model.nbody)


def _base(model: mujoco.MjModel) -> int | None:
    """The free joint that carries most: more moving parts than a loose object, or the heavier of equals."""
    moving = _moving_parts(model)

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
        found[name] = Command(name, parse_unit(spec.unit), factors, spec.pair("limits"), spec.description)
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


def _key_names(model: mujoco.MjModel) -> list[str]:
    return [model.key(i).name for i in range(model.nkey)]


def no_keyframe(name: str, keys: Sequence[str]) -> tuple[str, str]:
    """What is wrong with the name of a keyframe that is not there, and what to do."""
    if keys:
        return f"the MJCF has no keyframe '{name}'; allowed: {listing(keys)}", suggest(name, keys)
    message = f"found '{name}', but the MJCF has no keyframes; allowed: no key"
    return message, "hold, such as hold: {JOINT: 10 deg}, puts joints where they start"


def _start(
    robot: Robot, model: mujoco.MjModel, servos: Mapping[str, float], problems: list[Problem]
) -> tuple[Array, Array, StartState]:
    """Positions at the start, the controls that hold them, and the rest of the state."""
    qpos, ctrl, start = model.qpos0.copy(), np.zeros(model.nu), start_state(model)
    if robot.key is not None:
        keys = _key_names(model)
        if robot.key in keys:
            qpos, ctrl = model.key(robot.key).qpos.copy(), model.key(robot.key).ctrl.copy()
            start = start_state(model, robot.key)
        else:
            problems.append(robot.problem(("key",), *no_keyframe(robot.key, keys)))
    _aim(model, {int(model.joint(name).id) for name in servos}, qpos, ctrl, start.act)
    hold_joints(
        model, robot.hold, qpos, ctrl, start.act,
        lambda name, *m: problems.append(robot.problem(("hold", name), *m)),
    )  # fmt: skip
    return qpos, ctrl, start


def _aim(
    model: mujoco.MjModel, joints: Iterable[int], qpos: Array, ctrl: Array, act: Array
) -> dict[int, str]:
    """Let the position actuators of some joints hold the joints' positions from the first moment on.

    Force = k (a - length) + b with the gear's length = gear * position: the target a is length - b / k. It is
    the control, or the state of an actuator that filters its control; an integrator's state is a, and its
    control is the speed 0.

    Args:
        model: The model.
        joints: Numbers of the joints.
        qpos: Positions; shape (nq,).
        ctrl: Controls, changed in place; shape (nu,).
        act: States of actuators, changed in place; shape (na,).

    Returns:
        Why a joint is not held, by its number.
    """
    chosen, refused = set(joints), {}
    for i in range(model.nactuator):
        joint = int(model.actuator_trnid[i, 0])
        if not of_joint(model, i) or joint not in chosen or not holds_position(model, i):
            continue
        length = qpos[model.jnt_qposadr[joint]] * model.actuator_gear[model.actuator_outadr[i], 0]
        target = length - model.actuator_biasprm[i, 0] / -model.actuator_biasprm[i, 1]
        if message := _unreachable(model, i, target):
            refused[joint] = message
        place, state = int(model.actuator_ctrladr[i]), int(model.actuator_actadr[i])
        integrates = model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_INTEGRATOR
        ctrl[place] = 0.0 if integrates else target
        if _keeps_target(model, i):
            act[state] = target
    return refused


def _keeps_target(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the first state of a position actuator is the target that it follows."""
    if model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_PID:  # its target is limited in speed, or not
        return bool(model.actuator_dynprm[actuator, 1] > 0)
    return bool(model.actuator_actnum[actuator] > 0)


def _unreachable(model: mujoco.MjModel, actuator: int, target: float) -> str:
    """Why an actuator cannot hold a target, in its own units; empty if it can."""
    name, place = model.actuator(actuator).name, int(model.actuator_ctrladr[actuator])
    integrates = model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR
    bounds = []
    if model.actuator_ctrllimited[place] and not integrates:
        bounds.append(("ctrlrange", model.actuator_ctrlrange[place]))
    if model.actuator_actlimited[actuator] and _keeps_target(model, actuator):
        bounds.append(("actrange", model.actuator_actrange[actuator]))
    for word, (low, high) in bounds:
        if not low <= target <= high:
            return (
                f"its actuator '{name}' would have to be told {target:.6g}, and its {word} is {low:g} to "
                f"{high:g}; allowed: what lies within; or give the joint a servo by servos"
            )
    if model.actuator_history[actuator, 0] > 0:
        return (
            f"its actuator '{name}' gets its controls late and would let go at first; allowed: an actuator "
            "without delay; or give the joint a servo by servos"
        )
    return ""


def hold_at(robot: RobotModel, qpos: Array, ctrl: Array, act: Array) -> Array:
    """The controls of a keyframe; servos that the robot file brings get its positions. Shape (nu,)."""
    held = ctrl.copy()
    if robot.robot.servos_in_use:
        of_servos = [int(robot.model.joint(name).id) for name in robot.servo_joints]
        _aim(robot.model, of_servos, qpos, held, act)
    return held


def hold_joints(
    model: mujoco.MjModel,
    hold: Mapping[str, str],
    qpos: Array,
    ctrl: Array,
    act: Array,
    complain: Callable[..., object],
) -> None:
    """Put joints where they shall be held; position actuators that drive them get the target.

    Args:
        model: The model.
        hold: Angle or position by joint, as text with unit.
        qpos: Positions, changed in place; shape (nq,).
        ctrl: Controls, changed in place; shape (nu,).
        act: States of actuators, changed in place; shape (na,).
        complain: Is told the joint, a message and a hint for each that cannot be held.
    """
    names = [model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) in {HINGE, SLIDE}]
    numbers: dict[int, str] = {}
    for name, text in hold.items():
        if name not in names:
            complain(
                name,
                f"the MJCF has no hinge or slide '{name}'; allowed: {listing(names)}",
                suggest(name, names),
            )
            continue
        joint = int(model.joint(name).id)
        kind = int(model.jnt_type[joint])
        unit, quantity = HELD_UNITS[kind], parse_quantity(text)
        if quantity.dimension != unit.dimension:
            is_a = f"but {name} is a {TYPE_NAMES[kind]}"
            complain(name, f"found '{text}', {is_a}; allowed: a quantity in {unit} or like it")
            continue
        qpos[model.jnt_qposadr[joint]] = quantity.value_si
        numbers[joint] = name
    for joint, message in _aim(model, numbers, qpos, ctrl, act).items():
        complain(numbers[joint], message)


def of_joint(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator drives a joint."""
    return int(model.actuator_trntype[actuator]) in {int(kind) for kind in OF_JOINT}


def holds_position(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator pulls its joint to a target: force = k (target - length), and damping.

    The target is its control, or a state that follows the control.
    """
    gain, bias = float(model.actuator_gainprm[actuator, 0]), float(model.actuator_biasprm[actuator, 1])
    if model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_AFFINE:
        return False
    if model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_PID:  # its gain is that of the integral
        inputs = int(model.actuator_ctrlspec[actuator])
        return bias < 0 and bool(inputs & int(mujoco.mjtCtrlInput.mjINPUT_POS))
    plain = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
    return bool(plain and gain > 0 and abs(gain + bias) <= 1e-9 * gain)


def drives_position(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's control is a position; that of an integrator is a speed."""
    integrates = model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR
    return holds_position(model, actuator) and not integrates


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


class MobileBase:
    """What carries a robot through the world: a free joint, or slides along x and y and a hinge about z.

    The axes are the world's at the robot's start. Slides may stand on each other, as those of a gantry do.

    Attributes:
        free: Number of the free joint, if any.
        dofs: Places in `qvel` of the velocity along x (0) and y (1), as far as there are any.
        places: Places in `qpos` of the same.
        signs: 1, or -1 where the slide counts backwards.
        turn: Number of the hinge about z, if it stands on one.
        turn_sign: 1, or -1 where that counts to the right.
    """

    def __init__(self, robot: RobotModel) -> None:
        """Find it."""
        model, self.free = robot.model, robot.base
        self.turn: int | None = None
        self.turn_sign = 1.0
        self.dofs: dict[int, int] = {}
        self.places: dict[int, int] = {}
        self.signs = {0: 1.0, 1: 1.0}
        if self.free is not None:
            start, place = int(model.jnt_dofadr[self.free]), int(model.jnt_qposadr[self.free])
            self.dofs, self.places = {0: start, 1: start + 1}, {0: place, 1: place + 1}
            return
        data = mujoco.MjData(model)
        data.qpos[:] = robot.start_qpos
        mujoco.mj_kinematics(model, data)
        carriages, soft, root = {0}, flex_bodies(model), 0
        moving = _moving_parts(model)
        for body in sorted(range(1, model.nbody), key=lambda each: -moving[model.body_rootid[each]]):
            if int(model.body_parentid[body]) not in carriages or body in soft:
                continue
            if root != model.body_rootid[body] and (self.dofs or self.turn is not None):
                break  # it is one of them that is the robot
            root = int(model.body_rootid[body])
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            found = [self._take(model, joint, data.xaxis[joint]) for joint in range(first, first + count)]
            if count and all(found):
                carriages.add(body)

    def _take(self, model: mujoco.MjModel, joint: int, axis: Array) -> bool:
        """Take a joint that moves along x or y, or turns about z; says whether it is a slide of the base."""
        way = int(np.abs(axis).argmax())
        if abs(axis[way]) <= _ALONG:
            return False
        if model.jnt_type[joint] == SLIDE and way != 2 and way not in self.dofs:  # noqa: PLR2004 - z
            self.dofs[way], self.places[way] = int(model.jnt_dofadr[joint]), int(model.jnt_qposadr[joint])
            self.signs[way] = float(np.sign(axis[way]))
            return True
        if model.jnt_type[joint] == HINGE and way == 2 and self.turn is None:  # noqa: PLR2004 - z
            self.turn, self.turn_sign = joint, float(np.sign(axis[way]))
        return False
