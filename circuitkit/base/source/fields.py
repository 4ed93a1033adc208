"""Field types for models of files: quantities that become SI floats, or stay as they are written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema

from circuitkit.base.source.validation import describe
from circuitkit.base.units import Quantity, parse_quantity, parse_unit


def _reader(unit_text: str, example: str) -> Callable[[object, ValidationInfo], float]:
    """A validator: number or text to the SI value, if it has the dimension of `unit_text`.

    A bare number in a file has no unit and is refused where one is needed; in Python it is in SI units.
    """
    unit = parse_unit(unit_text)

    def read(value: object, info: ValidationInfo) -> float:
        if info.mode == "python" and isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        allowed = f"a quantity such as '{example}'"
        quantity = _quantity(value, allowed)
        if quantity.dimension != unit.dimension:
            message = f"found {describe(value)}, which is {quantity.dimension}; allowed: {allowed}"
            raise ValueError(message)
        return quantity.value_si

    return read


def _quantity(value: object, allowed: str) -> Quantity:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        message = f"found {describe(value)}; allowed: {allowed}"
        raise ValueError(message)  # noqa: TRY004 - pydantic collects ValueError, not TypeError
    return parse_quantity(str(value))


def _as_written(value: object) -> str:
    """A validator: number or text to the text of a quantity of any dimension."""
    _quantity(value, "a quantity such as '20 N' or 0.1")
    return str(value)


_TEXT = {"anyOf": [{"type": "number"}, {"type": "string"}]}

# A quantity of any dimension, which stays as it was written.
AnyQuantity = Annotated[str, BeforeValidator(_as_written)]
Metres = Annotated[float, BeforeValidator(_reader("m", "80 mm")), WithJsonSchema(_TEXT)]
Radians = Annotated[float, BeforeValidator(_reader("rad", "33 deg")), WithJsonSchema(_TEXT)]
Seconds = Annotated[float, BeforeValidator(_reader("s", "200 ms")), WithJsonSchema(_TEXT)]
Kilograms = Annotated[float, BeforeValidator(_reader("kg", "0.3 kg")), WithJsonSchema(_TEXT)]
Newtons = Annotated[float, BeforeValidator(_reader("N", "20 N")), WithJsonSchema(_TEXT)]
MetresPerSecond = Annotated[float, BeforeValidator(_reader("m/s", "2 cm/s")), WithJsonSchema(_TEXT)]
RadiansPerSecond = Annotated[float, BeforeValidator(_reader("rad/s", "1 deg/s")), WithJsonSchema(_TEXT)]
NewtonMetres = Annotated[float, BeforeValidator(_reader("N*m", "14.8 N*m")), WithJsonSchema(_TEXT)]
Stiffness = Annotated[float, BeforeValidator(_reader("N*m/rad", "100 N*m/rad")), WithJsonSchema(_TEXT)]
Damping = Annotated[float, BeforeValidator(_reader("N*m*s/rad", "3.55 N*m*s/rad")), WithJsonSchema(_TEXT)]
RadiansPerMetre = Annotated[float, BeforeValidator(_reader("rad/m", "8 rad/m")), WithJsonSchema(_TEXT)]
RadianSecondsPerMetre = Annotated[
    float, BeforeValidator(_reader("rad*s/m", "0.2 rad*s/m")), WithJsonSchema(_TEXT)
]
PerSecondToTheSixth = Annotated[float, BeforeValidator(_reader("1/s^6", "1e6 1/s^6")), WithJsonSchema(_TEXT)]
Ratio = Annotated[float, BeforeValidator(_reader("1", "20 %")), WithJsonSchema(_TEXT)]
