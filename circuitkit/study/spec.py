"""The study file: which scenario, which of its fields vary, with which seeds, and what is searched."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeAlias

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from circuitkit.base.errors import InputError, Problem, UnitError, UnknownNameError, listing, suggest
from circuitkit.base.reading import INTEGERS_END, is_file
from circuitkit.base.source import (
    Data,
    Document,
    FileModel,
    describe,
    find_data_file,
    read_yaml,
    validate_model,
)
from circuitkit.base.source.fields import AnyQuantity, Ratio, Seconds
from circuitkit.base.units import Quantity, Unit, parse_quantity
from circuitkit.simulation.measures import CLAMPED, INVALID, RMS

FOLDER = "sims/studies"
RESERVED = ("seed", INVALID, "scenario", "version", "key")  # columns that every table of results has
MOST_SEEDS, MOST_CELLS, MOST_STEPS = 1_000_000, 1_000_000, 1_000_000

# A value of an axis: as in the file, or in SI units where it has one.
Label: TypeAlias = "str | int | float | bool | None"
# What is changed: fields by path, such as {"push.force": "20 N"}.
Settings: TypeAlias = Mapping[str, Any]


def is_measure(column: str) -> bool:
    """Whether a column of an outcome is a measure of the scenario, and not one about commands."""
    return column != CLAMPED and not column.startswith(RMS)


def _axis(value: object) -> object:
    if not (isinstance(value, list | dict) and value):
        allowed = "a list of values, or a mapping of names to fields"
        message = f"found {describe(value) if value or value is None else 'no values'}; allowed: {allowed}"
        raise ValueError(message)
    return value


class Seeds(FileModel):
    """Seeds that follow each other."""

    first: int = Field(default=0, ge=0, le=INTEGERS_END - MOST_SEEDS)
    count: int = Field(gt=0, le=MOST_SEEDS)

    def each(self) -> range:
        """The seeds."""
        return range(self.first, self.first + self.count)


class Search(FileModel):
    """The largest value of a field for which a condition holds, on a grid from `low` to `high`."""

    model_config = ConfigDict(populate_by_name=True)

    field: str = Field(description="Path of the field that is searched, such as push.force.")
    low: AnyQuantity = Field(description="Smallest value.")
    high: AnyQuantity = Field(description="Largest value.")
    step: AnyQuantity = Field(description="Distance of two values of the grid.")
    of: Literal["all_seeds", "each_seed"] = Field(
        default="all_seeds",
        description="Whose boundary: of the seeds together, or of each by itself, for means over seeds.",
    )
    condition: str = Field(
        default="survived", alias="while", description="The measure that must be true of a run."
    )
    survive: Ratio = Field(
        default=1.0, gt=0, le=1, description="Share of the seeds for which the condition must hold."
    )
    check_below: int = Field(
        default=3, ge=0, description="How many values below the boundary are tried as well."
    )

    @model_validator(mode="after")
    def _is_a_grid(self) -> Search:
        low, high, step = (parse_quantity(text) for text in (self.low, self.high, self.step))
        for name, other in (("high", high), ("step", step)):
            if other.dimension != low.dimension:
                found = f"low is {low.dimension}, {name} is {other.dimension}"
                message = f"found {self.low} and {getattr(self, name)}: {found}; allowed: the same for all"
                raise ValueError(message)
        if step.value_si <= 0 or high.value_si <= low.value_si:
            found = f"low {self.low}, high {self.high}, step {self.step}"
            message = f"found {found}; allowed: low below high, and a step of more than 0"
            raise ValueError(message)
        first, last, width = (_decimal(each, step.unit) for each in (low, high, step))
        if not (last - first).is_finite() or (last - first) / width > MOST_STEPS:
            message = (
                f"found low {self.low}, high {self.high}, step {self.step}; "
                f"allowed: up to {MOST_STEPS} steps from low to high"
            )
            raise ValueError(message)
        if (last - first) % width:
            message = (
                f"found low {self.low}, high {self.high}, step {self.step}; "
                "allowed: whole steps from low to high"
            )
            raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _of_each_seed(self) -> Search:
        if self.of == "each_seed" and (given := {"survive", "check_below"} & self.model_fields_set):
            message = f"found of: each_seed with {listing(sorted(given))}; allowed: these with all_seeds only"
            raise ValueError(message)
        return self

    @property
    def unit(self) -> Unit:
        """The unit of the grid: that of `step`."""
        return parse_quantity(self.step).unit

    @property
    def count(self) -> int:
        """How many values the grid has."""
        first, last, width = self._numbers()
        return int((last - first) / width) + 1

    def value(self, index: int) -> str:
        """The value number `index` of the grid as it would be written, such as `13 N`."""
        first, _, width = self._numbers()
        number = f"{first + index * width:f}"
        return number if self.unit.symbol == "1" else f"{number} {self.unit.symbol}"

    def _numbers(self) -> tuple[Decimal, Decimal, Decimal]:
        first, last, width = (
            _decimal(parse_quantity(text), self.unit) for text in (self.low, self.high, self.step)
        )
        return first, last, width


def _decimal(quantity: Quantity, unit: Unit) -> Decimal:
    """The number in a unit, as a decimal: the same for 0.1 s and for 100 ms."""
    return Decimal(f"{unit.from_si(quantity.value_si):.12g}")


def _scalar(value: object) -> object:
    if isinstance(value, list | dict) or value is None:
        message = (
            f"found {describe(value)}; allowed: a text, a number, true or false; "
            "give sets of fields a name: NAME: {FIELD: VALUE}"
        )
        raise ValueError(message)
    return value


Axis: TypeAlias = Annotated[
    list[Annotated[Any, AfterValidator(_scalar)]] | dict[str, dict[str, Any]], BeforeValidator(_axis)
]


class StudyHead(FileModel):
    """What every study begins with, whether it sweeps or tunes."""

    study: str = Field(description="Name.")
    description: str = ""
    scenario: str = Field(description="A shipped scenario, or the path of a scenario file.")
    set: dict[str, Any] = Field(
        default={}, description="Fields, by path, that differ from the scenario's in all runs."
    )
    watch: Seconds | None = Field(
        default=None,
        gt=0,
        description="The run ends this long after the end of the last push, not at the scenario's duration.",
    )


class StudyFile(StudyHead):
    """Many runs of one scenario."""

    axes: dict[str, Axis] = Field(
        default={},
        description="What varies: a list of values of the field that the axis is called after, or names of "
        "sets of fields. Every combination is run.",
    )
    seeds: Seeds = Field(description="Of noise and jitter.")
    search: Search | None = Field(default=None, description="The boundary that is looked for in each cell.")


@dataclass(frozen=True)
class AxisValue:
    """One value of an axis.

    Attributes:
        label: A number in SI units if all values of the axis are such, or a text.
        text: As it was written.
        settings: The fields that it sets.
        place: Where it stands in the study.
        named: Whether it is a name of a set of fields.
    """

    label: Label
    text: str
    settings: Settings
    place: tuple[str | int, ...]
    named: bool


@dataclass(frozen=True)
class Cell:
    """One combination of the axes.

    Attributes:
        labels: Value by axis: a number in SI units, or a text.
        texts: The same as they were written.
        settings: The fields that it sets, on top of `set`.
        places: Where in the study each of them stands.
    """

    labels: Mapping[str, Label]
    texts: Mapping[str, str]
    settings: Settings
    places: Mapping[str, tuple[str | int, ...]]


@dataclass(frozen=True)
class Study:
    """A study: its file, with line and column of every part.

    Attributes:
        file: What it says.
        document: Where it says it.
    """

    file: StudyFile
    document: Document

    @property
    def name(self) -> str:
        """Its name."""
        return self.file.study

    @property
    def search(self) -> Search | None:
        """What is searched; None for a plain grid."""
        return self.file.search

    @property
    def seeds(self) -> range:
        """The seeds."""
        return self.file.seeds.each()

    @cached_property
    def axes(self) -> Mapping[str, tuple[AxisValue, ...]]:
        """The values of every axis, in the order of the file."""
        return {name: tuple(_values(name, axis)) for name, axis in self.file.axes.items()}

    def require_axes(self, names: Iterable[str]) -> None:
        """See whether these are axes of the study.

        Raises:
            UnknownNameError: One is not.
        """
        for name in names:
            if name not in self.axes:
                kind = "axis"
                raise UnknownNameError(kind, name, self.axes)

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Every combination of the axes; the last axis varies first."""
        return tuple(
            cell_of(dict(zip(self.axes, chosen, strict=True)))
            for chosen in itertools.product(*self.axes.values())
        )

    def with_(self, changes: Mapping[str, Any]) -> Study:
        """A changed copy, such as a smaller one for a quick look.

        Args:
            changes: By the keys of the file. `set`, `seeds` and `search` are changed key by key, and None
                takes a key away. An axis that is named gets these values: of named sets a list of names picks
                some, a mapping replaces them; None drops the axis.

        Raises:
            InputError: What comes out is no study.
        """
        data = deepcopy(self.document.data)
        if not isinstance(data, dict):  # never: it was a study before
            raise TypeError
        changed = []
        for key, value in changes.items():
            old = data.get(key)
            if value is None:
                data.pop(key, None)
            elif key == "axes":
                data[key] = _changed_axes(old if isinstance(old, dict) else {}, value)
            elif key in {"set", "seeds", "search"} and isinstance(old, dict):
                data[key] = {k: v for k, v in (old | dict(value)).items() if v is not None}
            else:
                data[key] = deepcopy(value)
            changed.append((key,))
        marks = {place: mark for place, mark in self.document.marks.items() if place[:1] not in changed}
        return _study(Document(self.document.path, data, marks, self.document.shifts))


