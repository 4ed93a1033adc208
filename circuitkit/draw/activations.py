"""`draw_activations`: the activation function of every neuron (Fig. 6 of the paper) as small multiples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from circuitkit.circuit.graph import CircuitGraph, Neuron
from circuitkit.circuit.models.model import ACTIVATION
from circuitkit.draw.layers import make_layers
from circuitkit.draw.network import make_network
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    GREY,
    PICTURES,
    SMALL,
    house_style,
    new_figure,
    require_suffix,
    save_figure,
    tidy,
)
from circuitkit.draw.wording import parameter_text
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.state import FloatArray
from circuitkit.units import Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_CURVES = 6
_MOST_COLUMNS = 3
_PANEL_WIDTH, _PANEL_HEIGHT = 2.75, 1.7  # [in]
_LEFT, _TOP, _BELOW, _LEGEND_ROW = 0.62, 0.34, 0.52, 0.155  # [in]
_POINTS = 801
_TAILS = 6.0  # how many widths of a curve are shown beside its centre
_BOUNDED = 1.5


@dataclass(frozen=True)
class Curve:
    """Neurons with one and the same function."""

    neurons: tuple[Neuron, ...]

    @property
    def text(self) -> str:
        """Names and parameters, such as `q1, q4: slope 0.1 /mm, shift 79.9 mm`."""
        first = self.neurons[0]
        unit = first.activation_unit
        values = (
            parameter_text(parameter, first.parameters[parameter.name], unit)
            for parameter in first.model.parameters
        )
        return f"{', '.join(neuron.name for neuron in self.neurons)}: {', '.join(values)}"

    def centres(self) -> list[float]:
        """Activations at which something happens, [SI]."""
        first = self.neurons[0]
        return [first.parameters[p.name] for p in first.model.parameters if p.unit_rule.activation == 1]

    def width(self) -> float:
        """How much activation the curve needs to rise, [SI]; 0 if it jumps."""
        first = self.neurons[0]
        slopes = [first.parameters[p.name] for p in first.model.parameters if p.unit_rule.activation == -1]
        return max((1 / abs(slope) for slope in slopes if slope), default=0.0)

    def values(self, activation: FloatArray) -> FloatArray:
        """Outputs at these activations [SI], dimensionless."""
        first = self.neurons[0]
        with np.errstate(all="ignore"):
            result = first.model.output.evaluate(
                {**first.parameters, ACTIVATION: activation}, NUMPY_FUNCTIONS
            )
        return np.broadcast_to(np.asarray(result, dtype=np.float64), activation.shape)


@dataclass(frozen=True)
class Panel:
    """Curves in one axes: neurons of one layer, one role and one unit of activation.

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
        names = list(self.names)
        shown = ", ".join(names) if len(names) <= _MOST_CURVES else f"{names[0]} to {names[-1]}"
        return f"{shown} ({self.role})"

    def span(self) -> tuple[float, float]:
        """The activations that show what the curves do, and 0, [SI]."""
        centres = [centre for curve in self.curves for centre in curve.centres()] or [0.0]
        tail = _TAILS * max(curve.width() for curve in self.curves)
        low, high = min(centres), max(centres)
        beside = max(tail, 0.5 * (high - low), 0.5 * max(abs(low), abs(high))) or 1.0
        return min(low - beside, 0.0), max(high + beside, 0.0)


def draw_activations(graph: CircuitGraph, path: str | Path) -> None:
    """Draw the activation function (eq. 12) of every neuron; equal ones share a curve.

    Args:
        graph: The circuit.
        path: Where the picture goes: .png, .svg or .pdf.

    Raises:
        InputError: Another suffix.
        OutputError: The file cannot be written.
    """
    require_suffix(path, PICTURES)
    save_figure(activations_figure(graph), path)


