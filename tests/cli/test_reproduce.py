"""`circuitkit reproduce` with figures that nothing is run for; what makes them has tests of its own."""

from __future__ import annotations

import json

import pytest
from paper.reproduce.made_up import made_up_figure

from circuitkit.paper.reproduce import FIGURES


@pytest.fixture(autouse=True)
def figures(monkeypatch):
    made = {"fig9": made_up_figure(9), "fig10": made_up_figure(10)}
    monkeypatch.setattr(FIGURES, "kinds", made)
    return made


def test_it_prints_the_claims_and_says_what_it_does(circuitkit, figures):
    outcome = circuitkit("reproduce", "-o", "out", "--quick", "--workers", "1")
    assert outcome.code == 0
    assert outcome.out.count("It stands") == 2
    assert "fig9 (1 of 2), about " in outcome.err
    assert "wrote out/report.html" in outcome.err
    assert (figures["fig9"].jobs[0].quick, figures["fig9"].jobs[0].workers) == (True, 1)


def test_as_json_each_claim_names_its_figure(circuitkit):
    outcome = circuitkit("reproduce", "fig10", "-o", "out", "--json")
    (claim,) = json.loads(outcome.out)
    assert claim["figure"] == "fig10"
    assert (claim["paper"], claim["ours"], claim["verdict"]) == ("22 N", "20 N", "holds")


def test_a_figure_that_there_is_not_is_refused(circuitkit, monkeypatch):
    monkeypatch.undo()
    outcome = circuitkit("reproduce", "fig12", "-o", "out")
    assert outcome.code == 1
    assert "unknown figure 'fig12'; allowed: fig5, " in outcome.err


def test_without_a_folder_it_is_wrong_usage(circuitkit):
    assert circuitkit("reproduce", "fig9").code == 2


def test_a_file_is_no_folder(circuitkit, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    outcome = circuitkit("reproduce", "fig9", "-o", "notes.txt")
    assert outcome.code == 2
    assert "'notes.txt' is no folder" in outcome.err
    assert (tmp_path / "notes.txt").read_text() == "mine"
