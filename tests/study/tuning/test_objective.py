"""Figures and objectives of made-up rows."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from circuitkit.base.errors import UnknownNameError
from circuitkit.study.tuning.objective import FigureError, Term, limit, score
from circuitkit.study.tuning.runs import Condition

# Two directions, pushed at 50, 75 and 100 % of something, two seeds each: who stands.
STANDS = {
    "left": {0.5: (True, True), 0.75: (True, True), 1.0: (True, False)},
    "right": {0.5: (True, True), 0.75: (False, False), 1.0: (True, True)},
}
CONDITIONS = tuple(
    Condition({"direction": cell}, factor, {}) for cell, each in STANDS.items() for factor in each
)
ROWS = [
    [{"survived": stands, "recovery_time_s": 0.2 if stands else None, "rms_x": 0.01} for stands in seeds]
    for each in STANDS.values()
    for seeds in each.values()
]


def figure(**keys: object) -> float:
    return Term.model_validate(keys).figure_of(CONDITIONS, ROWS)


def test_survived_is_the_share_of_the_runs():
    assert figure(figure="survived") == pytest.approx(9 / 12)


def test_the_limit_counts_from_below():
    # To the left all stand up to 75 %; to the right up to 50 %, and what stands above a fall does not count.
    assert limit(CONDITIONS, ROWS) == figure(figure="limit") == pytest.approx((0.75 + 0.5) / 2)


def test_no_factor_that_all_survive_counts_as_nothing():
    fallen = [[{"survived": False}]] * len(CONDITIONS)
    assert limit(CONDITIONS, fallen) == 0.0


def test_what_counts_for_runs_without_a_figure_must_be_said():
    with pytest.raises(FigureError, match="say what counts for it with 'otherwise'"):
        figure(figure="recovery_time_s")
    assert figure(figure="recovery_time_s", otherwise="2 s") == pytest.approx((9 * 0.2 + 3 * 2.0) / 12)
    assert figure(figure="recovery_time_s", otherwise="2 s", statistic="max", unit="ms") == 2000.0


def test_an_unknown_figure_is_refused_with_those_there_are():
    with pytest.raises(
        UnknownNameError, match=r"unknown figure 'surived'; allowed: .*did you mean 'survived'"
    ):
        figure(figure="surived")


def test_only_what_is_beyond_counts():
    term = Term.model_validate({"figure": "rms_x", "unit": "deg", "beyond": "0.5 deg", "weight": -2.0})
    measured = term.figure_of(CONDITIONS, ROWS)
    assert measured == pytest.approx(math.degrees(0.01))
    assert term.part(measured) == pytest.approx(-2.0 * (math.degrees(0.01) - 0.5))
    assert term.part(0.4) == 0.0


def test_the_objective_is_the_weighted_sum():
    terms = [
        Term.model_validate({"figure": "survived", "weight": 3.0}),
        Term.model_validate({"figure": "limit", "weight": -1.0}),
    ]
    found = score(terms, {"pushed": CONDITIONS}, {"pushed": ROWS})
    assert found.value == pytest.approx(3.0 * 9 / 12 - 0.625)
    assert found.figures == pytest.approx((0.75, 0.625))
    assert found.runs == 12


def test_units_of_a_term_must_fit():
    with pytest.raises(ValidationError, match="found beyond 2 mm; allowed: a quantity in a unit like deg"):
        Term.model_validate({"figure": "rms_x", "unit": "deg", "beyond": "2 mm"})
