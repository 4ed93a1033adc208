"""The resolved graph: names, and its view in networkx."""

from __future__ import annotations

import pickle

import networkx as nx
import strategies
from hypothesis import given, settings

from circuitkit.circuit import load_circuit

few = settings(max_examples=25, deadline=None)


@given(strategies.circuit_graphs())
@few
def test_names_are_unique_and_in_order(graph):
    names = list(graph.names())
    assert names == [node.name for node in (*graph.inputs, *graph.neurons, *graph.outputs)]
    assert len(set(names)) == len(names)


@given(strategies.circuit_graphs())
@few
def test_the_networkx_view_has_every_node_and_edge_with_its_attributes(graph):
    view = graph.to_networkx()
    assert tuple(view) == graph.names()
    assert {name: data["node"] for name, data in view.nodes(data=True)} == {
        node.name: node for node in (*graph.inputs, *graph.neurons, *graph.outputs)
    }
    edges = {(s.source, s.target): {"weight": s.weight, "kind": s.kind} for s in graph.synapses}
    for output in graph.outputs:
        for neuron, weight in output.readout:
            edges[neuron, output.name] = {"weight": weight, "kind": "readout"}
    assert {(source, target): data for source, target, data in view.edges(data=True)} == edges


def test_networkx_finds_the_circle_of_the_binn():
    view = load_circuit("binn_lateral").to_networkx()
    circles = [part for part in nx.strongly_connected_components(view) if len(part) > 1]
    assert circles == [{"h1", "h2", "p1", "p2"}]


@given(strategies.circuit_graphs())
@few
def test_graphs_survive_pickling(graph):
    assert pickle.loads(pickle.dumps(graph)) == graph
