from __future__ import annotations

import json
import math

import numpy as np
import pytest
from paper.reproduce.made_up import a_claim, a_finding, drawn

from circuitkit.paper.reproduce.finding import FINDING_FILE, Finding, Verdict, agrees, all_hold, reaches


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [
        (22.0, Verdict.HOLDS),
        (24.1, Verdict.HOLDS),
        (19.9, Verdict.HOLDS),
        (26.0, Verdict.PARTLY),
        (16.0, Verdict.PARTLY),
        (60.0, Verdict.FAILS),
        (0.0, Verdict.FAILS),
        (None, Verdict.FAILS),
        (math.nan, Verdict.FAILS),
    ],
)
def test_a_number_agrees_with_the_papers_within_a_part_of_it(ours, verdict):
    assert agrees(ours, 22.0, within=0.1) is verdict


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [
        (1.6, Verdict.HOLDS),
        (1.5255, Verdict.HOLDS),
        (1.2, Verdict.PARTLY),
        (1.0, Verdict.FAILS),
        (0.3, Verdict.FAILS),
        (math.inf, Verdict.HOLDS),
        (math.nan, Verdict.FAILS),
        (None, Verdict.FAILS),
    ],
)
def test_a_number_reaches_what_is_claimed_or_at_least_speaks_for_it(ours, verdict):
    assert reaches(ours, 1.5255, at_least=1.0) is verdict


def test_without_a_least_number_there_is_no_part():
    assert reaches(0.84, 0.85) is Verdict.FAILS
    assert reaches(0.85, 0.85) is Verdict.HOLDS


@pytest.mark.parametrize(
    ("parts", "verdict"),
    [
        ((True, True), Verdict.HOLDS),
        ((True, False), Verdict.PARTLY),
        ((False, False), Verdict.FAILS),
    ],
)
def test_several_things_hold_all_some_or_none(parts, verdict):
    assert all_hold(*parts) is verdict


def test_a_finding_comes_back_as_it_was_written(tmp_path):
    drawn(tmp_path)
    finding = a_finding(claims=(a_claim(), a_claim(Verdict.FAILS, why="the edge is near")))
    finding.save(tmp_path, version="1", quick=True)
    assert Finding.load(tmp_path) == (finding, {"version": "1", "quick": True})


def test_what_json_cannot_say_becomes_nothing(tmp_path):
    drawn(tmp_path)
    data = {"ratio": math.nan, "most": math.inf, "array": np.array([1.0, math.nan]), "one": np.float64(2.0)}
    a_finding(data=data).save(tmp_path)
    raw = json.loads((tmp_path / FINDING_FILE).read_text(encoding="utf-8"))
    assert raw["finding"]["data"] == {"ratio": None, "most": None, "array": [1.0, None], "one": 2.0}


def test_a_finding_without_its_picture_is_none(tmp_path):
    a_finding().save(tmp_path)
    assert Finding.load(tmp_path) is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"finding": {"claims": 3}}'])
def test_a_damaged_file_is_no_finding(tmp_path, text):
    (tmp_path / FINDING_FILE).write_text(text, encoding="utf-8")
    assert Finding.load(tmp_path) is None