def activations_figure(graph: CircuitGraph) -> Figure:
    """The curves as a matplotlib figure."""
    panels = make_panels(graph)
    columns = min(_MOST_COLUMNS, max(1, len(panels)))
    columns = math.ceil(len(panels) / math.ceil(len(panels) / columns)) if panels else 1
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    legends = [_LEGEND_ROW * max(len(panel.curves) for panel in row) for row in rows]
    heights = [_TOP + _PANEL_HEIGHT + _BELOW + legend for legend in legends]
    width, height = columns * (_LEFT + _PANEL_WIDTH) + 0.15, sum(heights) or 1.0
    with house_style():
        figure = new_figure(width, height)
        top = height
        for row, tall in zip(rows, heights, strict=True):
            for i, panel in enumerate(row):
                left, bottom = i * (_LEFT + _PANEL_WIDTH) + _LEFT, top - _TOP - _PANEL_HEIGHT
                frame = (left / width, bottom / height, (_PANEL_WIDTH - 0.1) / width, _PANEL_HEIGHT / height)
                _paint(figure.add_axes(frame), panel, first=i == 0)
            top -= tall
    return figure


def make_panels(graph: CircuitGraph) -> list[Panel]:
    """Neurons grouped by layer, role and unit, no more than six curves together."""
    layer_of = make_layers(make_network(graph)).layer_of
    groups: dict[tuple[int, str, Unit], list[Neuron]] = {}
    for neuron in graph.neurons:
        key = (layer_of[neuron.name], neuron.role, neuron.activation_unit)
        groups.setdefault(key, []).append(neuron)
    panels = []
    for (_, role, unit), neurons in sorted(groups.items(), key=lambda each: each[0][0]):
        alike: dict[tuple[object, ...], list[Neuron]] = {}
        for neuron in neurons:
            alike.setdefault((neuron.model, *neuron.parameters.items()), []).append(neuron)
        curves = [Curve(tuple(each)) for each in alike.values()]
        for i in range(0, len(curves), _MOST_CURVES):
            shown = curves[i : i + _MOST_CURVES]
            names = [neuron.name for neuron in neurons if any(neuron in curve.neurons for curve in shown)]
            panels.append(Panel(role, unit, tuple(names), tuple(shown)))
    return panels


def _paint(axes: Axes, panel: Panel, *, first: bool) -> None:
    low, high = panel.span()
    activation = _grid(panel.curves, low, high)
    scale = panel.unit.scale
    for i, curve in enumerate(panel.curves):
        colour, dashes = CYCLE[i % len(CYCLE)], DASHES[i % len(DASHES)]
        values = curve.values(activation)
        axes.plot(activation / scale, values, color=colour, linestyle=dashes, linewidth=1.5, label=curve.text)
        for centre in curve.centres():
            at = curve.values(np.array([centre]))
            axes.plot(centre / scale, at, marker="o", markersize=3.2, color=colour, linestyle="none")
    bottom, top = axes.get_ylim()
    if bottom > -_BOUNDED and top < _BOUNDED:
        axes.set_ylim(min(bottom, -0.05), max(top, 1.05))
    axes.set_xlim(low / scale, high / scale)
    axes.set_title(panel.title, loc="left", fontsize=SMALL + 1.0)
    axes.locator_params(axis="x", nbins=6)
    axes.set_xlabel(f"activation A [{panel.unit}]")
    if first:
        axes.set_ylabel("output O [1]")
    axes.axvline(0.0, color=GREY, linewidth=0.5, zorder=0)
    tidy(axes)
    corner = -0.40 / _PANEL_HEIGHT
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(0.0, corner),
        frameon=False,
        handlelength=2.2,
        borderaxespad=0.0,
        labelspacing=0.25,
        borderpad=0.0,
    )


def _grid(curves: Sequence[Curve], low: float, high: float) -> FloatArray:
    """Activations to compute at: evenly spaced, and close together where a curve is steep."""
    parts = [np.linspace(low, high, _POINTS)]
    for curve in curves:
        for centre in curve.centres():
            width = max(curve.width(), 1e-9 * (high - low))
            parts += [
                centre + width * np.linspace(-_TAILS, _TAILS, 61),
                np.nextafter(centre, [-np.inf, np.inf]),
            ]
    grid = np.unique(np.concatenate(parts))
    return grid[(grid >= low) & (grid <= high)]
