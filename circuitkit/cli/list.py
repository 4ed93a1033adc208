"""`circuitkit list`."""

from __future__ import annotations

from typing import Annotated

import typer

from circuitkit.cli.printing import examples, print_json, print_table


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        name="list",
        epilog=examples("circuitkit list", "circuitkit list robots", "circuitkit list circuits --json"),
    )(list_shipped)


def list_shipped(
    what: Annotated[
        str | None, typer.Argument(metavar="[WHAT]", help="circuits, robots, scenarios, controllers, ... or all.")
    ] = None,
    *,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List what ships and what plug-ins bring, with one line each."""
    from circuitkit.base.catalogue import catalogue  # reads files

    found = catalogue(what)
    if as_json:
        print_json([{"kind": each.kind, "name": each.name, "description": each.description, "file": str(each.path)} for each in found])
        return
    for kind in dict.fromkeys(each.kind for each in found):
        rows = [(each.name, each.description) for each in found if each.kind == kind]
        print_table(kind, ("name", "what it is"), rows)
