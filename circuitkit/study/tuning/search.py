"""The search: Optuna proposes a generation of candidates, all of them are measured together, and it is told.

Everything that the samplers know is in Optuna's storage, and each candidate is drawn by a seed of its own, so
a search that was stopped goes on as if it had not been: candidates that were proposed and never measured are
measured first, then the next ones are proposed as they would have been.
"""

from __future__ import annotations

import importlib
import json
import math
import sqlite3
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from circuitkit.base.errors import (
    CircuitkitError,
    InputError,
    MissingDependencyError,
    Problem,
    SimulationError,
)
from circuitkit.study.identity import Identity, unpacked
from circuitkit.study.tuning.objective import Score
from circuitkit.study.tuning.space import Searched, texts
from circuitkit.study.workers import whole

try:
    import optuna
    from optuna.trial import FrozenTrial, TrialState

    importlib.import_module("cmaes")  # which Optuna would miss only later
except ImportError as missing:  # an extra
    raise MissingDependencyError(missing.name or "optuna", "tune", "tuning") from missing

Candidate = Mapping[str, str]
Evaluate = Callable[[Sequence[Candidate]], Sequence[Score | CircuitkitError]]

_IDENTITY = "circuitkit:identity"
_KNOWN = "circuitkit:measured"
_NOBODY = Identity("", {}, {})
_TPE_GENERATION = 10
_FIXED = "fixed_params"  # how Optuna marks a trial that was put into its queue


@dataclass(frozen=True)
class Search:
    """What is searched, and how.

    Attributes:
        name: Name of the study in the storage.
        parameters: What is searched, by name.
        start: The first candidate, as values of the distributions; empty for none.
        sampler: `cmaes` or `tpe`.
        seed: Of the sampler.
        maximise: Whether more is better.
        generation: How many candidates are measured together; None for the sampler's own number.
        spread: For `cmaes`: standard deviation of the first generation, as a share of the ranges.
        identity: All that determines the search; it only resumes with the same.
    """

    name: str
    parameters: Mapping[str, Searched]
    start: Mapping[str, Any]
    sampler: Literal["cmaes", "tpe"]
    seed: int
    maximise: bool
    generation: int | None = None
    spread: float = 1.0 / 6.0
    identity: Identity = _NOBODY

    @property
    def size(self) -> int:
        """How many candidates are measured together; CMA-ES: 4 + 3 ln n by default (Hansen 2016, eq. 48)."""
        if self.generation is not None:
            return self.generation
        dimensions = len(self.parameters)
        return 4 + math.floor(3 * math.log(dimensions)) if self.sampler == "cmaes" else _TPE_GENERATION

    def rounded(self, trials: int) -> int:
        """So many candidates, and then to the end of the generation; the start goes with the first one."""
        first = 1 if self.start else 0
        return first + max(1, math.ceil((trials - first) / self.size)) * self.size


@dataclass(frozen=True)
class Trial:
    """A candidate that was measured.

    Attributes:
        number: From 0, in the order of being proposed.
        settings: Its values, as texts.
        value: The objective; None if it could not be measured.
        figures: The figures of the objective's terms.
        runs: How many runs they were taken of.
        error: Why it could not be measured; else empty.
    """

    number: int
    settings: Candidate
    value: float | None
    figures: tuple[float, ...]
    runs: int = 0
    error: str = ""


@dataclass(frozen=True)
class History:
    """What a search has measured so far.

    Attributes:
        trials: The candidates that were measured, in the order of being proposed.
        maximise: Whether more is better.
        interrupted: Whether Ctrl-C ended it.
    """

    trials: tuple[Trial, ...]
    maximise: bool
    interrupted: bool = False

    def ranking(self) -> list[Trial]:
        """The candidates, best first, each once; of equally good ones the earlier one."""
        sign = -1.0 if self.maximise else 1.0
        order = sorted(
            (each for each in self.trials if each.value is not None),
            key=lambda each: (sign * (each.value or 0.0), each.number),
        )
        unique: dict[str, Trial] = {}
        for each in order:
            unique.setdefault(json.dumps(dict(each.settings)), each)
        return list(unique.values())

    @property
    def best(self) -> Trial:
        """The best candidate.

        Raises:
            SimulationError: None could be measured.
        """
        ranking = self.ranking()
        if not ranking:
            reasons = "; ".join(dict.fromkeys(each.error for each in self.trials if each.error))
            message = f"no candidate could be measured{f': {reasons}' if reasons else ''}"
            raise SimulationError(message)
        return ranking[0]


