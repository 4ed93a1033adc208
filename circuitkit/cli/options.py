"""Arguments and options that several commands have, in the same words, and how they are read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

import circuitkit

if TYPE_CHECKING:
    from circuitkit.circuit import CircuitGraph


def names_of_files(folder: str, ending: str) -> str:
    """What files of the package are called, for the help, without importing what reads them.

    Args:
        folder: Where in the package they lie.
        ending: Of their names, which is left out.
    """
    paths = (Path(circuitkit.__file__).parent / folder).glob(f"*{ending}")
    *most, last = sorted(path.name.removesuffix(ending) for path in paths)
    return f"{', '.join(most)} or {last}"


CircuitFile: TypeAlias = Annotated[
    str, typer.Argument(metavar="FILE", help="A circuit file, or the name of a shipped circuit.")
]
Scenario: TypeAlias = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A scenario file, or the name of a shipped one.")
]
Settings: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Change a value of the circuit, such as w=2deg or q1.slope=50/m; once for each.",
    ),
]
Backend: TypeAlias = Annotated[
    str,
    typer.Option(
        "--backend",
        metavar="NAME",
        help=f"auto, {names_of_files('engine/backends', '_backend.py')}; auto takes the fastest.",
    ),
]
Verbose: TypeAlias = Annotated[
    bool, typer.Option("--verbose", help="Also say which backend ran it, and why.")
]
LAST_SEED = 2**63 - 1  # what tables of results can hold
SETTINGS = ("--set", "w=2deg")  # for `named_values`
CONTROLLERS = "open_loop, circuit, a controller file, or a shipped one of `circuitkit list controllers`"
Push: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--push",
        metavar="FORCE,DURATION,DIRECTION",
        help="Push so instead of as the scenario says, such as 20N,200ms,left.",
    ),
]
Circuit: TypeAlias = Annotated[
    str | None,
    typer.Option("--circuit", metavar="FILE", help="Control with this circuit, a file or a shipped name."),
]
Robot: TypeAlias = Annotated[
    str | None,
    typer.Option("--robot", metavar="FILE", help="Take this robot, a file or a shipped name."),
]
Seed: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--seed", metavar="N", min=0, max=LAST_SEED, help="Of all that is drawn at random: noise, jitter."
    ),
]
Timeout: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        metavar="SECONDS",
        min=1.0,
        help="After so long a batch's worker counts as stuck; by default by what others took, at least 60.",
    ),
]
Folder: TypeAlias = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Folder for the recordings and the plots."),
]
Video: TypeAlias = Annotated[bool, typer.Option("--video", help="Also film the robot; needs -o.")]
Verdicts: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print outcome and measures as JSON, in SI units.")
]


def named_values(texts: list[str] | None, option: str, example: str) -> dict[str, str]:
    """The values of an option that is given once for each name.

    Args:
        texts: As given, each NAME=VALUE.
        option: Name of the option, for messages.
        example: What is right, for messages.

    Raises:
        typer.BadParameter: A text is of another form, or a name is given twice.
    """
    named: dict[str, str] = {}
    for text in texts or []:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (equals and name and value):
            message = f"found '{text}'; allowed: NAME=VALUE, such as {example}"
            raise typer.BadParameter(message, param_hint=option)
        if name in named:
            message = f"'{name}' is given twice"
            raise typer.BadParameter(message, param_hint=option)
        named[name] = value
    return named


def require_folder(folder: Path | None, *, video: bool) -> None:
    """Refuse a video that has nowhere to go.

    Raises:
        typer.BadParameter: There is no folder.
    """
    if video and folder is None:
        message = "--video needs a folder to write to: -o DIR"
        raise typer.BadParameter(message)


def read_graph(file: str, settings: list[str] | None) -> CircuitGraph:
    """The circuit of a file, with the values of `--set`.

    Raises:
        typer.BadParameter: `--set` is not of the form NAME=VALUE.
        InputError: The file is wrong, or what `--set` makes of it; the message then names the option.
    """
    from circuitkit.circuit import load_circuit  # late: see cli/__init__.py

    return load_circuit(file, named_values(settings, *SETTINGS), option="--set")
