"""Figures 5 to 8: the circuit against section 4.2, computation times, and a small cut of Fig. 7."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.image import imread

from circuitkit.circuit import load_circuit
from circuitkit.circuit.silencing import silence
from circuitkit.paper.reproduce import fig5, fig6, fig7, fig8, timing
from circuitkit.paper.reproduce.fig5 import settled_answers
from circuitkit.paper.reproduce.fig7 import Plane
from circuitkit.paper.reproduce.figure import Job
from circuitkit.paper.reproduce.finding import Finding, Verdict
from circuitkit.paper.reproduce.timing import Times, network_steps, time_in_the_loop, time_in_turns
from circuitkit.simulation import load_scenario, make_plan
from circuitkit.simulation.scenario import with_push
from circuitkit.study import CaseBuilder, load_study


def make(figure, folder):
    """Make a figure coarsely; it is as complete as the report needs it."""
    finding = figure().run(Job(figure.kind, folder, quick=True, workers=1))
    finding.save(folder)
    again, _ = Finding.load(folder)
    assert again.claims == finding.claims
    assert finding.text
    assert all(claim.claim and claim.paper and claim.ours and claim.how for claim in finding.claims)
    assert "nan" not in " ".join(claim.ours for claim in finding.claims)
    for picture in finding.pictures:
        assert picture.caption
        assert picture.alt
        assert imread(folder / picture.file).std() > 0.02  # there is something on it
        assert (folder / picture.file).with_suffix(".pdf").is_file()
    for table in finding.tables:
        assert table.rows
        assert all(len(row) == len(table.headings) for row in table.rows)
    return finding


def verdicts(finding):
    return [claim.verdict for claim in finding.claims]


# Figures 5 and 6.


def test_fig5_the_network_is_that_of_section_4_2(tmp_path):
    finding = make(fig5.Fig5, tmp_path)
    assert set(verdicts(finding)) == {Verdict.HOLDS}
    assert len(finding.data["neurons"]) == 11
    assert len(finding.data["connections"]) == 18


def test_fig5_tells_a_network_that_is_another():
    """Without lf the right foot's edges count on the left foot; the weights that are left out are zero."""
    lesioned = silence(load_circuit("binn_lateral"), ["lf"])
    answers = settled_answers(lesioned, np.linspace(-0.12, 0.12, 61))
    found = {claim.claim: claim.verdict for claim in fig5._claims(lesioned, answers)}
    assert found["All weights between neurons are 1 (inhibitory: −1)"] is Verdict.FAILS
    assert Verdict.HOLDS not in {
        verdict
        for claim, verdict in found.items()
        if claim.startswith("Only the neurons of the edges") and not verdict
    }
    assert (
        found["Only the neurons of the edges of the present support polygon are not inhibited"]
        is Verdict.PARTLY
    )


def test_answers_are_mirrored():
    """Left and right are the same network: what the left foot does at y, the right foot does at -y."""
    answers = settled_answers(load_circuit("binn_lateral"), np.linspace(-0.1, 0.1, 41))
    for one, other in (("p1", "p2"), ("q1", "q4"), ("q2", "q3")):
        np.testing.assert_allclose(
            answers.of(one, "left foot"), answers.of(other, "right foot")[::-1], atol=1e-9
        )
        np.testing.assert_allclose(
            answers.of(one, "both feet"), answers.of(other, "both feet")[::-1], atol=1e-9
        )


def test_fig6_the_curves_do_what_the_text_says(tmp_path):
    finding = make(fig6.Fig6, tmp_path)
    assert set(verdicts(finding)) == {Verdict.HOLDS}
    inside = finding.data["q_inside_edge"]
    assert inside["0.0"] == 0.5
    assert inside["0.01"] == pytest.approx(1 / (1 + math.e))  # eq. 12 with m = 100 per metre


# Figure 7.


def a_plane(share, weights=(-0.02, 0.02), forces=(5.0, 10.0, 15.0)):
    return Plane(np.array(weights), np.array(forces), np.array(share), 12.0, 14.0)


