"""The file of a tuning: a study with a section `tune`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from circuitkit.base.errors import InputError, Problem, UnitError, listing, suggest
from circuitkit.base.source import Document, FileModel, Place, find_data_file, read_yaml, validate_model
from circuitkit.base.source.fields import Ratio
from circuitkit.base.units import parse_quantity
from circuitkit.circuit.spec import PlainName
from circuitkit.study.plain import as_written, plain
from circuitkit.study.spec import FOLDER, Seeds, StudyHead, beside
from circuitkit.study.tuning.objective import LIMIT, Term
from circuitkit.study.tuning.runs import Runs, RunSet, in_words, make_runs
from circuitkit.study.tuning.space import Searched, ValueText, start_values

TARGETS = ("circuit", "controller", "reference")
_LEAST = 4  # of fewer candidates CMA-ES learns nothing about how its ranges belong together
TRAIN, TEST, CONFIRM = "train", "test", "confirm"


def _terms(value: object) -> object:
    """A figure by its name alone is a list of one term."""
    if isinstance(value, str):
        return ({"figure": value},)
    if isinstance(value, Mapping):
        return (value,)
    return (
        tuple({"figure": each} if isinstance(each, str) else each for each in value)
        if isinstance(value, list)
        else value
    )


Terms = Annotated[tuple[Term, ...], BeforeValidator(_terms), Field(min_length=1)]


class Part(FileModel):
    """What candidates are measured by at one time."""

    seeds: Seeds
    runs: dict[str, RunSet] = Field(
        default={}, description="Sets of runs that differ from those of the same name above."
    )


class Confirmation(Part):
    """The best few are measured once more, by runs that the search has not seen; the best is taken."""

    best: int = Field(default=5, ge=2, description="How many.")


class TuneSpec(FileModel):
    """What is tuned, what for, and by which runs."""

    circuit: str | None = Field(default=None, description="A circuit: a shipped one, or its path.")
    controller: str | None = Field(default=None, description="Instead: a controller file.")
    reference: dict[str, str] | None = Field(
        default=None,
        min_length=1,
        max_length=1,
        description="Instead: the file of a reference, such as {KIND: FILE}.",
    )
    parameters: dict[str, Searched] = Field(
        min_length=1, description="What is searched: values of the file by name, as --set takes them."
    )
    start: dict[str, ValueText] = Field(default={}, description="The first candidate, by name.")
    maximise: Terms | None = Field(default=None, description="The objective, a weighted sum of figures.")
    minimise: Terms | None = Field(default=None, description="Instead of maximise.")
    runs: dict[str, RunSet] = Field(min_length=1, description="Sets of runs, by name.")
    train: Part = Field(description="By what candidates are compared.")
    test: Part = Field(description="By what the best one is measured in the end, and only then.")
    confirm: Confirmation | None = Field(default=None, description="How the best of the best is chosen.")
    apart: tuple[str, ...] = Field(
        default=(), description="Fields whose values in training must not occur in the test, beside seeds."
    )
    sampler: Literal["cmaes", "tpe"] = Field(default="cmaes", description="Of Optuna.")
    trials: int = Field(default=200, ge=1, le=1_000_000, description="How many candidates are tried.")
    generation: int | None = Field(
        default=None, ge=2, le=100_000, description="How many candidates are run together."
    )
    spread: Ratio = Field(
        default=1 / 6, gt=0, le=1, description="cmaes: how widely it searches first, in parts of the ranges."
    )
    seed: int = Field(default=0, ge=0, lt=2**32, description="Of the sampler.")
    result: PlainName = Field(description="Name of what comes out.")

    @model_validator(mode="after")
    def _one_target_and_one_direction(self) -> TuneSpec:
        for keys in (TARGETS, ("maximise", "minimise")):
            given = [key for key in keys if getattr(self, key) is not None]
            if len(given) != 1:
                message = f"found {' and '.join(given) or 'none'} of {', '.join(keys)}; allowed: one of them"
                raise ValueError(message)
        if self.sampler == "cmaes" and (chosen := [k for k, v in self.parameters.items() if v.choices]):
            message = f"found choices for {', '.join(chosen)}; allowed: ranges only, or the sampler tpe"
            raise ValueError(message)
        return self

    @field_validator("generation")
    @classmethod
    def _large_enough(cls, generation: int | None, info: ValidationInfo) -> int | None:
        if info.data.get("sampler") == "cmaes" and (generation or _LEAST) < _LEAST:
            message = f"found a generation of {generation} for cmaes; allowed: {_LEAST} or more"
            raise ValueError(message)
        return generation

    @property
    def target(self) -> str:
        """What is tuned: `circuit`, `controller` or `reference`."""
        return next(key for key in TARGETS if getattr(self, key) is not None)

    @property
    def base(self) -> str:
        """The file that is tuned."""
        if self.reference is not None:
            return next(iter(self.reference.values()))
        return str(getattr(self, self.target))

    @property
    def kind(self) -> str:
        """The key by which a scenario names it, and by which the file names itself."""
        return self.target if self.reference is None else next(iter(self.reference))

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms of the objective."""
        return self.maximise or self.minimise or ()


