"""What is run next: a plain grid, or bisection for a boundary; one decides for each cell by itself.

Each is a generator: it yields the runs that it wants, gets for which of them the condition held, and ends
when it knows enough. What it wants depends on nothing else, so the same runs are made whatever the workers
do first.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

# A run of a cell: number of the searched value on its grid (0 without search), and the seed.
Request: TypeAlias = tuple[int, int]
Strategy: TypeAlias = Generator[list[Request], Mapping[Request, bool], None]

FIRST_SEEDS = 4  # so many seeds are run first; the others only where these leave a hope


def grid_runs(seeds: Sequence[int]) -> Strategy:
    """All seeds of a cell without search."""
    yield [(0, seed) for seed in seeds]


@dataclass(frozen=True)
class Boundary:
    """A search for the largest value for which the condition holds.

    Attributes:
        count: Values 0 to count - 1 are on the grid.
        seeds: Those that are run.
        survive: Share of them for which it must hold.
        check_below: How many values below the boundary must hold as well.
    """

    count: int
    seeds: Sequence[int]
    survive: float
    check_below: int

    @property
    def may_fail(self) -> int:
        """For how many seeds it may fail."""
        return allowed_failures(len(self.seeds), self.survive)

    def runs(self) -> Strategy:
        """Ask for runs until the boundary is known.

        Between a value that holds and one that does not, the middle is tried. Where they are neighbours, the
        values just below are tried too; if one of them does not hold, the search goes on below it.
        """
        holds: dict[int, bool] = {}
        while True:
            low, high = boundary(holds, self.count)
            if high - low > 1:
                wanted = [(low + high) // 2]
            else:
                below = range(low - 1, max(low - 1 - self.check_below, -1), -1)
                wanted = [index for index in below if index not in holds]
                if not wanted:
                    return
            holds |= yield from self._probe(wanted)

    def _probe(
        self, values: Sequence[int]
    ) -> Generator[list[Request], Mapping[Request, bool], dict[int, bool]]:
        """Whether values hold; some seeds of each first, the rest where it still may."""
        first, rest = self.seeds[:FIRST_SEEDS], self.seeds[FIRST_SEEDS:]
        held = dict((yield [(value, seed) for value in values for seed in first]))
        going = [value for value in values if self._failures(held, value) <= self.may_fail]
        if going and rest:
            held |= yield [(value, seed) for value in going for seed in rest]
        return {value: self._failures(held, value) <= self.may_fail for value in values}

    @staticmethod
    def _failures(held: Mapping[Request, bool], value: int) -> int:
        return sum(not up for (index, _), up in held.items() if index == value)

    def about(self) -> float:
        """How many runs a search takes, about: half of the values that are tried do not hold."""
        tries = math.log2(self.count + 1)
        few = min(FIRST_SEEDS, len(self.seeds))
        return tries * (few + len(self.seeds)) / 2 + min(self.check_below, self.count) / 2 * len(self.seeds)

    def most(self) -> int:
        """How many runs a search can take at most."""
        return self.count * len(self.seeds)


@dataclass(frozen=True)
class EachBoundary:
    """A search for the largest value for which it holds with each seed, in the same rounds for all.

    Attributes:
        count: Values 0 to count - 1 are on the grid.
        seeds: Those that are run.
    """

    count: int
    seeds: Sequence[int]

    def runs(self) -> Strategy:
        """Ask for runs until the boundary of every seed is known, each by bisection."""
        holds: dict[int, dict[int, bool]] = {seed: {} for seed in self.seeds}
        while wanted := list(self._middles(holds)):
            for (index, seed), up in (yield wanted).items():
                holds[seed][index] = up

    def _middles(self, holds: Mapping[int, Mapping[int, bool]]) -> Iterator[Request]:
        for seed, known in holds.items():
            low, high = boundary(known, self.count)
            if high - low > 1:
                yield (low + high) // 2, seed

    def about(self) -> float:
        """How many runs a search takes, about."""
        return math.log2(self.count + 1) * len(self.seeds)

    def most(self) -> int:
        """How many runs a search can take at most."""
        return math.ceil(math.log2(self.count + 1)) * len(self.seeds)


def allowed_failures(seeds: int, survive: float) -> int:
    """For how many of the seeds it may fail where it must hold for a share."""
    return seeds - math.ceil(survive * seeds - 1e-9)


def boundary(holds: Mapping[int, bool], count: int) -> tuple[int, int]:
    """The largest value that holds below the smallest that does not, and that one; -1 and `count` if none."""
    high = min((index for index, held in holds.items() if not held), default=count)
    low = max((index for index, held in holds.items() if held and index < high), default=-1)
    return low, high
