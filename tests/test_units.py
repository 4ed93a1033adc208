"""Units against the definitions of SI, and every complaint about a quantity word for word."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

import contextlib
import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.base.errors import UnitError, listing
from circuitkit.base.units import (
    DIMENSIONLESS,
    LISTED_SYMBOLS,
    UNIT_SYMBOLS,
    Dimension,
    Quantity,
    format_quantity,
    parse_quantity,
    parse_unit,
)

finite = st.floats(min_value=-1e100, max_value=1e100)


@pytest.mark.parametrize(
    ("text", "value_si", "dimension"),
    [
        ("-80 mm", -0.08, Dimension(length=1)),
        ("79.9 mm", 0.0799, Dimension(length=1)),
        ("2.5 cm", 0.025, Dimension(length=1)),
        ("3 km", 3000.0, Dimension(length=1)),
        ("10 ms", 0.01, Dimension(time=1)),
        ("2 min", 120.0, Dimension(time=1)),
        ("1 h", 3600.0, Dimension(time=1)),
        ("180 deg", math.pi, Dimension(angle=1)),
        ("100 /m", 100.0, Dimension(length=-1)),
        ("100/m", 100.0, Dimension(length=-1)),
        ("5 1/mm", 5000.0, Dimension(length=-1)),
        ("5 %", 0.05, Dimension()),
        ("0.1", 0.1, Dimension()),
        ("7 1", 7.0, Dimension()),
        ("50 Hz", 50.0, Dimension(time=-1)),
        ("20 N", 20.0, Dimension(length=1, mass=1, time=-2)),
        ("2 kg*m^2/s^2", 2.0, Dimension(length=2, mass=1, time=-2)),
        ("3 J", 3.0, Dimension(length=2, mass=1, time=-2)),
        ("9.81 m/s/s", 9.81, Dimension(length=1, time=-2)),
        ("10 mm^2", 1e-5, Dimension(length=2)),
        ("-65 mV", -0.065, Dimension(length=2, mass=1, time=-3, current=-1)),
        ("2 nA", 2e-9, Dimension(current=1)),
        ("300 pF", 3e-10, Dimension(length=-2, mass=-1, time=4, current=2)),
        ("1e-3 m", 0.001, Dimension(length=1)),
        ("+.5m", 0.5, Dimension(length=1)),
    ],
)
def test_quantities_have_their_si_value_and_dimension(text, value_si, dimension):
    quantity = parse_quantity(text)
    assert quantity.value_si == value_si
    assert quantity.dimension == dimension


def test_electrical_units_fit_together():
    """Ohm's law, the definition of capacitance, and power: V = ohm A, F = A s / V, S = A / V, W = V A."""
    assert parse_unit("ohm*A").dimension == parse_unit("V").dimension
    assert parse_unit("A*s/V").dimension == parse_unit("F").dimension
    assert parse_unit("A/V").dimension == parse_unit("S").dimension
    assert parse_unit("V*A").dimension == parse_unit("W").dimension == parse_unit("J/s").dimension
    assert parse_unit("Mohm*pA").factor == parse_unit("uV").factor
    assert parse_unit("mV/Mohm").factor == parse_unit("nA").factor


def test_mechanical_units_fit_together():
    assert parse_unit("N*m") == parse_unit("J").__class__("N*m", Fraction(1), parse_unit("J").dimension)
    assert parse_unit("N/m^2").dimension == parse_unit("Pa").dimension
    assert parse_unit("kg*m/s^2").dimension == parse_unit("N").dimension


def test_angle_is_neither_a_number_nor_a_length():
    assert len({parse_unit(symbol).dimension for symbol in ("deg", "1", "mm")}) == 3
    assert parse_unit("deg").dimension == parse_unit("rad").dimension


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("−80 mm", "-80 mm"),
        ("3 µm", "3 um"),
        ("2 N·m", "2 N*m"),
        ("9 m/s²", "9 m/s^2"),
        ("22°", "22 deg"),
        ("5 Ω", "5 ohm"),
    ],
)
def test_typographic_signs_mean_what_they_look_like(text, same):
    assert parse_quantity(text) == parse_quantity(same)


@given(value=finite, symbol=st.sampled_from(UNIT_SYMBOLS))
def test_every_unit_there_and_back(value, symbol):
    unit = parse_unit(symbol)
    assert unit.from_si(unit.to_si(value)) == pytest.approx(value, rel=1e-15, abs=1e-290)


@given(value=finite, symbol=st.sampled_from(UNIT_SYMBOLS))
def test_a_shown_quantity_reads_back(value, symbol):
    unit = parse_unit(symbol)
    shown = format_quantity(unit.to_si(value), unit, digits=17)
    assert parse_quantity(shown).value_si == pytest.approx(unit.to_si(value), rel=1e-15, abs=1e-290)
    assert parse_quantity(shown).dimension == unit.dimension


