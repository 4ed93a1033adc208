"""Populations, projections, gates, delays and instances: how they are told, and that they do not overlap."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from drawing import assert_nothing_overlaps, dense, layout_of
from hypothesis import example, given
from hypothesis import strategies as st

from circuitkit.base.source import shipped_names
from circuitkit.base.units import DIMENSIONLESS, UNIT_SYMBOLS, Dimension, parse_quantity, parse_unit
from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.circuit.graph import Projection
from circuitkit.circuit.names import node_of
from circuitkit.draw import draw_circuit
from circuitkit.draw.network import make_network, parameter_text, quantity_text, rule_text, weight_text

HEAD = "circuit: c\ncontrol_step: 10 ms\ntiming: ordered\n"
RING = (
    HEAD
    + """\
inputs:
  u: {unit: mm, range: [0 mm, 1 mm]}
populations:
  ring: {size: 8, model: leaky_integrator, role: excitatory, tau: 10 ms, slope: 1, shift: 0}
neurons:
  calm: {model: identity, role: inhibitory}
synapses:
  - {from: "ring[3]", to: calm, weight: 1}
  - {from: calm, to: "ring[1]", weight: -1, delay: 20 ms}
  - {from: calm, to: "ring[2]", weight: -2, delay: 20 ms}
projections:
  - {from: u, to: ring, connect: all_to_all, weight: "cos(2*pi*j/n_target) * 1 /mm"}
  - {from: ring, to: ring, connect: all_to_all, self: false, weight: 0.5, model: first_order, tau: 5 ms}
outputs:
  y: {unit: deg, readout: {ring: "i * 1 deg"}}
"""
)


def links(text):
    return {(each.source, each.target, each.kind): each for each in make_network(parse_circuit(text)).links}


def test_a_population_is_one_node_with_its_size():
    (ring,) = [node for node in make_network(parse_circuit(RING)).nodes if node.name == "ring"]
    assert (ring.lines, ring.size, ring.role) == (("ring", "8 neurons"), 8, "excitatory")
    assert ring.details.splitlines()[0] == "ring: excitatory, leaky_integrator, 8 neurons"
    assert "tau 0.01 s" in ring.details


_POWERS = st.sampled_from(("", "^2", "^3", "^-1"))
_FACTORS = st.builds(str.__add__, st.sampled_from(UNIT_SYMBOLS), _POWERS)
_UNITS = st.lists(st.tuples(st.sampled_from("*/"), _FACTORS), min_size=1, max_size=4).map(
    lambda parts: parse_unit("".join(sign + factor for sign, factor in parts).removeprefix("*"))
)


def assert_read_back(text, value_si, dimension):
    """What stands in a picture is the quantity, to the four digits that are shown."""
    found = parse_quantity(text)
    assert found.dimension == dimension
    assert found.value_si == pytest.approx(value_si, rel=5e-4)


@given(above=_UNITS, below=_UNITS, value=st.floats(1e-6, 1e6))
@example(above=parse_unit("1^2"), below=parse_unit("1"), value=1.0)
@example(above=parse_unit("1*m"), below=parse_unit("1/s"), value=1.0)
def test_what_units_are_made_of_others_can_be_read_back(above, below, value):
    quotient = above.over(below)
    again = parse_unit(quotient.symbol)
    assert (again.factor, again.dimension) == (quotient.factor, quotient.dimension)
    assert quotient.factor == above.factor / below.factor
    assert quotient.dimension == above.dimension.times(below.dimension, -1)
    assert_read_back(weight_text(-value, above, below), -value, quotient.dimension)
    assert_read_back(quantity_text(value, above), value, above.dimension)


@pytest.mark.parametrize("name", shipped_names("circuits"))
def test_weights_of_shipped_circuits_are_shown_as_the_language_reads_them(name):
    """Every weight that is one number, of synapses and readouts, and every parameter of a neuron."""
    graph = load_circuit(name)
    ends: dict[str, list[tuple[float, Dimension]]] = {}
    activations = {each.name: each.activation_unit for each in (*graph.neurons, *graph.populations)}
    inputs = {each.name: each.unit for each in graph.inputs}
    for each in graph.synapses:
        below = inputs.get(node_of(each.source), DIMENSIONLESS).dimension
        dimension = each.model.weight.dimension(activations[node_of(each.target)].dimension, below)
        words = f"{node_of(each.source)} to {node_of(each.target)}: {each.kind}"
        ends.setdefault(words, []).append((each.weight, dimension))
    for output in graph.outputs:
        for source, weight in output.readout:
            words = f"{node_of(source)} to {output.name}: readout"
            ends.setdefault(words, []).append((weight, output.unit.dimension))
    shown = {
        words: rest.partition("weight ")[2].partition(",")[0]
        for link in make_network(graph).links
        for words, _, rest in [link.details.splitlines()[0].partition(", ")]
    }
    checked = 0
    for words, (first, *others) in ends.items():
        if not others and isinstance(first[0], float):
            assert_read_back(shown[words], *first)
            checked += 1
    assert checked or not graph.synapses
    for neuron in graph.neurons:
        for each in neuron.model.parameters:
            text = parameter_text(each, neuron.parameters[each.name], neuron.activation_unit)
            dimension = each.unit_rule.dimension(neuron.activation_unit.dimension)
            assert_read_back(text.partition(" ")[2], neuron.parameters[each.name], dimension)


BALANCE = (
    HEAD
    + """inputs:
  lean: {unit: rad, range: [-30 deg, 30 deg]}
  rate: {unit: rad/s, range: [-5 rad/s, 5 rad/s]}
  tilt: {unit: deg, range: [-30 deg, 30 deg]}
