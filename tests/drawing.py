"""What a drawing must be, measured on its geometry."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from circuitkit.circuit.graph import CircuitGraph
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
