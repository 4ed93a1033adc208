"""How `circuitkit show FILE` prints what a circuit resolves to, as tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from circuitkit.base.units import format_quantity
from circuitkit.circuit.authoring.elements import Weights, value_text
from circuitkit.circuit.authoring.flat import parameter_unit
from circuitkit.circuit.graph import CircuitGraph, Neuron, OutputNode, Population, Projection, Synapse
from circuitkit.cli.printing import print_table


def print_tables(graph: CircuitGraph) -> None:
    """Print what a circuit resolves to: its inputs, neurons, synapses and outputs."""
    print(f"{graph.name}: {graph.description}" if graph.description else graph.name)
    substeps = f", {graph.substeps} substeps" if graph.substeps > 1 else ""
    print(f"timing {graph.timing}, control step {graph.step_s * 1e3:g} ms{substeps}\n")
    print_table(
        "inputs",
        ("name", "unit", ">from", ">to", "description"),
        (
            (
                x.name,
                str(x.unit),
                format_quantity(x.low, x.unit),
                format_quantity(x.high, x.unit),
                x.description,
            )
            for x in graph.inputs
        ),
    )
    print_table(
        "neurons",
        ("name", "model", "role", "parameters", "description"),
        ((x.name, x.model.name, x.role, ", ".join(_parameters(x)), x.description) for x in graph.neurons),
    )
    if graph.populations:
        print_table(
            "populations",
            ("name", ">size", "model", "role", "parameters", "description"),
            (
                (x.name, str(x.size), x.model.name, x.role, ", ".join(_parameters(x)), x.description)
                for x in graph.populations
            ),
        )
    _print_edges("synapses", graph, graph.synapses)
    if graph.projections:
        _print_edges("projections", graph, graph.projections)
    print_table(
        "outputs",
        ("name", "readout", "over the steps", ">from", ">to", "description"),
        (
            (
                x.name,
                " + ".join(_readout(x)).replace("+ -", "- "),
                _over_the_steps(x),
                format_quantity(x.low, x.unit) if math.isfinite(x.low) else "",
                format_quantity(x.high, x.unit) if math.isfinite(x.high) else "",
                x.description,
            )
            for x in graph.outputs
        ),
    )


def _print_edges(title: str, graph: CircuitGraph, edges: Sequence[Synapse | Projection]) -> None:
    """A table of synapses or projections; columns in which nothing stands are left out."""
    weights = Weights(graph)

    def weight(edge: Any) -> str:  # noqa: ANN401 - either of the two
        return weights.text(edge, edge.weights if title == "projections" else edge.weight)

    columns: dict[str, Callable[[Any], str]] = {
        "from": lambda edge: str(edge.source),
        "to": lambda edge: str(edge.target),
        ">synapses": lambda edge: str(len(edge.sources)) if title == "projections" else "",
        ">weight": weight,
        "kind": lambda edge: str(edge.kind),
        "model": lambda edge: "" if edge.model.name == "static" else str(edge.model.name),
        ">delay": lambda edge: f"{edge.delay_s * 1e3:g} ms" if edge.delay_s else "",
        "gate": lambda edge: str(edge.gate),
    }
    rows = [[tell(edge) for tell in columns.values()] for edge in edges]
    always = ("from", "to", ">weight", "kind")
    kept = [i for i, name in enumerate(columns) if name in always or any(row[i] for row in rows)]
    headings = list(columns)
    print_table(title, [headings[i] for i in kept], ([row[i] for i in kept] for row in rows))


def _parameters(neuron: Neuron | Population) -> Iterator[str]:
    for parameter in neuron.model.parameters:
        value = neuron.parameters[parameter.name]
        yield f"{parameter.name} {value_text(value, parameter_unit(neuron, parameter))}"


def _readout(output: OutputNode) -> Iterator[str]:
    for name, weight in output.readout:
        yield f"{value_text(weight, output.unit)} · {name}"


def _over_the_steps(output: OutputNode) -> str:
    if output.leak is None:
        return "the sum itself"
    return f"adds up, leaks {output.leak * 100:g} %" if output.leak else "adds up"
