"""A force or a torque on a body."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from circuitkit.base.errors import InputError, Problem, UnitError, listing, suggest
from circuitkit.base.source import describe
from circuitkit.base.source.fields import Metres, NewtonMetres, Newtons, Seconds
from circuitkit.base.units import parse_quantity, parse_unit
from circuitkit.control import Array
from circuitkit.simulation.disturbance import Disturbance, Start
from circuitkit.simulation.effects import BodyForce, Effects, Lever, placed
from circuitkit.simulation.reference import Moment

_HIGHEST_M = 2.0  # above or below a body's centre of mass; beyond, it is a slip of the unit
_LARGEST_ANGLE_RAD = math.radians(360) * (1 + 1e-9)  # once round, however it is written

DIRECTIONS: Mapping[str, tuple[float, float, float]] = {
    "forward": (1.0, 0.0, 0.0),
    "backward": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}


def check_direction(value: object) -> str:
    """Refuse an angle of more than once round; words are looked up when the reference is known."""
    text = value if isinstance(value, str) else ""
    if _is_angle(text):
        if not abs(parse_quantity(text).value_si) <= _LARGEST_ANGLE_RAD:
            message = f"found '{text}'; allowed: an angle from -360 deg to 360 deg"
            raise ValueError(message)
    elif not text.replace("_", "").isalpha():
        allowed = f"{listing(DIRECTIONS)}, or an angle such as '15 deg'"
        message = f"unknown direction {describe(value)}; allowed: {allowed}"
        raise ValueError(message)
    return text


def _is_angle(text: str) -> bool:
    try:
        return parse_quantity(text).dimension == parse_unit("rad").dimension
    except UnitError:
        return False


class Push(Disturbance):
    """Pushes a body with a force, or turns it with a torque, for a while."""

    kind: ClassVar[str] = "push"
    per_robot: ClassVar[bool] = True

    body: str = Field(
        description="A body of the MJCF, or what a block of the robot file calls one, such as torso."
    )
    force: Newtons | None = Field(default=None, ge=0, description="Size of the force.")
    torque: NewtonMetres | None = Field(
        default=None, ge=0, description="Size of a torque about `direction`, instead of a force."
    )
    direction: Annotated[str, BeforeValidator(check_direction)] = Field(
        description="forward, backward, left, right, up, down, or what the reference knows, or an "
        "angle: 0 deg is forward, 90 deg to the left."
    )
    duration: Seconds = Field(gt=0, description="How long it lasts.")
    height: Metres = Field(
        default=0.0,
        ge=-_HIGHEST_M,
        le=_HIGHEST_M,
        description="Where it acts: so far above the body's centre of mass, or below if negative.",
    )
    at: tuple[Metres, Metres, Metres] | None = Field(
        default=None,
        description="Where it acts: a point of the body, from its centre of mass along its own x, y and z, "
        "which turns with it; instead of height.",
    )
    start: Start = Field(description="A time such as 5 s, or a moment of the reference.")

    @model_validator(mode="after")
    def _force_or_torque(self) -> Push:
        if (self.force is None) == (self.torque is None):
            found = "neither force nor torque" if self.force is None else "both force and torque"
            message = f"found {found}; allowed: one of them"
            raise ValueError(message)
        if self.at is not None and self.height:
            message = "found both at and height; allowed: one of them"
            raise ValueError(message)
        return self

    def first_tick(self, effects: Effects, robot: int, where: str) -> int:
        """The tick in which it begins."""
        return int(_begin_s(effects.moment(self.start, where), effects, robot) / effects.step_s)

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:
        """Add the push to those on the same body."""
        with placed(f"{where}.body"):
            body = effects.robot.number("body", self.body)
        moment = effects.moment(self.start, where)
        way = direction_of(self.direction, moment, f"{where}.direction")
        for i in robots:
            start = _begin_s(moment, effects, i)
            end = start + self.duration
            force = (self.force or 0.0) * way
            point = np.array([0.0, 0.0, self.height] if self.at is None else self.at)
            turn = self.torque * way if self.torque is not None else np.zeros(3)
            acting = _Acting(i, start, end, force, point, self.at is not None, turn, self.direction)
            _pushes_of(effects).setdefault(body, []).append(acting)
            if np.isnan(effects.windows_s[i, 0]):
                effects.windows_s[i] = start, end


def _begin_s(moment: Moment, effects: Effects, robot: int) -> float:
    """When a robot's push begins: the moment, shifted by the jitter; [s]."""
    return max(moment.time_s + float(effects.shift_s[robot]), 0.0)


def direction_of(name: str, moment: Moment, where: str = "direction") -> Array:
    """Unit vector of a direction, world frame; an angle is from forward towards the left.

    Raises:
        InputError: Neither the reference nor the world knows the direction.
    """
    if name in moment.directions:
        return np.asarray(moment.directions[name])
    if name in DIRECTIONS:
        return np.array(DIRECTIONS[name])
    if _is_angle(name):
        angle = parse_quantity(name).value_si
        return np.array([math.cos(angle), math.sin(angle), 0.0])
    words = [*DIRECTIONS, *moment.directions]
    message = f"unknown direction '{name}'; allowed: {listing(words)}, or an angle such as '15 deg'"
    raise InputError(Problem("", 0, 0, where, message, suggest(name, words)))


class _Acting(NamedTuple):
    """A force and a torque on a robot's body from start to end, at a point that may turn with the body."""

    robot: int
    start_s: float
    end_s: float
    force: Array
    point_m: Array
    turns: bool
    torque: Array
    way: str


def _pushes_of(effects: Effects) -> dict[int, list[_Acting]]:
    """The pushes so far by body; when all are there they become one `BodyForce` a body."""

    def finish(effects: Effects) -> None:
        for body, entries in pushes.items():
            made = _body_force(body, entries, effects)
            effects.forces.append(made)
            effects.on_worlds.append(made.hook())

    pushes: dict[int, list[_Acting]] = effects.collected("pushes", dict, finish)
    return pushes


def _body_force(body: int, entries: list[_Acting], effects: Effects) -> BodyForce:
    """Forces of each tick; where a push covers a part of a tick, that part of its force acts all through."""
    batch, dt = effects.batch, effects.step_s
    first = int(min(entry.start_s for entry in entries) / dt)
    last = min(int(np.ceil(max(entry.end_s for entry in entries) / dt)), effects.ticks)
    begin = (first + np.arange(last - first + 1)) * dt
    forces = np.zeros((len(begin), batch, 3))
    torques = np.zeros_like(forces) if any(e.point_m.any() or e.torque.any() for e in entries) else None
    points, turning = np.zeros((batch, 3)), np.zeros(batch, dtype=bool)
    levers = []
    for i, start, end, force, point, turns, torque, _ in entries:
        share = np.clip(np.minimum(end, begin + dt) - np.maximum(start, begin), 0.0, dt)[:, np.newaxis] / dt
        forces[:, i] += share * force
        points[i], turning[i] = point, turns
        if torques is not None:
            torques[:, i] += share * (torque if turns else np.cross(point, force) + torque)
        if turns:
            levers.append(Lever(i, point, share * force))
    ways = tuple((each.robot, each.start_s, each.way) for each in entries)
    return BodyForce(body, first, forces, torques, points, turning, tuple(levers), ways)
