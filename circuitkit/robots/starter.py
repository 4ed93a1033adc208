"""A commented robot file to start from, with everything that an MJCF has."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from keyword import iskeyword
from pathlib import Path

import mujoco
import numpy as np

from circuitkit.base.errors import ExpressionError, InputError, Problem
from circuitkit.base.files import write_text
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.robots.mjcf import HINGE, SERVO_UNITS, SLIDE, compile_mjcf, flex_bodies, read_mjcf
from circuitkit.robots.model import not_for_commands
from circuitkit.robots.parts import ARITIES, AXES
from circuitkit.robots.sensors import unit_of_sensor
from circuitkit.robots.spec import RESERVED
from circuitkit.robots.start import drives_position

_NO_WORD = re.compile(r"\W+")
_PLAIN = re.compile(r"[A-Za-z_/][\w.\-/]*")
_YAML_WORDS = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false", "null"})
_TAKEN = frozenset({"t", "ended"})  # of measures
_SERVO = {"stiffness": 100, "damping": 3, "torque": 10}  # a start, in the units of the joint
_SHOWN_COMPONENTS = 6  # further numbers of a sensor, such as a skin's, are comments


def write_robot_starter(mjcf: Path, path: Path, *, force: bool = False) -> Path:
    """Write a robot file for an MJCF: sensors as channels, actuators as commands, the rest as comments.

    Args:
        mjcf: The model file; nothing in it is changed.
        path: Where the robot file goes.
        force: Overwrite a file that is there.

    Raises:
        InputError: The MJCF cannot be read, or the file is there.
        OutputError: The file cannot be written.

    Returns:
        The path.
    """
    if path.exists() and not force:
        message = f"'{path}' is there already; allowed: another name, or --force"
        raise InputError(Problem("", 0, 0, "FILE", message))
    model = compile_mjcf(read_mjcf(mjcf), mjcf)
    write_text(path, "\n".join(_lines(mjcf, path, model)) + "\n")
    return path


def _lines(mjcf: Path, path: Path, model: mujoco.MjModel) -> Iterator[str]:
    try:
        beside = mjcf.resolve().relative_to(path.resolve().parent)
    except ValueError:
        beside = mjcf.resolve()
    yield f"# A robot made of {mjcf.name}: what of it can be read (channels) and written (commands)."
    guide = "docs/robots/README.md tells what expressions can say"
    yield f"# Take out what you do not need, rename what you like; {guide}."
    yield f"robot: {_key(_word(mjcf.stem))}"
    yield f"description: {_key(mjcf.name)}"
    yield f"mjcf: {_key(str(beside))}"
    timestep = f"{model.opt.timestep * 1e3:g} ms"
    yield f"# timestep: {timestep}      # the MJCF's own; a control step is a multiple of it"
    keys = [_key(model.key(i).name) for i in range(model.nkey)]
    yield (
        f"# key: {keys[0]}      # keyframes to start from: {', '.join(keys)}"
        if keys
        else "# (the MJCF has no keyframes)"
    )
    yield from _joints(model)
    taken = set(RESERVED)
    yield from _channels(model, taken)
    yield from _commands(model, taken)


def _word(text: str) -> str:
    """A name that expressions can say: a word that means nothing else there."""
    word = _NO_WORD.sub("_", text).strip("_") or "unnamed"
    return f"_{word}" if word[0].isdigit() else f"{word}_" if iskeyword(word) or word in _TAKEN else word


def _shown(name: str) -> str:
    """A name of the MJCF as an argument of an expression."""
    if name.isidentifier() and not iskeyword(name):
        return name
    return f"'{name}'" if '"' in name else f'"{name}"'


def _can_be_read(expression: str) -> bool:
    """Whether an expression can name the part; a name with both kinds of quotes cannot be put in quotes."""
    try:
        parse_expression(expression, (), units=True, references=ARITIES)
    except ExpressionError:
        return False
    return True


def _key(name: str) -> str:
    """A name or a path in YAML, with quotes where YAML would read something else."""
    plain = _PLAIN.fullmatch(name) and name.lower() not in _YAML_WORDS
    return name if plain else "'" + name.replace("'", "''") + "'"


def _quoted(expression: str) -> str:
    if '"' in expression or "'" in expression:
        return "'" + expression.replace("'", "''") + "'"
    return f'"{expression}"' if "," in expression else expression


def _moving(model: mujoco.MjModel) -> list[tuple[str, int, int]]:
    """Hinges and slides: name, number, type."""
    kinds = [(model.joint(j).name, j, int(model.jnt_type[j])) for j in range(model.njnt)]
    return [each for each in kinds if each[2] in {HINGE, SLIDE}]


def _joints(model: mujoco.MjModel) -> Iterator[str]:
    moving = _moving(model)
    if not moving:
        return
    start_at = "joints that start at and, where a position actuator drives them, are held at this"
    yield f"# hold:                    # {start_at}"
    for name, j, kind in moving:
        start = float(model.qpos0[model.jnt_qposadr[j]])
        shown = f"{np.degrees(start):.6g} deg" if kind == HINGE else f"{start * 1e3:.6g} mm"
        yield f"#   {_key(name)}: {shown}"
    of_joint = [int(t) == int(mujoco.mjtTrn.mjTRN_JOINT) for t in model.actuator_trntype]
    driven = {int(model.actuator_trnid[i, 0]) for i in range(model.nactuator) if of_joint[i]}
    wanted = [each for each in moving if each[1] in driven] or moving
    yield "# servos:                  # position servos in the place of the MJCF's actuators of these joints"
    for kind, units in SERVO_UNITS.items():
        if names := [_key(name) for name, _, each in wanted if each == kind]:
            numbers = ", ".join(f"{key}: {_SERVO[key]} {unit}" for key, unit in units.items())
            yield f"#   - {{joints: [{', '.join(names)}], {numbers}}}"


def _channels(model: mujoco.MjModel, taken: set[str]) -> Iterator[str]:
    """A line for everything that can be read; `taken` takes the names."""
    lines: list[str] = []

    def add(name: str, unit: str, expression: str, *, used: bool = True) -> None:
        own = name
        while own in taken:
            own += "_"
        taken.add(own)
        shown = '"1"' if unit == "1" else unit
        mark = "" if used and _can_be_read(expression) else "# "
        lines.append(f"  {mark}{_key(own)}: {{unit: {shown}, is: {_quoted(expression)}}}")

    _sensors(model, add)
    soft = flex_bodies(model)  # of which there are many, and nobody reads them all
    for name, number, kind in _moving(model):
        unit, used = "rad" if kind == HINGE else "m", int(model.jnt_bodyid[number]) not in soft
        add(_word(name), unit, f"joint({_shown(name)})", used=used)
        add(f"{_word(name)}_rate", f"{unit}/s", f"rate({_shown(name)})", used=used)
    for b in range(1, model.nbody):
        if int(model.body_parentid[b]) == 0 and model.body_dofnum[b] > 0 and b not in soft:
            _body(_word(model.body(b).name), _shown(model.body(b).name), add)
    for i in range(model.ntendon):
        name = model.tendon(i).name
        add(f"{_word(name)}_length", "m", f"tendon({_shown(name)})", used=False)
    for i in range(model.nactuator):
        name = model.actuator(i).name
        add(f"{_word(name)}_force", _unit_of_force(model, i), f"actuator_force({_shown(name)})", used=False)
    used = any(not line.startswith("  #") for line in lines)
    yield "channels:" if used else "channels: {}"
    yield from lines


def _sensors(model: mujoco.MjModel, add: Callable[..., None]) -> None:
    for i in range(model.nsensor):
        name, width = model.sensor(i).name, int(model.sensor_dim[i])
        unit = unit_of_sensor(model, i) or "1"
        if width == 1:
            add(_word(name), unit, f"sensor({_shown(name)})")
            continue
        for k in range(width):
            part = AXES[k] if width == len(AXES) else str(k)
            add(f"{_word(name)}_{part}", unit, f"sensor({_shown(name)}, {part})", used=k < _SHOWN_COMPONENTS)


def _body(own: str, name: str, add: Callable[..., None]) -> None:
    for axis in AXES:
        add(f"{own}_{axis}", "m", f"position({name}, {axis})")
    add(f"{own}_vx", "m/s", f"velocity({name}, x)")
    add(f"{own}_upright", "1", f"up({name}, z)")
    add(f"{own}_yaw", "rad", f"yaw({name})")
    add(f"{own}_contact", "N", f"contact({name})", used=False)


def _commands(model: mujoco.MjModel, channels: set[str]) -> Iterator[str]:
    """A line for each actuator; a name that a channel has gets an ending, so that measures can name both."""
    if not model.nactuator:
        yield "commands: {}   # the MJCF has no actuators; servos above bring some, named like their joints"
        return
    written = not all(not_for_commands(model, i) for i in range(model.nactuator))
    yield "commands:" if written else "commands: {}"
    taken = set(channels)
    for i in range(model.nactuator):
        name, unit = model.actuator(i).name, _unit_of_actuator(model, i)
        limits = ""
        place = int(model.actuator_ctrladr[i])
        if model.actuator_ctrllimited[place]:
            low, high = (
                f"{value:.9g}{'' if unit == '1' else f' {unit}'}" for value in model.actuator_ctrlrange[place]
            )
            limits = f", limits: [{low}, {high}]"
        own = _word(name)
        if own in taken:
            own += "_command"
        while own in taken:
            own += "_"
        taken.add(own)
        shown = '"1"' if unit == "1" else unit
        why = not_for_commands(model, i)
        mark, end = ("# ", f"   # {why.partition(';')[0]}") if why else ("", "")
        yield f"  {mark}{_key(own)}: {{unit: {shown}, to: {{{_key(name)}: 1}}{limits}}}{end}"


def _unit_of_actuator(model: mujoco.MjModel, i: int) -> str:
    """Of its control: a position or a velocity of its joint; else a plain number."""
    if int(model.actuator_trntype[i]) != int(mujoco.mjtTrn.mjTRN_JOINT) or int(model.actuator_dyntype[i]):
        return "1"
    kind = int(model.jnt_type[model.actuator_trnid[i, 0]])
    if kind not in {HINGE, SLIDE}:
        return "1"
    if drives_position(model, i):
        return "rad" if kind == HINGE else "m"
    gain, bias = float(model.actuator_gainprm[i, 0]), float(model.actuator_biasprm[i, 2])
    if gain > 0 and abs(gain + bias) <= 1e-9 * gain and not model.actuator_biasprm[i, 1]:
        return "rad/s" if kind == HINGE else "m/s"
    return "1"


def _unit_of_force(model: mujoco.MjModel, i: int) -> str:
    """Of an actuator's force: a torque about a hinge, else a force."""
    of_joint = int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
    return "N*m" if of_joint and int(model.jnt_type[model.actuator_trnid[i, 0]]) == HINGE else "N"
