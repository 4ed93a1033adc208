"""Values of the circuit file: numbers, quantities, parameters, and expressions such as `2 * w - 5 mm`.

A number directly followed by a unit is a quantity; a unit that stands alone in an expression is one of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, TypeAlias

from circuitkit.base.errors import ExpressionError, OutOfRangeError, UnitError, listing, suggest
from circuitkit.base.source import describe
from circuitkit.base.units import (
    DIMENSIONLESS,
    UNIT_SYMBOLS,
    Dimension,
    Quantity,
    Unit,
    format_quantity,
    parse_quantity,
    parse_unit,
    plain_signs,
)
from circuitkit.circuit.expressions.dimensions import DimensionError, OpenDimension, dimension_of
from circuitkit.circuit.expressions.expression import CONSTANTS, SCALAR_FUNCTIONS, Expression, Name
from circuitkit.circuit.expressions.parsing import parse_expression, with_stand_ins

# A float, or a numpy array.
Number: TypeAlias = Any


@dataclass(frozen=True, slots=True, eq=False)
class Amount:
    """A number or an array with a unit.

    Attributes:
        value: The value, [SI].
        unit: The unit in which it is shown.
    """

    value: Number
    unit: Unit

    @property
    def dimension(self) -> Dimension:
        """The dimension of the unit."""
        return self.unit.dimension

    def __str__(self) -> str:
        if isinstance(self.value, int | float):
            return format_quantity(self.value, self.unit)
        bounds = (float(self.value.min()), float(self.value.max()))
        lowest, highest = (format_quantity(bound, self.unit) for bound in bounds)
        return f"values from {lowest} to {highest}"


def is_finite(value: Number) -> bool:
    """Check whether a number, or every one of an array, is finite."""
    if isinstance(value, int | float):
        return math.isfinite(value)
    import numpy as np  # 0.1 s, which most files are checked without

    return bool(np.isfinite(value).all())


def _compute(name: str, *values: Number) -> Number:
    """Compute a function of numbers, or of arrays, whichever they are."""
    if all(isinstance(value, int | float) for value in values):
        return SCALAR_FUNCTIONS[name](*values)
    from circuitkit.circuit.expressions.arrays import ARRAY_FUNCTIONS  # brings numpy: 0.1 s

    return ARRAY_FUNCTIONS[name](*values)


AMOUNT_FUNCTIONS: Mapping[str, Callable[..., Number]] = {
    name: partial(_compute, name) for name in SCALAR_FUNCTIONS
}


_UNITS = frozenset(UNIT_SYMBOLS) - {"1", "%"}
_LONE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_NAME = re.compile(r"(?<![\w.])(?P<name>[^\W\d]\w*(?:\.[A-Za-z_]\w*)*)(?P<opening>\s*\()?")
_IS_JOINED = re.compile(r"\b(?:if|and|or|not)\b|[A-Za-z_]\s*\(|.[-+*/^<>]|^[^\d.+-]")
_WORDS = frozenset({"and", "not", "or"})
_NOT_FINITE = frozenset({"nan", "inf", "infinity"})


class ValueProblemError(Exception):
    """A value cannot be used: what was found and what is allowed, a hint, and where in it."""

    def __init__(self, message: str, hint: str = "", offset: int = 0) -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint
        self.offset = offset


class LostNameError(Exception):
    """A value names something that is declared but unsound, which is reported where it is declared."""


LookUp = Callable[[str], Quantity]


@dataclass(frozen=True)
class _Formula:
    """An expression of the file.

    Attributes:
        text: As written.
        tree: With a stand-in for every quantity and every name with dots.
        quantities: By stand-in.
        names: The others: stand-in or name, with the name and where it stands.
    """

    text: str
    tree: Expression
    quantities: Mapping[str, Amount]
    names: Mapping[str, tuple[str, int]]


def evaluate(value: object, look_up: LookUp) -> Quantity:
    """Return the quantity that a value of the file stands for.

    Args:
        value: As written: a number or a text; anything else is complained about.
        look_up: Gives the value of a parameter.

    Raises:
        ValueProblemError: It is no value, is not finite, or joins what does not fit together.
        LostNameError: It names an unsound parameter.
    """
    if isinstance(value, float | int) and not isinstance(value, bool):
        return Quantity(_finite(value), DIMENSIONLESS)
    found = compute(value, look_up)
    return Quantity(float(found.value), found.unit)


def compute(value: object, look_up: LookUp, variables: Mapping[str, Amount] | None = None) -> Amount:
    """As `evaluate`, but with variables that may be arrays, such as `i`; the result may then be one.

    Raises:
        ValueProblemError: See `evaluate`.
        LostNameError: See `evaluate`.
    """
    if (complaint := not_a_value(value)) is not None:
        raise ValueProblemError(complaint)
    if not isinstance(value, str):
        return Amount(_finite(value), DIMENSIONLESS)  # type: ignore[arg-type]  # a number
    read = _read(value)
    if isinstance(read, Quantity):
        return Amount(read.value_si, read.unit)
    names = {key: _named(read, key, look_up, variables or {}) for key in read.names}
    amounts = {**read.quantities, **names}
    if not variables:
        return _computed(read, amounts)
    import numpy as np  # 0.1 s, which most files are checked without

    with np.errstate(all="ignore"):  # what is not finite is complained about with its place
        return _computed(read, amounts)


def names_in(value: object) -> frozenset[str]:
    """Return the names that a value of the file mentions, of whatever kind."""
    if not isinstance(value, str):
        return frozenset()
    return frozenset(match["name"] for match in _NAME.finditer(value))


def _computed(formula: _Formula, amounts: Mapping[str, Amount]) -> Amount:
    unit = _unit(formula, amounts)
    try:
        value = formula.tree.evaluate({name: each.value for name, each in amounts.items()}, AMOUNT_FUNCTIONS)
    except (ArithmeticError, ValueError) as error:
        message = f"found '{formula.text}', which has no value ({error}); allowed: a finite number"
        raise ValueProblemError(message) from error
    if not is_finite(value):
        message = f"found '{formula.text}', which is too large or no number; allowed: a finite number"
        raise ValueProblemError(message)
    return Amount(value, unit)


def _unit(formula: _Formula, amounts: Mapping[str, Amount]) -> Unit:
    """Find the unit to show a value in: the first one in the text that is of its dimension, or that of SI."""
    dimensions = {name: OpenDimension(each.dimension) for name, each in amounts.items()}
    known = {name: each.value for name, each in amounts.items() if isinstance(each.value, int | float)}
    try:
        found = dimension_of(formula.tree, dimensions, known)
    except DimensionError as error:
        raise ValueProblemError(error.of(formula.text)) from error
    units = [amounts[name].unit for name in _in_order(formula.tree)]
    if found is None:  # 0, which is of any dimension
        return next((unit for unit in units if unit != DIMENSIONLESS), DIMENSIONLESS)
    same = (unit for unit in units if unit.dimension == found.fixed)
    return next(same, found.fixed.si_unit if any(found.fixed) else DIMENSIONLESS)


def _in_order(expression: Expression) -> Iterator[str]:
    """Yield the names in an expression, from left to right."""
    if isinstance(expression, Name):
        yield expression.name
    for operand in expression.operands():
        yield from _in_order(operand)


def _named(formula: _Formula, key: str, look_up: LookUp, variables: Mapping[str, Amount]) -> Amount:
    """Find what a name in an expression stands for: a variable, a parameter, a constant, or a unit."""
    name, offset = formula.names[key]
    if name in variables:
        return variables[name]
    if name.lower() in _NOT_FINITE:
        message = f"found '{name}'; allowed: a finite number"
        raise ValueProblemError(message, offset=offset)
    try:
        quantity = look_up(name)
    except ValueProblemError as error:
        if name in CONSTANTS:
            return Amount(CONSTANTS[name], DIMENSIONLESS)
        is_alone = isinstance(formula.tree, Name)
        if name in _UNITS and not is_alone:
            return Amount(parse_unit(name).scale, parse_unit(name))
        hint = f"did you mean '1 {name}'?" if name in _UNITS else error.hint
        raise ValueProblemError(error.message, hint, offset) from error
    return Amount(quantity.value_si, quantity.unit)


@lru_cache(maxsize=8192)
def _read(text: str) -> Quantity | _Formula:
    """Read a text of the file as a quantity or an expression.

    Raises:
        ValueProblemError: It is neither.
    """
    stripped = text.strip()
    if _LONE_NAME.fullmatch(stripped):
        return _Formula(text, Name(stripped), {}, {stripped: (stripped, text.index(stripped))})
    try:
        return parse_quantity(stripped)
    except OutOfRangeError as error:
        raise ValueProblemError(str(error)) from error
    except UnitError as error:
        refusal = error
    try:
        return _formula(text)
    except ExpressionError as error:
        is_unit = isinstance(error.__cause__, UnitError)
        if is_unit or _IS_JOINED.search(stripped) or not stripped:
            raise ValueProblemError(str(error), offset=error.offset) from error
        raise ValueProblemError(str(refusal)) from error  # a number, and something that is no unit


def _formula(text: str) -> _Formula:
    """Return a text of the file as an expression.

    Raises:
        ExpressionError: It is none.
    """
    formula, stand_ins = with_stand_ins(plain_signs(text))
    names: dict[str, tuple[str, int]] = {}
    pieces, position = [], 0
    for match in _NAME.finditer(formula):
        name = match["name"]
        is_name = name not in stand_ins.quantities and name not in _WORDS
        if is_name and not (name in SCALAR_FUNCTIONS and match["opening"]):
            piece = stand_ins.add(name) if "." in name else name
            names.setdefault(piece, (name, match.start()))
            pieces += [formula[position : match.start()], piece]
            position = match.end("name")
    formula = "".join((*pieces, formula[position:]))
    try:
        tree = parse_expression(formula, (*names, *stand_ins.quantities))
    except ExpressionError as error:
        message = stand_ins.as_written(str(error).replace(formula, text))
        raise ExpressionError(message, error.offset) from error
    quantities = {key: Amount(each.value_si, each.unit) for key, each in stand_ins.quantities.items()}
    return _Formula(text, tree, quantities, names)


def _finite(number: float) -> float:
    try:
        value = float(number)
    except OverflowError:
        value = float("inf")
    if not is_finite(value):
        message = f"found '{number}', which is too large; allowed: a finite number"
        raise ValueProblemError(message)
    return value


def not_a_value(value: object) -> str | None:
    """Return the complaint about something that is neither a number nor a text; None if it is one."""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        return None
    return f"found {describe(value)}; allowed: a number, a quantity such as '-80 mm', or a parameter"


def unknown_parameter(name: str, parameters: Iterable[str], *, hint: bool = True) -> ValueProblemError:
    """Return the complaint about a name that is no parameter, perhaps with the one that was meant."""
    known = tuple(parameters)
    allowed = f"a number, a quantity such as '-80 mm', or a parameter: {listing(known)}"
    return ValueProblemError(
        f"unknown parameter '{name}'; allowed: {allowed}", suggest(name, known) if hint else ""
    )
