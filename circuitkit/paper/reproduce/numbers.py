"""Writes numbers as texts, tables and claims of the report have them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def one_line(text: str) -> str:
    """Join a text that is broken into lines in its source into one line."""
    return " ".join(text.split())


def median_range(values: Sequence[float | None], unit: str, digits: int = 2) -> str:
    """Write median and range, such as `0.03 s (0.01 to 0.35 s)`, and how many values there are if some lack.

    Args:
        values: None where there is no value.
        unit: Stands behind each.
        digits: Significant digits.
    """
    known = [value for value in values if value is not None]
    if not known:
        return "never"
    low, middle, high = (plain(float(value), digits) for value in (min(known), np.median(known), max(known)))
    text = f"{middle} {unit}" if low == high else f"{middle} {unit} ({low} to {high} {unit})"
    return text if len(known) == len(values) else f"{text}, in {len(known)} of {len(values)} runs"


def seeds_in_words(seeds: Sequence[int]) -> str:
    """Name consecutive seeds, such as `seeds 0 to 11`."""
    return f"seeds {seeds[0]} to {seeds[-1]}"


def plain(value: float | None, digits: int = 3) -> str:
    """Write a number with so many significant digits, never in powers of ten; `-` for none."""
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "unlimited" if value > 0 else "-"
    if value == 0:
        return "0"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{decimals}f}"


def signed_percent(ratio: float) -> str:
    """Write how much more or less than one a ratio is, such as `+52.6 %`."""
    return "-" if math.isnan(ratio) else f"{(ratio - 1) * 100:+.1f} %".replace("-", "\N{MINUS SIGN}")


def count(stood: int, runs: int) -> str:
    """Write how many of all, such as `20 of 20`."""
    return f"{stood} of {runs}"
