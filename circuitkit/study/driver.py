"""Running studies: `sweep` to a folder, `run_studies` and `run_cases` in memory."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.files import OutputError
from circuitkit.base.output_folder import one_run
from circuitkit.base.progress import progress_bar
from circuitkit.simulation.disturbances.delay import Delay
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case, Outcome
from circuitkit.study.processes import Processes
from circuitkit.study.results import Results, row_of
from circuitkit.study.scheduler import CasesByCell, Progress, Task, boundary_of, drive
from circuitkit.study.spec import Settings, Study, read_study
from circuitkit.study.store import Store
from circuitkit.study.workers import Job, Workers, open_workers, processors, run_job


def load_study(name_or_path: str | Path) -> Study:
    """Read a study file, and check that the fields that it names exist and take these values.

    Args:
        name_or_path: A path, or the name of a shipped one such as `push_limits`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    study = read_study(name_or_path)
    CaseBuilder(study).check()
    return study


def sweep(
    study: Study,
    folder: str | Path,
    *,
    workers: int | Workers | None = None,
    resume: bool = False,
    scheduler: str | None = None,
    progress: bool | Progress = True,
    batch: int | None = None,
    timeout_s: float | None = None,
) -> Results:
    """Run a study and write its results as they come.

    The results are the same, to the last byte, whatever `workers`, `scheduler` and `batch` are.

    Args:
        study: The study.
        folder: Takes `results.parquet`, and meanwhile what is done; is made if it is missing.
        workers: Processes, by default one for each processor; or workers that are there already.
        resume: Go on with what the folder has, and do not run it again.
        scheduler: Address of a Dask scheduler whose workers are used instead.
        progress: Show a bar on a terminal; or gets how many runs are done, and about how many there will be.
        batch: Runs that a worker steps together, at most.
        timeout_s: How long a batch may take until its worker counts as stuck, [s]; see `open_workers`.

    Raises:
        InputError: Something of the study does not fit, or the folder has results of another study, or it has
            results and `resume` is not set.
        CircuitkitError: No worker could do a batch; a run failed.
        OutputError: The results cannot be written.
        KeyboardInterrupt: Ctrl-C came; says what is kept.
    """
    store = Store(Path(folder))
    with one_run(store.folder, resumed=resume, own=store.names):
        return _sweep(study, store, workers, scheduler, progress, batch, timeout_s, resume=resume)


def _sweep(
    study: Study,
    store: Store,
    workers: int | Workers | None,
    scheduler: str | None,
    progress: bool | Progress,
    batch: int | None,
    timeout_s: float | None,
    *,
    resume: bool,
) -> Results:
    cases = CasesByCell(study)
    known = store.begin(study, cases.identity(), resume=resume)
    task = Task(study, cases, known)
    workplace = (
        nullcontext(workers) if isinstance(workers, Workers) else open_workers(workers, scheduler, timeout_s)
    )
    try:
        with workplace as used, _reported(progress, study.name) as report:
            drive(
                [task],
                used,
                batch,
                report,
                lambda _, runs: store.add(study, [row_of(study, r) for r in runs]),
            )
        if task.error is not None:
            raise task.error
        results = task.results()
        store.finish(results)
    except KeyboardInterrupt:
        count = store.count()
        kept = "1 run is" if count == 1 else f"{count} runs are"
        message = f"{kept} kept in '{store.folder}'; --resume (resume=True) goes on with the study"
        raise KeyboardInterrupt(message) from None
    except OutputError as error:
        message = (
            f"{error}; the runs before are kept in '{store.folder}', --resume (resume=True) goes on with them"
        )
        raise OutputError(message) from error
    return results


def run_studies(
    studies: Sequence[Study], workers: Workers, *, batch: int | None = None, progress: Progress | None = None
) -> list[Results | CircuitkitError]:
    """Run studies side by side, such as the candidates of a search, and write nothing.

    Args:
        studies: The studies.
        workers: Do the runs.
        batch: Runs that a worker steps together, at most.
        progress: Gets how many runs are done and about how many there will be.

    Returns:
        The results of each study, or what keeps one of its cells from being run.
    """
    tasks = [Task(study, CasesByCell(study), {}) for study in studies]
    drive(tasks, workers, batch, progress)
    return [task.results() if task.error is None else task.error for task in tasks]


