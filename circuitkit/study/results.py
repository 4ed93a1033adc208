"""Results: one row a run, as a table, and what the rows say: limits with their confidence, or shares."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, TypeAlias

import circuitkit
from circuitkit.base.errors import CircuitkitError, InputError, MissingDependencyError, listing
from circuitkit.base.units import format_quantity, parse_quantity
from circuitkit.simulation.measures import INVALID
from circuitkit.study.cases import Case, Outcome
from circuitkit.study.search import Verdict, boundary, verdict, verdicts_of_one
from circuitkit.study.spec import RESERVED, Cell, Label, Study, is_measure

if TYPE_CHECKING:
    import pyarrow

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
    return [*filter(is_measure, names), *sorted(n for n in names if not is_measure(n))]


def rows_of(study: Study, runs: Iterable[Run]) -> tuple[Row, ...]:
    """The rows of runs, in the order of the cells, searched values and seeds."""
    ordered = sorted(runs, key=lambda run: (run.cell, run.index, run.outcome.seed))
    return tuple(row_of(study, run) for run in ordered)


def row_of(study: Study, run: Run) -> dict[str, Any]:
    """The row of a run.

    Raises:
        InputError: An axis has the name of a measure.
    """
    seed, search = run.outcome.seed, study.search
    row: dict[str, Any] = dict(study.cells[run.cell].labels)
    if search is not None:
        row[search.field] = parse_quantity(search.value(run.index)).value_si
    if clash := row.keys() & run.outcome.row().keys():
        name = min(clash)
        message = f"found an axis '{name}', which is a measure of the scenario; allowed: another name"
        raise InputError(study.document.problem(("axes", name), message, at_key=True))
    return (
        row
        | run.outcome.row()
        | {
            "scenario": run.case.description(seed),
            "version": circuitkit.__version__,
            "key": run.case.run_key(seed),
        }
    )


def outcome_of(study: Study, row: Row) -> Outcome:
    """What became of the run of a row."""
    values = {name: row[name] for name in measures_in(study, [row])}
    return Outcome(int(row["seed"]), values, row.get(INVALID))


def arrow() -> Any:  # noqa: ANN401 - a module that ships no types
    """The module pyarrow.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        import pyarrow  # an extra
        import pyarrow.parquet  # the same
    except ImportError as error:
        package, extra = "pyarrow", "study"
        raise MissingDependencyError(package, extra, "writing the results of a sweep") from error
    return pyarrow


def table_of(study: Study, rows: Sequence[Row]) -> pyarrow.Table:
    """Rows as an Arrow table with the same columns whatever their order.

    Raises:
        MissingDependencyError: pyarrow is not installed.
    """
    pa = arrow()
    fields = [_labelled(pa, study, axis) for axis in study.axes]
    if study.search is not None:
        fields.append(_with_unit(pa.field(study.search.field, pa.float64()), study.search.step))
    fields += [pa.field("seed", pa.int64()), pa.field(INVALID, pa.string())]
    fields += [pa.field(name, _type_of(pa, name, rows)) for name in measures_in(study, rows)]
    fields += [pa.field(name, pa.string()) for name in ("scenario", "version", "key")]
    columns = [pa.array([row.get(field.name) for row in rows], type=field.type) for field in fields]
    return pa.Table.from_arrays(columns, schema=pa.schema(fields))


def _type_of(pa: Any, name: str, rows: Iterable[Row]) -> Any:  # noqa: ANN401 - a module that ships no types
    """Truth values, or numbers."""
    return pa.bool_() if any(isinstance(row.get(name), bool) for row in rows) else pa.float64()


def _labelled(pa: Any, study: Study, axis: str) -> Any:  # noqa: ANN401 - a module that ships no types
    values = study.axes[axis]
    if all(isinstance(value.label, bool) for value in values):
        return pa.field(axis, pa.bool_())
    if all(isinstance(value.label, float) for value in values):
        return _with_unit(pa.field(axis, pa.float64()), values[0].text)
    return pa.field(axis, pa.string())