def read_study(name_or_path: str | Path) -> Study:
    """Read a study file, without looking at the scenario that it is about; see `load_study`.

    Args:
        name_or_path: A path, or the name of a shipped one such as `push_limits`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    document = read_yaml(find_data_file(name_or_path, FOLDER))
    if isinstance(document.data, dict) and "tune" in document.data:
        message = "found a study that tunes; allowed: one that sweeps"
        raise InputError(document.problem(("tune",), message, "circuitkit tune runs it", at_key=True))
    return _study(document)


def make_study(data: Mapping[str, Any]) -> Study:
    """A study from data of the same form as the file's.

    Raises:
        InputError: The data is no study.
    """
    return _study(Document("", deepcopy(dict(data) if isinstance(data, Mapping) else data), {}))


def _study(document: Document) -> Study:
    study = Study(validate_model(document, StudyFile), document)
    if (cells := math.prod(map(len, study.file.axes.values()))) > MOST_CELLS:
        message = f"found axes with {cells} combinations; allowed: up to {MOST_CELLS}"
        raise InputError(document.problem(("axes",), message))
    fields = [*study.file.axes, *([study.search.field] if study.search else [])]
    clash = [name for name in fields if name in RESERVED or fields.count(name) > 1]
    if clash:
        place: tuple[str | int, ...] = (
            ("axes", clash[0]) if clash[0] in study.file.axes else ("search", "field")
        )
        what = "a column of the results" if clash[0] in RESERVED else "an axis and the searched field at once"
        message = f"found '{clash[0]}', which is {what}; allowed: another name"
        raise InputError(document.problem(place, message, at_key=place[0] == "axes"))
    twice = [
        (value, other)
        for values in study.axes.values()
        for i, value in enumerate(values)
        for other in values[:i]
        if value.label == other.label
    ]
    if twice:
        value, other = twice[0]
        message = f"found '{value.text}', the same as '{other.text}'; allowed: each value once"
        raise InputError(document.problem(value.place, message))
    return study


def _values(name: str, axis: Sequence[Any] | Mapping[str, Settings]) -> list[AxisValue]:
    if isinstance(axis, Mapping):
        return [
            AxisValue(label, label, settings, ("axes", name, label), named=True)
            for label, settings in axis.items()
        ]
    return [
        AxisValue(label, value_text(value), {name: value}, ("axes", name, i), named=False)
        for i, (value, label) in enumerate(zip(axis, _labels(axis), strict=True))
    ]


def _labels(values: Sequence[Any]) -> Sequence[Label]:
    """SI values if all are quantities of one dimension, the values themselves if all are of one type."""
    if all(isinstance(value, bool) for value in values):
        return values
    try:
        quantities = [parse_quantity(value_text(value)) for value in values]
    except UnitError:
        return [value_text(value) for value in values]
    if len({quantity.dimension for quantity in quantities}) > 1:
        return [value_text(value) for value in values]
    return [quantity.value_si for quantity in quantities]


def value_text(value: object) -> str:
    """A value as a file would have it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def beside(document: Document, name: str) -> str:
    """A file that a study names, from the study's own folder if it is a relative path and lies there."""
    path = Path(name)
    there = Path(document.path).parent / path
    return str(there) if path.suffix and not path.is_absolute() and is_file(there) else name


