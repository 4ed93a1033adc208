"""Measures: what is told of a run, what ends it, the kinds that plug-ins bring, and who has ended when."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import ExpressionError, InputError, Problem
from circuitkit.base.registry import Registry
from circuitkit.base.source import FileModel
from circuitkit.base.units import Unit
from circuitkit.control import Array
from circuitkit.robots import Observer, RobotModel, TickLog
from circuitkit.simulation.effects import Effects
from circuitkit.simulation.formulas import Formula, Track, Value
from circuitkit.simulation.reference import Motion


class MeasureKind(FileModel):
    """Base of the kinds of measures that plug-ins bring; see `BoundMeasure` for what it becomes in a run.

    Attributes:
        kind: The key below `measures` in a scenario.
    """

    kind: ClassVar[str]

    def bind(self, plan: Any) -> BoundMeasure:  # noqa: ANN401, ARG002 - the plan, which knows measures
        """What measures a run of this plan.

        Raises:
            InputError: The plan lacks what it needs.
        """
        return BoundMeasure()


class BoundMeasure:
    """A measure that knows its run; this one measures nothing.

    Attributes:
        channels: What it needs.
        units: The names of what it gives, with their units.
    """

    channels: tuple[str, ...] = ()
    units: Mapping[str, Unit] = {}

    def measure(self, track: Track) -> Mapping[str, Value]:  # noqa: ARG002 - for others
        """What it gives."""
        return {}

    def bounds_known(self, channel: str) -> bool:  # noqa: ARG002 - for others
        """Whether it knows bounds of a channel."""
        return False

    def bounds(self, channel: str, values: Callable[[str], Array]) -> tuple[Any, Any] | None:  # noqa: ARG002
        """Lower and upper bound of a channel for `outside`, shape (T,) each; None if it knows none."""
        return None


SURVIVED = "survived"  # the measure that says whether a run was a success
MEASURES: Registry[MeasureKind] = Registry("measures", MeasureKind)


@dataclass(frozen=True, eq=False)
class Judge:
    """All measures of a scenario, and what ends a run.

    Attributes:
        formulas: Measures that are expressions, by name.
        kinds: Measures of plug-ins.
        until: What ends the run; None for nothing.
        ranges: Bounds of channels, [SI].
    """

    formulas: Mapping[str, Formula] = field(default_factory=dict)
    kinds: tuple[BoundMeasure, ...] = ()
    until: Formula | None = None
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def units(self) -> dict[str, Unit | None]:
        """Unit of each measure, in the order of the table; None for true and false."""
        found: dict[str, Unit | None] = {
            name: None if formula.is_condition else formula.unit for name, formula in self.formulas.items()
        }
        for each in self.kinds:
            found |= each.units
        return found

    @property
    def channels(self) -> tuple[str, ...]:
        """Everything that it needs of a run."""
        needed = [name for formula in self.formulas.values() for name in formula.channels]
        needed += [name for each in self.kinds for name in each.channels]
        needed += self.until.channels if self.until else ()
        return tuple(dict.fromkeys(needed))

    def bounds(self, name: str, values: Callable[[str], Array]) -> tuple[Any, Any] | None:
        """Bounds of a channel: those of a plug-in's measure, else those of its range."""
        for each in self.kinds:
            if (found := each.bounds(name, values)) is not None:
                return found
        return self.ranges.get(name)

    def __call__(self, track: Track) -> dict[str, Value]:
        """Judge a run."""
        found = {name: formula.value(track) for name, formula in self.formulas.items()}
        for each in self.kinds:
            found |= each.measure(track)
        return found


def located(error: ExpressionError, place: Callable[[str, int], Problem]) -> InputError:
    """The error of an expression, with the place in the scenario."""
    return InputError(place(str(error), error.offset))


