"""Circuits that are hard to draw, and what a drawing must be, measured on its geometry."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from circuitkit.base.units import DIMENSIONLESS, parse_unit
from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode, Synapse
from circuitkit.circuit.models import neuron_model
from circuitkit.draw.layout import Layout, arrange
from circuitkit.draw.network import make_network
from circuitkit.draw.shapes import Box, block_size
from circuitkit.draw.style import SMALL

RIM = 9.0  # a rounded node begins up to this far inside its box


def layout_of(graph: CircuitGraph) -> Layout:
    return arrange(make_network(graph))


def _inside(points: np.ndarray, box: Box, shrunk: float) -> bool:
    half = (box.width / 2 - shrunk, box.height / 2 - shrunk)
    return bool((np.abs(points - (box.x, box.y)) < half).all(axis=1).any())


def assert_nothing_overlaps(layout: Layout) -> None:
    for one, other in combinations(layout.nodes.values(), 2):
        assert not one.box.overlaps(other.box, 6.0), (one.name, other.name)
    for route in layout.routes:
        points = np.array(route.polyline)
        for node in layout.nodes.values():
            ends = node.name in {route.link.source, route.link.target}
            assert not _inside(points, node.box, RIM if ends else -1.5), (route.link, node.name)
        assert points.min() >= -1e-9
        assert (points <= (layout.width, layout.height)).all()
    for label in layout.labels:
        width, height = block_size(label.text, SMALL)
        assert (label.box.width, label.box.height) > (width, height)
        for node in layout.nodes.values():
            assert not label.box.overlaps(node.box), (label.text, node.name)
    for one, other in combinations(layout.labels, 2):
        assert not one.box.overlaps(other.box), (one.text, other.text)
    shown = {label.link for label in layout.labels} | set(layout.homeless)
    assert shown == {route.link for route in layout.routes if route.link.label}


def dense(seed: int, count: int, names: str = "n{}") -> CircuitGraph:
    """A circuit with more synapses, cycles and labels than one would like to see."""
    random = np.random.default_rng(seed)
    roles = random.choice(["excitatory", "inhibitory"], count).tolist()
    model = neuron_model("sigmoid")
    neurons = [
        Neuron(names.format(i), model, role, {"slope": 1.0, "shift": 0.0}, DIMENSIONLESS)
        for i, role in enumerate(roles)
    ]
    inputs = tuple(InputNode(f"u{i}", parse_unit("mm"), -1.0, 1.0) for i in range(3))
    synapses = []
    for target in neurons:
        for node in (*inputs, *neurons):
            if random.random() < 3.0 / count:
                sign = -1.0 if isinstance(node, Neuron) and node.role == "inhibitory" else 1.0
                weight = sign * float(random.choice([1.0, round(random.exponential(), 3)]))
                kind = node.role if isinstance(node, Neuron) else "sensorial"
                synapses.append(Synapse(node.name, target.name, weight, kind))
    outputs = tuple(
        OutputNode(
            f"y{i}", parse_unit("deg"), ((neurons[i].name, 0.1), (neurons[-1 - i].name, -0.2)), -1.0, 1.0, 0.1
        )
        for i in range(2)
    )
    return CircuitGraph("dense", "", "ordered", 0.01, inputs, tuple(neurons), tuple(synapses), outputs, {})
