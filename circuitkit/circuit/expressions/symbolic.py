"""Calculus on expressions: derivatives, substitution, and as much simplification as these need."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache

from circuitkit.circuit.expressions.expression import (
    COMPARISONS,
    SCALAR_FUNCTIONS,
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)

_ZERO, _ONE = Number(0.0), Number(1.0)
_NEAR_ZERO = Number(3e-4)  # below it, three terms of the series of exprel' are nearer than its closed form


def derivative(expression: Expression, name: str) -> Expression:
    """Return the partial derivative with respect to a name, simplified.

    Functions with steps or kinks have theirs almost everywhere: that of `heaviside`, `sign`, `floor` and of
    comparisons is zero, at a kink of `abs`, `clip`, `max`, `min` or `where` it is the one of one side.

    Args:
        expression: The expression.
        name: The name; all others are held.
    """
    return simplify(_derivative(expression, name))


def substitute(expression: Expression, replacements: Mapping[str, Expression]) -> Expression:
    """Return the expression with every name that has a replacement replaced, all at once."""
    match expression:
        case Name(name=name):
            return replacements.get(name, expression)
        case Unary(operator=sign, operand=operand):
            return Unary(sign, substitute(operand, replacements))
        case Binary(operator=joint, left=left, right=right):
            return Binary(joint, substitute(left, replacements), substitute(right, replacements))
        case Call(function=function, arguments=arguments):
            return Call(function, tuple(substitute(argument, replacements) for argument in arguments))
    return expression


@lru_cache(maxsize=4096)
def simplify(expression: Expression) -> Expression:
    """Give an expression of the same value, wherever that is finite, without needless constants, 0 and 1.

    As in the mathematics of real numbers, zero has no sign: `-0` becomes 0. Of all functions only `atan2`
    tells the two apart, where its first argument is zero and the second one is zero or negative.
    """
    match expression:
        case Unary(operator=sign, operand=operand):
            return _sign(sign, simplify(operand))
        case Binary(operator=joint, left=left, right=right):
            return _binary(Binary(joint, simplify(left), simplify(right)))
        case Call(function=function, arguments=arguments):
            return _call(Call(function, tuple(simplify(argument) for argument in arguments)))
    return expression


def constant(expression: Expression) -> float | None:
    """Return the value of a number, with its signs; None for anything else."""
    match expression:
        case Number(value=number):
            return number
        case Unary(operator=sign, operand=operand) if (inner := constant(operand)) is not None:
            return -inner if sign == "-" else inner
    return None


def _number(value: float) -> Expression:
    """Return a number as the parser has it: negative ones are a sign and a number."""
    return Number(abs(value)) if value >= 0 else Unary("-", Number(-value))


def _computed(expression: Expression) -> Expression:
    """Return the value of an expression without names, if it has one."""
    try:
        value = expression.evaluate({})
    except (ArithmeticError, ValueError):
        return expression
    return _number(float(value)) if isinstance(value, float) and math.isfinite(value) else expression


def _sign(sign: str, operand: Expression) -> Expression:
    match sign, operand:
        case "+", _:
            return operand
        case _, Unary(operator="-", operand=inner):
            return inner
        case _, Number(value=0.0):
            return operand
    return Unary(sign, operand)


def _binary(expression: Binary) -> Expression:
    left, right = constant(expression.left), constant(expression.right)
    if left is not None and right is not None:
        return _computed(expression)
    if left is not None and (found := _with_left(expression, left)) is not None:
        return found
    if right is not None and (found := _with_right(expression, right)) is not None:
        return found
    return _without_inner_sign(expression)


def _with_left(expression: Binary, left: float) -> Expression | None:
    """Find what is left of it if its left operand is a special number."""
    match expression.operator, left:
        case ("+", 0.0) | ("*", 1.0):
            return expression.right
        case ("-", 0.0) | ("*", -1.0):
            return _sign("-", expression.right)
        case "*" | "/", 0.0:
            return _ZERO
    return None


def _with_right(expression: Binary, right: float) -> Expression | None:
    """Find what is left of it if its right operand is a special number."""
    match expression.operator, right:
        case ("+" | "-", 0.0) | ("*" | "/" | "**", 1.0):
            return expression.left
        case "*" | "/", -1.0:
            return _sign("-", expression.left)
        case "*", 0.0:
            return _ZERO
        case "**", 0.0:
            return _ONE
    return None


def _without_inner_sign(expression: Binary) -> Expression:
    """`a + -b` as `a - b`, `a - -b` as `a + b`, and signs of factors in front of their product."""
    match expression:
        case Binary(operator="+" | "-" as joint, left=left, right=Unary(operator="-", operand=inner)):
            return Binary("-" if joint == "+" else "+", left, inner)
        case Binary(operator="*" | "/" as joint, left=Unary(operator="-", operand=inner), right=right):
            return _sign("-", _binary(Binary(joint, inner, right)))
        case Binary(operator="*" | "/" as joint, left=left, right=Unary(operator="-", operand=inner)):
            return _sign("-", _binary(Binary(joint, left, inner)))
    return expression


def _call(expression: Call) -> Expression:
    values = [constant(argument) for argument in expression.arguments]
    if None not in values and expression.function in SCALAR_FUNCTIONS:
        return _computed(expression)
    if expression.function == "where":
        _, then, otherwise = expression.arguments
        if then == otherwise:
            return then
        if values[0] is not None:
            return then if values[0] else otherwise
    return expression


def _derivative(expression: Expression, name: str) -> Expression:
    if name not in expression.names():
        return _ZERO
    match expression:
        case Unary(operator=sign, operand=operand):
            return Unary(sign, _derivative(operand, name))
        case Binary():
            return _derivative_of_binary(expression, name)
        case Call(function=function, arguments=arguments):
            inner = tuple(_derivative(argument, name) for argument in arguments)
            if function in _OF_SEVERAL:
                return _OF_SEVERAL[function](arguments, inner)
            return Binary("*", _OUTER[function](arguments[0]), inner[0])
    return _ONE


def _derivative_of_binary(expression: Binary, name: str) -> Expression:
    joint, u, v = expression.operator, expression.left, expression.right
    if joint in COMPARISONS:
        return _ZERO
    du, dv = _derivative(u, name), _derivative(v, name)
    match joint:
        case "+" | "-":
            return Binary(joint, du, dv)
        case "*":
            return Binary("+", Binary("*", du, v), Binary("*", u, dv))
        case "/":
            change = Binary("-", du, Binary("*", expression, dv))
            return Binary("/", change, v)
    base = Binary("*", Binary("*", v, Binary("**", u, Binary("-", v, _ONE))), du)
    if name not in v.names():
        return base
    return Binary("+", base, Binary("*", Binary("*", expression, Call("log", (u,))), dv))


def _exprel_slope(x: Expression) -> Expression:
    """`(exp(x) - exprel(x)) / x`; near zero its series 1/2 + x/3 + x^2/8."""
    near = Binary("<", Call("abs", (x,)), _NEAR_ZERO)
    divisor = Call("where", (near, _ONE, x))
    far = Binary("/", Binary("-", Call("exp", (x,)), Call("exprel", (x,))), divisor)
    square = Binary("/", Binary("*", x, x), Number(8.0))
    series = Binary("+", Binary("+", Number(0.5), Binary("/", x, Number(3.0))), square)
    return Call("where", (near, series, far))


def _tanh_slope(x: Expression) -> Expression:
    return Binary("-", _ONE, Binary("**", Call("tanh", (x,)), Number(2.0)))


def _chosen(comparison: str, pair: tuple[Expression, ...], inner: tuple[Expression, ...]) -> Expression:
    return Call("where", (Binary(comparison, *pair), *inner))


def _hypot_slope(arguments: tuple[Expression, ...], inner: tuple[Expression, ...]) -> Expression:
    """(x dx + y dy) / hypot(x, y)."""
    products = (Binary("*", *pair) for pair in zip(arguments, inner, strict=True))
    return Binary("/", Binary("+", *products), Call("hypot", arguments))


def _atan2_slope(arguments: tuple[Expression, ...], inner: tuple[Expression, ...]) -> Expression:
    """(x dy - y dx) / (x^2 + y^2)."""
    (y, x), (dy, dx) = arguments, inner
    square = Binary("+", Binary("*", x, x), Binary("*", y, y))
    return Binary("/", Binary("-", Binary("*", x, dy), Binary("*", y, dx)), square)


def _clip_slope(arguments: tuple[Expression, ...], inner: tuple[Expression, ...]) -> Expression:
    (x, low, high), (dx, dlow, dhigh) = arguments, inner
    return _chosen("<=", (Call("max", (x, low)), high), (_chosen(">=", (x, low), (dx, dlow)), dhigh))


# Derivative of a function of one argument, at that argument.
_OUTER: Mapping[str, Callable[[Expression], Expression]] = {
    "abs": lambda x: Call("sign", (x,)),
    "cos": lambda x: Unary("-", Call("sin", (x,))),
    "exp": lambda x: Call("exp", (x,)),
    "expm1": lambda x: Call("exp", (x,)),
    "exprel": _exprel_slope,
    "floor": lambda _: _ZERO,
    "heaviside": lambda _: _ZERO,
    "log": lambda x: Binary("/", _ONE, x),
    "log1p": lambda x: Binary("/", _ONE, Binary("+", _ONE, x)),
    "sigmoid": lambda x: Binary("*", Call("sigmoid", (x,)), Call("sigmoid", (Unary("-", x),))),
    "sign": lambda _: _ZERO,
    "sin": lambda x: Call("cos", (x,)),
    "sqrt": lambda x: Binary("/", Number(0.5), Call("sqrt", (x,))),
    "tanh": _tanh_slope,
}
# Derivative of a function of several arguments, from these and their derivatives.
_OF_SEVERAL: Mapping[str, Callable[[tuple[Expression, ...], tuple[Expression, ...]], Expression]] = {
    "atan2": _atan2_slope,
    "clip": _clip_slope,
    "hypot": _hypot_slope,
    "max": lambda arguments, inner: _chosen(">=", arguments, inner),
    "min": lambda arguments, inner: _chosen("<=", arguments, inner),
    "where": lambda arguments, inner: Call("where", (arguments[0], *inner[1:])),
}
