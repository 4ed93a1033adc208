"""The scenario: robot, reference, controller, disturbances, measures and seed, as data or as objects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from circuitkit.base.errors import InputError, Problem, UnitError
from circuitkit.base.reading import INTEGERS_END, is_file
from circuitkit.base.source import (
    Document,
    FileModel,
    describe,
    find_data_file,
    place_text,
    read_yaml,
    unfilled,
    validate_model,
)
from circuitkit.base.source.fields import Seconds
from circuitkit.base.units import parse_quantity, parse_unit
from circuitkit.circuit import CircuitGraph
from circuitkit.robots import Robot
from circuitkit.simulation.disturbance import Disturbance, item_class
from circuitkit.simulation.disturbances.push import Push, check_direction
from circuitkit.simulation.fallback import FallbackKind
from circuitkit.simulation.measures import MEASURES
from circuitkit.simulation.reference import REFERENCES, Reference

FOLDER = "sims"
LONGEST_S = 3600.0


class _Sides(FileModel):
    """Names that differ between a circuit and a robot."""

    inputs: Mapping[str, str] = Field(default={}, description="Channel by the circuit's input.")
    outputs: Mapping[str, str | None] = Field(
        default={}, description="Command by the circuit's output; ~ for one that is not written."
    )


class _ReferenceItem(FileModel):
    """Base of `reference`: one kind with its settings."""

    @model_validator(mode="after")
    def _one(self) -> _ReferenceItem:
        if len(self.model_fields_set) != 1:
            found = ", ".join(sorted(self.model_fields_set)) or "nothing"
            message = f"found {found}; allowed: one kind of reference"
            raise ValueError(message)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the function that makes the class."""
        return unfilled, (reference_class,), self.__getstate__()


def _expression(found: object) -> object:
    if isinstance(found, str):
        return found
    kinds = ", ".join(MEASURES.kinds)
    allowed = f"an expression, such as max(abs(roll)); kinds with settings are {kinds}"
    message = f"found {describe(found)}; allowed: {allowed}"
    raise ValueError(message)


class _Measures(FileModel):
    """Base of `measures`: expressions by name, and kinds of measures with their settings."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[str, BeforeValidator(_expression)]] = Field(init=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the function that makes the class."""
        return unfilled, (measures_class,), self.__getstate__()


@cache
def reference_class() -> type[_ReferenceItem]:
    """A model with a key for each kind of reference."""
    fields: dict[str, Any] = {
        kind: (
            made.settings | None,
            Field(default=None, description=(made.__doc__ or kind).partition("\n")[0]),
        )
        for kind, made in REFERENCES.kinds.items()
    }
    return create_model("Reference", __base__=_ReferenceItem, **fields)


@cache
def measures_class() -> type[_Measures]:
    """A model that takes expressions by any name, and has a key for each kind of measure."""
    fields: dict[str, Any] = {kind: (made | None, None) for kind, made in MEASURES.kinds.items()}
    return create_model("Measures", __base__=_Measures, **fields)


@cache
def scenario_class() -> type[Scenario]:
    """`Scenario` with the kinds of disturbances, references and measures that are registered."""
    item: Any = item_class()
    reference: Any = reference_class()
    measure: Any = measures_class()
    fields: dict[str, Any] = {
        "reference": (reference | None, Field(default=None, description="What the commands are added to.")),
        "disturbances": (
            tuple[item, ...],
            Field(default=(), description="What befalls robot, channels and commands, in order."),
        ),
        "measures": (
            measure,
            Field(
                default=measure(),
                description="Expressions by name, and kinds of measures with their settings.",
            ),
        ),
    }
    return create_model("Scenario", __base__=Scenario, **fields)


class _TakesObjects(type(FileModel)):  # type: ignore[misc]  # pydantic's metaclass has no public name
    """Lets Python make scenarios of objects; what comes from a file does not pass here."""

    def __call__(cls, **data: Any) -> Any:  # noqa: ANN401 - the fields
        """Make a scenario that knows all registered kinds."""
        made = scenario_class() if cls is Scenario else cls
        given = {k: v if isinstance(v, Disturbance) else _as_file(v) for k, v in data.items()}
        reference = given.get("reference")
        if isinstance(reference, Reference):
            given.pop("reference")
        scenario = super(_TakesObjects, made).__call__(**given)
        if isinstance(reference, Reference):
            object.__setattr__(scenario, "reference", reference)
        return scenario


