"""`circuitkit run --realtime`: a circuit at a fixed rate, and how well the machine keeps it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from circuitkit.base.errors import SimulationError
from circuitkit.cli.printing import note, print_json, print_table
from circuitkit.engine import compile_circuit
from circuitkit.engine.realtime import RealtimeReport, realtime
from circuitkit.engine.scheduling import HOW_TO_ALLOW
from circuitkit.engine.table import given_inputs

if TYPE_CHECKING:
    from circuitkit.circuit import CircuitGraph
    from circuitkit.engine.program import Precision

_LONG_S = 1e-3
_LIMIT = re.compile(r"([0-9]+)|([0-9]+\.?[0-9]*|\.[0-9]+)\s*%")


@dataclass(frozen=True)
class Limit:
    """How many deadlines may be missed.

    Attributes:
        text: As it was given, such as `3` or `1%`.
        count: A number of ticks; infinite if it is a share.
        share: A share of all ticks; infinite if it is a number.
    """

    text: str
    count: float = math.inf
    share: float = math.inf

    @classmethod
    def read(cls, text: str) -> Limit:
        """Read `3` or `1%`.

        Raises:
            typer.BadParameter: It is neither.
        """
        match = _LIMIT.fullmatch(text.strip())
        if match is None or (match[2] and float(match[2]) > 100):  # noqa: PLR2004 - per cent
            message = f"found '{text}'; allowed: a number of ticks such as 3, or a share such as 1%"
            raise typer.BadParameter(message, param_hint="'--max-missed'")
        if match[1]:
            return cls(text, count=int(match[1]))
        return cls(text, share=float(match[2]) / 100)

    def is_kept(self, report: RealtimeReport) -> bool:
        """Whether a run missed no more."""
        return report.missed <= min(self.count, self.share * report.ticks)


def run_realtime(
    graph: CircuitGraph,
    seconds: float,
    rate_hz: float | None,
    values: Mapping[str, str],
    table: Path | None,
    *,
    limit: Limit,
    priority: int | None,
    backend: str,
    precision: Precision,
    verbose: bool,
    as_json: bool,
) -> None:
    """Run a circuit for some time, by default at the rate of its control step; print what was measured.

    Raises:
        SimulationError: More deadlines were missed than may be.
    """
    inputs, _ = given_inputs(graph, values, table, None if table else 1)
    program = compile_circuit(graph, backend, precision)
    rate = 1.0 / graph.step_s if rate_hz is None else rate_hz
    report = realtime(program, rate, seconds, inputs, priority)
    for refusal in report.scheduling.refusals:
        note(f"not granted: {refusal}; {HOW_TO_ALLOW}")
    if verbose:
        note(program.note or f"backend {program.backend}")
    if as_json:
        print_json(asdict(report))
    else:
        _print(report)
    if not limit.is_kept(report):
        message = (
            f"missed {report.missed} of {report.ticks} deadlines; allowed: {limit.text} (--max-missed); "
            "fewer by a lower --rate, a quieter machine or --priority"
        )
        raise SimulationError(message)


def _print(report: RealtimeReport) -> None:
    share = f" ({100 * report.missed / report.ticks:.2g} %)" if report.missed else ""
    print(f"{report.name}, backend {report.backend}: {report.ticks} ticks at {report.rate_hz:g} Hz")
    skipped = f", of which {report.skipped} were left out" if report.skipped else ""
    print(f"missed deadlines: {report.missed}{share}{skipped}")
    if report.scheduling.priority is not None:
        locked = "locked" if report.scheduling.is_locked else "not locked"
        print(f"SCHED_FIFO with priority {report.scheduling.priority}, memory {locked}")
    print()
    rows = [
        (f"p{percentile:g}", _duration(late), _duration(report.duration_s[percentile]))
        for percentile, late in report.lateness_s.items()
    ]
    rows.append(("largest", _duration(report.most_late_s), _duration(report.longest_s)))
    print_table("", ("ticks", ">begun late by", ">step took"), rows)


def _duration(seconds: float) -> str:
    return f"{seconds * 1e3:.3g} ms" if seconds >= _LONG_S else f"{seconds * 1e6:.3g} µs"
