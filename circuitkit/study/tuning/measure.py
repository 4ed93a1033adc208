"""Measuring candidates: all runs of all of them together, with a report of how far that is."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from circuitkit.base.errors import CircuitkitError
from circuitkit.study.cases import Outcome
from circuitkit.study.driver import run_cases
from circuitkit.study.results import Row
from circuitkit.study.tuning.objective import Score, score
from circuitkit.study.tuning.runs import Runs
from circuitkit.study.tuning.search import Candidate, History, Trial
from circuitkit.study.tuning.spec import TRAIN, Tuning
from circuitkit.study.workers import Workers


@dataclass
class Measure:
    """Measures candidates together: all runs of all of them by the same workers.

    Attributes:
        tuning: What is tuned.
        runs: By which runs.
        workers: Do the runs.
        progress: Gets how many of how many runs are done.
    """

    tuning: Tuning
    runs: Sequence[Runs]
    workers: Workers
    progress: Callable[[int, int], object] | None = None

    def __call__(self, candidates: Sequence[Candidate]) -> list[Score | CircuitkitError]:
        """The scores of candidates, or why they have none, in order."""
        total = len(candidates) * sum(each.count for each in self.runs)
        outcomes: dict[str, list[Sequence[Outcome] | CircuitkitError]] = {}
        before = 0
        for each in self.runs:
            settings = [
                {**condition.settings, **self.tuning.settings(candidate)}
                for candidate in candidates
                for condition in each.conditions
            ]
            report = None if self.progress is None else _from(before, total, self.progress)
            outcomes[each.name] = list(
                run_cases(each.study, settings, each.seeds, self.workers, progress=report)
            )
            before += len(settings) * len(each.seeds)
        return [self._score(number, outcomes) for number in range(len(candidates))]

    def _score(
        self, number: int, outcomes: Mapping[str, Sequence[Sequence[Outcome] | CircuitkitError]]
    ) -> Score | CircuitkitError:
        rows: dict[str, list[list[Row]]] = {}
        for each in self.runs:
            size = len(each.conditions)
            rows[each.name] = []
            for outcome in outcomes[each.name][number * size : (number + 1) * size]:
                if isinstance(outcome, CircuitkitError):
                    return outcome
                rows[each.name].append([run.row() for run in outcome])
        return score(self.tuning.spec.terms, {each.name: each.conditions for each in self.runs}, rows)


def _from(before: int, total: int, progress: Callable[[int, int], object]) -> Callable[[int, int], object]:
    """Progress that begins behind what is done already."""
    return lambda done, _: progress(before + done, total)


@dataclass(frozen=True)
class Progress:
    """How far a tuning is.

    Attributes:
        done: How many candidates have been measured, with the part of those under way.
        measured: How many candidates have been measured.
        trials: How many there will be.
        best: The best one so far; None before the first generation is done.
        remaining_s: How much longer it will take; None as long as nobody knows.
        stage: `train`, `confirm` or `test`.
    """

    done: float
    measured: int
    trials: int
    best: Trial | None
    remaining_s: float | None
    stage: str = TRAIN


@dataclass
class Reporter:
    """Reports how far a tuning is, and how much longer it will take by what it took so far.

    Attributes:
        trials: How many candidates there will be.
        report: Gets it; None if nobody wants it.
        stage: `train`, `confirm` or `test`.
        sign: Is called now and then, to say that the tuning is alive.
    """

    trials: int
    report: Callable[[Progress], object] | None
    stage: str = TRAIN
    sign: Callable[[], object] | None = None
    _began: float = field(default_factory=time.monotonic)
    _history: History = field(default_factory=lambda: History((), maximise=True))
    _before: int = 0  # candidates that an earlier run had measured
    _under_way: int = 0

    def generation(self, history: History, under_way: int) -> None:
        """What has been found before a generation of so many candidates begins."""
        if not self._under_way:
            self._before, self._began = len(history.trials), time.monotonic()
        self._history, self._under_way = history, under_way
        self.runs(0, 1)

    def runs(self, done: int, total: int) -> None:
        """So many runs of so many that are under way are done."""
        if self.sign is not None:
            self.sign()
        if self.report is None:
            return
        under_way = self._under_way if self.stage == TRAIN else 0
        candidates = len(self._history.trials) + under_way * done / max(total, 1)
        new, elapsed = candidates - self._before, time.monotonic() - self._began
        left = (self.trials - candidates) * elapsed / new if new > 0 else None
        best = next(iter(self._history.ranking()), None)
        self.report(Progress(candidates, len(self._history.trials), self.trials, best, left, self.stage))
