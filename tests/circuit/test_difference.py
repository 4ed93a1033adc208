"""What changed between two circuits."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import strategies
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from circuitkit.base.source import data_folder
from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.circuit.authoring.difference import Change, compare_circuits
from circuitkit.circuit.graph import Population, Projection
from circuitkit.circuit.models import neuron_model

TEXT = (data_folder("circuits") / "binn_lateral.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def binn():
    return load_circuit("binn_lateral")


def changed(binn, old, new):
    """The changes that another spelling of the BiNN's text makes."""
    assert old in TEXT
    return compare_circuits(binn, parse_circuit(TEXT.replace(old, new)))


@given(strategies.circuit_graphs())
@settings(max_examples=30, deadline=None)
def test_a_circuit_does_not_differ_from_itself(graph):
    assert compare_circuits(graph, graph) == ()


@given(strategies.circuit_graphs(), strategies.circuit_graphs())
@settings(max_examples=30, deadline=None)
def test_circuits_that_are_not_equal_differ(one, other):
    assume(one != other)
    assert compare_circuits(one, other)


def test_a_weight(binn):
    assert changed(binn, "{from: h1, to: p2, weight: -1}", "{from: h1, to: p2, weight: -2}") == (
        Change("synapse", "h1 -> p2", "changed", "weight", "-1", "-2"),
    )


def test_a_parameter_and_what_follows_from_it(binn):
    assert changed(binn, "leak: {value: 5 %", "leak: {value: 4 %") == (
        Change("parameter", "leak", "changed", "value", "5 %", "4 %"),
        Change("output", "ankle_roll", "changed", "leak", "5 %", "4 %"),
    )


def test_the_timing_and_the_control_step(binn):
    text = TEXT.replace("timing: ordered", "timing: synchronous").replace(
        "control_step: 10 ms", "control_step: 5 ms"
    )
    assert compare_circuits(binn, parse_circuit(text)) == (
        Change("circuit", "", "changed", "timing", "ordered", "synchronous"),
        Change("circuit", "", "changed", "control step", "10 ms", "5 ms"),
    )


def test_synapses_that_have_come_and_gone(binn):
    assert changed(binn, "{from: p1, to: h1, weight: 1}", "{from: p1, to: h2, weight: 1}") == (
        Change("synapse", "p1 -> h1", "removed", "", "weight 1", ""),
        Change("synapse", "p1 -> h2", "added", "", "", "weight 1"),
    )


def test_a_change_too_small_for_six_digits_is_shown(binn):
    (change,) = changed(binn, "{from: h1, to: p2, weight: -1}", "{from: h1, to: p2, weight: -1.000000001}")
    assert (change.old, change.new) == ("-1", "-1.0000000010000001")


def test_another_order_of_the_neurons_counts(binn):
    graph = replace(binn, neurons=(*binn.neurons[1:], binn.neurons[0]))
    (change,) = compare_circuits(binn, graph)
    assert (change.kind, change.what, change.field) == ("neuron", "changed", "order")
    assert change.new == "bf, rf, q1, q2, q3, q4, h1, h2, p1, p2, lf"


def test_a_neuron_of_another_name(binn):
    assert changed_names(binn, {"q1": "edge"}) == (Change("neuron", "edge", "renamed", "", "q1", "edge"),)


@given(st.permutations(["lf", "bf", "q1", "q2", "h1", "p2", "zmp_y", "ankle_roll"]), st.integers(1, 8))
@settings(max_examples=25, deadline=None)
def test_any_nodes_of_other_names(names, count):
    binn = load_circuit("binn_lateral")
    changes = changed_names(binn, {name: f"new_{name}" for name in names[:count]})
    assert {(change.what, change.old, change.new) for change in changes} == {
        ("renamed", name, f"new_{name}") for name in names[:count]
    }


def changed_names(binn, names):
    text = re.sub(r"\b\w+\b", lambda match: names.get(match[0], match[0]), _without_texts(TEXT))
    before = parse_circuit(_without_texts(TEXT))
    assert before.neurons[0].name == binn.neurons[0].name
    return compare_circuits(before, parse_circuit(text))


def _without_texts(text):
    return re.sub(r'description: ("[^"]*"|[^}\n]*)', 'description: ""', text)


def test_a_renamed_neuron_that_changed_too_has_gone_and_another_has_come(binn):
    text = re.sub(r"\bh1\b", "edge", TEXT).replace(
        "edge: {model: sigmoid, role: inhibitory, slope: 500",
        "edge: {model: sigmoid, role: inhibitory, slope: 400",
    )
    changes = compare_circuits(binn, parse_circuit(text))
    assert {(change.what, change.name) for change in changes if change.kind == "neuron"} == {
        ("removed", "h1"),
        ("added", "edge"),
    }


def ring(binn, size=4, shift=0.0, sources=(1, 2, 3, 0)):
    """A circuit with a population that projects on itself."""
    model = neuron_model("sigmoid")
    values = {"slope": 1.0, "shift": np.linspace(0.0, 1.0, size) + shift}
    cells = Population("ring", size, model, "excitatory", values, DIMENSIONLESS)
    indptr = np.arange(size + 1, dtype=np.int64)
    lines = Projection("ring", "ring", indptr, np.array(sources, dtype=np.int32), 0.5, "excitatory")
    return replace(binn, populations=(cells,), projections=(lines,))


def test_populations_and_projections(binn):
    assert compare_circuits(ring(binn), ring(binn)) == ()
    assert compare_circuits(ring(binn), ring(binn, shift=1.0)) == (
        Change("population", "ring", "changed", "shift", "4 values, 0 to 1", "4 values, 1 to 2"),
    )
    assert compare_circuits(ring(binn), ring(binn, sources=(3, 0, 1, 2))) == (
        Change("projection", "ring -> ring", "changed", "synapses", "4", "4, other ones"),
    )
    values = "size 4, sigmoid, excitatory, unit 1, slope 1, shift 4 values, 0 to 1, noise 0"
    assert compare_circuits(binn, ring(binn)) == (
        Change("population", "ring", "added", "", "", values),
        Change("projection", "ring -> ring", "added", "", "", "synapses 4, weight 0.5"),
    )
