"""The benchmarks' stop-watch."""

from __future__ import annotations

import time

import pytest

from circuitkit.base.errors import CircuitkitError, UnknownNameError
from circuitkit.study.bench import Amount, Case, LeftOutError, Loop, Timed, measure, select, shipped_cases


def sleeper(seconds):
    return lambda: time.sleep(seconds)


def test_the_ratio_is_that_of_the_times():
    case = Case("slow", "quick", lambda: (sleeper(0.006), sleeper(0.002)), limit=4.0)
    (row,) = measure([case], rounds=3)
    assert (row.case, row.against, row.limit) == ("slow", "quick", 4.0)
    assert row.seconds == pytest.approx(0.006, rel=0.5)
    assert row.ratio == pytest.approx(3, rel=0.5)


def test_cases_are_chosen_by_part_of_their_name():
    cases = [
        Case(name, "", lambda: (lambda: None, lambda: None))
        for name in ("engine: step", "engine: run", "loop")
    ]
    assert [case.name for case in select(cases, ["engine"])] == ["engine: step", "engine: run"]
    assert len(select(cases, [])) == 3
    with pytest.raises(UnknownNameError) as caught:
        select(cases, ["lopp"])
    assert str(caught.value) == (
        "unknown benchmark 'lopp'; allowed: engine: step, engine: run, loop; did you mean 'loop'?"
    )


def test_work_may_bring_its_own_loop_or_its_own_time():
    case = Case(
        "loop", "told", lambda: (Loop(lambda n: time.sleep(0.002 * n)), Timed(lambda: 0.004)), steps=2
    )
    (row,) = measure([case], rounds=3)
    assert row.ratio == pytest.approx(0.5, rel=0.5)
    assert row.seconds == pytest.approx(0.001, rel=0.5)


@pytest.mark.parametrize(("limit", "ok"), [(3.0, True), (2.0, False), (None, None)])
def test_an_amount_is_the_median_and_has_a_limit(limit, ok):
    values = iter([1.0, 9.0, 2.5])
    (row,) = measure([Amount("memory", "bytes", lambda: lambda: next(values), limit)], rounds=3)
    assert (row.amount, row.unit, row.ok, row.ratio, row.seconds) == (2.5, "bytes", ok, None, None)


def test_what_cannot_be_measured_is_left_out_with_a_note():
    def prepare():
        message = "Nengo is not installed"
        raise LeftOutError(message)

    (row,) = measure([Case("step", "Nengo", prepare, limit=1.0)])
    assert (row.note, row.ratio, row.ok) == ("Nengo is not installed", None, None)


def test_shipped_benchmarks_have_names_of_their_own():
    cases = shipped_cases()
    assert len({case.name for case in cases}) == len(cases) > 0


@pytest.mark.parametrize(
    "name", ["numpy: a call a step, ordered", "numpy: a batch of 100", "closed loop: 1 robot"]
)
def test_shipped_benchmarks_are_prepared_without_error(name):
    (case,) = (case for case in shipped_cases() if case.name == name)
    for work in case.prepare():
        work.times(1) if isinstance(work, Loop) else work()


def test_without_a_checkout_the_message_says_where_they_are(tmp_path):
    with pytest.raises(CircuitkitError, match=r"^found no benchmarks in .*: they are part of the repository"):
        shipped_cases(tmp_path / "benchmarks")
