"""What `simulate` and `compare` print when they are done: one line a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from circuitkit.base.errors import CircuitkitError
from circuitkit.cli.printing import note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.base.units import Unit
    from circuitkit.simulation.result import Result


_CIRCUIT = "circuit"  # the controller that --set is for


def finish(
    results: Sequence[Result],
    output: Path | None,
    *,
    settings: Mapping[str, str],
    as_json: bool,
    verbose: bool,
) -> None:
    """Print the outcomes; a run that was stopped by Ctrl-C has its say too, and then ends the command.

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
        _print_results(results)
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
        raise KeyboardInterrupt
    if any(row["invalid"] for row in rows):
        raise typer.Exit(CircuitkitError.exit_code)


def _print_results(results: Sequence[Result]) -> None:
    """Print one line a run: the outcome, and every measure in its unit."""
    rows = [result.row() for result in results]
    units: dict[str, Unit | None] = {}
    for result in results:
        units |= result.units
    shown = [name for name in units if name not in _TOLD]
    pushed = any(row["push"] is not None for row in rows)
    print_table(
        ", ".join(dict.fromkeys(str(row["scenario"]) for row in rows)),
        (
            "controller",
            ">seed",
            *(("push",) if pushed else ()),
            "outcome",
            *(f">{_heading(name, units[name])}" for name in shown),
        ),
        (
            (
                str(row["controller"]),
                str(row["seed"]),
                *((_push(row["push"]),) if pushed else ()),
                result.outcome,
                *(_measure(row.get(name), units[name]) for name in shown),
            )
            for row, result in zip(rows, results, strict=True)
        ),
    )
    for row, result in zip(rows, results, strict=True):
        for remark in result.remarks:
            print(f"{row['controller']}: {remark}")


_TOLD = frozenset({"survived", "time_of_fall_s"})  # measures that the outcome tells


def _heading(name: str, unit: Unit | None) -> str:
    """The name of a measure without the unit at its end, which stands beside the number."""
    ending = "" if unit is None else f"_{unit.symbol.replace('/', '_')}"
    return name.removesuffix(ending).replace("_", " ") if ending != "_1" else name.replace("_", " ")


def _push(push: Mapping[str, Any] | None) -> str:
    """The first push, and how many there are besides."""
    if push is None:
        return "none"
    size = f"{push['torque_nm']:g} N*m" if push["force_n"] is None else f"{push['force_n']:g} N"
    seconds = push["duration_s"]
    lasts = f"{seconds:g} s" if seconds >= 1 else f"{seconds * 1e3:g} ms"
    more = f", and {push['pushes'] - 1} more" if push["pushes"] > 1 else ""
    return f"{size}, {lasts}, {push['direction']}{more}"


def _measure(value: float | bool | None, unit: Unit | None) -> str:
    """A value with its unit; lengths of less than a metre in millimetres."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if unit is None or unit.symbol == "1":
        return f"{value:.3g}"
    if unit.symbol in {"rad", "rad/s"}:
        return f"{math.degrees(value):.3g} {unit.symbol.replace('rad', 'deg')}"
    if unit.symbol in {"m", "m/s"} and abs(value) < 1:
        return f"{value * 1e3:.3g} m{unit.symbol}"
    return f"{value:.3g} {unit.symbol}"
