"""`draw_circuit`: the network as a picture that one would print, with its legend, in any of five formats."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit.base.files import write_text
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.draw.formats import add_tooltips, dot_text, html_page, tooltips
from circuitkit.draw.layout import Layout, NodeBox, arrange
from circuitkit.draw.marks import add_group, add_line, add_node, add_text
from circuitkit.draw.network import Link, Network, make_network
from circuitkit.draw.routing import Route
from circuitkit.draw.shapes import Box, text_size
from circuitkit.draw.style import (
    INK,
    KIND_COLOUR,
    PAPER,
    POINTS_PER_INCH,
    SMALL,
    house_style,
    new_figure,
    require_suffix,
    save_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_MARGIN = 10.0
_LEGEND_GAP = 16.0


def draw_circuit(graph: CircuitGraph, path: str | Path) -> None:
    """Draw a circuit: layers from left to right, arrows excite, bars inhibit, arcs go back inside a cycle.

    Args:
        graph: The circuit.
        path: Where the picture goes; the suffix chooses the format: .png, .svg, .pdf, .dot (for Graphviz), or
            .html (a page of its own with the details of every node and line under the pointer).

    Raises:
        InputError: Another suffix.
        OutputError: The file cannot be written.
    """
    write = _WRITERS[require_suffix(path, tuple(_WRITERS))]
    write(make_network(graph), Path(path))


def circuit_figure(network: Network, *, with_legend: bool = True) -> Figure:
    """Return the picture as a matplotlib figure, as large as the circuit asks for."""
    layout = arrange(network)
    legend = make_legend(layout)
    width = max(layout.width, legend.width if with_legend else 0.0) + 2 * _MARGIN
    above = max([0.0, *(-label.box.top for label in layout.labels)])  # words on the uppermost line
    below = max([0.0, *(label.box.bottom - layout.height for label in layout.labels)])
    drawn = above + layout.height + below
    height = drawn + (_LEGEND_GAP + legend.height if with_legend else 0.0) + 2 * _MARGIN
    with house_style():
        figure = new_figure(width / POINTS_PER_INCH, height / POINTS_PER_INCH)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(0.0, width), ylim=(height, 0.0))
        left = (width - layout.width) / 2
        _paint(axes, layout, (left, _MARGIN + above))
        if with_legend:
            legend_at = ((width - legend.width) / 2, _MARGIN + drawn + _LEGEND_GAP)
            _paint_legend(axes, legend, legend_at)
    return figure


def _paint(axes: Axes, layout: Layout, shift: tuple[float, float]) -> None:
    by_source: dict[tuple[str, str], list[Route]] = {}
    for route in layout.routes:
        by_source.setdefault((route.link.source, route.link.way), []).append(route)
    # Each source's lines get one white rim together, so that crossings read as bridges and forks stay whole.
    for level, routes in enumerate(by_source.values()):
        for route in routes:
            add_line(axes, route, shift, 2.0 + 0.01 * level)
    for group in layout.groups:
        add_group(axes, group, shift)
    for node in layout.nodes.values():
        add_node(axes, node, shift)
    for label in layout.labels:
        x, y = label.box.x + shift[0], label.box.y + shift[1]
        colour = KIND_COLOUR[label.link.kind]
        pad = {"boxstyle": "square,pad=0.12", "facecolor": PAPER, "edgecolor": "none"}
        add_text(axes, (x, y), label.text, SMALL, colour, zorder=5.0, bbox=pad)


def _paint_legend(axes: Axes, legend: Legend, shift: tuple[float, float]) -> None:
    for node in legend.nodes:
        add_node(axes, node, shift)
    for route in legend.routes:
        add_line(axes, route, shift, 2.0)
    for x, y, text in legend.texts:
        add_text(axes, (x + shift[0], y + shift[1]), text, SMALL, INK, horizontalalignment="left")


def svg_text(network: Network) -> str:
    """Return the picture as SVG, with the details of every node and line as its tooltip."""
    figure = circuit_figure(network)
    buffer = io.BytesIO()
    with house_style():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return add_tooltips(buffer.getvalue().decode("utf-8"), tooltips(network))


def _write_picture(network: Network, path: Path) -> None:
    save_figure(circuit_figure(network), path)


def _write_svg(network: Network, path: Path) -> None:
    write_text(path, svg_text(network))


def _write_html(network: Network, path: Path) -> None:
    write_text(path, html_page(network, svg_text(network)))


def _write_dot(network: Network, path: Path) -> None:
    write_text(path, dot_text(network))


_WRITERS: Mapping[str, Callable[[Network, Path], None]] = {
    ".png": _write_picture,
    ".svg": _write_svg,
    ".pdf": _write_picture,
    ".dot": _write_dot,
    ".html": _write_html,
}


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
