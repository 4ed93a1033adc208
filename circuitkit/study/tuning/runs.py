"""The runs by which a tuning measures its candidates: conditions (settings of the scenario) times seeds."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import Field, field_validator

from circuitkit.base.errors import InputError, UnitError
from circuitkit.base.source import Document, FileModel, Mark, Place, validate_model
from circuitkit.base.source.fields import Ratio, Seconds
from circuitkit.base.units import format_quantity, parse_quantity
from circuitkit.study.spec import Axis, Seeds, Settings, Study, StudyFile

_OF_A_STUDY = ("scenario", "set", "watch")  # what a set of runs takes over from its study
_DIGITS = 12


class RunSet(FileModel):
    """Runs that a figure is taken of: every combination of the axes and the scale, with every seed."""

    set: dict[str, Any] = Field(default={}, description="Fields of the scenario by path, for all of them.")
    axes: dict[str, Axis] = Field(default={}, description="What varies, as in any study.")
    scale: dict[str, tuple[Ratio, ...]] = Field(
        default={}, description="By the path of a field, factors of its value; of one field at most."
    )
    watch: Seconds | None = Field(
        default=None, gt=0, description="Runs end this long after the last push; as the study if absent."
    )

    @field_validator("scale")
    @classmethod
    def _of_one_field(cls, scale: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
        if len(scale) > 1:
            message = f"found {len(scale)} fields: {', '.join(scale)}; allowed: one"
            raise ValueError(message)
        for factors in scale.values():
            if not factors or any(b <= a for a, b in itertools.pairwise((0.0, *factors))):
                message = "found factors out of order; allowed: at least one, above 0, the smallest first"
                raise ValueError(message)
        return scale


@dataclass(frozen=True)
class Condition:
    """One setting of the scenario.

    Attributes:
        cell: Which combination of the axes it is: the value of each as it was written.
        factor: By what the scaled field is multiplied; 1 without a scale.
        settings: Fields of the scenario by path.
        places: Where in the file each of them is set.
    """

    cell: Mapping[str, str]
    factor: float
    settings: Settings
    places: Mapping[str, Place] = field(default_factory=dict)

    @property
    def cell_key(self) -> tuple[tuple[str, str], ...]:
        """Equal for conditions that differ in the scale only."""
        return tuple(self.cell.items())


@dataclass(frozen=True)
class Runs:
    """A set of runs that is ready to be run.

    Attributes:
        name: Its name.
        study: The set as a study of its own.
        conditions: The settings, those of one cell behind each other, by growing factor.
        seeds: The seeds of each.
    """

    name: str
    study: Study
    conditions: tuple[Condition, ...]
    seeds: range

    @property
    def count(self) -> int:
        """How many runs a candidate needs."""
        return len(self.conditions) * len(self.seeds)


def make_runs(
    name: str, spec: RunSet, seeds: Seeds, document: Document, place: Place, measures: Settings
) -> Runs:
    """The runs of a set.

    Args:
        name: Its name.
        spec: What the file says of it.
        seeds: The seeds.
        measures: Measures that the objective adds to those of the scenario, as fields by path.
        document: The file of the tuning.
        place: Where the set stands in it.

    Raises:
        InputError: What is scaled has no value, or none that can be scaled.
    """
    study = _study(name, spec, seeds, document, place, measures)
    conditions = []
    for cell in study.cells:
        places = {path: (*place, *inner) for path, inner in cell.places.items()}
        for path, factors in spec.scale.items():
            given = {**study.file.set, **cell.settings}
            for factor in factors:
                settings = {**cell.settings, path: _scaled(given, path, factor, document, place)}
                conditions.append(
                    Condition(cell.texts, factor, settings, {path: (*place, "scale", path)} | places)
                )
        if not spec.scale:
            conditions.append(Condition(cell.texts, 1.0, cell.settings, places))
    return Runs(name, study, tuple(conditions), seeds.each())


def _study(
    name: str, spec: RunSet, seeds: Seeds, document: Document, place: Place, measures: Settings
) -> Study:
    """The set as a study of its own, whose parts know where they stand in the file of the tuning."""
    whole: Any = document.data  # a mapping with what `place` names: it has been validated
    inner = whole
    for part in place:
        inner = inner[part]
    data: dict[str, Any] = {key: whole[key] for key in _OF_A_STUDY if key in whole}
    data |= {"study": name, "seeds": seeds.model_dump(), "axes": inner.get("axes", {})}
    data["set"] = {**data.get("set", {}), **spec.set, **measures}
    if "watch" in inner:
        data["watch"] = inner["watch"]
    marks: dict[Place, Mark] = {at: mark for at, mark in document.marks.items() if at[:1] != ("tune",)}
    marks |= {at[len(place) :]: mark for at, mark in document.marks.items() if at[: len(place)] == place}
    own = Document(document.path, data, marks, {})
    return Study(validate_model(own, StudyFile), own)


def _scaled(settings: Settings, path: str, factor: float, document: Document, place: Place) -> str:
    """A factor times the value of a field, in its unit."""
    at = (*place, "scale", path)
    if path not in settings:
        message = f"nothing gives '{path}' a value; allowed: a field that stands in set or in an axis"
        raise InputError(document.problem(at, message, at_key=True))
    try:
        quantity = parse_quantity(str(settings[path]))
    except UnitError as error:
        raise InputError(document.problem(at, f"cannot scale '{path}': {error}", at_key=True)) from error
    return format_quantity(factor * quantity.value_si, quantity.unit, _DIGITS)


def in_words(seeds: Seeds) -> str:
    """Such as `seeds 100 to 104`, or `seed 100`."""
    numbers = seeds.each()
    return f"seeds {numbers[0]} to {numbers[-1]}" if len(numbers) > 1 else f"seed {numbers[0]}"
