"""Values of the circuit file: numbers, quantities, parameters, and expressions such as `2 * w - 5 mm`.

A number directly followed by a unit is a quantity; a unit that stands alone in an expression is one of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

from circuitkit.circuit.expression import CONSTANTS, SCALAR_FUNCTIONS, Expression, Name
from circuitkit.circuit.measures import MEASURE_FUNCTIONS, Measure, MisfitError, is_finite, measure
from circuitkit.circuit.parsing import parse_expression
from circuitkit.errors import ExpressionError, UnitError, listing, suggest
from circuitkit.source import describe
from circuitkit.units import DIMENSIONLESS, UNIT_SYMBOLS, Quantity, parse_quantity, parse_unit, plain_signs

_UNITS = frozenset(UNIT_SYMBOLS) - {"1", "%"}
_LONE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TOKEN = re.compile(
    r"(?P<number>(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,4})?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*)"
)
_UNIT_AFTER_NUMBER = re.compile(
    r"\s*(?P<over>/\s*|1/)?(?P<symbol>[A-Za-z%]+)(?:\s*\^\s*-?\d(?!\w))?(?![\w(])"
)
_FURTHER_UNIT = re.compile(r"\s*[*/]\s*(?P<symbol>[A-Za-z%]+)(?:\s*\^\s*-?\d(?!\w))?(?![\w(.])")
_NOT_FINITE = frozenset({"nan", "inf", "infinity"})
_FIRST_STAND_IN = 0x4E00  # one-letter names that no author writes, for quantities and names with dots


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
    quantities: Mapping[str, Measure]
    names: Mapping[str, tuple[str, int]]


def evaluate(value: object, look_up: LookUp) -> Quantity:
    """The quantity that a value of the file stands for.

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


def compute(value: object, look_up: LookUp, variables: Mapping[str, Measure] | None = None) -> Measure:
    """As `evaluate`, but with variables that may be arrays, such as `i`; the result may then be one.

    Raises:
        ValueProblemError: See `evaluate`.
        LostNameError: See `evaluate`.
    """
    if (complaint := not_a_value(value)) is not None:
        raise ValueProblemError(complaint)
    if not isinstance(value, str):
        return Measure(_finite(value), DIMENSIONLESS)  # type: ignore[arg-type]  # a number
    read = _read(value)
    if isinstance(read, Quantity):
        return Measure(read.value_si, read.unit)
    names = {key: _named(read, key, look_up, variables or {}) for key in read.names}
    return _computed(read, {**read.quantities, **names})


def names_in(value: object) -> frozenset[str]:
    """The names that a value of the file mentions, of whatever kind."""
    if not isinstance(value, str):
        return frozenset()
    return frozenset(match["name"] for match in _TOKEN.finditer(value) if match["name"])


def _computed(formula: _Formula, values: Mapping[str, Measure]) -> Measure:
    try:
        found = measure(formula.tree.evaluate(values, MEASURE_FUNCTIONS))
    except MisfitError as error:
        message = f"found '{formula.text}', which {error.deed}; allowed: {error.allowed}"
        raise ValueProblemError(message) from error
    except (ArithmeticError, ValueError) as error:
        message = f"found '{formula.text}', which has no value ({error}); allowed: a finite number"
        raise ValueProblemError(message) from error
    if isinstance(found.value, complex) or not is_finite(found.value):
        message = f"found '{formula.text}', which is too large or no number; allowed: a finite number"
        raise ValueProblemError(message)
    return found


def _named(formula: _Formula, key: str, look_up: LookUp, variables: Mapping[str, Measure]) -> Measure:
    """What a name in an expression stands for: a variable, a parameter, a constant, or a unit."""
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
            return Measure(CONSTANTS[name], DIMENSIONLESS)
        is_alone = isinstance(formula.tree, Name)
        if name in _UNITS and not is_alone:
            return Measure(parse_unit(name).scale, parse_unit(name))
        hint = f"did you mean '1 {name}'?" if name in _UNITS else error.hint
        raise ValueProblemError(error.message, hint, offset) from error
    return Measure(quantity.value_si, quantity.unit)


