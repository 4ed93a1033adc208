"""`make_map`: a `Map` in which what depends on constants alone has been computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.operations import FloatArray, IndexArray, Map


def make_map(
    count: int,
    results: Sequence[tuple[int, Expression]],
    rows: Mapping[str, int],
    constants: Mapping[str, FloatArray] | None = None,
    picks: Mapping[str, IndexArray] | None = None,
) -> Map:
    """Make the operation that evaluates expressions side by side; see `Map` for the arguments."""
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
    """Return the operation that copies rows."""
    return Map(count, ((target, Name("x")),), {"x": source})


class _Folding:
    """Replaces every part of expressions that consists of constants by a constant of its own."""

    def __init__(self, constants: Mapping[str, FloatArray]) -> None:
        self.constants = dict(constants)
        self._known: dict[Expression, Name] = {}

    def fold(self, expression: Expression) -> Expression:
        if not isinstance(expression, Name | Number) and self._is_constant(expression):
            return self._constant(expression)
        match expression:
            case Unary(operator=sign, operand=operand):
                return self._chosen((operand,), lambda part: Unary(sign, part))
            case Binary(operator=joint, left=left, right=right):
                return self._chosen((left, right), lambda *parts: Binary(joint, *parts))
            case Call(function=function, arguments=arguments):
                return self._chosen(arguments, lambda *parts: Call(function, parts))
        return expression

    def _chosen(self, parts: Sequence[Expression], join: Callable[..., Expression]) -> Expression:
        """Turn a function of a choice between constants into a choice between its values.

        So the factor of an exponential step is computed once, also for a neuron that has another one while
        it is refractory.
        """
        folded = [self.fold(part) for part in parts]
        varying = [k for k, part in enumerate(folded) if not self._is_constant(part)]
        match [folded[k] for k in varying]:
            case [Call(function="where", arguments=(condition, *values))] if all(
                map(self._is_constant, values)
            ):
                (k,) = varying
                choices = (self.fold(join(*folded[:k], value, *folded[k + 1 :])) for value in values)
                return Call("where", (condition, *choices))
        return join(*folded)

    def _is_constant(self, expression: Expression) -> bool:
        return expression.names() <= self.constants.keys()

    def _constant(self, expression: Expression) -> Name:
        if expression not in self._known:
            with np.errstate(all="ignore"):
                value = np.asarray(expression.evaluate(self.constants, NUMPY_FUNCTIONS), dtype=np.float64)
            name = Name(f"folded_{len(self._known)}")
            self._known[expression], self.constants[name.name] = name, value
        return self._known[expression]
