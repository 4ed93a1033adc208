"""Writes docs/models from the declarations of the models; docs/generate.py calls `write_model_pages`.

Every page has the equations, the symbols, an example from docs/models/examples and a picture of that example.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from circuitkit import compile_circuit, load_circuit, run
from circuitkit.base.files import write_text
from circuitkit.base.units import Unit, format_quantity, parse_unit
from circuitkit.circuit.expressions.expression import Expression
from circuitkit.circuit.models import (
    NEURON_MODEL_NAMES,
    SYNAPSE_MODEL_NAMES,
    ModelParameter,
    ModelState,
    NeuronModel,
    SynapseModel,
    UnitRule,
    neuron_model,
    synapse_model,
)
from circuitkit.draw.style import CYCLE, DASHES, SMALL, house_style, new_figure, save_figure, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from circuitkit import CircuitGraph, Trace

Array = NDArray[np.float64]
Panels = Mapping[str, Mapping[str, Array]]  # by label, then by owner of the curve

MODELS = Path(__file__).parent / "models"
WIDTH_IN, ROW_IN = 6.4, 0.95
ON, OFF = 0.1, 0.6  # parts of the time at which the input of an example goes up and down
SECONDS = {"hebbian": 8.0, "oja": 6.0, "matsuoka": 4.0, "depressing_facilitating_rate": 4.0}
SECONDS |= dict.fromkeys(("first_order", "leaky_integrator", "leaky_linear", "static", "gated"), 2.0)
SECONDS |= {"conductance": 1.0, "adaptive_exponential": 0.4, "izhikevich": 0.6}
USUAL_SECONDS = 0.15
METHODS = {
    "euler": "Euler",
    "exponential_euler": "exponential Euler (exact where a state's equation is linear in it)",
    "exact": "exact, by the matrix exponential",
    "rk4": "fourth-order Runge-Kutta",
}
SIGNS = {
    "role": "positive from an excitatory neuron, negative from an inhibitory one, any from an input",
    "positive": "positive",
    "any": "any",
}
INDEX_HEAD = """# The models

Written by `make docs` from the declarations in `circuitkit/circuit/models`. A neuron names its model by the
key `model`; so does a synapse, unless it is `static`. The parameters of the model stand beside it; what is in
brackets here is their default. A model of your own is declared in the circuit file: see
[own models](own_models.md). A delay needs no model: any synapse has the key `delay`.

A is the activation of a neuron: the sum of what its synapses deliver (eq. 11), and its noise. The output of a
spiking neuron is 1 in the substep in which it spikes, else 0; what runs at the control rate sees the number
of spikes in the control step.
"""
PAGE_WIDTH = 120  # columns of text; code and pictures stay as they are


def write_model_pages() -> None:
    """Write all pages and pictures, and the index."""
    models: list[NeuronModel | SynapseModel] = [
        *map(neuron_model, NEURON_MODEL_NAMES),
        *map(synapse_model, SYNAPSE_MODEL_NAMES),
    ]
    for model in models:
        folder = folder_of(model)
        write_text(MODELS / folder / f"{model.name}.md", model_page(model))
        with house_style():
            save_figure(picture(model), MODELS / "img" / folder / f"{model.name}.png")
    write_text(MODELS / "README.md", index_page(models))


def folder_of(model: NeuronModel | SynapseModel) -> str:
    """Where the files of a model stand."""
    return "neurons" if isinstance(model, NeuronModel) else "synapses"


def example_of(model: NeuronModel | SynapseModel) -> Path:
    """The circuit that shows a model."""
    return MODELS / "examples" / folder_of(model) / f"{model.name}.yaml"


def index_page(models: Iterable[NeuronModel | SynapseModel]) -> str:
    """The list of all models."""
    lines = [INDEX_HEAD]
    for folder in ("neurons", "synapses"):
        own = [model for model in models if folder_of(model) == folder]
        lines += [f"## {folder.capitalize()}", "", *map(index_entry, own), ""]
    return "\n".join(lines)


def index_entry(model: NeuronModel | SynapseModel) -> str:
    """A model's place in the list: what it does, and its parameters."""
    text = f"[`{model.name}`]({folder_of(model)}/{model.name}.md): {model.description}"
    if model.parameters:
        text += f" Parameters: {parameters(model)}."
    return f"- {filled(text, indent=2)}"


def filled(text: str, indent: int = 0) -> str:
    """Text in lines of at most `PAGE_WIDTH` columns, of which all but the first are indented."""
    lines = textwrap.wrap(text, PAGE_WIDTH - indent, break_long_words=False, break_on_hyphens=False)
    return f"\n{' ' * indent}".join(lines)