@lru_cache(maxsize=8192)
def _read(text: str) -> Quantity | _Formula:
    """A text of the file as a quantity or an expression.

    Raises:
        ValueProblemError: It is neither.
    """
    stripped = text.strip()
    if _LONE_NAME.fullmatch(stripped):
        return _Formula(text, Name(stripped), {}, {stripped: (stripped, text.index(stripped))})
    try:
        return parse_quantity(stripped)
    except UnitError as error:
        refusal = error
    formula, stand_ins = _with_stand_ins(plain_signs(text))
    try:
        tree = parse_expression(formula, stand_ins.everything)
    except ExpressionError as error:
        if not stand_ins.names and not stand_ins.has_operator(formula):
            raise ValueProblemError(str(refusal)) from error  # a number, and something that is no unit
        message = stand_ins.as_written(str(error), formula, text)
        raise ValueProblemError(message, offset=getattr(error, "offset", 0)) from error
    return _Formula(text, tree, stand_ins.quantities, stand_ins.names)


class _StandIns:
    """Names that take the place of quantities and of names with dots, letter for letter."""

    def __init__(self) -> None:
        self.quantities: dict[str, Measure] = {}
        self.names: dict[str, tuple[str, int]] = {}
        self.texts: dict[str, str] = {}

    def add(self, text: str) -> str:
        """A stand-in as long as the text."""
        name = chr(_FIRST_STAND_IN + len(self.texts)) + "_" * (len(text) - 1)
        self.texts[name] = text
        return name

    @property
    def everything(self) -> list[str]:
        """All names that the expression then has."""
        return [*self.quantities, *self.names]

    @staticmethod
    def has_operator(formula: str) -> bool:
        """Whether anything is joined in it."""
        return any(sign in formula.strip().lstrip("+-") for sign in "+-*/(^<>")

    def as_written(self, message: str, formula: str, text: str) -> str:
        """A message with the author's own text instead of stand-ins."""
        message = message.replace(formula, text)
        for name, written in self.texts.items():
            message = message.replace(name, written)
        return message


def _with_stand_ins(text: str) -> tuple[str, _StandIns]:
    """The text with stand-ins, as long as before, and what they stand for.

    Raises:
        ValueProblemError: A number is followed by something that is no unit.
    """
    stand_ins = _StandIns()
    pieces: list[str] = []
    position = 0
    while (match := _TOKEN.search(text, position)) is not None:
        pieces.append(text[position : match.start()])
        position = match.end()
        if match["number"]:
            position = _end_of_unit(text, position)
            piece = text[match.start() : position]
            if position > match.end():
                key = stand_ins.add(piece)
                quantity = parse_quantity(piece)
                stand_ins.quantities[key] = Measure(quantity.value_si, quantity.unit)
                piece = key
        else:
            piece = name = match["name"]
            if not (name in SCALAR_FUNCTIONS and text[position:].lstrip().startswith("(")):
                piece = stand_ins.add(name) if "." in name else name
                stand_ins.names.setdefault(piece, (name, match.start()))
        pieces.append(piece)
    return "".join((*pieces, text[position:])), stand_ins


def _end_of_unit(text: str, start: int) -> int:
    """Where the unit after a number ends; where it starts if there is none."""
    match = _UNIT_AFTER_NUMBER.match(text, start)
    if match is None:
        return start
    if match["symbol"] not in _UNITS and match["symbol"] != "%":
        if match["over"]:
            return start
        try:
            parse_unit(match["symbol"])
        except UnitError as error:
            raise ValueProblemError(str(error), offset=match.start("symbol")) from error
    end = match.end()
    while (match := _FURTHER_UNIT.match(text, end)) is not None and match["symbol"] in _UNITS:
        end = match.end()
    return end


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
    """The complaint about something that is neither a number nor a text; None if it is one."""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        return None
    return f"found {describe(value)}; allowed: a number, a quantity such as '-80 mm', or a parameter"


def unknown_parameter(name: str, parameters: Iterable[str]) -> ValueProblemError:
    """The complaint about a name that is no parameter."""
    known = tuple(parameters)
    allowed = f"a number, a quantity such as '-80 mm', or a parameter: {listing(known)}"
    return ValueProblemError(f"unknown parameter '{name}'; allowed: {allowed}", suggest(name, known))
