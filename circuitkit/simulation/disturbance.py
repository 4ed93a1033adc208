"""Pushes, noise and faults as arrays over ticks and robots, made before the loop starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, UnknownNameError, suggest
from circuitkit.base.units import parse_quantity
from circuitkit.biped.gait import LEFT, PHASES, Walk
from circuitkit.biped.gait.schedule import plan_steps
from circuitkit.robots import RobotModel, body_number
from circuitkit.simulation.scenario import DIRECTIONS, SIDEWAYS, Fault, Jitter, Push, SensorNoise

Array = NDArray[np.float64]

_COM_STREAM = 1  # a stream of its own beside the seed's, so that one noise does not change another


@dataclass(frozen=True)
class Trial:
    """One robot's fate.

    Attributes:
        seed: Of noise and jitter.
        pushes: What pushes it.
    """

    seed: int
    pushes: tuple[Push, ...]


@dataclass(frozen=True)
class BodyPush:
    """Forces on one body.

    Attributes:
        body: Number of the body.
        first_tick: Tick of the first row.
        forces: At its centre of mass; shape (t, B, 3), [N]; the last row is zero.
        torques: What comes with them if they act elsewhere, r x F; shape (t, B, 3), [N m]; None without.
    """

    body: int
    first_tick: int
    forces: Array
    torques: Array | None = None


@dataclass(frozen=True)
class Fates:
    """What befalls the robots of a batch.

    Attributes:
        pushes: Forces, a body each.
        windows_s: Start and end of each robot's first push; shape (B, 2); not a number without a push.
        base_velocity: At the start, forward and left; shape (B, 2), [m/s].
        cell_noise: Added to the force cells; shape (T, B, 8), [N]; None without noise.
        com_noise: Added to the centre of mass and to its velocity; shape (T, B, 6), [m] and [m/s]; None
            without noise.
    """

    pushes: tuple[BodyPush, ...]
    windows_s: Array
    base_velocity: Array
    cell_noise: Array | None
    com_noise: Array | None = None


def draw_fates(
    trials: Sequence[Trial], walk: Walk, robot: RobotModel, jitter: Jitter, noise: SensorNoise
) -> Fates:
    """Draw everything random, each robot from its own seed, so that a batch draws what a single robot does.

    Raises:
        InputError: A push starts in a step that is not there, or on a body that does not exist.
    """
    dt = walk.gait.control_step
    cells = len(robot.layout.cells)
    windows = np.full((len(trials), 2), np.nan)
    velocity = np.zeros((len(trials), 2))
    cell_noise = np.zeros((walk.ticks, len(trials), cells)) if noise.force_cells > 0 else None
    com_noise = np.zeros((walk.ticks, len(trials), 6)) if noise.com > 0 or noise.com_velocity > 0 else None
    by_body: dict[int, list[_Acting]] = {}
    for i, trial in enumerate(trials):
        rng = np.random.default_rng(trial.seed)
        shift = rng.uniform(-jitter.push_start, jitter.push_start)
        velocity[i] = rng.normal(0.0, jitter.base_velocity, 2)
        if cell_noise is not None:
            cell_noise[:, i] = rng.normal(0.0, noise.force_cells, (walk.ticks, cells))
        if com_noise is not None:
            own = np.random.default_rng((trial.seed, _COM_STREAM))
            deviation = np.repeat([noise.com, noise.com_velocity], 3)
            com_noise[:, i] = own.normal(0.0, 1.0, (walk.ticks, 6)) * deviation
        for number, push in enumerate(trial.pushes):
            start_s, support = push_start(push, walk, number)
            start = max(start_s + shift, 0.0)
            end = start + push.duration
            force = push.force * direction_of(push.direction, support)
            acting = _Acting(i, start, end, force, push.height)
            by_body.setdefault(_body(push, robot, number), []).append(acting)
            if number == 0:
                windows[i] = start, end
    pushes = tuple(_body_push(body, entries, len(trials), dt) for body, entries in by_body.items())
    return Fates(pushes, windows, velocity, cell_noise, com_noise)


def _body(push: Push, robot: RobotModel, number: int) -> int:
    try:
        return body_number(robot, push.body)
    except UnknownNameError as error:
        raise InputError(replace(error.problems[0], where=f"pushes[{number}].body")) from error


def direction_of(name: str, support: int) -> Array:
    """Unit vector of a direction, world frame; inward and outward depend on the foot that carries.

    An angle is from forward towards the left.
    """
    if name in SIDEWAYS:
        outward = 1.0 if support == LEFT else -1.0
        return np.array([0.0, outward if name == "outward" else -outward, 0.0])
    if name in DIRECTIONS:
        return np.array(DIRECTIONS[name])
    angle = parse_quantity(name).value_si
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def push_start(push: Push, walk: Walk, number: int = 0) -> tuple[float, int]:
    """When a push starts by the gait, [s], and which foot carries then.

    Raises:
        InputError: The walk is over before.
    """
    schedule, start, gait = walk.schedule, push.start, walk.gait
    phase = PHASES.index(start.phase)
    first_step = plan_steps(gait, 1)
    moment = start.at * np.count_nonzero(first_step.phase == phase)
    ticks = np.flatnonzero((schedule.step == start.step) & (schedule.phase == phase))
    if len(ticks) == 0 or moment > len(ticks):
        whole_steps = (walk.ticks - np.count_nonzero(first_step.step < 0)) // gait.step_ticks
        steps = f"steps 0 to {whole_steps - 1}, or " if whole_steps > 0 else ""
        found = f"found step {start.step}, and the walk ends before that '{start.phase}'"
        message = f"{found}; allowed: {steps}a longer duration"
        raise InputError(Problem("", 0, 0, f"pushes[{number}].start", message))
    return float(ticks[0] + moment) * gait.control_step, int(schedule.support[ticks[0]])


class _Acting(NamedTuple):
    """A force on a robot's body from start to end, so far above the body's centre of mass."""

    robot: int
    start_s: float
    end_s: float
    force: Array
    height_m: float


def _body_push(body: int, entries: list[_Acting], batch: int, dt: float) -> BodyPush:
    """Forces of each tick; where a push covers a part of a tick, that part of its force acts all through."""
    first = int(min(entry.start_s for entry in entries) / dt)
    last = int(np.ceil(max(entry.end_s for entry in entries) / dt))
    begin = (first + np.arange(last - first + 1)) * dt
    forces = np.zeros((len(begin), batch, 3))
    torques = np.zeros_like(forces) if any(entry.height_m for entry in entries) else None
    for i, start, end, force, height in entries:
        share = np.clip(np.minimum(end, begin + dt) - np.maximum(start, begin), 0.0, dt) / dt
        forces[:, i] += share[:, None] * force
        if torques is not None:
            torques[:, i] += share[:, None] * np.cross([0.0, 0.0, height], force)
    return BodyPush(body, first, forces, torques)


def fault_values(faults: Sequence[Fault], walk: Walk, robot: RobotModel) -> dict[int, Array]:
    """For each tick with a fault, what the force cells show: 1 passes through, 0 and not-a-number do not.

    Raises:
        InputError: There is no such cell.
    """
    cells = robot.layout.cells
    factors: dict[int, Array] = {}
    for number, fault in enumerate(faults):
        if fault.cell not in cells:
            message = f"the robot has no force cell '{fault.cell}'; allowed: {', '.join(cells)}"
            where = f"faults[{number}].cell"
            raise InputError(Problem("", 0, 0, where, message, suggest(fault.cell, cells)))
        dt = walk.gait.control_step
        end = walk.ticks if fault.duration is None else round((fault.start + fault.duration) / dt)
        for tick in range(round(fault.start / dt), min(end, walk.ticks)):
            row = factors.setdefault(tick, np.ones(len(cells)))
            row[cells.index(fault.cell)] = np.nan if fault.reading == "missing" else 0.0
    return factors


def delay_ticks(delay_s: float, walk: Walk) -> int:
    """How many ticks old a reading is.

    Raises:
        InputError: It is no whole number of control steps.
    """
    dt = walk.gait.control_step
    ticks = round(delay_s / dt)
    if abs(delay_s - ticks * dt) > 1e-9:  # noqa: PLR2004 - rounding
        message = f"found {delay_s * 1e3:g} ms; allowed: a multiple of the control step of {dt * 1e3:g} ms"
        raise InputError(Problem("", 0, 0, "sensor_delay", message))
    return ticks
