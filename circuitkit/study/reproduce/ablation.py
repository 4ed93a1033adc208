"""Ablation: what each neuron and each connection of the circuit is worth, by silencing it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from circuitkit.circuit.silencing import ARROW, connections
from circuitkit.draw.style import EXCITATORY, GREY, INHIBITORY, INK, NORMAL, house_style, new_figure, tidy
from circuitkit.study import load_study
from circuitkit.study.reproduce.drawing import WIDTH_IN, save
from circuitkit.study.reproduce.each_seed import Ratio, forces_by, paired_ratio, seeds_in_words
from circuitkit.study.reproduce.finding import Claim, Finding, Picture, Table, reaches
from circuitkit.study.reproduce.job import Effort, Job
from circuitkit.study.reproduce.numbers import count, plain, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from circuitkit.circuit import CircuitGraph
    from circuitkit.study import Study

TITLE = "Ablation: what each part of the circuit is worth"
EFFORT = Effort(full_s=300.0, quick_s=60.0)
STUDY = "ablation"
WHOLE, NONE = "nothing", "everything"
_QUICK: Mapping[str, Any] = {"seeds": {"count": 2}, "search": {"step": "8 N"}}
_NOTICED = 0.95  # of the force that the whole circuit survives


def run(job: Job) -> Finding:
    """Silence each neuron and each connection in turn, search the largest survived forces, and draw them."""
    study = load_study(STUDY)
    study = study.with_(_QUICK) if job.quick else study
    circuit = study.point().circuit
    study = with_lesions(study, circuit)
    forces = forces_by(job.sweep(study).limits(), "lesion")
    ratios = {lesion: paired_ratio(found, forces[WHOLE,]) for (lesion,), found in forces.items()}
    seeds = len(study.seeds)
    return Finding(
        figure=job.figure,
        title=TITLE,
        claims=(claim_of(ratios, neurons_of(circuit), seeds),),
        pictures=(_draw(job, ratios, circuit),),
        tables=(_table(ratios),),
        text=words(f"""
        One neuron or one connection of `{circuit.name}` at a time sends nothing; all else stays, also the
        order of a step. For each of {seeds} seeds the largest force of 0.2 s that is survived is
        searched, outward and inward, in a step of the left and in one of the right foot, so that both
        halves of the network are asked. 100 % is the whole circuit; the open loop is the circuit with
        everything silenced. Less than 100 % is what a part is worth; more means that the robot does
        better without it, against these pushes. Intervals (95 %) are a bootstrap over the seeds."""),
        seeds=seeds_in_words(study),
        studies=(STUDY,),
        data={lesion: vars(ratio) for lesion, ratio in ratios.items()},
    )


def with_lesions(study: Study, circuit: CircuitGraph) -> Study:
    """The study with a lesion for each neuron and each connection of the circuit, after those that it has."""
    axis: dict[str, Any] = {value.text: dict(value.settings) for value in study.axes["lesion"]}
    axis |= {name: {"silenced": [name]} for name in (*neurons_of(circuit), *connections_of(circuit))}
    return study.with_({"axes": {"lesion": axis}})


def neurons_of(circuit: CircuitGraph) -> tuple[str, ...]:
    """Names of its neurons that send anything."""
    sending = {source for source, _ in connections(circuit)}
    return tuple(neuron.name for neuron in circuit.neurons if neuron.name in sending)


def connections_of(circuit: CircuitGraph) -> tuple[str, ...]:
    """Its connections as `silence` takes them."""
    return tuple(f"{source} {ARROW} {target}" for source, target in connections(circuit))


def claim_of(ratios: Mapping[str, Ratio], neurons: Sequence[str], seeds: int) -> Claim:
    """Whether every neuron has its part in what the circuit does."""
    needed = [name for name in neurons if ratios[name].value < _NOTICED]
    spare = [name for name in neurons if name not in needed]
    worst = min(neurons, key=lambda name: ratios[name].value)
    return Claim(
        "Every neuron of the network has its part in the result",
        "-",
        f"{count(len(needed), len(neurons))} neurons; {worst} is worth most: "
        f"{ratios[worst].value * 100:.0f} % without it, open loop {ratios[NONE].value * 100:.0f} %",
        f"neuron silenced, mean force survived below 95 % of the whole circuit's; 0.2 s, {seeds} seeds",
        reaches(len(needed), len(neurons), 0),
        why=f"Without {', '.join(spare)} at least 95 % stay." if spare else "",
        source="beyond the paper",
    )


def _table(ratios: Mapping[str, Ratio]) -> Table:
    rows = tuple(
        (
            lesion,
            plain(ratio.mine),
            f"{ratio.value * 100:.0f} %",
            f"{ratio.low * 100:.0f} to {ratio.high * 100:.0f} %",
        )
        for lesion, ratio in ratios.items()
    )
    headings = ("silenced", ">mean force [N]", ">of the whole circuit's", ">95 % interval")
    return Table("Mean of the largest survived forces over seeds, steps and directions", headings, rows)


def _draw(job: Job, ratios: Mapping[str, Ratio], circuit: CircuitGraph) -> Picture:
    neurons, edges = neurons_of(circuit), connections_of(circuit)
    half = -(-len(edges) // 2)
    columns = (neurons, edges[:half], edges[half:])
    titles = ("neuron silenced", "connection silenced", "connection silenced")
    ends = [end for ratio in ratios.values() for end in (ratio.low, ratio.high, ratio.value)]
    limits = (min(0.0, *ends), 1.08 * float(np.nanmax(ends)) * 100)
    with house_style():
        figure = new_figure(WIDTH_IN, 0.24 * max(len(column) for column in columns) + 1.1)
        figure.set_layout_engine("constrained")
        panels = figure.subplots(1, len(columns))
        for axes, names, title in zip(panels, columns, titles, strict=True):
            axes.set_title(title, fontsize=NORMAL)
            _bars(axes, {name: ratios[name] for name in names}, ratios[NONE].value, _roles(circuit))
            axes.set(xlim=limits, xlabel="force survived [%]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        file = save(figure, job.folder, "ablation")
    caption = words("""
        Largest survived force without a neuron or a connection, in percent of the whole circuit's (solid
        line); thin lines are 95 % intervals by a bootstrap over seeds. Dashed, the open loop. Hatched are
        inhibitory neurons and what they send.""")
    return Picture(
        file, caption, "Bars for each silenced neuron and connection beside the lines of the whole circuit."
    )


def _roles(circuit: CircuitGraph) -> dict[str, str]:
    return {neuron.name: neuron.role for neuron in circuit.neurons}


def _bars(axes: Axes, ratios: Mapping[str, Ratio], without: float, roles: Mapping[str, str]) -> None:
    tidy(axes)
    axes.set(ylim=(len(ratios) - 0.4, -0.6), yticks=range(len(ratios)), yticklabels=list(ratios))
    axes.tick_params(axis="y", length=0)
    axes.axvline(100.0, color=INK, linewidth=1.0, label="whole circuit", zorder=3)
    axes.axvline(without * 100, color=GREY, linewidth=1.0, linestyle="--", label="open loop", zorder=3)
    for row, (name, ratio) in enumerate(ratios.items()):
        inhibits = roles.get(name.partition(ARROW)[0].strip()) == "inhibitory"
        look: Any = (
            {"hatch": "////", "color": "#e7b3a6", "edgecolor": INHIBITORY}
            if inhibits
            else {"color": EXCITATORY}
        )
        axes.barh(row, ratio.value * 100, height=0.66, linewidth=0.4, **look)
        axes.plot(np.array([ratio.low, ratio.high]) * 100, [row, row], color=INK, linewidth=0.9, zorder=4)
