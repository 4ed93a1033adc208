"""`tune`: the file of a tuning in; a tuned circuit, controller or reference out, with its history."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from circuitkit.base.errors import CircuitkitError, InputError, Problem, UnitError, listing, suggest
from circuitkit.base.files import OutputError, make_folder
from circuitkit.base.output_folder import one_run
from circuitkit.base.reading import resolved
from circuitkit.base.source import Data, Place, find_data_file, read_yaml
from circuitkit.base.units import format_quantity
from circuitkit.circuit import load_circuit
from circuitkit.simulation.measures import CLAMPED, RMS
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case, plan_of
from circuitkit.study.identity import Identity, identity_of
from circuitkit.study.plain import plain
from circuitkit.study.tuning.history import draw_history, write_table
from circuitkit.study.tuning.lock import StudyLock
from circuitkit.study.tuning.measure import Measure, Progress, Reporter
from circuitkit.study.tuning.objective import LIMIT, Score
from circuitkit.study.tuning.result import folder_of, provenance, write_result
from circuitkit.study.tuning.runs import Condition, Runs
from circuitkit.study.tuning.search import History, Search, Trial, run_search, silence_optuna
from circuitkit.study.tuning.spec import CONFIRM, TEST, TRAIN, Tuning, load_tuning
from circuitkit.study.tuning.storage import Storage
from circuitkit.study.workers import Workers, open_workers

_ALL_DIGITS = 17
_DATABASE = "trials.db"


@dataclass(frozen=True)
class Tuned:
    """What a tuning has found.

    Attributes:
        history: The candidates.
        best: The one that was chosen.
        confirmed: What the runs say by which it was chosen among the best; None without such.
        test: What the test says of it; None if the search was ended early.
        start: The first candidate, if it could be measured.
        path: The tuned file.
        kept: What is kept and how to go on, if the search was ended early.
    """

    history: History
    best: Trial
    confirmed: Score | None
    test: Score | None
    start: Trial | None
    path: Path
    kept: str = ""

    def row(self) -> dict[str, Any]:
        """The result for JSON."""
        best = self.best
        return {
            "result": str(self.path),
            "trials": len(self.history.trials),
            "interrupted": self.history.interrupted,
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
    timeout_s: float | None = None,
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
        progress: Gets how far it is.
        timeout_s: How long a batch may take until its worker counts as stuck, [s]; see `open_workers`.

    Returns:
        What was found; after Ctrl-C, the best so far.

    Raises:
        InputError: The study is wrong; or there is one already, and it shall not be resumed.
        StorageError: Another process works on the study, or the database cannot be used.
        MissingDependencyError: Optuna or cmaes are not installed.
        KeyboardInterrupt: Ctrl-C came before any candidate was measured.
    """
    tuning = study if isinstance(study, Tuning) else load_tuning(study)
    folder = Path(folder)
    path = Path(result) if result is not None else folder / f"{tuning.spec.result}.yaml"
    if resolved(path) == resolved(_file_of(tuning)):
        message = f"found '{path}', the file that is tuned; allowed: another file"
        raise InputError(Problem("", 0, 0, "--result", message))
    parts = {part: tuning.runs(part) for part in tuning.parts()}
    check(tuning, parts[TRAIN])
    silence_optuna(verbose=verbose)
    search = _search(tuning, parts[TRAIN])
    total = search.rounded(trials or tuning.spec.trials)
    place = Storage(storage or _database(folder), None if storage else folder)
    make_folder(folder)
    own = (_DATABASE, f"{_DATABASE}-journal")
    with (
        one_run(folder, resumed=resume, own=own),
        StudyLock(place, search.name) as lock,
        open_workers(workers, scheduler, timeout_s) as opened,
    ):
        reporter = Reporter(total, progress, sign=lock.sign)
        measure = Measure(tuning, parts[TRAIN], opened, reporter.runs)
        history = run_search(search, place, total, measure, resume=resume, before=reporter.generation)
        if not any(trial.value is not None for trial in history.trials) and history.interrupted:
            raise KeyboardInterrupt(kept_in(history, place))
        history, best, confirmed, test = _chosen(tuning, history, parts, opened, reporter)
        write_table(tuning, history, folder / "trials.csv")
        for suffix in ("png", "pdf"):
            draw_history(tuning, history, best, search.size, folder / f"history.{suffix}")
        write_result(tuning, best.settings, provenance(tuning, history, best, confirmed, test), path)
    start = next((trial for trial in history.trials if trial.number == 0 and trial.value is not None), None)
    kept = kept_in(history, place) if history.interrupted else ""
    return Tuned(history, best, confirmed, test, start, path, kept)


