"""Several circuits of one structure as one: their constants, weights and initial values side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import InputError, Problem
from circuitkit.engine.operations import Lowered, Map, Noise, Operation, Sum

_T = TypeVar("_T")


def side_by_side(circuits: Sequence[Lowered]) -> Lowered:
    """Return one circuit whose numbers have the batch as their last axis, wherever they differ.

    Raises:
        InputError: The circuits differ in more than numbers.
    """
    first = circuits[0]
    for field in fields(Lowered):
        if field.name not in {"before", "substep", "after", "initial", "state_names"}:
            _require_same([getattr(circuit, field.name) for circuit in circuits], field.name)
    return replace(
        first,
        initial=_stacked([circuit.initial for circuit in circuits], first.n_rows),
        before=_aligned([circuit.before for circuit in circuits]),
        substep=_aligned([circuit.substep for circuit in circuits]),
        after=_aligned([circuit.after for circuit in circuits]),
    )


def _aligned(parts: Sequence[Sequence[Operation]]) -> tuple[Operation, ...]:
    _require_same([len(part) for part in parts], "number of operations")
    return tuple(_joined(alike) for alike in zip(*parts, strict=True))


def _joined(alike: Sequence[Operation]) -> Operation:
    first = alike[0]
    _require_same([type(operation) for operation in alike], "operations")
    if isinstance(first, Sum):
        return _with_numbers(alike, first, {"weights": (lambda each: each.weights, len(first.sources))})
    if isinstance(first, Noise):
        count = first.stop - first.start
        return _with_numbers(alike, first, {"scale": (lambda each: each.scale, count)})
    if isinstance(first, Map):
        _require_same([tuple(each.constants) for each in alike if isinstance(each, Map)], "constants")
        constants = {
            name: _stacked([each.constants[name] for each in alike if isinstance(each, Map)], first.count)
            for name in first.constants
        }
        return replace(_with_numbers(alike, first, {}, ("constants",)), constants=constants)
    return _with_numbers(alike, first, {})


def _with_numbers(
    alike: Sequence[Any],
    first: _T,
    numbers: dict[str, tuple[Callable[[Any], npt.NDArray[np.float64]], int]],
    others: tuple[str, ...] = (),
) -> _T:
    """Return an operation with some fields put side by side; all the rest must be the same."""
    for field in fields(first):  # type: ignore[arg-type]  # all operations are dataclasses
        if field.name not in {*numbers, *others}:
            _require_same([getattr(each, field.name) for each in alike], field.name)
    stacked = {name: _stacked([get(each) for each in alike], n) for name, (get, n) in numbers.items()}
    return replace(first, **stacked)  # type: ignore[type-var]


def _stacked(values: Sequence[npt.NDArray[np.float64]], count: int) -> npt.NDArray[np.float64]:
    """Shape (count, B); as they are if they are all the same."""
    if all(_same(values[0], other) for other in values):
        return values[0]
    columns = [np.broadcast_to(value, (count,)) for value in values]
    stacked = np.stack(columns, axis=-1)
    stacked.flags.writeable = False
    return stacked


def _require_same(values: Sequence[Any], what: str) -> None:
    for number, value in enumerate(values):
        if not _same(value, values[0]):
            message = f"found other {what} in circuit {number} than in circuit 0"
            hint = "circuits of a sweep may differ in numbers alone"
            raise InputError(Problem("", 0, 0, "sweep", f"{message}; allowed: the same structure", hint))


def _same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one is other or (one.shape == other.shape and bool((one == other).all()))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    return bool(one == other)
