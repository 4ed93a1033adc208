"""The dimension of an expression, from those of its names; refuses what joins different ones.

Sums, comparisons, minima and maxima need the same dimension on both sides; products and powers multiply
dimensions; sine and cosine take an angle or a plain number, `atan2` gives an angle; the other functions take
plain numbers. A number is dimensionless, except that 0 fits any dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from types import MappingProxyType
from typing import NamedTuple

from circuitkit.base.errors import ExpressionError
from circuitkit.base.units import Dimension, parse_unit
from circuitkit.circuit.expressions.expression import (
    COMPARISONS,
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.expressions.symbolic import constant, simplify, substitute

_WHOLE = 1e-9  # off which an exponent may be, by rounding
_NAMED = tuple((symbol, parse_unit(symbol).dimension) for symbol in ("V", "A", "S", "F", "ohm", "N", "N*m"))


class OpenDimension(NamedTuple):
    """A fixed dimension times powers of two that a circuit decides, such as `activation/s`."""

    fixed: Dimension = Dimension()
    activation: int = 0
    source: int = 0

    def times(self, other: OpenDimension, power: int = 1) -> OpenDimension:
        """Return dimension of the product `self * other ** power`."""
        mine, theirs = self[1:], other[1:]
        words = (own + power * added for own, added in zip(mine, theirs, strict=True))
        return OpenDimension(self.fixed.times(other.fixed, power), *words)

    def raised(self, power: float) -> OpenDimension | None:
        """Return the dimension of a power; None if that has exponents which are not whole."""
        exponents = [exponent * power for exponent in (*self.fixed, *self[1:])]
        whole = [round(exponent) for exponent in exponents]
        if any(abs(exponent - near) > _WHOLE for exponent, near in zip(exponents, whole, strict=True)):
            return None
        *fixed, activation, source = whole
        return OpenDimension(Dimension(*fixed), activation, source)

    def __str__(self) -> str:
        if self == NO_DIMENSION:
            return "a plain number"
        above = [
            _power(word, power) for word, power in zip(self._fields[1:], self[1:], strict=True) if power > 0
        ]
        below = [
            _power(word, -power) for word, power in zip(self._fields[1:], self[1:], strict=True) if power < 0
        ]
        symbol = named_symbol(self.fixed)
        first = "*".join([*above, *([] if symbol.startswith("/") or symbol == "1" else [symbol])])
        return "/".join([first or "1", *below]) + (symbol if symbol.startswith("/") else "")


class DimensionError(ExpressionError):
    """A part of an expression whose dimensions do not fit together; its `offset` says where it begins.

    Attributes:
        found: The dimensions that were found.
    """

    def __init__(
        self,
        part: Expression,
        what: str,
        found: Sequence[OpenDimension],
        allowed: str,
        offset: int | None = None,
    ) -> None:
        """Name the part, what it does, and what is allowed instead.

        Args:
            part: The part.
            what: What it does, with `{}` for every dimension of `found`.
            found: The dimensions that were found.
            allowed: What is allowed.
            offset: Where it begins, if not at the part.
        """
        super().__init__(
            f"found '{part}'{what.format(*found)}; allowed: {allowed}",
            part.offset if offset is None else offset,
        )
        self.found = tuple(found)
        self._parts = (what, allowed)

    def of(self, text: str) -> str:
        """Return the message about a whole expression as it was written, with dimensions by their names."""
        what, allowed = self._parts
        return f"found '{text}'{what.format(*(each.fixed for each in self.found))}; allowed: {allowed}"


NO_DIMENSION = OpenDimension()
_ANGLE = OpenDimension(Dimension(angle=1))


def _power(word: str, power: int) -> str:
    return word if power == 1 else f"{word}^{power}"


def named_symbol(dimension: Dimension) -> str:
    """Return a named unit or its reciprocal, by or times the second if need be, rather than base units."""
    for seconds, power, (symbol, named) in product((0, -1, 1), (1, -1), _NAMED):
        if dimension == Dimension(time=seconds).times(named, power):
            above: list[str] = []
            below: list[str] = []
            (above if power == 1 else below).append(symbol)
            (above if seconds == 1 else below).extend(["s"] * abs(seconds))
            return "/".join(["*".join(above), *below])
    return dimension.si_symbol


def dimension_of(
    expression: Expression,
    names: Mapping[str, OpenDimension],
    known: Mapping[str, float] = MappingProxyType({}),
) -> OpenDimension | None:
    """Return the dimension of an expression; None if it is zero, which has any.

    Args:
        expression: The expression.
        names: The dimension of every name.
        known: Values of names, which then may be exponents of what has a dimension.

    Raises:
        DimensionError: It joins what does not fit together.
    """
    match expression:
        case Number(value=value, unit=unit):
            return OpenDimension(unit.dimension) if value or any(unit.dimension) else None
        case Name(name=name):
            return names[name]
        case Unary(operand=operand):
            return dimension_of(operand, names, known)
        case Binary():
            return _of_binary(expression, names, known)
        case Call(function=function, arguments=arguments):
            found = [dimension_of(argument, names, known) for argument in arguments]
            return _RULES.get(function, _of_plain)(expression, found)
    return None


def check_dimension(
    expression: Expression, names: Mapping[str, OpenDimension], wanted: OpenDimension
) -> None:
    """Refuse an expression that is of another dimension than this.

    Raises:
        ExpressionError: It is, or joins what does not fit together.
    """
    found = dimension_of(expression, names)
    if found not in {None, wanted}:
        message = f"found '{expression}', which is {found}; allowed: {wanted}"
        raise ExpressionError(message, expression.offset)


def _of_binary(
    expression: Binary, names: Mapping[str, OpenDimension], known: Mapping[str, float]
) -> OpenDimension | None:
    left, right = (dimension_of(each, names, known) for each in expression.operands())
    match expression.operator:
        case "*" | "/" as joint:
            if left is None or (right is None and joint == "*"):
                return None
            return left.times(right or NO_DIMENSION, 1 if joint == "*" else -1)
        case "**":
            return _of_power(expression, left, right, known)
    same = _alike(expression, [left, right])
    return NO_DIMENSION if expression.operator in COMPARISONS else same


def _of_power(
    expression: Binary,
    base: OpenDimension | None,
    exponent: OpenDimension | None,
    known: Mapping[str, float],
) -> OpenDimension | None:
    _of_plain(expression, [exponent])
    if base is None or base == NO_DIMENSION:
        return NO_DIMENSION
    numbers = {name: Number(known[name]) for name in expression.right.names() if name in known}
    value = constant(simplify(substitute(expression.right, numbers)))
    raised = None if value is None else base.raised(value)
    if raised is None:
        allowed = "a number as exponent that gives whole powers of the unit"
        raise DimensionError(expression, ", a power of {}", [base], allowed, expression.right.offset)
    return raised


def _alike(expression: Expression, found: list[OpenDimension | None]) -> OpenDimension | None:
    known = [dimension for dimension in found if dimension is not None]
    for other in known[1:]:
        if other != known[0]:
            pair = (known[0], other)
            raise DimensionError(expression, ", which joins {} and {}", pair, "the same on all sides")
    return known[0] if known else None


def _of_plain(expression: Expression, found: list[OpenDimension | None]) -> OpenDimension:
    for dimension in found:
        if dimension is not None and dimension != NO_DIMENSION:
            raise DimensionError(expression, " with {}", [dimension], "a plain number there")
    return NO_DIMENSION


def _of_angle(expression: Expression, found: list[OpenDimension | None]) -> OpenDimension:
    return NO_DIMENSION if found == [_ANGLE] else _of_plain(expression, found)


def _angle_between(expression: Expression, found: list[OpenDimension | None]) -> OpenDimension:
    _alike(expression, found)
    return _ANGLE


def _of_any(_: Expression, __: list[OpenDimension | None]) -> OpenDimension:
    return NO_DIMENSION


def _root(expression: Expression, found: list[OpenDimension | None]) -> OpenDimension | None:
    (square,) = found
    if square is None:
        return None
    if (root := square.raised(0.5)) is None:
        raise DimensionError(expression, ", the root of {}", [square], "even powers of a unit there")
    return root


def _of_choice(expression: Expression, found: list[OpenDimension | None]) -> OpenDimension | None:
    return _alike(expression, found[1:])


_Rule = Callable[[Expression, list[OpenDimension | None]], OpenDimension | None]
_RULES: Mapping[str, _Rule] = {
    **dict.fromkeys(("abs", "clip", "hypot", "max", "min"), _alike),
    **dict.fromkeys(("cos", "sin"), _of_angle),
    **dict.fromkeys(("heaviside", "sign"), _of_any),
    "atan2": _angle_between,
    "sqrt": _root,
    "where": _of_choice,
}