def kept_in(history: History, place: Storage) -> str:
    """What a tuning that was stopped has kept, and how to go on."""
    count = len(history.trials)
    kept = "1 candidate is" if count == 1 else f"{count} candidates are"
    return f"{kept} kept in {place}; --resume (resume=True) goes on with the tuning"


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
    tuning: Tuning,
    history: History,
    parts: Mapping[str, tuple[Runs, ...]],
    workers: Workers,
    reporter: Reporter,
) -> tuple[History, Trial, Score | None, Score | None]:
    """The best candidate with what confirmation and test say of it, as far as Ctrl-C let them."""
    best, confirmed = history.best, None
    if history.interrupted:
        return history, best, None, None
    try:
        if tuning.spec.confirm is not None:
            reporter.stage = CONFIRM
            finalists = history.ranking()[: tuning.spec.confirm.best]
            scores = Measure(tuning, parts[CONFIRM], workers, reporter.runs)(
                [each.settings for each in finalists]
            )
            sign = -1.0 if history.maximise else 1.0
            sound = [(s, each) for s, each in zip(scores, finalists, strict=True) if isinstance(s, Score)]
            confirmed, best = min(sound, key=lambda pair: sign * pair[0].value, default=(None, best))
        reporter.stage = TEST
        (test,) = Measure(tuning, parts[TEST], workers, reporter.runs)([best.settings])
    except KeyboardInterrupt:
        return replace(history, interrupted=True), best, confirmed, None
    if isinstance(test, CircuitkitError):
        raise test
    return history, best, confirmed, test


def _database(folder: Path) -> str:
    """The URL of the database in a folder.

    Raises:
        OutputError: The folder's name is no text, which SQLite's names are.
    """
    from sqlalchemy import URL  # comes with Optuna

    path = str(resolved(folder) / _DATABASE)
    try:
        path.encode()
    except UnicodeEncodeError as error:
        message = f"cannot write to '{path}': its name is not UTF-8, as that of a database must be"
        raise OutputError(message) from error
    url = URL.create("sqlite", database=path)
    return url.render_as_string(hide_password=False)


def _search(tuning: Tuning, runs: Sequence[Runs]) -> Search:
    spec = tuning.spec
    return Search(
        name=tuning.file.study,
        parameters=spec.parameters,
        start=start_of(tuning),
        sampler=spec.sampler,
        seed=spec.seed,
        maximise=spec.maximise is not None,
        generation=spec.generation,
        spread=spec.spread,
        identity=_identity(tuning, runs),
    )


def _identity(tuning: Tuning, runs: Sequence[Runs]) -> Identity:
    """All that determines the search: what it depends on itself, and every condition of every set of runs."""
    definition = tuning.definition()
    cases = []
    for each in runs:
        builder = CaseBuilder(each.study)
        for condition in each.conditions:
            case = builder.case({**condition.settings, **tuning.settings({})})
            label = [each.name, plain(condition.cell), condition.factor, [*each.seeds]]
            cases.append((label, case.identity))
    return identity_of(definition, {"tune": definition}, cases)


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
    return (*plan.judge.units, CLAMPED, *(f"{RMS}{name}" for name in commands))


def _placed(tuning: Tuning, condition: Condition, problem: Problem) -> Problem:
    """A problem with a place in the file of the tuning, if it has none of its own."""
    if problem.is_placed:
        return problem
    fallback: Place = ("tune", tuning.spec.target)
    place = next((at for path, at in condition.places.items() if problem.where.startswith(path)), fallback)
    return replace(tuning.document.problem(place, problem.message, problem.hint), where=problem.where)


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
