"""`circuitkit run --realtime`: a circuit at a fixed rate, and how well the machine keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit.cli.printing import note, print_json, print_table
from circuitkit.engine import compile_circuit
from circuitkit.engine.realtime import RealtimeReport, realtime
from circuitkit.engine.table import given_inputs

if TYPE_CHECKING:
    from circuitkit.circuit import CircuitGraph
    from circuitkit.engine.program import Precision

_LONG_S = 1e-3


def run_realtime(
    graph: CircuitGraph,
    seconds: float,
    rate_hz: float | None,
    values: Mapping[str, str],
    table: Path | None,
    *,
    backend: str,
    precision: Precision,
    verbose: bool,
    as_json: bool,
) -> None:
    """Run a circuit for some time, by default at the rate of its control step; print what was measured."""
    inputs, _ = given_inputs(graph, values, table, None if table else 1)
    program = compile_circuit(graph, backend, precision)
    report = realtime(program, 1.0 / graph.step_s if rate_hz is None else rate_hz, seconds, inputs)
    if verbose:
        note(program.note or f"backend {program.backend}")
    if as_json:
        print_json(asdict(report))
    else:
        _print(report)


def _print(report: RealtimeReport) -> None:
    share = f" ({100 * report.missed / report.ticks:.2g} %)" if report.missed else ""
    print(f"{report.name}, backend {report.backend}: {report.ticks} ticks at {report.rate_hz:g} Hz")
    print(f"missed deadlines: {report.missed}{share}\n")
    rows = [
        (f"p{percentile:g}", _duration(late), _duration(report.duration_s[percentile]))
        for percentile, late in report.lateness_s.items()
    ]
    rows.append(("largest", _duration(report.most_late_s), _duration(report.longest_s)))
    print_table("", ("ticks", ">begun late by", ">step took"), rows)


def _duration(seconds: float) -> str:
    return f"{seconds * 1e3:.3g} ms" if seconds >= _LONG_S else f"{seconds * 1e6:.3g} µs"
