"""Makes figure 5, the network, and sees whether it is the one that section 4.2 describes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.draw import draw_circuit
from circuitkit.draw.style import (
    CYCLE,
    DASHES,
    GREY,
    INK,
    SMALL,
    axes_at,
    house_style,
    new_figure,
    plain_legend,
    tidy,
)
from circuitkit.engine import compile_circuit, run
from circuitkit.paper.reproduce.drawing import save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import Claim, Finding, Picture, all_hold, one_line

Array = NDArray[np.float64]

CIRCUIT = "binn_lateral"
# Section 4.2 in pairs: who acts on whom. Sensorial inputs are left out.
SECTION_4_2 = frozenset(
    (source, target)
    for sources, targets in (
        ("lf", "q1 q2"),  # the left foot carries: the right foot's edges do not count
        ("bf", "q2 q3"),  # both feet carry: the inner edges do not count
        ("rf", "q3 q4"),  # the right foot carries: the left foot's edges do not count
        ("q1 q3", "p1 h1"),  # beyond a right edge: the output, and feedforward inhibition
        ("q2 q4", "p2 h2"),  # beyond a left edge
        ("p1", "h1"),  # feedback inhibition
        ("p2", "h2"),
        ("h1", "p2"),  # lateral inhibition
        ("h2", "p1"),
    )
    for source in sources.split()
    for target in targets.split()
)
GROUPS = ("lf bf rf", "q1 q2 q3 q4", "h1 h2", "p1 p2")
# Which q stand for the edges of the support polygon.
EDGES = {"left foot": "q3 q4", "both feet": "q1 q4", "right foot": "q1 q2"}

_ZMP_M = np.linspace(-0.12, 0.12, 481)
_WIDTH, _HEIGHT, _LEFT, _BETWEEN, _TOP, _BOTTOM = 2.0, 1.7, 0.6, 0.2, 0.32, 0.75  # [in]
_ON = 0.5
LOADS: Mapping[str, float] = {"left foot": 1.0, "both feet": 0.0, "right foot": -1.0}
FORCES, ZMP = "force_difference", "zmp_y"
_SETTLED = 60  # steps, after which a network without memory but its loop of p and h changes no more


class Fig5(ReportFigure):
    """Draws the network and holds it against section 4.2."""

    kind: ClassVar[str] = "fig5"
    order: ClassVar[int] = 5
    title: ClassVar[str] = "Figure 5: the network"
    effort: ClassVar[Effort] = Effort(full_s=4.0, quick_s=4.0)

    def run(self, job: Job) -> Finding:
        """Draw the network and what it answers, and hold both against section 4.2."""
        graph = load_circuit(CIRCUIT)
        answers = settled_answers(graph, _ZMP_M)
        for suffix in ("png", "pdf"):
            draw_circuit(graph, job.folder / f"fig5.{suffix}")
        pictures = (
            Picture(
                "fig5.png",
                "The network of `circuits/binn_lateral.yaml`. Excitatory neurons are round, inhibitory ones "
                "have eight corners; a line with a bar inhibits.",
                "Graph of 11 neurons from two inputs on the left to the correction of the ankle on the right",
            ),
            Picture(
                save(_answers_figure(graph, answers), job.folder, "fig5_answers"),
                "What the network answers when the ZMP stands still, for each way of standing. Vertical "
                "lines: the edges of the support polygon.",
                "Three panels, one for each way of standing, with the outputs of p1 and p2 over the ZMP",
            ),
        )
        claims = _claims(graph, answers)
        return Finding(
            job.figure, self.title, claims, pictures, text=one_line(_TEXT), data=_data(graph, answers)
        )


_TEXT = """
Section 4.2 says in words all that the figure shows. The pairs of neurons that it names are written down in
`paper/reproduce/fig5.py` and compared with those of the circuit file. The neurons of right edges see the
mirrored ZMP, so that a weight of −1 inhibits them although the paper gives their curves a negative slope: the
curve is the same.
"""


def _claims(graph: CircuitGraph, answers: Answers) -> tuple[Claim, ...]:
    names = Counter(neuron.name for neuron in graph.neurons)
    expected = Counter(name for group in GROUPS for name in group.split())
    inner = _inner(graph)
    unit = all(abs(weight) == 1.0 for *_, weight in inner)
    edges = Counter((source, target) for source, target, _ in inner)
    missing, more = SECTION_4_2 - set(edges), set(edges) - SECTION_4_2
    both = max(
        float(np.minimum(answers.of("p1", way), answers.of("p2", way)).max()) for way in answers.outputs
    )
    how = f"`circuits/{CIRCUIT}.yaml`, resolved"
    return (
        Claim(
            "11 neurons: three for the feet, four for the edges, two that inhibit, two that send",
            "11",
            f"{len(graph.neurons)}",
            how,
            all_hold(names == expected, len(graph.neurons) == sum(expected.values())),
            source="section 4.2",
        ),
        Claim(
            "Who acts on whom",
            f"{len(SECTION_4_2)} connections",
            f"{len(edges)}; {len(missing)} missing, {len(more)} more",
            f"{how}, against the pairs that the text names",
            all_hold(not missing, not more, max(edges.values()) == 1),
            source="Fig. 5, section 4.2",
        ),
        Claim(
            "All weights between neurons are 1 (inhibitory: −1)",
            "1",
            f"{sum(abs(w) == 1.0 for *_, w in inner)} of {len(inner)}",
            how,
            all_hold(unit),
            source="section 4.2",
        ),
        Claim(
            "Only the neurons of the edges of the present support polygon are not inhibited",
            "-",
            _which(answers),
            f"inputs held until it has settled, ZMP up to {1e3 * answers.zmp_m[-1]:g} mm to either side",
            all_hold(*(_firing(answers, way) == set(EDGES[way].split()) for way in answers.outputs)),
            source="section 4.2",
        ),
        Claim(
            "Only one p neuron is active at a time",
            "one",
            f"the less active one sends at most {both:.2g}",
            f"inputs held, {len(answers.zmp_m)} places of the ZMP, three ways of standing",
            all_hold(both < _ON),
            source="section 4.2",
        ),
    )


def _inner(graph: CircuitGraph) -> list[tuple[str, str, float]]:
    """List the synapses between neurons: from, to, weight in the unit of the target's activation."""
    neurons = {neuron.name for neuron in graph.neurons}
    return [
        (synapse.source, synapse.target, synapse.weight)
        for synapse in graph.synapses
        if synapse.source in neurons
    ]


