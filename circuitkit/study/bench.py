"""Benchmarks as ratios: two pieces of work take turns in one process; what counts is how they compare.

A ratio measured in one run means the same on a fast and on a slow machine; seconds do not.
"""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from circuitkit.errors import CircuitkitError, UnknownNameError

_CHECKOUT = Path(__file__).parent.parent.parent
ROUND_S = 0.05  # a round of measured work lasts about this long, [s]

Work = Callable[[], object]


@dataclass(frozen=True)
class Case:
    """One comparison.

    Attributes:
        name: What is measured.
        against: What it is compared with.
        prepare: Sets up both and returns (measured work, reference work), equal amounts of what is compared.
        limit: The ratio is meant to stay at or below this; None if there is no such aim.
    """

    name: str
    against: str
    prepare: Callable[[], tuple[Work, Work]]
    limit: float | None = None


@dataclass(frozen=True)
class Row:
    """The result of a case.

    Attributes:
        case: Its name.
        seconds: Median time of the measured work, [s].
        ratio: Median over the rounds of measured time / reference time.
        against: What it was compared with.
        limit: As in the case.
    """

    case: str
    seconds: float
    ratio: float
    against: str
    limit: float | None


def shipped_cases(folder: Path | None = None) -> tuple[Case, ...]:
    """The cases of the repository: every `benchmarks/*.py` has a function `cases()`.

    Args:
        folder: Where the benchmarks lie; by default beside the package.

    Raises:
        CircuitkitError: There is no such folder, as in an installed wheel.
    """
    place = folder or _CHECKOUT / "benchmarks"
    if not place.is_dir():
        message = (
            f"found no benchmarks in '{place}': they are part of the repository, not of the installed "
            "package; run `make bench` in a clone of the repository"
        )
        raise CircuitkitError(message)
    return tuple(case for file in sorted(place.glob("*.py")) for case in _cases_of(file))


def _cases_of(file: Path) -> Iterable[Case]:
    spec = importlib.util.spec_from_file_location(f"circuitkit_benchmarks_{file.stem}", file)
    if spec is None or spec.loader is None:
        message = f"cannot load the benchmarks of '{file}'"
        raise CircuitkitError(message)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    cases: Iterable[Case] = module.cases()
    return cases


def select(cases: Sequence[Case], names: Sequence[str]) -> tuple[Case, ...]:
    """The cases whose name contains one of `names`; all, if no names are given.

    Raises:
        UnknownNameError: A name fits no case.
    """
    for name in names:
        if not any(name in case.name for case in cases):
            kind = "benchmark"
            raise UnknownNameError(kind, name, (case.name for case in cases))
    return tuple(case for case in cases if not names or any(name in case.name for name in names))


def measure(cases: Iterable[Case], rounds: int = 15) -> Iterator[Row]:
    """Measure cases, one row each.

    In every round the two take turns, so that what else the machine does hits both.

    Args:
        cases: What to measure.
        rounds: How many pairs of times to take the median of.
    """
    for case in cases:
        measured, reference = case.prepare()
        repeats = _repeats(measured, reference)
        pairs = [(_seconds(measured, repeats), _seconds(reference, repeats)) for _ in range(rounds)]
        yield Row(
            case=case.name,
            seconds=statistics.median(mine for mine, _ in pairs),
            ratio=statistics.median(mine / theirs for mine, theirs in pairs),
            against=case.against,
            limit=case.limit,
        )


def _repeats(*works: Work) -> int:
    """How often to repeat work so that a round of the faster one lasts `ROUND_S`; also warms both up."""
    for work in works:
        work()
    return max(1, int(ROUND_S / max(min(_seconds(work, 1) for work in works), 1e-9)))


def _seconds(work: Work, repeats: int) -> float:
    """Time of one call of `work`, the mean over `repeats` calls, [s]."""
    begin = time.perf_counter()
    for _ in range(repeats):
        work()
    return (time.perf_counter() - begin) / repeats
