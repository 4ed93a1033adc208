"""`circuitkit draw`."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from circuitkit.cli.options import CircuitFile, Settings, read_graph
from circuitkit.cli.printing import examples, note


class What(Enum):
    """What to draw."""

    GRAPH = "graph"
    ACTIVATIONS = "activations"


PLACE = 24


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit draw binn_lateral -o out.svg",
            "circuitkit draw my_circuit.yaml -o out.html",
            "circuitkit draw binn_lateral --what activations --set margin=4mm -o curves.pdf",
        )
    )(draw)


def draw(
    file: CircuitFile,
    *,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="OUT", help="Ends in .png, .svg, .pdf, .dot or .html."),
    ],
    what: Annotated[
        What, typer.Option("--what", help="The network, or the curve of every neuron.")
    ] = What.GRAPH,
    settings: Settings = None,
) -> None:
    """Draw a circuit.

    Either the network, or the activation curve of every neuron.

    The suffix of OUT chooses the format. Missing folders of OUT are made.
    """
    from circuitkit.draw import draw_activations, draw_circuit  # late: see cli/__init__.py

    write = {What.GRAPH: draw_circuit, What.ACTIVATIONS: draw_activations}[what]
    write(read_graph(file, settings), output)
    note(f"wrote {output}")
