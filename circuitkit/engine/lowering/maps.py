"""`make_map`: a `Map` in which what depends on constants alone has been computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.operations import IndexArray, Map
from circuitkit.engine.state import FloatArray


def make_map(
    count: int,
    results: Sequence[tuple[int, Expression]],
    rows: Mapping[str, int],
    constants: Mapping[str, FloatArray] | None = None,
    picks: Mapping[str, IndexArray] | None = None,
) -> Map:
    """The operation that evaluates expressions side by side; see `Map` for the arguments."""
    folding = _Folding(constants or {})
    folded = tuple((row, folding.fold(expression)) for row, expression in results)
    used = frozenset[str]().union(*(expression.names() for _, expression in folded))
    return Map(
        count,
        folded,
        {name: row for name, row in rows.items() if name in used},
        {name: pick for name, pick in (picks or {}).items() if name in used},
        {name: value for name, value in folding.constants.items() if name in used},
    )


def copy_rows(count: int, source: int, target: int) -> Map:
    """The operation that copies rows."""
    return Map(count, ((target, Name("x")),), {"x": source})


class _Folding:
    """Replaces every part of expressions that consists of constants by a constant of its own."""

    def __init__(self, constants: Mapping[str, FloatArray]) -> None:
        self.constants = dict(constants)
        self._known: dict[Expression, Name] = {}

    def fold(self, expression: Expression) -> Expression:
        if not isinstance(expression, Name | Number) and expression.names() <= self.constants.keys():
            return self._constant(expression)
        match expression:
            case Unary(operator=sign, operand=operand):
                return Unary(sign, self.fold(operand))
            case Binary(operator=joint, left=left, right=right):
                return Binary(joint, self.fold(left), self.fold(right))
            case Call(function=function, arguments=arguments):
                return Call(function, tuple(self.fold(argument) for argument in arguments))
        return expression

    def _constant(self, expression: Expression) -> Name:
        if expression not in self._known:
            with np.errstate(all="ignore"):
                value = np.asarray(expression.evaluate(self.constants, NUMPY_FUNCTIONS), dtype=np.float64)
            name = Name(f"folded_{len(self._known)}")
            self._known[expression], self.constants[name.name] = name, value
        return self._known[expression]
