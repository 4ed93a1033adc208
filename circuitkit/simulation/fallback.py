"""What is sent while a controller gives no command: the last one, and after a while a fallback."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from circuitkit.control import Array
from circuitkit.robots import TickLog

FallbackKind = Literal["hold", "zero", "open_loop"]
_ROUNDING = 1e-9  # of a control step
_FEW = 32  # commands that Python adds sooner than numpy


@dataclass(frozen=True)
class Fallback:
    """What takes the place of commands that do not come.

    Attributes:
        kind: `hold`: the last command on and on; `zero`: the command is zero; `open_loop`: all commands of
            that robot are zero, so that the reference is alone.
        after_s: How long the last command is held before.
    """

    kind: FallbackKind = "hold"
    after_s: float = 0.1


class MissingCommands:
    """Finds what is no command, which is all that is not finite, and sends something else.

    Attributes:
        held: When the last command was sent again, by command.
        replaced: When the fallback took its place.
    """

    def __init__(self, fallback: Fallback, names: Sequence[str], batch: int, step_s: float) -> None:
        """Begin with zero as the last command.

        Args:
            fallback: What takes the place of commands that do not come.
            names: The commands.
            batch: B.
            step_s: The control step.
        """
        self.held, self.replaced = TickLog(names), TickLog(names)
        self._kind = fallback.kind
        self._patience = math.inf if fallback.kind == "hold" else self._ticks(fallback.after_s, step_s)
        self._last = np.zeros((batch, len(names)))
        self._waited: NDArray[np.int64] | None = None  # ticks since the last command; None: all are there

    @staticmethod
    def _ticks(time_s: float, step_s: float) -> int:
        return math.ceil(time_s / step_s - _ROUNDING)

    def __call__(self, tick: int, commands: Array, still: NDArray[np.bool_] | None) -> None:
        """Replace what is no command, in place.

        Args:
            tick: Which one.
            commands: Shape (B, m); is kept until the next call.
            still: For whom time stands still, so that nothing is noted; None for nobody.
        """
        # One sum for all of them, which is finite where every command is; Python's is quick for some.
        total = sum(commands.ravel().tolist()) if commands.size <= _FEW else np.vdot(commands, commands)
        if math.isfinite(total):
            self._waited = None
        else:
            self._replace(tick, commands, still)
        self._last = commands

    def _replace(self, tick: int, commands: Array, still: NDArray[np.bool_] | None) -> None:
        gone = ~np.isfinite(commands)
        before = np.zeros(gone.shape, dtype=np.int64) if self._waited is None else self._waited
        self._waited = np.where(gone, before + 1, 0)
        replaced = self._waited > self._patience
        if self._kind == "open_loop":
            replaced |= replaced.any(axis=1, keepdims=True)
        np.copyto(commands, self._last, where=gone)
        commands[replaced] = 0.0
        if still is not None:
            gone[still] = replaced[still] = False
        held = gone & ~replaced
        if held.any():
            self.held.add(tick, held)
        if replaced.any():
            self.replaced.add(tick, replaced)
