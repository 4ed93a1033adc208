"""Measures: every reduction against numpy, conditions, bounds, units, what ends a run; and complaints."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from small_robots import CART, CART_FILE, Told, run, small_robot

from circuitkit.base.errors import ExpressionError, InputError
from circuitkit.base.units import parse_unit
from circuitkit.simulation import Scenario, simulate
from circuitkit.simulation.disturbances.noise import Noise
from circuitkit.simulation.formula_parser import parse_measure
from circuitkit.simulation.formulas import Track
from circuitkit.simulation.reductions import holds_where

DT = 0.01
UNITS = {
    "x": parse_unit("m"),
    "y": parse_unit("m"),
    "v": parse_unit("m/s"),
    "load": parse_unit("N"),
    "n": parse_unit("1"),
}
series = arrays(float, st.integers(1, 60), elements=st.floats(-100, 100).map(lambda value: round(value, 3)))


def track(ended=False, bounds=None, first=0, **values):
    shape = next(iter(values.values())).shape
    return Track(
        step_s=DT, first=first, shape=shape, ended=ended, values=values.__getitem__,
        bounds=(bounds or {}).get, push_s=np.nan, pace_s=0.0,
    )  # fmt: skip


def value(text, ended=False, bounds=None, **values):
    """The value of a measure at the end of a run."""
    return parse_measure(text, UNITS, bounds or ()).value(track(ended, bounds, **values))


# --- reductions ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("max", np.max), ("min", np.min), ("mean", np.mean), ("rms", lambda x: np.sqrt(np.mean(x**2))),
        ("total", lambda x: np.sum(x) * DT), ("first", lambda x: x[0]), ("last", lambda x: x[-1]),
    ],
)  # fmt: skip
@given(x=series)
def test_a_reduction_is_that_of_numpy(name, expected, x):
    assert value(f"{name}(x)", x=x) == pytest.approx(float(expected(x)), rel=1e-9, abs=1e-9)


@given(x=series, level=st.floats(-100, 100).map(lambda value: round(value, 3)))
def test_how_long_how_often_and_when_first(x, level):
    above = x > level
    assert value(f"duration(x > {level} m)", x=x) == pytest.approx(np.count_nonzero(above) * DT)
    begun = np.count_nonzero(above & ~np.concatenate([[False], above[:-1]]))
    assert value(f"count(x > {level} m)", x=x) == begun
    first = value(f"time_of(x > {level} m)", x=x)
    assert first == (pytest.approx((above.argmax() + 1) * DT) if above.any() else None)


@given(x=series, low=st.floats(-50, 0), high=st.floats(0, 50))
def test_outside_is_how_far_beyond_the_bounds(x, low, high):
    beyond = np.maximum(np.maximum(low - x, x - high), 0)
    assert value(f"max(outside(x, {low} m, {high} m))", x=x) == pytest.approx(beyond.max(), abs=1e-9)
    assert value("max(outside(x))", bounds={"x": (low, high)}, x=x) == pytest.approx(beyond.max(), abs=1e-9)


def test_bounds_may_differ_from_tick_to_tick():
    x, low, high = np.zeros(4), np.array([-1, -1, 1, 2.0]), np.array([1, -0.5, 3, 3])
    assert value("total(outside(x))", bounds={"x": (low, high)}, x=x) == pytest.approx((0 + 0.5 + 1 + 2) * DT)


@given(x=series)
def test_reductions_and_plain_numbers_join(x):
    found = value("max(x) - min(x) + 2 * abs(last(x)) + 1 m", x=x)
    assert found == pytest.approx(np.ptp(x) + 2 * abs(x[-1]) + 1)
    assert value("max(abs(x - first(x)))", x=x) == pytest.approx(np.abs(x - x[0]).max())
    assert value("mean(where(x > 0 m, x, 0 m))", x=x) == pytest.approx(np.maximum(x, 0).mean(), abs=1e-9)


@given(x=series)
def test_at_every_tick_a_reduction_knows_what_was_so_far(x):
    for name, so_far in (
        ("max", np.maximum.accumulate(x)),
        ("mean", np.cumsum(x) / np.arange(1, len(x) + 1)),
    ):
        np.testing.assert_allclose(parse_measure(f"{name}(x)", UNITS).series(track(x=x)), so_far, atol=1e-9)


def test_of_several_arguments_max_and_min_choose_among_them():
    x, y = np.array([1.0, 5, 2]), np.array([3.0, 4, 4])
    assert value("last(max(x, y))", x=x, y=y) == 4
    assert value("max(min(x, y))", x=x, y=y) == 4


@given(x=series, start=st.integers(0, 60))
def test_within_a_window_only_what_lies_in_it_counts(x, start):
    later = x[start:]
    found = value(f"max(after(x, {start * DT:.2f} s))", x=x)
    assert found == (pytest.approx(later.max()) if len(later) else None)


def test_time_is_that_of_the_end_of_a_tick_and_ended_is_the_last_one():
    x = np.zeros(5)
    assert value("max(t)", x=x) == pytest.approx(0.05)
    assert value("first(t)", x=x) == pytest.approx(0.01)
    assert value("not ended", x=x) is True
    assert value("not ended", ended=True, x=x) is False
    assert value("time_of(ended)", ended=True, x=x) == pytest.approx(0.05)
    assert value("time_of(ended)", x=x) is None


@pytest.mark.parametrize(
    ("text", "truth"),
    [
        ("max(x) > 2 m", True), ("max(x) > 2 m and min(x) > 2 "
            "m", False), ("max(x) > 2 m or min(x) > 2 m", True),
        ("not max(x) > 2 m", False), ("count(x > 2 m) > 0", True), ("last(x > 2 m)", False),
    ],
)  # fmt: skip
def test_a_comparison_of_reductions_is_true_or_false(text, truth):
    assert value(text, x=np.array([0.0, 3, 1])) is truth


def test_robots_of_a_batch_are_measured_side_by_side():
    x = np.arange(12.0).reshape(4, 3)
    np.testing.assert_array_equal(parse_measure("max(x)", UNITS).series(track(x=x))[-1], x.max(axis=0))
    both = parse_measure("mean(x) + first(x)", UNITS).series(track(x=x))[-1]
    np.testing.assert_allclose(both, x.mean(axis=0) + x[0])


# --- what has no value --------------------------------------------------------------------------------------


def left_out(text, x):
    """The value of a measure of a run of 0.1 s."""
    return value(text, x=np.asarray(x, dtype=float))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("last(after(x > 5 m, 5 s))", None), ("after(x > 5 m, 5 s)", None), ("not after(x > 5 m, 5 s)", None),
        ("between(x > 5 m, 0.01 s, 0.03 s)", None), ("max(after(x, 5 s)) > 1 m", None),
        ("after(x, 5 s) > 1 m and t > 0 s", None), ("after(x, 5 s) > 1 m and t < 0 s", False),
        ("t < 0 s and after(x, 5 s) > 1 m", False), ("after(x, 5 s) > 1 m or t > 0 s", True),
        ("t > 0 s or after(x, 5 s) > 1 m", True), ("after(x, 5 s) > 1 m or t < 0 s", None),
        ("last(where(after(x, 5 s) > 1 m, 2, 2))", 2), ("last(where(after(x, 5 s) > 1 m, 2, 3))", None),
        ("duration(not (after(x, 0.08 s) > 5 m))", 0.02), ("duration(after(x, 5 s) > 5 m)", 0),
        ("count(not (after(x, 0.08 s) > 5 m))", 1), ("time_of(not (after(x, 0.08 s) > 5 m))", 0.09),
        ("time_of(after(x, 0.08 s) < 5 m)", 0.09), ("mean(after(x, 0.08 s) < 5 m)", 1),
        ("mean(not after(x < 5 m, 0.08 s))", 0), ("mean(between(x, 0.02 s, 0.06 s) > 1.5 m)", 0.75),
        ("min(after(x, 0.08 s) < 5 m)", 1), ("last(between(x, 0.02 s, 0.05 s) > 2.5 m)", True),
    ],
)  # fmt: skip
def test_what_is_not_known_is_left_out_and_is_neither_true_nor_false(text, expected):
    """x is 0, 1, 2, 3 and 4 m, and so once more, at ten ticks of 10 ms."""
    found = left_out(text, [*range(5), *range(5)])
    assert found == (expected if expected is None else pytest.approx(expected))
    assert isinstance(found, bool) == isinstance(expected, bool)


def test_the_mean_of_what_was_infinite_is_no_number():
    assert left_out("mean(1 / x)", [0, 1, 2]) is None
    assert left_out("total(1 / x)", [0, 1, 2]) is None


_TIMES = st.integers(-1, 31).map(lambda tick: f"{tick * DT:.2f} s")
_LEVELS = st.integers(-3, 3).map(lambda level: f"{level} m")
_NUMBERS = st.recursive(
    st.sampled_from(["x", "y"]),
    lambda inside: st.one_of(
        st.tuples(inside, inside).map(lambda two: f"({two[0]} - {two[1]})"),
        st.tuples(st.sampled_from(["max", "min"]), inside, inside).map("{0[0]}({0[1]}, {0[2]})".format),
        st.tuples(
            st.sampled_from(["first", "first", "max", "min", "mean", "rms", "last", "abs"]), inside
        ).map("{0[0]}({0[1]})".format),
        st.tuples(inside, _TIMES).map("after({0[0]}, {0[1]})".format),
        st.tuples(inside, _TIMES, _TIMES).map("between({0[0]}, {0[1]}, {0[2]})".format),
        st.tuples(inside, _LEVELS).map("outside({0[0]}, {0[1]}, 3 m)".format),
    ),
    max_leaves=4,
)
_CONDITIONS = st.recursive(
    st.tuples(_NUMBERS, st.sampled_from(["<", "<=", ">", ">="]), _LEVELS).map(" ".join),
    lambda inside: st.one_of(
        st.tuples(inside, st.sampled_from(["and", "or"]), inside).map("({0[0]} {0[1]} {0[2]})".format),
        inside.map("(not ({}))".format),
        st.tuples(st.sampled_from(["first", "last"]), inside).map("{0[0]}({0[1]})".format),
        st.tuples(inside, _TIMES).map("after({0[0]}, {0[1]})".format),
        st.tuples(inside, _TIMES, _TIMES).map("between({0[0]}, {0[1]}, {0[2]})".format),
        inside.map("duration({}) > 0.03 s".format),
        inside.map("count({}) >= 2".format),
    ),
    max_leaves=3,
)


@settings(max_examples=300)
@given(
    text=_CONDITIONS,
    x=arrays(float, (30, 2), elements=st.integers(-4, 4)),
    y=arrays(float, (30, 2), elements=st.integers(-4, 4)),
    cuts=st.sets(st.integers(1, 29)),
)
@example(
    text="abs(x - first(after(x, 0.05 s))) > 1 m", x=np.tile(np.arange(30.0), (2, 1)).T, y=np.zeros((30, 2)),
    cuts={3, 9},
)  # fmt: skip
@example(text="after(x > 1 m, 0.2 s)", x=np.zeros((30, 2)), y=np.zeros((30, 2)), cuts={7})
def test_a_condition_in_parts_is_that_of_the_whole(text, x, y, cuts):
    """As the loop asks for it: two robots, some ticks at a time."""
    formula = parse_measure(text, UNITS)

    def until(end):
        return lambda begin: track(first=begin, x=x[begin:end], y=y[begin:end])

    parts, firsts = [], []
    for begin, end in pairwise([0, *sorted(cuts), len(x)]):
        parts.append(holds_where(formula.since(until(end), begin, firsts)))
    whole = holds_where(formula.since(until(len(x)), 0, []))
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    series = formula.series(track(x=x, y=y))
    np.testing.assert_array_equal(whole, (series != 0) & ~np.isnan(series))
    for robot in (0, 1):  # and what a measure finds afterwards
        when = parse_measure(f"time_of({text})", UNITS).value(track(x=x[:, robot], y=y[:, robot]))
        ticks = np.flatnonzero(whole[:, robot])
        assert when == (pytest.approx((ticks[0] + 1) * DT) if len(ticks) else None)


# --- units --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("max(x)", "m"), ("total(x)", "m*s"), ("total(v)", "m"), ("duration(x > 1 m)", "s"),
        ("count(x > 1 m)", "1"), ("time_of(x > 1 m)", "s"), ("max(outside(x, 0 m, 1 m))", "m"),
        ("total(hypot(v, v))", "m"), ("max(load) / 2 N", "1"), ("mean(x) / max(t)", "m/s"),
        ("rms(load) * max(x)", "N*m"),
    ],
)  # fmt: skip
def test_the_unit_of_a_measure_follows_from_its_channels(text, unit):
    assert parse_measure(text, UNITS).unit.dimension == parse_unit(unit).dimension


@pytest.mark.parametrize(
    ("text", "offset", "said"),
    [
        ("max(x) + max(load)", 0, "found 'max(x) + max(load)', which joins m and N; allowed: the same on all "
            "sides"),
        ("1 m + total(x)", 0, "found '1 m + total(x)', which joins m and m*s; allowed: the same on all "
            "sides"),
        ("max(x > 1 N)", 4, "found 'x > 1 N', which joins m and N; allowed: the same on all sides"),
        ("max(outside(x, 0, 1 N))", 4, "found 'outside(x, 0, 1 N)', which joins length and force; allowed: "
            "the same on all sides"),
        ("duration(x)", 0, "found 'duration(x)'; allowed: a condition there, such as duration(x > 0)"),
        ("2 * count(1 + x / 1 m)", 4, "found 'count(1 + x / 1 m)'; allowed: a condition there, such as "
            "count(x > 0)"),
        ("max(outside(x))", 4, "found 'outside(x)', whose bounds are not known; allowed: outside(x, low, "
            "high)"),
        (
            "max(outside(x, 1 m))", 4,
            "found outside with 2 arguments; allowed: outside(x, low, high), or outside(channel)",
        ),
        ("mean(xx)", 5, "unknown name 'xx'; allowed: "),
        ("maen(x)", 0, "unknown function 'maen'; allowed: "),
        ("mean(x, y)", 0, "found mean with 2 arguments; allowed: 1"),
    ],
)  # fmt: skip
def test_a_wrong_measure_is_told_with_its_place(text, offset, said):
    with pytest.raises(ExpressionError) as caught:
        parse_measure(text, UNITS)
    assert str(caught.value).startswith(said)
    assert caught.value.offset == offset


# --- what ends a run ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cart(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("cart"), CART, **CART_FILE)


def pushed(cart, until, seconds=1.0, **fields):
    """A cart that is pushed forward with 2 N from the start."""
    return run(cart, Told(["place"], force=2.0), duration_s=seconds, until=until, **fields)


@pytest.mark.parametrize("step_s", [0.002, 0.01, 0.05])
def test_what_comes_after_the_end_is_recorded_for_as_long_whatever_the_control_step(cart, step_s):
    """0.6 s from the next look, which is 20 ticks away at most."""
    recording = pushed(cart, "place > 1 cm", seconds=4.0, step_s=step_s)
    after = recording.ticks * step_s - recording.ended_s()
    assert 0.6 - 1e-9 <= after <= 0.6 + 20 * step_s


@pytest.mark.parametrize(
    "until",
    [
        "place > 5 cm",
        "abs(place - first(place)) > 5 cm",
        "max(place) > 5 cm",
        "place > 5 cm or angle > 9 rad",
    ],
)
def test_a_run_ends_in_the_tick_in_which_its_condition_first_holds(cart, until):
    """Also where it looks back, by `first` or by more."""
    recording = pushed(cart, until)
    free = pushed(cart, None)
    place = free.channel("place")[:, 0]
    start = place[0] if "first" in until else 0.0
    expected = int(np.argmax(place - start > 0.05))
    assert 0 < expected < 90
    assert recording.end_tick[0] == expected
    assert recording.ended_s() == pytest.approx((expected + 1) * DT)
    assert recording.measures[0]["survived"] is False
    assert free.end_tick[0] == -1
    assert free.measures[0]["survived"] is True
    np.testing.assert_array_equal(recording.qpos, free.qpos[: recording.ticks])


@pytest.mark.parametrize(
    ("until", "tick"),
    [
        ("after(place > -9 m, 0.8 s)", 80), ("between(place > -9 m, 0.8 s, 0.9 s)", 80),
        ("not after(place < -9 m, 0.8 s)", 80), ("after(place < -9 m, 0.8 s)", -1),
        ("after(place > -9 m, 0.8 s) or t > 0.3 s", 30),
        ("place - first(after(place, 0.3 s)) > 5 cm", None),
    ],
)  # fmt: skip
def test_a_window_ends_a_run_when_it_has_come(cart, until, tick):
    """The tick that ends at 0.8 s is the 79th from 0, and is not after it."""
    if tick is None:
        place = pushed(cart, None).channel("place")[:, 0]
        tick = int(np.argmax(place - place[30] > 0.05))
    found = pushed(cart, until, measures={"when": f"time_of({until})"})
    assert found.end_tick[0] == tick
    assert found.measures[0]["when"] == (None if tick < 0 else pytest.approx((tick + 1) * DT))


def survival(cart, survived, until=None):
    """A run of 1 s that is judged by a measure of its own."""
    scenario = Scenario(
        robot=cart, control_step=DT, duration=1.0, until=until, measures={"survived": survived}
    )
    return simulate(scenario)


def test_a_run_of_which_nobody_knows_has_not_survived_and_says_so(cart):
    """It ends before the window comes."""
    result = survival(cart, "last(after(place < 9 m, 0.5 s))", "t > 0.2 s")
    assert (result.measures["survived"], result.survived) == (None, False)
    assert result.outcome == "failed at 0.21 s, as survived has no value"
    assert result.row()["survived"] is None
    endless = survival(cart, "max(place / (place - place)) > 0")
    assert endless.outcome == "failed, as survived has no value"
    assert survival(cart, "last(after(place < 9 m, 0.5 s))").outcome == "passed"


@pytest.mark.parametrize(
    "window", ["after(place < 9 m, 5 s)", "after(place < 9 m, 1 s)", "between(place < 9 m, 0.5 s, 0.4 s)"]
)
def test_survival_by_a_window_that_never_comes_is_refused(cart, window):
    with pytest.raises(InputError) as caught:
        survival(cart, f"last({window})")
    assert str(caught.value) == (
        f"measures.survived: found '{window}', and the run of 1 s never comes to that; "
        "allowed: a window within the duration"
    )


def test_measures_stop_where_the_run_ended(cart):
    measures = {"way": "last(place)", "end": "time_of(ended)", "work": "total(pull * speed)"}
    recording = pushed(cart, "place > 5 cm", measures=measures)
    tick = int(recording.end_tick[0])
    place, speed, pull = (recording.channel(name)[: tick + 1, 0] for name in ("place", "speed", "pull"))
    assert recording.measures[0] == {
        "survived": False, "way": pytest.approx(place[-1]), "end": pytest.approx((tick + 1) * DT),
        "work": pytest.approx((speed * pull).sum() * DT),
    }  # fmt: skip
    assert recording.judge.units["way"].symbol == "m"
    assert recording.judge.units["survived"] is None


def test_measures_may_name_commands_references_and_parts(cart):
    measures = {
        "effort": "rms(force)",
        "unused": "max(angle)",
        "tip": "max(position(tip, z))",
        "gap": "min(distance(cart, tip))",
    }
    recording = pushed(cart, None, measures=measures)
    found = recording.measures[0]
    assert found["effort"] == pytest.approx(2.0)
    assert found["gap"] == pytest.approx(1.0)
    assert found["tip"] < 0.02


def test_what_nobody_commands_is_zero(cart):
    assert run(cart, measures={"effort": "max(abs(force))"}).measures[0]["effort"] == 0


def test_survived_may_be_something_else(cart):
    recording = pushed(cart, None, measures={"survived": "max(place) > 5 cm"})
    assert recording.measures[0] == {"survived": True}


def test_a_channel_that_a_measure_and_the_controller_read_is_seen_without_noise_by_the_measure(cart):
    measures = {"most": "max(place)"}
    quiet, loud = (
        pushed(cart, None, measures=measures, disturbances=noise)
        for noise in ([], [Noise(channel="place", std="1 m")])
    )
    assert quiet.measures == loud.measures


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"until": "place"}, "until: found 'place'; allowed: a condition, such as height < 0.2 m"),
        ({"until": "place > 1 N"}, "until: found 'place > 1 N', which joins m and N; allowed: the same on "
            "all sides"),
        (
            {"measures": {"a": "max(position(tips, z))"}},
            "measures.a: the MJCF has no body or site or geom or camera 'tips'; "
            "allowed: world, cart, pole, tip, box; did you mean 'tip'?",
        ),
        (
            {"measures": {"a": "max(joint(slide)) + max(joint(hinge))"}},
            "measures.a: found 'max(joint(slide)) + max(joint(hinge))', which joins m and rad; "
            "allowed: the same on all sides",
        ),
    ],
)  # fmt: skip
def test_a_wrong_measure_of_a_scenario_in_python_is_an_input_error(cart, fields, said):
    with pytest.raises(InputError) as caught:
        run(cart, **fields)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("text", "bound"),
    [
        ("n < 0.7", 0.7),
        ("n < 0.7 or x < 0.6 * first(x)", 0.7),
        ("x > 1 m or n <= 0.5 or 0.8 > n", 0.8),
        ("n < 0.7 and x > 1 m", None),
        ("n > 0.7", None),
        ("x < 0.6 * first(x)", None),
        ("max(n) < 0.7", None),
    ],
)
def test_below_which_value_a_channel_alone_makes_a_condition_true(text, bound):
    assert parse_measure(text, UNITS).true_below("n") == bound
