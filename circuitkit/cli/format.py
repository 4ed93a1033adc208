"""`circuitkit format`."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from circuitkit.base.errors import InputError
from circuitkit.cli.printing import examples, note

PLACE = 21


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit format my_circuit.yaml",
            "circuitkit format my_circuit.yaml other.yaml --check",
            "circuitkit format my_circuit.yaml --diff",
        )
    )(format)


def format(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Circuit files, or names of shipped circuits.")
    ],
    *,
    check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit with 1 if a file is in another form.")
    ] = False,
    diff: Annotated[
        bool, typer.Option("--diff", help="Write nothing; print what would change, as a patch.")
    ] = False,
) -> None:
    """Bring circuit files into the normal form.

    Order of sections and keys, spacing, indentation, lines of 110 characters, and the spelling of quantities
    are made alike. Comments stay, and so does what the file means. A file with errors is left as it is.
    """
    from circuitkit.circuit.authoring.formatting import format_file  # late: see cli/__init__.py

    wrong = False
    for file in files:
        try:
            formatted = format_file(file)
        except InputError as error:  # the other files are still done
            note(error)
            wrong = True
            continue
        wrong |= check and formatted.changes
        if diff:
            sys.stdout.writelines(formatted.patch())
        elif check:
            print(f"{file}: {'in another form' if formatted.changes else 'in the normal form'}")
        else:
            formatted.write()
            note(f"{file}: {'formatted' if formatted.changes else 'left as it is'}")
    raise typer.Exit(1 if wrong else 0)
