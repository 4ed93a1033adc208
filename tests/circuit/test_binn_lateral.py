"""The structure of the shipped network against section 4.2 of the paper, written here again by hand."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from circuitkit.circuit import check, load_circuit

GRAPH = load_circuit("binn_lateral")
NEURONS = {neuron.name: neuron for neuron in GRAPH.neurons}
WEIGHTS = {(synapse.source, synapse.target): synapse.weight for synapse in GRAPH.synapses}

# Section 4.2: "lf ⊣ q1, q2; bf ⊣ q2, q3; rf ⊣ q3, q4", the right edges (q1, q3) to p1, the left ones to p2.
INHIBITORY = {
    ("lf", "q1"), ("lf", "q2"), ("bf", "q2"), ("bf", "q3"), ("rf", "q3"), ("rf", "q4"),
    ("h1", "p2"), ("h2", "p1"),
}  # fmt: skip
EXCITATORY = {
    ("q1", "p1"), ("q3", "p1"), ("q2", "p2"), ("q4", "p2"),
    ("q1", "h1"), ("q3", "h1"), ("q2", "h2"), ("q4", "h2"),
    ("p1", "h1"), ("p2", "h2"),
}  # fmt: skip
SENSORIAL = {
    ("force_difference", "lf"): 1, ("force_difference", "bf"): 1, ("force_difference", "rf"): 1,
    ("zmp_y", "q1"): -1, ("zmp_y", "q2"): 1, ("zmp_y", "q3"): -1, ("zmp_y", "q4"): 1,
}  # fmt: skip
# The support polygon for feet at y = +-50 mm: the force cells lie 29.9 mm outside and 23.1 mm inside.
OUTER, INNER = 0.050 + 0.0299, 0.050 - 0.0231

# What becomes of a name when left and right change places.
MIRROR = {
    "lf": "rf", "bf": "bf", "rf": "lf", "q1": "q4", "q2": "q3", "q3": "q2", "q4": "q1",
    "h1": "h2", "h2": "h1", "p1": "p2", "p2": "p1",
}  # fmt: skip


def test_there_are_no_errors_and_no_warnings():
    assert check("binn_lateral") == ((), ())


def test_the_neurons_and_their_order():
    """h1 and h2 before p1 and p2: the p see the h of this step."""
    assert list(NEURONS) == ["lf", "bf", "rf", "q1", "q2", "q3", "q4", "h1", "h2", "p1", "p2"]


def test_the_roles():
    inhibitory = {name for name, neuron in NEURONS.items() if neuron.role == "inhibitory"}
    assert inhibitory == {"lf", "bf", "rf", "h1", "h2"}


def test_the_synapses_between_neurons_have_weight_1():
    between = {pair: weight for pair, weight in WEIGHTS.items() if pair not in SENSORIAL}
    assert between == dict.fromkeys(EXCITATORY, 1.0) | dict.fromkeys(INHIBITORY, -1.0)


def test_the_synapses_of_the_inputs():
    assert {pair: weight for pair, weight in WEIGHTS.items() if pair in SENSORIAL} == SENSORIAL
    kinds = {(synapse.source, synapse.target): synapse.kind for synapse in GRAPH.synapses}
    assert {pair for pair, kind in kinds.items() if kind == "sensorial"} == set(SENSORIAL)
    assert {pair for pair, kind in kinds.items() if kind == "inhibitory"} == INHIBITORY


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("lf", {"slope": 500, "shift": 0.1}),
        ("bf", {"slope": 500, "low": -0.1, "high": 0.1}),
        ("rf", {"slope": -500, "shift": -0.1}),
        # Right edges mirrored: the shift is minus the edge.
        ("q1", {"slope": 100, "shift": OUTER}),
        ("q2", {"slope": 100, "shift": -INNER}),
        ("q3", {"slope": 100, "shift": -INNER}),
        ("q4", {"slope": 100, "shift": OUTER}),
        ("h1", {"slope": 500, "shift": 0.1}),
        ("h2", {"slope": 500, "shift": 0.1}),
        ("p1", {"slope": 10, "shift": 0.5}),
        ("p2", {"slope": 10, "shift": 0.5}),
    ],
)
def test_the_parameters(name, parameters):
    assert NEURONS[name].parameters == pytest.approx(parameters)


@pytest.mark.parametrize(
    ("name", "edge", "falls"),
    [("q1", -OUTER, True), ("q2", -INNER, False), ("q3", INNER, True), ("q4", OUTER, False)],
)
@pytest.mark.parametrize("zmp", [-0.12, -0.08, -0.03, 0.0, 0.02, 0.08, 0.1])
def test_each_q_alone_has_the_curve_of_the_paper(name, edge, falls, zmp):
    """Eq. 12 with |m| = 100 and s the edge, falling for the right edges: mirroring has changed nothing."""
    slope = -100 if falls else 100
    activation = WEIGHTS["zmp_y", name] * zmp
    output = NEURONS[name].model.output.evaluate({"A": activation, **NEURONS[name].parameters})
    assert output == pytest.approx(1 / (1 + math.exp(-slope * (zmp - edge))), rel=1e-9)


def test_left_and_right_are_exact_mirror_images():
    """Exact, to the last bit: the mirrored neuron has the same curve for the mirrored input."""
    for (source, target), weight in WEIGHTS.items():
        mirrored_source, sign = (MIRROR[source], 1) if source in MIRROR else (source, -1)
        if source == "force_difference":
            continue
        assert WEIGHTS[mirrored_source, MIRROR[target]] == sign * weight
    for left, right in (("q1", "q4"), ("q2", "q3"), ("h1", "h2"), ("p1", "p2")):
        assert NEURONS[left].parameters == NEURONS[right].parameters
    lf, rf, bf = (NEURONS[name].parameters for name in ("lf", "rf", "bf"))
    assert {name: -value for name, value in lf.items()} == rf
    assert bf["low"] == -bf["high"]
    (output,) = GRAPH.outputs
    readout = dict(output.readout)
    assert readout["p1"] == -readout["p2"]
    assert output.low == -output.high


def test_the_output_is_eq_14_as_an_increment():
    (output,) = GRAPH.outputs
    assert output.name == "ankle_roll"
    assert output.unit.symbol == "deg"
    assert dict(output.readout) == pytest.approx({"p1": math.radians(1.63), "p2": -math.radians(1.63)})
    assert (output.low, output.high) == pytest.approx((-math.radians(22), math.radians(22)))
    assert output.leak == 0.05


def test_w_is_what_eq_21_gives_for_the_push_of_section_5_2():
    """Eq. 21: 20 N, 0.2 s, 10 ms, 5.18 kg, 0.27 m; gamma near 1 (1.01 in Fig. 7)."""
    exact = [
        math.degrees(math.asin(gamma * 0.2 * 20 * GRAPH.step_s / (5.18 * 0.27))) for gamma in (0.99, 1.01)
    ]
    assert exact[0] < math.degrees(GRAPH.outputs[0].readout[0][1]) < exact[1]


def test_inputs_timing_and_step():
    assert [(node.name, node.unit.symbol, node.low, node.high) for node in GRAPH.inputs] == [
        ("force_difference", "1", -1.0, 1.0),
        ("zmp_y", "mm", -0.15, 0.15),
    ]
    assert GRAPH.timing == "ordered"
    assert GRAPH.step_s == 0.01


@pytest.mark.parametrize(("foot", "outer", "inner"), [("left", "q4", "q3"), ("right", "q1", "q2")])
def test_a_margin_moves_every_edge_inwards(foot, outer, inner):
    moved = {neuron.name: neuron for neuron in load_circuit("binn_lateral", {"margin": "10 mm"}).neurons}
    sign = {"q1": -1, "q2": 1, "q3": -1, "q4": 1}
    edges = {name: sign[name] * moved[name].parameters["shift"] for name in (outer, inner)}
    side = 1 if foot == "left" else -1
    assert edges == pytest.approx({outer: side * (OUTER - 0.01), inner: side * (INNER + 0.01)})


@pytest.mark.parametrize(
    "edge", ["left_edge_left_foot", "right_edge_left_foot", "left_edge_right_foot", "right_edge_right_foot"]
)
def test_each_edge_is_one_parameter(edge):
    neuron = {"left_edge_left_foot": "q4", "right_edge_left_foot": "q3", "left_edge_right_foot": "q2"}.get(
        edge, "q1"
    )
    graph = load_circuit("binn_lateral", {edge: "60 mm"})
    sign = -1 if neuron in {"q1", "q3"} else 1
    assert {each.name: each for each in graph.neurons}[neuron].parameters["shift"] == sign * 0.06


def test_the_other_reading_of_the_correction_is_one_parameter():
    graph = load_circuit("binn_lateral", {"w": "-0.5 deg"})
    assert dict(graph.outputs[0].readout) == pytest.approx(
        {"p1": -math.radians(0.5), "p2": math.radians(0.5)}
    )


def test_the_file_says_where_its_numbers_stand_in_the_paper():
    lines = Path(GRAPH.neurons[0].origin.file).read_text(encoding="utf-8").splitlines()
    comments = " ".join(line.partition("#")[2] for line in lines)
    places = (
        "section 4.1",
        "section 4.2",
        "section 5.1",
        "section 5.2",
        "Eqs. 11 and 12",
        "Eq. 14",
        "Eq. 21",
        "eq. 20",
    )
    assert [place for place in places if place not in comments] == []


def test_reading_checking_and_resolving_is_fast():
    times = []
    for _ in range(5):
        start = time.perf_counter()
        load_circuit("binn_lateral")
        times.append(time.perf_counter() - start)
    assert min(times) < 0.02
