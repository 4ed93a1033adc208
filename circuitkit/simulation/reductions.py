"""What makes one number of a channel over time: the largest value, how long a condition held, and others.

What has no value is not a number; reductions leave it out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.units import Dimension
from circuitkit.circuit.expressions.dimensions import NO_DIMENSION, OpenDimension
from circuitkit.control import Array

Series: TypeAlias = Callable[[Array, float], Array]

SECOND, PLAIN = OpenDimension(Dimension(time=1)), NO_DIMENSION


@dataclass(frozen=True)
class Reduction:
    """A function that makes one number of a channel over time.

    Attributes:
        so_far: Its value at every tick, from the values up to then and dt; (T,) to (T,).
        dimension: Of the result, from that of the argument.
        description: What it gives.
    """

    so_far: Series
    dimension: Callable[[OpenDimension | None], OpenDimension | None]
    description: str


def _same(dimension: OpenDimension | None) -> OpenDimension | None:
    return dimension


def _mean_so_far(x: Array, _: float) -> Array:
    return np.asarray(np.cumsum(_or_zero(x), axis=0) / np.cumsum(~np.isnan(x), axis=0), dtype=np.float64)


def _or_zero(x: Array) -> Array:
    """What is left out as zero, for sums."""
    return np.where(np.isnan(x), 0.0, x)


def holds_where(x: Array) -> NDArray[np.bool_]:
    """Where a condition holds: what has no value, which is not a number, does not."""
    holds: NDArray[np.bool_] = (x != 0) & ~np.isnan(x)
    return holds


def _total_so_far(x: Array, dt: float) -> Array:
    total: Array = np.asarray(np.cumsum(_or_zero(x), axis=0) * dt, dtype=np.float64)
    return total


def _held_so_far(x: Array, dt: float) -> Array:
    held: Array = np.asarray(np.cumsum(holds_where(x), axis=0) * dt, dtype=np.float64)
    return held


def _last_so_far(x: Array, _: float) -> Array:
    """The last value that is a number."""
    rows = np.arange(len(x)).reshape(-1, *(1,) * (x.ndim - 1))
    latest = np.maximum.accumulate(np.where(np.isnan(x), 0, rows), axis=0)
    return np.take_along_axis(x, np.broadcast_to(latest, x.shape), axis=0)


def _first_so_far(x: Array, _: float) -> Array:
    """The first value that is a number."""
    if not len(x):
        return x
    first = np.argmax(~np.isnan(x), axis=0)
    value = np.take_along_axis(x, np.expand_dims(first, 0), axis=0)
    return np.where(np.arange(len(x)).reshape(-1, *(1,) * (x.ndim - 1)) >= first, value, np.nan)


def _first_time(x: Array, dt: float) -> Array:
    seen = np.maximum.accumulate(holds_where(x), axis=0)
    first = np.argmax(holds_where(x), axis=0) if len(x) else 0
    time: Array = np.where(seen, (first + 1) * dt, np.nan)
    return time


def _begun(x: Array) -> Array:
    holds = holds_where(x).astype(np.float64)
    return np.maximum(np.diff(holds, prepend=0.0, axis=0), 0.0)


REDUCTIONS: Mapping[str, Reduction] = {
    "max": Reduction(lambda x, _: np.fmax.accumulate(x, axis=0), _same, "the largest value"),
    "min": Reduction(lambda x, _: np.fmin.accumulate(x, axis=0), _same, "the smallest value"),
    "mean": Reduction(_mean_so_far, _same, "the mean"),
    "rms": Reduction(lambda x, dt: np.sqrt(_mean_so_far(np.square(x), dt)), _same, "the root mean square"),
    "total": Reduction(_total_so_far, lambda d: d and d.times(SECOND), "the integral over time"),
    "first": Reduction(_first_so_far, _same, "the first value"),
    "last": Reduction(_last_so_far, _same, "the last value"),
    "duration": Reduction(_held_so_far, lambda _: SECOND, "how long a condition held"),
    "count": Reduction(
        lambda x, _: np.cumsum(_begun(x), axis=0), lambda _: PLAIN, "how often a condition began to hold"
    ),
    "time_of": Reduction(_first_time, lambda _: SECOND, "when a condition held first"),
}
CONDITIONAL = frozenset({"duration", "count", "time_of"})
