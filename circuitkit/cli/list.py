"""`circuitkit list`."""

from __future__ import annotations

from typing import Annotated

import typer

from circuitkit.cli.printing import examples, print_json, print_table

PLACE = 11


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        name="list",
        epilog=examples("circuitkit list", "circuitkit list robots", "circuitkit list circuits --json"),
    )(list_shipped)


def list_shipped(
    kind: Annotated[
        str | None, typer.Argument(metavar="[KIND]", help="Only these, such as robots or scenarios.")
    ] = None,
    *,
    as_json: Annotated[bool, typer.Option("--json", help="Print the list as JSON.")] = False,
) -> None:
    """List what ships, with a line about each: what commands and files can name.

    Without KIND, all kinds: circuits, robots, scenarios, controllers and more.
    """
    from circuitkit.base.catalogue import catalogue  # here, for the start-up: see app.py

    found = catalogue(kind)
    if as_json:
        print_json(
            [
                {
                    "kind": each.kind,
                    "name": each.name,
                    "description": each.description,
                    "file": str(each.path),
                }
                for each in found
            ]
        )
        return
    for each_kind in dict.fromkeys(each.kind for each in found):
        rows = [(each.name, each.description) for each in found if each.kind == each_kind]
        print_table(each_kind, ("name", "what it is"), rows)
