"""`draw_circuit`: the network as a picture that one would print, in any of five formats."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit.base.files import write_text
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.draw.dot import dot_text
from circuitkit.draw.layout import Layout, arrange
from circuitkit.draw.legend import Legend, make_legend
from circuitkit.draw.marks import add_group, add_line, add_node, add_text
from circuitkit.draw.network import Network, make_network
from circuitkit.draw.page import add_tooltips, html_page, tooltips
from circuitkit.draw.routing import Route
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
