"""The scenario file: which robot walks how, under which controller, and what befalls it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, model_validator

from circuitkit.base.errors import InputError, Problem, UnitError, listing, suggest
from circuitkit.base.source import (
    Document,
    FileModel,
    describe,
    find_data_file,
    place_text,
    read_yaml,
    validate_model,
)
from circuitkit.base.source.fields import Metres, MetresPerSecond, Newtons, Ratio, Seconds
from circuitkit.base.units import parse_quantity, parse_unit
from circuitkit.robots import Plant

_FOLDER = "sims"
_HIGHEST_M = 2.0  # above or below a body's centre of mass; beyond, it is a slip of the unit
_LARGEST_ANGLE_RAD = math.radians(360) * (1 + 1e-9)  # once round, however it is written

# Forward, left, up. Inward is towards the foot in the air, outward away from it.
DIRECTIONS: Mapping[str, tuple[float, float, float]] = {
    "forward": (1.0, 0.0, 0.0),
    "backward": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
}
SIDEWAYS = ("inward", "outward")


def _direction(value: object) -> object:
    words = (*DIRECTIONS, *SIDEWAYS)
    if value in words:
        return value
    if isinstance(value, str) and _is_angle(value):
        if not abs(parse_quantity(value).value_si) <= _LARGEST_ANGLE_RAD:
            message = f"found '{value}'; allowed: an angle from -360 deg to 360 deg"
            raise ValueError(message)
        return value
    hint = suggest(str(value), words)
    allowed = f"{listing(words)}, or an angle such as '15 deg'"
    message = f"unknown direction {describe(value)}; allowed: {allowed}{'; ' if hint else ''}{hint}"
    raise ValueError(message)


def _is_angle(text: str) -> bool:
    try:
        return parse_quantity(text).dimension == parse_unit("rad").dimension
    except UnitError:
        return False


class Start(FileModel):
    """When a push begins: a moment of the gait."""

    step: int = Field(ge=0, description="Number of the step, from 0; the left foot carries the even ones.")
    phase: Literal["transfer", "lift", "extend"] = Field(description="Movement of that step.")
    at: Ratio = Field(ge=0, le=1, description="How far into the movement.")


class Push(FileModel):
    """A force on a body."""

    body: str = Field(
        description="torso, left_foot, right_foot or a body of the MJCF; acts at its centre of mass."
    )
    force: Newtons = Field(ge=0)
    direction: Annotated[str, BeforeValidator(_direction)] = Field(
        description="forward, backward, left, right, inward (towards the lifted foot), outward or an angle: "
        "0 deg is forward, 90 deg to the left."
    )
    duration: Seconds = Field(gt=0)
    height: Metres = Field(
        default=0.0,
        ge=-_HIGHEST_M,
        le=_HIGHEST_M,
        description="Where it acts: so far above the body's centre of mass, or below if negative.",
    )
    start: Start


class Fault(FileModel):
    """A force cell that fails, for a while or for the whole run."""

    cell: str = Field(description="Name of the force cell.")
    reading: Literal["missing", "zero"] = Field(description="Not a number, or zero.")
    start: Seconds = Field(default=0.0, ge=0)
    duration: Seconds | None = Field(default=None, gt=0, description="To the end of the run if absent.")


class SensorNoise(FileModel):
    """Standard deviations of white noise in what the controller reads."""

    force_cells: Newtons = Field(default=0.0, ge=0)
    com: Metres = Field(default=0.0, ge=0, description="Of each coordinate of the centre of mass.")
    com_velocity: MetresPerSecond = Field(default=0.0, ge=0, description="Of each part of its velocity.")


class Jitter(FileModel):
    """What differs from seed to seed beside the noise."""

    push_start: Seconds = Field(
        default=0.0, ge=0, description="Pushes begin up to this much earlier or later."
    )
    base_velocity: MetresPerSecond = Field(
        default=0.0, ge=0, description="Standard deviation of the torso's velocity at first."
    )


class Edges(FileModel):
    """Neurons that stand at the edges of a support polygon."""

    right: str
    left: str


class Thresholds(FileModel):
    """Neurons at whose half activation the ZMP counts as having crossed; for the plots and the verdict."""

    channel: str = Field(description="The circuit's input that they compare.")
    left_foot: Edges
    right_foot: Edges
    both_feet: Edges


class Scenario(FileModel):
    """A simulation."""

    scenario: str = Field(description="Name.")
    description: str = ""
    robot: str = Field(description="A shipped robot, or the path of a robot.yaml.")
    servo_profile: str | None = Field(
        default=None, description="A servo profile of the robot; its own if absent."
    )
    gait: str = Field(description="A shipped gait, or the path of a gait file.")
    controller: str = Field(
        default="circuit", description="open_loop, circuit, or the name or path of a controller file."
    )
    circuit: str = Field(description="The circuit of the controller named circuit: a shipped one or a path.")
    silenced: tuple[str, ...] = Field(
        default=(),
        description="Neurons or inputs of the circuit that send nothing, and connections that carry nothing, "
        "such as q1 or q1 -> p1; the thresholds stay those of the whole circuit.",
    )
    duration: Seconds = Field(gt=0, le=3600)
    pushes: tuple[Push, ...] = ()
    faults: tuple[Fault, ...] = ()
    sensor_noise: SensorNoise = SensorNoise()
    jitter: Jitter = Jitter()
    plant: Plant = Field(
        default=Plant(), description="How robot and floor differ from those that the walk is planned for."
    )
    sensor_delay: Seconds = Field(
        default=0.0, ge=0, description="What the controller reads is this old; whole control steps."
    )
    seed: int = Field(default=0, ge=0)
    thresholds: Thresholds

    _document: Document = PrivateAttr(default=Document("", None, {}))

    @model_validator(mode="after")
    def _pushes_end(self) -> Scenario:
        if late := [fault for fault in self.faults if fault.start >= self.duration]:
            message = f"the fault of {late[0].cell} starts after the end; allowed: before {self.duration:g} s"
            raise ValueError(message)
        return self

    def file(self, name: str) -> str:
        """A file that the scenario names, from the scenario's own folder if it is a relative path."""
        path = Path(name)
        beside = Path(self._document.path).parent / path
        return str(beside) if (path.suffix and not path.is_absolute() and beside.is_file()) else name

    @contextmanager
    def located(self, key: str) -> Iterator[None]:
        """Give complaints that belong to no file the line of this scenario that they are about.

        Args:
            key: What they are about if they do not say, such as `robot`.
        """
        try:
            yield
        except InputError as error:
            problems = (each if each.file else self._here(each, key) for each in error.problems)
            raise InputError(*problems) from error

    def _here(self, problem: Problem, key: str) -> Problem:
        where = problem.where or key
        place = next((place for place in self._document.marks if place_text(place) == where), (key,))
        return replace(self._document.problem(place, problem.message, problem.hint), where=where)


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario file.

    Args:
        name_or_path: A path, or the name of a shipped one such as `nao_push`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    document = read_yaml(find_data_file(name_or_path, _FOLDER))
    scenario = validate_model(document, Scenario)
    scenario._document = document  # the scenario's own factory
    return scenario


def parse_push(text: str, scenario: Scenario) -> Push:
    """Read `20N,200ms,inward`; body and start are those of the scenario's first push.

    Raises:
        InputError: The text cannot be read, or the scenario has no push to take the start from.
    """
    parts = [part.strip() for part in text.split(",")]
    wanted = "FORCE,DURATION,DIRECTION such as 20N,200ms,inward"
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
        if (
            quantity.dimension.si_symbol != parse_quantity(f"1 {unit}").dimension.si_symbol
            or quantity.value_si <= 0
        ):
            message = f"found '{part}'; allowed: more than 0, in a unit like {unit}"
            raise InputError(Problem("", 0, 0, f"--push: {key}", message))
        values.append(quantity.value_si)
    try:
        direction = str(_direction(parts[2]))
    except ValueError as error:
        raise InputError(Problem("", 0, 0, "--push: direction", str(error))) from error
    change = {"force": values[0], "duration": values[1], "direction": direction}
    return scenario.pushes[0].model_copy(update=change)
