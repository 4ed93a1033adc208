"""The objective: a weighted sum of figures of runs, worked out from the rows of a results table."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from circuitkit.base.errors import CircuitkitError, UnknownNameError
from circuitkit.base.source import FileModel
from circuitkit.base.source.fields import AnyQuantity
from circuitkit.base.units import parse_quantity, parse_unit
from circuitkit.simulation.measures import INVALID
from circuitkit.study.results import Row
from circuitkit.study.tuning.runs import Condition

LIMIT = "limit"  # the figure that is no column


class FigureError(CircuitkitError):
    """A figure cannot be taken of these runs."""


class Term(FileModel):
    """A figure of some runs and its weight.

    The term is weight · max(0, statistic of the column over the runs − beyond), in `unit`. The figure `limit`
    is the mean over the cells (combinations of the axes) of the largest factor of the scale up to which a
    condition holds in all runs.
    """

    model_config = ConfigDict(populate_by_name=True)

    figure: str = Field(
        description="A column of the results: a measure of the scenario, or rms_COMMAND; or limit."
    )
    expression: str | None = Field(
        default=None,
        alias="is",
        description="An expression over channels and time, if the scenario has no such measure.",
    )
    condition: str = Field(
        default="survived", alias="while", description="Of limit: the measure that must be true of a run."
    )
    runs: str | None = Field(default=None, description="Which set of runs; needed if there are several.")
    weight: float = Field(default=1.0, description="Of the figure in its unit.")
    statistic: Literal["mean", "median", "min", "max", "rms"] = "mean"
    unit: str | None = Field(default=None, description="In which the figure counts; SI if absent.")
    otherwise: AnyQuantity | None = Field(
        default=None, description="What counts for runs without this figure, as those without a recovery."
    )
    beyond: AnyQuantity | None = Field(
        default=None, description="Only what is above this counts, so that less is no better."
    )

    @model_validator(mode="after")
    def _units_fit(self) -> Term:
        unit = parse_unit(self.unit or "1")
        for key in ("otherwise", "beyond"):
            text = getattr(self, key)
            if text is not None and self.unit and parse_quantity(text).dimension != unit.dimension:
                message = f"found {key} {text}; allowed: a quantity in a unit like {self.unit}"
                raise ValueError(message)
        return self

    @property
    def scale(self) -> float:
        """SI value of one unit."""
        return parse_unit(self.unit).scale if self.unit else 1.0

    @property
    def name(self) -> str:
        """The figure in words, for tables: `rms_ankle_roll of calm [deg]`."""
        statistic = "" if self.statistic == "mean" else f"{self.statistic} of "
        return f"{statistic}{self.figure}{f' of {self.runs}' if self.runs else ''}"

    def figure_of(self, conditions: Sequence[Condition], rows: Sequence[Sequence[Row]]) -> float:
        """The figure in its unit, without weight.

        Args:
            conditions: The conditions of the set of runs.
            rows: For each of them the rows of its seeds.

        Raises:
            UnknownNameError: The results have no such column.
            FigureError: A run lacks the figure, and `otherwise` does not say what counts for it.
        """
        if self.figure == LIMIT:
            return limit(conditions, rows, self.condition)
        values = [self._value(row) for each in rows for row in each]
        return float(_STATISTICS[self.statistic](np.array(values))) / self.scale

    def _value(self, row: Row) -> float:
        if self.figure not in row:
            kind = "figure"
            raise UnknownNameError(kind, self.figure, (LIMIT, *columns(row)))
        value = row[self.figure]
        if value is None or (isinstance(value, float) and math.isnan(value)):
            if self.otherwise is None:
                message = (
                    f"a run has no {self.figure}; say what counts for it with 'otherwise', such as "
                    f"{{figure: {self.figure}, otherwise: 10}}"
                )
                raise FigureError(message)
            return parse_quantity(self.otherwise).value_si
        return float(value)

    def part(self, figure: float) -> float:
        """What a figure adds to the objective."""
        beyond = 0.0 if self.beyond is None else parse_quantity(self.beyond).value_si / self.scale
        return self.weight * (figure if self.beyond is None else max(0.0, figure - beyond))


_STATISTICS: Mapping[str, Callable[[NDArray[np.float64]], Any]] = {
    "mean": np.mean,
    "median": np.median,
    "min": np.min,
    "max": np.max,
    "rms": lambda values: np.sqrt(np.mean(values**2)),
}


def columns(row: Row) -> list[str]:
    """The columns of a row that hold numbers, or nothing, and say something of the run."""
    return [
        name
        for name, value in row.items()
        if name not in {"seed", INVALID} and (value is None or isinstance(value, bool | int | float))
    ]


def limit(conditions: Sequence[Condition], rows: Sequence[Sequence[Row]], measure: str = "survived") -> float:
    """Mean over the cells of the largest factor up to which a measure holds in all runs; 0 if in none.

    Raises:
        FigureError: Nobody knows of a run whether it holds.
    """
    largest: dict[tuple[tuple[str, str], ...], float] = {}
    over: set[tuple[tuple[str, str], ...]] = set()
    for condition, each in zip(conditions, rows, strict=True):
        largest.setdefault(condition.cell_key, 0.0)
        if any(row[measure] is None for row in each):
            message = f"a run has no value for '{measure}', so that nobody knows whether it holds"
            raise FigureError(message)
        if condition.cell_key not in over and all(row[measure] for row in each):
            largest[condition.cell_key] = condition.factor
        else:
            over.add(condition.cell_key)
    return float(np.mean(list(largest.values())))


@dataclass(frozen=True)
class Score:
    """How good a candidate is.

    Attributes:
        value: The objective.
        figures: The figures of its terms, in their units.
        runs: How many runs it was taken of.
    """

    value: float
    figures: tuple[float, ...]
    runs: int


def score(
    terms: Sequence[Term],
    conditions: Mapping[str, Sequence[Condition]],
    rows: Mapping[str, Sequence[Sequence[Row]]],
) -> Score:
    """The objective of a candidate.

    Args:
        terms: Its terms.
        conditions: The conditions by the name of their set of runs.
        rows: The rows by set, condition and seed.

    Raises:
        UnknownNameError: The results have no such column.
        FigureError: A run lacks a figure, or is invalid: what it would have been, nobody knows.
    """
    every = (row for sets in rows.values() for each in sets for row in each)
    if (bad := next((row for row in every if row.get(INVALID) is not None), None)) is not None:
        message = f"the run with seed {bad['seed']} is invalid {bad[INVALID]}"
        raise FigureError(message)
    names = list(conditions)
    sets = [term.runs or names[0] for term in terms]
    figures = tuple(
        term.figure_of(conditions[name], rows[name]) for term, name in zip(terms, sets, strict=True)
    )
    value = sum(term.part(figure) for term, figure in zip(terms, figures, strict=True))
    return Score(value, figures, sum(len(each) for sets_ in rows.values() for each in sets_))
