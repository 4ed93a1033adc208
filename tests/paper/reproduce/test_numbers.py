from __future__ import annotations

import math

import pytest

from circuitkit.paper.reproduce.finding import count, median_range, one_line, plain, signed_percent


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (22.0, "22.0"),
        (0.084, "0.0840"),
        (1234.5, "1234"),
        (0, "0"),
        (None, "-"),
        (math.nan, "-"),
        (math.inf, "unlimited"),
    ],
)
def test_numbers_have_three_digits_and_no_powers(value, text):
    assert plain(value) == text


def test_a_ratio_is_told_as_what_is_more_or_less():
    assert signed_percent(1.526) == "+52.6 %"
    assert signed_percent(0.9) == "\N{MINUS SIGN}10.0 %"
    assert signed_percent(math.nan) == "-"


def test_a_spread_tells_median_and_range_and_what_is_missing():
    assert median_range([0.02, 0.03, 0.3], "s") == "0.030 s (0.020 to 0.30 s)"
    assert median_range([0.5, 0.5], "s") == "0.50 s"
    assert median_range([0.5, None], "s") == "0.50 s, in 1 of 2 runs"
    assert median_range([None], "s") == "never"


def test_counts_and_texts():
    assert count(3, 20) == "3 of 20"
    assert one_line("\n   two\n   lines ") == "two lines"
