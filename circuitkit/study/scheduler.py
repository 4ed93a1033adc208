"""The scheduler of studies: cells ask for runs, and those that fit together go to the workers in batches.

Which worker does what, and how many runs go into a batch, changes nothing in what comes out: a cell asks by
what its own runs have shown, and a run's outcome is its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from circuitkit.base.errors import CircuitkitError
from circuitkit.study.batches import Batches
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case, Outcome
from circuitkit.study.identity import Identity, identity_of
from circuitkit.study.plain import as_written, plain
from circuitkit.study.results import Results, Run, rows_of
from circuitkit.study.search import Boundary, EachBoundary, Request, Strategy, grid_runs
from circuitkit.study.spec import Settings, Study
from circuitkit.study.workers import Done, Job, Workers

_UNSEEN = ("description", "scenario")  # keys of a study that determine nothing by their own text
BATCH = 32  # runs in a batch, at most
_LEAST = 4  # a batch is not cut smaller to keep a worker busy

Progress: TypeAlias = Callable[[int, int], object]


class CasesByCell:
    """The cases of a study by cell and number of the searched value; each is made when it is asked for."""

    def __init__(
        self, study: Study, settings: Settings | None = None, builder: CaseBuilder | None = None
    ) -> None:
        """Take a study.

        Args:
            study: The study.
            settings: Fields that take the place of those of the cells.
            builder: Has read its files already.
        """
        self._study = study
        self._builder = builder or CaseBuilder(study)
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

    def identity(self) -> Identity:
        """All that determines the runs of the study."""
        study = self._study
        file: Any = study.document.data
        words = {key: each for key, each in file.items() if key not in _UNSEEN}
        search = None if study.search is None else plain(study.search)
        own = {"study": study.name, "seeds": plain(study.file.seeds), "search": search}
        cells = ((plain(cell.labels), self(number, 0).identity) for number, cell in enumerate(study.cells))
        return identity_of(own, {"study": as_written(words)}, cells)


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
        boundary = boundary_of(self.study)
        return boundary.runs() if boundary else grid_runs(self.seeds or self.study.seeds)

    def about(self) -> float:
        """How many runs a cell takes, about."""
        boundary = boundary_of(self.study)
        return boundary.about() if boundary else len(self.seeds or self.study.seeds)

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


def drive(
    tasks: Sequence[Task],
    workers: Workers,
    batch: int | None,
    progress: Progress | None = None,
    keep: Callable[[Task, list[Run]], object] | None = None,
) -> None:
    """Run tasks to their end.

    Args:
        tasks: They get their runs, or an error.
        workers: Do the runs.
        batch: Runs in a batch, at most.
        progress: Gets how many runs are done and about how many there will be.
        keep: Is given a task's new runs, a batch at a time.

    Raises:
        CircuitkitError: `batch` is less than 1, or no worker can do a batch.
    """
    if batch is not None and batch < 1:
        message = f"found a batch of {batch}; allowed: 1 or more"
        raise CircuitkitError(message)
    scheduler = _Scheduler(tasks)
    batches: Batches[list[_Pending]] = Batches(workers)
    try:
        while True:
            if progress is not None:
                progress(scheduler.done, scheduler.expected())
            while (free := workers.slots() - len(batches)) > 0 and (
                chosen := scheduler.take(batch or BATCH, free)
            ):
                batches.begin(
                    Job(chosen[0].case, tuple(each.case.spec(each.seed) for each in chosen)), chosen
                )
            if not batches:
                return
            for chosen, done in batches.wait():
                for task, runs in scheduler.settle(chosen, done).items():
                    if keep is not None:
                        keep(task, runs)
    finally:
        batches.cancel()


@dataclass(eq=False)
class _Cell:
    """A cell under way.

    Attributes:
        task: Whose cell it is.
        number: Which one.
        strategy: Decides which runs it asks for.
        requests: What it waits for.
        answers: Whether the condition held, for those of the requests that are done.
        done: How many of its runs are done.
        over: Whether it asks for nothing more.
    """

    task: Task
    number: int
    strategy: Strategy
    requests: list[Request] = field(default_factory=list)
    answers: dict[Request, bool | None] = field(default_factory=dict)
    done: int = 0
    over: bool = False


@dataclass(eq=False)
class _Pending:
    """A run that one or more cells ask for, and that is not done yet.

    Attributes:
        case: What is run.
        seed: Its seed.
        asked_by: The cells that wait for it, each with its request.
    """

    case: Case
    seed: int
    asked_by: list[tuple[_Cell, Request]]


class _Scheduler:
    """What is asked for and not yet under way, by what can be stepped together.

    Attributes:
        done: How many runs are done.
    """

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._pending: dict[str, _Pending] = {}  # by the run's key; also those that are under way
        self._waiting: dict[str, list[str]] = {}  # keys of runs, by what they share
        self._outcomes = {key: outcome for task in tasks for key, outcome in task.known.items()}
        self.done = 0
        self._cells = [
            _Cell(task, i, task.strategy()) for task in tasks for i in range(len(task.study.cells))
        ]
        for cell in self._cells:
            self._ask(cell, None)

    def expected(self) -> int:
        """About how many runs there will be."""
        left = (
            max(cell.task.about() - cell.done, len(cell.requests) - len(cell.answers))
            for cell in self._cells
            if not cell.over
        )
        return self.done + round(sum(left))

    def take(self, most: int, free: int) -> list[_Pending]:
        """Runs for a worker: of those that wait for the same plan, the most; nothing if none wait.

        Runs of one seed go together as far as they can, since what they have in common is simulated once.

        Args:
            most: How many at most.
            free: How many workers have nothing to do.
        """
        if not self._waiting:
            return []
        total = sum(len(each) for each in self._waiting.values())
        shared = max(self._waiting, key=lambda name: len(self._waiting[name]))
        queue = self._waiting[shared]
        size = min(len(queue), most, max(-(-total // free), _LEAST))
        keys = sorted(queue, key=lambda key: self._pending[key].seed)[:size]
        self._keep(shared, set(queue) - set(keys))
        return [self._pending[key] for key in keys]

    def settle(self, chosen: Sequence[_Pending], done: Done) -> dict[Task, list[Run]]:
        """Give outcomes to the cells that wait for them, which may then ask for more; the tasks' new runs."""
        new: dict[Task, list[Run]] = {}
        ready: dict[_Cell, None] = {}
        for pending, outcome in zip(chosen, done.outcomes, strict=True):
            key = pending.case.run_key(pending.seed)
            del self._pending[key]
            for cell, request in pending.asked_by:
                if isinstance(outcome, CircuitkitError):
                    self._give_up(cell.task, outcome)
                    continue
                self._outcomes[key] = outcome
                new.setdefault(cell.task, []).append(self._answer(cell, request, pending.case, outcome))
                ready[cell] = None
        for cell in ready:
            if len(cell.answers) == len(cell.requests) and not cell.over:
                self._ask(cell, cell.answers)
        return new

    def _keep(self, shared: str, keys: set[str]) -> None:
        """Let only these of the runs that share something go on waiting."""
        left = [key for key in self._waiting[shared] if key in keys]
        if left:
            self._waiting[shared] = left
        else:
            del self._waiting[shared]

    def _give_up(self, task: Task, error: CircuitkitError) -> None:
        """Ask for nothing more for a task, and drop what only it waits for."""
        task.error = task.error or error
        for cell in self._cells:
            cell.over = cell.over or cell.task is task
        for shared, queue in list(self._waiting.items()):
            dropped = {key for key in queue if self._is_given_up(key)}
            for key in dropped:
                del self._pending[key]
            self._keep(shared, set(queue) - dropped)

    def _is_given_up(self, key: str) -> bool:
        return all(cell.task.error is not None for cell, _ in self._pending[key].asked_by)

    def _answer(self, cell: _Cell, request: Request, case: Case, outcome: Outcome) -> Run:
        """Give a cell the outcome of one of its runs."""
        search = cell.task.study.search
        held: bool | None = None
        try:
            held = True if search is None else outcome.holds(search.condition)
        except CircuitkitError as error:  # there is no such measure, or it is a number
            self._give_up(cell.task, error)
        run = Run(cell.number, request[0], case, outcome)
        cell.task.runs.append(run)
        cell.answers[request] = held
        cell.done += 1
        self.done += 1
        return run

    def _ask(self, cell: _Cell, answers: Mapping[Request, bool | None] | None) -> None:
        """Let a cell ask for runs, as long as all that it asks for is known already."""
        while not cell.over:
            try:
                requests = next(cell.strategy) if answers is None else cell.strategy.send(answers)
                cases = [cell.task.cases(cell.number, index) for index, _ in requests]
            except StopIteration:
                cell.over = True
                return
            except CircuitkitError as error:
                self._give_up(cell.task, error)
                return
            cell.requests, cell.answers = requests, {}
            for request, case in zip(requests, cases, strict=True):
                self._request(cell, request, case)
            if len(cell.answers) < len(requests):
                return
            answers = cell.answers

    def _request(self, cell: _Cell, request: Request, case: Case) -> None:
        """Answer a request by a known outcome, or have it wait for its run."""
        seed = request[1]
        key = case.run_key(seed)
        if key in self._outcomes:
            self._answer(cell, request, case, self._outcomes[key])
        elif key in self._pending:
            self._pending[key].asked_by.append((cell, request))
        else:
            self._pending[key] = _Pending(case, seed, [(cell, request)])
            self._waiting.setdefault(case.shared_key, []).append(key)
