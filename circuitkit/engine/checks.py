"""Whether arrays that a user hands in fit the program, with messages that say what would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit.memory import shortage
from circuitkit.engine.operations import FloatArray

_STEP_AXES = 2
_RUN_AXES = 3
_LARGEST_SEED = 2**64 - 1
_LITTLE = 2**26  # bytes, which every machine has


def input_problem(message: str) -> InputError:
    """Return the error for inputs that do not fit."""
    return InputError(Problem("", 0, 0, "inputs", message))


def require_batch(batch: int | None, members: int) -> int:
    """Return the size of a batch: at least 1, and in a sweep the number of its members.

    Raises:
        InputError: It is another one.
    """
    size = members or 1 if batch is None else batch
    if size < 1 or members not in {0, size}:
        allowed = f"{members}, the number of circuits of the sweep" if members else "whole numbers from 1"
        raise InputError(Problem("", 0, 0, "batch", f"found {size}; allowed: {allowed}"))
    return size


def require_memory(where: str, what: str, needed: float) -> None:
    """Refuse what needs more memory than the machine has.

    Args:
        where: What the user gave.
        what: What was found there.
        needed: What it needs, [bytes].

    Raises:
        InputError: It needs more.
    """
    complaint = shortage(what, needed) if needed > _LITTLE else ""
    if complaint:
        raise InputError(Problem("", 0, 0, where, complaint))


def require_seed(seed: int) -> None:
    """Require a whole number of 64 bits without a sign.

    Raises:
        InputError: It is another one.
    """
    if not (isinstance(seed, int | np.integer) and 0 <= seed <= _LARGEST_SEED):
        message = f"found {seed}; allowed: whole numbers from 0 to {_LARGEST_SEED}"
        raise InputError(Problem("", 0, 0, "seed", message))


def require_inputs(inputs: FloatArray, names: Sequence[str]) -> None:
    """Require an array of shape (B, n_inputs) or (T, B, n_inputs).

    Raises:
        InputError: It is none, or the shape is another one.
    """
    found: tuple[int, ...] = getattr(inputs, "shape", ())
    if len(found) not in {_STEP_AXES, _RUN_AXES} or found[-1] != len(names):
        message = f"found {_shown(inputs)}; allowed: {_wanted('B', names)} or {_wanted('T, B', names)}"
        raise input_problem(message)


def require_step_inputs(inputs: FloatArray, batch: int, names: Sequence[str]) -> None:
    """Require an array of shape (B, n_inputs) with the batch size B of the state.

    Raises:
        InputError: It is none, or the shape is another one.
    """
    if getattr(inputs, "shape", ()) != (batch, len(names)):
        message = f"found {_shown(inputs)}; allowed: {_wanted(str(batch), names)}"
        raise input_problem(message)


def as_run_inputs(inputs: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return the inputs as an array of shape (T, B, n_inputs).

    Raises:
        InputError: The shape is another one.
    """
    array = np.asarray(inputs, dtype=np.float64)
    if array.ndim != _RUN_AXES or array.shape[-1] != len(names):
        message = f"found {_shown(array)}; allowed: {_wanted('T, B', names)}"
        raise input_problem(message)
    return array


def _shown(inputs: object) -> str:
    shape = getattr(inputs, "shape", None)
    return f"{type(inputs).__name__}" if shape is None else f"shape {shape}"


def _wanted(leading: str, names: Sequence[str]) -> str:
    columns = f" with the columns {', '.join(names)}" if names else ""
    return f"an array of shape ({leading}, {len(names)}){columns}"
