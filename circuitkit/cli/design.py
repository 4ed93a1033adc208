"""`circuitkit design`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from circuitkit.base.errors import InputError, Problem, UnitError
from circuitkit.base.units import parse_quantity, parse_unit
from circuitkit.cli.printing import examples, note, print_json

_OF_A_PUSH = 2  # of force, duration and w; eq. 21 gives the third
PLACE = 51


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog=examples(
            "circuitkit design --force 20N --duration 200ms",
            "circuitkit design --w 0.5deg --duration 200ms --json",
            "circuitkit design --force 20N --duration 200ms --robot nao --gait gait_march",
            "circuitkit design --force 60N --duration 0.1s --mass 30kg --com-height 60cm --edge 9cm -o w.svg",
        )
    )(design)


def _quantity(name: str, text: str) -> typer.models.OptionInfo:
    return typer.Option(name, metavar="QUANTITY", help=text)  # type: ignore[no-any-return]


def design(
    *,
    force: Annotated[str | None, _quantity("--force", "Of the push, such as 20N.")] = None,
    duration: Annotated[str | None, _quantity("--duration", "Of the push, such as 200ms.")] = None,
    weight: Annotated[
        str | None,
        _quantity("--w", "Ankle roll that is added in a step, such as 1.63deg, for what it can hold."),
    ] = None,
    gamma: Annotated[str | None, _quantity("--gamma", "Safety factor of eq. 19; by default 1.01.")] = None,
    step: Annotated[
        str | None, _quantity("--step", "Time between two steps of the circuit; by default 10ms.")
    ] = None,
    leak: Annotated[
        str | None, _quantity("--leak", "Part of the angle that is lost in a step; by default none.")
    ] = None,
    mass: Annotated[str | None, _quantity("--mass", "Of the robot; by default 5.18kg.")] = None,
    com_height: Annotated[
        str | None, _quantity("--com-height", "Of the centre of mass; by default 270mm.")
    ] = None,
    edge: Annotated[
        str | None,
        _quantity("--edge", "From the CoM (the DCM, if it moves) to the support's edge; by default 120mm."),
    ] = None,
    ankle_limit: Annotated[
        str | None, _quantity("--ankle-limit", "How far the ankle turns; by default 22deg.")
    ] = None,
    push_height: Annotated[
        str | None,
        _quantity(
            "--push-height", "Where it acts, above the floor; by default at the CoM, of a robot on the torso."
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option("--robot", metavar="NAME", help="Take all this from a robot, such as nao, that walks."),
    ] = None,
    gait: Annotated[
        str | None,
        typer.Option("--gait", metavar="NAME", help="How the robot walks; by default gait_march."),
    ] = None,
    moment: Annotated[
        str | None,
        _quantity("--at", "When the robot is pushed, in parts of single support; by default 20%."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="OUT", help="Also draw it: .png, .svg or .pdf.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON.")] = False,
) -> None:
    """Work out the weight w of a stabiliser for a push, and what can be held at all.

    Give two of --force, --duration and --w; eq. 21 of the paper gives the third. Beside it stand the largest
    force that lasts (eq. 22), the largest for this duration (bound of the DCM), and where the equations are
    valid. Without other numbers the robot is the paper's.
    """
    if robot is None and (gait is not None or moment is not None):
        message = "--gait and --at go with --robot"
        raise typer.BadParameter(message)
    pair = {"--force": force, "--duration": duration, "--w": weight}
    given = [option for option, text in pair.items() if text is not None]
    if len(given) != _OF_A_PUSH:
        message = f"found {', '.join(given) or 'none of them'}; allowed: two of {', '.join(pair)}"
        raise typer.BadParameter(message)
    from circuitkit.cli._designing import (  # late: see cli/__init__.py
        body_and_reaches,
        changed,
        print_sheet,
        sheet_data,
    )
    from circuitkit.paper.design_sheet import Reach, make_sheet  # the same

    if output is not None:
        from circuitkit.draw.style import PICTURES, require_suffix  # late even here: only for pictures

        require_suffix(output, PICTURES)
    body, reaches = body_and_reaches(robot, gait, _read("--at", moment, "1", "20 %", zero=True, most="100 %"))
    body = changed(
        body,
        mass_kg=_read("--mass", mass, "kg", "5.18 kg"),
        com_height_m=_read("--com-height", com_height, "m", "270 mm"),
        ankle_limit_rad=_read("--ankle-limit", ankle_limit, "rad", "22 deg"),
    )
    distance = _read("--edge", edge, "m", "120 mm")
    with _naming(force, duration):
        sheet = make_sheet(
            body,
            reaches if distance is None else (Reach("", distance),),
            force_n=_read("--force", force, "N", "20 N"),
            duration_s=_read("--duration", duration, "s", "200 ms"),
            weight_rad=_read("--w", weight, "rad", "1.63 deg", most="90 deg"),
            gamma=_read("--gamma", gamma, "1", "1.01"),
            step_s=_read("--step", step, "s", "10 ms"),
            leak=_read("--leak", leak, "1", "5 %", zero=True, most="100 %"),
            push_height_m=_read("--push-height", push_height, "m", "368 mm"),
        )
    if output is not None:
        from circuitkit.paper.design_figure import draw_design  # the same

        draw_design(sheet, output)
    if as_json:
        print_json(sheet_data(sheet))
    else:
        print_sheet(sheet)
    if output is not None:
        note(f"wrote {output}")


def _read(
    option: str, text: str | None, unit: str, example: str, *, zero: bool = False, most: str = ""
) -> float | None:
    """A quantity of an option in SI units; None if it is not given.

    Args:
        option: Its name, for messages.
        text: What was given.
        unit: Of the dimension that it must have.
        example: What is right, for messages.
        zero: Whether 0 is allowed; negative numbers are not.
        most: The largest that is allowed; empty if there is none.

    Raises:
        InputError: It cannot be read, has the wrong dimension, or is too small or too large.
    """
    if text is None:
        return None
    try:
        quantity = parse_quantity(text)
    except UnitError as error:
        raise InputError(Problem("", 0, 0, option, str(error))) from error
    allowed = f"allowed: a quantity such as '{example}'"
    if quantity.dimension != parse_unit(unit).dimension:
        message = f"found '{text}', which is {quantity.dimension}; {allowed}"
        raise InputError(Problem("", 0, 0, option, message))
    if not (quantity.value_si > 0 or (zero and quantity.value_si == 0)):
        least = "0 or more" if zero else "more than 0"
        raise InputError(Problem("", 0, 0, option, f"found '{text}'; allowed: {least}, such as '{example}'"))
    if most and quantity.value_si > parse_quantity(most).value_si:
        raise InputError(Problem("", 0, 0, option, f"found '{text}'; allowed: up to {most}"))
    return quantity.value_si


@contextmanager
def _naming(force: str | None, duration: str | None) -> Iterator[None]:
    """Say of a push that no angle holds which option asks for it, not which part of the equations."""
    try:
        yield
    except InputError as error:
        (problem, *others) = error.problems
        if others or force is None or problem.where != "com_shift_m":
            raise
        message = f"found '{force}' for {duration}, too strong for any w: {problem.message}"
        raise InputError(Problem("", 0, 0, "--force", message)) from error
