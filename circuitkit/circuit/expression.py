"""Mathematical expressions as data: text to a tree of frozen nodes by a whitelist, never by `eval`.

`parse_expression("sigmoid(slope * (A - shift))", ("A", "slope", "shift"))` is a `Call` of a `Binary`.
Backends and exporters walk the tree; `evaluate` computes it on numbers or on anything with the arithmetic
operators.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias

from circuitkit.errors import ExpressionError, UnitError, listing, suggest
from circuitkit.units import DIMENSIONLESS, UNIT_SYMBOLS, Quantity, Unit, parse_quantity, parse_unit

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
    """A real power; Python's own of a negative float would be complex."""
    value = base**exponent
    if isinstance(value, complex):
        message = "a negative number has no real power of this exponent"
        raise ValueError(message)  # noqa: TRY004 - as the functions of `math` do
    return value


SCALAR_FUNCTIONS: Mapping[str, Callable[..., float]] = {
    "abs": abs,
    "clip": clip,
    "cos": math.cos,
    "exp": math.exp,
    "expm1": math.expm1,
    "exprel": exprel,
    "floor": lambda x: float(math.floor(x)),
    "heaviside": heaviside,
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
_ARITY_NOT_ONE = {"clip": 3, "max": 2, "min": 2, "where": 3}
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
_SYMBOL_OF_NODE: Mapping[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
    ast.UAdd: "+",
    ast.USub: "-",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}
_ALLOWED = "allowed: numbers, names, + - * / ^ < <= > >= and functions"

_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,4})?")
_UNIT = re.compile(r"\s*(?P<over>/\s*)?(?P<symbol>[A-Za-z]+)(?:\s*\^\s*-?\d)?(?![\w(.])")
_FURTHER_UNIT = re.compile(r"\s*[*/]\s*(?P<symbol>[A-Za-z]+)(?:\s*\^\s*-?\d)?(?![\w(.])")
_FIRST_STAND_IN = 0x4E00  # names from one letter that nobody writes, for quantities

# How tightly each kind of node binds, to print no more parentheses than it takes.
_COMPARISON, _SUM, _PRODUCT, _SIGN, _POWER, _ATOM = range(6)
_BINDING = {"+": _SUM, "-": _SUM, "*": _PRODUCT, "/": _PRODUCT, "**": _POWER}


@dataclass(frozen=True)
class Expression(ABC):
    """A node of an expression; `str()` gives text that parses to an equal node.

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
    """A number.

    Attributes:
        value: The number, [SI].
        unit: The unit that stood behind it, which `value` contains.
    """

    value: float
    unit: Unit = field(default=DIMENSIONLESS, compare=False, repr=False)

    def names(self) -> frozenset[str]:
        """No names."""
        return frozenset()

    def evaluate(self, _values: Values, _functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The number itself."""
        return self.value

    @property
    def binding(self) -> int:
        """That of a sign, if it has one."""
        return _ATOM if math.copysign(1.0, self.value) > 0 else _SIGN

    def __str__(self) -> str:
        return repr(self.value).removesuffix(".0")


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

    def names(self) -> frozenset[str]:
        """The names of both operands."""
        return self.left.names() | self.right.names()

    def evaluate(self, values: Values, functions: Functions = SCALAR_FUNCTIONS, /) -> Value:
        """The operands joined."""
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


def parse_expression(text: str, names: Iterable[str], *, units: bool = False) -> Expression:
    """Read an expression such as `sigmoid(slope * (A - shift))`; `^` and `**` are both powers.

    The constant `pi` may be used, unless the name means something else here.

    Args:
        text: The expression.
        names: The names that may occur.
        units: Whether numbers may have a unit directly behind them, such as `40 mV`.

    Raises:
        ExpressionError: It is no expression, or uses a name or a function that is not allowed; its `offset`
            says where in the text.
    """
    if len(text) > _MAX_LENGTH:
        message = f"found an expression of {len(text)} characters; allowed: {_MAX_LENGTH}"
        raise ExpressionError(message)
    source = _Source(text, frozenset(names), units=units)
    try:
        tree = ast.parse(source.python, mode="eval")
        return _convert(tree.body, source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, ExpressionError):
            raise
        message = f"cannot read the expression '{text}'; {_ALLOWED}"
        column = error.offset if isinstance(error, SyntaxError) and error.offset else 1
        raise ExpressionError(message, source.offset(column - 1)) from error