def _as_file(value: Any) -> Any:  # noqa: ANN401 - any field
    """A value as the models of files take it: tuples for lists, and each disturbance under its kind."""
    if isinstance(value, Disturbance):
        return {value.kind: value}
    if isinstance(value, list | tuple):
        return tuple(_as_file(each) for each in value)
    if type(value) is dict:
        return {key: each if isinstance(each, Disturbance) else _as_file(each) for key, each in value.items()}
    return value


_TAKEN: Mapping[
    str, tuple[tuple[type, ...], str]
] = {  # no types: what is neither a number nor a mapping nor a list
    "robot": ((str, Path, Robot), "the name of a robot, the path of a robot file, or a Robot"),
    "circuit": ((str, Path, CircuitGraph, type(None)), "the name of a circuit, a path, or a CircuitGraph"),
    "controller": ((), "a name, a path, or a Controller"),
}


def misfit(key: str, value: object) -> str:
    """What is wrong with a value in the place of a robot, a circuit or a controller; empty if nothing is."""
    kinds, allowed = _TAKEN[key]
    fits = isinstance(value, kinds) if kinds else not isinstance(value, int | float | dict | list)
    return "" if fits else f"found {describe(value)}; allowed: {allowed}"


class Scenario(FileModel, metaclass=_TakesObjects):
    """A simulation.

    Every field takes what a file may say, or, in Python, an object: a `Robot`, a `Controller`, a
    `CircuitGraph`, a `Reference`, a list of disturbances.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    scenario: str = Field(default="scenario", description="Name.")
    description: str = Field(default="", description="One sentence; `circuitkit list` shows it.")
    robot: Any = Field(description="A shipped robot, or the path of a robot file.")
    servo_profile: str | None = Field(
        default=None, description="A set of servos of the robot file; its own choice if absent."
    )
    reference: Any = None
    controller: Any = Field(
        default=None, description="open_loop, circuit, or the name or path of a controller file."
    )
    circuit: Any = Field(
        default=None, description="The circuit of the controller named circuit: a shipped one or a path."
    )
    settings: Mapping[str, str | float] = Field(
        default={}, description="Values of the circuit that take the place of its file's, such as w: 2 deg."
    )
    connect: _Sides = Field(default=_Sides(), description="Joins names of the circuit to those of the robot.")
    silenced: tuple[str, ...] = Field(
        default=(),
        description="Neurons or inputs of the circuit that send nothing, and connections that carry nothing, "
        "such as q1 or q1 -> p1.",
    )
    control_step: Seconds | None = Field(
        default=None,
        gt=0,
        description="Time between two commands; that of the reference, else that of the circuit, if absent.",
    )
    duration: Seconds = Field(gt=0, le=LONGEST_S, description="How long the run lasts.")
    fallback: FallbackKind = Field(
        default="hold",
        description="What takes the place of a command that does not come (is not a number): hold, the last "
        "one; zero; or open_loop, all commands of the robot zero, so that the reference is alone.",
    )
    fallback_after: Seconds = Field(
        default=0.1, ge=0, description="How long the last command is held before the fallback."
    )
    disturbances: Any = ()
    until: str | None = Field(default=None, description="Condition that ends the run.")
    valid: str | None = Field(
        default=None, description="Condition that holds in any run that is possible; else the run is invalid."
    )
    measures: Any = Field(default_factory=dict)
    seed: int = Field(default=0, ge=0, lt=INTEGERS_END, description="Seed of everything random.")

    _document: Document = PrivateAttr(default=Document("", None, {}))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the function that makes the class."""
        return unfilled, (scenario_class,), self.__getstate__()

    @field_validator("robot", "circuit", "controller")
    @classmethod
    def _takes(cls, value: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - text or an object
        key = str(info.field_name)
        if complaint := misfit(key, value):
            raise ValueError(complaint)
        return value

    @property
    def befalling(self) -> tuple[Disturbance, ...]:
        """The disturbances themselves."""
        return tuple(item.disturbance for item in self.disturbances)

    @property
    def pushes(self) -> tuple[Push, ...]:
        """The pushes among the disturbances."""
        return tuple(each for each in self.befalling if isinstance(each, Push))

    @property
    def formulas(self) -> dict[str, str]:
        """The measures that are expressions, by name; `survived` unless the scenario has its own."""
        extra = getattr(self.measures, "__pydantic_extra__", None)
        own = dict(extra if extra is not None else self.measures or {})
        return own if "survived" in own else {"survived": "not ended", **own}

    @property
    def measure_kinds(self) -> tuple[Any, ...]:
        """The measures of registered kinds."""
        found = [getattr(self.measures, kind, None) for kind in MEASURES.kinds]
        return tuple(each for each in found if each is not None)

    def made_reference(self) -> Reference:
        """The reference: what the file says, or the object; to hold the start if there is none.

        Raises:
            InputError: A file that it names is wrong or missing.
        """
        if isinstance(self.reference, Reference):
            return self.reference
        if self.reference is None:
            return Reference()
        kind = next(iter(self.reference.model_fields_set))
        with self.located(f"reference.{kind}"):
            return REFERENCES[kind].read(getattr(self.reference, kind), self._document)

    def with_disturbances(self, disturbances: Iterable[Disturbance]) -> Scenario:
        """The same scenario with others."""
        item = item_class()
        return self.model_copy(
            update={"disturbances": tuple(item(**{each.kind: each}) for each in disturbances)}
        )

    def file(self, name: str) -> str:
        """A file that the scenario names, from the scenario's own folder if it is a relative path."""
        return beside(name, self._document)

    @contextmanager
    def located(self, key: str) -> Iterator[None]:
        """Give complaints that belong to no file the line of this scenario that they are about.

        Args:
            key: What they are about if they do not say, such as `robot`; empty leaves those as they are.
        """
        try:
            yield
        except InputError as error:
            problems = (each if each.is_placed else self._here(each, key) for each in error.problems)
            raise InputError(*problems) from error

    def _here(self, problem: Problem, key: str) -> Problem:
        where = problem.where or key
        if not where:
            return problem
        for length in range(len(parts := where.split(".")), 0, -1):
            shorter = ".".join(parts[:length])
            place = next((place for place in self._document.marks if place_text(place) == shorter), None)
            if place is not None:
                return replace(self._document.problem(place, problem.message, problem.hint), where=where)
        if not self._document.path:
            return replace(problem, where=where)
        return replace(
            self._document.problem((key.partition(".")[0],), problem.message, problem.hint), where=where
        )

    def problem_in(self, key: str, name: str, message: str, offset: int) -> Problem:
        """A complaint about the text of an expression, such as `measures` and the name of one."""
        place = (key, name) if name else (key,)
        if place not in self._document.marks:
            return Problem("", 0, 0, place_text(place), message)
        return self._document.problem(place, message, offset=offset)


def beside(name: str, document: Document) -> str:
    """A file that a document names, from the document's own folder if it is a path that exists there."""
    path = Path(name)
    near = Path(document.path).parent / path
    found = path.suffix and not path.is_absolute() and is_file(near)
    return str(near) if found else name


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario file.

    Args:
        name_or_path: A path, or the name of a shipped one such as `nao_push`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    document = read_yaml(find_data_file(name_or_path, FOLDER))
    scenario = validate_model(document, scenario_class())
    scenario._document = document  # the scenario's own factory
    return scenario


def parse_push(text: str, scenario: Scenario) -> Push:
    """Read `20N,200ms,inward`; body and start are those of the scenario's first push.

    Raises:
        InputError: The text cannot be read, or the scenario has no push to take the start from.
    """
    parts = [part.strip() for part in text.split(",")]
    wanted = "FORCE,DURATION,DIRECTION such as 20N,200ms,left"
    if len(parts) != 3:  # noqa: PLR2004 - force, duration and direction
        raise InputError(Problem("", 0, 0, "--push", f"found '{text}'; allowed: {wanted}"))
    if not scenario.pushes:
        message = f"the scenario '{scenario.scenario}' has no push to change; allowed: a scenario with a push"
        raise InputError(Problem("", 0, 0, "--push", message))
    values = []
    for part, unit, key in zip(parts[:2], ("N", "s"), ("force", "duration"), strict=True):
        try:
            quantity = parse_quantity(part)
        except UnitError as error:
            raise InputError(Problem("", 0, 0, f"--push: {key}", str(error))) from error
        if quantity.dimension != parse_unit(unit).dimension or quantity.value_si <= 0:
            message = f"found '{part}'; allowed: more than 0, in a unit like {unit}"
            raise InputError(Problem("", 0, 0, f"--push: {key}", message))
        values.append(quantity.value_si)
    try:
        direction = check_direction(parts[2])
    except ValueError as error:
        raise InputError(Problem("", 0, 0, "--push: direction", str(error))) from error
    change = {"force": values[0], "duration": values[1], "direction": direction, "torque": None}
    return scenario.pushes[0].model_copy(update=change)


def with_push(scenario: Scenario, push: Push | None) -> tuple[Disturbance, ...]:
    """The disturbances of a scenario with one push in the place of all of its pushes; as they are if None."""
    if push is None:
        return scenario.befalling
    kept: list[Disturbance] = []
    for each in scenario.befalling:
        if not isinstance(each, Push):
            kept.append(each)
        elif not any(isinstance(other, Push) for other in kept):
            kept.append(push)
    return tuple(kept)
