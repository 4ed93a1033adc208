"""Who proposes candidates: CMA-ES as cmaes has it, and Optuna's TPE.

The candidates of a round are a function of the search's seed and of the rounds before it, with their scores.
No state of a sampler is kept anywhere: it follows from what has been told, however often a search is stopped.
"""

from __future__ import annotations

import copy
import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import MissingDependencyError
from circuitkit.study.tuning.space import Searched, texts

try:
    import optuna

    cmaes = importlib.import_module("cmaes")
except ImportError as missing:  # an extra
    raise MissingDependencyError(missing.name or "optuna", "tune", "tuning") from missing

Values = Mapping[str, Any]  # of the distributions, by name
_LEAST_SPREAD = 1e-10  # cmaes divides by it
_RESAMPLINGS = 10  # times the dimensions: how often CMA-ES draws again what is out of range


@dataclass(frozen=True)
class Told:
    """A candidate that was measured.

    Attributes:
        values: Its values.
        value: The objective; None if it could not be measured.
    """

    values: Values
    value: float | None


class OtherCandidateError(LookupError):
    """A candidate that was told was not proposed by this sampler.

    Attributes:
        number: Its number.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def require_same(
    parameters: Mapping[str, Searched], first: int, told: Sequence[Told], proposed: Sequence[Values]
) -> None:
    """See whether what was told is what is proposed, from a candidate on and as far as it was told.

    Raises:
        OtherCandidateError: It is not.
    """
    for number, (old, new) in enumerate(zip(told, proposed, strict=False), first):
        if texts(parameters, old.values) != texts(parameters, new):
            raise OtherCandidateError(number)


@dataclass(frozen=True)
class Space:
    """What all samplers have to know.

    Attributes:
        parameters: What is searched.
        start: Candidate 0, which stands beside the generations; empty for none.
        seed: Of the search.
        maximise: Whether more is better.
    """

    parameters: Mapping[str, Searched]
    start: Values
    seed: int
    maximise: bool

    def seed_of(self, number: int) -> int:
        """The seed of a candidate."""
        return int(np.random.SeedSequence([self.seed, number]).generate_state(1)[0])

    def is_start(self, number: int) -> bool:
        """Whether this is the candidate beside the generations."""
        return number == 0 and bool(self.start)


class Sampler(Protocol):
    """Proposes a round of candidates."""

    def __call__(self, rounds: Sequence[Sequence[Told]], size: int) -> list[Values]:
        """The next candidates.

        Args:
            rounds: All rounds before, in order and whole.
            size: How many candidates are wanted. The first of all is the start.

        Raises:
            OtherCandidateError: What was told was not proposed by this sampler.
        """


class Cmaes:
    """CMA-ES in the unit cube, with margins where whole numbers are searched."""

    def __init__(self, space: Space, generation: int, spread: float) -> None:
        """Take a space.

        Args:
            space: What is searched; its start, or the middle of the ranges, begins the search.
            generation: How many candidates move the distribution.
            spread: Standard deviation of the first generation, in parts of the ranges.
        """
        self._space, self._generation = space, generation
        self._axes = {name: _Axis.of(each) for name, each in space.parameters.items()}
        size = len(self._axes)
        self._given: dict[str, Any] = {
            "mean": self._point(space.start) if space.start else np.full(size, 0.5),
            "sigma": max(spread, _LEAST_SPREAD),
            "bounds": np.array([[0.0, 1.0]] * size),
            "n_max_resampling": _RESAMPLINGS * size,
            "population_size": generation,
        }

    def __call__(self, rounds: Sequence[Sequence[Told]], size: int) -> list[Values]:
        """The next candidates; see `Sampler`.

        A candidate that could not be measured counts for nothing, so a generation may take several rounds.
        """
        optimizer = self._optimizer()
        # Drawing and copying change a covariance's last bits: both must always happen alike.
        untouched = copy.deepcopy(optimizer)
        members: list[tuple[NDArray[np.float64], float]] = []
        number = 0
        for each in rounds:
            asked = self._ask(optimizer, number, len(each))
            require_same(self._space.parameters, number, each, [values for values, _ in asked])
            for k, (told, (_, point)) in enumerate(zip(each, asked, strict=True), number):
                if told.value is not None and not self._space.is_start(k):
                    members.append((point, -told.value if self._space.maximise else told.value))
            number += len(each)
            if len(members) >= self._generation:
                optimizer = untouched
                optimizer.tell(members[: self._generation])
                members, untouched = [], copy.deepcopy(optimizer)
        return [values for values, _ in self._ask(optimizer, number, size)]

    def _optimizer(self) -> Any:  # noqa: ANN401 - cmaes.CMA or cmaes.CMAwM
        if not any(each.whole for each in self._axes.values()):
            return cmaes.CMA(**self._given)
        return cmaes.CMAwM(steps=np.array([each.step for each in self._axes.values()]), **self._given)

    def _ask(self, optimizer: Any, first: int, size: int) -> list[tuple[Values, NDArray[np.float64]]]:  # noqa: ANN401 - as above
        """Candidates from a number on, each with the point that cmaes is told of it."""
        found = []
        for number in range(first, first + size):
            if self._space.is_start(number):
                found.append((self._space.start, self._point(self._space.start)))
                continue
            legacy = np.random.RandomState(self._space.seed_of(number))
            optimizer.reseed_rng(legacy.randint(1, 2**16) + number)
            asked = optimizer.ask()
            unit = asked[0] if isinstance(asked, tuple) else asked
            each = zip(self._axes.items(), unit.tolist(), strict=True)
            values = {name: axis.value(x) for (name, axis), x in each}
            found.append((values, asked[1] if isinstance(asked, tuple) else self._point(values)))
        return found

    def _point(self, values: Values) -> NDArray[np.float64]:
        return np.array([axis.unit(values[name]) for name, axis in self._axes.items()])


@dataclass(frozen=True)
class _Axis:
    """A range as an edge of the unit cube.

    Attributes:
        low: Its smallest value.
        high: Its largest one.
        log: Whether the logarithm is searched.
        whole: Whether only whole numbers are searched.
    """

    low: float
    high: float
    log: bool
    whole: bool

    @classmethod
    def of(cls, searched: Searched) -> _Axis:
        """The edge of a range."""
        found: Any = searched.distribution()
        return cls(found.low, found.high, found.log, searched.whole)

    @property
    def step(self) -> float:
        """The distance of two whole numbers on the edge; 0 where all values may occur, or logarithms."""
        return 1 / (self.high - self.low) if self.whole and not self.log else 0.0

    @property
    def _ends(self) -> tuple[float, float]:
        return self._scaled(self.low), self._scaled(self.high)

    def _scaled(self, value: float) -> float:
        return math.log(value) if self.log else float(value)

    def unit(self, value: float) -> float:
        """Where a value stands, 0 to 1."""
        low, high = self._ends
        return (self._scaled(value) - low) / (high - low)

    def value(self, unit: float) -> float:
        """The value that stands there."""
        low, high = self._ends
        scaled = low + unit * (high - low)
        if self.whole:
            number = round(math.exp(scaled)) if self.log else math.floor(scaled - self.low + 0.5) + self.low
            return min(max(number, self.low), self.high)
        # Ranges are open above, as numbers that are drawn evenly are.
        most = float(np.nextafter(self.high, self.high - 1))
        value = math.exp(scaled) if self.log else scaled
        return min(max(value, self.low), most)


class Tpe:
    """Optuna's tree-structured Parzen estimator; each candidate is drawn with a seed of its own."""

    def __init__(self, space: Space) -> None:
        self._space = space
        self._distributions = {name: each.distribution() for name, each in space.parameters.items()}

    def __call__(self, rounds: Sequence[Sequence[Told]], size: int) -> list[Values]:
        """The next candidates; see `Sampler`."""
        study = optuna.create_study(direction="maximize" if self._space.maximise else "minimize")
        study.add_trials([self._trial(each) for some in rounds for each in some])
        first = sum(map(len, rounds))
        found: list[Values] = []
        for number in range(first, first + size):
            if self._space.is_start(number):
                study.enqueue_trial(dict(self._space.start))
            study.sampler = optuna.samplers.TPESampler(seed=self._space.seed_of(number))
            found.append(study.ask(self._distributions).params)
        return found

    def _trial(self, told: Told) -> optuna.trial.FrozenTrial:
        state = optuna.trial.TrialState.FAIL if told.value is None else optuna.trial.TrialState.COMPLETE
        return optuna.trial.create_trial(
            state=state, value=told.value, params=dict(told.values), distributions=self._distributions
        )
