"""Mathematical expressions as data: trees of frozen nodes, of a whitelist of operators and functions.

`sigmoid(slope * (A - shift))` is a `Call` of a `Binary`; `parsing` reads it from text. Backends and exporters
walk the tree; `evaluate` computes it on numbers or on anything with the arithmetic operators.
"""

from __future__ import annotations

import math
import operator
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from circuitkit.base.units import DIMENSIONLESS, Unit
from circuitkit.circuit.expressions.exact import exact

# Whatever a caller computes with: floats, arrays or symbols. Only the arithmetic operators are asked of it.
Value: TypeAlias = Any
Values: TypeAlias = Mapping[str, Value]
Functions: TypeAlias = Mapping[str, Callable[..., Value]]


def sigmoid(x: float) -> float:
    """Logistic function `1 / (1 + exp(-x))` (eq. 12), without overflow at large negative `x`."""
    if x >= 0.0:
        return 1.0 / (1.0 + math.exp(-x))
    grown = math.exp(x)
    return grown / (1.0 + grown)


def heaviside(x: float) -> float:
    """Unit step: 0 for `x < 0`, 1 for `x >= 0`."""
    return 1.0 if x >= 0.0 else 0.0


def exprel(x: float) -> float:
    """Relative exponential `(exp(x) - 1) / x`, 1 at 0."""
    return math.expm1(x) / x if x else 1.0


def sign(x: float) -> float:
    """-1, 0 or 1."""
    return float((x > 0.0) - (x < 0.0))


def clip(x: float, low: float, high: float) -> float:
    """`min(max(x, low), high)`."""
    return min(max(x, low), high)


def where(condition: float, then: float, otherwise: float) -> float:
    """`then` if the condition is not zero, else `otherwise`; both are computed in any case."""
    return then if condition else otherwise


def _power(base: Value, exponent: Value) -> Value:
    """Return a real power; Python's own of a negative float would be complex."""
    try:
        value = base**exponent
    except OverflowError as error:  # its own words have the number of a system's error
        message = "math range error"
        raise OverflowError(message) from error
    if isinstance(value, complex):
        message = "a negative number has no real power of this exponent"
        raise ValueError(message)  # noqa: TRY004 - as the functions of `math` do
    return value


SCALAR_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "abs": abs,
    "atan2": math.atan2,
    "clip": clip,
    "cos": math.cos,
    "exp": math.exp,
    "expm1": math.expm1,
    "exprel": exprel,
    "floor": lambda x: float(math.floor(x)),
    "heaviside": heaviside,
    "hypot": math.hypot,
    "log": math.log,
    "log1p": math.log1p,
    "max": max,
    "min": min,
    "sigmoid": sigmoid,
    "sign": sign,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "tanh": math.tanh,
    "where": where,
}
_ARITY_NOT_ONE = {"atan2": 2, "clip": 3, "hypot": 2, "max": 2, "min": 2, "where": 3}
FUNCTION_ARITY: Mapping[str, int] = {name: _ARITY_NOT_ONE.get(name, 1) for name in SCALAR_FUNCTIONS}
CONSTANTS: Mapping[str, float] = {"pi": math.pi}
_BINARY: Mapping[str, Callable[[Value, Value], Value]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": _power,
    "<": lambda left, right: (left < right) * 1.0,
    "<=": lambda left, right: (left <= right) * 1.0,
    ">": lambda left, right: (left > right) * 1.0,
    ">=": lambda left, right: (left >= right) * 1.0,
}
COMPARISONS = frozenset({"<", "<=", ">", ">="})
BINARY_OPERATORS: tuple[str, ...] = tuple(_BINARY)
_PLAIN_NAME = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*")
# How tightly each kind of node binds, to print no more parentheses than it takes.
_COMPARISON, _SUM, _PRODUCT, _SIGN, _POWER, _ATOM = range(6)
_BINDING = {"+": _SUM, "-": _SUM, "*": _PRODUCT, "/": _PRODUCT, "**": _POWER}


