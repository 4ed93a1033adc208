"""Ratios with their intervals, and what robustness and ablation claim of them, from made-up forces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from circuitkit.circuit import load_circuit
from circuitkit.circuit.silencing import silence
from circuitkit.paper.reproduce import ablation, robustness
from circuitkit.paper.reproduce.finding import Verdict
from circuitkit.paper.reproduce.forces import Ratio, paired_ratio
from circuitkit.study import load_study


def test_the_ratio_is_that_of_the_means_over_pushes_and_seeds():
    ratio = paired_ratio(np.array([[10.0, 20.0], [30.0, 40.0]]), np.array([[5.0, 10.0], [10.0, 15.0]]))
    assert ratio.value == pytest.approx(100 / 40)
    assert (ratio.mine, ratio.theirs) == (25.0, 10.0)
    assert ratio.low == pytest.approx(60 / 25)  # the second seed, twice
    assert ratio.high == pytest.approx(40 / 15)  # the first seed, twice


def test_seeds_that_do_not_differ_leave_no_doubt():
    ratio = paired_ratio(np.full((2, 8), 18.0), np.full((2, 8), 12.0))
    assert (ratio.low, ratio.value, ratio.high) == (1.5, 1.5, 1.5)


def test_what_varies_with_the_seed_for_both_alike_does_not_widen_the_interval():
    theirs = np.linspace(5.0, 15.0, 12)[None]
    paired = paired_ratio(1.5 * theirs, theirs)
    shuffled = paired_ratio(1.5 * theirs[:, ::-1], theirs)
    assert paired.high - paired.low == pytest.approx(0.0, abs=1e-12)
    assert shuffled.high - shuffled.low > 0.1


def test_the_interval_covers_the_truth_about_as_often_as_it_says():
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        theirs = rng.normal(10.0, 1.0, (1, 12))
        mine = rng.normal(15.0, 2.0, (1, 12))
        ratio = paired_ratio(mine, theirs)
        hits += ratio.low <= 1.5 <= ratio.high
    assert 0.85 <= hits / 200 <= 0.99  # a bootstrap of twelve is a little too sure of itself


def test_over_nothing_there_is_no_ratio():
    ratio = paired_ratio(np.ones((1, 3)), np.zeros((1, 3)))
    assert math.isnan(ratio.value)
    assert math.isnan(ratio.low)


def made_up(value, low, high):
    return Ratio(value, low, high, 10 * value, 10.0)


def test_a_gain_in_every_condition_holds():
    ratios = {
        "nominal": made_up(1.6, 1.5, 1.7),
        "ice": made_up(1.4, 1.2, 1.5),
        "hill": made_up(1.3, 1.1, 1.4),
    }
    gain, kept = robustness.claims_of("binn", ratios, 12)
    assert gain.verdict is Verdict.HOLDS
    assert gain.ours == "in 2 of 2 conditions"
    assert kept.verdict is Verdict.HOLDS
    assert "1.30 (1.10 to 1.40) (hill)" in kept.ours


def test_a_condition_without_a_sure_gain_is_named():
    ratios = {
        "nominal": made_up(1.6, 1.5, 1.7),
        "ice": made_up(1.05, 0.9, 1.2),
        "hill": made_up(1.5, 1.4, 1.6),
    }
    gain, kept = robustness.claims_of("binn", ratios, 12)
    assert gain.verdict is Verdict.PARTLY
    assert gain.why == "Not sure in: ice."
    assert kept.verdict is Verdict.PARTLY


def test_a_condition_in_which_the_open_loop_holds_nothing_is_not_the_worst_one():
    ratios = {
        "nominal": made_up(1.6, 1.5, 1.7),
        "ice": made_up(math.nan, math.nan, math.nan),
        "hill": made_up(1.2, 1.1, 1.3),
    }
    gain, kept = robustness.claims_of("binn", ratios, 12)
    assert gain.why == "Not sure in: ice."
    assert kept.ours.endswith("least 1.20 (1.10 to 1.30) (hill)")


def test_neurons_that_are_worth_nothing_are_named():
    ratios = {
        "nothing": made_up(1.0, 1.0, 1.0),
        "everything": made_up(0.5, 0.4, 0.6),
        "q1": made_up(0.7, 0.6, 0.8),
        "h1": made_up(0.99, 0.9, 1.1),
    }
    claim = ablation.claim_of("binn", ratios, ("q1", "h1"), 6)
    assert claim.verdict is Verdict.PARTLY
    assert claim.ours == "1 of 2 neurons; q1 is worth most: 70 % without it, open loop 50 %"
    assert claim.why == "Without h1, one at a time, no loss is sure."
    assert ablation.claim_of("binn", ratios, ("q1",), 6).verdict is Verdict.HOLDS
    unsure = {**ratios, "q1": made_up(0.7, 0.3, 1.02)}  # a large loss, but on few seeds only
    assert ablation.claim_of("binn", unsure, ("q1",), 6).verdict is Verdict.FAILS


NEURONS = ["lf", "bf", "rf", "q1", "q2", "q3", "q4", "h1", "h2", "p1", "p2"]


@pytest.mark.parametrize("name", ["binn_lateral_tuned", "binn_lateral_capture"])
def test_every_neuron_and_connection_of_the_circuit_is_silenced_in_turn(name):
    circuit = load_circuit(name)
    parts = ablation.neurons_of(circuit), ablation.connections_of(circuit)
    study = ablation.with_lesions(load_study("ablation"), name, parts)
    lesions = [value.text for value in study.axes["lesion"]]
    assert lesions[:2] == ["nothing", "everything"]
    assert lesions[2:13] == NEURONS
    assert len(lesions) == 2 + 11 + 27
    assert "inputs -> q1" in lesions
    for value in study.axes["lesion"][2:]:
        assert silence(circuit, value.settings["silenced"]) != circuit
    assert [value.text for value in study.axes["circuit"]] == [name]


def test_a_sum_of_inputs_to_a_neuron_is_one_connection():
    circuit = load_circuit("binn_lateral_capture")
    silenced = ablation.connections_of(circuit)["inputs -> q1"]
    assert "com_y -> lateral.q1" in silenced
    assert "com_velocity_y -> lateral.q1" in silenced
    assert all(each.endswith("-> lateral.q1") for each in silenced)