def model_page(model: NeuronModel | SynapseModel) -> str:
    """The page of a model."""
    kind = "neuron" if isinstance(model, NeuronModel) else "synapse"
    example = example_of(model).read_text(encoding="utf-8")
    picture_path = f"../img/{folder_of(model)}/{model.name}.png"
    parts = [
        f"# `{model.name}`, a {kind}\n",
        f"{filled(model.description)}\n",
        "```text",
        *equations(model),
        "```\n",
        *facts(model),
        *table("parameter", "default", [(each, default_text(each)) for each in model.parameters]),
        *table("state", "at the start", [(each, f"`{each.initial}`") for each in model.states]),
        f"{filled(f'Source: {model.source}.')}\n",
        "## Example\n",
        f"```yaml\n{example}```\n",
        f"![What the example does]({picture_path})\n",
        caption(model),
    ]
    return "\n".join(parts)


def equations(model: NeuronModel | SynapseModel) -> Iterator[str]:
    """The equations as lines of text."""
    if isinstance(model, SynapseModel):
        if model.per == "target":
            yield "input = sum of weight * pre over the sources"
        yield from (f"on arrival: {name} <- {change}" for name, change in model.jumps.items())
    yield from (f"d{name}/dt = {change}" for name, change in model.derivatives.items())
    yield from (f"each control step: {name} <- {new}" for name, new in model.updates.items())
    if isinstance(model, SynapseModel):
        yield f"A = A + {in_sum(model.current)}"
        return
    if model.spike is not None:
        changes = ", ".join(f"{name} <- {new}" for name, new in model.spike.reset.items())
        yield f"spike if {model.spike.when}: {changes}"
    yield f"output = {model.output}"


def in_sum(expression: Expression) -> str:
    """The text of an expression behind a plus sign."""
    return f"({expression})" if str(expression).startswith("-") else str(expression)


def facts(model: NeuronModel | SynapseModel) -> Iterator[str]:
    """What is not in the equations, as a list."""
    if isinstance(model, NeuronModel):
        unit = (
            "any unit; that of the parameters"
            if model.activation is None
            else f"a current, such as {model.activation}"
        )
        yield f"- activation A: {unit}"
        if not model.states:
            yield "- without memory: the output follows from A alone"
    else:
        yield f"- weight: unit {model.weight}; {SIGNS[model.sign]}"
        if model.states:
            yield f"- states: one for every {model.per}"
        if model.gated:
            yield "- `gate`: the name of the neuron whose output scales the synapse"
        for name, rule in model.reads.items():
            side, _, state = name.partition("_")
            whose = "target" if side == "post" else "source"
            yield f"- needs a {whose} with a state `{state}` in {rule}"
    if model.derivatives:
        yield f"- integrated by: {METHODS[model.method]}"
    if model.increasing:
        yield f"- must increase in this order: {', '.join(f'`{name}`' for name in model.increasing)}"
    yield ""


def table(kind: str, column: str, rows: Iterable[tuple[ModelParameter | ModelState, str]]) -> Iterator[str]:
    """A table of parameters or of states; nothing if there are none."""
    lines = [f"| `{each.name}` | {each.unit_rule} | {text} | {each.description} |" for each, text in rows]
    if lines:
        yield from (f"| {kind} | unit | {column} | |", "|---|---|---|---|", *lines, "")


def parameters(model: NeuronModel | SynapseModel) -> str:
    """The parameters of a model, with the defaults of those that have one."""
    texts = (
        f"`{each.name}`" + ("" if each.default is None else f" ({default_text(each)})")
        for each in model.parameters
    )
    return ", ".join(texts)


def default_text(parameter: ModelParameter) -> str:
    """The default in the parameter's unit."""
    if parameter.default is None:
        return "required"
    return format_quantity(parameter.default, parameter.unit) if parameter.unit else f"{parameter.default:g}"


def caption(model: NeuronModel | SynapseModel) -> str:
    """What the picture shows."""
    if isinstance(model, NeuronModel) and not model.states:
        return "The output over the range of the input.\n"
    return "From above: the input `u`, the states, the outputs of the neurons.\n"


def picture(model: NeuronModel | SynapseModel) -> Figure:
    """What the example of a model does."""
    graph = load_circuit(example_of(model))
    low, high = graph.inputs[0].low, graph.inputs[0].high
    program = compile_circuit(graph)
    if isinstance(model, NeuronModel) and not model.states:
        sweep = np.linspace(low, high, 401)
        return curve(graph, sweep, run(program, sweep.reshape(1, -1, 1)).output[0, :, 0])
    steps = round(SECONDS.get(model.name, USUAL_SECONDS) / graph.step_s)
    time_s = np.arange(1, steps + 1) * graph.step_s
    is_on = (time_s > ON * time_s[-1]) & (time_s <= OFF * time_s[-1])
    signal = np.where(is_on, high, low)
    trace = run(program, signal.reshape(-1, 1, 1), states=True)
    return traces(graph, state_groups(model, graph, trace), time_s, signal, trace)