@dataclass(frozen=True)
class Expression(ABC):
    """A node of an expression; `str()` gives text that parses to an equal node, with units if it has any.

    Attributes:
        offset: Where its text begins in the text it was read from, from 0.
    """

    offset: int = field(default=0, kw_only=True, compare=False, repr=False)

    @property
    def binding(self) -> int:
        """How tightly its parts hold together as text; an operand that holds less needs parentheses."""
        return _ATOM

    def text_in(self, binding: int) -> str:
        """Its text as an operand of something that binds so tightly."""
        return str(self) if self.binding >= binding else f"({self})"

    def operands(self) -> tuple[Expression, ...]:
        """Find what it is made of; nothing if it is a number or a name."""
        return ()

    def names(self) -> frozenset[str]:
        """Return the names that occur in it."""
        return frozenset().union(*(operand.names() for operand in self.operands()))

    @abstractmethod
    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """Return the value, computed with the arithmetic of what `values` holds.

        Args:
            values: A value for every name.
            functions: A function for every function name; arrays need other ones than numbers.
        """


@dataclass(frozen=True)
class Number(Expression):
    """A number.

    Attributes:
        value: The number, [SI].
        unit: The unit that stood behind it, which `value` contains.
    """

    value: float
    unit: Unit = field(default=DIMENSIONLESS, compare=False, repr=False)

    def evaluate(self, _values: Values, _functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """Return the number itself."""
        return self.value

    @property
    def binding(self) -> int:
        """That of a sign, if it has one."""
        return _ATOM if math.copysign(1.0, self.value) > 0 else _SIGN

    def __str__(self) -> str:
        if self.unit != DIMENSIONLESS:
            return str(exact(self.value, self.unit))
        return repr(self.value).removesuffix(".0")


@dataclass(frozen=True)
class Name(Expression):
    """A variable or parameter."""

    name: str

    def names(self) -> frozenset[str]:
        """This name."""
        return frozenset((self.name,))

    def evaluate(self, values: Values, _functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """Return the value of the name."""
        return values[self.name]

    def __str__(self) -> str:
        if _PLAIN_NAME.fullmatch(self.name):
            return self.name
        quote = "'" if '"' in self.name else '"'  # as an argument of a reference, where any text may stand
        return f"{quote}{self.name}{quote}"


@dataclass(frozen=True)
class Unary(Expression):
    """A sign, `+` or `-`, before an operand."""

    operator: str
    operand: Expression

    def operands(self) -> tuple[Expression, ...]:
        """Return the operand."""
        return (self.operand,)

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """Return the operand with the sign."""
        value = self.operand.evaluate(values, functions)
        return -value if self.operator == "-" else value

    @property
    def binding(self) -> int:
        """Less than a power: -x ** 2 is -(x ** 2)."""
        return _SIGN

    def __str__(self) -> str:
        return f"{self.operator}{self.operand.text_in(_SIGN)}"


@dataclass(frozen=True)
class Binary(Expression):
    """Two operands joined by `+`, `-`, `*`, `/`, `**`, or by a comparison, which gives 1 or 0."""

    operator: str
    left: Expression
    right: Expression

    def operands(self) -> tuple[Expression, ...]:
        """Left and right."""
        return (self.left, self.right)

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """Return the operands joined."""
        left, right = self.left.evaluate(values, functions), self.right.evaluate(values, functions)
        return _BINARY[self.operator](left, right)

    @property
    def binding(self) -> int:
        """That of the operator."""
        return _BINDING.get(self.operator, _COMPARISON)

    def __str__(self) -> str:
        if self.operator == "**":  # the one that groups from the right; a sign may stand in the exponent
            return f"{self.left.text_in(_ATOM)} ** {self.right.text_in(_SIGN)}"
        lowest = _SUM if self.operator in COMPARISONS else self.binding
        return f"{self.left.text_in(lowest)} {self.operator} {self.right.text_in(self.binding + 1)}"


@dataclass(frozen=True)
class Call(Expression):
    """A function of the whitelist, or one that a caller of the parser added, with its arguments."""

    function: str
    arguments: tuple[Expression, ...]

    def operands(self) -> tuple[Expression, ...]:
        """Return the arguments."""
        return self.arguments

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """Return the function of the arguments' values."""
        arguments = (argument.evaluate(values, functions) for argument in self.arguments)
        return functions[self.function](*arguments)

    def __str__(self) -> str:
        return f"{self.function}({', '.join(str(argument) for argument in self.arguments)})"
