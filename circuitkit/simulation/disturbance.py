"""Disturbances: forces, and what befalls channels, commands, actuators and bodies; made before the loop.

A kind is a module in `disturbances`: a model of what the file says, and `act`, which adds hooks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, ValidationInfo, create_model, model_validator

from circuitkit.base.errors import InputError, Problem, UnitError
from circuitkit.base.registry import Registry
from circuitkit.base.source import FileModel, describe, unfilled
from circuitkit.base.units import parse_quantity
from circuitkit.robots import RobotModel
from circuitkit.simulation.effects import Effects
from circuitkit.simulation.reference import Reference


def _start(value: object, info: ValidationInfo) -> object:
    """A time in seconds, or a moment in the words of the reference."""
    if isinstance(value, Mapping):
        return dict(value)
    if (
        info.mode == "python"
        and isinstance(value, int | float)
        and not isinstance(value, bool)
        and value >= 0
    ):
        return float(value)
    try:
        quantity = parse_quantity(str(value))
        fits = not isinstance(value, bool) and quantity.dimension == parse_quantity("1 s").dimension
    except UnitError:
        fits = False
    if not fits or quantity.value_si < 0:
        message = f"found {describe(value)}; allowed: a time such as '5 s', or a moment of the reference"
        raise ValueError(message)
    return quantity.value_si


Start = Annotated[Any, AfterValidator(_start)]


class Disturbance(FileModel):
    """Base of all kinds of disturbances.

    Attributes:
        kind: The key in a scenario, as in `- push: {…}`.
        per_robot: Whether the robots of one batch may differ in it.
        early: Whether it acts before the others, since they depend on it.
    """

    kind: ClassVar[str]
    per_robot: ClassVar[bool] = False
    early: ClassVar[bool] = False

    def change(self, robot: RobotModel) -> None:
        """Change the compiled model, for the whole run.

        Raises:
            InputError: The model lacks a part; lists those it has. Its place is that within the settings.
        """

    @property
    def changes_model(self) -> bool:
        """Whether `change` does something."""
        return False

    @property
    def begins(self) -> Any:  # noqa: ANN401 - seconds, or a mapping
        """When it begins: seconds, or a moment in the words of the reference; None for the whole run."""
        return getattr(self, "start", None)

    def first_tick(self, effects: Effects, robot: int, where: str) -> int:  # noqa: ARG002 - for others
        """From which tick on a robot may do otherwise than one that it does not befall; 0 if not known.

        Asked of disturbances that are `per_robot`: robots with the same seed are the same before that tick,
        and one of them is simulated for all.

        Raises:
            InputError: It starts at no moment of the reference.
        """
        return 0

    def act(self, effects: Effects, robots: Sequence[int], where: str) -> None:
        """Add hooks.

        Args:
            effects: Takes them.
            robots: The robots of the batch that it befalls: all, unless `per_robot`.
            where: The place in the scenario, for complaints.

        Raises:
            InputError: It names what is not there, or starts at no moment of the reference.
        """


DISTURBANCES: Registry[Disturbance] = Registry(
    "disturbances", Disturbance, "circuitkit.simulation.disturbances"
)


class _OneOf(FileModel):
    """Base of an item of the list of disturbances: one kind with its settings."""

    @model_validator(mode="after")
    def _one(self) -> _OneOf:
        given = sorted(self.model_fields_set)
        if len(given) != 1 or getattr(self, given[0]) is None:
            found = f"found {', '.join(given)}" if given else "found nothing"
            message = f"{found}; allowed: one kind of disturbance, such as push: {{…}}"
            raise ValueError(message)
        return self

    @property
    def disturbance(self) -> Disturbance:
        """What it holds."""
        found: Disturbance = getattr(self, next(iter(self.model_fields_set)))
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the function that makes the class."""
        return unfilled, (item_class,), self.__getstate__()


@cache
def item_class() -> type[_OneOf]:
    """A model with a key for each kind of disturbance."""
    fields: dict[str, Any] = {
        kind: (made | None, Field(default=None, description=(made.__doc__ or kind).partition("\n")[0]))
        for kind, made in DISTURBANCES.kinds.items()
    }
    return create_model("Disturbance", __base__=_OneOf, **fields)


@dataclass(frozen=True)
class RunSpec:
    """What is special to one robot of a batch.

    Attributes:
        seed: Of everything random.
        disturbances: What befalls it; the robots of a batch differ only in kinds that are `per_robot`.
    """

    seed: int
    disturbances: tuple[Disturbance, ...] = ()


def draw_effects(
    specs: Sequence[RunSpec],
    robot: RobotModel,
    reference: Reference,
    ticks: int,
    step_s: float,
    observed: Sequence[str] = (),
    commanded: Sequence[str] = (),
) -> Effects:
    """Draw everything random, each robot from its own seed, so that a batch draws what a single robot does.

    Args:
        specs: One for each of the B robots.
        robot: What they are, as they are known.
        reference: Gives moments and directions.
        ticks: T.
        step_s: The control step.
        observed: The channels that the controller reads.
        commanded: The commands that it writes.

    Raises:
        InputError: A disturbance names what is not there, or starts at no moment of the reference; or the
            robots differ in one that befalls all of a batch.
    """
    effects = Effects(robot, reference, ticks, step_s, [spec.seed for spec in specs], observed, commanded)
    every = range(len(specs))
    shared = [(k, each) for k, each in enumerate(specs[0].disturbances) if not each.per_robot]
    for spec in specs[1:]:
        _require_the_same([each for _, each in shared], [e for e in spec.disturbances if not e.per_robot])
    for early in (True, False):
        for k, each in shared:
            if each.early is early:
                each.act(effects, every, f"disturbances[{k}].{each.kind}")
    for i, spec in enumerate(specs):
        for k, each in enumerate(spec.disturbances):
            if each.per_robot:
                where = f"disturbances[{k}].{each.kind}"
                each.act(effects, (i,), where)
                effects.own_tick[i] = min(effects.own_tick[i], each.first_tick(effects, i, where))
    for finish in effects.finishers:
        finish(effects)
    return effects


def _require_the_same(first: list[Disturbance], other: list[Disturbance]) -> None:
    """Refuse robots of one batch that differ in what befalls all of them."""
    if first != other:
        kinds = dict.fromkeys(
            each.kind for each in (*first, *other) if each not in first or each not in other
        )
        apart = ", ".join(kind for kind, made in DISTURBANCES.kinds.items() if made.per_robot)
        message = (
            f"robots of one batch differ in {', '.join(kinds) or 'their order'}; allowed: in {apart} only"
        )
        raise InputError(Problem("", 0, 0, "disturbances", message))