neurons:
  n: {model: identity, role: excitatory}
synapses:
  - {from: lean, to: n, weight: 3.5 /rad}
  - {from: rate, to: n, weight: WEIGHT}
  - {from: tilt, to: n, weight: 3 /rad}
outputs:
  y: {unit: N, readout: {n: 10 N}}
"""
)


@pytest.mark.parametrize("weight", ["0.9 s/rad", "15.7 ms/deg", "0.9 s*1/rad"])
def test_a_weight_is_shown_in_the_unit_of_its_file(weight):
    found = links(BALANCE.replace("WEIGHT", weight))
    shown = [found[name, "n", "sensorial"].label for name in ("lean", "rate", "tilt")]
    assert shown == ["3.5 /rad", weight, "3 /rad"]


def test_lines_say_who_is_connected_how_strongly_by_which_model_and_when():
    found = {ends: link.label for ends, link in links(RING).items()}
    minus = "\N{MINUS SIGN}"
    assert found == {
        ("ring", "calm", "excitatory"): "[3]",
        ("calm", "ring", "inhibitory"): f"2 synapses\n{minus}2 to {minus}1, 20 ms",
        ("u", "ring", "sensorial"): f"to all\n{minus}1 to 1 /mm",
        ("ring", "ring", "excitatory"): "all to all others\n0.5, first order",
        ("ring", "y", "readout"): "0 to 7 deg",
    }


def test_a_gate_is_a_line_to_the_target_of_what_it_gates():
    text = HEAD + (
        "inputs: {u: {unit: '1', range: [0, 1]}}\nneurons:\n  g: {model: identity, role: excitatory}\n"
        "  n: {model: identity, role: excitatory}\nsynapses:\n  - {from: u, to: g, weight: 1}\n"
        "  - {from: u, to: n, weight: 1, model: gated, gate: g}\noutputs: {y: {unit: '1', readout: {n: 1}}}\n"
    )
    gate = links(text)["g", "n", "gate"]
    assert (gate.label, gate.details) == ("\N{MULTIPLICATION SIGN} u", "g gates u to n")


@pytest.mark.parametrize(
    ("indptr", "sources", "sizes", "expected"),
    [
        ([0, 1, 2, 3], [0, 1, 2], (3, 3), "one to one"),
        ([0, 2, 4], [0, 1, 0, 1], (2, 2), "all to all"),
        ([0, 1, 2], [1, 0], (2, 2), "all to all others"),
        ([0, 1, 2, 3], [0, 0, 0], (1, 3), "to all"),
        ([0, 3], [0, 1, 2], (3, 1), "from all"),
        ([0, 2, 4], [0, 2, 1, 2], (4, 2), "2 to each"),
        ([0, 1, 1, 4], [0, 1, 2, 3], (4, 3), "33 % of all pairs"),
    ],
)
def test_who_is_connected_with_whom(indptr, sources, sizes, expected):
    ends = np.array(indptr, dtype=np.int64), np.array(sources, dtype=np.int32)
    assert rule_text(Projection("a", "a", *ends, 1.0, "excitatory"), *sizes) == expected


@pytest.mark.parametrize("name", shipped_names("circuits"))
def test_nothing_overlaps_in_shipped_circuits(name):
    layout = layout_of(load_circuit(name))
    assert_nothing_overlaps(layout)
    assert_instances_stand_apart(layout)
    assert layout.homeless == ()


def assert_instances_stand_apart(layout):
    for one, other in combinations(layout.groups, 2):
        assert not one.box.overlaps(other.box, 4.0), (one.name, other.name)
    for group in layout.groups:
        assert group.box.top >= -1e-9
        assert group.box.bottom <= layout.height + 1e-9
        for node in layout.nodes.values():
            inside = node.name.startswith(f"{group.name}.") and node.role not in {"input", "output"}
            assert group.box.overlaps(node.box) == inside, (group.name, node.name)


@pytest.mark.parametrize("seed", range(12))
def test_instances_stand_apart_in_any_circuit(seed):
    random = np.random.default_rng(seed)
    graph = dense(seed, int(random.integers(4, 20)))
    groups = [f"g{i}." for i in range(int(random.integers(1, 4)))]
    called = {each.name: f"{random.choice(['', *groups])}{each.name}" for each in graph.neurons}
    layout = layout_of(
        replace(
            graph,
            neurons=tuple(replace(each, name=called[each.name]) for each in graph.neurons),
            synapses=tuple(
                replace(each, source=called.get(each.source, each.source), target=called[each.target])
                for each in graph.synapses
            ),
            outputs=tuple(
                replace(each, readout=tuple((called[name], weight) for name, weight in each.readout))
                for each in graph.outputs
            ),
        )
    )
    assert_nothing_overlaps(layout)
    assert_instances_stand_apart(layout)


def test_nodes_of_an_instance_are_called_as_in_its_file():
    layout = layout_of(load_circuit("binn_planar"))
    assert [group.name for group in layout.groups] == ["lateral", "sagittal"]
    assert layout.nodes["lateral.q1"].lines == ("q1",)


def test_instances_are_clusters_of_the_dot_file(tmp_path):
    draw_circuit(load_circuit("binn_planar"), tmp_path / "planar.dot")
    text = (tmp_path / "planar.dot").read_text(encoding="utf-8")
    assert 'subgraph "cluster_lateral" {\n    label="lateral";' in text
    draw_circuit(parse_circuit(RING), tmp_path / "ring.dot")
    assert 'label="ring\\n8 neurons"' in (tmp_path / "ring.dot").read_text(encoding="utf-8")


def test_the_page_tells_about_projections(tmp_path):
    draw_circuit(parse_circuit(RING), tmp_path / "ring.html")
    page = (tmp_path / "ring.html").read_text(encoding="utf-8")
    assert (
        "ring to ring: excitatory, all to all others, weight 0.5, first order, goes back in a cycle" in page
    )


def test_a_hundred_thousand_neurons_are_drawn_in_a_moment(tmp_path):
    text = HEAD + (
        "populations:\n  a: {size: 80000, model: leaky_linear, role: excitatory, tau: 10 ms}\n"
        "  b: {size: 20000, model: leaky_linear, role: inhibitory, tau: 10 ms}\nprojections:\n"
        "  - {from: a, to: b, connect: {in_degree: 10}, weight: 0.1}\n"
        "  - {from: b, to: a, connect: {in_degree: 10}, weight: -0.1}\n"
        "outputs: {y: {unit: '1', readout: {a: 1}}}\n"
    )
    graph = parse_circuit(text)
    start = time.perf_counter()
    draw_circuit(graph, tmp_path / "large.svg")
    assert time.perf_counter() - start < 5.0  # 0.3 s on an idle core
