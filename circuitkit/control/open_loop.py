"""No feedback: what the reference wants, and nothing else."""

from __future__ import annotations

import numpy as np

from circuitkit.control.controller import Array


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