class TuningFile(StudyHead):
    """A tuning."""

    tune: TuneSpec


@dataclass(frozen=True)
class Tuning:
    """A tuning, with line and column of every part.

    Attributes:
        file: What it says.
        document: Where it says it.
    """

    file: TuningFile
    document: Document

    @property
    def spec(self) -> TuneSpec:
        """The section `tune`."""
        return self.file.tune

    @property
    def base(self) -> str:
        """The file that is tuned; a relative path counts from the study's folder if it is there."""
        return beside(self.document, self.spec.base)

    @cached_property
    def start(self) -> dict[str, Any]:
        """The start that the file gives, as values of Optuna's distributions."""
        return start_values(self.spec.parameters, self.spec.start, self.document)

    def runs(self, part: str) -> tuple[Runs, ...]:
        """The runs of a part.

        Args:
            part: `train`, `test` or `confirm`.

        Raises:
            InputError: An axis or a scale is wrong.
        """
        spec: Part = getattr(self.spec, part)
        found = []
        for name, runs in {**self.spec.runs, **spec.runs}.items():
            place: Place = ("tune", part, "runs", name) if name in spec.runs else ("tune", "runs", name)
            found.append(make_runs(name, runs, spec.seeds, self.document, place, self._measures(name)))
        return tuple(found)

    def _measures(self, name: str) -> dict[str, str]:
        """The measures that terms of the objective define for a set of runs, as fields by path."""
        return {
            f"measures.{term.figure}": term.expression
            for term in self.spec.terms
            if term.expression is not None and term.runs in {None, name}
        }

    def parts(self) -> tuple[str, ...]:
        """The parts that there are."""
        return (TRAIN, TEST) if self.spec.confirm is None else (TRAIN, CONFIRM, TEST)

    def settings(self, candidate: Mapping[str, str]) -> dict[str, Any]:
        """A candidate as fields of the scenario."""
        target = self.spec.target
        own: dict[str, Any] = {"controller": "circuit"} if target == "circuit" else {}
        own[target if target == self.spec.kind else f"{target}.{self.spec.kind}"] = self.base
        return own | {f"{target}.{name}": text for name, text in candidate.items()}

    def definition(self) -> dict[str, Any]:
        """All that the search depends on beside its runs, as plain data.

        Left out are words, where files lie, how many trials there are, and what comes after them.
        """
        data = plain(self.file)
        for key in ("scenario", "set", "watch"):
            data.pop(key)
        for key in ("trials", "result", CONFIRM, TEST, *TARGETS):
            data["tune"].pop(key)
        return {"study": data["study"], **as_written(data["tune"])}


