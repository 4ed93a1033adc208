"""Measures what each neuron and each connection of a circuit is worth, by silencing it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit import CircuitGraph
from circuitkit.circuit.silencing import ARROW, connections
from circuitkit.draw.style import EXCITATORY, INHIBITORY, INK, NORMAL, house_style, new_figure, tidy
from circuitkit.paper.reproduce.drawing import WIDTH_IN, save
from circuitkit.paper.reproduce.figure import Effort, Job, ReportFigure
from circuitkit.paper.reproduce.finding import (
    Claim,
    Finding,
    Picture,
    Table,
    count,
    one_line,
    plain,
    reaches,
    seeds_in_words,
)
from circuitkit.paper.reproduce.forces import Ratio, forces_by, paired_ratio
from circuitkit.study import Case, CaseBuilder, Study

STUDY = "ablation"
WHOLE, NONE = "nothing", "everything"
SENSES = "inputs"
_QUICK: Mapping[str, Any] = {
    "axes": {"push.direction": ["inward"]},
    "seeds": {"count": 2},
    "search": {"step": "8 N"},
}
_STYLES = (("o", "white", EXCITATORY), ("s", INHIBITORY, INHIBITORY), ("^", "#e6a100", INK))

# What is silenced, by its name in the report.
Lesions = Mapping[str, Sequence[str]]
# The force without a part over that of the whole circuit, by part.
Ratios = Mapping[str, Ratio]


class Ablation(ReportFigure):
    """Silences each neuron and each connection of a circuit in turn."""

    kind: ClassVar[str] = "ablation"
    order: ClassVar[int] = 40
    title: ClassVar[str] = "Ablation: what each part of the circuit is worth"
    studies: ClassVar[tuple[str, ...]] = (STUDY,)
    effort: ClassVar[Effort] = Effort(full_s=340.0, quick_s=60.0)

    def run(self, job: Job) -> Finding:
        """Silence each neuron and each connection in turn, search the largest survived forces, draw them."""
        study = job.study(STUDY, _QUICK)
        cases = CaseBuilder(study)
        found: dict[str, Ratios] = {}
        parts: dict[str, tuple[Lesions, Lesions]] = {}
        for value in study.axes["circuit"]:
            circuit = _circuit(cases.case(value.settings))
            parts[circuit.name] = neurons_of(circuit), connections_of(circuit)
            own = with_lesions(study, value.text, parts[circuit.name])
            forces = forces_by(job.sweep(own, circuit.name).limits(), "lesion")
            found[circuit.name] = {each: paired_ratio(forces[each,], forces[WHOLE,]) for (each,) in forces}
        seeds = len(study.seeds)
        return Finding(
            figure=job.figure,
            title=self.title,
            claims=tuple(claim_of(name, found[name], tuple(parts[name][0]), seeds) for name in found),
            pictures=(_draw(job, found, parts),),
            tables=tuple(_table(name, ratios) for name, ratios in found.items()),
            text=one_line(f"""
            One neuron or one connection of a circuit at a time sends nothing; all else stays, also the order
            of a step. What a neuron takes from several inputs is one connection here. For each of {seeds}
            seeds the largest force of 0.2 s that is survived is searched, in a step of the left and in one of
            the right foot, so that both halves of the network are asked. 100 % is the whole circuit; the open
            loop is the circuit with everything silenced. Less than 100 % is what a part is worth; more means
            that the robot does better without it, against these pushes. Intervals (95 %) are a bootstrap over
            the seeds; over so few they are rather too narrow. The search of a seed takes the first
            boundary that bisection finds; whether weaker pushes leave gaps below is not looked for."""),
            seeds=seeds_in_words(study.seeds),
            studies=self.studies,
            data={
                name: {each: vars(ratio) for each, ratio in ratios.items()} for name, ratios in found.items()
            },
        )


def _circuit(case: Case) -> CircuitGraph:
    """Return the circuit of a case.

    Raises:
        InputError: It has none.
    """
    if case.circuits.used is None:
        message = f"the study '{STUDY}' names no circuit; allowed: circuits to take apart"
        raise InputError(Problem("", 0, 0, "axes.circuit", message))
    return case.circuits.used


def with_lesions(study: Study, circuit: str, parts: tuple[Lesions, Lesions]) -> Study:
    """Give the study of one circuit a lesion for each of its parts, after those that the study has."""
    axis: dict[str, Any] = {value.text: dict(value.settings) for value in study.axes["lesion"]}
    axis |= {name: {"silenced": list(silenced)} for part in parts for name, silenced in part.items()}
    return study.with_({"axes": {"circuit": [circuit], "lesion": axis}})


def neurons_of(circuit: CircuitGraph) -> Lesions:
    """List the neurons that send anything."""
    sending = {source for source, _ in connections(circuit)}
    names = [neuron.name for neuron in circuit.neurons if neuron.name in sending]
    return {_short(name, circuit): (name,) for name in names}


def connections_of(circuit: CircuitGraph) -> Lesions:
    """List the connections; those from several inputs to one neuron are one."""
    inputs = {node.name for node in circuit.inputs}
    found: dict[str, list[str]] = {}
    for source, target in connections(circuit):
        start = SENSES if source in inputs else _short(source, circuit)
        found.setdefault(f"{start} {ARROW} {_short(target, circuit)}", []).append(
            f"{source} {ARROW} {target}"
        )
    return found


def _short(name: str, circuit: CircuitGraph) -> str:
    """Strip a name of that of the instance, if all neurons are of one."""
    instances = {neuron.name.rpartition(".")[0] for neuron in circuit.neurons}
    (prefix,) = instances if len(instances) == 1 else ("",)
    return name.removeprefix(f"{prefix}.") if prefix else name


def claim_of(circuit: str, ratios: Ratios, neurons: Sequence[str], seeds: int) -> Claim:
    """Claim that every neuron has its part in what the circuit does."""
    needed = [name for name in neurons if ratios[name].high < 1]
    spare = [name for name in neurons if name not in needed]
    worst = min(neurons, key=lambda name: ratios[name].value)
    return Claim(
        f"Every neuron of {circuit} has its part in the result",
        "-",
        f"{count(len(needed), len(neurons))} neurons; {worst} is worth most: "
        f"{ratios[worst].value * 100:.0f} % without it, open loop {ratios[NONE].value * 100:.0f} %",
        "neuron silenced, mean force survived over the whole circuit's; needed where the 95 % bootstrap "
        f"interval lies below 100 %; 0.2 s, {seeds} seeds",
        reaches(len(needed), len(neurons), 0),
        why=f"Without {', '.join(spare)}, one at a time, no loss is sure." if spare else "",
        source="beyond the paper",
    )


def _table(circuit: str, ratios: Ratios) -> Table:
    rows = tuple(
        (each, plain(ratio.mine), _percent(ratio.value), f"{_percent(ratio.low)} to {_percent(ratio.high)}")
        for each, ratio in ratios.items()
    )
    headings = ("silenced", ">mean force [N]", ">of the whole circuit's", ">95 % interval")
    return Table(f"{circuit}: mean of the largest survived forces", headings, rows)


def _percent(value: float) -> str:
    return "-" if np.isnan(value) else f"{value * 100:.0f} %"


def _draw(job: Job, found: Mapping[str, Ratios], parts: Mapping[str, tuple[Lesions, Lesions]]) -> Picture:
    neurons = tuple(dict.fromkeys(name for own in parts.values() for name in own[0]))
    edges = tuple(dict.fromkeys(name for own in parts.values() for name in own[1]))
    half = -(-len(edges) // 2)
    columns = (neurons, edges[:half], edges[half:])
    titles = ("neuron silenced", "connection silenced", "connection silenced")
    ends = [end for own in found.values() for ratio in own.values() for end in (ratio.high, ratio.value)]
    most = 106.0 * float(np.nanmax(ends))
    with house_style():
        figure = new_figure(WIDTH_IN, 0.3 * max(len(column) for column in columns) + 1.4)
        figure.set_layout_engine("constrained")
        panels = figure.subplots(1, len(columns))
        for axes, names, title in zip(panels, columns, titles, strict=True):
            axes.set_title(title, fontsize=NORMAL)
            _rows(axes, names)
            for number, (circuit, ratios) in enumerate(found.items()):
                _points(axes, circuit, ratios, names, number, len(found))
            axes.set(xlim=(0.0, most), xlabel="force survived [%]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        file = save(figure, job.folder, "ablation")
    caption = one_line("""
        Largest survived force without a neuron or a connection, in percent of the whole circuit's (solid
        line); thin bars are 95 % intervals by a bootstrap over seeds. The other lines are the open loop.""")
    return Picture(
        file, caption, "A row for each silenced neuron and connection with the force that is left."
    )


def _rows(axes: Axes, names: Sequence[str]) -> None:
    tidy(axes)
    labels = [name.replace(ARROW, "→") for name in names]
    axes.set(ylim=(len(names) - 0.4, -0.6), yticks=range(len(names)), yticklabels=labels)
    axes.tick_params(axis="y", length=0)
    axes.axvline(100.0, color=INK, linewidth=0.9, label="whole circuit", zorder=1)


def _points(axes: Axes, circuit: str, ratios: Ratios, names: Sequence[str], number: int, of: int) -> None:
    marker, face, colour = _STYLES[number % len(_STYLES)]
    dashes = ((0, (1, 1.5)), (0, (5, 2)), (0, (5, 1.5, 1, 1.5)))[number % len(_STYLES)]
    without = ratios[NONE].value * 100
    axes.axvline(
        without, color=colour, linewidth=1.1, linestyle=dashes, label=f"open loop / {circuit}", zorder=1
    )
    aside = 0.17 * (2 * number - of + 1)
    rows = [row for row, name in enumerate(names) if name in ratios]
    own = [ratios[names[row]] for row in rows]
    places = np.array(rows) + aside
    for place, ratio in zip(places, own, strict=True):
        axes.plot(np.array([ratio.low, ratio.high]) * 100, [place] * 2, color=colour, linewidth=1.1, zorder=2)
    style: Any = {"color": colour, "markerfacecolor": face, "markersize": 4.5, "zorder": 3}
    axes.plot([ratio.value * 100 for ratio in own], places, marker, label=circuit, **style)
