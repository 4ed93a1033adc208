"""Benchmarks: pieces of work that take turns with what they are compared with, and amounts with a limit.

A ratio measured in one run means the same on a fast and on a slow machine; seconds do not. Where seconds or
bytes are what counts, as for loading a file, the amount itself has the limit.
"""

from __future__ import annotations

import importlib.util
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from circuitkit.base.errors import CircuitkitError, UnknownNameError

_CHECKOUT = Path(__file__).parent.parent.parent
ROUND_S = 0.05  # a round of measured work lasts about this long, [s]
_MOST_SAMPLES = 5  # of an amount, each of which is a process of its own or a long one

Work = Callable[[], object]


@dataclass(frozen=True)
class Loop:
    """Work of less than a microsecond, which brings its own loop, so that no call of ours is counted.

    Attributes:
        times: Does the work as often as it is told.
    """

    times: Callable[[int], object]


@dataclass(frozen=True)
class Timed:
    """Work that tells its own time, such as that of another program without its start.

    Attributes:
        seconds: Does the work once and returns how long it took, [s].
    """

    seconds: Callable[[], float]


AnyWork: TypeAlias = Work | Loop | Timed


class LeftOutError(Exception):
    """A case cannot be measured here, for instance since the simulator to compare with is not installed."""


@dataclass(frozen=True)
class Case:
    """One comparison.

    Attributes:
        name: What is measured.
        against: What it is compared with.
        prepare: Sets up both and returns (measured work, reference work), equal amounts of what is compared;
            raises LeftOutError if that is not possible here.
        limit: The ratio is meant to stay at or below this; None if there is no such aim.
        steps: How many steps the measured work does, for the time of one.
    """

    name: str
    against: str
    prepare: Callable[[], tuple[AnyWork, AnyWork]]
    limit: float | None = None
    steps: int = 1


@dataclass(frozen=True)
class Amount:
    """Something that is measured by itself.

    Attributes:
        name: What is measured.
        unit: Unit of the amount: `s`, or another one, such as `bytes a synapse`.
        prepare: Sets up, and returns a function that measures once; raises LeftOutError as a case's does.
        limit: The median is meant to stay at or below this; None if there is no such aim.
    """

    name: str
    unit: str
    prepare: Callable[[], Callable[[], float]]
    limit: float | None = None


AnyCase: TypeAlias = Case | Amount


@dataclass(frozen=True)
class Row:
    """The result of a case.

    Attributes:
        case: Its name.
        seconds: Median time of the measured work, or of one step of it, [s]; None if it is no time.
        ratio: Median over the rounds of measured time / reference time; None for an amount.
        against: What it was compared with; empty for an amount.
        limit: As in the case.
        amount: Median of the amount, [`unit`]; None for a comparison.
        unit: Unit of the amount and of its limit; empty for a comparison.
        note: Why there is no result; empty if there is one.
        ok: Whether it stays within the limit; None if there is no limit or no result.
    """

    case: str
    seconds: float | None
    ratio: float | None
    against: str
    limit: float | None
    amount: float | None = None
    unit: str = ""
    note: str = ""
    ok: bool | None = None


def shipped_cases(folder: Path | None = None) -> tuple[AnyCase, ...]:
    """The cases of the repository: every `benchmarks/bench_*.py` has a function `cases()`.

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
    if str(place.parent) not in sys.path:
        sys.path.append(str(place.parent))  # benchmarks share modules: `from benchmarks.plain import ...`
    return tuple(case for file in sorted(place.glob("bench_*.py")) for case in _cases_of(file))


def _cases_of(file: Path) -> Iterable[AnyCase]:
    spec = importlib.util.spec_from_file_location(f"circuitkit_benchmarks_{file.stem}", file)
    if spec is None or spec.loader is None:
        message = f"cannot load the benchmarks of '{file}'"
        raise CircuitkitError(message)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses look for the names in their annotations
    spec.loader.exec_module(module)
    cases: Iterable[AnyCase] = module.cases()
    return cases


def select(cases: Sequence[AnyCase], names: Sequence[str]) -> tuple[AnyCase, ...]:
    """The cases whose name contains one of `names`; all, if no names are given.

    Raises:
        UnknownNameError: A name fits no case.
    """
    for name in names:
        if not any(name in case.name for case in cases):
            kind = "benchmark"
            raise UnknownNameError(kind, name, (case.name for case in cases))
    return tuple(case for case in cases if not names or any(name in case.name for name in names))


def measure(cases: Iterable[AnyCase], rounds: int = 15) -> Iterator[Row]:
    """Measure cases, one row each.

    In every round of a comparison the two take turns, now one and now the other first, so that what else the
    machine does hits both.

    Args:
        cases: What to measure.
        rounds: How many pairs of times, or at most how many amounts, to take the median of.
    """
    for case in cases:
        try:
            yield _compare(case, rounds) if isinstance(case, Case) else _weigh(case, rounds)
        except LeftOutError as reason:
            against, unit = (case.against, "") if isinstance(case, Case) else ("", case.unit)
            yield Row(case.name, None, None, against, case.limit, unit=unit, note=str(reason))


def _compare(case: Case, rounds: int) -> Row:
    measured, reference = case.prepare()
    repeats, repeats_of_reference = _repeats(measured), _repeats(reference)
    times, ratios = [], []
    for number in range(rounds):
        before = _seconds(reference, repeats_of_reference) if number % 2 else None
        mine = _seconds(measured, repeats)
        theirs = _seconds(reference, repeats_of_reference) if before is None else before
        times.append(mine)
        ratios.append(mine / theirs)
    ratio = statistics.median(ratios)
    return Row(
        case=case.name,
        seconds=statistics.median(times) / case.steps,
        ratio=ratio,
        against=case.against,
        limit=case.limit,
        ok=None if case.limit is None else ratio <= case.limit,
    )


def _weigh(case: Amount, rounds: int) -> Row:
    once = case.prepare()
    amount = statistics.median(once() for _ in range(min(rounds, _MOST_SAMPLES)))
    return Row(
        case=case.name,
        seconds=amount if case.unit == "s" else None,
        ratio=None,
        against="",
        limit=case.limit,
        amount=amount,
        unit=case.unit,
        ok=None if case.limit is None else amount <= case.limit,
    )


def _repeats(work: AnyWork) -> int:
    """How often to repeat work so that a round of it lasts `ROUND_S`; also warms it up."""
    _seconds(work, 1)
    once = _seconds(work, 1)
    if once < ROUND_S / 10:  # too short to be measured by itself
        once = _seconds(work, max(1, int(ROUND_S / 10 / max(once, 1e-7))))
    return max(1, int(ROUND_S / max(once, 1e-9)))


def _seconds(work: AnyWork, repeats: int) -> float:
    """Time of one call of `work`, the mean over `repeats` calls, [s]; what tells its time is called once."""
    if isinstance(work, Timed):
        return work.seconds()
    begin = time.perf_counter()
    if isinstance(work, Loop):
        work.times(repeats)
    else:
        for _ in range(repeats):
            work()
    return (time.perf_counter() - begin) / repeats
