"""From an `Expression` to ufunc calls: walks the tree once and binds every operation to its arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.special import expit, exprel

from circuitkit.circuit.expressions.expression import COMPARISONS, Binary, Call, Expression, Name, Unary
from circuitkit.engine.operations import FloatArray

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
    "atan2": (np.arctan2, ()),
    "clip": (_clip, ()),
    "cos": (np.cos, ()),
    "exp": (np.exp, ()),
    "expm1": (np.expm1, ()),
    "exprel": (exprel, ()),
    "floor": (np.floor, ()),
    "heaviside": (np.heaviside, (1.0,)),
    "hypot": (np.hypot, ()),
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
_LARGE = 2048  # numbers from which it is quicker to spread a constant than to read one for each
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
    """Bind operations that write the value of an expression into `target`, without allocating anything.

    Args:
        expression: The tree.
        constants: Arrays that broadcast to the shape of `target` and stay; what depends on them alone is
            computed once, here.
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
        if not self._changes(expression):
            self.operations.append(partial(np.copyto, target, self._operand(expression, target)))
            return
        match expression:
            case Unary(operator=sign, operand=inner):
                self._bind(_SIGN[sign], (inner,), (), target)
            case Binary(operator=joint) if joint in COMPARISONS:
                self.operations.append(partial(np.copyto, target, self._condition(expression, target)))
            case Binary(operator=joint, left=left, right=right):
                self._bind(_BINARY[joint], (left, right), (), target)
            case Call(function="sigmoid", arguments=(argument,)):
                self._write_sigmoid(argument, target)
            case Call(function="clip", arguments=(x, low, high)):
                self.write(Call("min", (Call("max", (x, low)), high)), target)
            case Call(function="where", arguments=(condition, then, otherwise)):
                self._write_choice(condition, then, otherwise, target)
            case Call(function=function, arguments=arguments):
                ufunc, more = _FUNCTIONS[function]
                self._bind(ufunc, arguments, more, target)
            case _:
                self.operations.append(partial(np.copyto, target, self._operand(expression, target)))

    def _write_sigmoid(self, argument: Expression, target: FloatArray) -> None:
        """1 / (1 + exp(-x)): unlike expit, numpy's exp is vectorised, with the same bits for any size."""
        one = np.ones(target.shape if target.size < _LARGE else (), dtype=target.dtype)
        self.write(_negative(argument), target)
        self.operations += [
            partial(np.exp, target, target),
            partial(np.add, target, one, target),
            partial(np.divide, one, target, target),
        ]

    def _write_choice(
        self, condition: Expression, then: Expression, otherwise: Expression, target: FloatArray
    ) -> None:
        chosen, others = self._operand(then, target), self._operand(otherwise, target)
        holds = self._condition(condition, target)
        if chosen is target:  # in place: what is not chosen is what moves
            self.operations.append(partial(np.logical_not, holds, holds))
            chosen, others = others, chosen
        if others is not target:
            self.operations.append(partial(np.copyto, target, others))
        self.operations.append(partial(np.copyto, target, chosen, where=holds))

    def _condition(self, expression: Expression, like: FloatArray) -> npt.NDArray[np.bool_]:
        """Find where a condition holds."""
        holds = np.zeros(like.shape, dtype=np.bool_)
        match expression:
            case Binary(operator=joint, left=left, right=right) if joint in COMPARISONS:
                operands = (self._operand(left, like), self._operand(right, like))
                self.operations.append(partial(_BINARY[joint], *operands, holds))
            case _:
                zero = np.zeros((), dtype=like.dtype)
                self.operations.append(partial(np.not_equal, self._operand(expression, like), zero, holds))
        return holds

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
        """Return the array in which the value of an operand stands; a new one unless it exists already."""
        if not self._changes(expression):
            with np.errstate(all="ignore"):
                value = np.asarray(expression.evaluate(self._constants, NUMPY_FUNCTIONS), dtype=like.dtype)
            if like.size >= _LARGE and value.size == 1:
                return value.reshape(())  # numpy would set up buffers to spread a column of numbers
            return np.array(np.broadcast_to(value, like.shape), order="C")
        if isinstance(expression, Name):
            return self._variables[expression.name]
        own = np.empty_like(like)
        self.write(expression, own)
        return own

    def _changes(self, expression: Expression) -> bool:
        return not expression.names().isdisjoint(self._variables)


def _negative(expression: Expression) -> Expression:
    """Return the negative of an expression, by an operation that it has already if that changes no bit."""
    match expression:
        case Unary(operator="-", operand=operand):
            return operand
        case Binary(operator="-", left=left, right=right):
            return Binary("-", right, left)
        case Binary(operator="*" as joint, left=left, right=Binary(operator="-") as right):
            return Binary(joint, left, _negative(right))
    return Unary("-", expression)
