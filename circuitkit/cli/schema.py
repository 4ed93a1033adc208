"""`circuitkit schema`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from circuitkit.base.files import write_text
from circuitkit.cli.printing import examples, note, print_json

PLACE = 26


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog=examples("circuitkit schema", "circuitkit schema -o circuit.schema.json"))(schema)


def schema(
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="OUT", help="Write it to this file instead.")
    ] = None,
) -> None:
    """Print the JSON Schema of the circuit file.

    Editors that know it complete and check circuit files as they are typed. The first line of a circuit file
    names it: # yaml-language-server: $schema=circuit.schema.json
    """
    from circuitkit.circuit import circuit_schema  # late: see cli/__init__.py

    if output is None:
        print_json(circuit_schema())
    else:
        write_text(output, json.dumps(circuit_schema(), indent=2, ensure_ascii=False) + "\n")
        note(f"wrote {output}")
