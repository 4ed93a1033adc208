"""What befalls a batch of robots, as hooks for the loop; disturbances add to it before the loop begins."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.base.patterns import matches
from circuitkit.base.units import Unit, parse_quantity, parse_unit
from circuitkit.control import Array
from circuitkit.robots import Channel, RobotModel, Worlds
from circuitkit.robots.sensors import sensor_at, unit_of_sensor
from circuitkit.simulation.reference import Moment, Reference

Mask = NDArray[np.bool_]
_ROUNDING = 1e-9  # of a control step


class Hook(NamedTuple):
    """Something that is done in the ticks from `first` up to but without `last`.

    Attributes:
        first: First tick.
        last: One past the last tick.
        act: Gets the tick and what it changes: worlds, readings, channels or commands.
    """

    first: int
    last: int
    act: Callable[[int, Any], object]


class Lever(NamedTuple):
    """A force that acts at a point of a body.

    Attributes:
        robot: Which robot's.
        point_m: Where, from the body's centre of mass along the body's own axes; shape (3,).
        forces: World frame, one row a tick; shape (t, 3), [N].
    """

    robot: int
    point_m: Array
    forces: Array


@dataclass(frozen=True)
class BodyForce:
    """Forces on one body, for the loop and for the pictures.

    Attributes:
        body: Number of the body.
        first_tick: Tick of the first row.
        forces: At its centre of mass; shape (t, B, 3), [N]; the last row is zero.
        torques: Moments beside them; shape (t, B, 3), [N m]; None without.
        point_m: Where they act, from the body's centre of mass; shape (B, 3), [m]; for pictures.
        turns: Whether that point turns with the body; else it lies along the world's axes; shape (B,).
        levers: The forces whose points turn with the body; their moments follow from how it stands.
        ways: What the scenario calls the directions of pushes: robot, start [s], word; for pictures.
    """

    body: int
    first_tick: int
    forces: Array
    torques: Array | None
    point_m: Array
    turns: Mask
    levers: tuple[Lever, ...] = ()
    ways: tuple[tuple[int, float, str], ...] = ()

    def hook(self) -> Hook:
        """What the loop does."""

        def act(tick: int, worlds: Worlds) -> None:
            row = tick - self.first_tick
            torques = None if self.torques is None else self.torques[row]
            if torques is not None and self.levers:
                torques = torques.copy()
                for robot, point_m, forces in self.levers:
                    if forces[row].any():
                        turned = worlds.rotation(self.body, robot) @ point_m
                        torques[robot] += np.cross(turned, forces[row])
            worlds.push(self.body, self.forces[row], torques)

        return Hook(self.first_tick, self.first_tick + len(self.forces), act)


@dataclass(eq=False)
class Effects:
    """Everything that befalls a batch of robots, as hooks by what they change.

    Attributes:
        robot: What the robots are, as they are known.
        reference: Gives moments and directions.
        ticks: T.
        step_s: The control step.
        seeds: One for each of the B robots.
        observed: The channels that the controller reads, in order.
        commanded: The commands that it writes, in order.
        at_rest: Done before the first readings, on the worlds.
        at_once: Done after them, before the first tick.
        on_worlds: Before a control step passes; gets the `Worlds`.
        on_readings: On what the sensors show, shape (B, s), before readings are clipped to their range.
        on_clipped: The same, after that.
        on_computed: On the channels that are computed from it, shape (B, k), before they are clipped.
        on_channels: The same, after that: what the controller reads.
        on_commands: On what it writes; shape (B, m).
        forces: Forces on bodies, which are on `on_worlds` as well.
        windows_s: Start and end of each robot's first push; shape (B, 2); not a number without one.
        own_tick: From which tick on a robot may do otherwise than others with its seed; shape (B,).
        shift_s: By how much pushes start later; shape (B,).
        spans: Everything that has a beginning and an end, for pictures: label, first and last second.
        finishers: Done when all disturbances have added their hooks; see `collected`.
    """

    robot: RobotModel
    reference: Reference
    ticks: int
    step_s: float
    seeds: Sequence[int]
    observed: Sequence[str] = ()
    commanded: Sequence[str] = ()
    at_rest: list[Callable[[Worlds], object]] = field(default_factory=list)
    at_once: list[Callable[[Worlds], object]] = field(default_factory=list)
    on_worlds: list[Hook] = field(default_factory=list)
    on_readings: list[Hook] = field(default_factory=list)
    on_clipped: list[Hook] = field(default_factory=list)
    on_computed: list[Hook] = field(default_factory=list)
    on_channels: list[Hook] = field(default_factory=list)
    on_commands: list[Hook] = field(default_factory=list)
    forces: list[BodyForce] = field(default_factory=list)
    spans: list[tuple[str, float, float]] = field(default_factory=list)
    windows_s: Array = field(init=False)
    own_tick: NDArray[np.int64] = field(init=False)
    shift_s: Array = field(init=False)

    def __post_init__(self) -> None:
        self.windows_s = np.full((self.batch, 2), np.nan)
        self.own_tick = np.full(self.batch, self.ticks, dtype=np.int64)
        self.shift_s = np.zeros(self.batch)
        self._generators: dict[tuple[int, int], np.random.Generator] = {}
        self._collections: dict[str, Any] = {}
        self.finishers: list[Callable[[Effects], object]] = []

    @property
    def batch(self) -> int:
        """B."""
        return len(self.seeds)

    def generator(self, robot: int, stream: int = 0) -> np.random.Generator:
        """Random numbers of one robot: the same for the same seed, whatever the batch.

        Args:
            robot: Which one.
            stream: Disturbances of one stream draw in the order of the file; those of another do not change
                them.
        """
        key = (robot, stream)
        if key not in self._generators:
            seed: Any = (self.seeds[robot], stream) if stream else self.seeds[robot]
            self._generators[key] = np.random.default_rng(seed)
        return self._generators[key]

    def collected(
        self, name: str, make: Callable[[], Any], finish: Callable[[Effects], object] | None = None
    ) -> Any:  # noqa: ANN401
        """Something that several disturbances add to, and that may be finished when all have.

        Args:
            name: What it is called.
            make: Makes it empty.
            finish: Is called in the end; nothing if None.
        """
        if name not in self._collections:
            self._collections[name] = make()
            if finish is not None:
                self.finishers.append(finish)
        return self._collections[name]

    def moment(self, start: Any, where: str) -> Moment:  # noqa: ANN401 - seconds, or a mapping
        """When something starts.

        Raises:
            InputError: There is no such moment before the end of the run.
        """
        end_s = self.ticks * self.step_s
        try:
            if isinstance(start, Mapping):
                return self.reference.moment(start, end_s)
            require_before(float(start), end_s)
            return self.reference.at(float(start))
        except InputError as error:
            problems = (_placed(each, f"{where}.{each.where or 'start'}") for each in error.problems)
            raise InputError(*problems) from error

    def window(self, start: Any, duration: float | None, where: str) -> tuple[int, int]:  # noqa: ANN401 - as above
        """First tick and one past the last tick of something; to the end without a duration.

        Its ticks are the control steps that begin in the window: k with start <= k dt < start + duration.

        Raises:
            InputError: It begins at no moment before the end, or no control step begins in it.
        """
        begin = self.moment(start, where).time_s
        first = self._tick_from(begin)
        last = self.ticks if duration is None else min(self._tick_from(begin + duration), self.ticks)
        if last <= first:
            found = f"from {begin:g} s on" if duration is None else f"{begin:g} s to {begin + duration:g} s"
            message = f"found {found}, in which no control step of {self.step_s:g} s begins"
            key = "start" if duration is None else "duration"
            allowed = "at least one, such as with a duration of a control step or longer"
            raise InputError(Problem("", 0, 0, f"{where}.{key}", f"{message}; allowed: {allowed}"))
        return first, last

    def _tick_from(self, time_s: float) -> int:
        """The first control step that does not begin before a time; a rounding error before it counts."""
        return math.ceil(time_s / self.step_s - _ROUNDING)

    def columns_of(self, pattern: str, where: str) -> tuple[list[int], list[str]]:
        """What a pattern over channels means: columns of `sensordata`, and channels that are more than one.

        Args:
            pattern: Name of a channel or of a sensor, with `*` for any letters.
            where: The place in the scenario, for complaints.

        Returns:
            Columns, in the order of the channels, and the names of the other channels.

        Raises:
            InputError: Nothing has such a name; lists what there is.
        """
        of_sensor = self._columns_of_sensor(pattern)
        if of_sensor is not None:
            return of_sensor, []
        channels = self._matching(pattern)
        if not channels:
            with placed(where):
                kind = "channel"
                raise UnknownNameError(kind, pattern, dict.fromkeys([*self.robot.channels, *self._roles]))
        bare = [each.value.bare for each in channels]
        columns = list(dict.fromkeys(column for column in bare if column is not None))
        return columns, [each.name for each, column in zip(channels, bare, strict=True) if column is None]

    def amount_for(self, pattern: str, text: str, where: str) -> float:
        """An amount that is added to what a pattern over channels means, in SI units.

        Args:
            pattern: As for `columns_of`, which knows what it means.
            text: The amount as written.
            where: The place in the scenario, for complaints.

        Raises:
            InputError: Its unit is not that of every channel, or that of the sensor by its type; where MuJoCo
                knows none of a sensor, any fits.
        """
        quantity = parse_quantity(text)
        for kind, name, unit in self._units_of(pattern):
            if unit.dimension != quantity.dimension:
                message = f"found '{text}', and the {kind} '{name}' has '{unit}'; allowed: a unit like it"
                raise InputError(Problem("", 0, 0, where, message))
        return quantity.value_si

    def _units_of(self, pattern: str) -> Iterator[tuple[str, str, Unit]]:
        """What a pattern over channels means: kind, name and unit of each channel or sensor that has one."""
        of_sensor = self._columns_of_sensor(pattern)
        if of_sensor is None:
            yield from (("channel", each.name, each.unit) for each in self._matching(pattern))
            return
        model = self.robot.model
        for number in dict.fromkeys(sensor_at(model, column) for column in of_sensor):
            if (unit := unit_of_sensor(model, number)) is not None:
                yield "sensor", pattern, parse_unit(unit)

    def _matching(self, pattern: str) -> list[Channel]:
        return [each for name, each in self.robot.channels.items() if matches(name, pattern)]

    def _columns_of_sensor(self, name: str) -> list[int] | None:
        """The columns of what a block calls a sensor, or of a sensor that no channel is called like."""
        if name in self._roles:
            return list(self._roles[name])
        model = self.robot.model
        for i in range(0 if self._matching(name) else model.nsensor):
            if model.sensor(i).name == name:
                first = int(model.sensor_adr[i])
                return list(range(first, first + int(model.sensor_dim[i])))
        return None

    @property
    def _roles(self) -> dict[str, Sequence[int]]:
        return {
            name: columns
            for block in self.robot.blocks.values()
            for name, columns in getattr(block, "sensor_roles", {}).items()
        }


def require_before(start_s: float, end_s: float) -> None:
    """Refuse what begins when the run is over.

    Raises:
        InputError: It does.
    """
    if start_s >= end_s - 1e-9:
        message = f"found {start_s:g} s, and the run ends at {end_s:g} s; allowed: a start before the end"
        raise InputError(Problem("", 0, 0, "start", message, "or a longer duration of the run"))


@contextmanager
def placed(where: str) -> Iterator[None]:
    """Give a complaint about an unknown name the place in the scenario where the name stands."""
    try:
        yield
    except UnknownNameError as error:
        raise InputError(*(_placed(problem, where) for problem in error.problems)) from error


def _placed(problem: Problem, where: str) -> Problem:
    """A complaint with the place in the scenario that it is about."""
    return problem if problem.is_placed else Problem("", 0, 0, where, problem.message, problem.hint)