def test_the_largest_force_counts_with_every_smaller_one():
    plane = a_plane([[1.0, 0.5, 1.0], [0.0, 1.0, 1.0]])
    assert [plane.largest_n(i) for i in (0, 1)] == [5.0, 0.0]
    assert plane.best == 0
    assert a_plane([[1.0, 1.0, 1.0]], weights=(0.01,)).largest_n(0) == 15.0


def test_cells_are_sorted_by_the_line_of_eq_21():
    """At 0.02 rad a step eq. 21 holds 13.8 N: two of three forces are above the line for either sign."""
    planes = {"outward": a_plane([[0.0, 0.0, 0.0], [0.2, 0.4, 0.9]])}
    assert fig7._survived(planes, as_printed=True, stable=True) == pytest.approx(0.3)
    assert fig7._survived(planes, as_printed=True, stable=False) == pytest.approx(0.9)
    assert fig7._survived(planes, as_printed=False, stable=True) == 0.0


@pytest.mark.parametrize(
    ("held", "verdict"), [(12.0, Verdict.HOLDS), (13.0, Verdict.PARTLY), (15.0, Verdict.FAILS)]
)
def test_both_bounds_count_that_of_the_push_on_the_torso_and_that_at_the_com(held, verdict):
    _, claim = fig7._claims_of_runs({"outward": a_plane([[1.0, 1.0]], (0.01,), (5.0, held))}, 20)
    assert claim.verdict is verdict


def test_fig7_from_a_few_runs_to_the_pictures(tmp_path, monkeypatch):
    cut = {
        "axes": {"circuit.w": ["-0.5 deg", "1.63 deg"], "push.force": ["4 N", "22 N"]},
        "seeds": {"count": 1},
        "set": {"push.start.step": 2},
        "watch": "1 s",
    }
    monkeypatch.setattr(fig7, "_QUICK", cut)
    finding = make(fig7.Fig7, tmp_path)
    assert verdicts(finding)[:4] == [Verdict.HOLDS, Verdict.PARTLY, Verdict.FAILS, Verdict.HOLDS]
    assert finding.data["eq_21_weight_rad"] == pytest.approx(math.radians(1.655), rel=1e-3)
    for plane in finding.data["planes"].values():
        assert np.shape(plane["share"]) == (2, 2)
        assert plane["dcm_bound_torso_n"] < plane["dcm_bound_com_n"]
    outward = finding.data["planes"]["outward"]
    assert outward["dcm_bound_com_n"] < 22.0
    assert outward["share"][0][1] == outward["share"][1][1] == 0.0  # so nothing holds 22 N


def test_every_cell_of_the_study_of_fig7_can_be_run():
    study = load_study(fig7.STUDY)
    labels = {cell.labels["circuit.w"] for cell in study.cells}
    assert {-weight for weight in labels} == labels  # both signs alike
    circuit = CaseBuilder(study).of_cell(study.cells[0]).circuits.used
    assert float(circuit.parameters["leak"].value_si) == 0.04
    assert list(study.seeds) == list(range(20))


# Figure 8.


def test_works_take_turns_and_are_timed_by_the_step():
    calls = []

    def work(name):
        return lambda steps: calls.append((name, steps))

    times = time_in_turns({"a": (work("a"), 10), "b": (work("b"), 20)}, 3)
    assert calls == [("a", 10), ("b", 20)] + [("a", 10), ("b", 20)] * 3  # once to warm up
    assert [len(each.means_s) for each in times.values()] == [3, 3]


def test_mean_and_coefficient_of_variation():
    times = Times(10, (1e-6, 2e-6, 3e-6))
    assert times.mean_s == pytest.approx(2e-6)
    assert times.variation == pytest.approx(0.5)  # standard deviation of a sample over mean
    assert math.isnan(Times(10, (1e-6,)).variation)


