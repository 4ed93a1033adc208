"""`tune`: the file of a tuning in; a tuned circuit, controller or reference out, with its history."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from circuitkit.base.errors import CircuitkitError, InputError, Problem, UnitError, listing, suggest
from circuitkit.base.source import Data, Place, find_data_file, read_yaml
from circuitkit.base.units import format_quantity
from circuitkit.circuit import load_circuit
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case, fingerprint
from circuitkit.study.driver import run_cases
from circuitkit.study.jobs import RMS, Outcome, plan_of
from circuitkit.study.tuning.history import draw_history, write_table
from circuitkit.study.tuning.objective import LIMIT, Row, Score, score
from circuitkit.study.tuning.result import folder_of, make_folder, provenance, write_result
from circuitkit.study.tuning.runs import Condition, Runs
from circuitkit.study.tuning.search import Candidate, Found, Search, Told, run_search, silence_optuna
from circuitkit.study.tuning.spec import CONFIRM, TEST, TRAIN, Tuning, load_tuning
from circuitkit.study.workers import Workers, open_workers

_ALL_DIGITS = 17


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
    best: Told | None
    remaining_s: float | None
    stage: str = TRAIN


@dataclass(frozen=True)
class Tuned:
    """What a tuning has found.

    Attributes:
        found: The candidates.
        best: The one that was chosen.
        confirmed: What the runs say by which it was chosen among the best; None without such.
        test: What the test says of it; None if the search was ended early.
        start: The first candidate, if it could be measured.
        path: The tuned file.
    """

    found: Found
    best: Told
    confirmed: Score | None
    test: Score | None
    start: Told | None
    path: Path

    def row(self) -> dict[str, Any]:
        """The result for JSON."""
        best = self.best
        return {
            "result": str(self.path),
            "trials": len(self.found.told),
            "interrupted": self.found.interrupted,
            "best": {"number": best.number, "values": dict(best.settings)},
            "start": None if self.start is None else _numbers(self.start.value, self.start.figures),
            "train": _numbers(best.value, best.figures),
            "confirm": self.confirmed and _numbers(self.confirmed.value, self.confirmed.figures),
            "test": self.test and _numbers(self.test.value, self.test.figures),
        }


def _numbers(value: float | None, figures: Sequence[float]) -> dict[str, Any]:
    return {"objective": value, "figures": list(figures)}


def tune(
    study: str | Path | Tuning,
    folder: str | Path,
    *,
    trials: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    storage: str | None = None,
    resume: bool = False,
    result: str | Path | None = None,
    verbose: bool = False,
    progress: Callable[[Progress], object] | None = None,
) -> Tuned:
    """Search for the values with which a circuit, a controller or a reference does best.

    Candidates are measured on training runs only. In the end the best one is measured on the test runs, once.

    Args:
        study: A study with a section `tune`, its path, or the name of a shipped one.
        folder: Where the results go: `trials.db`, `trials.csv`, `history.png` and `.pdf`, and the tuned file.
        trials: How many candidates, instead of the file's number; the last generation is always measured as a
            whole.
        workers: How many processes; all processors by default.
        scheduler: Address of a Dask scheduler, instead of processes here.
        storage: URL of a database of Optuna, instead of `trials.db`.
        resume: Go on with what is there.
        result: Where the tuned file goes, instead of the folder.
        verbose: Let Optuna log.
        progress: Is told how far it is.

    Returns:
        What was found; after Ctrl-C, the best so far.

    Raises:
        InputError: The study is wrong; or there is one already, and it shall not be resumed.
        MissingDependencyError: Optuna or cmaes are not installed.
        KeyboardInterrupt: Ctrl-C came before any candidate was measured.
    """
    tuning = study if isinstance(study, Tuning) else load_tuning(study)
    folder = Path(folder)
    path = Path(result) if result is not None else folder / f"{tuning.spec.result}.yaml"
    if path.resolve() == _file_of(tuning).resolve():
        message = f"found '{path}', the file that is tuned; allowed: another file"
        raise InputError(Problem("", 0, 0, "--result", message))
    parts = {part: tuning.runs(part) for part in tuning.parts()}
    check(tuning, parts[TRAIN])
    silence_optuna(verbose=verbose)
    search = _search(tuning, parts[TRAIN])
    total = search.rounded(trials or tuning.spec.trials)
    with open_workers(workers, scheduler) as opened:
        clock = _Clock(total, progress)
        measure = Measure(tuning, parts[TRAIN], opened, clock.runs)
        found = run_search(
            search,
            storage or _database(folder),
            total,
            measure,
            resume=resume,
            folder=None if storage else folder,
            before=clock.generation,
        )
        if not any(told.value is not None for told in found.told) and found.interrupted:
            raise KeyboardInterrupt
        best, confirmed, test = _chosen(tuning, found, parts, opened, clock)
    write_table(tuning, found, folder / "trials.csv")
    for suffix in ("png", "pdf"):
        draw_history(tuning, found, best, search.size, folder / f"history.{suffix}")
    write_result(tuning, best.settings, provenance(tuning, found, best, confirmed, test), path)
    start = next((told for told in found.told if told.number == 0 and told.value is not None), None)
    return Tuned(found, best, confirmed, test, start, path)


def _file_of(tuning: Tuning) -> Path:
    """The file that is tuned.

    Raises:
        InputError: There is none; says where the study names it.
    """
    target, kind = tuning.spec.target, tuning.spec.kind
    folder = folder_of(tuning)
    try:
        return find_data_file(tuning.base, folder)
    except InputError as error:
        place: Place = ("tune", target) if target == kind else ("tune", target, kind)
        problems = (tuning.document.problem(place, each.message, each.hint) for each in error.problems)
        raise InputError(*problems) from error


def _chosen(
    tuning: Tuning, found: Found, parts: Mapping[str, tuple[Runs, ...]], workers: Workers, clock: _Clock
) -> tuple[Told, Score | None, Score | None]:
    """The best candidate with what confirmation and test say of it, if the search was not ended early."""
    best, confirmed = found.best, None
    if found.interrupted:
        return best, None, None
    try:
        if tuning.spec.confirm is not None:
            clock.stage = CONFIRM
            finalists = found.ranking()[: tuning.spec.confirm.best]
            scores = Measure(tuning, parts[CONFIRM], workers, clock.runs)([each.settings for each in finalists])
            sign = -1.0 if found.maximise else 1.0
            sound = [(s, each) for s, each in zip(scores, finalists, strict=True) if isinstance(s, Score)]
            confirmed, best = min(sound, key=lambda pair: sign * pair[0].value, default=(None, best))
        clock.stage = TEST
        (test,) = Measure(tuning, parts[TEST], workers, clock.runs)([best.settings])
    except KeyboardInterrupt:
        return best, confirmed, None
    if isinstance(test, CircuitkitError):
        raise test
    return best, confirmed, test


def _database(folder: Path) -> str:
    """The URL of the database in a folder, which is made."""
    make_folder(folder)
    return f"sqlite:///{folder.resolve() / 'trials.db'}"


def _search(tuning: Tuning, runs: Sequence[Runs]) -> Search:
    spec = tuning.spec
    inputs = [
        dict(CaseBuilder(each.study).case({**each.conditions[0].settings, **tuning.settings({})}).inputs)
        for each in runs
    ]
    return Search(
        name=tuning.file.study,
        parameters=spec.parameters,
        start=start_of(tuning),
        sampler=spec.sampler,
        seed=spec.seed,
        maximise=spec.maximise is not None,
        generation=spec.generation,
        spread=spec.spread,
        definition=fingerprint((tuning.definition(), inputs)),
    )


def start_of(tuning: Tuning) -> dict[str, Any]:
    """The first candidate: what the file gives, else what the base has, else the middle of the range."""
    own = _own_values(tuning)
    start = {}
    for name, searched in tuning.spec.parameters.items():
        start[name] = tuning.start.get(name, searched.middle())
        if name not in tuning.start and name in own:
            with suppress(UnitError):  # outside of the range
                start[name] = searched.number(own[name])
    return start


def _own_values(tuning: Tuning) -> dict[str, str]:
    """What the base has for what is searched, as far as it is known, by name."""
    if tuning.spec.target != "circuit":
        data = read_yaml(find_data_file(tuning.base, folder_of(tuning))).data
        flat = dict(_flattened(data, ""))
        return {name: flat[name] for name in tuning.spec.parameters if name in flat}
    graph = load_circuit(tuning.base)
    own: dict[str, str] = {"timing": graph.timing}
    for name, searched in tuning.spec.parameters.items():
        node, _, key = name.rpartition(".")
        parameters = next((each.parameters for each in graph.neurons if each.name == node), {})
        if name in graph.parameters:
            own[name] = format_quantity(graph.parameters[name].value_si, searched.unit, _ALL_DIGITS)
        elif key in parameters:
            own[name] = format_quantity(float(parameters[key]), searched.unit, _ALL_DIGITS)
    return own


def _flattened(data: Data, name: str) -> Iterator[tuple[str, str]]:
    """The values of mappings in mappings by their path."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _flattened(value, f"{name}.{key}" if name else key)
    elif not isinstance(data, list):
        yield name, str(data)


