"""Makes figure 6, the neurons' activation functions, and what shift and slope do to one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.circuit.graph import Neuron
from circuitkit.draw import draw_activations
from circuitkit.draw.responses import function
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
    tidy,
)
from circuitkit.paper.reproduce.drawing import save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import Claim, Finding, Picture, Table, all_hold, one_line

CIRCUIT = "binn_lateral"
_SLOPES, _SHIFTS = (5.0, 10.0, 50.0), (0.25, 0.5, 0.75)  # around those of p: 10 and 0.5
_INSIDE_M = (0.03, 0.02, 0.01, 0.0)  # of the edge
_SILENT, _ACTIVE = 0.01, 0.99
_BEYOND = 0.01  # of the force difference: lf, bf and rf must have changed by then
_WIDTH, _HEIGHT, _LEFT, _BETWEEN, _TOP, _BOTTOM = 2.6, 1.8, 0.6, 0.5, 0.32, 1.05  # [in]


class Fig6(ReportFigure):
    """Draws the neurons' curves and checks what the text says of them."""

    kind: ClassVar[str] = "fig6"
    order: ClassVar[int] = 6
    title: ClassVar[str] = "Figure 6: the activation functions"
    effort: ClassVar[Effort] = Effort(full_s=4.0, quick_s=4.0)

    def run(self, job: Job) -> Finding:
        """Draw the curves of the circuit's neurons and those of eq. 12, and check what the text says."""
        graph = load_circuit(CIRCUIT)
        neurons = {neuron.name: neuron for neuron in graph.neurons}
        for suffix in ("png", "pdf"):
            draw_activations(graph, job.folder / f"fig6.{suffix}")
        pictures = (
            Picture(
                "fig6.png",
                "The curves of the neurons of `circuits/binn_lateral.yaml`; equal ones share a line. A dot "
                "stands at the shift. The neurons of right edges, q1 and q3, see the mirrored ZMP.",
                "Output over activation for the four layers of neurons",
            ),
            Picture(
                save(_parameters_figure(neurons["p1"]), job.folder, "fig6_parameters"),
                "Eq. 12 with other slopes m (left) and other shifts s (right), around those of p1.",
                "Sigmoids with three slopes and with three shifts",
            ),
        )
        table = Table(
            "Output of a q neuron and of the p neuron behind it, by where the ZMP is",
            ("ZMP", ">q", ">p"),
            tuple(
                (_place(inside), f"{q:.3f}", f"{_output(neurons['p1'], q):.3f}")
                for inside, q in ((inside, _near_edge(neurons["q4"], inside)) for inside in _INSIDE_M)
            ),
        )
        return Finding(
            job.figure,
            self.title,
            _claims(neurons),
            pictures,
            (table,),
            one_line(_TEXT),
            data=_data(graph, neurons),
        )


_TEXT = """
The curves follow from the circuit file alone. The slope of the q neurons is soft, 100 per metre: half active
at the edge itself, a quarter active 11 mm inside it. That is the safety margin of section 4.2, and it has a
price: the ZMP of force cells cannot pass the outermost cell, where the edge of this circuit stands, so q
never gets beyond one half and neither does p. The tuned circuit puts the thresholds further inside.
"""


def _place(inside_m: float) -> str:
    return f"{1e3 * inside_m:g} mm inside the edge" if inside_m else "at the edge"


def _output(neuron: Neuron, activation: float) -> float:
    return float(function(neuron, np.array([activation]))[0])


def _near_edge(q: Neuron, inside_m: float) -> float:
    return _output(q, q.parameters["shift"] - inside_m)


