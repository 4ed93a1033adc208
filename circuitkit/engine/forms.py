"""Which equations can be computed side by side: one or two elements like `function(gain * (A - offset))`.

A sigmoid is one element, a window two of them multiplied. Neurons of different models whose elements share a
function then need one subtraction, one multiplication and one call of the function together, instead of one
each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from circuitkit.circuit.expression import Binary, Call, Expression, Name, Number, Unary
from circuitkit.circuit.models.model import ACTIVATION

_A = Name(ACTIVATION)
GAIN, OFFSET, FIRST, SECOND = Name("gain"), Name("offset"), Name("first"), Name("second")


@dataclass(frozen=True)
class Element:
    """`function(gain * (A - offset))`; gain and offset are expressions in the model's parameters.

    Attributes:
        function: Name of a function of one argument.
        gain: In front of the difference, [1/unit of A].
        offset: Activation at which the argument is zero, [unit of A].
    """

    function: str
    gain: Expression
    offset: Expression

    @property
    def equation(self) -> Expression:
        """The element in terms of `A`, `gain` and `offset`."""
        return Call(self.function, (Binary("*", GAIN, Binary("-", _A, OFFSET)),))

    def values(self, parameters: Mapping[str, float]) -> tuple[float, float]:
        """Gain and offset of a neuron with these parameters."""
        return float(self.gain.evaluate(parameters)), float(self.offset.evaluate(parameters))


@dataclass(frozen=True)
class Form:
    """An equation taken apart.

    Attributes:
        elements: One, or two with the same function.
        joint: The operator between the two; empty if there is one.
    """

    elements: tuple[Element, ...]
    joint: str = ""

    @property
    def function(self) -> str:
        """The function that the elements share."""
        return self.elements[0].function

    @property
    def equation(self) -> Expression:
        """How `first` and `second`, the values of two elements, are joined."""
        return Binary(self.joint, FIRST, SECOND)


@lru_cache
def form_of(output: Expression) -> Form | None:
    """The form of a model's equation, equal to it to the last bit; None if it has another one."""
    single = _element(output)
    if single is not None:
        return Form((single,))
    match output:
        case Binary(operator=joint, left=left, right=right):
            first, second = _element(left), _element(right)
            if first is not None and second is not None and first.function == second.function:
                return Form((first, second), joint)
    return None


def _element(expression: Expression) -> Element | None:
    match expression:
        case Call(
            function=function,
            arguments=(Binary(operator="*", left=gain, right=Binary(operator="-", left=left, right=right)),),
        ) if _is_parameter(gain):
            if left == _A and _is_parameter(right):
                return Element(function, gain, right)
            if right == _A and _is_parameter(left):
                return Element(function, Unary("-", gain), left)
    return None


def _is_parameter(expression: Expression) -> bool:
    return isinstance(expression, Name | Number) and expression != _A