def run_search(
    search: Search,
    storage: str,
    trials: int,
    evaluate: Evaluate,
    *,
    resume: bool = False,
    folder: Path | None = None,
    before: Callable[[History, int], object] | None = None,
) -> History:
    """Search until so many candidates have been measured, those of earlier runs included.

    A generation is always measured as a whole. Ctrl-C ends it early; what has been measured is kept.

    Args:
        search: What is searched.
        storage: URL of a database, such as `sqlite:///out/trials.db`.
        trials: After how many candidates no generation is begun; see `Search.rounded`.
        evaluate: Measures candidates together.
        resume: Go on with what the storage has, instead of refusing it.
        folder: Where the storage lies, if it is the folder that the user named, not the storage.
        before: Gets what has been measured before each generation, and how many candidates that has; 0 at
            the end.

    Raises:
        InputError: The storage has a study of this name already, or one with another definition; or it cannot
            be opened.
        CircuitkitError: All candidates of a generation fail: the first reason.
    """
    study = _open(search, storage, folder, resume=resume)
    proposer = _Proposer(search, study)
    history = _history(search, study)
    try:
        while generation := whole(partial(proposer.propose, trials)):
            if before is not None:
                before(history, len(generation))
            scores = evaluate([texts(search.parameters, trial.params) for trial in generation])
            whole(partial(_keep_all, search, study, generation, scores))
            history = _history(search, study)
            failures = [score for score in scores if isinstance(score, CircuitkitError)]
            if len(failures) == len(generation):
                raise failures[0]
    except KeyboardInterrupt:
        return History(_history(search, study).trials, search.maximise, interrupted=True)
    if before is not None:
        before(history, 0)
    return history


def _open(search: Search, storage: str, folder: Path | None, *, resume: bool) -> optuna.Study:
    """The study in its storage, new or to be resumed."""
    from sqlalchemy.exc import SQLAlchemyError  # comes with Optuna

    other = "storage" if folder is None else "folder"
    direction: Literal["maximize", "minimize"] = "maximize" if search.maximise else "minimize"
    try:
        database = _database(storage)
        names = optuna.get_all_study_names(database)
        resume = resume or _is_untouched(search, database, names)
        if search.name in names and not resume:
            option, place = ("--storage", storage) if folder is None else ("--output", f"'{folder}'")
            message = f"found a study '{search.name}' in {place} already"
            hint = f"go on with it by --resume, or choose another {other}"
            raise InputError(Problem("", 0, 0, option, message, hint))
        study = optuna.create_study(
            storage=database, study_name=search.name, direction=direction, load_if_exists=resume
        )
    except (ImportError, SQLAlchemyError, ValueError) as error:  # no driver, no database, no URL
        message = (
            f"cannot open '{storage}': {str(error).splitlines()[0]}; allowed: a URL such as sqlite:///x.db"
        )
        raise InputError(Problem("", 0, 0, "--storage", message)) from error
    before = study.user_attrs.get(_IDENTITY)
    if before is None and not study.get_trials(deepcopy=False):
        study.set_user_attr(_IDENTITY, search.identity.packed())
        if search.start:
            study.enqueue_trial(dict(search.start))
    elif difference := search.identity.differences(unpacked(before)):
        message = f"the study '{search.name}' was begun with something else: {difference}"
        hint = f"undo that, or begin anew in another {other}"
        raise InputError(Problem("", 0, 0, "--resume", message, hint))
    return study


def _is_untouched(search: Search, database: optuna.storages.RDBStorage, names: Sequence[str]) -> bool:
    """Whether the study was stopped before any candidate was measured, and is still the same."""
    if search.name not in names:
        return False
    study = optuna.load_study(study_name=search.name, storage=database)
    before = study.user_attrs.get(_IDENTITY)
    same = before is None or not search.identity.differences(unpacked(before))
    return same and not _history(search, study).trials


def _database(url: str) -> optuna.storages.RDBStorage:
    """The storage of a URL; SQLite with a log instead of a flush to the disk a value."""
    if not url.startswith("sqlite:"):
        return optuna.storages.RDBStorage(url)

    class Connection(sqlite3.Connection):
        def __init__(self, *arguments: Any, **options: Any) -> None:  # noqa: ANN401 - as sqlite3 declares it
            super().__init__(*arguments, **options)
            self.execute("PRAGMA journal_mode=WAL")
            self.execute("PRAGMA synchronous=NORMAL")

    return optuna.storages.RDBStorage(url, engine_kwargs={"connect_args": {"factory": Connection}})


