"""The scheduler of a study under way: cells ask for runs, those that fit together go to the workers in batches.

Which worker does what, and how many runs go into a batch, changes nothing in what comes out: a cell asks by
what its own runs have shown, and a run's outcome is its own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from circuitkit.base.errors import CircuitkitError
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case
from circuitkit.study.jobs import Done, Job, Outcome
from circuitkit.study.pool import Pool, PoolError
from circuitkit.study.results import Results, Run, rows_of
from circuitkit.study.search import Boundary, EachBoundary, Request, Strategy, grid_runs
from circuitkit.study.spec import Settings, Study

BATCH = 32  # runs in a batch, at most
_LEAST = 4  # a batch is not cut smaller to keep a worker busy

Progress: TypeAlias = Callable[[int, int], object]


class CasesByCell:
    """The cases of a study by cell and number of the searched value; each is made when it is asked for."""

    def __init__(self, study: Study, settings: Settings | None = None) -> None:
        self._study = study
        self._builder = CaseBuilder(study)
        self._settings = settings
        self._made: dict[tuple[int, int], Case] = {}

    def __call__(self, cell: int, index: int) -> Case:
        """The case of a cell at a searched value.

        Raises:
            InputError: Something does not fit.
        """
        if (cell, index) not in self._made:
            study, search = self._study, self._study.search
            if self._settings is not None:
                case = self._builder.case(self._settings)
            else:
                searched = None if search is None else search.value(index)
                case = self._builder.of_cell(study.cells[cell], searched)
            self._made[cell, index] = case
        return self._made[cell, index]

    def inputs(self) -> dict[str, str]:
        """What the files of all cells say."""
        found: dict[str, str] = {}
        for cell in range(len(self._study.cells)):
            for name, content in self(cell, 0).inputs.items():
                while found.get(name, content) != content:  # other settings of the same file
                    name += " "  # noqa: PLW2901 - it is counted by the length of its name
                found[name] = content
        return found


@dataclass(eq=False)
class Task:
    """A study under way.

    Attributes:
        study: The study.
        cases: Its cases.
        known: Outcomes that are there already, by the run's key.
        seeds: Those of the runs; the study's by default.
        runs: What is done.
        error: What keeps a cell from being run.
    """

    study: Study
    cases: CasesByCell
    known: Mapping[str, Outcome]
    seeds: Sequence[int] | None = None
    runs: list[Run] = field(default_factory=list)
    error: CircuitkitError | None = None

    def strategy(self) -> Strategy:
        """What decides for a cell."""
        boundary = self._boundary()
        return boundary.runs() if boundary else grid_runs(self.seeds or self.study.seeds)

    def about(self) -> float:
        """How many runs a cell takes, about."""
        boundary = self._boundary()
        return boundary.about() if boundary else len(self.seeds or self.study.seeds)

    def _boundary(self) -> Boundary | EachBoundary | None:
        return boundary_of(self.study)

    def results(self) -> Results:
        """What was found."""
        return Results(self.study, rows_of(self.study, self.runs))


def boundary_of(study: Study) -> Boundary | EachBoundary | None:
    """The search of a study's cells; None for a plain grid."""
    search = study.search
    if search is None:
        return None
    if search.of == "each_seed":
        return EachBoundary(search.count, study.seeds)
    return Boundary(search.count, study.seeds, search.survive, search.check_below)


@dataclass(eq=False)
class _Cell:
    """A cell under way: what it has asked for, and what has come of it."""

    task: Task
    number: int
    strategy: Strategy
    wanted: list[Request] = field(default_factory=list)
    come: dict[Request, bool] = field(default_factory=dict)
    done: int = 0
    over: bool = False


@dataclass(eq=False)
class _Open:
    """A run that is wanted by one or more cells."""

    case: Case
    seed: int
    asked_by: list[tuple[_Cell, Request]]


def drive(
    tasks: Sequence[Task],
    pool: Pool,
    batch: int | None,
    progress: Progress | None = None,
    keep: Callable[[Task, list[Run]], object] | None = None,
) -> None:
    """Run tasks to their end.

    Args:
        tasks: They get their runs, or an error.
        pool: The workers.
        batch: Runs in a batch, at most.
        progress: Is told how many runs are done and about how many there will be.
        keep: Is given a task's new runs, a batch at a time.

    Raises:
        CircuitkitError: `batch` is less than 1; a worker has ended, or is at work for a call that was broken
            off.
    """
    if batch is not None and batch < 1:
        message = f"found a batch of {batch}; allowed: 1 or more"
        raise CircuitkitError(message)
    if pool.under_way:
        message = (
            f"the workers still have {pool.under_way} jobs of a call that was broken off; open a new pool"
        )
        raise PoolError(message)
    scheduler = _Scheduler(tasks)
    flying: dict[int, list[_Open]] = {}
    number = 0
    while True:
        while len(flying) < pool.slots and (chosen := scheduler.take(batch or BATCH, pool.slots - len(flying))):
            number += 1
            flying[number] = chosen
            pool.submit(_job(number, chosen))
        if progress is not None:
            progress(scheduler.done, scheduler.expected())
        if not flying:
            return
        done = pool.next()
        for task, runs in scheduler.settle(flying.pop(done.number), done).items():
            if keep is not None:
                keep(task, runs)


