"""Up to which numbers a dense kernel serves: far from infinity the order of additions is rounding alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from circuitkit.engine.backends.dense_plan import BOUNDED, Layout, Stage, matrices
from circuitkit.engine.operations import Map, Operation, Sum
from circuitkit.engine.program import Program

_LIMITS = (1e100, 1e50, 1e25, 1e12, 1e6)
_ROOM = 1e-3  # part of the largest number that is never passed, in whatever order terms are added


def largest_start(program: Program, stages: Sequence[Stage], layout: Layout) -> float:
    """Find up to where the numbers at the beginning of a step may go for all in it to stay far from infinity.

    Then no order of additions makes a difference to what is finite. 0 if there is no such number, or if
    outputs without bounds follow from activations that a state may bring.
    """
    largest = _ROOM * float(np.finfo(program.precision).max)
    if not all(np.isfinite(matrix).all() for matrix in matrices(stages, layout, 1.0)):
        return 0.0
    if stages[0].outputs_first and not layout.is_bounded:
        return 0.0
    return next((x for x in _LIMITS if x * x < largest and _reach(program, stages, x) < largest), 0.0)


def accumulates(program: Program, limit: float) -> bool:
    """Check whether an output of the circuit adds to itself without bounds up to a limit."""
    first, stop = program.readout_rows
    for operation in program.after:
        if isinstance(operation, Map) and any(first <= row < stop for row in operation.rows.values()):
            ends = [operation.constants.get(name, np.array(np.inf)) for name in ("low", "high")]
            if any((np.abs(end) > limit).any() for end in ends):
                return True
    return False


def _reach(program: Program, stages: Sequence[Stage], start: float) -> float:
    """Bound all that a step computes from numbers up to `start`."""
    bounds: dict[int, float] = {}
    reached = start
    for stage in stages:
        bounds |= {target: bounds.get(source, start) for source, target in stage.copies}
        sums = {
            row: sum(abs(weight) * bounds.get(source, start) for source, weight in terms)
            for row, terms in stage.terms.items()
        }
        for cell in stage.cells:
            arguments = [abs(e.gain) * sums[e.row] + abs(e.constant) for e in cell.elements]
            values = [
                1.0 if e.function in BOUNDED else x for e, x in zip(cell.elements, arguments, strict=True)
            ]
            bounds[cell.target] = values[0] * values[-1] if cell.joint == "*" else sum(values)
            reached = max(reached, *arguments, bounds[cell.target])
        reached = max(reached, *sums.values(), 0.0)
    for operation in program.after:
        found = _after(operation, {row: bounds.get(row, start) for row in _read(operation)})
        bounds |= found
        reached = max(reached, *found.values(), 0.0)
    return reached


def _read(operation: Operation) -> set[int]:
    if isinstance(operation, Sum):
        return {*(operation.sources + operation.base).tolist(), *range(operation.start, operation.stop)}
    if isinstance(operation, Map):
        return {row + i for row in operation.rows.values() for i in range(operation.count)}
    return set()


def _after(operation: Operation, bounds: Mapping[int, float]) -> dict[int, float]:
    """Bound what an operation behind the stages writes: sums, and `clip(keep before + sum, low, high)`."""
    found: dict[int, float] = {}
    if isinstance(operation, Sum):
        weights = np.broadcast_to(operation.weights, operation.sources.shape).tolist()
        sources = (operation.sources + operation.base).tolist()
        for i in range(operation.stop - operation.start):
            part = range(int(operation.indptr[i]), int(operation.indptr[i + 1]))
            row = operation.start + i
            terms = [abs(weights[k]) * bounds[sources[k]] for k in part]
            found[row] = sum(terms, bounds[row] if operation.add else 0.0)
    elif isinstance(operation, Map):
        for i in range(operation.count):
            total = sum(bounds[row + i] for row in operation.rows.values())
            found |= {row + i: total for row, _ in operation.results}
    return found
