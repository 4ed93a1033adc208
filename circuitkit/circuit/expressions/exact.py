"""SI values as texts of a circuit file that read back to the very same value."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

from circuitkit.base.units import DIMENSIONLESS, Unit, parse_quantity

SAFE_DIGITS = 15  # a decimal number of so many digits survives being a float
MOST_DIGITS = 17  # with so many, every float is told from its neighbours
MANY_DIGITS = 25  # with so many, it still is after conversion to another unit


def exact(value_si: float, unit: Unit) -> float | str:
    """Write an SI value as a number or a text such as `-80 mm` that reads back to exactly it.

    Args:
        value_si: The value, [SI].
        unit: The unit to write it in.
    """
    if unit == DIMENSIONLESS:
        return int(value_si) if value_si == int(value_si) else value_si
    number = unit.from_si(value_si)
    for digits in range(SAFE_DIGITS, MOST_DIGITS + 1):  # zeros at the end fall away by themselves
        text = _with_unit(float(f"{number:.{digits}g}"), unit.symbol)
        if parse_quantity(text).value_si == value_si:
            return text
    exact_value = Fraction(value_si) / unit.factor  # no float in this unit reads back exactly, but this does
    with localcontext(prec=MANY_DIGITS):
        decimal = Decimal(exact_value.numerator) / Decimal(exact_value.denominator)
    return f"{decimal} {unit}"


def _with_unit(number: float, symbol: str) -> str:
    """`80 mm`; `100 /m` for the unit `1/m`."""
    unit = symbol.removeprefix("1") if symbol.startswith("1/") else symbol
    return f"{repr(number).removesuffix('.0')} {unit}"
