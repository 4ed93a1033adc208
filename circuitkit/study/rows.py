"""Rows: what a table of results says of each run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import circuitkit
from circuitkit.base.errors import CircuitkitError
from circuitkit.base.units import parse_quantity
from circuitkit.study.cases import Case
from circuitkit.study.jobs import Outcome
from circuitkit.study.spec import RESERVED, RMS, Study

Row: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True)
class Run:
    """One run of a cell, done.

    Attributes:
        cell: Number of the cell.
        index: Number of the searched value on its grid; 0 without search.
        case: What was run.
        outcome: What became of it.
    """

    cell: int
    index: int
    case: Case
    outcome: Outcome


def measures_in(study: Study, rows: Iterable[Row]) -> list[str]:
    """The columns of measures in the scenario's order, and then those of commands in alphabetical order."""
    searched = () if study.search is None else (study.search.field,)
    others = {*study.axes, *searched, *RESERVED}
    names = dict.fromkeys(name for row in rows for name in row if name not in others)
    return [*(n for n in names if not n.startswith(RMS)), *sorted(n for n in names if n.startswith(RMS))]


def rows_of(study: Study, runs: Iterable[Run]) -> tuple[Row, ...]:
    """The rows of runs, in the order of the cells, searched values and seeds."""
    ordered = sorted(runs, key=lambda run: (run.cell, run.index, run.outcome.seed))
    return tuple(row_of(study, run) for run in ordered)


def row_of(study: Study, run: Run) -> dict[str, Any]:
    """The row of a run.

    Raises:
        CircuitkitError: An axis has the name of a measure.
    """
    seed, search = run.outcome.seed, study.search
    row: dict[str, Any] = dict(study.cells[run.cell].labels)
    if search is not None:
        row[search.field] = parse_quantity(search.value(run.index)).value_si
    if clash := row.keys() & run.outcome.row().keys():
        message = f"found an axis '{min(clash)}', which is a measure of the scenario; allowed: another name"
        raise CircuitkitError(message)
    return (
        row
        | run.outcome.row()
        | {
            "scenario": run.case.description(seed),
            "version": circuitkit.__version__,
            "key": run.case.run_key(seed),
        }
    )