class CountingProgram:
    """Stands for a compiled circuit; keeps the inputs of every step."""

    input_names = ("zmp_y", "force_difference")

    def __init__(self):
        self.rows = []

    def step(self, row):
        self.rows.append(row.copy())


def test_every_step_that_is_timed_is_done_with_other_inputs(monkeypatch):
    program = CountingProgram()
    monkeypatch.setattr(timing, "compile_circuit", lambda *_: program)
    monkeypatch.setattr(timing, "Stepper", lambda found, _batch: found)
    steps = network_steps("binn_lateral", "numpy")
    steps(1500)
    rows = np.array(program.rows)
    assert rows.shape == (1500, 1, 2)
    assert len(np.unique(rows[:1000, 0, 0])) == 1000
    zmp, load = rows[:, 0, 0], rows[:, 0, 1]
    assert np.abs(load).max() == 1.0  # both feet in turn, and both together
    assert (np.abs(load) < 0.1).any()
    assert np.abs(zmp).max() < 0.15  # the range of the input


def test_the_solves_that_are_timed_meet_bounds(monkeypatch):
    """From some of the states that pushes have moved the ZMP needs its bounds, else nothing is solved."""
    plan = make_plan(load_scenario("nao_push"))
    counts = []
    solve_all = timing.JerkMpc.solve_all

    def counted(self, state, zmp, low, high):
        found = solve_all(self, state, zmp, low, high)
        free = self.unbounded(state[None], zmp)[0]
        counts.append(bool((free < low).any() or (free > high).any()))
        assert (found >= low - 1e-6).all()
        assert (found <= high + 1e-6).all()
        return found

    monkeypatch.setattr(timing.JerkMpc, "solve_all", counted)
    timing.mpc_solves("mpc", plan)(100)
    assert len(counts) == 100
    assert 0.2 < np.mean(counts) <= 1.0


def test_controllers_are_timed_in_the_loop_and_do_the_same_there():
    scenario = load_scenario("nao_push")
    push = scenario.pushes[0]
    early = push.model_copy(update={"start": {**push.start, "step": 0}})
    plan = make_plan(
        scenario.with_disturbances(with_push(scenario, early)).model_copy(update={"duration": 2.0})
    )
    times = time_in_the_loop(plan, ("circuit", "open_loop"), range(2))
    assert [times[name].steps for name in times] == [200, 200]
    assert all(0 < mean < 0.05 for each in times.values() for mean in each.means_s)
    assert times["circuit"].mean_s > times["open_loop"].mean_s


def test_fig8_tells_times_as_parts_of_the_paper_s(tmp_path, monkeypatch):
    alone = {"compiled": 1e-7, "numpy": 2.5e-6, "solve": 4e-5}
    made = {name: Times(10, (mean, mean, 1.001 * mean)) for name, mean in alone.items()}
    made["numpy"] = Times(10, (2e-6, 2.5e-6, 3e-6))
    loop = dict.fromkeys(("circuit", "mpc", "mpc_full", "dcm_ankle"), made["solve"])
    monkeypatch.setattr(fig8, "time_in_turns", lambda works, runs: made if runs == 20 and works else {})
    monkeypatch.setattr(fig8, "time_in_the_loop", lambda *_: loop)
    finding = make(fig8.Fig8, tmp_path)
    mean, variation, part, others, solve = finding.claims
    assert (mean.ours, mean.verdict) == ("0.00010 ms in C, 0.0025 ms in numpy", Verdict.HOLDS)
    assert (variation.ours, variation.verdict) == ("0.058 % in C, 20 % in numpy", Verdict.PARTLY)
    assert (part.ours, part.verdict) == ("0.0010 % in C, 0.025 % in numpy", Verdict.HOLDS)
    assert others.paper == "7407 to 111111 times as long"  # 20 and 300 ms over 0.0027 ms
    assert others.ours == "8000 to 120000 times as long"
    assert solve.ours == "a solve takes 0.040 ms: 400 × a step in C, 16 × one in numpy"
    assert solve.verdict is Verdict.PARTLY
