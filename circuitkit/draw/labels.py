"""Weights beside the lines: where they hide nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.draw.layers import Link
from circuitkit.draw.routing import HEAD, Route
from circuitkit.draw.shapes import Box, text_size
from circuitkit.draw.style import SMALL, number
from circuitkit.units import DIMENSIONLESS, Unit

_MARGIN = 1.5
_CANDIDATES = 48


@dataclass(frozen=True)
class Label:
    """A weight in the drawing; it stands on the line of its link.

    Attributes:
        link: The link.
        text: The weight with its unit.
        box: Extent of the text.
        hides: How many points of other lines lie under it.
    """

    link: Link
    text: str
    box: Box
    hides: int


def label_texts(graph: CircuitGraph, links: Iterable[Link]) -> dict[Link, str]:
    """What stands on each line: the weight in the units of its ends, unless that follows from the line.

    A weight of 1 needs no label, nor does -1 on an inhibitory line. All are compared in SI units.
    """
    return {
        link: weight_text(graph, link)
        for link in links
        if link.weight != 1.0 and not (link.weight == -1.0 and link.kind == "inhibitory")
    }


def weight_text(graph: CircuitGraph, link: Link) -> str:
    """The weight of a link in the unit of its target over the unit of its source, such as `-2 mm/N`."""
    units: dict[str, Unit] = {node.name: node.unit for node in graph.inputs}
    units |= {output.name: output.unit for output in graph.outputs}
    units |= {neuron.name: neuron.activation_unit for neuron in graph.neurons if neuron.name == link.target}
    target, source = units[link.target], units.get(link.source, DIMENSIONLESS)
    if source.dimension == target.dimension:
        return number(link.weight)
    above = "" if target.symbol == "1" else target.symbol
    below = "" if source.symbol == "1" else f"/{source.symbol}"
    return f"{number(link.weight * source.scale / target.scale)} {above}{below}"


def place_labels(
    texts: Mapping[Link, str], routes: Sequence[Route], nodes: Sequence[Box]
) -> tuple[list[Label], list[Link]]:
    """Put every label on its line where it covers no node, no label, and as few other lines as possible.

    Args:
        texts: The labels.
        routes: All lines.
        nodes: Extents of all nodes.

    Returns:
        The labels, and the links whose label found no free place.
    """
    cloud = _Cloud(routes)
    placed: list[Label] = []
    homeless: list[Link] = []
    for i, route in sorted(enumerate(routes), key=lambda each: len(each[1].polyline)):
        if route.link not in texts:
            continue
        taken = [*nodes, *(label.box for label in placed)]
        label = _best_place(texts[route.link], route, cloud.without(i), taken)
        if label is None:
            homeless.append(route.link)
        else:
            placed.append(label)
    return placed, homeless


def _best_place(text: str, route: Route, others: Callable[[Box], int], taken: Sequence[Box]) -> Label | None:
    """The place that hides least of the other lines, and then the one nearest to three fifths of the way."""
    width, height = (size + 2 * _MARGIN for size in text_size(text, SMALL))
    line = route.polyline
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    found: Label | None = None
    least = (0, 0.0)
    for at in np.linspace(HEAD, max(HEAD, way[-1] - HEAD - 4.0), _CANDIDATES).tolist():
        x, y = (float(np.interp(at, way, line[:, axis])) for axis in (0, 1))
        if route.link.source == route.link.target:  # a loop is too small to carry its label: beyond it
            x = (route.tip[0] + float(line[0, 0])) / 2
            top = line[:, 1].min() if route.heading[1] > 0 else line[:, 1].max()
            y = float(top) - route.heading[1] * (height / 2 + 0.5)
        box = Box(x, y, width, height)
        if any(box.overlaps(other, _MARGIN) for other in taken):
            continue
        cost = (others(box), abs(at / float(way[-1]) - (0.5 if route.heading[0] == 0.0 else 0.6)))
        if found is None or cost < least:
            found, least = Label(route.link, text, box, cost[0]), cost
    return found


class _Cloud:
    """Points on all lines, sorted by x, so that those in a box are found without looking at the others."""

    def __init__(self, routes: Sequence[Route]) -> None:
        points = np.concatenate([np.empty((0, 2)), *(route.polyline for route in routes)])
        owners = np.repeat(np.arange(len(routes)), [len(route.polyline) for route in routes])
        order = np.argsort(points[:, 0], kind="stable")
        self._x, self._y, self._owner = points[order, 0], points[order, 1], owners[order]

    def without(self, owner: int) -> Callable[[Box], int]:
        """A function that counts the points of other lines in a box or within 1 pt of it."""

        def count(box: Box) -> int:
            begin, end = np.searchsorted(self._x, (box.left - 1.0, box.right + 1.0))
            near = np.abs(self._y[begin:end] - box.y) < box.height / 2 + 1.0
            return int(np.count_nonzero(near & (self._owner[begin:end] != owner)))

        return count
