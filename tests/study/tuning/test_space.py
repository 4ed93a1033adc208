"""What is searched: ranges with units, choices, and the texts that candidates become."""

from __future__ import annotations

import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from pydantic import ValidationError

from circuitkit.base.errors import UnitError
from circuitkit.base.units import parse_quantity
from circuitkit.study.tuning.space import Searched


def searched(**keys: object) -> Searched:
    return Searched.model_validate({key.rstrip("_"): value for key, value in keys.items()})


def test_a_range_is_searched_in_the_unit_of_its_lower_end():
    leak = searched(from_="1 %", to=0.3, log=True)
    assert leak.distribution() == FloatDistribution(1.0, 30.0, log=True)
    assert leak.text(12.3456789) == "12.3457 %"


def test_a_text_is_the_value_that_is_measured():
    w = searched(from_="-2 deg", to="2 deg")
    for value in (-2.0, 1 / 3, 1.23456789e-7, 2.0):
        assert w.number(w.text(value)) == pytest.approx(value, rel=5e-6)


def test_the_logarithm_of_what_is_below_zero_is_searched_by_its_size():
    w = searched(from_="-10 mm", to="-1 mm", log=True)
    assert w.distribution() == FloatDistribution(1.0, 10.0, log=True)
    assert w.text(3.0) == "-3 mm"
    assert w.number("-0.3 cm") == pytest.approx(3.0)
    assert w.text(w.middle()) == "-3.16228 mm"  # the square root of 10


def test_whole_numbers_and_choices():
    assert searched(from_=1, to=8, whole=True).distribution() == IntDistribution(1, 8)
    assert searched(from_=1, to=8, whole=True).text(5) == "5"
    timing = searched(choices=("ordered", "synchronous"))
    assert timing.distribution() == CategoricalDistribution(["ordered", "synchronous"])
    assert timing.plotted("synchronous") == 1.0


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"from_": "1 deg", "to": "2 mm"}, "allowed: one dimension"),
        ({"from_": "2 deg", "to": "1 deg"}, "the smaller value, then the larger one"),
        ({"from_": "-1 deg", "to": "1 deg", "log": True}, "both ends above 0, or both below"),
        ({"from_": 0.5, "to": 2, "whole": True}, "whole numbers as ends"),
        ({"from_": 1}, "allowed: from and to, or choices"),
        ({"choices": ("a", "b"), "from_": 1}, "found choices together with from"),
        ({"from_": "1 parsec", "to": 2}, "unknown unit 'parsec'"),
    ],
)
def test_ranges_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ValidationError, match=message):
        searched(**keys)


@pytest.mark.parametrize("text", ["3 deg", "1 mm", "x"])
def test_values_outside_of_the_range_are_refused(text):
    with pytest.raises(UnitError):
        searched(from_="-2 deg", to="2 deg").number(text)


def test_every_text_can_be_read_as_a_quantity():
    for unit in ("deg", "%", "/m", "1", "N*m/rad"):
        low, high = (f"{number} {unit}".removesuffix(" 1") for number in (1, 9))
        each = searched(from_=low, to=high)
        assert parse_quantity(each.text(4.5)).unit.dimension == each.unit.dimension
