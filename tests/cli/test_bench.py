"""`circuitkit bench`."""

from __future__ import annotations

import json

import pytest

from circuitkit.study.bench import Case


@pytest.fixture(autouse=True)
def cases(monkeypatch):
    two = (
        Case("engine step", "plain loop", lambda: (lambda: None, lambda: None), limit=2.0),
        Case("closed loop", "bare physics", lambda: (lambda: None, lambda: None)),
    )
    monkeypatch.setattr("circuitkit.study.bench.shipped_cases", lambda: two)
    monkeypatch.setattr("circuitkit.study.bench.ROUND_S", 1e-4)


def test_a_line_for_each_case(circuitkit):
    outcome = circuitkit("bench", "--rounds", "2")
    assert (outcome.code, outcome.err) == (0, "")
    assert "engine step" in outcome.out
    assert "bare physics" in outcome.out


def test_json_has_the_keys_of_the_contract(circuitkit):
    rows = json.loads(circuitkit("bench", "loop", "--rounds", "2", "--json").out)
    assert [list(row) for row in rows] == [["case", "seconds", "ratio", "against", "limit"]]
    assert (rows[0]["case"], rows[0]["against"], rows[0]["limit"]) == ("closed loop", "bare physics", None)
    assert rows[0]["ratio"] > 0


def test_an_unknown_case_is_wrong_input(circuitkit):
    outcome = circuitkit("bench", "engin stepp")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == (
        "unknown benchmark 'engin stepp'; allowed: engine step, closed loop; did you mean 'engine step'?\n"
    )
