"""`circuitkit simulate`."""

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

PLACE = 30


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit simulate vehicle_avoids",
            "circuitkit simulate arm_reflex --controller open_loop --seed 3 -o out/open_loop",
            "circuitkit simulate nao_push --controller mpc --push 20N,200ms,outward",
            "circuitkit simulate nao_push --circuit my_circuit.yaml --set w=1deg --json",
            "circuitkit simulate vehicle_avoids --robot my_robot.yaml",
            "circuitkit simulate quadruped_trots -o out/film --video",
        )
    )(simulate)


def simulate(
    scenario: Scenario,
    *,
    robot: Robot = None,
    circuit: Circuit = None,
    settings: Settings = None,
    controller: Annotated[
        str | None,
        typer.Option("--controller", metavar="NAME", help=f"Control with it: {CONTROLLERS}."),
    ] = None,
    push: Push = None,
    seed: Seed = None,
    backend: Backend = "auto",
    output: Folder = None,
    video: Video = False,
    view: Annotated[bool, typer.Option("--view", help="Then watch the run in a window.")] = False,
    verbose: Verbose = False,
    as_json: Verdicts = False,
) -> None:
    """Run a robot in closed loop with a controller.

    Prints how it ended, and every measure of the scenario in its unit.

    With -o DIR, writes the recording (recording.nc and .csv) and plots. Missing folders of DIR are made.
    """
    if circuit is not None and controller is not None:
        message = "give --circuit or --controller, not both"
        raise typer.BadParameter(message)
    require_folder(output, video=video)
    values = named_values(settings, *SETTINGS)

    from circuitkit.simulation import simulate as run_simulation  # late: see cli/__init__.py

    result = run_simulation(
        scenario,
        controller=controller,
        robot=robot,
        circuit=circuit,
        settings=values,
        backend=backend,
        push=push,
        seed=seed,
        output=output,
        video=video,
        view=view,
        progress=True,
    )
    finish([result], output, settings=values, as_json=as_json, verbose=verbose)
