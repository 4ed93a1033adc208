"""Channels: what can be read of a robot, computed from MuJoCo's `sensordata` for all robots at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.units import Unit
from circuitkit.circuit.expressions.expression import Expression, Name
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS, Operation, bind_expression

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Formula:
    """An expression of columns of `sensordata`.

    Attributes:
        expression: The tree; its names are keys of `columns`.
        columns: Column of `sensordata` by name.
    """

    expression: Expression
    columns: Mapping[str, int]

    @property
    def used(self) -> frozenset[int]:
        """The columns that it depends on."""
        return frozenset(self.columns[name] for name in self.expression.names())

    @property
    def bare(self) -> int | None:
        """The column that it is, if it is nothing more than one."""
        return self.columns[self.expression.name] if isinstance(self.expression, Name) else None


@dataclass(frozen=True, eq=False)
class Quotient:
    """A quotient of two linear forms of `sensordata`: (a . s) / max(b . s, least), or a . s without b.

    Attributes:
        numerator: The weights a; shape (s,).
        denominator: The weights b; shape (s,); all zero for a plain linear form.
        least: The smallest divisor, [unit of b . s].
    """

    numerator: Array
    denominator: Array
    least: float = 1.0

    @property
    def used(self) -> frozenset[int]:
        """The columns that it depends on."""
        return frozenset(np.flatnonzero((self.numerator != 0) | (self.denominator != 0)).tolist())

    @property
    def bare(self) -> int | None:
        """The column that it is, if it is nothing more than one."""
        used = np.flatnonzero(self.numerator)
        plain = len(used) == 1 and self.numerator[used[0]] == 1.0 and not self.denominator.any()
        return int(used[0]) if plain else None


@dataclass(frozen=True)
class Channel:
    """Something of a robot that can be read.

    Attributes:
        name: Name.
        unit: The unit in which it is shown; values are in SI units.
        value: How it is computed from `sensordata`.
        description: What it is.
        range: What it can show, [SI]; None without bounds.
        of_sensor: Whether that is the range of its sensor, so that whatever is computed from it is bound.
    """

    name: str
    unit: Unit
    value: Formula | Quotient
    description: str = ""
    range: tuple[float, float] | None = None
    of_sensor: bool = False


class Observer:
    """Computes chosen channels from sensor readings, for all robots at once.

    Every robot's result is computed in the same order whatever the batch, so it is the same to the last bit.
    """

    def __init__(self, channels: Mapping[str, Channel], names: Sequence[str]) -> None:
        """Pick channels.

        Raises:
            UnknownNameError: There is no such channel; lists those there are.
        """
        for name in names:
            if name not in channels:
                kind = "channel"
                raise UnknownNameError(kind, name, channels)
        chosen = [channels[name] for name in names]
        self.names = tuple(names)
        self._count = len(chosen)
        self._quotients = _Quotients(
            [(i, c.value) for i, c in enumerate(chosen) if isinstance(c.value, Quotient)]
        )
        self._formulas = [(i, c.value) for i, c in enumerate(chosen) if isinstance(c.value, Formula)]

    def __call__(self, readings: Array) -> Array:
        """Channels, shape (..., k), of readings, shape (..., s); what is missing stays missing (nan)."""
        values = np.empty((*readings.shape[:-1], self._count))
        self._quotients.compute(readings, values)
        for place, formula in self._formulas:
            columns = {name: readings[..., column] for name, column in formula.columns.items()}
            with np.errstate(all="ignore"):
                values[..., place] = formula.expression.evaluate(columns, NUMPY_FUNCTIONS)
        return values

    def bound(self, readings: Array) -> Callable[[Array], object]:
        """The same for one array of readings that changes in place, without making arrays on the way.

        Args:
            readings: Shape (B, s).

        Returns:
            What writes the channels into an array of shape (B, k).
        """
        quotients = self._quotients.bound(readings)
        if not self._formulas:
            return quotients
        values = np.empty((len(readings), self._count))
        operations, copies = self._operations(readings, values)

        def observe(target: Array) -> None:
            if not self._quotients.empty:
                quotients(values)
            for source, target_column in copies:
                target_column[...] = source
            for operation in operations:
                operation()
            target[...] = values

        return observe

    def _operations(
        self, readings: Array, values: Array
    ) -> tuple[list[Operation], list[tuple[Array, Array]]]:
        """What writes the formulas into the columns of `values`: operations, and plain copies of columns."""
        operations: list[Operation] = []
        copies: list[tuple[Array, Array]] = []
        for place, formula in self._formulas:
            target = values[:, place]
            if formula.bare is not None:
                copies.append((readings[:, formula.bare], target))
            else:
                variables = {name: readings[:, column] for name, column in formula.columns.items()}
                operations += bind_expression(formula.expression, {}, variables, target)
        return operations, copies

    def where_some_are_missing(self, readings: Array) -> Array:
        """The same for readings that may be missing (not a number), to the same bits where none is.

        Zero times not-a-number is no zero: here a channel misses only the readings that it uses.
        """
        values = self(readings)
        self._quotients.compute_missing(readings, values)
        for place, formula in self._formulas:  # comparisons make a number of one that is missing
            values[np.isnan(readings[..., sorted(formula.used)]).any(axis=-1), place] = np.nan
        return values


class _Quotients:
    """All quotients together, by one product of matrix and vector a robot."""

    def __init__(self, chosen: list[tuple[int, Quotient]]) -> None:
        self.empty = not chosen
        self._places = np.array([place for place, _ in chosen], dtype=np.intp)
        self._all = len(chosen) > 0 and self._places.tolist() == list(range(len(chosen)))
        quotients = [quotient for _, quotient in chosen]
        rows = np.array([q.numerator for q in quotients] + [q.denominator for q in quotients])
        used = np.flatnonzero(rows.any(axis=0)) if len(rows) else np.zeros(0, dtype=np.intp)
        self._columns = slice(int(used[0]), int(used[-1]) + 1) if len(used) else slice(0, 0)
        self._weights = np.ascontiguousarray(rows[:, self._columns]) if len(rows) else np.zeros((0, 0))
        self._count = len(quotients)
        # A plain linear form is divided by one: its divisor is 0, and one takes its place.
        self._least = np.array([q.least if q.denominator.any() else 1.0 for q in quotients])

    def compute(self, readings: Array, values: Array) -> None:
        if not self.empty:
            sums = np.vecdot(readings[..., None, self._columns], self._weights)
            values[..., self._places] = self._divided(sums)

    def compute_missing(self, readings: Array, values: Array) -> None:
        if not self.empty:
            there = np.where(self._weights != 0, readings[..., None, self._columns], 0.0)
            values[..., self._places] = self._divided(np.vecdot(there, self._weights))

    def bound(self, readings: Array) -> Callable[[Array], object]:
        view, weights, least = readings[:, None, self._columns], self._weights, self._least
        sums = np.empty((len(readings), len(weights)))
        above, below = sums[:, : self._count], sums[:, self._count :]
        places, every = self._places, self._all

        def observe(values: Array) -> None:
            np.vecdot(view, weights, sums)
            np.maximum(below, least, out=below)
            if every and values.shape[1] == len(places):
                np.divide(above, below, values)
            else:
                values[:, places] = above / below

        return observe

    def _divided(self, sums: Array) -> Array:
        values: Array = sums[..., : self._count] / np.maximum(sums[..., self._count :], self._least)
        return values
