"""Studies and tunings of robots that do not walk: their own measures judge, fill tables and are searched."""

from __future__ import annotations

import math

import pytest

from circuitkit.base.errors import CircuitkitError, InputError, UnknownNameError
from circuitkit.simulation import RunSpec, load_scenario, make_plan, simulate
from circuitkit.simulation.loop import run_loop
from circuitkit.study import CaseBuilder, make_study, open_workers, run_cases, sweep
from circuitkit.study.tuning.measure import Measure
from circuitkit.study.tuning.run import check
from circuitkit.study.tuning.spec import load_tuning

PUSH = {"body": "cart", "force": "1 N", "direction": "forward", "duration": "200 ms", "start": "0.5 s"}
POLE = {
    "study": "pole",
    "scenario": "cartpole_balances",
    "set": {"push": [PUSH], "measures.near": "max(abs(cart)) < 30 cm"},
    "watch": "1.5 s",
    "seeds": {"count": 2},
}


def by_hand(force_n: float) -> tuple[dict, ...]:
    """The measures of both seeds, from recordings."""
    scenario = load_scenario("cartpole_balances")
    case = CaseBuilder(make_study(POLE)).case()
    push = case.scenario.pushes[0].model_copy(update={"force": force_n})
    kept = [each for each in scenario.befalling if each.kind != "push"]
    changed = scenario.with_disturbances((*kept, push)).model_copy(update={"duration": 2.2})
    plan = make_plan(changed)
    specs = [RunSpec(seed, changed.befalling) for seed in range(2)]
    return run_loop(plan.setup(plan.controller(), specs)).measures


def test_a_run_ends_so_long_after_its_push_and_a_row_has_the_scenarios_measures(tmp_path):
    results = sweep(make_study(POLE), tmp_path, workers=1, progress=False)
    expected = by_hand(1.0)
    for row, measures in zip(results.rows, expected, strict=True):
        assert measures.items() <= row.items()
        assert row["near"] == (row["furthest"] < 0.3)
        assert row["rms_force"] > 0.0
    assert results.table.schema.field("near").type == "bool"
    (share,) = results.shares()
    assert (share.survived, share.runs) == (2, 2)
    assert share.means["furthest"] == pytest.approx(sum(each["furthest"] for each in expected) / 2)
    (near,) = results.shares(condition="near")
    assert near.survived == sum(row["near"] for row in results.rows)
    with pytest.raises(UnknownNameError, match=r"^unknown measure 'nearr'; .*; did you mean 'near'\?$"):
        results.shares(condition="nearr")
    with pytest.raises(CircuitkitError, match=r"^found the measure 'furthest', which is a number; allowed: "):
        results.shares(condition="furthest")


def test_the_search_goes_on_while_a_measure_of_ones_own_holds(tmp_path):
    search = {"field": "push.force", "low": "0 N", "high": "20 N", "step": "5 N", "while": "near"}
    (limit,) = sweep(make_study({**POLE, "search": search}), tmp_path, workers=1, progress=False).limits()
    held = {
        force: all(each["furthest"] < 0.3 for each in by_hand(force))
        for force in (0.0, 5.0, 10.0, 15.0, 20.0)
    }
    first = next(force for force, all_near in held.items() if not all_near)
    assert first > 0.0
    assert (limit.largest, limit.fails_at) == (first - 5.0, first)


def test_a_condition_that_is_not_known_has_neither_held_nor_failed(tmp_path):
    """`late` has no value: no run comes to its window."""
    search = {"field": "push.force", "low": "0 N", "high": "5 N", "step": "5 N", "while": "late"}
    late = {**POLE["set"], "measures.late": "last(after(cart < 9 m, 900 s))"}
    results = sweep(make_study({**POLE, "set": late, "search": search}), tmp_path, workers=1, progress=False)
    assert {row["late"] for row in results.rows} == {None}
    (limit,) = results.limits()
    assert (limit.survived, limit.runs, limit.fails_at, limit.unknown_at) == (0, 0, None, 0.0)
    (share, *_) = results.shares(condition="late")
    assert (share.survived, share.runs, share.unknown, share.invalid) == (0, 0, 4, 0)