def curve(graph: CircuitGraph, sweep: Array, output: Array) -> Figure:
    """The output over the input."""
    figure = new_figure(WIDTH_IN * 0.6, 2.4)
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    tidy(axes)
    unit = graph.inputs[0].unit
    axes.plot(sweep / unit.scale, output, color=CYCLE[0], linewidth=1.4)
    axes.set(xlabel=f"input u{in_unit(unit)}", ylabel="output")
    return figure


def in_unit(unit: Unit) -> str:
    """A unit behind a name."""
    return "" if unit.symbol == "1" else f" [{unit}]"


def traces(graph: CircuitGraph, groups: Panels, time_s: Array, signal: Array, trace: Trace) -> Figure:
    """Input, states and outputs over time, one below the other."""
    figure = new_figure(WIDTH_IN, ROW_IN * (len(groups) + 2) + 0.4)
    figure.set_layout_engine("constrained")
    first, *middle, last = figure.subplots(len(groups) + 2, 1, sharex=True)
    for axes in (first, *middle, last):
        tidy(axes)
    lines(
        first, time_s, {"u": signal / graph.inputs[0].unit.scale}, f"input u{in_unit(graph.inputs[0].unit)}"
    )
    for axes, (label, curves) in zip(middle, groups.items(), strict=True):
        lines(axes, time_s, curves, label)
    spiking = {neuron.name for neuron in graph.neurons if neuron.model.spike is not None}
    outputs = {name: trace.output[:, 0, i] for i, name in enumerate(trace.neuron_names)}
    lines(last, time_s, {name: values for name, values in outputs.items() if name not in spiking}, "output")
    for number, name in enumerate(sorted(spiking)):
        times = time_s[outputs[name] > 0]
        if times.size:
            last.vlines(times, number, number + 0.8, color=CYCLE[number], linewidth=0.9, label=name)
            last.set_ylabel("spikes")
            last.set_yticks([])
    if len(outputs) > 1:
        last.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=SMALL)
    last.set(xlabel="time [s]")
    figure.align_ylabels()
    return figure


def state_groups(model: NeuronModel | SynapseModel, graph: CircuitGraph, trace: Trace) -> Panels:
    """The states to draw: a panel for each name and unit, a curve for each that has it.

    On a synapse's page these are its own states, and the potential or the like of the target.
    """
    units = {
        f"{neuron.name}.{state.name}": state.unit or neuron.activation_unit
        for neuron in graph.neurons
        for state in neuron.model.states
        if isinstance(model, NeuronModel) or (neuron.name == "target" and state.name == "v")
    }
    for synapse in graph.synapses:
        target = next(neuron for neuron in graph.neurons if neuron.name == synapse.target)
        for state in synapse.model.states:
            name = f"{synapse.source} -> {synapse.target}.{state.name}"
            units[name] = state.unit or shown_unit(state.unit_rule, synapse.model, target.activation_unit)
    groups: dict[str, dict[str, Array]] = {}
    for i, name in enumerate(trace.state_names):
        if name in units:
            owner, _, state_name = name.rpartition(".")
            whose = "target's " if isinstance(model, SynapseModel) and owner == "target" else ""
            label = f"{whose}{state_name}{in_unit(units[name])}"
            groups.setdefault(label, {})[owner] = trace.states[:, 0, i] / units[name].scale
    return groups


def shown_unit(rule: UnitRule, model: SynapseModel, activation: Unit) -> Unit:
    """A unit for a state of a synapse from a source without unit, of a size that is usual for it."""
    weight = model.weight.dimension(activation.dimension)
    dimension = rule.dimension(activation.dimension, weight=weight)
    usual = (activation, parse_unit("nS"))
    return next((unit for unit in usual if unit.dimension == dimension), dimension.si_unit)


def lines(axes: Axes, time_s: Array, curves: Mapping[str, Array], label: str) -> None:
    """Curves over time in one panel."""
    for number, (name, values) in enumerate(curves.items()):
        style = DASHES[number % len(DASHES)]
        axes.plot(time_s, values, color=CYCLE[number], linestyle=style, linewidth=1.3, label=name)
    axes.set_ylabel(label)
    axes.margins(x=0)
    if len(curves) > 1:
        axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=SMALL)


if __name__ == "__main__":
    write_model_pages()
