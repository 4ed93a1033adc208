"""`circuitkit bench`."""

from __future__ import annotations

from typing import Annotated

import typer

from circuitkit.cli.printing import examples, print_json, print_table, progress_bar


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog=examples("circuitkit bench", "circuitkit bench engine", "circuitkit bench --json"))(
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

    Each case is timed in turns with what it is compared with. The benchmarks lie in a clone of the
    repository, not in the installed package.
    """
    from dataclasses import asdict

    from circuitkit.study.bench import measure, select, shipped_cases

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
        "benchmarks: time of the case / time of what it is compared with",
        ("case", ">seconds", ">ratio", "against", ">limit"),
        (
            (
                row.case,
                f"{row.seconds:.3g}",
                f"{row.ratio:.2f}",
                row.against,
                "" if row.limit is None else f"{row.limit:g}",
            )
            for row in rows
        ),
    )
