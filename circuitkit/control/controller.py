"""`Controller`: named channels in, named commands out, once a control step, for B robots at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

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
    that into an array of shape (B, n); `bind(interface)`, which is asked once before a run for the controller
    that runs; and `seed_noise(seeds)`, which is told after `reset` which seed each robot has, if something in
    the controller is random. A robot's commands must depend on what it reads itself and on its seed alone.

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
            Shape (B, m), SI units.
        """


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