class Tracker:
    """Keeps the channels that measures need, and sees who has ended.

    Attributes:
        ended: Who has ended; shape (B,).
        end_tick: In which tick; -1 who has not; shape (B,).
        seen_tick: When that was seen; shape (B,).
        done: How many ticks it knows.
        lost: Whose simulation became unstable, which ended it; shape (B,).
    """

    def __init__(
        self,
        robot: RobotModel,
        motion: Motion,
        effects: Effects,
        judge: Judge,
        command_names: Sequence[str],
        *,
        step_s: float,
        ticks: int,
        cut: TickLog,
    ) -> None:
        """Name what is judged.

        Args:
            robot: The robot as it is simulated.
            motion: What the reference wants.
            effects: What befalls the robots.
            judge: Measures, and what ends a run.
            command_names: The controller's commands.
            step_s: The control step.
            ticks: T.
            cut: When commands and controls were cut to their ranges.
        """
        batch = effects.batch
        self._cut = cut
        self._judge, self._effects, self._motion = judge, effects, motion
        self._step_s = step_s
        sensed = [name for name in judge.channels if name in robot.channels]
        # One by one, so that no bit of a measure depends on what else is measured.
        self._observers = [Observer(robot.channels, [name]) for name in sensed]
        self._place = {name: i for i, name in enumerate(sensed)}
        self._values = np.empty((ticks, batch, len(sensed)))
        self._commands = np.empty((ticks, batch, len(command_names)))
        self._command_place = {name: i for i, name in enumerate(command_names)}
        self.ended: NDArray[np.bool_] = np.zeros(batch, dtype=bool)
        self.end_tick = np.full(batch, -1)
        self.seen_tick = np.full(batch, -1)
        self.done = 0
        self.lost: NDArray[np.bool_] = np.zeros(batch, dtype=bool)
        self._lost_tick = np.full(batch, ticks)
        self._firsts: list[Array] = []

    def lose(self, robots: NDArray[np.bool_], tick: int) -> None:
        """The simulation of these robots became unstable in a tick; shape (B,)."""
        self._lost_tick[robots] = np.minimum(self._lost_tick[robots], tick)

    def look(self, readings: Array, commands: Array) -> NDArray[np.bool_]:
        """Take the ticks since the last look, and see who has ended in them.

        Args:
            readings: Shape (n, B, s).
            commands: Shape (n, B, m).

        Returns:
            Who has; shape (B,).
        """
        newly: NDArray[np.bool_] = np.zeros(len(self.ended), dtype=bool)
        if len(readings) == 0:
            return newly
        begin, self.done = self.done, self.done + len(readings)
        for i, observer in enumerate(self._observers):
            self._values[begin : self.done, :, i] = observer(readings)[..., 0]
        self._commands[begin : self.done] = commands
        if self._judge.until is not None:

            def track(first: int) -> Track:
                return self._track(slice(None), first, self.done)

            holds = self._judge.until.holds(track, begin, self._firsts)
            newly = holds.any(axis=0) & ~self.ended
            self.end_tick[newly] = begin + holds[:, newly].argmax(axis=0)
        if (self._lost_tick < self.done).any():
            lost = (self._lost_tick < np.where(newly, self.end_tick, self.done)) & ~self.ended
            self.end_tick[lost] = self._lost_tick[lost]
            self.lost |= lost
            newly |= lost
        self.seen_tick[newly] = self.done - 1
        self.ended |= newly
        return newly

    def track(self, robot: int) -> Track:
        """One robot's run up to its end."""
        last = int(self.end_tick[robot]) + 1 if self.ended[robot] else self.done
        return self._track(robot, 0, last)

    def measures(self) -> tuple[Mapping[str, Value], ...]:
        """The measures of every robot."""
        return tuple(self._judge(self.track(i)) for i in range(len(self.ended)))

    def effort(self) -> tuple[dict[str, float], ...]:
        """Root mean square of every command up to the end, without the tick in which it ended; SI units."""
        found = []
        for i in range(len(self.ended)):
            last = int(self.end_tick[i]) if self.ended[i] else self.done
            spent = np.ascontiguousarray(self._commands[:last, i].T)
            values = [float(np.sqrt(np.square(each).mean())) if last else 0.0 for each in spent]
            found.append(dict(zip(self._command_place, values, strict=True)))
        return tuple(found)

    def clamped(self) -> Array:
        """In which part of its ticks up to the end a command or control of a robot was cut; shape (B,)."""
        return self._cut.shares(np.where(self.ended, self.end_tick + 1, self.done))

    def _track(self, robot: int | slice, first: int, last: int) -> Track:
        def values(name: str) -> Array:
            if name in self._place:
                return self._values[first:last, robot, self._place[name]]
            if name in self._command_place:
                return self._commands[first:last, robot, self._command_place[name]]
            if name not in self._motion.planned:  # a command that this controller does not write
                return np.zeros(
                    (last - first,) if isinstance(robot, int) else (last - first, len(self.ended))
                )
            planned = self._motion.planned[name].values[first:last]
            return planned if isinstance(robot, int) else planned[:, np.newaxis]

        one = isinstance(robot, int)
        return Track(
            step_s=self._step_s,
            first=first,
            shape=(last - first,) if one else (last - first, len(self.ended)),
            ended=bool(self.ended[robot]) if isinstance(robot, int) else False,
            values=values,
            bounds=lambda name: self._judge.bounds(name, values),
            push_s=float(self._effects.windows_s[robot, 0]) if isinstance(robot, int) else np.nan,
            pace_s=self._motion.pace_s,
        )
