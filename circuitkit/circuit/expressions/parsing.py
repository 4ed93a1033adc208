"""Text to expressions, by a whitelist and never by `eval`; complaints say where in the text."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterable, Mapping
from functools import partial

from circuitkit.base.errors import ExpressionError, listing, suggest
from circuitkit.base.units import DIMENSIONLESS, Quantity
from circuitkit.circuit.expressions.expression import (
    CONSTANTS,
    FUNCTION_ARITY,
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.expressions.quantities import StandIns, with_stand_ins

_MAX_LENGTH = 1000
_MAX_DEPTH = 50
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


def require_values(expression: Expression) -> None:
    """Check that what consists of numbers alone, such as `1 / 0`, has a value.

    Raises:
        ExpressionError: It has none, or none that is finite; its `offset` says where in the text.
    """
    if expression.names():
        for part in expression.operands():
            require_values(part)
        return
    try:
        value = expression.evaluate({})
        why = "" if math.isfinite(value) else "too large"
    except (ArithmeticError, ValueError) as error:
        why = str(error)
    if why:
        message = f"found '{expression}', which has no value ({why}); allowed: a finite number"
        raise ExpressionError(message, expression.offset)


class _Source:
    """An expression as written and as Python has it, with the names and quantities that may occur."""

    def __init__(self, text: str, names: frozenset[str], *, units: bool) -> None:
        self.names = names
        self.quantities = {
            name: Quantity(value, DIMENSIONLESS) for name, value in CONSTANTS.items() if name not in names
        }
        self._text, self._stand_ins = with_stand_ins(text, names) if units else (text, StandIns())
        self.quantities |= self._stand_ins.quantities
        self._start = len(text) - len(text.lstrip())
        self.python = re.sub(r"\s", " ", self._text.strip()).replace("^", "**")

    def as_written(self, node: ast.expr) -> str:
        """The text of a node."""
        return self._stand_ins.as_written(ast.unparse(node))

    def offset(self, column: int) -> int:
        """Where in the text, from 0, a character of the Python expression comes from."""
        length = -1
        for position, character in enumerate(self._text[self._start :], start=self._start):
            length += 2 if character == "^" else 1
            if length >= column:
                return position
        return max(len(self._text.rstrip()) - 1, 0)

    def offset_of(self, node: ast.expr) -> int:
        """Where in the text a node begins."""
        return self.offset(self._column(node.col_offset))

    def offset_of_joint(self, node: ast.expr) -> int:
        """Where in the text the operator between two operands stands, or where anything else begins."""
        match node:
            case ast.BinOp(left=left) | ast.Compare(left=left, ops=[_]):
                after = self.python[self._column(left.end_col_offset or 0) :]
                return self.offset(len(self.python) - len(after.lstrip(" )")))
        return self.offset_of(node)

    def _column(self, count: int) -> int:
        """A column of `ast`, which counts bytes, in characters."""
        return len(self.python.encode()[:count].decode())


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
    if isinstance(node, ast.IfExp):
        parts = (source.as_written(part) for part in (node.test, node.body, node.orelse))
        message = f"{message}; did you mean 'where({', '.join(parts)})'?"
    raise ExpressionError(message, source.offset_of_joint(node))


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