class _Source:
    """An expression as written and as Python has it, with the names and quantities that may occur."""

    def __init__(self, text: str, names: frozenset[str], *, units: bool) -> None:
        self.names = names
        self.quantities = {
            name: Quantity(value, DIMENSIONLESS) for name, value in CONSTANTS.items() if name not in names
        }
        self._written: dict[str, str] = {}
        self._text = self._with_stand_ins(text) if units else text
        self._start = len(text) - len(text.lstrip())
        self.python = re.sub(r"\s", " ", self._text.strip()).replace("^", "**")

    def _with_stand_ins(self, text: str) -> str:
        """The text with a name in the place of every quantity, letter for letter."""
        pieces, position = [], 0
        for match in _NUMBER.finditer(text):
            end = self._end_of_unit(text, match.end())
            if end > match.end():
                written = text[match.start() : end]
                name = chr(_FIRST_STAND_IN + len(self._written)).ljust(len(written), "_")
                self._written[name] = written
                self.quantities[name] = parse_quantity(written)
                pieces += [text[position : match.start()], name]
                position = end
        return "".join((*pieces, text[position:]))

    def _end_of_unit(self, text: str, start: int) -> int:
        """Where the unit behind a number ends; where the number does if there is none."""
        end, pattern = start, _UNIT
        while (match := pattern.match(text, end)) is not None and match["symbol"] not in self.names:
            if match["symbol"] not in UNIT_SYMBOLS:
                if end == start and not match["over"]:
                    try:
                        parse_unit(match["symbol"])
                    except UnitError as error:
                        raise ExpressionError(str(error), match.start("symbol")) from error
                break
            end, pattern = match.end(), _FURTHER_UNIT
        return end

    def as_written(self, node: ast.expr) -> str:
        """The text of a node."""
        text = ast.unparse(node)
        for name, written in self._written.items():
            text = text.replace(name, written)
        return text

    def offset(self, column: int) -> int:
        """Where in the text, from 0, a character of the Python expression comes from."""
        length = -1
        for position, character in enumerate(self._text[self._start :], start=self._start):
            length += 2 if character == "^" else 1
            if length >= column:
                return position
        return max(len(self._text.rstrip()) - 1, 0)

    def offset_of(self, node: ast.expr) -> int:
        """Where in the text a node begins; columns of `ast` count bytes."""
        return self.offset(len(self.python.encode()[: node.col_offset].decode()))


def _convert(node: ast.expr, source: _Source, depth: int = 0) -> Expression:
    at = source.offset_of(node)
    if depth > _MAX_DEPTH:
        message = f"found an expression nested more than {_MAX_DEPTH} deep; allowed: up to {_MAX_DEPTH}"
        raise ExpressionError(message, at)
    inside = partial(_convert, source=source, depth=depth + 1)
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return Number(_finite(value, at), offset=at)
        case ast.Name(id=name) if name in source.quantities:
            quantity = source.quantities[name]
            return Number(quantity.value_si, quantity.unit, offset=at)
        case ast.Name(id=name):
            return Name(_known(name, source.names, "name", at), offset=at)
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
            return Unary(_SYMBOL_OF_NODE[type(sign)], inside(operand), offset=at)
        case (
            ast.BinOp(left=left, op=joint, right=right)
            | ast.Compare(left=left, ops=[joint], comparators=[right])
        ) if type(joint) in _SYMBOL_OF_NODE:
            return Binary(_SYMBOL_OF_NODE[type(joint)], inside(left), inside(right), offset=at)
        case ast.Call(func=ast.Name(id=function), args=arguments, keywords=[]):
            _known(function, frozenset(FUNCTION_ARITY), "function", at)
            arity = FUNCTION_ARITY[function]
            if len(arguments) != arity:
                message = f"found {function} with {len(arguments)} arguments; allowed: {arity}"
                raise ExpressionError(message, at)
            return Call(function, tuple(inside(argument) for argument in arguments), offset=at)
    message = f"found '{source.as_written(node)}'; {_ALLOWED}"
    raise ExpressionError(message, at)


def _finite(value: float, at: int) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        message = "found a number that is too large; allowed: finite numbers"
        raise ExpressionError(message, at)
    return number


def _known(name: str, allowed: frozenset[str], kind: str, at: int) -> str:
    if name not in allowed:
        hint = suggest(name, sorted(allowed))
        message = f"unknown {kind} '{name}'; allowed: {listing(sorted(allowed))}"
        raise ExpressionError(f"{message}; {hint}" if hint else message, at)
    return name
