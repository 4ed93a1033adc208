"""From an operation of a program to numpy calls, bound to their arrays once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.engine.backends.numpy_expression import bind_expression
from circuitkit.engine.backends.numpy_sums import bind_sum
from circuitkit.engine.noise import NormalNumbers
from circuitkit.engine.operations import FloatArray, Map, Noise, Operation, Recall, Remember, Sum

Call: TypeAlias = Callable[[], object]


@dataclass(eq=False)
class Clock:
    """How many control steps and substeps have been done."""

    step: int = 0
    substep: int = 0

    def count_substep(self) -> None:
        """Count one more substep."""
        self.substep += 1


@dataclass(eq=False)
class Ring:
    """A memory: the values of the last `depth` times, of time t at place t modulo depth.

    Attributes:
        values: Shape (depth, n_slots, B).
        in_substeps: Whether it remembers every substep instead of every control step.
    """

    values: FloatArray
    in_substeps: bool

    def order(self, clock: Clock) -> npt.NDArray[np.intp]:
        """Return places of the values, the newest first, shape (depth,)."""
        depth = len(self.values)
        time = clock.substep if self.in_substeps else clock.step
        return (time - 1 - np.arange(depth)) % depth


@dataclass(eq=False)
class Workspace:
    """What operations work on.

    Attributes:
        table: Shape (n_rows, B).
        clock: The time.
        rings: Memories, by their number.
        normals: What draws the noise.
    """

    table: FloatArray
    clock: Clock = field(default_factory=Clock)
    rings: dict[int, Ring] = field(default_factory=dict)
    normals: list[NormalNumbers] = field(default_factory=list)


def bind_operation(operation: Operation, work: Workspace, *, in_substeps: bool) -> Iterator[Call]:
    """Bind the calls that do an operation."""
    match operation:
        case Sum():
            yield from bind_sum(operation, work.table)
        case Map():
            yield from _bind_map(operation, work.table)
        case Noise():
            yield _bind_noise(operation, work, in_substeps=in_substeps)
        case Recall():
            yield _bind_recall(operation, work)
        case Remember():
            yield _bind_remember(operation, work)


def _bind_noise(operation: Noise, work: Workspace, *, in_substeps: bool) -> Call:
    rows = work.table[operation.start : operation.stop]
    normals = NormalNumbers(operation.streams, rows.shape[1])
    work.normals.append(normals)
    scale = np.array(np.broadcast_to(_as_rows(operation.scale, *rows.shape), rows.shape), order="C")
    drawn, clock = np.empty_like(rows), work.clock

    def add_noise() -> None:
        normals.draw(clock.substep if in_substeps else clock.step)
        np.copyto(drawn, normals.values)
        np.multiply(drawn, scale, drawn)
        np.add(rows, drawn, rows)

    return add_noise


def _bind_recall(operation: Recall, work: Workspace) -> Call:
    ring, clock = work.rings[operation.memory], work.clock
    depth, n_slots, batch = ring.values.shape
    past = ring.values.reshape(depth * n_slots, batch)
    rows = work.table[operation.start : operation.stop]
    places = operation.slots.astype(np.intp) - operation.steps.astype(np.intp) * n_slots
    shifted = np.empty_like(places)

    def recall() -> None:
        time = clock.substep if ring.in_substeps else clock.step
        np.add(places, time % depth * n_slots, shifted)
        past.take(shifted, 0, rows, "wrap")

    return recall


def _bind_remember(operation: Remember, work: Workspace) -> Call:
    ring, clock, table = work.rings[operation.memory], work.clock, work.table
    sources, places = operation.sources.astype(np.intp), list(ring.values)

    def remember() -> None:
        time = clock.substep if ring.in_substeps else clock.step
        table.take(sources, 0, places[time % len(places)], "clip")

    return remember


def _bind_map(operation: Map, table: FloatArray) -> Iterator[Call]:
    count, batch = operation.count, table.shape[1]
    variables = {name: table[row : row + count] for name, row in operation.rows.items()}
    for name, pick in operation.picks.items():
        picked = np.empty((count, batch), dtype=table.dtype)
        variables[name] = picked
        yield partial(table.take, pick.astype(np.intp), 0, picked, "clip")
    constants = {name: _as_rows(value, count, batch) for name, value in operation.constants.items()}
    written = [table[row : row + count] for row, _ in operation.results]
    # With one result numpy itself may read and write the same rows; more need a place to wait.
    places = written if len(written) == 1 else [np.empty_like(rows) for rows in written]
    for place, (_, expression) in zip(places, operation.results, strict=True):
        yield from bind_expression(expression, constants, variables, place)
    if places is not written:
        for rows, place in zip(written, places, strict=True):
            yield partial(np.copyto, rows, place)


def _as_rows(values: FloatArray, count: int, batch: int) -> FloatArray:
    """Return constants of shape (), (count,) or (count, B) as (1, 1), (count, 1) or (count, B)."""
    if values.ndim == 1:
        return values[:, np.newaxis]
    return values if values.ndim else np.broadcast_to(values, (min(count, 1), min(batch, 1)))
