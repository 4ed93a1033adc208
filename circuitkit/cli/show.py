"""`circuitkit show`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circuitkit.cli.options import CircuitFile, Settings, read_graph
from circuitkit.cli.printing import examples, print_json

PLACE = 22


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit show binn_lateral",
            "circuitkit show binn_lateral q1",
            "circuitkit show binn_lateral q1 --set margin=4mm -o q1.svg",
            "circuitkit show binn_lateral --resolved > flat.yaml",
            "circuitkit show binn_lateral --json",
        )
    )(show)


def show(
    file: CircuitFile,
    neuron: Annotated[
        str | None,
        typer.Argument(metavar="[NEURON]", help="A neuron, population or member such as ring[3] to explain."),
    ] = None,
    *,
    settings: Settings = None,
    resolved: Annotated[
        bool,
        typer.Option(
            "--resolved", help="Print the flat YAML: no includes, no parameters, all values written out."
        ),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="OUT", help="Draw NEURON's curve: .png, .svg or .pdf."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the flat circuit as JSON.")] = False,
) -> None:
    """Show what a circuit file resolves to, or explain one neuron.

    Tables of the inputs, neurons, synapses and outputs, with every value worked out; or of one neuron its
    equations and numbers, its inputs and where it goes with the lines of the file, and its curve.
    """
    if output is not None and neuron is None:
        message = "-o draws the curve of one neuron; name it, or use circuitkit draw"
        raise typer.BadParameter(message)
    graph = read_graph(file, settings)
    if neuron is not None:
        from circuitkit.cli._explaining import show_neuron  # late: see cli/__init__.py

        show_neuron(graph, neuron, output, as_json=as_json)
        return
    from circuitkit.circuit.authoring.flat import flat_document, flat_yaml  # the same
    from circuitkit.cli._showing import print_tables  # the same

    if as_json:
        print_json(flat_document(graph))
    elif resolved:
        print(flat_yaml(graph), end="")
    else:
        print_tables(graph)
