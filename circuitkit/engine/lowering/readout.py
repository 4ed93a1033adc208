"""The outputs of the circuit: sums over neurons, with a leak and limits where they have them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name
from circuitkit.circuit.graph import OutputNode
from circuitkit.engine.lowering.maps import make_map
from circuitkit.engine.lowering.plan import Plan
from circuitkit.engine.lowering.sums import list_sum
from circuitkit.engine.operations import Operation, Sum

_SUM, _BEFORE, _KEEP, _LOW, _HIGH = (Name(name) for name in ("sum", "before", "keep", "low", "high"))


def read_out(plan: Plan, start: int) -> Iterator[Operation]:
    """`y' = clip(keep y + r, low, high)` for all outputs, in the rows from `start`."""
    row = start
    for is_plain, nodes in groupby(plan.graph.outputs, key=lambda node: _kind(node) == (False, False)):
        outputs = list(nodes)
        total = row if is_plain else plan.table.take(len(outputs))
        yield _weighted(plan, outputs, total)
        for kind, alike in groupby(outputs, key=_kind):
            part = list(alike)
            if any(kind):
                yield _accumulated(part, kind, total, row)
            total, row = total + len(part), row + len(part)


def _kind(node: OutputNode) -> tuple[bool, bool]:
    """Check whether it integrates, and whether it has limits."""
    return node.leak is not None, bool(np.isfinite(node.low) or np.isfinite(node.high))


def _weighted(plan: Plan, outputs: list[OutputNode], start: int) -> Sum:
    sources: list[npt.NDArray[Any]] = []
    weights: list[npt.NDArray[Any]] = []
    lengths = []
    for output in outputs:
        length = 0
        for name, weight in output.readout:
            block, member = plan.find(name)
            rows = block.output + (np.arange(block.size) if name == block.node.name else np.array([member]))
            sources.append(rows)
            weights.append(np.broadcast_to(np.asarray(weight, dtype=np.float64), rows.shape))
            length += len(rows)
        lengths.append(length)
    return list_sum(start, lengths, np.concatenate([[], *sources]), np.concatenate([[], *weights]))


def _accumulated(outputs: list[OutputNode], kind: tuple[bool, bool], total: int, row: int) -> Operation:
    integrates, is_limited = kind
    value: Expression = _SUM
    if integrates:
        value = Binary("+", Binary("*", _KEEP, _BEFORE), value)
    if is_limited:
        value = Call("min", (Call("max", (value, _LOW)), _HIGH))
    constants = {
        _KEEP.name: np.array([1.0 - (node.leak or 0.0) for node in outputs]),
        _LOW.name: np.array([node.low for node in outputs]),
        _HIGH.name: np.array([node.high for node in outputs]),
    }
    rows = {_SUM.name: total, _BEFORE.name: row}
    return make_map(len(outputs), [(row, value)], rows, constants)
