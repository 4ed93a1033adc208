"""Whether arrays that a user hands in fit the program, with messages that say what would."""

from __future__ import annotations

import numpy as np

from circuitkit.engine.state import FloatArray
from circuitkit.errors import InputError, Problem

_STEP_AXES = 2
_RUN_AXES = 3


def input_problem(message: str) -> InputError:
    """The error for inputs that do not fit."""
    return InputError(Problem("", 0, 0, "inputs", message))


def require_batch(batch: int) -> None:
    """Require a batch size of at least 1.

    Raises:
        InputError: It is smaller.
    """
    if batch < 1:
        raise InputError(Problem("", 0, 0, "batch", f"found {batch}; allowed: whole numbers from 1"))


def require_inputs(inputs: FloatArray, names: tuple[str, ...]) -> None:
    """Require an array of shape (B, n_inputs) or (T, B, n_inputs).

    Raises:
        InputError: It is none, or the shape is another one.
    """
    found: tuple[int, ...] = getattr(inputs, "shape", ())
    if len(found) not in {_STEP_AXES, _RUN_AXES} or found[-1] != len(names):
        message = f"found {_shown(inputs)}; allowed: {_wanted('B', names)} or {_wanted('T, B', names)}"
        raise input_problem(message)


def require_step_inputs(inputs: FloatArray, batch: int, names: tuple[str, ...]) -> None:
    """Require an array of shape (B, n_inputs) with the batch size B of the state.

    Raises:
        InputError: It is none, or the shape is another one.
    """
    if getattr(inputs, "shape", ()) != (batch, len(names)):
        message = f"found {_shown(inputs)}; allowed: {_wanted(str(batch), names)}"
        raise input_problem(message)


def as_run_inputs(inputs: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """The inputs as an array of shape (T, B, n_inputs).

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


def _wanted(leading: str, names: tuple[str, ...]) -> str:
    columns = f" with the columns {', '.join(names)}" if names else ""
    return f"an array of shape ({leading}, {len(names)}){columns}"
