"""Mathematical expressions as data: text to a tree of frozen nodes by a whitelist, never by `eval`.

`parse_expression("sigmoid(slope * (A - shift))", ("A", "slope", "shift"))` is a `Call` of a `Binary`.
Backends and exporters walk the tree; `evaluate` computes it on numbers or on anything with the arithmetic
operators.
"""

from __future__ import annotations

import ast
import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from circuitkit.errors import ExpressionError, listing, suggest

# Whatever a caller computes with: floats, arrays or symbols. Only the arithmetic operators are asked of it.
Value: TypeAlias = Any
Values: TypeAlias = Mapping[str, Value]
Functions: TypeAlias = Mapping[str, Callable[..., Value]]

_MAX_LENGTH = 1000
_MAX_DEPTH = 50


def sigmoid(x: float) -> float:
    """Logistic function `1 / (1 + exp(-x))` (eq. 12), without overflow at large negative `x`."""
    if x >= 0.0:
        return 1.0 / (1.0 + math.exp(-x))
    grown = math.exp(x)
    return grown / (1.0 + grown)


def heaviside(x: float) -> float:
    """Unit step: 0 for `x < 0`, 1 for `x >= 0`."""
    return 1.0 if x >= 0.0 else 0.0


SCALAR_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "abs": abs,
    "cos": math.cos,
    "exp": math.exp,
    "heaviside": heaviside,
    "log": math.log,
    "max": max,
    "min": min,
    "sigmoid": sigmoid,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "tanh": math.tanh,
}
FUNCTION_ARITY: Mapping[str, int] = {name: 2 if name in {"min", "max"} else 1 for name in SCALAR_FUNCTIONS}
_BINARY: Mapping[str, Callable[[Value, Value], Value]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
}
_SYMBOL_OF_NODE: Mapping[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
    ast.UAdd: "+",
    ast.USub: "-",
}


class Expression(ABC):
    """A node of an expression; `str()` gives text that parses to an equal node."""

    @abstractmethod
    def names(self) -> frozenset[str]:
        """The names that occur in it."""

    @abstractmethod
    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The value, computed with the arithmetic of what `values` holds.

        Args:
            values: A value for every name.
            functions: A function for every function name; arrays need other ones than numbers.
        """


@dataclass(frozen=True)
class Number(Expression):
    """A number."""

    value: float

    def names(self) -> frozenset[str]:
        """No names."""
        return frozenset()

    def evaluate(self, _values: Values, _functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The number itself."""
        return self.value

    def __str__(self) -> str:
        return repr(self.value)


@dataclass(frozen=True)
class Name(Expression):
    """A variable or parameter."""

    name: str

    def names(self) -> frozenset[str]:
        """This name."""
        return frozenset((self.name,))

    def evaluate(self, values: Values, _functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The value of the name."""
        return values[self.name]

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Unary(Expression):
    """A sign, `+` or `-`, before an operand."""

    operator: str
    operand: Expression

    def names(self) -> frozenset[str]:
        """The names of the operand."""
        return self.operand.names()

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The operand with the sign."""
        value = self.operand.evaluate(values, functions)
        return -value if self.operator == "-" else value

    def __str__(self) -> str:
        return f"({self.operator}{self.operand})"


@dataclass(frozen=True)
class Binary(Expression):
    """Two operands joined by `+`, `-`, `*`, `/` or `**`."""

    operator: str
    left: Expression
    right: Expression

    def names(self) -> frozenset[str]:
        """The names of both operands."""
        return self.left.names() | self.right.names()

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The operands joined."""
        left, right = self.left.evaluate(values, functions), self.right.evaluate(values, functions)
        return _BINARY[self.operator](left, right)

    def __str__(self) -> str:
        return f"({self.left} {self.operator} {self.right})"


@dataclass(frozen=True)
class Call(Expression):
    """A function of the whitelist with its arguments."""

    function: str
    arguments: tuple[Expression, ...]

    def names(self) -> frozenset[str]:
        """The names of all arguments."""
        return frozenset().union(*(argument.names() for argument in self.arguments))

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The function of the arguments' values."""
        arguments = (argument.evaluate(values, functions) for argument in self.arguments)
        return functions[self.function](*arguments)

    def __str__(self) -> str:
        return f"{self.function}({', '.join(str(argument) for argument in self.arguments)})"


def parse_expression(text: str, names: Iterable[str]) -> Expression:
    """Read an expression such as `sigmoid(slope * (A - shift))`; `^` and `**` are both powers.

    Args:
        text: The expression.
        names: The names that may occur.

    Raises:
        ExpressionError: It is no expression, or uses a name or a function that is not allowed.
    """
    if len(text) > _MAX_LENGTH:
        message = f"found an expression of {len(text)} characters; allowed: {_MAX_LENGTH}"
        raise ExpressionError(message)
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        return _convert(tree.body, frozenset(names))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, ExpressionError):
            raise
        message = f"cannot read the expression '{text}'; allowed: numbers, names, + - * / ^ and functions"
        raise ExpressionError(message) from error


def _convert(node: ast.expr, names: frozenset[str], depth: int = 0) -> Expression:
    if depth > _MAX_DEPTH:
        message = f"found an expression nested more than {_MAX_DEPTH} deep; allowed: up to {_MAX_DEPTH}"
        raise ExpressionError(message)
    inside = partial(_convert, names=names, depth=depth + 1)
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return Number(_finite(value))
        case ast.Name(id=name):
            return Name(_known(name, names, "name"))
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
            return Unary(_SYMBOL_OF_NODE[type(sign)], inside(operand))
        case ast.BinOp(left=left, op=joint, right=right) if type(joint) in _SYMBOL_OF_NODE:
            return Binary(_SYMBOL_OF_NODE[type(joint)], inside(left), inside(right))
        case ast.Call(func=ast.Name(id=function), args=arguments, keywords=[]):
            _known(function, frozenset(FUNCTION_ARITY), "function")
            arity = FUNCTION_ARITY[function]
            if len(arguments) != arity:
                message = f"found {function} with {len(arguments)} arguments; allowed: {arity}"
                raise ExpressionError(message)
            return Call(function, tuple(inside(argument) for argument in arguments))
    message = f"found '{ast.unparse(node)}'; allowed: numbers, names, + - * / ^ and functions"
    raise ExpressionError(message)


def _finite(value: float) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        message = "found a number that is too large; allowed: finite numbers"
        raise ExpressionError(message)
    return number


def _known(name: str, allowed: frozenset[str], kind: str) -> str:
    if name not in allowed:
        hint = suggest(name, sorted(allowed))
        message = f"unknown {kind} '{name}'; allowed: {listing(sorted(allowed))}"
        raise ExpressionError(f"{message}; {hint}" if hint else message)
    return name