def _firing(answers: Answers, standing: str) -> set[str]:
    """Find the q that send more than half at a ZMP far outside."""
    return {name for name in GROUPS[1].split() if answers.of(name, standing).max() > _ON}


def _which(answers: Answers) -> str:
    return "; ".join(f"{way}: {', '.join(sorted(_firing(answers, way)))}" for way in answers.outputs)


def _edges_m(graph: CircuitGraph, standing: str) -> list[float]:
    """Find where the thresholds of the q that count stand, as places of the ZMP, [m]."""
    shifts = {
        neuron.name: neuron.parameters["shift"] for neuron in graph.neurons if "shift" in neuron.parameters
    }
    signs = {synapse.target: synapse.weight for synapse in graph.synapses if synapse.source == "zmp_y"}
    return [shifts[name] * signs[name] for name in EDGES[standing].split()]


def _answers_figure(graph: CircuitGraph, answers: Answers) -> Figure:
    ways = list(answers.outputs)
    with house_style():
        width = _LEFT + len(ways) * (_WIDTH + _BETWEEN) + 0.1
        figure = new_figure(width, _TOP + _HEIGHT + _BOTTOM)
        for i, way in enumerate(ways):
            axes = axes_at(figure, _LEFT + i * (_WIDTH + _BETWEEN), _TOP, _WIDTH, _HEIGHT)
            for edge in _edges_m(graph, way):
                axes.axvline(1e3 * edge, color=GREY, linewidth=0.9, label=_first("edge of the support", axes))
            for k, (name, text) in enumerate(
                (("p1", "Out1 (p1): too far right"), ("p2", "Out2 (p2): too far left"))
            ):
                style: Any = {"color": CYCLE[k], "linestyle": DASHES[k], "linewidth": 1.6}
                axes.plot(1e3 * answers.zmp_m, answers.of(name, way), label=text, **style)
            axes.set_title(
                f"on the {way}" if "both" not in way else f"on {way}", loc="left", fontsize=SMALL + 1
            )
            axes.set_xlim(1e3 * answers.zmp_m[0], 1e3 * answers.zmp_m[-1])
            axes.set_ylim(-0.03, 1.05)
            axes.set_xlabel("ZMP [mm], left is positive")
            axes.tick_params(labelleft=i == 0)
            if i == 0:
                axes.set_ylabel("output [1]", color=INK)
                plain_legend(axes, "upper left", (0.0, -0.3), ncols=3, columnspacing=2.0)
            tidy(axes)
    return figure


def _first(label: str, axes: Axes) -> str:
    """Return the label the first time in these axes, then none."""
    return "" if label in axes.get_legend_handles_labels()[1] else label


def _data(graph: CircuitGraph, answers: Answers) -> dict[str, object]:
    return {
        "circuit": graph.name,
        "neurons": [neuron.name for neuron in graph.neurons],
        "connections": sorted(f"{source} -> {target}" for source, target, _ in _inner(graph)),
        "zmp_m": answers.zmp_m,
        "out1": {way: answers.of("p1", way) for way in answers.outputs},
        "out2": {way: answers.of("p2", way) for way in answers.outputs},
    }


@dataclass(frozen=True)
class Answers:
    """Outputs of all neurons.

    Attributes:
        zmp_m: The ZMP; shape (k,).
        names: Of the neurons.
        outputs: What each neuron sends at last, by way of standing; shape (k, n), between 0 and 1.
    """

    zmp_m: Array
    names: tuple[str, ...]
    outputs: Mapping[str, Array]

    def of(self, neuron: str, standing: str) -> Array:
        """Outputs of one neuron; shape (k,)."""
        return np.asarray(self.outputs[standing][:, self.names.index(neuron)])


def settled_answers(graph: CircuitGraph, zmp_m: Array) -> Answers:
    """Hold the inputs until the network has settled.

    Args:
        graph: A network with the inputs `force_difference` and `zmp_y`.
        zmp_m: Places of the ZMP; shape (k,).
    """
    program = compile_circuit(graph)
    columns = [list(program.input_names).index(name) for name in (FORCES, ZMP)]
    outputs = {}
    for standing, load in LOADS.items():
        inputs = np.zeros((_SETTLED, len(zmp_m), len(program.input_names)))
        inputs[..., columns[0]] = load
        inputs[..., columns[1]] = zmp_m
        outputs[standing] = run(program, inputs).output[-1]
    return Answers(zmp_m, tuple(program.neuron_names), outputs)