def _job(number: int, chosen: Sequence[_Open]) -> Job:
    return Job(number, chosen[0].case, tuple(each.case.spec(each.seed) for each in chosen))


class _Scheduler:
    """What is wanted and not yet under way, by what can be stepped together."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._open: dict[str, _Open] = {}
        self._waiting: dict[str, deque[str]] = {}
        self._outcomes = {key: outcome for task in tasks for key, outcome in task.known.items()}
        self.done = 0
        self._cells = [_Cell(task, i, task.strategy()) for task in tasks for i in range(len(task.study.cells))]
        for cell in self._cells:
            self._ask(cell, None)

    def expected(self) -> int:
        """About how many runs there will be."""
        left = (
            max(cell.task.about() - cell.done, len(cell.wanted) - len(cell.come))
            for cell in self._cells
            if not cell.over
        )
        return self.done + round(sum(left))

    def take(self, most: int, free: int) -> list[_Open]:
        """Runs for a worker: of those that wait for the same plan, the most; nothing if none wait.

        Runs of one seed go together as far as they can, since what they have in common is simulated once.

        Args:
            most: How many at most.
            free: How many workers have nothing to do.
        """
        if not self._waiting:
            return []
        total = sum(len(each) for each in self._waiting.values())
        key = max(self._waiting, key=lambda name: len(self._waiting[name]))
        queue = self._waiting[key]
        size = min(len(queue), most, max(-(-total // free), _LEAST))
        keys = sorted(queue, key=lambda name: self._open[name].seed)[:size]
        if size == len(queue):
            del self._waiting[key]
        else:
            taken = set(keys)
            self._waiting[key] = deque(name for name in queue if name not in taken)
        return [self._open[key] for key in keys]

    def settle(self, chosen: Sequence[_Open], done: Done) -> dict[Task, list[Run]]:
        """Give outcomes to the cells that wait for them, which may then ask for more; the tasks' new runs."""
        new: dict[Task, list[Run]] = {}
        ready: dict[_Cell, None] = {}
        for run, outcome in zip(chosen, done.outcomes, strict=True):
            key = run.case.run_key(run.seed)
            del self._open[key]
            for cell, wanted in run.asked_by:
                if isinstance(outcome, CircuitkitError):
                    self._give_up(cell.task, outcome)
                    continue
                self._outcomes[key] = outcome
                new.setdefault(cell.task, []).append(self._note(cell, wanted, run.case, outcome))
                ready[cell] = None
        for cell in ready:
            self._go_on(cell)
        return new

    def _give_up(self, task: Task, error: CircuitkitError) -> None:
        """Ask for nothing more for a task, and drop what only it waits for."""
        task.error = task.error or error
        for cell in self._cells:
            cell.over = cell.over or cell.task is task
        for name, queue in list(self._waiting.items()):
            left = deque(key for key in queue if not self._is_given_up(key))
            for key in queue:
                if self._is_given_up(key):
                    del self._open[key]
            if left:
                self._waiting[name] = left
            else:
                del self._waiting[name]

    def _is_given_up(self, key: str) -> bool:
        return all(cell.task.error is not None for cell, _ in self._open[key].asked_by)

    def _note(self, cell: _Cell, wanted: Request, case: Case, outcome: Outcome) -> Run:
        """Tell a cell the outcome of one of its runs."""
        search, held = cell.task.study.search, False
        try:
            held = search is None or outcome.holds(search.condition)
        except CircuitkitError as error:  # there is no such measure, or it is a number
            self._give_up(cell.task, error)
        run = Run(cell.number, wanted[0], case, outcome)
        cell.task.runs.append(run)
        cell.come[wanted] = held
        cell.done += 1
        self.done += 1
        return run

    def _go_on(self, cell: _Cell) -> None:
        if len(cell.come) == len(cell.wanted) and not cell.over:
            self._ask(cell, cell.come)

    def _ask(self, cell: _Cell, held: Mapping[Request, bool] | None) -> None:
        """Let a cell ask for runs, as long as all that it asks for is known already."""
        while not cell.over:
            try:
                wanted = next(cell.strategy) if held is None else cell.strategy.send(held)
                cases = [cell.task.cases(cell.number, index) for index, _ in wanted]
            except StopIteration:
                cell.over = True
                return
            except CircuitkitError as error:
                self._give_up(cell.task, error)
                return
            cell.wanted, cell.come = wanted, {}
            known = self._outcomes
            for each, case in zip(wanted, cases, strict=True):
                key = case.run_key(each[1])
                if key in known:
                    self._note(cell, each, case, known[key])
                elif key in self._open:
                    self._open[key].asked_by.append((cell, each))
                else:
                    self._open[key] = _Open(case, each[1], [(cell, each)])
                    self._waiting.setdefault(case.shared_key, deque()).append(key)
            if len(cell.come) < len(wanted):
                return
            held = cell.come
