"""What `simulate` and `compare` print when they are done: one line a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from circuitkit.cli.main import INTERRUPTED
from circuitkit.cli.printing import note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.simulation.run import Result


_CIRCUIT = "circuit"  # the controller that --set is for


def finish(
    results: Sequence[Result],
    output: Path | None,
    *,
    settings: Mapping[str, str],
    as_json: bool,
    verbose: bool,
) -> None:
    """Print verdicts; a run that was stopped by Ctrl-C has its say too, and then ends the command.

    Args:
        results: The runs.
        output: Where the recordings were written; None if nowhere.
        settings: What was set in the circuit by `--set`.
        as_json: Print JSON instead of a table.
        verbose: Also say which backend ran the circuit.
    """
    rows = [result.row() for result in results]
    if as_json:
        print_json(rows)
    else:
        print_results(rows)
        if output is not None:
            note(f"wrote {output}")
    for text in dict.fromkeys(result.backend for result in results if verbose and result.backend):
        note(text)
    for text in (text for row in rows for text in row.get("notes", ())):
        note(text)
    if settings and not any(row["controller"] == _CIRCUIT for row in rows):
        named = ", ".join(dict.fromkeys(str(row["controller"]) for row in rows))
        note(f"--set changes no run: it is for the controller circuit, and here is only {named}")
    if any(row["interrupted"] for row in rows):
        raise typer.Exit(INTERRUPTED)


def print_results(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print verdicts.

    Args:
        rows: With the keys of the command line's JSON: "scenario", "controller", "seed", "push", "survived",
            "time_of_fall_s", "max_zmp_excursion_m", "recovery_time_s", "interrupted".
    """
    print_table(
        ", ".join(dict.fromkeys(str(row["scenario"]) for row in rows)),
        ("controller", ">seed", "push", "verdict", ">largest ZMP excursion", ">back inside after"),
        (
            (
                str(row["controller"]),
                str(row["seed"]),
                _push(row["push"]),
                _verdict(row),
                _scaled(row["max_zmp_excursion_m"], 1e3, "mm"),
                _scaled(row["recovery_time_s"], 1.0, "s"),
            )
            for row in rows
        ),
    )


def _verdict(row: Mapping[str, Any]) -> str:
    if not row["survived"]:
        return f"fell at {row['time_of_fall_s']:.2f} s"
    return "stood until interrupted" if row["interrupted"] else "stood"


def _push(push: Mapping[str, Any] | None) -> str:
    if push is None:
        return "none"
    return f"{push['force_n']:g} N, {push['duration_s'] * 1e3:g} ms, {push['direction']}"


def _scaled(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None or math.isnan(value) else f"{value * factor:.3g} {unit}"
