"""The benchmarks' stop-watch."""

from __future__ import annotations

import time

import pytest

from circuitkit.errors import CircuitkitError, UnknownNameError
from circuitkit.study.bench import Case, measure, select, shipped_cases


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


def test_shipped_benchmarks_are_prepared_without_error():
    cases = shipped_cases()
    assert len({case.name for case in cases}) == len(cases) > 0
    for case in cases:
        measured, reference = case.prepare()
        measured()
        reference()


def test_without_a_checkout_the_message_says_where_they_are(tmp_path):
    with pytest.raises(CircuitkitError, match=r"^found no benchmarks in .*: they are part of the repository"):
        shipped_cases(tmp_path / "benchmarks")
