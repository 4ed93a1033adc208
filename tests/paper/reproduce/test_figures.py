"""A small cut of every study of the figures, from the runs to the picture."""

from __future__ import annotations

import pytest
from matplotlib.image import imread

from circuitkit.paper.reproduce import ablation, fig9, fig10, fig11, pushed_walk, robustness
from circuitkit.paper.reproduce.figure import Job
from circuitkit.paper.reproduce.finding import Finding, Verdict
from circuitkit.study import CaseBuilder, load_study

STEP_N = 16.0
COARSE = {
    "watch": "1 s",
    "search": {"step": f"{STEP_N:g} N"},
    "set": {"push.start.step": 2},
}


def make(figure, folder):
    """Make a figure coarsely in this process; it is as complete as the report needs it."""
    finding = figure().run(Job(figure.kind, folder, quick=True, workers=1))
    finding.save(folder)
    again, _ = Finding.load(folder)
    assert again.claims == finding.claims
    assert finding.title == figure.title
    assert finding.text
    assert finding.seeds.startswith("seeds 0 to ")
    assert finding.claims
    assert all(claim.claim and claim.paper and claim.ours and claim.how for claim in finding.claims)
    for picture in finding.pictures:
        assert picture.caption
        assert picture.alt
        pixels = imread(folder / picture.file)
        assert pixels.shape[1] == 1440  # 7.2 inches with 200 dots each
        assert pixels.std() > 0.02  # there is something on it
        assert (folder / picture.file).with_suffix(".pdf").is_file()
    for table in finding.tables:
        assert table.rows
        assert all(len(row) == len(table.headings) for row in table.rows)
    return finding


@pytest.fixture
def few_seeds(monkeypatch):
    monkeypatch.setattr(fig9, "QUICK_SEEDS", range(1))
    monkeypatch.setattr(fig10, "QUICK_SEEDS", range(2))
    monkeypatch.setattr(pushed_walk, "WATCHED_S", 3.0)


@pytest.mark.usefixtures("few_seeds")
def test_fig9_the_push_of_section_5_2_fells_the_open_loop_and_not_the_tuned_circuit(tmp_path):
    finding = make(fig9.Fig9, tmp_path)
    verdicts = [claim.verdict for claim in finding.claims]
    assert verdicts[0] is Verdict.HOLDS
    assert verdicts[2] is Verdict.HOLDS
    assert finding.data["stood"]["open_loop"] == 0
    assert finding.data["stood"]["binn_tuned"] == finding.data["runs"]["binn_tuned"] == 1


@pytest.mark.usefixtures("few_seeds")
def test_fig10_times_outside_fit_together(tmp_path):
    finding = make(fig10.Fig10, tmp_path)
    for runs in (finding.data["by_cells"], finding.data["by_pressure"]):
        assert len(runs) == 2
        for times in runs:
            if times["first"] is not None:
                assert 0 < times["first"] <= times["longest"] <= times["total"] + 1e-9
            if times["until_calm"] is not None:
                assert times["until_calm"] >= times["first"]


def test_fig11_forces_lie_on_the_grid_and_below_what_is_possible(tmp_path, monkeypatch):
    cut = {
        "axes": {
            "contender": ["open_loop", "mpc", "mpc_full", "binn", "binn_tuned", "binn_capture"],
            "push.duration": ["0.2 s"],
        },
        "seeds": {"count": 1},
        "search": {"step": "32 N", "check_below": 0},
    }
    monkeypatch.setattr(fig11, "_QUICK", COARSE | cut)
    com = {"axes": {"contender": ["binn_capture"], "push.duration": ["0.2 s"]}}
    monkeypatch.setattr(fig11, "_QUICK_COM", {**COARSE, **cut, **com, "set": {"push.start.step": 2}})
    finding = make(fig11.Fig11, tmp_path)
    forces, bounds = finding.data["largest_survived_n"], finding.data["dcm_bound_n"]
    assert len(forces) == 6 * 2
    assert {row["contender"] for row in bounds} == {"torso", "centre of mass"}
    most = {row["direction"]: row["force_n"] for row in bounds if row["contender"] == "centre of mass"}
    for row in forces:
        assert row["force_n"] % 32.0 == 0
        assert row["force_n"] <= most[row["direction"]]
    torso = {row["direction"]: row["force_n"] for row in bounds if row["contender"] == "torso"}
    assert all(torso[direction] < most[direction] for direction in most)


def test_robustness_compares_all_in_every_condition(tmp_path, monkeypatch):
    conditions = ["nominal", "mass +10 %"]
    cut = {"axes": {"condition": conditions, "push.direction": ["inward"]}, "seeds": {"count": 2}}
    monkeypatch.setattr(robustness, "_QUICK", COARSE | cut)
    finding = make(robustness.Robustness, tmp_path)
    assert list(finding.data) == ["binn_tuned", "binn_capture"]
    for own in finding.data.values():
        assert list(own) == conditions
        for ratio in own.values():
            assert ratio["mine"] % (STEP_N / 2) == ratio["theirs"] % (STEP_N / 2) == 0  # means of two seeds


def test_every_condition_of_the_robustness_study_can_be_run():
    study = load_study("robustness")
    cells = [c for c in study.cells if c.labels["push.direction"] == "inward"]
    cases = CaseBuilder(study)
    keys = {
        c.labels["condition"]: cases.of_cell(c, "10 N").key for c in cells if "binn" in c.texts["contender"]
    }
    assert len(set(keys.values())) == len(keys)  # no two conditions are the same world
    assert len(keys) >= 25


def test_ablation_sets_lesions_between_the_whole_circuit_and_none(tmp_path, monkeypatch):
    monkeypatch.setattr(ablation, "neurons_of", lambda _: {"q3": ("q3",), "p1": ("p1",)})
    ends = {"q3 -> p1": ("q3 -> p1",), "p1 -> ankle_roll": ("p1 -> ankle_roll",)}
    monkeypatch.setattr(ablation, "connections_of", lambda _: ends)
    axes = {"circuit": ["binn_lateral_tuned"], "push.start.step": [2], "push.direction": ["inward"]}
    monkeypatch.setattr(ablation, "_QUICK", {**COARSE, "axes": axes, "seeds": {"count": 1}, "set": {}})
    finding = make(ablation.Ablation, tmp_path)
    found = finding.data["binn_lateral_tuned"]
    assert list(found) == ["nothing", "everything", "q3", "p1", "q3 -> p1", "p1 -> ankle_roll"]
    assert found["nothing"]["value"] == 1.0
    assert found["p1"]["mine"] == found["p1 -> ankle_roll"]["mine"]  # the same lesion twice
