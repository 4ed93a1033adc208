"""The robot file: an MJCF with named channels, which can be read, and commands, which can be written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Protocol

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    create_model,
    model_validator,
)

from circuitkit.base.errors import Problem, UnitError, UnknownNameError, warn_once
from circuitkit.base.reading import is_file
from circuitkit.base.registry import Registry
from circuitkit.base.source import (
    Document,
    FileModel,
    Place,
    files_by_name,
    path_of,
    read_yaml,
    shipped_file,
    unfilled,
    validate_model,
)
from circuitkit.base.source.fields import AnyQuantity, Damping, Effort, Reach, Seconds, Stiffness
from circuitkit.base.units import parse_quantity, parse_unit

FOLDER = "robots"
FILE_NAME = "robot.yaml"
TIME, ENDED = "t", "ended"
# Names that mean something else where channels and commands are named, as in measures.
RESERVED: Mapping[str, str] = {TIME: "the time", ENDED: "whether until ended the run"}
_SECOND = parse_unit("s").dimension


def _unit(text: str) -> str:
    try:
        parse_unit(text)
    except UnitError as error:
        raise ValueError(str(error)) from error
    return text


def _number_as_text(value: object) -> object:
    """A constant as the text of an expression."""
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


UnitText = Annotated[
    str,
    BeforeValidator(lambda value: "1" if value == 1 and value is not True else value),
    AfterValidator(_unit),
]


class _WithUnit(FileModel):
    """Something with a unit, and two values in it."""

    unit: UnitText = Field(description="Unit, such as rad/s.")
    description: str = ""

    def pair(self, name: str) -> tuple[float, float] | None:
        """Both ends of a range or of limits, [SI]."""
        ends = getattr(self, name)
        return None if ends is None else (parse_quantity(ends[0]).value_si, parse_quantity(ends[1]).value_si)

    def _require_pair(self, name: str) -> None:
        ends = self.pair(name)
        if ends is None:
            return
        texts = getattr(self, name)
        for text in texts:
            if (found := parse_quantity(text)).dimension != parse_unit(self.unit).dimension:
                message = (
                    f"{name}: found '{text}', which is {found.dimension}; allowed: a quantity in {self.unit}"
                )
                raise ValueError(message)
        if not ends[0] < ends[1]:
            message = f"{name}: found {texts[0]} and {texts[1]}; allowed: the lower end first"
            raise ValueError(message)


class ChannelSpec(_WithUnit):
    """A channel: something of the robot that can be read."""

    model_config = ConfigDict(populate_by_name=True)

    expression: Annotated[str, BeforeValidator(_number_as_text)] = Field(
        alias="is", description="Expression over the MJCF's parts, such as sensor(eye_left)."
    )
    range: tuple[AnyQuantity, AnyQuantity] | None = Field(
        default=None, description="What the sensor can show; readings are clipped to it."
    )

    @model_validator(mode="after")
    def _ordered(self) -> ChannelSpec:
        self._require_pair("range")
        return self


class CommandSpec(_WithUnit):
    """A command: something of the robot that can be written."""

    to: Mapping[str, float] = Field(
        min_length=1, description="Factor for each actuator: control = what is held + factor * SI value."
    )
    limits: tuple[AnyQuantity, AnyQuantity] | None = Field(
        default=None, description="The command is clipped to these."
    )
    rate: AnyQuantity | None = Field(
        default=None, description="By how much it may change in a second, such as 60 deg/s."
    )

    @model_validator(mode="after")
    def _ordered(self) -> CommandSpec:
        self._require_pair("limits")
        if self.rate is not None:
            found, wanted = parse_quantity(self.rate), parse_unit(self.unit).dimension.times(_SECOND, -1)
            if found.dimension != wanted or found.value_si <= 0:
                is_a = "" if found.value_si <= 0 else f", which is {found.dimension}"
                message = f"rate: found '{self.rate}'{is_a}; allowed: more than 0, in {self.unit}/s"
                raise ValueError(message)
        return self

    @property
    def rate_si(self) -> float | None:
        """By how much it may change in a second, [SI/s]."""
        return None if self.rate is None else parse_quantity(self.rate).value_si


class Servo(FileModel):
    """A position servo: torque = stiffness (target - angle) - damping * velocity, within +- torque.

    Of a slide all this is a force, a position and their units.
    """

    joints: tuple[str, ...] = Field(
        min_length=1, description="Names of joints, or beginnings or ends with a *."
    )
    stiffness: Stiffness = Field(description="In N*m/rad, of a slide in N/m.")
    damping: Damping = Field(description="In N*m*s/rad, of a slide in N*s/m.")
    torque: Effort = Field(description="Largest torque in N*m, of a slide the largest force in N.")
    reach: Reach | None = Field(
        default=None,
        description="How far beyond its joint's range a target may be, in rad, of a slide in m; not at "
        "all if absent.",
    )


class RobotBlock(Protocol):
    """A block of a robot file that a plug-in reads, such as one for legged machines.

    Attributes:
        kind: The key of the block.
    """

    kind: ClassVar[str]

    def prepare(self, mj: Any, robot: Robot) -> Any:  # noqa: ANN401 - MjSpec is not typed
        """Check the MJCF, and add sensors to the model.

        Args:
            mj: The MjSpec, to which it may add.
            robot: The robot file.

        Returns:
            What has `finish(model)`, which gives what the block brings once the model is compiled; see
            `RobotModel.blocks`.
        """


class BlockSpec(FileModel):
    """Base of the blocks of plug-ins."""


blocks: Registry[Any] = Registry("robot_blocks", BlockSpec)


class Robot(FileModel):
    """A robot: an MJCF as its author wrote it, with channels and commands.

    Blocks of plug-ins are further keys; see `robot_class`.
    """

    robot: str = Field(description="Name.")
    description: str = ""
    mjcf: str = Field(description="The model file, beside this one; nothing in it is changed.")
    timestep: Seconds | None = Field(default=None, gt=0, description="In the place of the MJCF's own.")
    integrator: Literal["Euler", "RK4", "implicit", "implicitfast"] | None = Field(
        default=None,
        description="In the place of the MJCF's own; implicit ones bear more damping in long steps.",
    )
    key: str | None = Field(default=None, description="Keyframe to start from.")
    hold: Mapping[str, AnyQuantity] = Field(
        default={}, description="Angle or position of joints, at the start and as target of their servos."
    )
    servos: tuple[Servo, ...] | Mapping[str, tuple[Servo, ...]] = Field(
        default=(),
        description="Position servos in the place of the MJCF's actuators; or sets of them by name.",
    )
    servo_profile: str | None = Field(default=None, description="The set of servos in use.")
    channels: Mapping[str, ChannelSpec] = Field(default={}, description="What can be read.")
    commands: Mapping[str, CommandSpec] = Field(default={}, description="What can be written.")

    _document: Document = PrivateAttr(default=Document("", None, {}))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the function that makes the class."""
        return unfilled, (robot_class,), self.__getstate__()

    @model_validator(mode="after")
    def _known_profile(self) -> Robot:
        if isinstance(self.servos, Mapping):
            if self.servo_profile is None and len(self.servos) != 1:
                message = f"servo_profile is missing; allowed: {', '.join(self.servos)}"
                raise ValueError(message)
            if self.servo_profile is not None and self.servo_profile not in self.servos:
                raise ValueError(str(self._unknown_profile(self.servo_profile)))
        return self

    @property
    def servos_in_use(self) -> tuple[Servo, ...]:
        """The servos of the profile in use."""
        if isinstance(self.servos, Mapping):
            return self.servos[self.servo_profile or next(iter(self.servos))]
        return self.servos

    def with_servos(self, profile: str | None) -> Robot:
        """The same robot with another servo profile; with its own if None.

        Raises:
            UnknownNameError: It has no such profile; lists those it has.
        """
        if profile is None:
            return self
        if not isinstance(self.servos, Mapping) or profile not in self.servos:
            raise self._unknown_profile(profile)
        return self.model_copy(update={"servo_profile": profile})

    def _unknown_profile(self, name: str) -> UnknownNameError:
        return UnknownNameError(
            "servo profile", name, self.servos if isinstance(self.servos, Mapping) else ()
        )

    def __getstate__(self) -> dict[Any, Any]:
        """Its state for another process, which may work in another folder: with its file's whole path."""
        state = super().__getstate__()
        if document := (state["__pydantic_private__"] or {}).get("_document"):
            path = document.path and str(Path(document.path).absolute())
            private = state["__pydantic_private__"] | {"_document": replace(document, path=path)}
            state = state | {"__pydantic_private__": private}
        return state

    @property
    def folder(self) -> Path:
        """Where its file lies."""
        return Path(self._document.path).parent

    @property
    def mjcf_path(self) -> Path:
        """Where the model file lies."""
        return self.folder / self.mjcf

    def problem(
        self,
        place: Place,
        message: str,
        hint: str = "",
        *,
        offset: int | None = None,
        at_key: bool = False,
    ) -> Problem:
        """A complaint about a part of the robot file; about the MJCF if the robot came from no file."""
        if not self._document.path:
            return Problem(str(self.mjcf_path), 1, 1, ".".join(map(str, place)), message, hint)
        return self._document.problem(place, message, hint, offset=offset, at_key=at_key)

    def warn(self, place: Place, message: str) -> None:
        """Say once that a part of the robot file is allowed, and will hardly do."""
        warn_once(str(self.problem(place, message)))

    @property
    def given_blocks(self) -> dict[str, Any]:
        """The blocks of plug-ins that the file has, by kind."""
        there = {kind: getattr(self, kind, None) for kind in blocks.kinds}
        return {kind: block for kind, block in there.items() if block is not None}


