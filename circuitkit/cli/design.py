"""`circuitkit design`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import typer

from circuitkit.cli.printing import examples, note, print_json, print_table

if TYPE_CHECKING:
    from circuitkit.paper.design_sheet import Body, Bound, Reach, Sheet

_OF_A_PUSH = 2  # of force, duration and w; eq. 21 gives the third
_TEXT_WIDTH = 110  # of the notes below the tables

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
    from circuitkit.paper.design_sheet import Reach, make_sheet  # here, for the start-up: see app.py

    if output is not None:
        from circuitkit.draw.style import PICTURES, require_suffix

        require_suffix(output, PICTURES)
    body, reaches = _robot(robot, gait, _read("--at", moment, "1", "20 %", zero=True, most="100 %"))
    body = _changed(
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
        from circuitkit.paper.design_figure import draw_design

        draw_design(sheet, output)
    if as_json:
        print_json(_for_json(sheet))
    else:
        _print(sheet)
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
    from circuitkit.base.errors import InputError, Problem, UnitError
    from circuitkit.base.units import parse_quantity, parse_unit

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
    from circuitkit.base.errors import InputError, Problem

    try:
        yield
    except InputError as error:
        (problem, *others) = error.problems
        if others or force is None or problem.where != "com_shift_m":
            raise
        message = f"found '{force}' for {duration}, too strong for any w: {problem.message}"
        raise InputError(Problem("", 0, 0, "--force", message)) from error


def _robot(name: str | None, gait: str | None, moment: float | None) -> tuple[Body, tuple[Reach, ...]]:
    """The robot of a file while it walks, or the paper's."""
    from circuitkit.paper.design_sheet import PAPER_BODY, PAPER_REACH

    if name is None:
        return PAPER_BODY, (PAPER_REACH,)
    from circuitkit.base.errors import InputError, Problem, UnknownNameError, listing, suggest
    from circuitkit.paper.design import PUSHED_AT, robot_and_reaches, shipped_bipeds

    try:
        return robot_and_reaches(name, gait or "gait_march", PUSHED_AT if moment is None else moment)
    except UnknownNameError as error:
        names = shipped_bipeds()
        message = f"unknown robot '{name}'; allowed: {listing(names)}, or the path of a robot.yaml"
        raise InputError(Problem("", 0, 0, "--robot", message, suggest(name, names))) from error


def _changed(body: Body, **values: float | None) -> Body:
    """The robot with those values that were given."""
    given: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    return replace(body, name=f"{body.name}, changed", **given) if given else body


def _print(sheet: Sheet) -> None:
    """The tables for a person, the traps, and what to write into the circuit file."""
    from circuitkit.paper.design_sheet import show

    body = sheet.body
    robot = f"{show(body.mass_kg, 'kg')}, CoM at {show(body.com_height_m, 'm')}"
    push = f"{show(sheet.force_n, 'N')} for {show(sheet.duration_s, 's')}"
    rows = [
        ("speed that the CoM must get", f"{sheet.com_velocity:.4g} m/s", f"eq. 19, γ {sheet.gamma:g}"),
        (f"shift of the CoM in a step of {show(sheet.step_s, 's')}", show(sheet.com_shift_m, "m"), "eq. 20"),
        ("w, ankle roll in a step", show(sheet.weight_rad, "rad"), "eq. 21"),
    ]
    if body.lever_m is not None:
        value = "-" if sheet.weight_by_lever_rad is None else show(sheet.weight_by_lever_rad, "rad")
        rows.append(("the same by the measured lever", value, f"eq. 21, {show(body.lever_m, 'm')} for z_CoM"))
    print_table(f"{push} on {body.name} ({robot})", ("what", ">value", "by"), rows)
    print_table(
        f"what these feet can hold, pushed {show(sheet.push_height_m, 'm')} above the floor",
        ("push", ">room", ">for ever (eq. 22)", f">for {show(sheet.duration_s, 's')} (DCM bound)",
         ">the same at the CoM", f">{show(sheet.force_n, 'N')} at most", "this push is"),
        (_bound_row(bound) for bound in sheet.bounds),
    )  # fmt: skip
    print_table(
        "where eq. 21 is valid",
        ("condition", ">allowed", ">found", ""),
        ((check.name, check.allowed, check.found, "ok" if check.met else "beyond") for check in sheet.checks),
    )
    print("keep in mind")
    for trap in sheet.traps:
        print(fill(trap, _TEXT_WIDTH, initial_indent="  - ", subsequent_indent="    "))
    name, _, value = sheet.setting.partition("=")
    print("\nin the circuit file")
    print(f"  parameters:\n    {name}: {value.removesuffix('deg')} deg")
    print(f"  circuitkit diff binn_lateral binn_lateral --set {sheet.setting}")


def _bound_row(bound: Bound) -> tuple[str, ...]:
    from circuitkit.paper.design_sheet import show

    verdict = "beyond both" if not bound.under_bound else "under both"
    if bound.under_bound and not bound.under_lasting:
        verdict = "held for its duration, not for ever"
    return (
        bound.reach.direction or "towards the edge",
        show(bound.reach.distance_m, "m"),
        show(bound.lasting_force_n, "N"),
        show(bound.force_n, "N"),
        show(bound.force_at_com_n, "N"),
        show(bound.duration_s, "s"),
        verdict,
    )


def _for_json(sheet: Sheet) -> dict[str, object]:
    """The sheet with plain keys; what lasts for ever is null."""
    content = asdict(sheet)
    bounds = [{"direction": b.reach.direction, "distance_m": b.reach.distance_m} for b in sheet.bounds]
    for row, whole in zip(bounds, content.pop("bounds"), strict=True):
        row.update({key: value for key, value in whole.items() if key != "reach"})
    return {"weight_deg": math.degrees(sheet.weight_rad), **content, "bounds": bounds, "set": sheet.setting}
