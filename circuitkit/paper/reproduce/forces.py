"""Compares largest survived forces: ratios as the paper takes them, parts of the bound, ratios over seeds.

Forces that all seeds survived are compared push by push (`Forces`); those of each seed by the ratio of their
means, with an interval by a bootstrap over the seeds, which both share (`paired_ratio`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from circuitkit.paper.push_bounds import PushKind, dcm_bounds_around
from circuitkit.paper.reproduce.figure import Job
from circuitkit.paper.runs import plan_of, push_moment
from circuitkit.simulation import Plan
from circuitkit.simulation.disturbances.push import direction_of
from circuitkit.study import Limit, Study

Array = NDArray[np.float64]

DIRECTION, DURATION = "push.direction", "push.duration"
_RESAMPLES = 4000
_ENDS = (2.5, 97.5)  # of a 95 % interval, in percent


@dataclass(frozen=True)
class Forces:
    """Forces by push, [N].

    Attributes:
        survived: The largest that was survived, by contender.
        bound: What no control with the ankles can exceed whose torso does not turn, pushed where it is.
        point_mass: The same for a push at the height of the centre of mass.
        falls_unpushed: Contenders that did not survive the force 0 either, in some run.
        circuits: Name of the circuit of a contender that has one.
    """

    survived: Mapping[str, Mapping[PushKind, float]]
    bound: Mapping[PushKind, float]
    point_mass: Mapping[PushKind, float]
    falls_unpushed: frozenset[str] = frozenset()
    circuits: Mapping[str, str] = field(default_factory=dict)

    @property
    def kinds(self) -> tuple[PushKind, ...]:
        """All pushes."""
        return tuple(self.bound)

    def ratio(self, contender: str, baseline: str, kinds: Sequence[PushKind] | None = None) -> float:
        """Take the mean of force over force; pushes of which the baseline survives none are left out.

        Args:
            contender: Whose force is above.
            baseline: Whose is below.
            kinds: Only these pushes.

        Returns:
            Not a number if nothing is left.
        """
        mine, theirs = self.survived[contender], self.survived[baseline]
        return mean(mine[kind] / theirs[kind] for kind in kinds or self.kinds if theirs[kind] > 0)

    def of_bound(self, contender: str, kinds: Sequence[PushKind] | None = None) -> float:
        """Take the mean over pushes of the part of the bound that is reached."""
        mine = self.survived[contender]
        return mean(mine[kind] / self.bound[kind] for kind in kinds or self.kinds)

    def wins(self, contender: str, baseline: str) -> int:
        """Count the pushes in which it survives more."""
        mine, theirs = self.survived[contender], self.survived[baseline]
        return sum(mine[kind] > theirs[kind] for kind in self.kinds)

    def largest(self, contender: str) -> PushKind:
        """Find the push of which it survives most."""
        return max(self.kinds, key=lambda kind: self.survived[contender][kind])

    def shortest(self, direction: str) -> PushKind:
        """Find the shortest push of a direction."""
        return min(self.of_direction(direction), key=lambda kind: kind.duration_s)

    def of_direction(self, direction: str) -> tuple[PushKind, ...]:
        """List the pushes of a direction, the shortest first."""
        those = (kind for kind in self.kinds if kind.direction == direction)
        return tuple(sorted(those, key=lambda kind: kind.duration_s))


def measure(job: Job, study: Study) -> Forces:
    """Search the largest survived forces of all contenders of a study, with the bound on the same walk."""
    limits = job.sweep(study, apart="contender").limits()
    survived = by_contender(limits)
    kinds = tuple(next(iter(survived.values())))
    bound, point_mass = bounds(plan_of(study), kinds)
    return Forces(survived, bound, point_mass, fall_unpushed(limits), circuits_of(study))


def listed(forces: Mapping[str, Mapping[PushKind, float]]) -> list[dict[str, Any]]:
    """List forces as rows, for the data of a finding."""
    return [
        {"contender": name, "direction": kind.direction, "duration_s": kind.duration_s, "force_n": force}
        for name, by_kind in forces.items()
        for kind, force in by_kind.items()
    ]


def mean(values: Iterable[float]) -> float:
    """Take the mean; not a number of nothing."""
    every = tuple(values)
    return sum(every) / len(every) if every else math.nan


def by_contender(limits: Sequence[Limit], axis: str = "contender") -> dict[str, dict[PushKind, float]]:
    """Group the largest survived forces of a study by contender and push."""
    found: dict[str, dict[PushKind, float]] = {}
    for limit in limits:
        found.setdefault(str(limit.labels[axis]), {})[kind_of(limit)] = limit.largest
    return found


def bounds(plan: Plan, kinds: Iterable[PushKind]) -> tuple[dict[PushKind, float], dict[PushKind, float]]:
    """Work out the bound of the DCM for pushes to the side.

    Args:
        plan: Its first push says when, and where on the body.
        kinds: Directions inward and outward, and durations.

    Returns:
        For the push where it is, and for the same at the height of the centre of mass.
    """
    moment = push_moment(plan.scenario, plan.reference)
    upright, point_mass = {}, {}
    for kind in kinds:
        forward, left, _ = direction_of(kind.direction, moment)
        found = dcm_bounds_around(plan, np.array([math.atan2(left, forward)]), kind.duration_s)
        upright[kind], point_mass[kind] = float(found.upright_n[0]), float(found.point_mass_n[0])
    return upright, point_mass


def fall_unpushed(limits: Sequence[Limit], axis: str = "contender") -> frozenset[str]:
    """Find the contenders that fell with the force 0 in some run."""
    return frozenset(str(limit.labels[axis]) for limit in limits if limit.fails_at == 0)


def circuits_of(study: Study, axis: str = "contender") -> dict[str, str]:
    """Find which circuit each contender has."""
    return {
        value.text: str(value.settings["circuit"])
        for value in study.axes[axis]
        if "circuit" in value.settings
    }


def kind_of(limit: Limit) -> PushKind:
    """Find which push a cell of such a study is about."""
    return PushKind(str(limit.labels[DIRECTION]), float(str(limit.labels[DURATION])))


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
