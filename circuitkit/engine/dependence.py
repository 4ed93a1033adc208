"""What a circuit's inputs reach: every number of its state and every output that depends on some of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Expression, Name
from circuitkit.engine.operations import Map, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program
from circuitkit.engine.state import State

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Dependence:
    """What depends on some inputs of a circuit, now or ever.

    Attributes:
        outputs: Which outputs of the circuit; shape (n_outputs,).
        state: Which columns of each array of a state, in the order of `State.arrays`.
    """

    outputs: Flags
    state: tuple[Flags, ...]

    def put_back(self, robots: Flags, before: State, after: State) -> None:
        """Let what depends on the inputs be again what it was, for some members of the batch.

        Args:
            robots: Which members; shape (B,).
            before: What it was.
            after: Is changed in place.
        """
        for columns, old, new in zip(self.state, before.arrays(), after.arrays(), strict=True):
            if columns.any():
                chosen = (robots.reshape(-1, *[1] * (new.ndim - 1))) & columns
                np.copyto(new, old, where=chosen)


def dependence(program: Program, inputs: Flags) -> Dependence:
    """Follow some inputs through all operations of a step, and from step to step.

    A row depends on those that its operation reads, but for those that a weight of 0 takes out.
    Rows are never used twice, so once a row depends on an input it always does.

    Args:
        program: The circuit.
        inputs: Which inputs; shape (n_inputs,).
    """
    rows = np.zeros(program.n_rows, dtype=bool)
    rows[1 : 1 + len(inputs)] = inputs
    slots = [np.zeros(len(memory.sources), dtype=bool) for memory in program.memories]
    known = -1
    while known != (known := int(rows.sum()) + sum(int(each.sum()) for each in slots)):
        for operation in program.operations:
            _follow(operation, rows, slots)
    return Dependence(
        outputs=rows[slice(*program.readout_rows)],
        state=(
            rows[program.activation_rows],
            rows[program.output_rows],
            rows[slice(*program.readout_rows)],
            rows[program.state_rows],
            *slots,
        ),
    )


def _follow(operation: Operation, rows: Flags, slots: list[Flags]) -> None:
    """Mark what an operation writes from rows that are marked."""
    if isinstance(operation, Sum):
        weighs = np.asarray(operation.weights) != 0
        counts = weighs if weighs.ndim <= 1 else weighs.any(axis=1)
        terms = rows[operation.base + operation.sources] & counts
        targets = np.repeat(np.arange(operation.start, operation.stop), np.diff(operation.indptr))
        rows[targets[terms]] = True
    elif isinstance(operation, Map):
        found = [(target, _any_of(operation, expression, rows)) for target, expression in operation.results]
        for target, marked in found:
            rows[target : target + operation.count] |= marked
    elif isinstance(operation, Recall):
        rows[operation.start : operation.stop] |= slots[operation.memory][operation.slots]
    elif isinstance(operation, Remember):
        slots[operation.memory] |= rows[operation.sources]


def _any_of(operation: Map, expression: Expression, rows: Flags) -> Flags:
    """For which i an expression reads a row that is marked; shape (count,)."""
    marked = np.zeros(operation.count, dtype=bool)
    for name in expression.names():
        if name in operation.rows:
            marked |= rows[operation.rows[name] : operation.rows[name] + operation.count]
        elif name in operation.picks:
            marked |= rows[operation.picks[name]]
    return marked & ~_always_zero(operation, expression)


def _always_zero(operation: Map, expression: Expression) -> Flags:
    """For which i an expression is a product with a constant 0, such as a weight; shape (count,)."""
    match expression:
        case Name(name=name) if name in operation.constants:
            is_zero = np.asarray(operation.constants[name]) == 0
            return np.broadcast_to(is_zero if is_zero.ndim <= 1 else is_zero.all(axis=1), operation.count)
        case Binary(operator="*", left=left, right=right):
            return _always_zero(operation, left) | _always_zero(operation, right)
    return np.zeros(operation.count, dtype=bool)
