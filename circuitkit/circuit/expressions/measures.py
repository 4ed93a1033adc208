"""Arithmetic with units: what an expression of a circuit file is computed with.

Sums, comparisons, minima and maxima need the same dimension; products and powers multiply dimensions; sine
and cosine take an angle or a plain number, `atan2` gives an angle; the other functions take plain numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, TypeAlias

from circuitkit.base.units import DIMENSIONLESS, Dimension, Unit, format_quantity
from circuitkit.circuit.expressions.expression import SCALAR_FUNCTIONS

# A float, or a numpy array with a value for each member of a population.
Number: TypeAlias = Any
Operand: TypeAlias = "Measure | Number"

_ANGLE = Dimension(angle=1)
_WHOLE = 1e-9


class MisfitError(Exception):
    """Units that cannot be joined in this way: what the expression does, and what is allowed instead."""

    def __init__(self, deed: str, allowed: str) -> None:
        super().__init__(deed, allowed)
        self.deed = deed
        self.allowed = allowed


@dataclass(frozen=True, slots=True, eq=False)
class Measure:
    """A number or an array with a unit.

    Attributes:
        value: The value, [SI].
        unit: The unit in which it is shown.
    """

    value: Number
    unit: Unit
    __array_ufunc__: ClassVar[None] = None  # numpy leaves the arithmetic to this class

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

    def __neg__(self) -> Measure:
        return Measure(-self.value, self.unit)

    def __pos__(self) -> Measure:
        return self

    def __add__(self, other: Operand) -> Measure:
        return Measure(self.value + _alike(self, other).value, self.unit)

    def __radd__(self, other: Operand) -> Measure:
        return measure(other) + self

    def __sub__(self, other: Operand) -> Measure:
        return Measure(self.value - _alike(self, other).value, self.unit)

    def __rsub__(self, other: Operand) -> Measure:
        return measure(other) - self

    def __mul__(self, other: Operand) -> Measure:
        factor = measure(other)
        return Measure(self.value * factor.value, _product(self.unit, factor.unit))

    def __rmul__(self, other: Operand) -> Measure:
        return measure(other) * self

    def __truediv__(self, other: Operand) -> Measure:
        divisor = measure(other)
        if divisor.unit == DIMENSIONLESS:
            return Measure(self.value / divisor.value, self.unit)
        return Measure(self.value / divisor.value, self.dimension.times(divisor.dimension, -1).si_unit)

    def __rtruediv__(self, other: Operand) -> Measure:
        return measure(other) / self

    def __pow__(self, other: Operand) -> Measure:
        power = _plain(other, "an exponent")
        if not any(self.dimension):
            return Measure(self.value**power, DIMENSIONLESS)
        if not isinstance(power, int | float):
            deed = f"raises {self.dimension} to a power that varies"
            raise MisfitError(deed, "a number without unit, or one exponent")
        return Measure(self.value**power, _power(self.dimension, power))

    def __rpow__(self, other: Operand) -> Measure:
        return measure(other) ** self

    def __lt__(self, other: Operand) -> Number:
        return self.value < _alike(self, other).value

    def __le__(self, other: Operand) -> Number:
        return self.value <= _alike(self, other).value

    def __gt__(self, other: Operand) -> Number:
        return self.value > _alike(self, other).value

    def __ge__(self, other: Operand) -> Number:
        return self.value >= _alike(self, other).value


def measure(operand: Operand) -> Measure:
    """The operand with a unit; a bare number or array is dimensionless."""
    return operand if isinstance(operand, Measure) else Measure(operand, DIMENSIONLESS)


def _alike(first: Measure, other: Operand) -> Measure:
    second = measure(other)
    if first.dimension != second.dimension:
        deed = f"joins {first.dimension} and {second.dimension}"
        raise MisfitError(deed, "sums of the same dimension")
    return second


def _product(first: Unit, second: Unit) -> Unit:
    if not any(second.dimension):
        return first
    return second if not any(first.dimension) else first.dimension.times(second.dimension).si_unit


def _power(dimension: Dimension, power: float) -> Unit:
    exponents = [exponent * power for exponent in dimension]
    whole = [round(exponent) for exponent in exponents]
    if any(abs(exponent - near) > _WHOLE for exponent, near in zip(exponents, whole, strict=True)):
        deed = f"takes the power {power:g} of {dimension}"
        raise MisfitError(deed, "powers that leave whole ones")
    return Dimension(*whole).si_unit


def _plain(operand: Operand, what: str) -> Number:
    value = measure(operand)
    if any(value.dimension):
        deed = f"has {value.dimension} as {what}"
        raise MisfitError(deed, "a number without unit there")
    return value.value


def _compute(name: str, *values: Number) -> Number:
    """A function of numbers, or of arrays, whichever they are."""
    if all(isinstance(value, int | float) for value in values):
        return SCALAR_FUNCTIONS[name](*values)
    return array_functions()[name](*values)


def array_functions() -> Mapping[str, Callable[..., Number]]:
    """The functions of expressions for numpy arrays."""
    import numpy as np  # 0.1 s, which most files are checked without

    renamed: dict[str, Callable[..., Number]] = {
        "atan2": np.arctan2,
        "exprel": lambda x: np.where(x == 0, 1.0, np.expm1(x) / np.where(x == 0, 1.0, x)),
        "heaviside": lambda x: np.heaviside(x, 1.0),
        "max": np.maximum,
        "min": np.minimum,
        "sigmoid": lambda x: 0.5 * (1.0 + np.tanh(0.5 * x)),
        "where": lambda condition, then, otherwise: np.where(condition != 0, then, otherwise),
    }
    return {name: renamed.get(name) or getattr(np, name) for name in SCALAR_FUNCTIONS}


def _of_plain(name: str, *operands: Operand) -> Measure:
    return Measure(_compute(name, *(_plain(each, f"argument of {name}") for each in operands)), DIMENSIONLESS)


def _of_any(name: str, operand: Operand) -> Measure:
    return Measure(_compute(name, measure(operand).value), DIMENSIONLESS)


def _of_angle(name: str, operand: Operand) -> Measure:
    angle = measure(operand)
    value = angle.value if angle.dimension == _ANGLE else _plain(angle, f"argument of {name}")
    return Measure(_compute(name, value), DIMENSIONLESS)


def _of_alike(name: str, first: Operand, *others: Operand) -> Measure:
    leading = measure(first)
    rest = [_alike(leading, other).value for other in others]
    return Measure(_compute(name, leading.value, *rest), leading.unit)


def _angle_between(name: str, first: Operand, second: Operand) -> Measure:
    return Measure(_of_alike(name, first, second).value, _ANGLE.si_unit)


def _root(name: str, operand: Operand) -> Measure:
    value = measure(operand)
    return Measure(_compute(name, value.value), _power(value.dimension, 0.5))


def _where(name: str, condition: Operand, then: Operand, otherwise: Operand) -> Measure:
    chosen = measure(then)
    other = _alike(chosen, otherwise).value
    return Measure(_compute(name, _plain(condition, "a condition"), chosen.value, other), chosen.unit)


_RULES: Mapping[str, Callable[..., Measure]] = {
    **dict.fromkeys(("abs", "clip", "hypot", "max", "min"), _of_alike),
    **dict.fromkeys(("cos", "sin"), _of_angle),
    **dict.fromkeys(("heaviside", "sign"), _of_any),
    "atan2": _angle_between,
    "sqrt": _root,
    "where": _where,
}
MEASURE_FUNCTIONS: Mapping[str, Callable[..., Measure]] = {
    name: partial(_RULES.get(name, _of_plain), name) for name in SCALAR_FUNCTIONS
}


def is_finite(value: Number) -> bool:
    """Whether a number, or every one of an array, is finite."""
    if isinstance(value, int | float):
        return math.isfinite(value)
    import numpy as np  # 0.1 s, which most files are checked without

    return bool(np.isfinite(value).all())
