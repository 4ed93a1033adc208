"""`circuitkit compare`."""

from __future__ import annotations

from typing import Annotated

import typer

from circuitkit.cli.options import (
    CONTROLLERS,
    SETTINGS,
    Backend,
    Circuit,
    Folder,
    Push,
    Robot,
    Scenario,
    Seed,
    Settings,
    Verbose,
    Verdicts,
    Video,
    named_values,
    require_folder,
)
from circuitkit.cli.printing import examples
from circuitkit.cli.results import finish

PLACE = 31


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit compare nao_push --controllers open_loop,circuit",
            "circuitkit compare nao_push --controllers open_loop,circuit --push 20N,200ms,outward --seed 1",
            "circuitkit compare nao_push --controllers open_loop,circuit,mpc,stepping",
            "circuitkit compare arm_reflex --controllers open_loop,circuit -o out/compare --json",
            "circuitkit compare vehicle_avoids --controllers open_loop,circuit -o out/film --video",
        )
    )(compare)


def compare(
    scenario: Scenario,
    *,
    controllers: Annotated[
        str,
        typer.Option(
            "--controllers",
            metavar="NAME,NAME...",
            help=f"Which, with commas between them: {CONTROLLERS}.",
        ),
    ],
    robot: Robot = None,
    circuit: Circuit = None,
    settings: Settings = None,
    push: Push = None,
    seed: Seed = None,
    backend: Backend = "auto",
    output: Folder = None,
    video: Video = False,
    verbose: Verbose = False,
    as_json: Verdicts = False,
) -> None:
    """Run a scenario under several controllers: the same robot, reference, disturbances and seed.

    Prints a line for each: how it ended, and every measure of the scenario in its unit.

    With -o DIR, writes a folder for each controller, and plots that compare them. Missing folders are made.
    """
    names = [name.strip() for name in controllers.split(",") if name.strip()]
    if not names:
        message = "name at least one controller, such as open_loop,circuit"
        raise typer.BadParameter(message, param_hint="--controllers")
    require_folder(output, video=video)
    values = named_values(settings, *SETTINGS)

    from circuitkit.simulation import compare as run_comparison  # late: see cli/__init__.py

    results = run_comparison(
        scenario,
        names,
        robot=robot,
        circuit=circuit,
        settings=values,
        backend=backend,
        push=push,
        seed=seed,
        output=output,
        video=video,
        progress=True,
    )
    finish(results, output, settings=values, as_json=as_json, verbose=verbose)
