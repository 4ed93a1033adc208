"""`Controller`: named channels in, named channels out, once a control step, for B robots at once."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Controller(Protocol):
    """Adds commands to a walk.

    Attributes:
        name: As the user calls it.
        observations: Channels that it reads, in order.
        commands: Channels that it writes, in order.
        trace_names: What it records of itself, in order; may be nothing.
    """

    name: str
    observations: tuple[str, ...]
    commands: tuple[str, ...]
    trace_names: tuple[str, ...]

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""

    def step(self, observation: Array, trace: Array) -> Array:
        """Commands of this control step.

        Args:
            observation: Shape (B, k), SI units; readings that are missing are not numbers.
            trace: Takes what the controller records of itself, shape (B, n).

        Returns:
            Shape (B, m), SI units.
        """
