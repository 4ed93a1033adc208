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
from circuitkit.robots.sensors import sensor_at
from circuitkit.robots.validity import bad_position, bad_reading
from circuitkit.simulation.effects import Effects
from circuitkit.simulation.formulas import Formula, Track, Value
from circuitkit.simulation.reductions import holds_where
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


INVALID = "invalid"  # the column that says when and why a run became invalid
RMS = "rms_"  # what the columns of commands begin with
CLAMPED = "clamped_share"  # the column that says in which part of a run commands were cut to their limits
# Columns of results, of runs and of studies, that no measure may be called.
COLUMNS = frozenset([
    "scenario", "controller", "seed", "push", "outcome", INVALID, "warnings", "interventions", "interrupted",
    "notes", "recording", "version", "key", CLAMPED,
])  # fmt: skip
SURVIVED = "survived"  # the measure that says whether a run was a success
MEASURES: Registry[MeasureKind] = Registry("measures", MeasureKind)


@dataclass(frozen=True, eq=False)
class Judge:
    """All measures of a scenario, and what ends a run.

    Attributes:
        formulas: Measures that are expressions, by name.
        kinds: Measures of plug-ins.
        until: What ends the run; None for nothing.
        valid: What must hold all the time, or the run is invalid; None for nothing.
        ranges: Bounds of channels, [SI].
    """

    formulas: Mapping[str, Formula] = field(default_factory=dict)
    kinds: tuple[BoundMeasure, ...] = ()
    until: Formula | None = None
    valid: Formula | None = None
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
        needed += [name for each in (self.until, self.valid) if each for name in each.channels]
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
    """Keeps the channels that measures need, and sees who has ended, and whose physics has become invalid.

    Attributes:
        ended: Who has ended, one way or the other; shape (B,).
        end_tick: In which tick; -1 who has not; shape (B,).
        seen_tick: When that was seen; shape (B,).
        done: How many ticks it knows.
        invalid: When and why a robot's run became invalid, which ended it; None where it did not.
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
        self._robot, self._step_s = robot, step_s
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
        self.invalid: list[str | None] = [None] * batch
        self._faults = [""] * batch
        self._fault_tick = np.full(batch, ticks)
        self._firsts: list[Array] = []
        self._firsts_of_valid: list[Array] = []

    @property
    def broken(self) -> NDArray[np.bool_]:
        """Whose physics has become invalid."""
        found: NDArray[np.bool_] = self._fault_tick < self.done
        return found

    def last_valid(self, robot: int) -> int:
        """How many ticks of a robot there are up to the one in which its physics became invalid."""
        return min(int(self._fault_tick[robot]) + 1, self.done)

    def invalidate(self, faults: Mapping[int, str], tick: int) -> None:
        """The physics of these robots became invalid in a tick; the first reason counts."""
        for robot, why in faults.items():
            if tick < self._fault_tick[robot]:
                self._fault_tick[robot], self._faults[robot] = tick, why

    def look(self, readings: Array, commands: Array, qpos: Array) -> NDArray[np.bool_]:
        """Take the ticks since the last look, and see who has ended in them.

        Args:
            readings: Shape (n, B, s).
            commands: Shape (n, B, m).
            qpos: Shape (n, B, nq).

        Returns:
            Who has; shape (B,).
        """
        newly: NDArray[np.bool_] = np.zeros(len(self.ended), dtype=bool)
        if len(readings) == 0:
            return newly
        begin, self.done = self.done, self.done + len(readings)
        with np.errstate(all="ignore"):  # an exploded state is found below
            for i, observer in enumerate(self._observers):
                self._values[begin : self.done, :, i] = observer(readings)[..., 0]
        self._commands[begin : self.done] = commands
        self._find_bad_numbers(begin, readings, commands, qpos)

        def track(first: int) -> Track:
            return self._track(slice(None), first, self.done)

        if self._judge.valid is not None:
            value = self._judge.valid.since(track, begin, self._firsts_of_valid)
            text = f"'{self._judge.valid.text}' does not hold"
            self._find(begin, np.equal(value, 0.0)[..., np.newaxis], lambda _: text)
        if self._judge.until is not None:
            holds = holds_where(self._judge.until.since(track, begin, self._firsts))
            newly = holds.any(axis=0) & ~self.ended
            self.end_tick[newly] = begin + holds[:, newly].argmax(axis=0)
        if (self._fault_tick < self.done).any():
            newly |= self._end_the_invalid(newly)
        self.seen_tick[newly] = self.done - 1
        self.ended |= newly
        return newly

    def _find_bad_numbers(self, begin: int, readings: Array, commands: Array, qpos: Array) -> None:
        """Find who has numbers that are not finite."""
        model, names = self._robot.model, list(self._command_place)
        kinds: tuple[tuple[Array, Callable[[int], str]], ...] = (
            (qpos, lambda column: bad_position(model, column)),
            (readings, lambda column: bad_reading(model, sensor_at(model, column))),
            (commands, lambda column: f"the command '{names[column]}' is not finite"),
        )
        for values, words in kinds:
            finite = np.isfinite(values)
            if not finite.all():
                self._find(begin, ~finite, words)

    def _find(self, begin: int, bad: NDArray[np.bool_], why: Callable[[int], str]) -> None:
        """Invalidate who is bad, from the first tick on in which a column is; shape (n, B, columns)."""
        for robot in np.flatnonzero(bad.any(axis=(0, 2))).tolist():
            tick = int(bad[:, robot].any(axis=1).argmax())
            self.invalidate({robot: why(int(bad[tick, robot].argmax()))}, begin + tick)

    def _end_the_invalid(self, ending: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """End the runs that have become invalid before they end otherwise, or in the same tick.

        Args:
            ending: Who has just been ended by `until`; shape (B,).

        Returns:
            Whose runs are ended so; shape (B,).
        """
        before = np.where(ending, self.end_tick, self.done - 1)
        found: NDArray[np.bool_] = (self._fault_tick <= before) & ~self.ended
        self.end_tick[found] = self._fault_tick[found]
        for robot in np.flatnonzero(found).tolist():
            time_s = (int(self.end_tick[robot]) + 1) * self._step_s
            self.invalid[robot] = f"at {time_s:.3f} s: {self._faults[robot]}"
        return found

    def track(self, robot: int) -> Track:
        """One robot's run up to its end."""
        last = int(self.end_tick[robot]) + 1 if self.ended[robot] else self.done
        return self._track(robot, 0, last)

    def measures(self) -> tuple[Mapping[str, Value], ...]:
        """The measures of every robot; none has a value where the run is invalid."""
        nothing: dict[str, Value] = dict.fromkeys(self._judge.units)
        return tuple(
            self._judge(self.track(i)) if why is None else nothing for i, why in enumerate(self.invalid)
        )

    def effort(self) -> tuple[dict[str, float | None], ...]:
        """Root mean square of every command up to the end, without the tick in which it ended; SI units.

        None where the run is invalid.
        """
        found: list[dict[str, float | None]] = []
        for i in range(len(self.ended)):
            if self.invalid[i] is not None:
                found.append(dict.fromkeys(self._command_place))
                continue
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
