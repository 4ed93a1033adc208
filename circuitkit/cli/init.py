"""`circuitkit init`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circuitkit.cli.options import names_of_files
from circuitkit.cli.printing import examples, note

DEFAULT = Path("circuit.yaml")
_ROBOT = Path("robot.yaml")
PLACE = 10


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit init",
            "circuitkit init new/walker.yaml --from oscillator",
            "circuitkit init walker.yaml --from population --force",
            "circuitkit init my_robot.yaml --robot model.xml",
        )
    )(init)


def init(
    file: Annotated[Path, typer.Argument(metavar="[FILE]", help="Where it goes.")] = DEFAULT,
    *,
    template: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="TEMPLATE",
            help=f"Of what kind: {names_of_files('circuit/authoring/starters', '.yaml')}.",
        ),
    ] = "reflex",
    robot: Annotated[
        Path | None,
        typer.Option("--robot", metavar="XML", help="Write a robot file for this MJCF, not a circuit."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
) -> None:
    """Write a commented circuit or robot file to start from.

    It is valid, runs at once, and its comments say what to try. The JSON Schema that editors need to check
    and complete circuit files is written beside it. A robot file has every sensor, joint and actuator of the
    MJCF. Missing folders of FILE are made.
    """
    if robot is not None:
        from circuitkit.robots.starter import write_robot_starter  # late: see cli/__init__.py

        path = write_robot_starter(robot, _ROBOT if file == DEFAULT else file, force=force)
        note(f"wrote {path}")
        note(f"next: a scenario with robot: {path}; docs/robots/README.md has an example")
        return
    from circuitkit.circuit.authoring.starter import write_starter  # late: see cli/__init__.py

    for path in write_starter(file, template, force=force):
        note(f"wrote {path}")
    note(f"next: circuitkit validate {file}; what else to try stands at the top of the file")
