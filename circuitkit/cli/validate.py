"""`circuitkit validate`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from circuitkit.base.errors import InputError, Problem
from circuitkit.cli.options import SETTINGS, Settings, named_values
from circuitkit.cli.printing import counted, examples, note, print_json

PLACE = 20


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit validate binn_lateral",
            "circuitkit validate my_circuit.yaml other.yaml",
            "circuitkit validate binn_lateral --set margin=4mm",
            "circuitkit validate binn_lateral --json",
        )
    )(validate)


def validate(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Circuit files, or names of shipped circuits.")
    ],
    *,
    settings: Settings = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Check circuit files and list all errors at once.

    Warnings do not make a file invalid.
    """
    values = named_values(settings, *SETTINGS)
    findings = {file: _check(file, values) for file in files}
    errors = [problem for found, _ in findings.values() for problem in found]
    if as_json:
        warnings = [problem for _, found in findings.values() for problem in found]
        print_json(
            {
                "valid": not errors,
                "errors": [asdict(problem) for problem in errors],
                "warnings": [asdict(problem) for problem in warnings],
            }
        )
    else:
        for file, (wrong, doubtful) in findings.items():
            for problem in wrong:
                note(problem)
            for problem in doubtful:
                note(f"{problem} (warning)")
            print(f"{file}: {_verdict(len(wrong), len(doubtful))}")
    raise typer.Exit(1 if errors else 0)


def _check(file: str, values: dict[str, str]) -> tuple[tuple[Problem, ...], tuple[Problem, ...]]:
    """Errors and warnings of a file; of one without errors also those that other values bring."""
    from circuitkit.circuit import check, load_circuit  # late: see cli/__init__.py

    errors, warnings = check(file)
    if values and not errors:
        try:
            load_circuit(file, values, option="--set")
        except InputError as error:
            return error.problems, warnings
    return errors, warnings


def _verdict(errors: int, warnings: int) -> str:
    verdict = counted(errors, "error") if errors else "valid"
    return f"{verdict}, {counted(warnings, 'warning')}" if warnings else verdict
