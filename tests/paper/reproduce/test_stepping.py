"""A small cut of the study of stepping, from the runs to the pictures."""

from __future__ import annotations

from matplotlib.image import imread

from circuitkit.base.source import find_data_file
from circuitkit.control import load_controller
from circuitkit.paper.push_bounds import PushKind
from circuitkit.paper.reproduce import stepping
from circuitkit.paper.reproduce.figure import Job
from circuitkit.paper.reproduce.finding import Finding, Verdict
from circuitkit.paper.reproduce.forces import Forces
from circuitkit.study import CaseBuilder, load_study

CUT = {
    "axes": {"contender": ["ankles", "stepping"], "push.duration": ["0.2 s"]},
    "seeds": {"count": 1},
    "watch": "1 s",
    "search": {"low": "0 N", "high": "27 N", "step": "9 N", "check_below": 0},
    "set": {"push.start.step": 2},
}


def test_the_ankles_of_the_study_are_those_beside_which_it_steps():
    ankles = next(cell for cell in load_study("stepping").cells if cell.labels["contender"] == "ankles")
    assert ankles.settings["circuit"] == load_controller("stepping").ankle_circuit


def test_the_figure(tmp_path, monkeypatch):
    monkeypatch.setattr(stepping, "_QUICK", CUT)
    monkeypatch.setattr(stepping, "_QUICK_CALM_S", 2.5)
    finding = stepping.Stepping().run(Job("stepping", tmp_path, quick=True, workers=1))
    finding.save(tmp_path)
    again, _ = Finding.load(tmp_path)
    assert again.claims == finding.claims
    for picture in finding.pictures:
        assert imread(tmp_path / picture.file).std() > 0.02  # there is something on it
        assert (tmp_path / picture.file).with_suffix(".pdf").is_file()
    assert all(len(row) == len(table.headings) for table in finding.tables for row in table.rows)
    assert finding.claims[2].verdict is Verdict.HOLDS
    assert finding.data["calm_stepping_ticks"] == 0
    forces = {
        (row["contender"], row["direction"]): row["force_n"] for row in finding.data["largest_survived_n"]
    }
    for direction in ("outward", "inward"):
        assert forces["stepping", direction] >= forces["ankles", direction] > 0


def test_the_run_that_is_drawn_is_the_one_that_gains_most():
    outward, inward = PushKind("outward", 0.1), PushKind("inward", 0.4)
    bound = {outward: 10.0, inward: 20.0}
    forces = Forces(
        {"stepping": {outward: 14.0, inward: 19.0}, "ankles": {outward: 10.0, inward: 18.0}}, bound, bound
    )
    assert stepping.most_gained(forces) == outward
    calm = stepping.Calm(60.0, survived=True, stepping_ticks=0, nearest_m=-0.04, apart_m=0.0)
    verdicts = [claim.verdict for claim in stepping._claims(forces, calm, 20)]
    assert verdicts == [Verdict.HOLDS, Verdict.PARTLY, Verdict.HOLDS]
    forces.survived["stepping"][inward] = 17.0
    first = stepping._claims(forces, calm, 20)[0]
    assert first.verdict is Verdict.PARTLY
    assert first.ours.endswith("more in 1 of 2 kinds of push, less in 1")
    forces.survived["stepping"].update(forces.survived["ankles"])
    assert stepping._claims(forces, calm, 20)[0].verdict is Verdict.FAILS  # as much is no gain


def test_runs_are_others_when_a_circuit_within_the_controller_is_another(tmp_path):
    """So that a result that was found with an older circuit is not taken for one of the new."""
    controller, inner = tmp_path / "mine.yaml", tmp_path / "inner.yaml"
    shipped = find_data_file("stepping", "sims/controllers").read_text(encoding="utf-8")
    controller.write_text(shipped.replace("hand_over: hand_over", f"hand_over: {inner}"), encoding="utf-8")
    original = find_data_file("hand_over", "circuits").read_text(encoding="utf-8")
    keys = []
    for margin in ("30 mm", "30 mm", "25 mm"):
        inner.write_text(original.replace("value: 30 mm", f"value: {margin}"), encoding="utf-8")
        case = CaseBuilder(load_study("stepping")).case({"controller": str(controller)})
        keys.append((case.run_key(0), case.shared_key))
    assert keys[0] == keys[1]
    assert keys[0][0] != keys[2][0]
    assert keys[0][1] != keys[2][1]
