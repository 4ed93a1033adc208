"""`circuitkit list`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from circuitkit.cli.printing import examples, print_json, print_table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from circuitkit.base.registry import Registry

PLACE = 11


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        name="list",
        epilog=examples(
            "circuitkit list",
            "circuitkit list robots",
            "circuitkit list circuits --json",
            "circuitkit list kinds-of-disturbances",
        ),
    )(list_names)


def list_names(
    kind: Annotated[
        str | None,
        typer.Argument(metavar="[KIND]", help="Only these, such as robots; an unknown one names all."),
    ] = None,
    *,
    as_json: Annotated[bool, typer.Option("--json", help="Print the list as JSON.")] = False,
) -> None:
    """List what commands and files can name, with a line about each.

    Without KIND, all of it: the files that ship or that plug-ins bring, such as circuits, robots, scenarios,
    controllers and models; and the kinds that register themselves, such as kinds-of-references.
    """
    from circuitkit.base.catalogue import catalogue, file_kinds  # late: see cli/__init__.py

    found = catalogue(kind, () if kind in file_kinds() else _registries())
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


def _registries() -> Iterable[Registry[Any]]:
    """All registries, each of which is there once the package that it belongs to is imported."""
    from circuitkit.paper.reproduce.figure import FIGURES  # late, too; it imports all the others

    return FIGURES.every.values()
