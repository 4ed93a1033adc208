"""Field types for models of files: quantities that become SI floats, or stay as they are written.

They are dumped as they are; with a context, as what that function makes of SI value, SI unit and text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    PlainSerializer,
    PlainValidator,
    SerializationInfo,
    ValidationInfo,
    WithJsonSchema,
)

from circuitkit.base.source.validation import describe
from circuitkit.base.units import DIMENSIONLESS, Quantity, parse_quantity, parse_unit


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


def _either(
    hinge: str, slide: str, number: float, *, zero: bool = False
) -> Callable[[object, ValidationInfo], Quantity]:
    """A validator of what has one unit about a hinge and another one along a slide.

    Which of them a value needs is known only where its joint is; see `circuitkit.robots.mjcf`. A bare number
    in Python is in the SI unit of whatever joint it is for, and has no unit.

    Args:
        hinge: The unit about a hinge.
        slide: The unit along a slide.
        number: For the example.
        zero: Whether 0 is allowed.
    """
    dimensions = {parse_unit(hinge).dimension, parse_unit(slide).dimension}
    allowed = f"a quantity such as '{number:g} {hinge}', of a slide '{number:g} {slide}'"

    def read(value: object, info: ValidationInfo) -> Quantity:
        if isinstance(value, Quantity):
            return value
        quantity = _quantity(value, allowed)
        is_si = info.mode == "python" and not isinstance(value, str)
        if quantity.dimension not in dimensions and not (is_si and quantity.unit == DIMENSIONLESS):
            message = f"found {describe(value)}, which is {quantity.dimension}; allowed: {allowed}"
            raise ValueError(message)
        if quantity.value_si < 0 or (quantity.value_si == 0 and not zero):
            message = f"found {describe(value)}; allowed: {'0 or more' if zero else 'more than 0'}"
            raise ValueError(message)
        return quantity

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


# What a value may be in a file, as JSON Schema.
NUMBER_OR_TEXT: dict[str, list[dict[str, Any]]] = {"anyOf": [{"type": "number"}, {"type": "string"}]}
_SCHEMA = WithJsonSchema(NUMBER_OR_TEXT)


def _text_with_unit(text: Any, info: SerializationInfo) -> Any:  # noqa: ANN401 - a text, or several by name
    """A serializer of what stays as it is written."""
    if info.context is None or text is None:
        return text
    if isinstance(text, Mapping):
        return {name: _text_with_unit(each, info) for name, each in text.items()}
    quantity = parse_quantity(text)
    return info.context(quantity.value_si, quantity.dimension.si_symbol, text)


def _in(unit_text: str) -> PlainSerializer:
    """A serializer of an SI float."""
    symbol = parse_unit(unit_text).dimension.si_symbol

    def write(value: float | None, info: SerializationInfo) -> Any:  # noqa: ANN401 - what the context makes
        return value if info.context is None or value is None else info.context(value, symbol, "")

    return PlainSerializer(write)


def _value_si(quantity: Quantity, info: SerializationInfo) -> Any:  # noqa: ANN401 - what the context makes
    """A serializer of a quantity of one of two units."""
    value, symbol = quantity.value_si, quantity.dimension.si_symbol
    return value if info.context is None else info.context(value, symbol, str(quantity))


# A quantity of any dimension, which stays as it was written.
AnyQuantity = Annotated[str, BeforeValidator(_as_written), PlainSerializer(_text_with_unit), _SCHEMA]
Metres = Annotated[float, BeforeValidator(_reader("m", "80 mm")), _in("m"), _SCHEMA]
Radians = Annotated[float, BeforeValidator(_reader("rad", "33 deg")), _in("rad"), _SCHEMA]
Seconds = Annotated[float, BeforeValidator(_reader("s", "200 ms")), _in("s"), _SCHEMA]
Kilograms = Annotated[float, BeforeValidator(_reader("kg", "0.3 kg")), _in("kg"), _SCHEMA]
Newtons = Annotated[float, BeforeValidator(_reader("N", "20 N")), _in("N"), _SCHEMA]
MetresPerSecond = Annotated[float, BeforeValidator(_reader("m/s", "2 cm/s")), _in("m/s"), _SCHEMA]
RadiansPerSecond = Annotated[float, BeforeValidator(_reader("rad/s", "1 deg/s")), _in("rad/s"), _SCHEMA]
NewtonMetres = Annotated[float, BeforeValidator(_reader("N*m", "14.8 N*m")), _in("N*m"), _SCHEMA]
_IN_SI = PlainSerializer(_value_si)
Stiffness = Annotated[Quantity, PlainValidator(_either("N*m/rad", "N/m", 100)), _IN_SI, _SCHEMA]
Damping = Annotated[Quantity, PlainValidator(_either("N*m*s/rad", "N*s/m", 3.55, zero=True)), _IN_SI, _SCHEMA]
Effort = Annotated[Quantity, PlainValidator(_either("N*m", "N", 14.8)), _IN_SI, _SCHEMA]
Reach = Annotated[Quantity, PlainValidator(_either("rad", "m", 0.5, zero=True)), _IN_SI, _SCHEMA]
RadiansPerMetre = Annotated[float, BeforeValidator(_reader("rad/m", "8 rad/m")), _in("rad/m"), _SCHEMA]
RadianSecondsPerMetre = Annotated[
    float, BeforeValidator(_reader("rad*s/m", "0.2 rad*s/m")), _in("rad*s/m"), _SCHEMA
]
PerSecondToTheSixth = Annotated[float, BeforeValidator(_reader("1/s^6", "1e6 1/s^6")), _in("1/s^6"), _SCHEMA]
Ratio = Annotated[float, BeforeValidator(_reader("1", "20 %")), _in("1"), _SCHEMA]
