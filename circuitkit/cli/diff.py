"""`circuitkit diff`."""

from __future__ import annotations

from dataclasses import asdict
from itertools import groupby
from typing import TYPE_CHECKING, Annotated

import typer

from circuitkit.cli.options import Settings, read_graph
from circuitkit.cli.printing import examples, print_json

if TYPE_CHECKING:
    from circuitkit.circuit.authoring.difference import Change

CIRCUITS_DIFFER = 1
_SIGNS = {"added": "+", "removed": "-", "changed": "~", "renamed": "="}

PLACE = 23


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit diff binn_lateral binn_lateral_tuned",
            "circuitkit diff binn_lateral my_circuit.yaml --exit-code",
            "circuitkit diff binn_lateral binn_lateral --set w=2deg --json",
        )
    )(diff)


def diff(
    old: Annotated[str, typer.Argument(metavar="A", help="A circuit: a file or a shipped name.")],
    new: Annotated[str, typer.Argument(metavar="B", help="The circuit that it is compared with.")],
    *,
    settings: Settings = None,
    exit_code: Annotated[
        bool, typer.Option("--exit-code", help="Exit with 1 if the circuits differ.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the changes as JSON.")] = False,
) -> None:
    """Say what changed from circuit A to circuit B.

    Compared is what the files mean, in terms of neurons, synapses, inputs, outputs, parameters and timing. A
    neuron of another name that is otherwise the same counts as renamed. --set changes values of B.
    """
    from circuitkit.circuit.authoring.difference import compare_circuits  # late: see cli/__init__.py

    changes = compare_circuits(read_graph(old, None), read_graph(new, settings))
    if as_json:
        print_json({"equal": not changes, "changes": [asdict(change) for change in changes]})
    elif not changes:
        print(f"{old} and {new} mean the same")
    else:
        _print(changes)
    raise typer.Exit(CIRCUITS_DIFFER if exit_code and changes else 0)


def _print(changes: tuple[Change, ...]) -> None:
    """One line a change under the name of its kind, then how many there are of each sort."""
    for kind, group in groupby(changes, lambda change: change.kind):
        print(kind if kind == "circuit" else f"{kind}s")
        for change in group:
            print(f"  {_SIGNS[change.what]} {_line(change)}")
    counts = {what: sum(change.what == what for change in changes) for what in _SIGNS}
    print(", ".join(f"{count} {what}" for what, count in counts.items() if count))


def _line(change: Change) -> str:
    match change.what:
        case "added":
            return f"{change.name}: {change.new}"
        case "removed":
            return f"{change.name}: {change.old}"
        case "renamed":
            return f"{change.old} is now {change.new}"
        case "changed":
            field = "" if change.kind == "parameter" else change.field
            place = " ".join(part for part in (change.name, field) if part)
            return f"{place}: {change.old} → {change.new}"