@pytest.mark.parametrize(
    ("condition", "error", "message"),
    [
        ("neer", UnknownNameError, "unknown measure 'neer'; allowed: .*; did you mean 'near'"),
        ("furthest", CircuitkitError, "'furthest', which is a number; allowed: one that is true or false"),
    ],
)
def test_what_is_no_condition_cannot_be_searched(tmp_path, condition, error, message):
    search = {"field": "push.force", "low": "0 N", "high": "1 N", "step": "1 N", "while": condition}
    with pytest.raises(error, match=message):
        sweep(make_study({**POLE, "search": search}), tmp_path, workers=1, progress=False)


def test_an_axis_with_the_name_of_a_measure_is_refused(tmp_path):
    study = make_study({**POLE, "axes": {"furthest": {"a": {}}}})
    with pytest.raises(
        InputError, match=r"^axes\.furthest: found an axis .furthest., which is a measure of the scenario"
    ):
        sweep(study, tmp_path, workers=1, progress=False)


def test_weak_motors_and_other_floors_are_paths_too():
    settings = {"actuator.strength": "50 %", "body.mass": "120 %", "slope.forward": "1 deg"}
    with open_workers(1) as workers:
        ((weak, _), (strong, _)) = run_cases(make_study(POLE), [settings, {}], range(2), workers)
    assert weak.values["furthest"] != strong.values["furthest"]


TUNING = """\
study: pole
scenario: cartpole_balances
set: {push: [], duration: 1 s}
tune:
  circuit: cartpole_balance
  parameters: {slope: {from: 1, to: 3}}
  minimise: {figure: lean, is: "max(abs(pole))", unit: deg}
  runs: {all: {}}
  train: {seeds: {first: 0, count: 2}}
  test: {seeds: {first: 5, count: 1}}
  sampler: tpe
  result: mine
"""


def test_a_tuning_may_name_an_expression_of_its_own(tmp_path):
    path = tmp_path / "pole.yaml"
    path.write_text(TUNING)
    tuning = load_tuning(path)
    runs = tuning.runs("train")
    check(tuning, runs)
    with open_workers(1) as workers:
        (score,) = Measure(tuning, runs, workers)([{}])
    scenario = load_scenario("cartpole_balances")
    calm = [each for each in scenario.befalling if each.kind != "push"]
    changed = scenario.with_disturbances(tuple(calm)).model_copy(update={"duration": 1.0})
    plan = make_plan(changed)
    recorded = run_loop(
        plan.setup(plan.controller(), [RunSpec(seed, changed.befalling) for seed in range(2)])
    )
    leans = [math.degrees(each["largest_lean"]) for each in recorded.measures]
    assert score.value == pytest.approx(sum(leans) / 2, rel=1e-12)


def test_the_noise_in_a_circuit_follows_from_the_runs_seed_and_not_from_its_place_in_the_batch():
    settings = {"push": [], "duration": "0.5 s", "circuit.right.noise": 0.1}
    study = make_study(POLE)
    with open_workers(1) as workers:
        (together,) = run_cases(study, [settings], range(3), workers)
        alone = [run_cases(study, [settings], [seed], workers)[0][0] for seed in range(3)]
    assert list(together) == alone
    assert len({outcome.values["furthest"] for outcome in together}) == 3


def test_no_measure_has_the_name_of_another_column(tmp_path):
    scenario = load_scenario("cartpole_balances").with_disturbances([]).model_copy(update={"duration": 0.1})
    measured = simulate(scenario).measures.keys() | {"near"}
    columns = set(sweep(make_study(POLE), tmp_path, workers=1, progress=False).table.column_names)
    for name in sorted((columns | simulate(scenario).row().keys() | {"outcome"}) - measured):
        measures = {"measures.near": "max(cart)", f"measures.{name}": "max(cart)"}
        study = make_study({**POLE, "set": {"push": [PUSH], **measures}})
        with pytest.raises(InputError, match=f"found a measure '{name}', which is a column of the results"):
            sweep(study, tmp_path / name, workers=1, progress=False)