units = st.lists(
    st.tuples(st.sampled_from(UNIT_SYMBOLS), st.integers(-3, 3).filter(bool)),
    min_size=1,
    max_size=3,
)


@given(units, units)
def test_the_dimension_of_a_product_is_the_sum(first, second):
    def text(factors: list[tuple[str, int]]) -> str:
        return "*".join(f"{symbol}^{power}" for symbol, power in factors)

    product, left, right = (
        parse_unit(f"{text(first)}*{text(second)}"),
        parse_unit(text(first)),
        parse_unit(text(second)),
    )
    assert product.dimension == left.dimension.times(right.dimension)
    assert product.factor == left.factor * right.factor


@given(st.builds(Dimension, *[st.integers(-3, 3)] * 6))
def test_the_si_symbol_of_a_dimension_has_this_dimension(dimension):
    assert parse_unit(dimension.si_symbol).dimension == dimension
    assert parse_unit(dimension.si_symbol).scale == 1.0
    assert dimension.si_unit == parse_unit(dimension.si_symbol)


@pytest.mark.parametrize(
    ("dimension", "words"),
    [
        (Dimension(), "dimensionless"),
        (Dimension(length=1), "length"),
        (Dimension(length=1, time=-2), "length/time^2"),
        (Dimension(length=-1), "1/length"),
        (Dimension(mass=1, length=2, time=-1, angle=-1), "length^2*mass/time/angle"),
        (parse_unit("mV").dimension, "voltage"),
        (parse_unit("nS").dimension, "conductance"),
    ],
)
def test_dimensions_have_words(dimension, words):
    assert str(dimension) == words


@pytest.mark.parametrize(
    ("value_si", "symbol", "shown"),
    [
        (-0.08, "mm", "-80 mm"),
        (0.1, "1", "0.1"),
        (math.radians(22), "deg", "22 deg"),
        (0.05, "%", "5 %"),
        (math.inf, "mm", "inf mm"),
    ],
)
def test_quantities_are_shown_as_a_person_writes_them(value_si, symbol, shown):
    assert format_quantity(value_si, parse_unit(symbol)) == shown


def test_negation_and_text_of_a_quantity():
    assert -parse_quantity("80 mm") == parse_quantity("-80 mm")
    assert str(parse_quantity("-80.0 mm")) == "-80 mm"
    assert Quantity(0.5, DIMENSIONLESS).dimension == Dimension()


NUMBER = "a number, with a unit if it has one, such as '-80 mm' or '0.1'"
SYMBOLS = listing(LISTED_SYMBOLS)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mm", f"found 'mm'; allowed: {NUMBER}"),
        ("", f"found ''; allowed: {NUMBER}"),
        ("1,5 mm", f"found '1,5 mm'; allowed: {NUMBER}"),
        ("1_000", f"found '1_000'; allowed: {NUMBER}"),
        ("5 2 mm", f"found '5 2 mm'; allowed: {NUMBER}"),
        ("nan", f"found 'nan'; allowed: {NUMBER}"),
        ("1e999 mm", "found '1e999 mm', which is too large; allowed: a finite number"),
        ("5 mmm", f"unknown unit 'mmm'; allowed: {SYMBOLS}; did you mean 'mm'?"),
        ("5 rads", f"unknown unit 'rads'; allowed: {SYMBOLS}; did you mean 'rad'?"),
        ("5 furlong", f"unknown unit 'furlong'; allowed: {SYMBOLS}"),
        (
            "5 mm 3 mm",
            "cannot read 'mm 3 mm' in the unit 'mm 3 mm'; allowed: symbols joined by * and /, with powers such as ^2",
        ),
        (
            "5 m/",
            "cannot read '' in the unit 'm/'; allowed: symbols joined by * and /, with powers such as ^2",
        ),
        (
            "5 m^x",
            "cannot read 'm^x' in the unit 'm^x'; allowed: symbols joined by * and /, with powers such as ^2",
        ),
    ],
)
def test_what_is_no_quantity_is_named(text, message):
    with pytest.raises(UnitError) as caught:
        parse_quantity(text)
    assert str(caught.value) == message
    assert isinstance(caught.value, ValueError)
    assert caught.value.exit_code == 1


@pytest.mark.parametrize("text", ["", " ", "x" * 200])
def test_what_is_no_unit_is_named(text):
    with pytest.raises(UnitError, match=r"^found '.*'; allowed: a unit such as 'mm' or '1'$"):
        parse_unit(text)


@given(st.text(max_size=30))
def test_any_text_is_a_quantity_or_a_unit_error(text):
    with contextlib.suppress(UnitError):
        assert math.isfinite(parse_quantity(text).value_si)
