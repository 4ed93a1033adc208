"""The functions of expressions for numpy arrays; apart, since most files are checked without numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from circuitkit.circuit.expressions.expression import SCALAR_FUNCTIONS

Array: TypeAlias = Any

_RENAMED: Mapping[str, Callable[..., Array]] = {
    "atan2": np.arctan2,
    "exprel": lambda x: np.where(x == 0, 1.0, np.expm1(x) / np.where(x == 0, 1.0, x)),
    "heaviside": lambda x: np.heaviside(x, 1.0),
    "max": np.maximum,
    "min": np.minimum,
    "sigmoid": lambda x: 0.5 * (1.0 + np.tanh(0.5 * x)),
    "where": lambda condition, then, otherwise: np.where(condition != 0, then, otherwise),
}
ARRAY_FUNCTIONS: Mapping[str, Callable[..., Array]] = {
    name: _RENAMED.get(name) or getattr(np, name) for name in SCALAR_FUNCTIONS
}
