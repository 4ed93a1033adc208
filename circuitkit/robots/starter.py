"""A commented robot file to start from, with everything that an MJCF has."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import mujoco

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.files import write_text
from circuitkit.robots.model import drives_position
from circuitkit.robots.parts import AXES, unit_of_sensor, width_of_sensor

_NO_WORD = re.compile(r"\W+")
_HINGE, _SLIDE, _FREE = (
    int(kind) for kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE)
)


def write_robot_starter(mjcf: Path, path: Path, *, force: bool = False) -> Path:
    """Write a robot file for an MJCF: all its sensors as channels, its actuators as commands, the rest as comments.

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
    if not mjcf.is_file():
        raise InputError(Problem(str(mjcf), 1, 1, "--robot", "no such file; allowed: the path of an MJCF file"))
    if path.exists() and not force:
        message = f"'{path}' is there already; allowed: another name, or --force"
        raise InputError(Problem("", 0, 0, "FILE", message))
    try:
        spec = mujoco.MjSpec.from_file(str(mjcf))
        model = spec.compile()
    except ValueError as error:
        lines = "; ".join(line.strip() for line in str(error).splitlines() if line.strip())
        raise InputError(Problem(str(mjcf), 1, 1, "", f"not an MJCF file: {lines}")) from error
    write_text(path, "\n".join(_lines(mjcf, path, spec, model)) + "\n")
    return path


def _lines(mjcf: Path, path: Path, spec: object, model: mujoco.MjModel) -> Iterator[str]:
    try:
        beside = mjcf.resolve().relative_to(path.resolve().parent)
    except ValueError:
        beside = mjcf.resolve()
    yield f"# A robot made of {mjcf.name}: what of it can be read (channels) and written (commands)."
    yield "# Take out what you do not need, rename what you like; docs/robots/README.md tells what expressions can say."
    yield f"robot: {_word(mjcf.stem)}"
    yield f"description: {mjcf.name}"
    yield f"mjcf: {beside}"
    yield f"# timestep: {model.opt.timestep * 1e3:g} ms      # the MJCF's own; a control step is a multiple of it"
    keys = [model.key(i).name for i in range(model.nkey) if model.key(i).name]
    yield f"# key: {keys[0]}      # keyframes to start from: {', '.join(keys)}" if keys else "# (the MJCF has no named keyframes)"
    yield from _joints(model)
    yield from _channels(spec, model)
    yield from _commands(model)


def _word(text: str) -> str:
    word = _NO_WORD.sub("_", text).strip("_") or "unnamed"
    return f"_{word}" if word[0].isdigit() else word


def _shown(name: str) -> str:
    """A name of the MJCF as an argument of an expression."""
    return name if name.isidentifier() else f'"{name}"'


def _quoted(expression: str) -> str:
    return f"'{expression}'" if '"' in expression else f'"{expression}"' if "," in expression else expression


def _joints(model: mujoco.MjModel) -> Iterator[str]:
    named = [(model.joint(j).name, int(model.jnt_type[j])) for j in range(model.njnt) if model.joint(j).name]
    moving = [(name, kind) for name, kind in named if kind in {_HINGE, _SLIDE}]
    if not moving:
        return
    yield "# hold:                    # joints that start at and, where a position actuator drives them, are held at this"
    for name, kind in moving:
        yield f"#   {name}: {'0 deg' if kind == _HINGE else '0 mm'}"
    yield "# servos:                  # position servos in the place of the MJCF's actuators of these joints"
    yield '#   - {joints: ["*"], stiffness: 100 N*m/rad, damping: 3 N*m*s/rad, torque: 10 N*m}'


def _channels(spec: object, model: mujoco.MjModel) -> Iterator[str]:
    yield "channels:"
    taken: set[str] = set()

    def line(name: str, unit: str, expression: str, *, used: bool = True) -> str:
        own = name
        while own in taken:
            own += "_"
        taken.add(own)
        return f"  {'' if used else '# '}{own}: {{unit: {unit}, is: {_quoted(expression)}}}"

    sensors = [sensor for sensor in spec.sensors if sensor.name]  # type: ignore[attr-defined]  # MjSpec is not typed
    for sensor in sensors:
        width, unit = width_of_sensor(sensor), unit_of_sensor(sensor, model)
        if width == 1:
            yield line(_word(sensor.name), unit, f"sensor({_shown(sensor.name)})")
        else:
            for k in range(width):
                part = AXES[k] if width == 3 else str(k)  # noqa: PLR2004 - a vector
                yield line(f"{_word(sensor.name)}_{part}", unit, f"sensor({_shown(sensor.name)}, {part})")
    for j in range(model.njnt):
        name, kind = model.joint(j).name, int(model.jnt_type[j])
        if name and kind in {_HINGE, _SLIDE}:
            unit = "rad" if kind == _HINGE else "m"
            yield line(_word(name), unit, f"joint({_shown(name)})")
            yield line(f"{_word(name)}_rate", f"{unit}/s", f"rate({_shown(name)})")
    roots = [b for b in range(1, model.nbody) if int(model.body_parentid[b]) == 0 and model.body_dofnum[b] > 0]
    for b in roots:
        name = model.body(b).name
        if name:
            own = _word(name)
            for axis in AXES:
                yield line(f"{own}_{axis}", "m", f"position({_shown(name)}, {axis})")
            yield line(f"{own}_vx", "m/s", f"velocity({_shown(name)}, x)")
            yield line(f"{own}_upright", "1", f"up({_shown(name)}, z)")
            yield line(f"{own}_yaw", "rad", f"yaw({_shown(name)})")
            yield line(f"{own}_contact", "N", f"contact({_shown(name)})", used=False)
    if not taken:
        yield "  {}"


def _commands(model: mujoco.MjModel) -> Iterator[str]:
    yield "commands:"
    named = [i for i in range(model.nu) if model.actuator(i).name]
    if not named:
        yield "  {}   # the MJCF has no named actuators; servos above bring some, named like their joints"
    for i in named:
        name, unit = model.actuator(i).name, _unit_of_actuator(model, i)
        limits = ""
        if model.actuator_ctrllimited[i]:
            low, high = (f"{value:g}{'' if unit == '1' else f' {unit}'}" for value in model.actuator_ctrlrange[i])
            limits = f", limits: [{low}, {high}]"
        key = name if name.isidentifier() else f'"{name}"'
        yield f"  {_word(name)}: {{unit: {unit}, to: {{{key}: 1}}{limits}}}"


def _unit_of_actuator(model: mujoco.MjModel, i: int) -> str:
    """Of its control: a position or a velocity of its joint; else a plain number."""
    if int(model.actuator_trntype[i]) != int(mujoco.mjtTrn.mjTRN_JOINT):
        return "1"
    hinge = int(model.jnt_type[model.actuator_trnid[i, 0]]) == _HINGE
    if drives_position(model, i):
        return "rad" if hinge else "m"
    gain, bias = float(model.actuator_gainprm[i, 0]), float(model.actuator_biasprm[i, 2])
    if gain > 0 and abs(gain + bias) <= 1e-9 * gain and not model.actuator_biasprm[i, 1]:
        return "rad/s" if hinge else "m/s"
    return "1"
