"""Takes ratios of what two survive, with an interval by a bootstrap over seeds, which both share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from circuitkit.study import Limit

Array = NDArray[np.float64]

_RESAMPLES = 4000
_ENDS = (2.5, 97.5)  # of a 95 % interval, in percent


@dataclass(frozen=True)
class Ratio:
    """A ratio of mean forces.

    Attributes:
        value: Mean of one over mean of the other; not a number if the other is 0.
        low: Lower end of its 95 % interval.
        high: Upper end.
        mine: Mean force above, [N].
        theirs: Mean force below, [N].
    """

    value: float
    low: float
    high: float
    mine: float
    theirs: float


def paired_ratio(mine: Array, theirs: Array) -> Ratio:
    """Take the ratio of the means of two sets of forces, with its bootstrap interval.

    The seeds are drawn again with replacement, some thousand times; with each goes what both survived under
    it, in all kinds of pushes, since the same seed means the same noise and the same moment for both. The
    interval holds the middle 95 % of the ratios. It says what other seeds might have given, not what the
    grid of forces hides.

    Args:
        mine: Largest survived forces; shape (kinds of pushes, seeds), [N].
        theirs: The same of what they are compared with.
    """
    ours, others = mine.mean(axis=0), theirs.mean(axis=0)
    rng = np.random.default_rng(0)  # the same draws in every report
    drawn = rng.integers(0, len(ours), (_RESAMPLES, len(ours)))
    above, below = ours[drawn].mean(axis=1), others[drawn].mean(axis=1)
    ratios = np.divide(above, below, out=np.full(len(above), np.inf), where=below > 0)
    low, high = np.percentile(ratios, _ENDS) if np.isfinite(ratios).all() else (math.nan, math.nan)
    value = float(ours.mean() / others.mean()) if others.mean() > 0 else math.nan
    return Ratio(value, float(low), float(high), float(ours.mean()), float(others.mean()))


def forces_by(limits: Sequence[Limit], *axes: str) -> Mapping[tuple[str, ...], Array]:
    """Group what each seed survived by the values of some axes.

    Args:
        limits: Of a study that searches the limit of each seed.
        axes: The axes to keep apart; what varies along the others are kinds of pushes.

    Returns:
        Arrays of shape (kinds of pushes, seeds), [N].
    """
    found: dict[tuple[str, ...], list[Sequence[float]]] = {}
    for limit in limits:
        found.setdefault(tuple(str(limit.labels[axis]) for axis in axes), []).append(limit.each)
    return {key: np.array(rows) for key, rows in found.items()}