def run_cases(
    study: Study,
    cases: Sequence[Settings],
    seeds: Iterable[int],
    workers: Workers,
    *,
    batch: int | None = None,
    progress: Progress | None = None,
) -> list[tuple[Outcome, ...] | CircuitkitError]:
    """Run the study's scenario under different settings, and write nothing.

    Args:
        study: Gives scenario, `set` and `watch`; its axes, seeds and search are left aside.
        cases: For each, fields by path that differ, such as `{"circuit.w": "-0.5 deg"}`.
        seeds: Of every case.
        workers: Do the runs.
        batch: Runs that a worker steps together, at most.
        progress: Gets how many runs are done and how many there are.

    Returns:
        In the order of the cases: an outcome for each seed, or what keeps the case from being run.
    """
    each = tuple(seeds)
    plain = study.with_({"axes": None, "search": None, "seeds": {"first": 0, "count": 1}})
    builder = CaseBuilder(plain)
    tasks = [Task(plain, CasesByCell(plain, settings, builder), {}, each) for settings in cases]
    drive(tasks, workers, batch, progress)
    found: list[tuple[Outcome, ...] | CircuitkitError] = []
    for task in tasks:
        by_seed = {run.outcome.seed: run.outcome for run in task.runs}
        found.append(task.error if task.error is not None else tuple(by_seed[seed] for seed in each))
    return found


@contextmanager
def _reported(progress: bool | Progress, name: str) -> Iterator[Progress | None]:
    """Who gets how many runs are done: who asked for it, or a bar."""
    if callable(progress):
        yield progress
        return
    with progress_bar(name, shown=progress) as advance:
        if advance is None:
            yield None
            return
        yield lambda done, expected: advance(
            done, max(expected, 1), f"{name}: {done} of about {expected} runs"
        )


@dataclass(frozen=True)
class Estimate:
    """What a study will take.

    Attributes:
        cells: How many cells it has.
        runs: How many runs, about; exactly, if nothing is searched.
        most: How many at most.
        shortest_s: Simulated time of the shortest run, [s].
        longest_s: Simulated time of the longest run, [s].
        seconds: Time that one processor takes for the runs, about, [s]: a few robots were timed.
        begin_s: Time until the first runs begin, [s]: the robot was made; a worker's start comes before.
        start_s: Time in which a worker process starts, [s].
    """

    cells: int
    runs: int
    most: int
    shortest_s: float
    longest_s: float
    seconds: float
    begin_s: float
    start_s: float

    def takes_s(self, workers: int) -> float:
        """Time that it takes with so many workers, about, [s]."""
        count = min(workers, self.runs)
        start = self.start_s * max(count / processors(), 1.0) if count > 1 else 0.0
        return start + self.begin_s + self.seconds / count


_TIMED_S = 2.0  # simulated time of the robots that are timed, [s]
_TIMED_ROBOTS = 8


def estimate(study: Study) -> Estimate:
    """See what a study will take, without running it.

    Raises:
        InputError: Something of the study does not fit.
    """
    cases = CasesByCell(study)
    task = Task(study, cases, {})
    durations = [cases(cell, 0).scenario.duration for cell in range(len(study.cells))]
    runs = round(task.about() * len(study.cells))
    search = boundary_of(study)
    most = (search.most() if search else len(study.seeds)) * len(study.cells)
    runs = min(runs, most)  # the guess is for wide grids
    mean = sum(durations) / len(durations)
    began = time.perf_counter()
    Processes.start_one()
    start_s = time.perf_counter() - began
    each, begin_s = _seconds_a_second(cases(0, 0))
    seconds = each * mean * runs
    return Estimate(len(study.cells), runs, most, min(durations), max(durations), seconds, begin_s, start_s)


def _seconds_a_second(case: Case) -> tuple[float, float]:
    """Time that a second of one robot takes, and what is made once, [s]; what befalls it late is left out."""
    kept = tuple(each for each in case.scenario.befalling if isinstance(each, Noise | Delay))
    scenario = case.scenario.with_disturbances(kept).model_copy(update={"duration": _TIMED_S})
    short = replace(case, scenario=scenario)
    job = Job(short, tuple(short.spec(seed) for seed in range(_TIMED_ROBOTS)))
    first, again = run_job(job).seconds, run_job(job).seconds
    return again / _TIMED_S / _TIMED_ROBOTS, max(first - again, 0.0)
