"""`circuitkit compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circuitkit.cli.printing import examples
from circuitkit.cli.results import finish


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit compare nao_push --controllers open_loop,circuit",
            "circuitkit compare nao_push --controllers open_loop,circuit --push 20N,200ms,outward --seed 1",
            "circuitkit compare nao_push --controllers open_loop,circuit -o out/compare --json",
        )
    )(compare)


def compare(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A scenario file, or the name of a shipped one.")
    ],
    *,
    controllers: Annotated[
        str, typer.Option("--controllers", metavar="NAME,NAME...", help="Controllers, separated by commas.")
    ],
    circuit: Annotated[
        str | None,
        typer.Option("--circuit", metavar="FILE", help="The circuit of the controller named circuit."),
    ] = None,
    push: Annotated[
        str | None,
        typer.Option(
            "--push", metavar="FORCE,DURATION,DIRECTION", help="Push so instead, such as 20N,200ms,inward."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", metavar="N", min=0, help="Of the noise and of the push's jitter.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the recordings and the plots."),
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="Also film the robot; needs -o.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
) -> None:
    """Run a scenario under several controllers.

    Prints one line each: whether it stood, how far the ZMP went, and when it was back inside.

    Missing folders of DIR are made.
    """
    names = [name.strip() for name in controllers.split(",") if name.strip()]
    if not names:
        message = "name at least one controller, such as open_loop,circuit"
        raise typer.BadParameter(message, param_hint="--controllers")
    if video and output is None:
        message = "--video needs a folder to write to: -o DIR"
        raise typer.BadParameter(message)

    from circuitkit.simulate import compare as run_comparison

    results = run_comparison(
        scenario,
        names,
        circuit=circuit,
        push=push,
        seed=seed,
        output=output,
        video=video,
        progress=True,
    )
    finish([result.row() for result in results], output, as_json=as_json)
