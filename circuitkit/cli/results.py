"""The table that `simulate` and `compare` print: one line a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from circuitkit.cli.printing import print_table


def print_results(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print verdicts.

    Args:
        rows: With the keys of the command line's JSON: "scenario", "controller", "seed", "push", "survived",
            "time_of_fall_s", "max_zmp_excursion_m", "recovery_time_s".
    """
    print_table(
        ", ".join(dict.fromkeys(str(row["scenario"]) for row in rows)),
        ("controller", ">seed", "push", "verdict", ">largest ZMP excursion", ">back inside after"),
        (
            (
                str(row["controller"]),
                str(row["seed"]),
                _push(row["push"]),
                "stood" if row["survived"] else f"fell at {row['time_of_fall_s']:.2f} s",
                _scaled(row["max_zmp_excursion_m"], 1e3, "mm"),
                _scaled(row["recovery_time_s"], 1.0, "s"),
            )
            for row in rows
        ),
    )


def _push(push: Mapping[str, Any] | None) -> str:
    if push is None:
        return "none"
    return f"{push['force_n']:g} N, {push['duration_s'] * 1e3:g} ms, {push['direction']}"


def _scaled(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None or math.isnan(value) else f"{value * factor:.3g} {unit}"
