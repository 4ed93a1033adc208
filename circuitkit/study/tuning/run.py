"""`tune`: the file of a tuning in; a tuned circuit, controller or reference out, with its history."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from circuitkit.base.errors import CircuitkitError, InputError, Problem
from circuitkit.base.source import Place, find_data_file
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import fingerprint
from circuitkit.study.tuning.check import check
from circuitkit.study.tuning.history import draw_history, write_table
from circuitkit.study.tuning.measure import Measure, Progress, Reporter
from circuitkit.study.tuning.objective import Score
from circuitkit.study.tuning.result import folder_of, make_folder, provenance, write_result
from circuitkit.study.tuning.runs import Runs
from circuitkit.study.tuning.search import History, Search, Trial, run_search, silence_optuna
from circuitkit.study.tuning.spec import CONFIRM, TEST, TRAIN, Tuning, load_tuning
from circuitkit.study.tuning.start import start_of
from circuitkit.study.workers import Workers, open_workers


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
    """

    history: History
    best: Trial
    confirmed: Score | None
    test: Score | None
    start: Trial | None
    path: Path

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
        reporter = Reporter(total, progress)
        measure = Measure(tuning, parts[TRAIN], opened, reporter.runs)
        history = run_search(
            search,
            storage or _database(folder),
            total,
            measure,
            resume=resume,
            folder=None if storage else folder,
            before=reporter.generation,
        )
        if not any(trial.value is not None for trial in history.trials) and history.interrupted:
            raise KeyboardInterrupt
        best, confirmed, test = _chosen(tuning, history, parts, opened, reporter)
    write_table(tuning, history, folder / "trials.csv")
    for suffix in ("png", "pdf"):
        draw_history(tuning, history, best, search.size, folder / f"history.{suffix}")
    write_result(tuning, best.settings, provenance(tuning, history, best, confirmed, test), path)
    start = next((trial for trial in history.trials if trial.number == 0 and trial.value is not None), None)
    return Tuned(history, best, confirmed, test, start, path)


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
) -> tuple[Trial, Score | None, Score | None]:
    """The best candidate with what confirmation and test say of it, if the search was not ended early."""
    best, confirmed = history.best, None
    if history.interrupted:
        return best, None, None
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