def _claims(neurons: dict[str, Neuron]) -> tuple[Claim, ...]:
    lf, bf, rf, h, p, q = (neurons[name] for name in ("lf", "bf", "rf", "h1", "p1", "q4"))
    how = "the neurons' equations in the circuit file"
    feet = [
        _output(lf, 0.1 - _BEYOND) < _SILENT,
        _output(lf, 0.1 + _BEYOND) > _ACTIVE,
        _output(rf, -0.1 + _BEYOND) < _SILENT,
        _output(rf, -0.1 - _BEYOND) > _ACTIVE,
    ]
    window = [
        *(_output(bf, inside) > _ACTIVE for inside in (-0.1 + _BEYOND, 0.0, 0.1 - _BEYOND)),
        *(_output(bf, outside) < _SILENT for outside in (-0.1 - _BEYOND, 0.1 + _BEYOND)),
    ]
    margin, at_edge = _near_edge(q, 0.01), _near_edge(q, 0.0)
    return (
        Claim(
            "lf and rf switch where the feet's difference passes ±0.1",
            "a steep threshold, |m| = 500",
            f"from {_output(lf, 0.1 - _BEYOND):.2g} to {_output(lf, 0.1 + _BEYOND):.3g} within ±{_BEYOND:g}",
            how,
            all_hold(*feet),
            source="section 4.2, Fig. 6",
        ),
        Claim(
            "bf is active between −0.1 and 0.1",
            "a combination of lf and rf",
            f"{_output(bf, 0.0):.3g} at 0, {_output(bf, 0.11):.2g} at ±0.11",
            how,
            all_hold(*window),
            source="section 4.2, Fig. 6",
        ),
        Claim(
            "The q neurons send before the ZMP reaches the edge",
            "a safety margin, |m| = 100",
            f"{margin:.2f} at 10 mm inside, {at_edge:.2f} at the edge",
            how,
            all_hold(margin > _SILENT, at_edge > margin),
            source="section 4.2, Fig. 6",
        ),
        Claim(
            "The p neurons vary over inputs from 0 to 1",
            "m = 10, s = 0.5",
            f"{_output(p, 0.0):.2g} at 0, {_output(p, 0.5):.2g} at 0.5, {_output(p, 1.0):.3g} at 1",
            how,
            all_hold(_output(p, 0.0) < _SILENT, _output(p, 1.0) > _ACTIVE),
            source="section 4.2, Fig. 6",
        ),
        Claim(
            "The h neurons switch at a low activation",
            "m = 500, s = 0.1",
            f"{_output(h, 0.09):.2g} at 0.09, {_output(h, 0.11):.3g} at 0.11",
            how,
            all_hold(_output(h, 0.09) < _SILENT, _output(h, 0.11) > _ACTIVE),
            source="section 4.2, Fig. 6",
        ),
    )


def _parameters_figure(neuron: Neuron) -> Figure:
    """Draw eq. 12 with other slopes, and with other shifts."""
    own = {name: neuron.parameters[name] for name in ("slope", "shift")}
    with house_style():
        figure = new_figure(_LEFT + 2 * _WIDTH + _BETWEEN + 0.2, _TOP + _HEIGHT + _BOTTOM)
        left = axes_at(figure, _LEFT, _TOP, _WIDTH, _HEIGHT)
        right = axes_at(figure, _LEFT + _WIDTH + _BETWEEN, _TOP, _WIDTH, _HEIGHT)
        _paint(left, neuron, [{**own, "slope": slope} for slope in _SLOPES], "slope m")
        _paint(right, neuron, [{**own, "shift": shift} for shift in _SHIFTS], "shift s")
        left.set_ylabel("output O [1]")
    return figure


def _paint(axes: Axes, neuron: Neuron, choices: list[dict[str, float]], title: str) -> None:
    activation = np.linspace(-0.2, 1.2, 400)
    for i, values in enumerate(choices):
        other = replace(neuron, parameters=values)
        style: Any = {"color": CYCLE[i], "linestyle": DASHES[i], "linewidth": 1.5}
        label = f"m = {values['slope']:g}, s = {values['shift']:g}"
        axes.plot(activation, function(other, activation), label=label, **style)
    axes.set_title(title, loc="left", fontsize=SMALL + 1.0)
    axes.set_xlim(activation[0], activation[-1])
    axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel("activation A [1]")
    tidy(axes)
    plain_legend(axes, "upper left", (0.0, -0.28))


def _data(graph: CircuitGraph, neurons: dict[str, Neuron]) -> dict[str, object]:
    return {
        "circuit": graph.name,
        "parameters": {name: dict(neuron.parameters) for name, neuron in neurons.items()},
        "q_inside_edge": {str(inside): _near_edge(neurons["q4"], inside) for inside in _INSIDE_M},
    }
