"""What is run next: a plain grid, or bisection for a boundary; one decides for each cell by itself.

Each is a generator: it yields the runs that it wants, gets for which of them the condition held, and ends
when it knows enough. What it wants depends on nothing else, so the same runs are made whatever the workers
do first. Of a run that is invalid, or whose condition has no value, nobody knows whether it held: None.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

# A run of a cell: number of the searched value on its grid (0 without search), and the seed.
Request: TypeAlias = tuple[int, int]
Answers: TypeAlias = Mapping[Request, bool | None]
Strategy: TypeAlias = Generator[list[Request], Answers, None]
Verdict: TypeAlias = Literal["holds", "fails", "unknown", "open"]

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

    def runs(self) -> Strategy:
        """Ask for runs until the boundary is known.

        Between a value that holds and one that does not, the middle is tried. Where they are neighbours, the
        values just below are tried too; if one of them does not hold, the search goes on below it.

        At last it looks for holes: where nothing was tried in an octave of distances from the boundary, a
        value of it is; below the boundary with some seeds only. If one below does not hold, the search goes
        on below it as well; those above change the boundary no more.
        """
        known: dict[Request, bool | None] = {}
        while True:
            verdicts = self._verdicts(known)
            low, high = boundary(verdicts, self.count)
            tried = {value for value, _ in known}
            below = range(low - 1, max(low - 1 - self.check_below, -1), -1)
            if high - low > 1:
                yield from self._try([(low + high) // 2], known)
            elif wanted := [index for index in below if verdicts.get(index, "open") == "open"]:
                yield from self._try(wanted, known)
            elif wanted := list(untried_octaves(tried, low, -1, self.count)):
                yield from self._ask(wanted, self.seeds[:FIRST_SEEDS], known)
            elif wanted := list(untried_octaves(tried, high, 1, self.count)):
                yield from self._try(wanted, known)
            else:
                return

    def _verdicts(self, known: Answers) -> dict[int, Verdict]:
        """What is known of the values that were tried."""
        found: dict[int, list[bool | None]] = {}
        for (value, _), held in known.items():
            found.setdefault(value, []).append(held)
        return {value: verdict(each, len(self.seeds), self.survive) for value, each in found.items()}

    def _try(self, values: Sequence[int], known: dict[Request, bool | None]) -> Strategy:
        """Find out whether values hold: by some seeds of each first, the rest where it still may."""
        yield from self._ask(values, self.seeds[:FIRST_SEEDS], known)
        verdicts = self._verdicts(known)
        going = [value for value in values if verdicts[value] == "open"]
        yield from self._ask(going, self.seeds, known)

    @staticmethod
    def _ask(values: Sequence[int], seeds: Sequence[int], known: dict[Request, bool | None]) -> Strategy:
        """Have those runs made that are not known yet."""
        if wanted := [(value, seed) for value in values for seed in seeds if (value, seed) not in known]:
            known |= yield wanted

    def about(self) -> float:
        """How many runs a search takes, about: half of the values that are tried do not hold."""
        tries = math.log2(self.count + 1)
        few = min(FIRST_SEEDS, len(self.seeds))
        near = min(self.check_below, self.count) / 2 * len(self.seeds)
        holes = tries * few  # about half of the octaves above and below
        return tries * (few + len(self.seeds)) / 2 + near + holes

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
        """Ask for runs until the boundary of every seed is known, each by bisection.

        Then holes are looked for as by `Boundary`, but above the boundary only.
        """
        known: dict[int, dict[int, bool | None]] = {seed: {} for seed in self.seeds}
        while wanted := list(self._middles(known)) or list(self._above(known)):
            for (index, seed), held in (yield wanted).items():
                known[seed][index] = held

    def _middles(self, known: Mapping[int, Mapping[int, bool | None]]) -> Iterator[Request]:
        for seed, held in known.items():
            low, high = boundary(verdicts_of_one(held), self.count)
            if high - low > 1:
                yield (low + high) // 2, seed

    def _above(self, known: Mapping[int, Mapping[int, bool | None]]) -> Iterator[Request]:
        for seed, held in known.items():
            _, high = boundary(verdicts_of_one(held), self.count)
            for index in untried_octaves(held, high, 1, self.count):
                yield index, seed

    def about(self) -> float:
        """How many runs a search takes, about: half of the octaves above are looked into."""
        return 1.5 * math.log2(self.count + 1) * len(self.seeds)

    def most(self) -> int:
        """How many runs a search can take at most."""
        return 2 * math.ceil(math.log2(self.count + 1)) * len(self.seeds)


def verdict(found: Sequence[bool | None], seeds: int, survive: float = 1.0) -> Verdict:
    """Whether it holds for a value, by the runs that were made of it.

    It is unknown where too many runs tell nothing for it to hold, and too few fail for it not to; and open
    where seeds are missing.

    Args:
        found: Whether it held in each run; None where nobody knows.
        seeds: How many runs a value has when all are made.
        survive: Share of them in which it must hold.
    """
    may_fail = seeds - math.ceil(survive * seeds - 1e-9)
    if found.count(False) > may_fail:
        return "fails"
    if len(found) - found.count(True) > may_fail:
        return "unknown"
    return "holds" if len(found) >= seeds else "open"


def verdicts_of_one(held: Mapping[int, bool | None]) -> dict[int, Verdict]:
    """What one seed tells of the values that were tried with it."""
    return {index: verdict([each], 1) for index, each in held.items()}


def boundary(verdicts: Mapping[int, Verdict], count: int) -> tuple[int, int]:
    """The largest value that holds below all that do not, and the smallest of these; -1 and `count` if none.

    A value of which it is unknown is none that holds.
    """
    high = min((index for index, each in verdicts.items() if each in {"fails", "unknown"}), default=count)
    low = max((index for index, each in verdicts.items() if each == "holds" and index < high), default=-1)
    return low, high


def untried_octaves(tried: Collection[int], start: int, side: int, count: int) -> Iterator[int]:
    """A value of each octave of distances from `start` in which none was tried: 1, 2 to 3, 4 to 7, and so on.

    Args:
        tried: Numbers of the values that were.
        start: Where distances begin.
        side: 1 for the values above, -1 for those below.
        count: How many values the grid has.
    """
    nearest = 1
    while 0 <= start + side * nearest < count:
        if not any(nearest <= side * (index - start) < 2 * nearest for index in tried):
            yield start + side * nearest
        nearest *= 2
