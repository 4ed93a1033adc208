"""`Controller`: named channels in, named commands out, once a control step, for B robots at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import describe
from circuitkit.base.units import Unit

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class PlannedChannel:
    """Something that a reference knows beforehand.

    Attributes:
        unit: SI unit.
        values: One a tick; shape (T,).
    """

    unit: Unit
    values: Array


@dataclass(frozen=True)
class Interface:
    """What a controller may know of a run beforehand.

    Attributes:
        observations: Channels of the robot that can be read, with their units.
        commands: Commands of the robot, with their units.
        step_s: The control step.
        planned: Channels of the reference.
        reference: What the reference tells controllers that are made for it; None if nothing.
    """

    observations: Mapping[str, Unit]
    commands: Mapping[str, Unit]
    step_s: float
    planned: Mapping[str, PlannedChannel] = field(default_factory=dict)
    reference: Any = None


@runtime_checkable
class Controller(Protocol):
    """Maps channels to commands once a control step.

    A controller may also have `trace_names`, what it records of itself, with `store_trace(row)`, which writes
    that into an array of shape (B, n), in which nothing is a number before; `bind(interface)`, which is asked
    once before a run for the controller that runs; `seed_noise(seeds)`, which is told after `reset` which
    seed each robot has, if something in the controller is random; and `backends`, the names of the backends
    that run its circuits, by the keys of `ControllerSpec.circuits`. A robot's commands must depend on what it
    reads itself and on its seed alone.

    Attributes:
        name: As the user calls it.
        observations: Channels that it reads, in order.
        commands: Commands that it writes, in order.
    """

    name: str
    observations: tuple[str, ...]
    commands: tuple[str, ...]

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""

    def step(self, observation: Array) -> Array:
        """Commands of this control step.

        Args:
            observation: Shape (B, k), SI units; readings that are missing are not numbers.

        Returns:
            Shape (B, m), SI units. What is not a number is no command: the last one is held, and then the
            scenario's `fallback` takes its place.
        """


PROTOCOL = (
    "a controller is an object with name, observations and commands (lists of names), reset(robots), and "
    "step(observation), which takes an array of shape (robots, observations) and returns one of shape "
    "(robots, commands)"
)
_NAMES = ("observations", "commands")
_CALLED = ("reset", "step")
_FLOAT = np.dtype(np.float64)
_TRACE, _STORE = "trace_names", "store_trace"  # which a controller may have


def require_instance(given: object) -> None:
    """Refuse a class in the place of an object of it, before anything of it is asked.

    Raises:
        InputError: It is one.
    """
    if isinstance(given, type):
        raise InputError(_problem(given, f"an object of it, such as {given.__name__}()"))


def require_controller(given: object) -> Controller:
    """Refuse what is no controller; the shape of its commands is seen in the first tick, by `checked_step`.

    Args:
        given: What shall control a run.

    Raises:
        InputError: It lacks something of the protocol, or has something else in its place; lists all that is
            wrong.
    """
    require_instance(given)
    missing = [key for key in ("name", *_NAMES, *_CALLED) if not hasattr(given, key)]
    problems = []
    if missing:
        allowed = "the name of a controller, a path, or an object with all of these"
        problems.append(_problem(given, allowed, without=missing))
    for key in (*_NAMES, _TRACE):
        found = getattr(given, key, ())
        example = f"('{found}',)" if isinstance(found, str) else "('yaw', 'speed')"
        if not isinstance(found, list | tuple):
            problems.append(_problem(found, f"a tuple of names, such as {example}", key))
        elif strange := [each for each in found if not isinstance(each, str)]:
            problems.append(_problem(strange[0], f"a tuple of names, such as {example}", key))
        elif len(set(found)) < len(found):
            problems.append(_problem(found, "each name once", key))
    if getattr(given, _TRACE, ()) and not hasattr(given, _STORE):
        problems.append(_problem(given, f"with {_TRACE}, also {_STORE}(row)", without=[_STORE]))
    there = (key for key in (*_CALLED, _STORE) if hasattr(given, key))
    called = (key for key in there if not callable(getattr(given, key)))
    problems += [_problem(getattr(given, key), "a method", key) for key in called]
    if not isinstance(name := getattr(given, "name", ""), str):
        problems.append(_problem(name, "a text", "name"))
    if problems:
        raise InputError(*problems)
    made: Controller = given  # type: ignore[assignment]  # it has all that the protocol asks for
    return made


def checked_step(controller: Controller, batch: int) -> Callable[[Array], Array]:
    """The controller's `step`, which refuses commands that are no array of numbers of shape (B, m).

    The controller gets a copy of what it observes: it may change or keep that, and the recording stays what
    it is.

    Args:
        controller: The controller.
        batch: B.
    """
    wanted = (batch, len(controller.commands))
    allowed = f"an array of numbers of shape {wanted}, a row for each robot and a column for each command"

    def step(observation: Array) -> Array:
        found = controller.step(observation.copy())
        if type(found) is np.ndarray and found.dtype is _FLOAT and found.shape == wanted:
            return found
        # What a mask hides would be sent.
        is_array = isinstance(found, np.ndarray) and not isinstance(found, np.ma.MaskedArray)
        if not is_array or found.shape != wanted or found.dtype.kind not in "fiu":
            raise InputError(_problem(found, allowed, f"'{controller.name}'.step"))
        if found.dtype.itemsize > _FLOAT.itemsize:
            with np.errstate(over="ignore"):  # what becomes infinite is no command
                return found.astype(np.float64)
        return found

    return step


def _problem(found: object, allowed: str, key: str = "", without: Sequence[str] = ()) -> Problem:
    lacking = f" without {', '.join(without)}" if without else ""
    message = f"found {describe(found)}{lacking}; allowed: {allowed}"
    return Problem("", 0, 0, f"controller.{key}".rstrip("."), message, PROTOCOL)


class OpenLoop:
    """Adds nothing to the reference."""

    name = "open_loop"
    observations: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._nothing = np.zeros((1, 0))

    def reset(self, batch: int) -> None:
        """Start again."""
        self._nothing = np.zeros((batch, 0))

    def step(self, observation: Array) -> Array:  # noqa: ARG002 - reads nothing
        """No commands; shape (B, 0)."""
        return self._nothing
