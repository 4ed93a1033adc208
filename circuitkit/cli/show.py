"""`circuitkit show`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from circuitkit.cli.printing import examples, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.circuit import CircuitGraph
    from circuitkit.circuit.graph import Neuron, OutputNode


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit show binn_lateral",
            "circuitkit show binn_lateral --resolved > flat.yaml",
            "circuitkit show binn_lateral --json",
        )
    )(show)


def show(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A circuit file, or the name of a shipped circuit.")
    ],
    *,
    resolved: Annotated[
        bool,
        typer.Option(
            "--resolved", help="Print the flat YAML: no includes, no parameters, all values written out."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the flat circuit as JSON.")] = False,
) -> None:
    """Show what a circuit file resolves to.

    Tables of the inputs, neurons, synapses and outputs, with every value worked out.
    """
    from circuitkit.circuit import load_circuit, resolve
    from circuitkit.circuit.flat import flat_document, flat_yaml

    graph = resolve(load_circuit(file))
    if as_json:
        print_json(flat_document(graph))
    elif resolved:
        print(flat_yaml(graph), end="")
    else:
        _print_tables(graph)


def _print_tables(graph: CircuitGraph) -> None:
    from circuitkit.circuit.flat import weight_unit
    from circuitkit.units import format_quantity

    print(f"{graph.name}: {graph.description}" if graph.description else graph.name)
    print(f"timing {graph.timing}, control step {graph.step_s * 1e3:g} ms\n")
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
    print_table(
        "synapses",
        ("from", "to", ">weight", "kind"),
        (
            (x.source, x.target, format_quantity(x.weight, weight_unit(graph, x)), x.kind)
            for x in graph.synapses
        ),
    )
    print_table(
        "outputs",
        ("name", "readout", "over the steps", ">from", ">to", "description"),
        (
            (
                x.name,
                " + ".join(
                    f"{format_quantity(weight, x.unit)} · {name}" for name, weight in x.readout
                ).replace("+ -", "- "),
                _over_the_steps(x),
                format_quantity(x.low, x.unit) if math.isfinite(x.low) else "",
                format_quantity(x.high, x.unit) if math.isfinite(x.high) else "",
                x.description,
            )
            for x in graph.outputs
        ),
    )


def _parameters(neuron: Neuron) -> Iterator[str]:
    from circuitkit.circuit.flat import parameter_unit
    from circuitkit.units import format_quantity

    for parameter in neuron.model.parameters:
        value = neuron.parameters[parameter.name]
        yield f"{parameter.name} {format_quantity(value, parameter_unit(neuron, parameter))}"


def _over_the_steps(output: OutputNode) -> str:
    if output.leak is None:
        return "the sum itself"
    return f"adds up, leaks {output.leak * 100:g} %" if output.leak else "adds up"
