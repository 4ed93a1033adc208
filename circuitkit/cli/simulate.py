"""`circuitkit simulate`."""

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
            "circuitkit simulate nao_push",
            "circuitkit simulate nao_push --controller open_loop --seed 3 -o out/open_loop",
            "circuitkit simulate nao_push --circuit my_circuit.yaml --push 20N,200ms,inward",
            "circuitkit simulate nao_push -o out/film --video",
        )
    )(simulate)


def simulate(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A scenario file, or the name of a shipped one.")
    ],
    *,
    circuit: Annotated[
        str | None,
        typer.Option(
            "--circuit", metavar="FILE", help="Control with this circuit, a file or a shipped name."
        ),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option("--controller", metavar="NAME", help="Control with this controller, such as open_loop."),
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
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the recording and the plots."),
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="Also film the robot; needs -o.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Watch in a window while it runs.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdict as JSON.")] = False,
) -> None:
    """Run a robot in closed loop with a controller.

    Prints whether it stood, how far the ZMP went, and when it was back inside.

    Missing folders of DIR are made.
    """
    if circuit is not None and controller is not None:
        message = "give --circuit or --controller, not both"
        raise typer.BadParameter(message)
    if video and output is None:
        message = "--video needs a folder to write to: -o DIR"
        raise typer.BadParameter(message)

    from circuitkit.simulate import simulate as run_simulation

    result = run_simulation(
        scenario,
        controller=controller,
        circuit=circuit,
        push=push,
        seed=seed,
        output=output,
        video=video,
        view=view,
        progress=True,
    )
    finish([result.row()], output, as_json=as_json)
