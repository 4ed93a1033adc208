"""Plain YAML scalars to values, without the surprises of YAML 1.1.

Only `true` and `false` are booleans, `1e-3` is a number, and what readers of different YAML versions take for
different numbers (`010`, `1_000`, `1:30`, `0x1F`) is refused.
"""

from __future__ import annotations

import math
import re

_WORDS: dict[str, bool | None] = {"": None, "~": None, "null": None, "true": True, "false": False}
_STARTS_A_NUMBER = frozenset("0123456789+-.")
_INTEGER = re.compile(r"[-+]?(?:0|[1-9]\d*)")
_REAL = re.compile(r"[-+]?(?:(?:0|[1-9]\d*)(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF|nan|NaN|NAN)")
_LEADING_ZERO = re.compile(r"[-+]?0\d[\d_]*(?:\.\d*)?(?:[eE][-+]?\d+)?")
_OTHER_BASE = re.compile(r"[-+]?0(?:[xX][\da-fA-F_]+|[oO][0-7_]+|[bB][01_]+)")
_UNDERSCORE = re.compile(r"[-+]?\d[\d_]*(?:\.[\d_]*)?(?:[eE][-+]?\d+)?")
_SEXAGESIMAL = re.compile(r"[-+]?\d[\d_]*(?::[0-5]?\d)+(?:\.\d*)?")
_LONGEST_INTEGER = 300

_REFUSED = (
    (_NOT_FINITE, "a finite number"),
    (_LEADING_ZERO, "a number without leading zeros (some take these for octal), or quotes for a text"),
    (_OTHER_BASE, "a decimal number, or quotes for a text"),
    (_SEXAGESIMAL, "a decimal number (some take colons for base 60), or quotes for a text"),
    (_UNDERSCORE, "a number without underscores, or quotes for a text"),
)


class RefusedScalarError(ValueError):
    """A plain scalar that different YAML readers take for different values, or that is not finite."""


def plain_scalar(text: str) -> bool | float | int | str | None:
    """The value of an unquoted scalar.

    Raises:
        RefusedScalarError: It is ambiguous or not finite; the message says what is allowed.
    """
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in _STARTS_A_NUMBER:
        return text
    if _INTEGER.fullmatch(text) and len(text) < _LONGEST_INTEGER:
        return int(text)
    if _REAL.fullmatch(text):
        number = float(text)
        if math.isfinite(number):
            return number
        raise RefusedScalarError(_refusal(text, "a finite number"))
    for pattern, allowed in _REFUSED:
        if pattern.fullmatch(text):
            raise RefusedScalarError(_refusal(text, allowed))
    return text


def _refusal(text: str, allowed: str) -> str:
    shown = text if len(text) < _LONGEST_INTEGER else f"{text[:20]}…"
    return f"found {shown}; allowed: {allowed}"
