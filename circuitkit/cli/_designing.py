"""How `circuitkit design` takes numbers from a robot, and prints the sheet."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from textwrap import fill
from typing import Any

from circuitkit.base.errors import InputError, Problem, UnknownNameError, listing, suggest
from circuitkit.cli.printing import print_table
from circuitkit.paper.design_sheet import PAPER_BODY, PAPER_REACH, Body, Bound, Reach, Sheet, show

_TEXT_WIDTH = 110  # of the notes below the tables


def body_and_reaches(
    name: str | None, gait: str | None, moment: float | None
) -> tuple[Body, tuple[Reach, ...]]:
    """The robot of a file while it walks, or the paper's."""
    if name is None:
        return PAPER_BODY, (PAPER_REACH,)
    from circuitkit.paper.design import (  # MuJoCo, for robots only
        PUSHED_AT,
        robot_and_reaches,
        shipped_bipeds,
    )

    try:
        return robot_and_reaches(name, gait or "gait_march", PUSHED_AT if moment is None else moment)
    except UnknownNameError as error:
        names = shipped_bipeds()
        message = f"unknown robot '{name}'; allowed: {listing(names)}, or the path of a robot.yaml"
        raise InputError(Problem("", 0, 0, "--robot", message, suggest(name, names))) from error


def changed(body: Body, **values: float | None) -> Body:
    """The robot with those values that were given."""
    given: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
    return replace(body, name=f"{body.name}, changed", **given) if given else body


def print_sheet(sheet: Sheet) -> None:
    """The tables for a person, the traps, and what to write into the circuit file."""
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


def sheet_data(sheet: Sheet) -> dict[str, object]:
    """The sheet with plain keys; what lasts for ever is null."""
    content = asdict(sheet)
    bounds = [{"direction": b.reach.direction, "distance_m": b.reach.distance_m} for b in sheet.bounds]
    for row, whole in zip(bounds, content.pop("bounds"), strict=True):
        row.update({key: value for key, value in whole.items() if key != "reach"})
    return {"weight_deg": math.degrees(sheet.weight_rad), **content, "bounds": bounds, "set": sheet.setting}
