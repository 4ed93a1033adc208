"""What expressions may name of an MJCF: sensors, joints, bodies, actuators, contacts.

Each reference, such as `position(torso, x)`, becomes numbers of MuJoCo's `sensordata`: of a sensor that the
MJCF has, or of one that is added to the compiled model. Adding a sensor changes no bit of the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple, TypeAlias

import mujoco

from circuitkit.base.errors import ExpressionError
from circuitkit.base.units import parse_unit
from circuitkit.circuit.expressions.dimensions import OpenDimension
from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.robots.sensors import OF_HINGE_AND_SLIDE, UNIT_OF_TYPE, Sensors, column, no_such, word_of

AXES = ("x", "y", "z")
_OBJECT, _SENSOR = mujoco.mjtObj, mujoco.mjtSensor
_NET_FORCE = 3  # of mjtContactReduce: one wrench for all contacts, in the world's frame


class Meaning(NamedTuple):
    """What a reference stands for.

    Attributes:
        value: An expression of columns of `sensordata`.
        dimension: Of its value; None if any fits.
    """

    value: Expression
    dimension: OpenDimension | None


Arguments: TypeAlias = Sequence[str]


@dataclass(frozen=True)
class Reference:
    """A function of an expression that names parts of an MJCF.

    Attributes:
        usage: As it is written, with its arguments.
        arity: How many arguments it takes, at least and at most.
        meaning: What it stands for, given the sensors and its arguments.
    """

    usage: str
    arity: tuple[int, int]
    meaning: Callable[[Sensors, Arguments], Meaning]


_REFERENCES: dict[str, Reference] = {}
REFERENCES: Mapping[str, Reference] = _REFERENCES


def _dimension(unit: str) -> OpenDimension:
    return OpenDimension(parse_unit(unit).dimension)


@dataclass(frozen=True)
class StandIn(Name):
    """A name that stands for a part of an expression while units are checked; it is shown as that part."""

    def __str__(self) -> str:
        return self.name


def bind(
    expression: Expression, sensors: Sensors, dimensions: dict[str, OpenDimension]
) -> tuple[Expression, Expression]:
    """Replace the references of an expression.

    Args:
        expression: The tree as parsed, with a `Call` for each reference.
        sensors: Of the model.
        dimensions: Takes the dimension of each reference, by the name that stands for it.

    Returns:
        The tree with a name for each reference, whose units can be checked, and the tree of columns.

    Raises:
        ExpressionError: The MJCF lacks a part; says where in the text.
    """
    match expression:
        case Call(function=function, arguments=arguments) if function in _REFERENCES:
            words = [
                each.name if isinstance(each, Name) else f"{each.value:g}"
                for each in arguments
                if isinstance(each, Name | Number)
            ]
            try:
                meaning = _REFERENCES[function].meaning(sensors, words)
            except ExpressionError as error:
                raise ExpressionError(str(error), expression.offset) from error
            text = str(expression)
            if meaning.dimension is None:
                return Number(0.0, offset=expression.offset), meaning.value  # 0 fits any unit
            dimensions[text] = meaning.dimension
            return StandIn(text, offset=expression.offset), meaning.value
        case Unary(operator=sign, operand=operand):
            shown, value = bind(operand, sensors, dimensions)
            return Unary(sign, shown, offset=expression.offset), Unary(sign, value)
        case Binary(operator=joint, left=left, right=right):
            (a, b), (c, d) = bind(left, sensors, dimensions), bind(right, sensors, dimensions)
            return Binary(joint, a, c, offset=expression.offset), Binary(joint, b, d)
        case Call(function=function, arguments=arguments):
            both = [bind(each, sensors, dimensions) for each in arguments]
            return (
                Call(function, tuple(a for a, _ in both), offset=expression.offset),
                Call(function, tuple(b for _, b in both)),
            )
    return expression, expression


def _reference(
    usage: str, least: int, most: int | None = None
) -> Callable[[Callable[[Sensors, Arguments], Meaning]], None]:
    """Register a reference by how it is written."""

    def register(meaning: Callable[[Sensors, Arguments], Meaning]) -> None:
        _REFERENCES[usage.partition("(")[0]] = Reference(usage, (least, most or least), meaning)

    return register


def _axis(word: str) -> int:
    if word not in AXES:
        message = f"found the axis '{word}'; allowed: x, y or z"
        raise ExpressionError(message)
    return AXES.index(word)


def _of_joint(joint: Any, sensor: str) -> OpenDimension:  # noqa: ANN401 - as above
    """Position, rate or force of a hinge or a slide."""
    if joint.type not in {mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE}:
        kind = joint.type.name.removeprefix("mjJNT_").lower()
        message = f"'{joint.name}' is a {kind} joint; allowed: a hinge or a slide"
        raise ExpressionError(message)
    return _dimension(OF_HINGE_AND_SLIDE[sensor][0 if joint.type == mujoco.mjtJoint.mjJNT_HINGE else 1])


@_reference("sensor(NAME, component)", 1, 2)
def _sensor(sensors: Sensors, arguments: Arguments) -> Meaning:
    name = arguments[0]
    if name not in sensors.own:
        kind = "sensor"
        raise no_such(kind, name, (each for each in sensors.own if each))
    sensor, component = sensors.own[name], 0
    word, width = word_of(sensor.type), sensors.width(name)
    if len(arguments) > 1:
        part = arguments[1]
        component = AXES.index(part) if part in AXES else int(part) if part.isdigit() else -1
        if not 0 <= component < width:
            letters = "x, y, z, or " if width == len(AXES) else ""
            numbers = f"a number from 0 to {width - 1}" if width > 1 else "0"
            message = f"found the component '{part}' of the sensor '{name}'; allowed: {letters}{numbers}"
            raise ExpressionError(message)
    elif width > 1:
        first = "x" if width == len(AXES) else 0
        message = (
            f"the sensor '{name}' has {width} numbers; allowed: one of them, such as sensor({name}, {first})"
        )
        raise ExpressionError(message)
    if word in OF_HINGE_AND_SLIDE:
        return Meaning(column(name), _of_joint(sensors.part(["joint"], sensor.objname)[1], word))
    unit = UNIT_OF_TYPE.get(word)
    return Meaning(column(name, component), None if unit is None else _dimension(unit))


def _joint_sensor(usage: str, kind: mujoco.mjtSensor) -> None:
    @_reference(usage, 1)
    def _joint(sensors: Sensors, arguments: Arguments) -> Meaning:
        _, joint = sensors.part(["joint"], arguments[0])
        dimension = _of_joint(joint, word_of(kind))
        return Meaning(column(sensors.add(kind, _OBJECT.mjOBJ_JOINT, arguments[0])), dimension)


_joint_sensor("joint(NAME)", _SENSOR.mjSENS_JOINTPOS)
_joint_sensor("rate(NAME)", _SENSOR.mjSENS_JOINTVEL)
_joint_sensor("force(JOINT)", _SENSOR.mjSENS_JOINTACTFRC)


def _scalar_sensor(usage: str, part: str, obj: mujoco.mjtObj, kind: mujoco.mjtSensor) -> None:
    """A number of a tendon or of an actuator, whose unit depends on what it pulls: it fits any."""

    @_reference(usage, 1)
    def _scalar(sensors: Sensors, arguments: Arguments) -> Meaning:
        sensors.part([part], arguments[0])
        return Meaning(column(sensors.add(kind, obj, arguments[0])), None)


_scalar_sensor("tendon(NAME)", "tendon", _OBJECT.mjOBJ_TENDON, _SENSOR.mjSENS_TENDONPOS)
_scalar_sensor("tendon_rate(NAME)", "tendon", _OBJECT.mjOBJ_TENDON, _SENSOR.mjSENS_TENDONVEL)
_scalar_sensor("actuator_length(NAME)", "actuator", _OBJECT.mjOBJ_ACTUATOR, _SENSOR.mjSENS_ACTUATORPOS)
_scalar_sensor("actuator_velocity(NAME)", "actuator", _OBJECT.mjOBJ_ACTUATOR, _SENSOR.mjSENS_ACTUATORVEL)
_scalar_sensor("actuator_force(NAME)", "actuator", _OBJECT.mjOBJ_ACTUATOR, _SENSOR.mjSENS_ACTUATORFRC)

# A body's own frame is XBODY; BODY would be that of its principal axes of inertia.
_FRAME = {
    "body": _OBJECT.mjOBJ_XBODY,
    "site": _OBJECT.mjOBJ_SITE,
    "geom": _OBJECT.mjOBJ_GEOM,
    "camera": _OBJECT.mjOBJ_CAMERA,
}


def _frame(sensors: Sensors, kind: mujoco.mjtSensor, name: str) -> tuple[Name, Name, Name]:
    """Three columns about the frame of a body, site, geom or camera."""
    what, _ = sensors.part(_FRAME, name)
    sensor = sensors.add(kind, _FRAME[what], name)
    return column(sensor, 0), column(sensor, 1), column(sensor, 2)


def _vector(usage: str, kind: mujoco.mjtSensor, unit: str) -> None:
    @_reference(usage, 2)
    def _component(sensors: Sensors, arguments: Arguments) -> Meaning:
        return Meaning(_frame(sensors, kind, arguments[0])[_axis(arguments[1])], _dimension(unit))


_vector("position(PART, axis)", _SENSOR.mjSENS_FRAMEPOS, "m")
_vector("velocity(PART, axis)", _SENSOR.mjSENS_FRAMELINVEL, "m/s")
_vector("angular_velocity(PART, axis)", _SENSOR.mjSENS_FRAMEANGVEL, "rad/s")
_vector("ahead(PART, axis)", _SENSOR.mjSENS_FRAMEXAXIS, "1")
_vector("side(PART, axis)", _SENSOR.mjSENS_FRAMEYAXIS, "1")
_vector("up(PART, axis)", _SENSOR.mjSENS_FRAMEZAXIS, "1")


@_reference("acceleration(PART, axis)", 2)
def _acceleration(sensors: Sensors, arguments: Arguments) -> Meaning:
    """MuJoCo's sensor is what an accelerometer feels: 9.81 m/s^2 upward at rest; so is the world's."""
    axis = _axis(arguments[1])
    felt = _frame(sensors, _SENSOR.mjSENS_FRAMELINACC, arguments[0])[axis]
    still = _frame(sensors, _SENSOR.mjSENS_FRAMELINACC, "world")[axis]
    return Meaning(Binary("-", felt, still), _dimension("m/s^2"))


def _subtree(usage: str, kind: mujoco.mjtSensor, unit: str) -> None:
    @_reference(usage, 2)
    def _component(sensors: Sensors, arguments: Arguments) -> Meaning:
        sensors.part(["body"], arguments[0])
        sensor = sensors.add(kind, _OBJECT.mjOBJ_BODY, arguments[0])
        return Meaning(column(sensor, _axis(arguments[1])), _dimension(unit))


_subtree("com(BODY, axis)", _SENSOR.mjSENS_SUBTREECOM, "m")
_subtree("com_velocity(BODY, axis)", _SENSOR.mjSENS_SUBTREELINVEL, "m/s")


def _call(function: str, *arguments: Expression) -> Call:
    return Call(function, arguments)


@_reference("yaw(PART)", 1)
def _yaw(sensors: Sensors, arguments: Arguments) -> Meaning:
    x, y, _ = _frame(sensors, _SENSOR.mjSENS_FRAMEXAXIS, arguments[0])
    return Meaning(_call("atan2", y, x), _dimension("rad"))


@_reference("pitch(PART)", 1)
def _pitch(sensors: Sensors, arguments: Arguments) -> Meaning:
    x, y, z = _frame(sensors, _SENSOR.mjSENS_FRAMEXAXIS, arguments[0])
    return Meaning(_call("atan2", Unary("-", z), _call("hypot", x, y)), _dimension("rad"))


@_reference("roll(PART)", 1)
def _roll(sensors: Sensors, arguments: Arguments) -> Meaning:
    side = _frame(sensors, _SENSOR.mjSENS_FRAMEYAXIS, arguments[0])[2]
    up = _frame(sensors, _SENSOR.mjSENS_FRAMEZAXIS, arguments[0])[2]
    return Meaning(_call("atan2", side, up), _dimension("rad"))


def _length(x: Expression, y: Expression, z: Expression) -> Expression:
    return _call("hypot", _call("hypot", x, y), z)


@_reference("distance(PART, PART)", 2)
def _distance(sensors: Sensors, arguments: Arguments) -> Meaning:
    first, second = (_frame(sensors, _SENSOR.mjSENS_FRAMEPOS, name) for name in arguments)
    return Meaning(_length(*(Binary("-", a, b) for a, b in zip(first, second, strict=True))), _dimension("m"))


def _sum(parts: Sequence[Expression]) -> Expression:
    return reduce(lambda one, more: Binary("+", one, more), parts)


def _fixed_to(world: Any) -> Iterator[str]:  # noqa: ANN401 - as above
    """The world, and the bodies with geoms that are fixed to it: no joint and no mocap body lies between."""
    yield world.name
    waiting = list(world.bodies)
    while waiting:
        body = waiting.pop(0)
        if not body.mocap and not len(body.joints):
            waiting += body.bodies
            if len(body.geoms):
                yield body.name


@_reference("contact(BODY, OTHER, axis)", 1, 3)
def _contact(sensors: Sensors, arguments: Arguments) -> Meaning:
    """The net force of all contacts on a body and what it carries, from anything or from one body or geom.

    Another body counts with what it carries as well. The world carries everything; as the other body it is
    only what is fixed to it: one sensor for each body that nothing moves, and their sum.
    """
    words = list(arguments)
    axis = words.pop() if len(words) > 1 and words[-1] in AXES else None
    sensors.part(["body"], words[0])
    more: dict[str, Any] = {"reftype": _OBJECT.mjOBJ_XBODY, "refname": words[0]}
    others = [(_OBJECT.mjOBJ_UNKNOWN, "")]
    if len(words) > 1:
        what, part = sensors.part(("body", "geom"), words[1])
        others = [(_OBJECT.mjOBJ_GEOM if what == "geom" else _OBJECT.mjOBJ_XBODY, words[1])]
        if what == "body" and part.parent is None:
            others = [(_OBJECT.mjOBJ_BODY, name) for name in _fixed_to(part)]
    force = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE)
    added = [
        sensors.add(_SENSOR.mjSENS_CONTACT, obj, name, intprm=(force, _NET_FORCE, 1), **more)
        for obj, name in others
    ]
    columns = [_sum([column(sensor, i) for sensor in added]) for i in range(3)]
    value = _length(columns[0], columns[1], columns[2]) if axis is None else columns[_axis(axis)]
    return Meaning(value, _dimension("N"))


@_reference("energy()", 0)
def _energy(sensors: Sensors, _: Arguments) -> Meaning:
    """The mechanical energy of everything: potential, of weights and springs, and kinetic."""
    kinds = (_SENSOR.mjSENS_E_POTENTIAL, _SENSOR.mjSENS_E_KINETIC)
    parts = [column(sensors.add(kind, _OBJECT.mjOBJ_UNKNOWN, "")) for kind in kinds]
    return Meaning(_sum(parts), _dimension("J"))


@_reference("joint_speed()", 0)
def _joint_speed(sensors: Sensors, _: Arguments) -> Meaning:
    """The largest angular speed of all hinges."""
    hinges = [n for n, each in sensors.named("joint").items() if each.type == mujoco.mjtJoint.mjJNT_HINGE]
    if not hinges:
        message = "the MJCF has no hinge; allowed: rate(NAME) of a slide, or velocity(BODY, axis)"
        raise ExpressionError(message)
    rates = [column(sensors.add(_SENSOR.mjSENS_JOINTVEL, _OBJECT.mjOBJ_JOINT, name)) for name in hinges]
    speeds: list[Expression] = [_call("abs", rate) for rate in rates]
    return Meaning(reduce(lambda one, more: _call("max", one, more), speeds), _dimension("rad/s"))


ARITIES: Mapping[str, tuple[int, int]] = {name: reference.arity for name, reference in _REFERENCES.items()}
