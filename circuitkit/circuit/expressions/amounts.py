"""Amounts: numbers with a unit, or arrays of them with a value for each member of a population."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from circuitkit.base.units import Dimension, Unit, format_quantity
from circuitkit.circuit.expressions.expression import SCALAR_FUNCTIONS

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
