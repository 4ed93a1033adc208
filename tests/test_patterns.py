"""Patterns: a * stands for any letters, and everything else for itself."""

from __future__ import annotations

import pytest

from circuitkit.base.patterns import matches


@pytest.mark.parametrize(
    ("name", "pattern", "fits"),
    [
        ("leg1", "leg1", True),
        ("leg1", "leg", False),
        ("left leg", "*leg", True),
        ("legs", "*leg", False),
        ("a\nleg.1", "a*.1", True),
        ("leg[1]", "leg[1]", True),  # what file names would take for a class of letters
        ("leg1", "leg[1]", False),
        ("leg?", "leg?", True),
        ("leg1", "leg?", False),
        ("legx1", "leg.1", False),
        ("", "*", True),
        ("*", "*", True),
    ],
)
def test_only_the_star_stands_for_something_else(name, pattern, fits):
    assert matches(name, pattern) is fits
