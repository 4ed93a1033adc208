"""Text to expressions, by a whitelist and never by `eval`; complaints say where in the text.

Python's parser reads the text, with a name in the place of each quantity such as `40 mV` and of each quoted
text.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial, reduce
from keyword import kwlist
from types import MappingProxyType
from typing import TypeAlias

from circuitkit.base.errors import ExpressionError, UnitError, listing, suggest
from circuitkit.base.units import DIMENSIONLESS, UNIT_SYMBOLS, Quantity, parse_quantity, parse_unit
from circuitkit.circuit.expressions.expression import (
    COMPARISONS,
    CONSTANTS,
    FUNCTION_ARITY,
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.expressions.symbolic import constant

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
_ALLOWED = "allowed: numbers, names, + - * / ^ < <= > >= and or not, and functions"
_DOTTED = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)+")
_ZERO, _ONE = Number(0.0), Number(1.0)
Arities: TypeAlias = Mapping[str, tuple[int, int]]  # smallest and largest number of arguments, by name
_NOTHING: Arities = MappingProxyType({})
_OF_ANY_NUMBER = frozenset({"max", "min"})  # max(a, b, c) is max(max(a, b), c)
_MOST_ARGUMENTS = 50
_ARITIES: Arities = {
    name: (arity, _MOST_ARGUMENTS if name in _OF_ANY_NUMBER else arity)
    for name, arity in FUNCTION_ARITY.items()
}


def parse_expression(
    text: str,
    names: Iterable[str],
    *,
    units: bool = False,
    functions: Arities = _NOTHING,
    references: Arities = _NOTHING,
) -> Expression:
    """Read an expression such as `sigmoid(slope * (A - shift))`; `^` and `**` are both powers.

    The constant `pi` may be used, unless the name means something else here. `a and b`, `a or b` and `not a`
    give 1 or 0, as comparisons do, and are read as calls of `where`; what is not 0 is true.

    Args:
        text: The expression.
        names: The names that may occur.
        units: Whether numbers may have a unit directly behind them, such as `40 mV`.
        functions: Functions beside those of the language, or in their place, with the smallest and the
            largest number of their arguments, which are expressions.
        references: Functions whose arguments are no expressions, such as `sensor(eye_left)` or
            `position("left foot", x)`, with the smallest and the largest number of them. A bare or quoted
            text becomes a `Name` of this text, a number a `Number`.

    Returns:
        The tree; a function of the caller's is a `Call` in it.

    Raises:
        ExpressionError: It is no expression, or uses a name or a function that is not allowed; its `offset`
            says where in the text.
    """
    require_length(text)
    source = _Source(text, frozenset(names), {**_ARITIES, **functions}, references, units=units)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # Python's style is not this language's
            tree = ast.parse(source.python, mode="eval")
        source.restore_names(tree)
        return _convert(tree.body, source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, ExpressionError):
            raise
        message = f"cannot read the expression '{text}'; {_ALLOWED}"
        column = error.offset if isinstance(error, SyntaxError) and error.offset else 1
        raise ExpressionError(message, source.offset(column - 1)) from error


def require_length(text: str) -> None:
    """Refuse a text that is too long for an expression.

    Raises:
        ExpressionError: It is.
    """
    if len(text) > _MAX_LENGTH:
        message = f"found an expression of {len(text)} characters; allowed: {_MAX_LENGTH}"
        raise ExpressionError(message)


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
    """An expression as written and as Python has it, with the names and functions that may occur."""

    def __init__(
        self, text: str, names: frozenset[str], functions: Arities, references: Arities, *, units: bool
    ) -> None:
        self.names = names
        self.functions = {**functions, **references}
        self.references = references
        self.quantities = {
            name: Quantity(value, DIMENSIONLESS) for name, value in CONSTANTS.items() if name not in names
        }
        self._stand_ins = StandIns()
        self._text = without_quotes(text, self._stand_ins) if references else text
        if units:
            self._text, _ = with_stand_ins(self._text, names, self._stand_ins)
        self.quantities |= self._stand_ins.quantities
        self.texts = self._stand_ins.texts
        self._start = len(text) - len(text.lstrip())
        self.python = re.sub(r"\s", " ", self._text.strip()).replace("^", "**")

    def is_quantity(self, name: str) -> bool:
        """Check whether a name stands for a number with a unit."""
        return name in self._stand_ins.quantities

    def restore_names(self, tree: ast.AST) -> None:
        """Give names their characters back: `ast` replaces some by similar ones (NFKC), as `ª` by `a`."""
        if self.python.isascii():
            return
        raw = self.python.encode()
        for node in ast.walk(tree):
            if isinstance(node, ast.Name):
                node.id = raw[node.col_offset : node.end_col_offset].decode()
            elif isinstance(node, ast.Attribute):
                node.attr = raw[node.col_offset : node.end_col_offset].decode().rpartition(".")[2].strip()

    def as_written(self, node: ast.expr) -> str:
        """Return the text of a node."""
        return self._stand_ins.as_written(ast.unparse(node))

    def offset(self, column: int) -> int:
        """Find where in the text, from 0, a character of the Python expression comes from."""
        length = -1
        for position, character in enumerate(self._text[self._start :], start=self._start):
            length += 2 if character == "^" else 1
            if length >= column:
                return position
        return max(len(self._text.rstrip()) - 1, 0)

    def offset_of(self, node: ast.expr) -> int:
        """Find where in the text a node begins."""
        return self.offset(self._column(node.col_offset))

    def offset_of_joint(self, node: ast.expr) -> int:
        """Find where in the text the operator between two operands stands, or where anything else begins."""
        match node:
            case ast.BinOp(left=left) | ast.Compare(left=left, ops=[_]):
                after = self.python[self._column(left.end_col_offset or 0) :]
                return self.offset(len(self.python) - len(after.lstrip(" )")))
        return self.offset_of(node)

    def _column(self, count: int) -> int:
        """Return a column of `ast`, which counts bytes, in characters."""
        return len(self.python.encode()[:count].decode())


def _convert(node: ast.expr, source: _Source, depth: int = 0) -> Expression:
    at = source.offset_of(node)
    if depth > _MAX_DEPTH:
        message = f"found an expression nested more than {_MAX_DEPTH} deep; allowed: up to {_MAX_DEPTH}"
        raise ExpressionError(message, at)
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return Number(_finite(value, at), offset=at)
        case ast.Name(id=name) if name in source.quantities:
            quantity = source.quantities[name]
            return Number(quantity.value_si, quantity.unit, offset=at)
        case ast.Name(id=name) if name not in source.texts:
            return Name(_known(name, source.names, "name", at), offset=at)
    joined = _convert_joint(node, source, at, partial(_convert, source=source, depth=depth + 1))
    if joined is None:
        message = f"found '{source.as_written(node)}'; {_ALLOWED}{_meant(node, source)}"
        raise ExpressionError(message, source.offset_of_joint(node))
    return joined


def _convert_joint(
    node: ast.expr, source: _Source, at: int, inside: Callable[[ast.expr], Expression]
) -> Expression | None:
    """Convert what has operands or arguments, these by `inside`; None if the language has no such thing."""
    match node:
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
            return Unary(_SYMBOL_OF_NODE[type(sign)], inside(operand), offset=at)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return Call("where", (inside(operand), _ZERO, _ONE), offset=at)
        case ast.BoolOp(op=joint, values=parts):
            return _joined(isinstance(joint, ast.And), [inside(part) for part in parts])
        case (
            ast.BinOp(left=left, op=joint, right=right)
            | ast.Compare(left=left, ops=[joint], comparators=[right])
        ) if type(joint) in _SYMBOL_OF_NODE:
            return Binary(_SYMBOL_OF_NODE[type(joint)], inside(left), inside(right), offset=at)
        case ast.Call(func=ast.Name(id=function), args=arguments, keywords=[]):
            _require_function(function, len(arguments), source, at)
            convert = partial(_literal, source=source) if function in source.references else inside
            return _called(function, [convert(argument) for argument in arguments], at)
    return None


def _called(function: str, arguments: list[Expression], at: int) -> Expression:
    """Make a call; of more than two arguments for `max` and `min` several calls, as backends know two."""
    if function in _OF_ANY_NUMBER and len(arguments) > FUNCTION_ARITY[function]:
        return reduce(lambda one, more: Call(function, (one, more), offset=at), arguments)
    return Call(function, tuple(arguments), offset=at)


def _joined(is_and: bool, parts: list[Expression]) -> Expression:
    """Read `a and b` as where(a, b, 0), `a or b` as where(a, 1, b); a `b` that is not 1 or 0 becomes so."""
    *others, last = parts
    joined = last if _is_truth(last) else Call("where", (last, _ONE, _ZERO), offset=last.offset)
    for part in reversed(others):
        branches = (joined, _ZERO) if is_and else (_ONE, joined)
        joined = Call("where", (part, *branches), offset=part.offset)
    return joined


def _is_truth(expression: Expression) -> bool:
    """Check whether an expression is 1 or 0, whatever its names are."""
    match expression:
        case Binary(operator=joint):
            return joint in COMPARISONS
        case Call(function="where", arguments=(_, then, otherwise)):
            return _is_truth(then) and _is_truth(otherwise)
    return expression in {_ZERO, _ONE}


def _require_function(name: str, count: int, source: _Source, at: int) -> None:
    """Refuse a function that there is not, or that takes another number of arguments."""
    _known(name, frozenset(source.functions), "function", at)
    least, most = source.functions[name]
    if not least <= count <= most:
        many = f"{least} or more" if most == _MOST_ARGUMENTS else f"{least} to {most}"
        allowed = f"{least}" if least == most else many
        message = f"found {name} with {count} arguments; allowed: {allowed}"
        raise ExpressionError(message, at)


def _literal(node: ast.expr, source: _Source) -> Expression:
    """Read an argument of a reference: a text, or a number."""
    at = source.offset_of(node)
    match node:
        case ast.Name(id=name) if name in source.texts:
            return Name(source.texts[name], offset=at)
        case ast.Name(id=name) if not source.is_quantity(name):
            return Name(name, offset=at)
        case ast.Attribute() if _DOTTED.fullmatch(text := ast.unparse(node)):
            return Name(text, offset=at)
        case ast.Name() | ast.Constant(value=int() | float()):
            return _convert(node, source)
        case ast.UnaryOp(operand=ast.Name() | ast.Constant()):
            if (value := constant(_convert(node, source))) is not None:
                return Number(value, offset=at)
    message = f"found '{source.as_written(node)}'; allowed: a name, a text in quotes, or a number"
    raise ExpressionError(message, at)


def _meant(node: ast.expr, source: _Source) -> str:
    """Return a hint for what Python has, but not this language."""
    written = source.as_written
    match node:
        case ast.IfExp(test=test, body=body, orelse=otherwise):
            return f"; did you mean 'where({written(test)}, {written(body)}, {written(otherwise)})'?"
        case ast.Compare(left=left, ops=[*joints], comparators=[*others]) if len(joints) > 1 and all(
            type(joint) in _SYMBOL_OF_NODE for joint in joints
        ):
            pairs = zip([left, *others], joints, others, strict=False)
            parts = (f"{written(a)} {_SYMBOL_OF_NODE[type(joint)]} {written(b)}" for a, joint, b in pairs)
            return f"; did you mean '{' and '.join(parts)}'?"
    return ""


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


_NUMBER = re.compile(r"(?<![\w.])(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,4})?")
_POWER = r"(?:\s*\^\s*-?\d(?!\w))?(?![\w(.])"
_UNIT = re.compile(rf"\s*(?P<over>/\s*|1/)?(?P<symbol>[A-Za-z]+|%){_POWER}")
_FURTHER_UNIT = re.compile(rf"\s*[*/]\s*(?P<symbol>[A-Za-z]+){_POWER}")
_QUOTED = re.compile(r"""\"[^\"\n]*\"|'[^'\n]*'""")
_FIRST_STAND_IN = 0x4E00  # names from one letter that nobody writes


