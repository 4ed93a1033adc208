"""Values of the circuit file: numbers, quantities, parameters, and sums of these such as `edge - margin`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from circuitkit.errors import UnitError, listing, suggest
from circuitkit.source import describe
from circuitkit.units import DIMENSIONLESS, Quantity, parse_quantity

_NAME = re.compile(r"(?P<sign>[+-]?)(?P<name>[A-Za-z_][A-Za-z0-9_]*)")
_JOINT = re.compile(r"\s+([+-])\s+")


class ValueProblemError(Exception):
    """A value cannot be used: what was found and what is allowed, and a hint at what was meant."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint


class LostNameError(Exception):
    """A value names something that is declared but unsound, which is reported where it is declared."""


def evaluate(value: object, look_up: Callable[[str], Quantity]) -> Quantity:
    """The quantity that a value of the file stands for.

    Args:
        value: As written: a number or a text; anything else is complained about.
        look_up: Gives the value of a parameter.

    Raises:
        ValueProblemError: It is no value, is not finite, or adds up what does not fit together.
        LostNameError: It names an unsound parameter.
    """
    if (complaint := not_a_value(value)) is not None:
        raise ValueProblemError(complaint)
    if not isinstance(value, str):
        return Quantity(_finite(float(value), str(value)), DIMENSIONLESS)  # type: ignore[arg-type]  # a number
    pieces = _JOINT.split(value.strip())
    total = _term(pieces[0], look_up)
    for sign, piece in zip(pieces[1::2], pieces[2::2], strict=True):
        term = _term(piece, look_up)
        if term.dimension != total.dimension:
            joined = f"{total.dimension} and {term.dimension}"
            message = f"found '{value}', which joins {joined}; allowed: sums of the same dimension"
            raise ValueProblemError(message)
        change = -term.value_si if sign == "-" else term.value_si
        total = Quantity(_finite(total.value_si + change, value), total.unit)
    return total


def _term(text: str, look_up: Callable[[str], Quantity]) -> Quantity:
    if (match := _NAME.fullmatch(text)) is None:
        try:
            return parse_quantity(text)
        except UnitError as error:
            raise ValueProblemError(str(error)) from error
    if match["name"].lower() in {"nan", "inf", "infinity"}:
        message = f"found '{text}'; allowed: a finite number"
        raise ValueProblemError(message)
    quantity = look_up(match["name"])
    return -quantity if match["sign"] == "-" else quantity


def _finite(number: float, text: str) -> float:
    if not math.isfinite(number):
        message = f"found '{text}', which is too large; allowed: a finite number"
        raise ValueProblemError(message)
    return number


def not_a_value(value: object) -> str | None:
    """The complaint about something that is neither a number nor a text; None if it is one."""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        return None
    return f"found {describe(value)}; allowed: a number, a quantity such as '-80 mm', or a parameter"


def unknown_parameter(name: str, parameters: Mapping[str, object]) -> ValueProblemError:
    """The complaint about a name that is no parameter."""
    allowed = f"a number, a quantity such as '-80 mm', or a parameter: {listing(parameters)}"
    return ValueProblemError(f"unknown parameter '{name}'; allowed: {allowed}", suggest(name, parameters))