def load_tuning(name_or_path: str | Path) -> Tuning:
    """Read the file of a tuning, and check all of it that needs no run.

    Args:
        name_or_path: A path, or the name of a shipped study.

    Raises:
        InputError: It cannot be read, or training and test overlap; says where and why.
    """
    document = read_yaml(find_data_file(name_or_path, FOLDER))
    data = document.data
    if isinstance(data, dict) and "study" in data and "tune" not in data:
        message = "the study has no section 'tune'; allowed: a study with one, see docs/tuning.md"
        raise InputError(document.problem((), message))
    tuning = Tuning(validate_model(document, TuningFile), document)
    problems = [*_names(tuning), *_overlaps(tuning)]
    if problems:
        raise InputError(*sorted(problems, key=lambda each: (each.line, each.column)))
    _ = tuning.start
    return tuning


def _names(tuning: Tuning) -> Iterator[Problem]:
    """Names that name nothing."""
    spec, document = tuning.spec, tuning.document
    for name in spec.start:
        if name not in spec.parameters:
            message = f"'{name}' is not searched; allowed: {listing(spec.parameters)}"
            hint = suggest(name, spec.parameters)
            yield document.problem(("tune", "start", name), message, hint, at_key=True)
    direction = "maximise" if spec.maximise else "minimise"
    for number, term in enumerate(spec.terms):
        place: Place = ("tune", direction, number)
        if term.runs is None and len(spec.runs) > 1:
            message = f"found several sets of runs; allowed: runs, one of {listing(spec.runs)}"
            yield document.problem(place, message)
        elif term.runs is not None and term.runs not in spec.runs:
            message = f"unknown runs '{term.runs}'; allowed: {listing(spec.runs)}"
            yield document.problem((*place, "runs"), message, suggest(term.runs, spec.runs))
        elif term.figure == LIMIT and not spec.runs[term.runs or next(iter(spec.runs))].scale:
            message = "found the figure limit of runs without a scale; allowed: runs with a scale"
            yield document.problem((*place, "figure"), message)
    for part in tuning.parts():
        for name in getattr(spec, part).runs:
            if name not in spec.runs:
                message = f"unknown runs '{name}'; allowed: {listing(spec.runs)}"
                hint = suggest(name, spec.runs)
                yield document.problem(("tune", part, "runs", name), message, hint, at_key=True)


def _overlaps(tuning: Tuning) -> Iterator[Problem]:
    """What the test has in common with what the search may see."""
    spec, document = tuning.spec, tuning.document
    known = [(part, getattr(spec, part).seeds) for part in tuning.parts()]
    for (part, seeds), (other, others) in itertools.combinations(known, 2):
        if common := sorted(set(seeds.each()) & set(others.each())):
            message = (
                f"{in_words(others)} of {other} and {in_words(seeds)} of {part} both have "
                f"{'seed' if len(common) == 1 else 'the seeds'} {listing(map(str, common))}; "
                "allowed: seeds of its own"
            )
            yield document.problem(("tune", other, "seeds"), message)
    for number, field in enumerate(spec.apart):
        tested = _values(tuning.runs(TEST), field)
        for part in tuning.parts()[:-1]:
            if common := [text for key, text in _values(tuning.runs(part), field).items() if key in tested]:
                message = (
                    f"'{field}' is {listing(common)} in {part} and in the test; "
                    "allowed: other values in the test, by test: {runs: ...}"
                )
                yield document.problem(("tune", "apart", number), message)
        if not tested:
            message = f"no runs set '{field}'; allowed: a field that set or an axis gives a value"
            yield document.problem(("tune", "apart", number), message)


def _values(runs: tuple[Runs, ...], field: str) -> dict[object, str]:
    """The values of a field in sets of runs as texts, by what is equal for equal ones (0.1 s and 100 ms)."""
    values: dict[object, str] = {}
    for each in runs:
        for condition in each.conditions:
            found = {**each.study.file.set, **condition.settings}
            if field in found:
                text = str(found[field])
                values.setdefault(_comparable(text), text)
    return values


def _comparable(text: str) -> object:
    try:
        quantity = parse_quantity(text)
    except UnitError:
        return text
    return quantity.dimension, quantity.value_si