@dataclass
class StandIns:
    """Names that stand for parts of a text, letter for letter.

    Attributes:
        quantities: What the stand-ins for quantities mean.
        texts: What stands between the quotes of those for quoted texts.
        written: What every stand-in stands for, as written.
    """

    quantities: dict[str, Quantity] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    written: dict[str, str] = field(default_factory=dict)

    def add(self, written: str) -> str:
        """Add a new stand-in, as long as what it stands for."""
        name = chr(_FIRST_STAND_IN + len(self.written)).ljust(len(written), "_")
        self.written[name] = written
        return name

    def as_written(self, text: str) -> str:
        """Return a text with what was written instead of the stand-ins."""
        for name, written in self.written.items():
            text = text.replace(name, written)
        return text


def without_quotes(text: str, stand_ins: StandIns) -> str:
    """Put a name in the place of every quoted text, so that nothing in it is taken for anything else."""

    def name_of(match: re.Match[str]) -> str:
        name = stand_ins.add(match[0])
        stand_ins.texts[name] = match[0][1:-1]
        return name

    return _QUOTED.sub(name_of, text)


def with_stand_ins(
    text: str, names: Collection[str] = (), stand_ins: StandIns | None = None
) -> tuple[str, StandIns]:
    """Put a name in the place of every number that is directly followed by a unit.

    Args:
        text: An expression.
        names: Names that are no units there, even if they look like one.
        stand_ins: Names that stand for other parts of the text already.

    Raises:
        ExpressionError: A number is followed by something that is neither a unit nor an operator, or is too
            large with its unit.
    """
    require_length(text)
    stand_ins = stand_ins or StandIns()
    pieces, position = [], 0
    for match in _NUMBER.finditer(text):
        end = _end_of_unit(text, match.end(), names)
        if end > match.end():
            written = text[match.start() : end]
            name = stand_ins.add(written)
            try:
                stand_ins.quantities[name] = parse_quantity(written)
            except UnitError as error:  # it is too large
                raise ExpressionError(str(error), match.start()) from error
            pieces += [text[position : match.start()], name]
            position = end
    return "".join((*pieces, text[position:])), stand_ins


def _end_of_unit(text: str, start: int, names: Collection[str]) -> int:
    """Find where the unit behind a number ends; where the number does if there is none."""
    end, pattern, words = start, _UNIT, {*names, *kwlist}
    while (match := pattern.match(text, end)) is not None and match["symbol"] not in words:
        if match["symbol"] not in UNIT_SYMBOLS:
            if end == start and not match["over"]:
                try:
                    parse_unit(match["symbol"])
                except UnitError as error:
                    raise ExpressionError(str(error), match.start("symbol")) from error
            break
        end, pattern = match.end(), _FURTHER_UNIT
    return end
