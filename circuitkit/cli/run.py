"""`circuitkit run`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from circuitkit.base.progress import progress_bar
from circuitkit.cli.options import (
    LAST_SEED,
    Backend,
    CircuitFile,
    Settings,
    Verbose,
    named_values,
    read_graph,
)
from circuitkit.cli.printing import examples, note, print_json

if TYPE_CHECKING:
    from circuitkit.engine.table import RunTable


class Precision(Enum):
    """In which numbers a circuit is computed."""

    FLOAT64 = "float64"
    FLOAT32 = "float32"


PLACE = 25
_MAX_MISSED = "1%"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit run binn_lateral --input zmp_y=70mm --steps 100 -o out.csv",
            'circuitkit run binn_lateral --input "zmp_y=-90 mm" --input force_difference=0.4 --steps 20',
            "circuitkit run binn_lateral --inputs table.csv -o out.nc",
            "circuitkit run binn_lateral --set w=2deg --set q1.slope=50/m --steps 20 --backend numpy",
            "circuitkit run binn_lateral --input zmp_y=70mm --realtime 1 --rate 1000 --max-missed 50%",
            "circuitkit run matsuoka_half_centre --steps 300 --record flexor.v --record joint_angle",
        )
    )(run)


def run(
    file: CircuitFile,
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
    settings: Settings = None,
    record: Annotated[
        list[str] | None,
        typer.Option(
            "--record",
            metavar="NAME",
            help="Only this neuron, population, output or state such as q1.v; once for each name.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="OUT", help="Ends in .csv or .nc; by default CSV on standard output."
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, max=LAST_SEED, help="Of the neurons' noise.")
    ] = 0,
    backend: Backend = "auto",
    precision: Annotated[
        Precision, typer.Option("--precision", help="Of the numbers it is computed in.")
    ] = Precision.FLOAT64,
    realtime: Annotated[
        float | None,
        typer.Option(
            "--realtime",
            metavar="SECONDS",
            help="Step at a fixed rate instead; tell how late the ticks were.",
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option("--rate", metavar="HZ", help="Of --realtime; by default that of the control step."),
    ] = None,
    max_missed: Annotated[
        str | None,
        typer.Option(
            "--max-missed",
            metavar="N|P%",
            help="Of --realtime: how many deadlines may be missed; exit code 3 if more are. By default 1%.",
        ),
    ] = None,
    priority: Annotated[
        int | None,
        typer.Option(
            "--priority",
            metavar="N",
            min=1,
            max=99,
            help="Of --realtime: ask for SCHED_FIFO with this priority and for locked memory.",
        ),
    ] = None,
    verbose: Verbose = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print a summary with the last row as JSON.")
    ] = False,
) -> None:
    """Run a circuit alone, without a robot.

    One row a step; the columns are time_s, then inputs, neurons and outputs by name, each in the unit that
    the circuit file declares. Inputs that are not given are held at 0. Missing folders of OUT are made.
    """
    constants = named_values(values, "--input", "zmp_y=70mm")
    if realtime is not None:
        _require_nothing_else(steps=steps, record=record, output=output)
        from circuitkit.cli._realtime import Limit, run_realtime  # late: see cli/__init__.py

        run_realtime(
            read_graph(file, settings),
            realtime,
            rate,
            constants,
            table,
            limit=Limit.read(_MAX_MISSED if max_missed is None else max_missed),
            priority=priority,
            backend=backend,
            precision=precision.value,
            verbose=verbose,
            as_json=as_json,
        )
        return
    _require_realtime({"--rate": rate, "--max-missed": max_missed, "--priority": priority})
    if steps is None and table is None:
        message = "give --steps N, or --inputs TABLE.csv with one row a step"
        raise typer.BadParameter(message)
    from circuitkit.engine.table import (  # late: see cli/__init__.py
        require_format,
        run_lines,
        run_table,
        write_run,
    )

    if output is not None:
        require_format(output)
    graph = read_graph(file, settings)
    with progress_bar("running") as progress:
        result = run_table(
            graph,
            values=constants,
            table=table,
            steps=steps,
            record=record or (),
            backend=backend,
            precision=precision.value,
            seed=seed,
            progress=progress,
        )
    for text in result.notes:
        note(f"note: {text}")
    if verbose:
        note(result.backend)
    if output is not None:
        write_run(result, output)
    if as_json:
        print_json(_summary(result, output))
    elif output is not None:
        note(f"wrote {output}: {result.steps} steps of {result.step_s * 1e3:g} ms")
    else:
        sys.stdout.writelines(run_lines(result))


def _require_nothing_else(**options: object) -> None:
    """Refuse options that say what to record, where nothing is."""
    if any(options.values()):
        message = "--realtime measures and records nothing; leave out --steps, --record and -o"
        raise typer.BadParameter(message)


def _require_realtime(options: Mapping[str, object]) -> None:
    """Refuse options of --realtime without it."""
    for option, value in options.items():
        if value is not None:
            message = f"{option} goes with --realtime SECONDS"
            raise typer.BadParameter(message)


def _summary(result: RunTable, output: Path | None) -> dict[str, object]:
    return {
        "circuit": result.circuit,
        "steps": result.steps,
        "step_s": result.step_s,
        "units": {column.name: column.unit.symbol for column in result.columns},
        "last": result.last(),
        "recording": str(output) if output is not None else None,
        "backend": result.backend,
    }
