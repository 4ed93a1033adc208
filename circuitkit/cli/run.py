"""`circuitkit run`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from circuitkit.cli.printing import examples, note, print_json, progress_bar


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit run binn_lateral --input zmp_y=70mm --steps 100 -o out.csv",
            'circuitkit run binn_lateral --input "zmp_y=-90 mm" --input force_difference=0.4 --steps 20',
            "circuitkit run binn_lateral --inputs table.csv -o out.nc",
        )
    )(run)


def run(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A circuit file, or the name of a shipped circuit.")
    ],
    *,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="NAME=VALUE",
            help="Hold an input at a value with its unit; once for each input.",
        ),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            "--inputs",
            metavar="TABLE.csv",
            help="Inputs from a table: a header with names, one row a step, in the circuit file's units.",
        ),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option("--steps", metavar="N", min=1, help="How many steps; by default the rows of TABLE.csv."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Ends in .csv or .nc; by default CSV on standard output."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print a summary with the last row as JSON.")
    ] = False,
) -> None:
    """Run a circuit alone, without a robot.

    One row a step; the columns are time_s, then inputs, neurons and outputs by name, each in the unit that
    the circuit file declares. Inputs that are not given are held at 0. Missing folders of OUT are made.
    """
    from circuitkit.circuit import load_circuit, resolve
    from circuitkit.engine.table import csv_lines, require_format, run_table, write_run

    constants = _named_values(values or [])
    if steps is None and table is None:
        message = "give --steps N, or --inputs TABLE.csv with one row a step"
        raise typer.BadParameter(message)
    if output is not None:
        require_format(output)
    graph = resolve(load_circuit(file))
    with progress_bar("running") as progress:
        result = run_table(graph, values=constants, table=table, steps=steps, progress=progress)
    for text in result.notes:
        note(f"note: {text}")
    if output is not None:
        write_run(result, output)
    if as_json:
        print_json(
            {
                "circuit": result.circuit,
                "steps": result.steps,
                "step_s": result.step_s,
                "units": {column.name: column.unit.symbol for column in result.columns},
                "last": result.last(),
                "recording": str(output) if output is not None else None,
            }
        )
    elif output is not None:
        note(f"wrote {output}: {result.steps} steps of {result.step_s * 1e3:g} ms")
    else:
        sys.stdout.writelines(csv_lines(result))


def _named_values(texts: list[str]) -> dict[str, str]:
    named: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (equals and name.strip() and value.strip()):
            message = f"found '{text}'; allowed: NAME=VALUE, such as zmp_y=70mm"
            raise typer.BadParameter(message, param_hint="--input")
        if name.strip() in named:
            message = f"'{name.strip()}' is given twice"
            raise typer.BadParameter(message, param_hint="--input")
        named[name.strip()] = value.strip()
    return named
