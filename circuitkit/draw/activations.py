"""`draw_activations`: the activation function of every neuron (Fig. 6 of the paper) as small multiples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from circuitkit.base.units import DIMENSIONLESS, Unit
from circuitkit.circuit.graph import CircuitGraph, Neuron
from circuitkit.draw.layers import make_layers
from circuitkit.draw.network import make_network, parameter_texts
from circuitkit.draw.responses import centres, function, member, response, span
from circuitkit.draw.shapes import text_size
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    GREY,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
    tidy,
    write_picture,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_CURVES = 6
_MOST_COLUMNS = 3
_PANEL_WIDTH, _PANEL_HEIGHT = 2.75, 1.7  # [in]
_LEFT, _TOP, _BELOW, _LEGEND_ROW = 0.66, 0.34, 0.52, 0.155  # [in]
_ROOM = 72.0 * _PANEL_WIDTH  # for a title or an entry of the legend, [pt]
_BOUNDED = 1.5


@dataclass(frozen=True)
class Curve:
    """Neurons with one and the same function.

    Attributes:
        names: Of the neurons, or of populations.
        neuron: One of them.
    """

    names: tuple[str, ...]
    neuron: Neuron

    @property
    def text(self) -> str:
        """Names and parameters, such as `q1, q4: slope 0.1 /mm, shift 79.9 mm`."""
        values = ", ".join(parameter_texts(self.neuron))
        model = self.neuron.model.name.replace("_", " ")
        long = f"{', '.join(self.names)}: {values}"
        return long if _fits(long, SMALL) else f"{_names(self.names, SMALL, f': {model}')}: {model}"


@dataclass(frozen=True)
class Panel:
    """Curves in one axes: neurons of one layer, one role, one unit of activation, with states or without.

    Attributes:
        role: Of the neurons.
        unit: Of their activation.
        names: In file order.
        curves: Their functions.
    """

    role: str
    unit: Unit
    names: tuple[str, ...]
    curves: tuple[Curve, ...]

    @property
    def title(self) -> str:
        """The neurons and their role."""
        return f"{_names(self.names, SMALL + 1.0, f' ({self.role})')} ({self.role})"


def _names(names: Sequence[str], size: float, beside: str) -> str:
    """Return the names, or the first and the last of them, where there is no room for more beside a text."""
    every = ", ".join(names)
    return every if len(names) == 1 or _fits(every + beside, size) else f"{names[0]} to {names[-1]}"


def _fits(text: str, size: float) -> bool:
    return text_size(text, size)[0] <= _ROOM


def draw_activations(graph: CircuitGraph, path: str | Path) -> None:
    """Draw the activation function (eq. 12) of every neuron; equal ones share a curve.

    Of a neuron with states it is what it settles to at a held activation: its output, or its rate if it
    spikes. A population shows its first, middle and last member where they differ.

    Args:
        graph: The circuit.
        path: Where the picture goes: .png, .svg or .pdf.

    Raises:
        InputError: Another suffix.
        OutputError: The file cannot be written.
    """
    write_picture(path, lambda: activations_figure(graph))


def activations_figure(graph: CircuitGraph) -> Figure:
    """Return the curves as a matplotlib figure."""
    panels = make_panels(graph)
    columns = min(_MOST_COLUMNS, max(1, len(panels)))
    columns = math.ceil(len(panels) / math.ceil(len(panels) / columns)) if panels else 1
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    legends = [_LEGEND_ROW * max(len(panel.curves) for panel in row) for row in rows]
    heights = [_TOP + _PANEL_HEIGHT + _BELOW + legend for legend in legends]
    width, height = columns * (_LEFT + _PANEL_WIDTH) + 0.15, sum(heights) or 1.0
    with house_style():
        figure = new_figure(width, height)
        top = _TOP
        for row, tall in zip(rows, heights, strict=True):
            for i, panel in enumerate(row):
                left = i * (_LEFT + _PANEL_WIDTH) + _LEFT
                axes = axes_at(figure, left, top, _PANEL_WIDTH - 0.1, _PANEL_HEIGHT)
                _paint(axes, panel, first=i == 0)
            top += tall
    return figure


def make_panels(graph: CircuitGraph) -> list[Panel]:
    """Make neurons grouped by layer, role, unit and kind of answer, no more than six curves together."""
    layer_of = make_layers(make_network(graph)).layer_of
    groups: dict[tuple[Any, ...], list[tuple[str, Neuron]]] = {}
    for node, name, neuron in _shown_neurons(graph):
        answer = (bool(neuron.model.states), neuron.model.spike is not None)
        key = (layer_of[node], neuron.role, neuron.activation_unit, answer)
        groups.setdefault(key, []).append((name, neuron))
    panels = []
    for (_, role, unit, _), members in sorted(groups.items(), key=lambda each: each[0][0]):
        alike: dict[tuple[object, ...], list[str]] = {}
        first: dict[tuple[object, ...], Neuron] = {}
        for name, neuron in members:
            values = (neuron.model, *neuron.parameters.items())
            alike.setdefault(values, []).append(name)
            first.setdefault(values, neuron)
        curves = [Curve(tuple(names), first[values]) for values, names in alike.items()]
        for i in range(0, len(curves), _MOST_CURVES):
            shown = curves[i : i + _MOST_CURVES]
            names = [name for name, _ in members if any(name in curve.names for curve in shown)]
            panels.append(Panel(role, unit, tuple(names), tuple(shown)))
    return panels


def _shown_neurons(graph: CircuitGraph) -> Iterator[tuple[str, str, Neuron]]:
    """Yield neurons with node and name; of a population one member for all, or three where they differ."""
    for neuron in graph.neurons:
        yield neuron.name, neuron.name, neuron
    for population in graph.populations:
        if all(np.ndim(values) == 0 for values in population.parameters.values()):
            yield population.name, population.name, member(population, 0)
            continue
        for index in dict.fromkeys((0, population.size // 2, population.size - 1)):
            shown = member(population, index)
            yield population.name, shown.name, shown


def _paint(axes: Axes, panel: Panel, *, first: bool) -> None:
    low, high = span([curve.neuron for curve in panel.curves])
    scale = panel.unit.scale
    answers = []
    for i, curve in enumerate(panel.curves):
        colour, dashes = CYCLE[i % len(CYCLE)], DASHES[i % len(DASHES)]
        found = response(curve.neuron, low, high)
        answers.append(found)
        style: Any = {"color": colour, "linestyle": dashes, "linewidth": 1.5}
        axes.plot(found.activation / scale, found.output, label=curve.text, **style)
        for centre in () if curve.neuron.model.states else centres(curve.neuron):
            at = function(curve.neuron, np.array([centre]))
            axes.plot(centre / scale, at, marker="o", markersize=3.2, color=colour, linestyle="none")
    bottom, top = axes.get_ylim()
    if bottom > -_BOUNDED and top < _BOUNDED:
        axes.set_ylim(min(bottom, -0.05), max(top, 1.05))
    axes.set_xlim(low / scale, high / scale)
    axes.set_title(panel.title, loc="left", fontsize=SMALL + 1.0)
    axes.locator_params(axis="x", nbins=6)
    axes.set_xlabel(f"activation A [{panel.unit}]")
    what, unit = answers[0].what, answers[0].unit
    if first or (what, unit) != ("output", DIMENSIONLESS):
        axes.set_ylabel(f"{what} O [{unit}]" if unit == DIMENSIONLESS else f"{what} [{unit}]")
    axes.axvline(0.0, color=GREY, linewidth=0.5, zorder=0)
    tidy(axes)
    corner = -0.40 / _PANEL_HEIGHT
    plain_legend(axes, "upper left", (0.0, corner), handlelength=2.2, borderaxespad=0.0, labelspacing=0.25)