class _Cmaes(optuna.samplers.CmaEsSampler):
    """Optuna's CMA-ES from the first generation on, where it would draw the first candidate at random."""

    def __init__(self, search: Search, space: Mapping[str, Any], seed: int) -> None:
        start = dict(search.start) or None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # x0 and sigma0 go away with Optuna 6, margins are experimental
            super().__init__(
                x0=start,
                sigma0=search.spread,
                n_startup_trials=0,
                popsize=search.size,
                seed=seed,
                with_margin=any(each.whole for each in search.parameters.values()),
            )
        self._space = dict(space)
        self._seed = seed

    def _init_optimizer(self, *arguments: Any) -> Any:  # noqa: ANN401 - as Optuna declares it
        """The first state of CMA-ES; what is drawn then shall not depend on whether this was asked for."""
        optimizer = super()._init_optimizer(*arguments)
        self._cma_rng.rng.seed(self._seed)
        return optimizer

    def infer_relative_search_space(self, study: optuna.Study, trial: FrozenTrial) -> dict[str, Any]:
        """Everything, but for the start, which is no member of a generation."""
        del study
        return {} if _FIXED in trial.system_attrs else self._space


class _Proposer:
    """Asks Optuna for candidates, a generation at a time."""

    def __init__(self, search: Search, study: optuna.Study) -> None:
        self._search, self._study = search, study
        self._space = {name: each.distribution() for name, each in search.parameters.items()}

    def propose(self, trials: int) -> list[FrozenTrial]:
        """The candidates of the next generation: those that nobody has measured yet, and new ones.

        Args:
            trials: After how many measured candidates no generation is begun.
        """
        study = self._study
        running, finished, complete = [], 0, 0
        for trial in study.get_trials(deepcopy=False):
            if trial.state == TrialState.RUNNING and set(trial.params) != set(self._space):
                study.tell(trial.number, state=TrialState.FAIL)  # the end came while it was being proposed
                finished += 1
            elif trial.state == TrialState.RUNNING:
                running.append(trial)
            elif trial.state != TrialState.WAITING:
                finished += 1
                complete += trial.state == TrialState.COMPLETE
        new = self._end_of_generation(complete) - complete - len(running) if finished < trials else 0
        if new <= 0:
            return running
        number = finished + len(running)
        for each in range(number, number + new):
            study.sampler = self._sampler(each)
            study.ask(self._space)
        return study.get_trials(deepcopy=False, states=(TrialState.RUNNING,))

    def _end_of_generation(self, complete: int) -> int:
        """How many candidates are complete once this generation is; the start goes with the first one."""
        first = 1 if self._search.start else 0
        generations = max(complete - first, 0) // self._search.size
        return first + (generations + 1) * self._search.size

    def _sampler(self, number: int) -> optuna.samplers.BaseSampler:
        """The sampler for a candidate, with a seed of its own; all that it knows is in the storage."""
        seed = int(np.random.SeedSequence([self._search.seed, number]).generate_state(1)[0])
        if self._search.sampler == "cmaes":
            return _Cmaes(self._search, self._space, seed)
        return optuna.samplers.TPESampler(seed=seed)


def _keep_all(
    search: Search,
    study: optuna.Study,
    generation: Sequence[FrozenTrial],
    scores: Sequence[Score | CircuitkitError],
) -> None:
    """Keep the scores of a generation."""
    for trial, score in zip(generation, scores, strict=True):
        _keep(search, study, trial, score)


def _keep(search: Search, study: optuna.Study, trial: FrozenTrial, score: Score | CircuitkitError) -> None:
    """Keep the score of a candidate."""
    known: dict[str, Any] = {"settings": texts(search.parameters, trial.params)}
    value: float | None = None
    if isinstance(score, CircuitkitError):
        known["error"] = str(score)
    elif not math.isfinite(score.value):
        known["error"] = "the objective is not finite"
    else:
        value = score.value
        known |= {"figures": score.figures, "runs": score.runs}
    study._storage.set_trial_user_attr(trial._trial_id, _KNOWN, known)  # a FrozenTrial has no way to do it
    study.tell(trial.number, value, state=TrialState.FAIL if value is None else None)


def _history(search: Search, study: optuna.Study) -> History:
    trials = []
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.FAIL)):
        if known := trial.user_attrs.get(_KNOWN):
            figures, runs = tuple(known.get("figures", ())), known.get("runs", 0)
            error = known.get("error", "")
            trials.append(Trial(trial.number, known["settings"], trial.value, figures, runs, error))
    return History(tuple(sorted(trials, key=lambda each: each.number)), search.maximise)


def silence_optuna(*, verbose: bool) -> None:
    """Let Optuna log only where somebody asked for it."""
    optuna.logging.set_verbosity(optuna.logging.INFO if verbose else optuna.logging.ERROR)
