"""`circuitkit bench`."""

from __future__ import annotations

import json
import re

import pytest

from circuitkit.study.bench import Amount, Case, LeftOutError


def left_out():
    message = "it is not installed"
    raise LeftOutError(message)


@pytest.fixture(autouse=True)
def cases(monkeypatch):
    two = (
        Case("engine step", "plain loop", lambda: (lambda: None, lambda: None), limit=2.0),
        Case("closed loop", "bare physics", lambda: (lambda: None, lambda: None)),
        Amount("load", "s", lambda: lambda: 0.25, limit=0.5),
        Amount("memory", "bytes a synapse", lambda: lambda: 30.0, limit=20),
        Case("peer", "another simulator", left_out),
    )
    monkeypatch.setattr("circuitkit.study.bench.shipped_cases", lambda: two)
    monkeypatch.setattr("circuitkit.study.bench.ROUND_S", 1e-4)


def test_a_line_for_each_case(circuitkit):
    outcome = circuitkit("bench", "--rounds", "2")
    assert (outcome.code, outcome.err) == (0, "left out: peer: it is not installed\n")
    assert "engine step" in outcome.out
    assert "bare physics" in outcome.out


def test_amounts_are_held_against_their_limits(circuitkit):
    out = circuitkit("bench", "load", "memory", "--rounds", "1").out
    assert re.search(r"load +0\.25 +0\.25 s +0\.5 s +ok", out)
    assert re.search(r"memory +30 bytes a synapse +20 bytes a synapse +short", out)


def test_json_has_the_keys_of_the_contract(circuitkit):
    rows = json.loads(circuitkit("bench", "loop", "--rounds", "2", "--json").out)
    assert [list(row) for row in rows] == [
        ["case", "seconds", "ratio", "against", "limit", "amount", "unit", "note", "ok"]
    ]
    assert (rows[0]["case"], rows[0]["against"], rows[0]["limit"]) == ("closed loop", "bare physics", None)
    assert rows[0]["ratio"] > 0


def test_an_unknown_case_is_wrong_input(circuitkit):
    outcome = circuitkit("bench", "engin stepp")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == (
        "unknown benchmark 'engin stepp'; allowed: engine step, closed loop, load, memory, peer; "
        "did you mean 'engine step'?\n"
    )
