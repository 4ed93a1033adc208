"""`circuitkit reproduce`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from circuitkit.cli.printing import examples, note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.paper.reproduce.finding import Claim

PLACE = 50


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit reproduce -o out/paper --quick",
            "circuitkit reproduce fig11 -o out/paper",
            "circuitkit reproduce fig9 fig10 -o out/paper --json",
            "circuitkit reproduce robustness -o out/paper --again --workers 8",
        )
    )(reproduce)


def reproduce(
    figures: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FIGURE...]",
            help="Such as fig9 or robustness; all, if none is named. An unknown name lists them.",
        ),
    ] = None,
    *,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder for the figures, their runs and the report."
        ),
    ],
    quick: Annotated[bool, typer.Option("--quick", help="All of it, coarser, in under 10 minutes.")] = False,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, metavar="N", help="Processes; one for each processor by default."),
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Make figures anew that are finished, with all their runs.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the table of claims as JSON.")] = False,
) -> None:
    """Make the figures of the paper and a report that sets each of its claims beside ours.

    Writes report.html, which carries its pictures, and report.md. A call that was stopped goes on where it
    was when it is given again.
    """
    if output.exists() and not output.is_dir():
        message = f"'{output}' is no folder"
        raise typer.BadParameter(message, param_hint="--output")
    from circuitkit.paper.reproduce import reproduce as make  # late: see cli/__init__.py

    made = make(figures or [], output, quick=quick, workers=workers, again=again, progress=True, log=note)
    claims = [(finding.figure, claim) for finding in made.findings for claim in finding.claims]
    if as_json:
        print_json([{"figure": figure, **asdict(claim)} for figure, claim in claims])
    else:
        _print_claims(claims)
    note(f"wrote {made.html}")


def _print_claims(claims: list[tuple[str, Claim]]) -> None:
    print_table(
        "claims",
        ("figure", "claim", "the paper", "ours", "verdict"),
        ((figure, claim.claim, claim.paper, claim.ours, claim.verdict.value) for figure, claim in claims),
    )
