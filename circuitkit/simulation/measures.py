"""Measures: what is told of a run, what ends it, and the kinds that plug-ins bring."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from circuitkit.base.errors import ExpressionError, InputError, Problem
from circuitkit.base.registry import Registry
from circuitkit.base.source import FileModel
from circuitkit.base.units import Unit
from circuitkit.control import Array
from circuitkit.simulation.formulas import Formula, Track, Value


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