@cache
def robot_class() -> type[Robot]:
    """`Robot` with a key for the block of each plug-in."""
    fields: dict[str, Any] = {
        kind: (block | None, Field(default=None, description=(block.__doc__ or kind).partition("\n")[0]))
        for kind, block in blocks.kinds.items()
    }
    return create_model("Robot", __base__=Robot, **fields)


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with circuitkit."""
    return tuple(sorted(inner.partition("/")[0] for inner in files_by_name(FOLDER, f"*/{FILE_NAME}")))


def robot_path(name_or_path: str | Path) -> Path:
    """The path of a robot file.

    Raises:
        UnknownNameError: There is no shipped robot of this name; lists those there are.
        InputError: It is neither a name nor a path.
    """
    path = path_of(name_or_path, FOLDER)
    if is_file(path / FILE_NAME):
        return path / FILE_NAME
    if path.suffix or len(path.parts) != 1:
        return path
    found = shipped_file(FOLDER, f"{path.name}/{FILE_NAME}")
    if found is None:
        kind = "robot (a path to a robot.yaml is allowed as well)"
        raise UnknownNameError(kind, path.name, shipped_robots())
    return found


def load_robot(name_or_path: str | Path) -> Robot:
    """Read a robot file.

    Args:
        name_or_path: A path to a `robot.yaml`, or the name of a shipped robot such as `vehicle`.

    Raises:
        InputError: It cannot be read; says where and why.
    """
    document = read_yaml(robot_path(name_or_path))
    robot = validate_model(document, robot_class())
    robot._document = document  # the robot's own factory
    return robot
