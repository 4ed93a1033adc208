"""The search: a round of candidates is proposed, all are measured together, and their scores are kept.

The storage holds what has been measured, and nothing that is under way: each candidate comes in with its
score, by one transaction. Candidates are a function of the seed and of what has been measured in the rounds
before. So a search goes on as if it had not been stopped, wherever that was: a round of which only a part is
kept is proposed again, and the rest of it is measured.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Literal

from circuitkit.base.errors import (
    CircuitkitError,
    InputError,
    MissingDependencyError,
    Problem,
    SimulationError,
    listing,
)
from circuitkit.study.identity import Identity, unpacked
from circuitkit.study.plain import digest
from circuitkit.study.tuning.objective import Score
from circuitkit.study.tuning.samplers import (
    Cmaes,
    OtherCandidateError,
    Sampler,
    Space,
    Told,
    Tpe,
    Values,
    require_same,
)
from circuitkit.study.tuning.space import Searched, texts
from circuitkit.study.tuning.storage import Storage, StorageError, opened, patiently

try:
    import optuna
    from optuna.trial import FrozenTrial, TrialState
except ImportError as missing:  # an extra
    raise MissingDependencyError(missing.name or "optuna", "tune", "tuning") from missing

Candidate = Mapping[str, str]
Evaluate = Callable[[Sequence[Candidate]], Sequence[Score | CircuitkitError]]

_IDENTITY = "circuitkit:identity"
_KNOWN = "circuitkit:measured"
_NOBODY = Identity("", {}, {})
_TPE_GENERATION = 10


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

    def rounds(self, told: Sequence[Told]) -> tuple[list[Sequence[Told]], int]:
        """What has been told, by rounds, the last of which may be a part or empty; and the size of that one.

        A round takes a generation to its end: it replaces the candidates that could not be measured.
        """
        found, complete = list[Sequence[Told]](), 0
        while True:
            size = self._end_of_generation(complete) - complete
            begun = sum(map(len, found))
            found.append(told[begun : begun + size])
            if len(found[-1]) < size:
                return found, size
            complete += sum(each.value is not None for each in found[-1])

    def _end_of_generation(self, complete: int) -> int:
        """How many candidates are complete once this generation is; the start goes with the first one."""
        first = 1 if self.start else 0
        generations = max(complete - first, 0) // self.size
        return first + (generations + 1) * self.size

    def proposes(self) -> Sampler:
        """Who proposes its candidates."""
        space = Space(self.parameters, self.start, self.seed, self.maximise)
        return Cmaes(space, self.size, self.spread) if self.sampler == "cmaes" else Tpe(space)


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
    storage: str | Storage,
    trials: int,
    evaluate: Evaluate,
    *,
    resume: bool = False,
    before: Callable[[History, int], object] | None = None,
) -> History:
    """Search until so many candidates have been measured, those of earlier runs included.

    A generation is always measured as a whole. Ctrl-C ends it early; what has been kept stays.

    Args:
        search: What is searched.
        storage: A database, or its URL, such as `sqlite:///out/trials.db`.
        trials: After how many candidates no generation is begun; see `Search.rounded`.
        evaluate: Measures candidates together.
        resume: Go on with what the storage has, instead of refusing it.
        before: Gets what has been measured before each generation, and how many candidates that has; 0 at
            the end.

    Raises:
        InputError: The storage has a study of this name already, or one with another definition; or it cannot
            be opened.
        CircuitkitError: All candidates of a generation fail: the first reason.
    """
    store = _Store(search, storage if isinstance(storage, Storage) else Storage(storage), resume=resume)
    try:
        while proposed := _propose(search, store, trials):
            if before is not None:
                before(store.history(), len(proposed))
            scores = evaluate([texts(search.parameters, values) for values in proposed])
            for values, score in zip(proposed, scores, strict=True):
                store.add(values, score)
            failures = [score for score in scores if isinstance(score, CircuitkitError)]
            if len(failures) == len(proposed):
                raise failures[0]
    except KeyboardInterrupt:
        store.read()
        return store.history(interrupted=True)
    if before is not None:
        before(store.history(), 0)
    return store.history()


def _propose(search: Search, store: _Store, trials: int) -> list[Values]:
    """The candidates that are measured next: a round, or what is missing of it; none if there are enough.

    Raises:
        InputError: What the storage holds is not what would be proposed.
    """
    (*rounds, begun), size = search.rounds(store.told)
    if not begun and len(store.told) >= trials:
        return []
    try:
        proposed = search.proposes()(rounds, size)
        require_same(search.parameters, sum(map(len, rounds)), begun, proposed)
    except OtherCandidateError as error:
        packages = listing(f"{name} {version(name)}" for name in ("cmaes", "numpy", "optuna"))
        message = (
            f"candidate {error.number} of the study '{search.name}' in {store.place} is not what its seed "
            f"proposes with {packages}"
        )
        hint = f"go on with the versions with which it was begun, or {store.place.anew}"
        raise InputError(Problem("", 0, 0, "--resume", message, hint)) from error
    return proposed[len(begun) :]


class _Store:
    """A study in its storage.

    Attributes:
        place: Where that is.
        told: What has been measured.
    """

    def __init__(self, search: Search, place: Storage, *, resume: bool) -> None:
        """Open it, new or to be resumed.

        Raises:
            InputError: It is there already, or has another definition; or the storage cannot be opened.
            StorageError: The storage cannot be used.
        """
        self._search, self.place = search, place
        self._space = {name: each.distribution() for name, each in search.parameters.items()}
        database = opened(place)
        direction: Literal["maximize", "minimize"] = "maximize" if search.maximise else "minimize"
        self._study = patiently(
            place,
            lambda: optuna.create_study(
                storage=database, study_name=search.name, direction=direction, load_if_exists=True
            ),
        )
        stored = patiently(place, lambda: self._study.user_attrs.get(_IDENTITY))
        self.read()
        different = "" if stored is None else search.identity.differences(unpacked(stored))
        if not resume and (different or self.told):
            message = f"found a study '{search.name}' in {place} already"
            hint = f"go on with it by --resume, or choose another {place.word}"
            raise InputError(Problem("", 0, 0, place.option, message, hint))
        if different or (stored is None and self.told):
            message = f"the study '{search.name}' was begun with something else: {different}"
            hint = f"undo that, or begin anew in another {place.word}"
            raise InputError(Problem("", 0, 0, "--resume", message, hint))
        if stored is None:
            patiently(place, lambda: self._study.set_user_attr(_IDENTITY, search.identity.packed()))

    def read(self) -> None:
        """Read what has been measured.

        Raises:
            StorageError: It cannot be read, or it is not what a search has written.
        """
        found = patiently(self.place, lambda: self._study.get_trials(deepcopy=False))
        kept = [self._kept(number, trial) for number, trial in enumerate(found)]
        self.told, self._trials = [told for told, _ in kept], [trial for _, trial in kept]

    def history(self, *, interrupted: bool = False) -> History:
        """What has been measured so far."""
        return History(tuple(self._trials), self._search.maximise, interrupted)

    def add(self, values: Values, score: Score | CircuitkitError) -> None:
        """Keep the score of the next candidate.

        Raises:
            StorageError: It cannot be written.
        """
        value: float | None = None
        known: dict[str, Any] = {"settings": texts(self._search.parameters, values)}
        if isinstance(score, CircuitkitError):
            known["error"] = str(score)
        elif not math.isfinite(score.value):
            known["error"] = "the objective is not finite"
        else:
            value = score.value
            known |= {"figures": list(score.figures), "runs": score.runs}
        number = len(self.told)
        trial = optuna.trial.create_trial(
            state=TrialState.FAIL if value is None else TrialState.COMPLETE,
            value=value,
            params=dict(values),
            distributions=self._space,
            user_attrs={_KNOWN: known | {"sum": _sum(number, values, value, known)}},
        )
        patiently(self.place, lambda: self._study.add_trial(trial))
        self.told.append(Told(values, value))
        self._trials.append(self._kept(number, trial)[1])

    def _kept(self, number: int, trial: FrozenTrial) -> tuple[Told, Trial]:
        """A candidate as it is stored."""
        known = trial.user_attrs.get(_KNOWN, {})
        value = trial.value if trial.state == TrialState.COMPLETE else None
        kept = {key: each for key, each in known.items() if key != "sum"}
        if not kept or known.get("sum") != _sum(number, trial.params, value, kept):
            message = (
                f"trial {number} of the study '{self._search.name}' in {self.place} is not what this version "
                f"of circuitkit has written; put a copy of the database back, or {self.place.anew}"
            )
            raise StorageError(message)
        figures, runs = tuple(kept.get("figures", ())), kept.get("runs", 0)
        found = Trial(number, kept["settings"], value, figures, runs, kept.get("error", ""))
        return Told(trial.params, value), found


def _sum(number: int, values: Values, value: float | None, known: Mapping[str, Any]) -> str:
    """Checksum of a candidate, for databases have none."""
    return digest([number, dict(sorted(values.items())), value, dict(sorted(known.items()))])


def silence_optuna(*, verbose: bool) -> None:
    """Let Optuna log only where somebody asked for it."""
    optuna.logging.set_verbosity(optuna.logging.INFO if verbose else optuna.logging.ERROR)
