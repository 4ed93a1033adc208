"""The legend of a network drawing: only what occurs in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from circuitkit.draw.layout import Layout, NodeBox
from circuitkit.draw.network import Link
from circuitkit.draw.routing import Route
from circuitkit.draw.shapes import Box, text_size
from circuitkit.draw.style import SMALL

_ROW = 17.0
_SAMPLE = 26.0
_SPACE = 6.0
_BETWEEN = 18.0
_LEAST_WIDTH = 330.0
_ROLES = {
    "input": ("tag", "sensorial input"),
    "excitatory": ("capsule", "excitatory neuron"),
    "inhibitory": ("octagon", "inhibitory neuron"),
    "output": ("rectangle", "output"),
}
_KINDS = {
    "sensorial": "sensorial",
    "excitatory": "excites",
    "inhibitory": "inhibits",
    "readout": "is read out",
    "gate": "scales a synapse",
}


@dataclass(frozen=True)
class Legend:
    """Samples and words from the upper left corner of the legend, y downwards, [pt]."""

    nodes: tuple[NodeBox, ...]
    routes: tuple[Route, ...]
    texts: tuple[tuple[float, float, str], ...]
    width: float
    height: float


def make_legend(layout: Layout) -> Legend:
    """Make the legend for the roles and kinds that a layout shows, in rows no wider than the drawing."""
    roles = [role for role in _ROLES if any(node.role == role for node in layout.nodes.values())]
    links = [route.link for route in layout.routes]
    kinds = [kind for kind in _KINDS if any(link.kind == kind for link in links)]
    arcs = [link for link in links if link.backward]
    entries = [(_ROLES[role][1], role) for role in roles] + [(_KINDS[kind], kind) for kind in kinds]
    if arcs:
        entries.append(("arc back: closes a cycle", ""))
    if any(not link.label for link in links):
        entries.append(("a line without weight: 1, or \N{MINUS SIGN}1 if it inhibits", ""))
    if layout.homeless:
        entries.append((f"{len(layout.homeless)} lines have words without room", ""))
    return _flow(entries, max(layout.width, _LEAST_WIDTH), len(roles))


def _flow(entries: Sequence[tuple[str, str]], width: float, n_roles: int) -> Legend:
    nodes: list[NodeBox] = []
    routes: list[Route] = []
    texts: list[tuple[float, float, str]] = []
    x, row, widest = 0.0, 0, 0.0
    for i, (text, what) in enumerate(entries):
        sample = _SAMPLE + _SPACE if what else 0.0
        needed = sample + text_size(text, SMALL)[0]
        new_kind = i == n_roles or (not what and entries[i - 1][1])
        if x > 0 and (x + needed > width or new_kind):
            x, row = 0.0, row + 1
        y = (row + 0.5) * _ROW
        if i < n_roles:
            box = Box(x + _SAMPLE / 2, y, _SAMPLE, 13.0)
            nodes.append(NodeBox(f"legend {what}", what, _ROLES[what][0], ("",), box))
        elif what:
            link = Link("legend", what, what)
            routes.append(Route(link, ((x, y), (x + _SAMPLE, y)), "ML", (1.0, 0.0)))
        texts.append((x + sample, y, text))
        x += needed
        widest = max(widest, x)
        x += _BETWEEN
    return Legend(tuple(nodes), tuple(routes), tuple(texts), widest, (row + 1) * _ROW)
