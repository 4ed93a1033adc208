"""The search on objectives in closed form: it finds the optimum, and goes on as if it had never stopped."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from circuitkit.base.errors import CircuitkitError, InputError, SimulationError
from circuitkit.base.units import parse_quantity
from circuitkit.study.identity import identity_of
from circuitkit.study.tuning.objective import Score
from circuitkit.study.tuning.search import Candidate, History, Search, run_search, silence_optuna
from circuitkit.study.tuning.space import Searched

PARAMETERS = {
    "w": Searched.model_validate({"from": "-2 deg", "to": "2 deg"}),
    "leak": Searched.model_validate({"from": "1 %", "to": "100 %", "log": True}),
}
OPTIMUM = {"w": math.radians(0.6), "leak": 0.05}
START = {"w": -1.0, "leak": 40.0}  # in the units of the ranges


@pytest.fixture(autouse=True)
def _quiet():
    silence_optuna(verbose=False)


def bowl(candidate: Candidate) -> float:
    """How far a candidate is from the optimum, squared, in parts of the ranges."""
    w, leak = (parse_quantity(candidate[name]).value_si for name in ("w", "leak"))
    along = (w - OPTIMUM["w"]) / math.radians(4.0)
    across = math.log(leak / OPTIMUM["leak"]) / math.log(100.0)
    return along**2 + (across + 0.5 * along) ** 2


def measured(sign: float = 1.0) -> Callable[[Sequence[Candidate]], list[Score | CircuitkitError]]:
    return lambda candidates: [Score(sign * bowl(each), (bowl(each),), 1) for each in candidates]


def search(sampler: str = "cmaes", **keys: object) -> Search:
    given = {"start": START, "seed": 1, "maximise": False, "generation": 6} | keys
    return Search("bowl", PARAMETERS, sampler=sampler, **given)


def database(folder: Path, name: str = "trials") -> str:
    return f"sqlite:///{folder / name}.db"


@pytest.mark.parametrize(("sampler", "trials", "near"), [("cmaes", 61, 2e-3), ("tpe", 31, 0.02)])
def test_the_optimum_is_found(tmp_path, sampler, trials, near):
    found = run_search(search(sampler), database(tmp_path), trials, measured())
    assert len(found.trials) == trials
    assert found.trials[0].settings == {"w": "-1 deg", "leak": "40 %"}  # the start goes first
    assert bowl(found.best.settings) == found.best.value < near < bowl(found.trials[0].settings)


def test_maximising_is_minimising_the_opposite(tmp_path):
    least = run_search(search(), database(tmp_path, "a"), 7, measured())
    most = run_search(search(maximise=True), database(tmp_path, "b"), 7, measured(-1.0))
    assert [each.settings for each in least.trials] == [each.settings for each in most.trials]
    assert least.best.number == most.best.number


def stopped_now_and_then(url: str, sampler: str) -> History:
    """25 candidates, ended by --trials in a generation, by Ctrl-C, and by a failure of the machine."""

    def interrupted(error: type[BaseException]) -> Callable[[Sequence[Candidate]], list[Score]]:
        def evaluate(_: Sequence[Candidate]) -> list[Score]:
            raise error

        return evaluate

    run_search(search(sampler), url, 4, measured())
    run_search(search(sampler), url, 13, measured(), resume=True)
    assert run_search(search(sampler), url, 24, interrupted(KeyboardInterrupt), resume=True).interrupted
    with pytest.raises(MemoryError):
        run_search(search(sampler), url, 24, interrupted(MemoryError), resume=True)
    return run_search(search(sampler), url, 24, measured(), resume=True)


@pytest.mark.parametrize("sampler", ["cmaes", "tpe"])
def test_a_search_that_was_stopped_goes_on_as_if_it_had_not_been(tmp_path, sampler):
    at_one_go = run_search(search(sampler), database(tmp_path, "a"), 25, measured())
    assert stopped_now_and_then(database(tmp_path, "b"), sampler).trials == at_one_go.trials


def test_another_seed_searches_elsewhere(tmp_path):
    first = run_search(search(), database(tmp_path, "a"), 7, measured())
    other = run_search(search(seed=2), database(tmp_path, "b"), 7, measured())
    assert first.trials[0] == other.trials[0]
    assert all(a.settings != b.settings for a, b in zip(first.trials[1:], other.trials[1:], strict=True))


def test_candidates_that_fail_are_kept_with_the_reason_and_passed_over(tmp_path):
    def evaluate(candidates: Sequence[Candidate]) -> list[Score | CircuitkitError]:
        failure = SimulationError("too far to the left")
        return [failure if bowl(each) > 0.05 else Score(bowl(each), (), 1) for each in candidates]

    nearer = search(generation=12, start={"w": 0.5, "leak": 5.0})
    found = run_search(nearer, database(tmp_path), 13, evaluate)
    failed = [each for each in found.trials if each.value is None]
    assert failed
    assert {each.error for each in failed} == {"too far to the left"}
    assert all(each.value is None or each.value <= 0.05 for each in found.trials)
    assert found.best.value is not None


def test_if_all_fail_the_reason_is_told(tmp_path):
    failure = SimulationError("no robot")
    with pytest.raises(SimulationError, match="no robot"):
        run_search(search(), database(tmp_path), 7, lambda candidates: [failure] * len(candidates))


def test_a_search_is_not_begun_twice_nor_resumed_with_another_objective(tmp_path):
    one, other = (identity_of({"seed": n}, {"tune": {"seed": n}}, ()) for n in (1, 2))
    run_search(search(identity=one), database(tmp_path), 3, measured())
    with pytest.raises(InputError, match=r"found a study 'bowl' in .* already; go on with it by --resume"):
        run_search(search(identity=one), database(tmp_path), 3, measured())
    with pytest.raises(InputError, match="was begun with something else: tune: seed was 1, is 2; undo that"):
        run_search(search(identity=other), database(tmp_path), 3, measured(), resume=True)


@pytest.mark.parametrize("url", ["nonsense", "nonsense:///x", "sqlite:////no/such/folder/x.db"])
def test_a_storage_that_cannot_be_opened_is_refused(url):
    with pytest.raises(InputError, match=f"--storage: cannot open '{url}'"):
        run_search(search(), url, 3, measured())


def test_the_generation_follows_the_dimensions():
    assert search(generation=None).size == 4 + 2  # 3 ln 2 = 2.08
    assert search("tpe", generation=None).size == 10
