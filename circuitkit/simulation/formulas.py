"""Measures that are expressions over channels and time.

A formula is an expression of reductions (see `reductions`), channels and time.

What has no value is not a number: a channel outside the window of `after` or `between`, or a reduction to
which nothing has come yet. A comparison with it is not known either, and is not a number as well; `not`,
`and` and `or` carry that on, unless the other side settles the matter: `a or b` holds where `b` does. What is
not known does not hold (`holds_where`), and reductions leave it out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Unit
from circuitkit.circuit.expressions.expression import (
    COMPARISONS,
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.expressions.symbolic import constant
from circuitkit.control import Array
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.robots.spec import ENDED, TIME
from circuitkit.simulation.reductions import REDUCTIONS, Reduction, holds_where

_DIGITS = 12  # of a time in seconds


def _compared(comparison: np.ufunc, left: Any, right: Any) -> Array:  # noqa: ANN401 - numbers or arrays
    """A comparison: 1 or 0, and not a number where a side has no value."""
    unknown = np.isnan(left) | np.isnan(right)
    return np.where(unknown, np.nan, comparison(left, right))


def _chosen(condition: Any, then: Any, otherwise: Any) -> Array:  # noqa: ANN401 - as above
    """Choose `then` where a condition holds; where it is not known, only what is the same in any case is."""
    either = np.where(np.equal(then, otherwise), then, np.nan)
    return np.where(np.isnan(condition), either, np.where(condition, then, otherwise))


_COMPARISONS: Mapping[str, np.ufunc] = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
}


_OF_NUMBERS: Mapping[str, Callable[..., Any]] = {
    **NUMPY_FUNCTIONS,
    **{name: partial(_compared, each) for name, each in _COMPARISONS.items()},
    "where": _chosen,
}

Value: TypeAlias = "float | bool | None"

WINDOWS = ("after", "between")


@dataclass(frozen=True, eq=False)
class Track:
    """A run as measures see it; T ticks, the last one being that in which it ended.

    Attributes:
        step_s: The control step.
        first: Number of its first tick.
        shape: Of a channel: (T,) for one robot, or (T, B).
        ended: Whether the scenario's `until` ended it.
        values: Gives a channel by name.
        bounds: For `outside`: lower and upper bound of a channel, arrays or plain numbers; None without.
        push_s: When its first push began; not a number without one.
        pace_s: Time after which the reference repeats itself; 0 if it does not.
    """

    step_s: float
    first: int
    shape: tuple[int, ...]
    ended: bool
    values: Callable[[str], Array]
    bounds: Callable[[str], tuple[Any, Any] | None]
    push_s: float
    pace_s: float

    @property
    def ticks(self) -> int:
        """T."""
        return self.shape[0]

    @property
    def before_end(self) -> int:
        """How many ticks there are before the one in which it ended."""
        return self.ticks - 1 if self.ended else self.ticks


@dataclass(frozen=True, eq=False)
class Formula:
    """An expression that measures.

    Attributes:
        text: As written.
        tree: The expression.
        unit: Of its value, SI.
        is_condition: Whether its value is true or false.
        channels: The channels that it needs.
        references: Parts of the MJCF that it names itself, such as `position(ball, x)`; channels too.
    """

    text: str
    tree: Expression
    unit: Unit
    is_condition: bool
    channels: tuple[str, ...]
    references: tuple[Call, ...]

    def series(self, track: Track, firsts: list[Array] | None = None) -> Array:
        """Its value at every tick, from the ticks so far.

        Args:
            track: The run, or a part of it.
            firsts: The first values, where the track is a later part; takes them, where it is the first one.
        """
        tree, names, called, bounded = self._spelled
        functions = dict(_OF_NUMBERS)
        functions |= {name: partial(_reduced, REDUCTIONS[name], track) for name in called & REDUCTIONS.keys()}
        functions |= {name: partial(_either, name, track) for name in called & {"max", "min"}}
        if firsts is not None:
            functions["first"] = _First(track, firsts)
        values: dict[str, Any] = {name: track.values(name) for name in self.channels}
        if TIME in names or called & set(WINDOWS):
            time = _times(track.first, track.ticks, track.step_s)
            time = values[TIME] = time.reshape(-1, *(1,) * (len(track.shape) - 1))
            functions |= dict.fromkeys(WINDOWS, lambda x, *ends: np.where(_within(time, *ends), x, np.nan))
        if ENDED in names:
            flag = np.zeros(track.ticks)
            flag[-1:] = track.ended
            values[ENDED] = flag.reshape(-1, *(1,) * (len(track.shape) - 1))
        for name in bounded:
            low, high = track.bounds(name) or (-np.inf, np.inf)
            values |= {f"{name} low": low, f"{name} high": high}
        with np.errstate(all="ignore"):
            found = tree.evaluate(values, functions)
        return np.broadcast_to(np.asarray(found, dtype=np.float64), track.shape)

    def since(self, track: Callable[[int], Track], begin: int, firsts: list[Array]) -> Array:
        """Its value in the ticks from `begin` on; shape (n, B).

        Args:
            track: The run of all robots from a tick on.
            begin: The first tick that is asked for.
            firsts: What is remembered from one call to the next.
        """
        return self.series(track(0))[begin:] if self.looks_back else self.series(track(begin), firsts)

    def window_that_never_comes(self, ticks: int, step_s: float) -> Call | None:
        """The first window of plain times in which a run has no tick, as nothing is ever known of it."""
        time = _times(0, ticks, step_s)
        for each in _windows_in(self.tree):
            ends = [constant(end) for end in each.arguments[1:]]
            if None not in ends and not _within(time, *ends).any():
                return each
        return None

    def true_below(self, channel: str) -> float | None:
        """Below which value a channel makes the condition true, whatever all else is; None if it never does.

        It is read off comparisons with numbers that stand alone or are joined by `or`.
        """
        return max(_bounds_below(self.tree, channel), default=None)

    @cached_property
    def _spelled(self) -> tuple[Expression, frozenset[str], frozenset[str], tuple[str, ...]]:
        """The expression as it is evaluated, its names, its functions, and the channels that it bounds."""
        bounded: list[str] = []
        tree = _spelled_out(self.tree, bounded)
        return tree, frozenset(self.tree.names()), frozenset(_called_in(tree)), tuple(bounded)

    @cached_property
    def looks_back(self) -> bool:
        """Whether it needs more of the past than first values."""
        return any(name != "first" for name in _reductions_in(self.tree))

    def value(self, track: Track) -> Value:
        """Its value at the end; None if it has none, such as the time of what never was.

        A condition has none where it compares what has none, such as a window that never came.
        """
        if track.ticks == 0:
            return None
        last = self.series(track)[-1:]
        if self.is_condition:
            return None if np.isnan(last[0]) else bool(holds_where(last)[0])
        return float(last[0]) if math.isfinite(last[0]) else None


def _reduced(reduction: Reduction, track: Track, x: Any) -> Array:  # noqa: ANN401 - a number or an array
    return reduction.so_far(np.broadcast_to(np.asarray(x, dtype=np.float64), track.shape), track.step_s)


class _First:
    """`first(x)` of a run that comes in parts: remembers the first values, in the order of the calls.

    Who has had no value yet, such as before a window begins, waits for one in the parts to come.
    """

    def __init__(self, track: Track, firsts: list[Array]) -> None:
        self._track, self._firsts, self._calls = track, firsts, 0

    def __call__(self, x: Any) -> Array:  # noqa: ANN401 - a number or an array
        spread = np.broadcast_to(np.asarray(x, dtype=np.float64), self._track.shape)
        if self._calls == len(self._firsts):
            self._firsts.append(np.full(self._track.shape[1:], np.nan))
        before = self._firsts[self._calls]
        first = np.where(np.isnan(before), REDUCTIONS["first"].so_far(spread, self._track.step_s), before)
        if len(first):
            self._firsts[self._calls] = first[-1]
        self._calls += 1
        return first


def _times(first: int, ticks: int, step_s: float) -> Array:
    """The ends of ticks from `first` on; rounded, so that the tick that ends at 0.41 s is not after it."""
    return np.round((first + np.arange(1, ticks + 1)) * step_s, _DIGITS)


def _within(time: Array, start: Any, end: Any = np.inf) -> NDArray[np.bool_]:  # noqa: ANN401 - numbers or arrays
    """Which ends of ticks lie in the window of `after` or `between`."""
    return np.asarray((time > start) & (time <= end))


def _windows_in(tree: Expression) -> Iterator[Call]:
    if isinstance(tree, Call) and tree.function in WINDOWS:
        yield tree
    for each in tree.operands():
        yield from _windows_in(each)


def _bounds_below(tree: Expression, channel: str) -> Iterator[float]:
    match tree:
        case Call(function="where", arguments=(first, Number(value=1.0), other)):  # first or other
            yield from _bounds_below(first, channel)
            yield from _bounds_below(other, channel)
        case Binary(operator="<" | "<=", left=Name(name=name), right=Number(value=bound)) if name == channel:
            yield bound
        case Binary(operator=">" | ">=", left=Number(value=bound), right=Name(name=name)) if name == channel:
            yield bound


def _reductions_in(tree: Expression) -> Iterator[str]:
    match tree:
        case Call(function=function, arguments=arguments):
            if function in REDUCTIONS and (function not in {"max", "min"} or len(arguments) == 1):
                yield function
            for each in arguments:
                yield from _reductions_in(each)
        case _:
            for each in tree.operands():
                yield from _reductions_in(each)


def _either(name: str, track: Track, *arguments: Any) -> Any:  # noqa: ANN401 - numbers or arrays
    """Max and min: over time of one argument, of the larger or smaller of two."""
    if len(arguments) == 1:
        return _reduced(REDUCTIONS[name], track, arguments[0])
    return NUMPY_FUNCTIONS[name](*arguments)


def _called_in(tree: Expression) -> Iterator[str]:
    if isinstance(tree, Call):
        yield tree.function
    for each in tree.operands():
        yield from _called_in(each)


def _spelled_out(tree: Expression, bounded: list[str]) -> Expression:
    """Replace `outside(x, low, high)` by max(max(low - x, x - high), 0), and comparisons by calls.

    Where it has no bounds they are those of the channel, which `bounded` takes; they are called by its name
    and `low` or `high`. As calls, comparisons are those of the functions that a tree is evaluated with, which
    know what has no value.
    """
    match tree:
        case Binary(operator=joint, left=left, right=right) if joint in COMPARISONS:
            sides = tuple(_spelled_out(each, bounded) for each in (left, right))
            return Call(joint, sides, offset=tree.offset)
        case Call(function="outside", arguments=(x, low, high)):
            x, low, high = (_spelled_out(each, bounded) for each in (x, low, high))
            beyond = Call("max", (Binary("-", low, x), Binary("-", x, high)))
            return Call("max", (beyond, Number(0.0)))
        case Call(function="outside", arguments=(Name(name=name) as x,)):
            bounded.append(name)
            beyond = Call("max", (Binary("-", Name(f"{name} low"), x), Binary("-", x, Name(f"{name} high"))))
            return Call("max", (beyond, Number(0.0)))
    return mapped(tree, lambda each: _spelled_out(each, bounded))


def mapped(tree: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """The same expression with its operands changed."""
    match tree:
        case Call(arguments=arguments):
            return replace(tree, arguments=tuple(change(each) for each in arguments))
        case Binary(left=left, right=right):
            return replace(tree, left=change(left), right=change(right))
        case Unary(operand=operand):
            return replace(tree, operand=change(operand))
    return tree
