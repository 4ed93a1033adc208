"""`circuitkit init`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circuitkit.cli.printing import examples, note


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit init",
            "circuitkit init new/walker.yaml --from oscillator",
            "circuitkit init walker.yaml --from population --force",
        )
    )(init)


def init(
    file: Annotated[Path, typer.Argument(metavar="[FILE]", help="Where the circuit goes.")] = Path(
        "circuit.yaml"
    ),
    *,
    template: Annotated[
        str, typer.Option("--from", metavar="TEMPLATE", help="reflex, oscillator or population.")
    ] = "reflex",
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
) -> None:
    """Write a commented circuit to start from.

    It is valid, runs at once, and its comments say what to try. The JSON Schema that editors need to check
    and complete circuit files is written beside it. Missing folders of FILE are made.
    """
    from circuitkit.circuit.authoring.starter import write_starter

    for path in write_starter(file, template, force=force):
        note(f"wrote {path}")
    note(f"next: circuitkit validate {file}; what else to try stands at the top of the file")
