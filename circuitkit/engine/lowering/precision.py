"""All numbers of a circuit in the precision in which it is computed: rounded once, here, for all backends."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from circuitkit.engine.operations import FloatArray, Lowered, Map, Noise, Operation, Sum


def in_single_precision(lowered: Lowered) -> Lowered:
    """Round all constants, weights and initial values to float32; what it cannot hold becomes infinite."""
    rounding = _Rounding()
    with np.errstate(over="ignore"):
        return replace(
            lowered,
            before=tuple(map(rounding.operation, lowered.before)),
            substep=tuple(map(rounding.operation, lowered.substep)),
            after=tuple(map(rounding.operation, lowered.after)),
            initial=lowered.initial.astype(np.float32).astype(np.float64),  # as states are
        )


class _Rounding:
    """Rounds every array once, so that operations go on to share them."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[FloatArray, npt.NDArray[Any]]] = {}

    def operation(self, operation: Operation) -> Operation:
        match operation:
            case Sum():
                return replace(operation, weights=self._rounded(operation.weights))
            case Noise():
                return replace(operation, scale=self._rounded(operation.scale))
            case Map():
                constants = {name: self._rounded(each) for name, each in operation.constants.items()}
                return replace(operation, constants=constants)
        return operation

    def _rounded(self, values: FloatArray) -> npt.NDArray[Any]:
        if id(values) not in self._known:
            # The values are held as well, so that their identity stays taken.
            self._known[id(values)] = values, np.asarray(values, np.float32)
        return self._known[id(values)][1]