def cell_of(chosen: Mapping[str, AxisValue]) -> Cell:
    """The cell of a value of each axis."""
    settings: dict[str, Any] = {}
    places: dict[str, tuple[str | int, ...]] = {}
    for value in chosen.values():
        for path, data in value.settings.items():
            settings[path] = data
            places[path] = (*value.place, path) if value.named else value.place
    labels = {axis: value.label for axis, value in chosen.items()}
    return Cell(labels, {axis: value.text for axis, value in chosen.items()}, settings, places)


def _changed_axes(old: Mapping[str, Data], changes: Mapping[str, Any]) -> dict[str, Any]:
    axes: dict[str, Any] = dict(old)
    for name, values in changes.items():
        before = axes.get(name)
        if values is None:
            axes.pop(name, None)
        elif isinstance(before, dict) and not isinstance(values, Mapping):
            for label in values:
                if label not in before:
                    _unknown_label(name, label, before)
            axes[name] = {label: before[label] for label in values}
        else:
            axes[name] = deepcopy(dict(values) if isinstance(values, Mapping) else list(values))
    return axes


def _unknown_label(axis: str, label: str, names: Mapping[str, Any]) -> NoReturn:
    message = f"unknown value '{label}' of the axis; allowed: {listing(names)}"
    raise InputError(Problem("", 0, 0, f"axes.{axis}", message, suggest(str(label), names)))
