"""Batches under way: what a worker has lost is done again, and a worker that is stuck is ended.

A batch may be done any number of times, since a run's outcome depends on nothing but its case and seed.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Generic, TypeVar

from circuitkit.study.workers import Done, Job, LostJobError, WorkerError, Workers

_LOG = logging.getLogger("circuitkit")
_TRIES = 3
_LOOK_S = 1.0  # how often to see whether a worker is stuck
_FIRST_S = 600.0  # what a batch may take as long as none is done
_LEAST_S, _TIMES = 60.0, 20.0  # and then: so long, and so many times what the others took for as much work

T = TypeVar("T")


@dataclass
class _Batch(Generic[T]):
    """A job under way.

    Attributes:
        job: The job.
        asked_by: What whoever began it knows it by.
        tries: How often it was begun.
        waited_s: How long it is under way, [s]; a pause of this process does not count.
        stuck: Whether its worker was ended because of that.
    """

    job: Job
    asked_by: T
    tries: int = 1
    waited_s: float = 0.0
    stuck: bool = False

    @property
    def work_s(self) -> float:
        """How much there is to do: the simulated time of all runs, [s]."""
        return len(self.job.specs) * self.job.case.scenario.duration

    def __str__(self) -> str:
        seeds = ", ".join(dict.fromkeys(str(spec.seed) for spec in self.job.specs))
        count = len(self.job.specs)
        runs = "1 run" if count == 1 else f"{count} runs"
        return f"{runs} of the scenario '{self.job.case.scenario.scenario}' with seed {seeds}"


class Batches(Generic[T]):
    """Batches under way."""

    def __init__(self, workers: Workers) -> None:
        """Take the workers that do them."""
        self._workers = workers
        self._under_way: dict[Future[Done], _Batch[T]] = {}
        self._took_s = self._work_s = 0.0
        self._looked = time.monotonic()

    def __len__(self) -> int:
        return len(self._under_way)

    def begin(self, job: Job, asked_by: T) -> None:
        """Have a worker do a job."""
        self._begin(_Batch(job, asked_by))

    def _begin(self, batch: _Batch[T]) -> None:
        batch.waited_s, batch.stuck = 0.0, False
        self._under_way[self._workers.submit(batch.job)] = batch

    def wait(self) -> Iterator[tuple[T, Done]]:
        """What is done, as soon as something is; nothing, if it takes long.

        Raises:
            WorkerError: Several workers have ended or were stuck in the same job, or none can do it.
        """
        for future in wait(self._under_way, timeout=_LOOK_S, return_when=FIRST_COMPLETED).done:
            batch = self._under_way.pop(future)
            try:
                done = self._workers.outcome(future, batch.job.case)
            except LostJobError as error:
                self._again(batch, error)
                continue
            self._took_s += done.seconds
            self._work_s += batch.work_s
            yield batch.asked_by, done
        self._look()

    def _again(self, batch: _Batch[T], error: LostJobError) -> None:
        why = str(error)
        if batch.stuck:
            why = f"{why.partition(' was ended')[0]} was stuck at it for {batch.waited_s:.0f} s and was ended"
        if batch.tries == _TRIES:
            hint = "; allow more by --timeout (timeout_s)" if batch.stuck else ""
            message = f"a batch was lost {_TRIES} times: {batch}; the last time, {why}{hint}"
            raise WorkerError(message) from error
        batch.tries += 1
        _LOG.warning("%s; its batch (%s) is run again, try %d of %d", why, batch, batch.tries, _TRIES)
        self._begin(batch)

    def _look(self) -> None:
        """End the workers that are stuck.

        Raises:
            WorkerError: They cannot be ended from here.
        """
        now = time.monotonic()
        passed, self._looked = min(now - self._looked, 2 * _LOOK_S), now
        for future, batch in self._under_way.items():
            batch.waited_s += passed
            if batch.waited_s > self._limit_s(batch) and not batch.stuck and not future.done():
                batch.stuck = True
                self._workers.stop(future, batch.waited_s)

    def _limit_s(self, batch: _Batch[T]) -> float:
        """How long a batch may take, [s]; when it is tried again, twice as long."""
        if self._workers.timeout_s is not None:
            return self._workers.timeout_s
        if not self._work_s:
            return _FIRST_S
        expected_s = self._took_s / self._work_s * batch.work_s
        return float((_LEAST_S + _TIMES * expected_s) * 2 ** (batch.tries - 1))

    def cancel(self) -> None:
        """Have no more done."""
        for future in self._under_way:
            future.cancel()