def _with_unit(field: Any, text: str) -> Any:  # noqa: ANN401 - as above
    return field.with_metadata({"unit": parse_quantity(text).dimension.si_symbol})


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Where the true share of successes lies, by Wilson (1927).

    (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n), with p = successes/n and z the quantile of
    the normal distribution. Unlike p +- z sqrt(p (1 - p)/n) it says something where all runs or none succeed.

    Args:
        successes: How many runs succeeded.
        runs: n, how many there were.
        confidence: How sure to be.

    Returns:
        Lower and upper end; 0 and 1 without runs.
    """
    if runs == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    share, extra = successes / runs, z * z / runs
    middle = share + extra / 2
    half = z * math.sqrt(share * (1 - share) / runs + extra / (4 * runs))
    low, high = (middle - half) / (1 + extra), (middle + half) / (1 + extra)
    return (0.0 if successes == 0 else low), (1.0 if successes == runs else high)


@dataclass(frozen=True)
class Share:
    """In how many runs of a cell a condition held, and the means of all measures.

    Runs of which nobody knows whether it held are counted apart, and are no part of the share.

    Attributes:
        labels: Value by axis: a number in SI units, or a text.
        texts: The same as the study has it written.
        survived: In how many runs the condition held: that the robot survived, unless asked for another.
        runs: Of how many runs it is known whether it held.
        interval: Wilson's interval of the share, 95 %.
        means: Mean of each other measure over the runs that have a value, [SI unit]; of conditions it is the
            share of the runs in which they held; not a number where no run has a value.
        invalid: How many further runs are invalid, since their physics exploded.
        unknown: How many further runs are valid, but have no value for the condition.
    """

    labels: Mapping[str, Label]
    texts: Mapping[str, str]
    survived: int
    runs: int
    interval: tuple[float, float]
    means: Mapping[str, float] = field(default_factory=dict)
    invalid: int = 0
    unknown: int = 0

    @property
    def share(self) -> float:
        """The share of the runs in which it held; not a number without runs."""
        return self.survived / self.runs if self.runs else math.nan


@dataclass(frozen=True)
class Tried:
    """A value that a search has tried.

    Attributes:
        value: The value, [SI unit].
        verdict: Whether it `holds` or `fails` by the share that the search asks for; `unknown` where too many
            runs are invalid or have no value; `open` where some seeds were not run.
        survived: In how many runs the condition held.
        runs: Of how many runs it is known whether it held.
        invalid: How many further runs are invalid.
        unknown: How many further runs are valid, but have no value for the condition.
    """

    value: float
    verdict: Verdict
    survived: int
    runs: int
    invalid: int
    unknown: int


@dataclass(frozen=True)
class Limit:
    """The largest value for which the condition held in a cell, and for every smaller one that was tried.

    Attributes:
        labels: Value by axis: a number in SI units, or a text.
        texts: The same as the study has it written.
        largest: That value, [SI unit]; 0 if it did not even hold for the smallest.
        survived: In how many runs at `largest` it held.
        runs: Of how many runs there it is known.
        interval: Wilson's interval of the share in which it holds at `largest`, 95 %.
        fails_at: The smallest value for which it did not hold, [SI unit]; None if it did for all.
        each: The largest value for which it held with each seed, where that was searched; else nothing.
        tried: All values that were tried, the smallest first.
    """

    labels: Mapping[str, Label]
    texts: Mapping[str, str]
    largest: float
    survived: int
    runs: int
    interval: tuple[float, float]
    fails_at: float | None
    each: tuple[float, ...] = ()
    tried: tuple[Tried, ...] = ()

    @property
    def unknown_at(self) -> float | None:
        """The smallest value of which it is unknown whether it holds, as runs are invalid or tell nothing."""
        return next((each.value for each in self.tried if each.verdict == "unknown"), None)

    @property
    def holds_again(self) -> tuple[Tried, ...]:
        """Values above one that does not hold for which it holds nevertheless: there is a hole below them."""
        found = self._above_the_boundary()
        return tuple(each for each in found if each.verdict == "holds")

    @property
    def hole(self) -> tuple[Tried, ...]:
        """Values that do not hold, or of which it is unknown, below one that holds; the smallest first."""
        above = self._above_the_boundary()
        last = max((i for i, each in enumerate(above) if each.verdict == "holds"), default=0)
        return tuple(each for each in above[:last] if each.verdict in {"fails", "unknown"})

    def _above_the_boundary(self) -> tuple[Tried, ...]:
        first = next((i for i, each in enumerate(self.tried) if each.verdict in {"fails", "unknown"}), None)
        return () if first is None else self.tried[first:]


@dataclass(frozen=True)
class Results:
    """Everything that a study found.

    Attributes:
        study: The study.
        rows: One for each run: axes by name, the searched value, the columns of `Outcome.row`, and the
            `scenario` as JSON, the `version` of circuitkit and the run's `key`. In the order of the cells,
            searched values and seeds.
        complete: Whether nothing is left to be run.
    """

    study: Study
    rows: tuple[Row, ...] = field(repr=False)
    complete: bool = True

    @cached_property
    def table(self) -> pyarrow.Table:
        """The rows as an Arrow table; a searched value and axes of quantities have their `unit` as metadata.

        Raises:
            MissingDependencyError: pyarrow is not installed.
        """
        return table_of(self.study, self.rows)

    def limits(self) -> tuple[Limit, ...]:
        """The boundary of every cell, in the order of the study.

        Raises:
            CircuitkitError: The study searches nothing.
        """
        search = self.study.search
        if search is None:
            message = f"the study '{self.study.name}' has no search; ask for shares()"
            raise CircuitkitError(message)
        values = {parse_quantity(search.value(i)).value_si: i for i in range(search.count)}
        limit = self._limit_of_each if search.of == "each_seed" else self._limit
        return tuple(
            limit(cell, rows, values) for cell, rows in zip(self.study.cells, self._by_cell, strict=True)
        )

    def _limit(self, cell: Cell, rows: Sequence[Row], values: Mapping[float, int]) -> Limit:
        search = self.study.search
        assert search is not None
        tried = self._tried(rows)
        verdicts = {values[each.value]: each.verdict for each in tried}
        low, _ = boundary(verdicts, search.count)
        amounts = {i: value for value, i in values.items()}
        shown = next((each for each in tried if each.value == amounts[max(low, 0)]), None)
        up, known = (shown.survived, shown.runs) if shown else (0, 0)
        return Limit(
            labels=cell.labels,
            texts=cell.texts,
            largest=amounts[low] if low >= 0 else 0.0,
            survived=up,
            runs=known,
            interval=wilson_interval(up, known),
            fails_at=next((each.value for each in tried if each.verdict == "fails"), None),
            tried=tried,
        )

    def _limit_of_each(self, cell: Cell, rows: Sequence[Row], values: Mapping[float, int]) -> Limit:
        search = self.study.search
        assert search is not None
        amounts = {i: value for value, i in values.items()}
        ends = []
        for seed in self.study.seeds:
            mine = {
                values[row[search.field]]: self._held(row, search.condition)
                for row in rows
                if row["seed"] == seed
            }
            ends.append(boundary(verdicts_of_one(mine), search.count))
        each = tuple(amounts[low] if low >= 0 else 0.0 for low, _ in ends)
        held = sum(low >= 0 for low, _ in ends)
        tried = self._tried(rows)
        return Limit(
            labels=cell.labels,
            texts=cell.texts,
            largest=min(each),
            survived=held,
            runs=len(each),
            interval=wilson_interval(held, len(each)),
            fails_at=next((each.value for each in tried if each.survived < each.runs), None),
            each=each,
            tried=tried,
        )

    def _held(self, row: Row, condition: str) -> bool | None:
        """Whether a condition held in the run of a row; None if nobody knows."""
        return outcome_of(self.study, row).holds(condition)

    def _tried(self, rows: Sequence[Row]) -> tuple[Tried, ...]:
        """The searched values of rows, each with what became of it, the smallest first."""
        search = self.study.search
        assert search is not None
        groups: dict[float, list[Row]] = {}
        for row in rows:
            groups.setdefault(row[search.field], []).append(row)
        found = []
        for value, group in sorted(groups.items()):
            held = [self._held(row, search.condition) for row in group]
            invalid = sum(row.get(INVALID) is not None for row in group)
            known = len(held) - held.count(None)
            what = verdict(held, len(self.study.seeds), search.survive)
            found.append(Tried(value, what, held.count(True), known, invalid, held.count(None) - invalid))
        return tuple(found)

    def shares(self, by: Sequence[str] | None = None, condition: str = "survived") -> tuple[Share, ...]:
        """In how many runs of every cell a condition held, and the means of the measures.

        Args:
            by: The axes to tell apart; runs that differ in others are counted together. All by default.
            condition: The measure that is counted.

        Returns:
            One for each cell, in the order of the study.

        Raises:
            UnknownNameError: The study has no such axis, or the scenario no such measure.
            CircuitkitError: The measure is a number.
        """
        axes = tuple(self.study.axes)
        self.study.require_axes(by or ())
        kept = axes if by is None else tuple(axis for axis in axes if axis in by)
        groups: dict[tuple[Label, ...], tuple[Cell, list[Row]]] = {}
        for cell, rows in zip(self.study.cells, self._by_cell, strict=True):
            same = tuple(cell.labels[axis] for axis in kept)
            groups.setdefault(same, (cell, []))[1].extend(rows)
        found = []
        for cell, group in groups.values():
            held = [self._held(row, condition) for row in group]
            count, known = held.count(True), len(held) - held.count(None)
            invalid = sum(row.get(INVALID) is not None for row in group)
            labels = {axis: cell.labels[axis] for axis in kept}
            texts = {axis: cell.texts[axis] for axis in kept}
            interval, means = wilson_interval(count, known), self._means(group, condition)
            unknown = held.count(None) - invalid
            found.append(Share(labels, texts, count, known, interval, means, invalid, unknown))
        return tuple(found)

    def remarks(self) -> tuple[str, ...]:
        """What does not show in numbers: runs that are invalid, and searches that saw holes."""
        found = []
        if invalid := [str(row[INVALID]) for row in self.rows if row.get(INVALID) is not None]:
            found.append(
                f"{len(invalid)} of {len(self.rows)} runs are invalid and count as neither held nor failed; "
                f"the first {invalid[0]}"
            )
        if (search := self.study.search) is None:
            return tuple(found)
        for limit in self.limits():
            if limit.holds_again:
                where = "".join(f"{name} {text}, " for name, text in limit.texts.items())
                tried, again = (
                    listing(
                        f"{format_quantity(t.value, search.unit)} ({t.survived} of {t.runs})" for t in each
                    )
                    for each in (limit.hole, limit.holds_again)
                )
                found.append(f"{where}there is a hole: it does not hold at {tried}, but again at {again}")
        return tuple(found)

    def _means(self, rows: Sequence[Row], condition: str) -> dict[str, float]:
        """The means of all measures but the condition; those of commands are left out."""
        means = {}
        for name in measures_in(self.study, rows):
            if name != condition and is_measure(name):
                values = [float(row[name]) for row in rows if row.get(name) is not None]
                means[name] = sum(values) / len(values) if values else math.nan
        return means

    @cached_property
    def _by_cell(self) -> tuple[tuple[Row, ...], ...]:
        """The rows of every cell."""
        found: dict[tuple[Label, ...], list[Row]] = {}
        axes = tuple(self.study.axes)
        for row in self.rows:
            found.setdefault(tuple(row[axis] for axis in axes), []).append(row)
        return tuple(tuple(found.get(tuple(cell.labels.values()), ())) for cell in self.study.cells)
