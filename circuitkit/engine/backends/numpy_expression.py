"""From an `Expression` to ufunc calls: walks the tree once and binds every operation to its arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from scipy.special import expit, exprel

from circuitkit.circuit.expression import Binary, Call, Expression, Name, Unary
from circuitkit.engine.state import FloatArray

Operation: TypeAlias = Callable[[], object]

_BINARY: Mapping[str, np.ufunc] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.true_divide,
    "**": np.power,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
}
_SIGN: Mapping[str, np.ufunc] = {"-": np.negative, "+": np.positive}


def _clip(x: FloatArray, low: FloatArray, high: FloatArray, out: FloatArray | None = None) -> FloatArray:
    clipped: FloatArray = np.minimum(np.maximum(x, low), high, out=out)
    return clipped


def _where(
    condition: FloatArray, then: FloatArray, otherwise: FloatArray, out: FloatArray | None = None
) -> FloatArray:
    chosen: FloatArray = np.where(condition, then, otherwise)
    if out is None:
        return chosen
    np.copyto(out, chosen)
    return out


# Each function with the arguments that follow those of the expression.
_FUNCTIONS: Mapping[str, tuple[Callable[..., Any], tuple[float, ...]]] = {
    "abs": (np.absolute, ()),
    "clip": (_clip, ()),
    "cos": (np.cos, ()),
    "exp": (np.exp, ()),
    "expm1": (np.expm1, ()),
    "exprel": (exprel, ()),
    "floor": (np.floor, ()),
    "heaviside": (np.heaviside, (1.0,)),
    "log": (np.log, ()),
    "log1p": (np.log1p, ()),
    "max": (np.maximum, ()),
    "min": (np.minimum, ()),
    "sigmoid": (expit, ()),
    "sign": (np.sign, ()),
    "sin": (np.sin, ()),
    "sqrt": (np.sqrt, ()),
    "tanh": (np.tanh, ()),
    "where": (_where, ()),
}
_OUT_BY_NAME = frozenset({np.maximum, np.minimum})  # numpy 2.4 warns of a third argument without a name
NUMPY_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    name: (lambda *arguments, _ufunc=ufunc, _more=more: _ufunc(*arguments, *_more))
    for name, (ufunc, more) in _FUNCTIONS.items()
}


def bind_expression(
    expression: Expression,
    constants: Mapping[str, FloatArray],
    variables: Mapping[str, FloatArray],
    target: FloatArray,
) -> list[Operation]:
    """Operations that write the value of an expression into `target`, without allocating anything.

    Args:
        expression: The tree.
        constants: Arrays of the shape of `target` that stay; what depends on them alone is computed once,
            here.
        variables: Arrays of the shape of `target` that change between calls; `target` may be among them.
        target: Where the value goes.
    """
    binder = _Binder(constants, variables)
    binder.write(expression, target)
    return binder.operations


class _Binder:
    """Collects operations, those of the operands before those that use them."""

    def __init__(self, constants: Mapping[str, FloatArray], variables: Mapping[str, FloatArray]) -> None:
        self.operations: list[Operation] = []
        self._constants = constants
        self._variables = variables

    def write(self, expression: Expression, target: FloatArray) -> None:
        """Have the value of an expression stand in `target` after the operations so far."""
        match expression:
            case Unary(operator=sign, operand=inner) if self._changes(expression):
                self._bind(_SIGN[sign], (inner,), (), target)
            case Binary(operator=joint, left=left, right=right) if self._changes(expression):
                self._bind(_BINARY[joint], (left, right), (), target)
            case Call(function=function, arguments=arguments) if self._changes(expression):
                ufunc, more = _FUNCTIONS[function]
                self._bind(ufunc, arguments, more, target)
            case _:
                self.operations.append(partial(np.copyto, target, self._operand(expression, target)))

    def _bind(
        self,
        ufunc: Callable[..., Any],
        arguments: tuple[Expression, ...],
        more: tuple[float, ...],
        target: FloatArray,
    ) -> None:
        operands = [self._operand(argument, target) for argument in arguments]
        if ufunc in _OUT_BY_NAME:
            self.operations.append(partial(ufunc, *operands, *more, out=target))
        else:  # a third of the call's time less
            self.operations.append(partial(ufunc, *operands, *more, target))

    def _operand(self, expression: Expression, like: FloatArray) -> FloatArray:
        """The array in which the value of an operand stands; a new one unless it exists already."""
        if not self._changes(expression):
            with np.errstate(all="ignore"):
                value = np.asarray(expression.evaluate(self._constants, NUMPY_FUNCTIONS), dtype=np.float64)
            return np.array(np.broadcast_to(value, like.shape), order="C")
        if isinstance(expression, Name):
            return self._variables[expression.name]
        own = np.empty_like(like)
        self.write(expression, own)
        return own

    def _changes(self, expression: Expression) -> bool:
        return not expression.names().isdisjoint(self._variables)
