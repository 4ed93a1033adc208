"""Quantities with units: text such as `-80 mm` or `1.63 deg` to SI values, and back.

Everything inside circuitkit is in SI units; a unit is met only where a file is read or a number is shown.
Angle is a dimension of its own (in SI it is not), so that degrees against metres, and degrees against plain
numbers, are both caught. A number without a unit is dimensionless.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from circuitkit.base.errors import OutOfRangeError, UnitError, listing, suggest


class Dimension(NamedTuple):
    """Exponents of the base dimensions; a velocity is `Dimension(length=1, time=-1)`."""

    length: int = 0
    mass: int = 0
    time: int = 0
    angle: int = 0
    current: int = 0
    temperature: int = 0

    def times(self, other: Dimension, power: int = 1) -> Dimension:
        """Dimension of the product `self * other ** power`."""
        if not power or other == _NO_DIMENSION:
            return self
        return Dimension(*(mine + power * theirs for mine, theirs in zip(self, other, strict=True)))

    @property
    def si_symbol(self) -> str:
        """The SI unit of this dimension, such as `m/s`, `/m` or `S`; `1` if dimensionless."""
        if self in _NAMED:
            return _NAMED[self][0]
        text = _fraction_text(self, ("m", "kg", "s", "rad", "A", "K"))
        return text.removeprefix("1") if any(self) else "1"

    @property
    def si_unit(self) -> Unit:
        """The SI unit of this dimension, as a unit."""
        return Unit(self.si_symbol, Fraction(1), self)

    def __str__(self) -> str:
        if self in _NAMED:
            return _NAMED[self][1]
        return _fraction_text(self, self._fields) if any(self) else "dimensionless"


_NO_DIMENSION = Dimension()


def _fraction_text(exponents: tuple[int, ...], names: tuple[str, ...]) -> str:
    powers = list(zip(names, exponents, strict=True))
    above = [name if e == 1 else f"{name}^{e}" for name, e in powers if e > 0]
    below = [name if e == -1 else f"{name}^{-e}" for name, e in powers if e < 0]
    return "/".join(["*".join(above) or "1", *below])


def _divided(numerator: int, denominator: int) -> float:
    """A quotient of whole numbers; infinite where no float is so large."""
    try:
        return numerator / denominator
    except OverflowError:
        return math.inf if numerator > 0 else -math.inf


@dataclass(frozen=True)
class Unit:
    """A unit of measurement.

    Attributes:
        symbol: As written, such as `deg/s`; `1` for dimensionless.
        factor: SI value of one unit, exact (the factor of `mm` is 1/1000).
        dimension: Its dimension.
    """

    symbol: str
    factor: Fraction
    dimension: Dimension

    @property
    def scale(self) -> float:
        """SI value of one unit, as a float."""
        return float(self.factor)

    def to_si(self, value: float | Fraction) -> float:
        """SI value of `value` in this unit, rounded once: 79.9 mm is 0.0799, to the last bit."""
        numerator, denominator = value.as_integer_ratio()
        return _divided(numerator * self.factor.numerator, denominator * self.factor.denominator)

    def from_si(self, value_si: float) -> float:
        """Value in this unit of an SI value; infinities stay what they are."""
        if not math.isfinite(value_si):
            return value_si
        numerator, denominator = value_si.as_integer_ratio()
        return _divided(numerator * self.factor.denominator, denominator * self.factor.numerator)

    def over(self, other: Unit) -> Unit:
        """This unit divided by another one, written so that it can be read: `s` over `rad` is `s/rad`.

        Every factor of the other one changes its side, for each `/` divides by one factor: the reciprocal of
        `rad/s` is `s/rad`.
        """
        below = ((factor, "/" if sign == "*" else "*") for factor, sign in _factors(other.symbol))
        factors = [*_factors(self.symbol), *below]
        above = "*".join(factor for factor, sign in factors if sign == "*" and factor != "1")
        under = "".join(f"/{factor}" for factor, sign in factors if sign == "/" and factor != "1")
        dimension = self.dimension.times(other.dimension, -1)
        return Unit(above + under or "1", self.factor / other.factor, dimension)

    def __str__(self) -> str:
        return self.symbol


DIMENSIONLESS = Unit("1", Fraction(1), Dimension())


@dataclass(frozen=True)
class Quantity:
    """A number with a unit.

    Attributes:
        value_si: The value in SI units.
        unit: The unit in which it was written and is shown.
    """

    value_si: float
    unit: Unit

    @property
    def dimension(self) -> Dimension:
        """The dimension of the unit."""
        return self.unit.dimension

    def __neg__(self) -> Quantity:
        return Quantity(-self.value_si, self.unit)

    def __str__(self) -> str:
        return format_quantity(self.value_si, self.unit)


def _base(power_of_ten: int = 0, **exponents: int) -> tuple[Fraction, Dimension]:
    return Fraction(10) ** power_of_ten, Dimension(**exponents)


def _of(number: int | Fraction, **exponents: int) -> tuple[Fraction, Dimension]:
    return Fraction(number), Dimension(**exponents)


_MECHANICAL = {
    "m": _base(length=1),
    "km": _base(3, length=1),
    "cm": _base(-2, length=1),
    "mm": _base(-3, length=1),
    "um": _base(-6, length=1),
    "kg": _base(mass=1),
    "g": _base(-3, mass=1),
    "s": _base(time=1),
    "ms": _base(-3, time=1),
    "us": _base(-6, time=1),
    "min": _of(60, time=1),
    "h": _of(3600, time=1),
    "Hz": _base(time=-1),
    "kHz": _base(3, time=-1),
    "rad": _base(angle=1),
    "mrad": _base(-3, angle=1),
    "deg": _of(Fraction(math.pi) / 180, angle=1),
    "N": _base(length=1, mass=1, time=-2),
    "mN": _base(-3, length=1, mass=1, time=-2),
    "kN": _base(3, length=1, mass=1, time=-2),
    "Pa": _base(length=-1, mass=1, time=-2),
    "J": _base(length=2, mass=1, time=-2),
    "W": _base(length=2, mass=1, time=-3),
}
_ELECTRICAL = {
    "A": {"current": 1},
    "V": {"length": 2, "mass": 1, "time": -3, "current": -1},
    "ohm": {"length": 2, "mass": 1, "time": -3, "current": -2},
    "S": {"length": -2, "mass": -1, "time": 3, "current": 2},
    "F": {"length": -2, "mass": -1, "time": 4, "current": 2},
}
_PREFIXES = {"M": 6, "k": 3, "": 0, "m": -3, "u": -6, "n": -9, "p": -12}
_SYMBOLS: dict[str, tuple[Fraction, Dimension]] = {
    "1": _base(),
    "%": _base(-2),
    "K": _base(temperature=1),
    **_MECHANICAL,
    **{
        prefix + symbol: _base(power, **exponents)
        for symbol, exponents in _ELECTRICAL.items()
        for prefix, power in _PREFIXES.items()
    },
}
UNIT_SYMBOLS: tuple[str, ...] = tuple(_SYMBOLS)
# What a message lists: without the prefixes of electrical units.
LISTED_SYMBOLS: tuple[str, ...] = ("1", "%", *_MECHANICAL, *_ELECTRICAL)
# Dimensions that are better known by a unit and a word of their own than by base units.
_WORDS = {"N": "force", "V": "voltage", "ohm": "resistance", "S": "conductance", "F": "capacitance"}
_NAMED = {_SYMBOLS[symbol][1]: (symbol, word) for symbol, word in _WORDS.items()}

# Typographic signs that copied text carries, and what they mean here.
_TYPOGRAPHY = str.maketrans(
    {"\N{MINUS SIGN}": "-", "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "\N{MIDDLE DOT}": "*"}
    | {"\N{DEGREE SIGN}": "deg", "\N{OHM SIGN}": "ohm", "\N{GREEK CAPITAL LETTER OMEGA}": "ohm"}
    | {"\N{SUPERSCRIPT TWO}": "^2", "\N{SUPERSCRIPT THREE}": "^3"}
)
_FACTOR = re.compile(r"(?P<symbol>[A-Za-z%]+|1)(?:\^(?P<power>-?[0-9]))?")
_NUMBER = re.compile(
    r"(?P<number>[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,4})?)"
    r"(?:\s+(?P<quotient>1(?:\s*[*/^].*)?)|\s*(?P<unit>[^\d.,_:\s].*))?"
)
_MAX_LENGTH = 80
_LONGEST = 500  # of a number with its unit
_SMALLEST_UNIT = Fraction(1, 10**250)  # one that floats have room around, above as below


def plain_signs(text: str) -> str:
    """The text with the signs of this language for the typographic ones that copied text carries."""
    return text.translate(_TYPOGRAPHY)


@lru_cache(maxsize=1024)
def parse_unit(text: str) -> Unit:
    """Read a unit: symbols with powers, joined by `*` and `/`, such as `deg/s`, `kg*m^2`, `/m`, `1`.

    Every `/` divides by the one factor after it: `N/m/s` is `N/(m*s)`.

    Raises:
        UnitError: The text is not a unit; names the part that is wrong and the symbols there are.
    """
    compact = re.sub(r"\s*([*/^])\s*", r"\1", text.translate(_TYPOGRAPHY).strip())
    if not compact or len(compact) > _MAX_LENGTH:
        message = f"found '{text[:_MAX_LENGTH]}'; allowed: a unit such as 'mm' or '1'"
        raise UnitError(message)
    factor, dimension = Fraction(1), Dimension()
    for piece, sign in _factors(compact):
        part_factor, part_dimension, power = _parse_factor(piece, text)
        power = -power if sign == "/" else power
        factor *= part_factor**power
        dimension = dimension.times(part_dimension, power)
    if not _SMALLEST_UNIT < factor < 1 / _SMALLEST_UNIT:
        message = f"found the unit '{text}', which is too large or too small; allowed: powers that matter"
        raise UnitError(message)
    return Unit(compact, factor, dimension)


def _factors(symbol: str) -> list[tuple[str, str]]:
    """The factors of a unit's symbol, each with `*` or `/` before it: `/m` is 1 / m."""
    pieces = re.split(r"([*/])", f"1{symbol}" if symbol.startswith("/") else symbol)
    return list(zip(pieces[::2], ["*", *pieces[1::2]], strict=True))