@dataclass
class Measure:
    """Measures candidates together: all runs of all of them by the same workers.

    Attributes:
        tuning: What is tuned.
        runs: By which runs.
        workers: Do the runs.
        progress: Is told how many of how many runs are done.
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


@dataclass
class _Clock:
    """Tells how far it is, and how much longer it will take by what it took so far.

    Attributes:
        trials: How many candidates there will be.
        tell: Is told.
        stage: `train`, `confirm` or `test`.
    """

    trials: int
    tell: Callable[[Progress], object] | None
    stage: str = TRAIN
    _began: float = field(default_factory=time.monotonic)
    _found: Found = field(default_factory=lambda: Found((), maximise=True))
    _before: int = 0  # candidates that an earlier run had measured
    _under_way: int = 0

    def generation(self, found: Found, under_way: int) -> None:
        """What has been found before a generation of so many candidates begins."""
        if not self._under_way:
            self._before, self._began = len(found.told), time.monotonic()
        self._found, self._under_way = found, under_way
        self.runs(0, 1)

    def runs(self, done: int, total: int) -> None:
        """So many runs of so many that are under way are done."""
        if self.tell is None:
            return
        under_way = self._under_way if self.stage == TRAIN else 0
        candidates = len(self._found.told) + under_way * done / max(total, 1)
        new, elapsed = candidates - self._before, time.monotonic() - self._began
        left = (self.trials - candidates) * elapsed / new if new > 0 else None
        best = next(iter(self._found.ranking()), None)
        self.tell(Progress(candidates, len(self._found.told), self.trials, best, left, self.stage))


def check(tuning: Tuning, runs: Sequence[Runs]) -> None:
    """See whether what is searched exists and may have the values of its range, and the cases are sound.

    So are the figures of the objective: whatever the first runs would have complained about.

    Raises:
        InputError: With everything that is not; says where in the file of the tuning.
    """
    spec, document = tuning.spec, tuning.document
    problems: list[Problem] = []
    for each in runs:
        builder = CaseBuilder(each.study)
        for condition in each.conditions:
            try:
                builder.case({**condition.settings, **tuning.settings({})})
            except InputError as error:
                problems += [_placed(tuning, condition, problem) for problem in error.problems]
    builder, first_condition = CaseBuilder(runs[0].study), runs[0].conditions[0]
    for name, searched in () if problems else spec.parameters.items():
        ends = searched.choices or (searched.low, searched.high)
        for text in map(str, ends):
            try:
                builder.case({**first_condition.settings, **tuning.settings({name: text})})
            except InputError as error:
                found = error.problems[0]
                at_key = found.message.startswith("unknown")
                place: Place = ("tune", "parameters", name)
                problems.append(document.problem(place, found.message, found.hint, at_key=at_key))
                break
    problems += () if problems else _unknown_figures(tuning, runs)
    if problems:
        first = {(problem.file, problem.line, problem.column): problem for problem in reversed(problems)}
        raise InputError(*sorted(first.values(), key=lambda each: (each.file, each.line, each.column)))


def _unknown_figures(tuning: Tuning, runs: Sequence[Runs]) -> Iterator[Problem]:
    """Terms of the objective whose figure some of their runs will not have."""
    spec = tuning.spec
    direction = "maximise" if spec.maximise else "minimise"
    by_name = {each.name: each for each in runs}
    known: dict[str, tuple[str, ...]] = {}
    for number, term in enumerate(spec.terms):
        if term.figure == LIMIT:
            continue
        used = by_name[term.runs] if term.runs else runs[0]
        builder = CaseBuilder(used.study)
        for condition in used.conditions:
            case = builder.case({**condition.settings, **tuning.settings({})})
            if case.shared_key not in known:
                known[case.shared_key] = _columns(case)
            allowed = (LIMIT, *known[case.shared_key])
            if term.figure not in allowed:
                message = f"unknown figure '{term.figure}'; allowed: {listing(allowed)}"
                place: Place = ("tune", direction, number, "figure")
                yield tuning.document.problem(place, message, suggest(term.figure, allowed))
                break


def _columns(case: Case) -> tuple[str, ...]:
    """The columns of a case's results that a figure can be, known without a run."""
    plan = plan_of(case)
    commands = plan.controller(case.controller).commands
    return (*plan.judge.units, *(f"{RMS}{name}" for name in commands))


def _placed(tuning: Tuning, condition: Condition, problem: Problem) -> Problem:
    """A problem with a place in the file of the tuning, if it has none of its own."""
    if problem.file:
        return problem
    fallback: Place = ("tune", tuning.spec.target)
    place = next((at for path, at in condition.places.items() if problem.where.startswith(path)), fallback)
    return replace(tuning.document.problem(place, problem.message, problem.hint), where=problem.where)
