"""Nothing overlaps: measured on the geometry of the BiNN and of random circuits."""

import math
from itertools import combinations

import numpy as np
import pytest
from drawing import RIM, assert_nothing_overlaps, dense, layout_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import isotonic_regression
from strategies import circuit_graphs

from circuitkit.circuit.graph import CircuitGraph, Synapse
from circuitkit.circuit.load import load_circuit
from circuitkit.draw.layers import Bend, _crossings, make_layers
from circuitkit.draw.layout import Layout
from circuitkit.draw.network import make_network
from circuitkit.draw.placing import ascending


@pytest.fixture(scope="module")
def binn() -> CircuitGraph:
    return load_circuit("binn_lateral")


def labels(graph: CircuitGraph) -> dict[tuple[str, str], str]:
    """The words on the lines that have some, by their ends."""
    return {(each.source, each.target): each.label for each in make_network(graph).links if each.label}


def assert_links_meet_their_nodes(graph: CircuitGraph, layout: Layout) -> None:
    wanted = {(s.source, s.target) for s in graph.synapses}
    wanted |= {(neuron, output.name) for output in graph.outputs for neuron, _ in output.readout}
    assert {(route.link.source, route.link.target) for route in layout.routes} == wanted
    for route in layout.routes:
        for name, point in ((route.link.source, route.points[0]), (route.link.target, route.tip)):
            box = layout.nodes[name].box
            away = max(abs(point[0] - box.x) - box.width / 2, abs(point[1] - box.y) - box.height / 2)
            assert -RIM <= away <= 1e-9, (route.link, name)
    for name in layout.nodes:
        tips = [route.tip for route in layout.routes if route.link.target == name]
        assert all(math.dist(one, other) >= 5.0 for one, other in combinations(tips, 2)), name


def test_nothing_overlaps_in_the_binn(binn):
    layout = layout_of(binn)
    assert_nothing_overlaps(layout)
    assert_links_meet_their_nodes(binn, layout)
    assert layout.cost == (0, 0)  # every weight has a place, and none hides another line


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(graph=circuit_graphs())
def test_nothing_overlaps_in_random_circuits(graph):
    layout = layout_of(graph)
    assert_nothing_overlaps(layout)
    assert_links_meet_their_nodes(graph, layout)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [4, 12, 25])
def test_nothing_overlaps_in_dense_circuits(seed, count):
    graph = dense(seed, count, "n{}" if seed % 2 else "a_neuron_with_a_long_name_{}")
    layout = layout_of(graph)
    assert_nothing_overlaps(layout)
    assert_links_meet_their_nodes(graph, layout)


def test_the_binn_stands_in_the_layers_of_the_paper(binn):
    layers = make_layers(make_network(binn))
    columns = [[item for item in layer if not isinstance(item, Bend)] for layer in layers.order]
    assert columns == [
        ["force_difference", "zmp_y"],
        ["lf", "bf", "rf"],
        ["q1", "q2", "q3", "q4"],
        ["h1", "h2"],
        ["p1", "p2"],
        ["ankle_roll"],
    ]
    back = {(link.source, link.target) for link in layers.links if link.backward}
    assert back == {("p1", "h1"), ("p2", "h2")}


def test_labels_show_what_the_line_does_not(binn):
    minus = "\N{MINUS SIGN}"
    assert labels(binn) == {
        ("zmp_y", "q1"): f"{minus}1",  # the line of an input does not tell the sign
        ("zmp_y", "q3"): f"{minus}1",
        ("p1", "ankle_roll"): "1.63 deg",
        ("p2", "ankle_roll"): f"{minus}1.63 deg",
    }


def test_a_weight_is_shown_in_the_units_of_its_ends():
    graph = dense(0, 4)
    synapses = (
        Synapse("u0", "n0", 0.002 / 0.001, "sensorial"),  # 0.002 for a mm
        Synapse("n0", "n1", 1.0, "excitatory"),
        Synapse("n1", "n2", 2.0, "excitatory"),
    )
    graph = CircuitGraph("units", "", "ordered", 0.01, graph.inputs, graph.neurons, synapses, (), {})
    assert labels(graph) == {("u0", "n0"): "0.002 /mm", ("n1", "n2"): "2"}


@given(
    st.lists(st.tuples(st.floats(-100, 100), st.floats(0.01, 10)), min_size=1, max_size=30),
)
def test_pooling_is_isotonic_regression(pairs):
    values, weights = (list(each) for each in zip(*pairs, strict=True))
    expected = isotonic_regression(values, weights=weights).x
    np.testing.assert_allclose(ascending(values, weights), expected, rtol=1e-9, atol=1e-9)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), unique=True, max_size=20))
def test_crossings_are_counted_as_pairs_in_opposite_order(edges):
    left, right = [f"a{i}" for i in range(6)], [f"b{i}" for i in range(6)]
    targets = {name: [f"b{j}" for i, j in edges if f"a{i}" == name] for name in left}
    expected = sum((a - c) * (b - d) < 0 for (a, b), (c, d) in combinations(edges, 2))
    assert _crossings(left, right, targets) == expected