def _parse_factor(piece: str, whole: str) -> tuple[Fraction, Dimension, int]:
    match = _FACTOR.fullmatch(piece)
    if match is None:
        allowed = "symbols joined by * and /, with powers such as ^2"
        message = f"cannot read '{piece}' in the unit '{whole}'; allowed: {allowed}"
        raise UnitError(message)
    symbol = match["symbol"]
    if symbol not in _SYMBOLS:
        hint = suggest(symbol, UNIT_SYMBOLS)
        message = f"unknown unit '{symbol}'; allowed: {listing(LISTED_SYMBOLS)}"
        raise UnitError(f"{message}; {hint}" if hint else message)
    factor, dimension = _SYMBOLS[symbol]
    return factor, dimension, int(match["power"] or 1)


@lru_cache(maxsize=4096)
def parse_quantity(text: str) -> Quantity:
    """Read a number with its unit: `-80 mm`, `1.63 deg`, `100 /m`, `5 %`, `0.1`.

    Raises:
        UnitError: The text is no finite number followed by a unit.
    """
    match = _NUMBER.fullmatch(text.translate(_TYPOGRAPHY).strip()) if len(text) <= _LONGEST else None
    if match is None:
        allowed = "a number, with a unit if it has one, such as '-80 mm' or '0.1'"
        message = f"found '{text[:_MAX_LENGTH]}'; allowed: {allowed}"
        raise UnitError(message)
    symbol = match["unit"] or match["quotient"]
    unit = parse_unit(symbol) if symbol else DIMENSIONLESS
    numerator, denominator = _ratio(match["number"])
    value_si = _divided(numerator * unit.factor.numerator, denominator * unit.factor.denominator)
    if not math.isfinite(value_si):
        message = f"found '{text[:_MAX_LENGTH]}', which is too large; allowed: a finite number"
        raise OutOfRangeError(message)
    if numerator and not value_si:
        message = f"found '{text[:_MAX_LENGTH]}', which is too small; allowed: 0, or what a float can hold"
        raise OutOfRangeError(message)
    return Quantity(value_si, unit)


def _ratio(number: str) -> tuple[int, int]:
    """Numerator and denominator of a decimal number, exactly: 79.9 is 799 / 10."""
    mantissa, _, exponent = number.lower().partition("e")
    whole, _, decimals = mantissa.partition(".")
    power = int(exponent or 0) - len(decimals)
    return int(whole + decimals) * 10 ** max(power, 0), 10 ** max(-power, 0)


def format_quantity(value_si: float, unit: Unit, digits: int = 6) -> str:
    """Show an SI value in a unit, such as `-80 mm`; what comes out can be read by `parse_quantity`.

    Args:
        value_si: The value in SI units.
        unit: The unit to show it in.
        digits: Significant digits.
    """
    number = f"{unit.from_si(value_si):.{digits}g}"
    return number if unit.symbol == "1" else f"{number} {unit.symbol}"
