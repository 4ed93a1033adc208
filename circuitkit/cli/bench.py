"""`circuitkit bench`."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from circuitkit.base.progress import progress_bar
from circuitkit.cli.printing import examples, note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.study.bench import Row

PLACE = 60


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog=examples("circuitkit bench", "circuitkit bench compiled", "circuitkit bench --json"))(
        bench
    )


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME...]", help="Only the cases whose name contains one of these."),
    ] = None,
    *,
    rounds: Annotated[
        int, typer.Option("--rounds", min=1, metavar="N", help="Rounds to take the median of.")
    ] = 15,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Run the benchmarks of the repository, as ratios.

    Each case is timed in turns with what it is compared with, on one core unless it says otherwise. A few are
    amounts with a limit of their own, such as the time to load a file. The benchmarks lie in a clone of the
    repository, not in the installed package.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy reads it when it is imported, which is later
    from circuitkit.study.bench import measure, select, shipped_cases  # late: see cli/__init__.py

    cases = select(shipped_cases(), names or [])
    rows = []
    with progress_bar("measuring") as progress:
        for row in measure(cases, rounds):
            rows.append(row)
            if progress is not None:
                progress(len(rows), len(cases))
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    print_table(
        "time of the case / time of what it is compared with, medians",
        ("case", ">seconds", ">ratio", ">limit", "", "against"),
        (_cells(row) for row in rows if not row.note),
    )
    for row in rows:
        if row.note:
            note(f"left out: {row.case}: {row.note}")


def _cells(row: Row) -> tuple[str, ...]:
    unit = f" {row.unit}" if row.unit else ""
    return (
        row.case,
        "" if row.seconds is None else f"{row.seconds:.3g}",
        f"{row.ratio:.3g}" if row.ratio is not None else f"{row.amount:.3g}{unit}",
        "" if row.limit is None else f"{row.limit:.3g}{unit}",
        {True: "ok", False: "short", None: ""}[row.ok],
        row.against,
    )
