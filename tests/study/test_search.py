"""The search for a boundary against looking at every value, and Wilson's interval against its definition."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.study import wilson_interval
from circuitkit.study.search import FIRST_SEEDS, Boundary, boundary, verdict

SEEDS = range(20)


def found_by(search: Boundary, stands) -> tuple[dict[int, list[bool]], tuple[int, int]]:
    """The runs that a search asks for, and the boundary, where `stands(value, seed)` says who stands."""
    strategy, made = search.runs(), {}
    wanted = next(strategy)
    while True:
        come = {(value, seed): stands(value, seed) for value, seed in wanted}
        for (value, _), up in come.items():
            made.setdefault(value, []).append(up)
        try:
            wanted = strategy.send(come)
        except StopIteration:
            break
    verdicts = {value: verdict(ups, len(search.seeds), search.survive) for value, ups in made.items()}
    return made, boundary(verdicts, search.count)


@given(st.integers(1, 200), st.integers(-1, 200), st.integers(0, 5))
def test_where_all_below_holds_it_is_what_looking_at_each_finds(count, last, below):
    last = min(last, count - 1)
    made, (low, high) = found_by(Boundary(count, SEEDS, 1.0, below), lambda value, _: value <= last)
    assert (low, high) == (last, last + 1)
    whole = [value for value, ups in made.items() if value > last or len(ups) == len(SEEDS)]
    octaves = math.ceil(math.log2(count + 1))  # a look for holes takes one value of each, and few runs
    above = sum(len(ups) for value, ups in made.items() if value > last) / FIRST_SEEDS
    assert above <= 2 * octaves
    assert len([value for value in whole if value <= last]) <= octaves + below + 1
    assert len(made) <= 3 * octaves + below + 1


@given(st.lists(st.booleans(), min_size=1, max_size=80), st.integers(0, 4))
def test_whatever_holds_the_values_just_below_the_boundary_do(pattern, below):
    made, (low, high) = found_by(Boundary(len(pattern), SEEDS, 1.0, below), lambda value, _: pattern[value])
    assert high == low + 1
    assert low == -1 or pattern[low]
    assert high == len(pattern) or not pattern[high]
    assert all(pattern[value] for value in range(max(low - below, 0), low))
    assert all(pattern[value] for value in made if value < low)


def test_looking_at_all_below_finds_the_first_gap():
    pattern = [value not in {10, 13} for value in range(61)]
    _, (low, _) = found_by(Boundary(61, SEEDS, 1.0, 61), lambda value, _: pattern[value])
    assert low == 9


def test_a_value_that_falls_at_once_costs_a_few_runs_only():
    made, _ = found_by(Boundary(61, SEEDS, 1.0, 0), lambda value, _: value <= 11)
    assert all(len(ups) == FIRST_SEEDS for value, ups in made.items() if value > 11)
    assert len(made[11]) == len(SEEDS)
    assert sum(len(ups) for ups in made.values()) <= 3 * len(SEEDS) + (3 + 6) * FIRST_SEEDS  # six octaves


def with_a_hole(value: int, seed: int) -> bool:
    """30 N 6 of 6, 36 N 2 of 6, 44 N 6 of 6, 52 N 0 of 6: a hole from 33 N on, and an end at 48 N."""
    return value < 33 or 40 <= value < 48 or (33 <= value < 40 and seed < 2)


@pytest.mark.parametrize(("count", "below"), [(53, 3), (61, 0), (61, 3), (81, 3), (200, 3)])
def test_a_hole_is_seen_from_above_and_from_below_wherever_bisection_lands(count, below):
    made, (low, high) = found_by(Boundary(count, range(6), 1.0, below), with_a_hole)
    assert (low, high) == (32, 33)
    assert any(len(ups) == 6 and all(ups) for value, ups in made.items() if value > high)
    assert sum(len(ups) for ups in made.values()) <= 6 * 4 * math.log2(count)


def test_what_nobody_knows_is_neither_held_nor_failed():
    """Above 9 the physics explodes."""
    made, (low, high) = found_by(
        Boundary(16, range(3), 1.0, 0), lambda value, _: True if value < 10 else None
    )
    assert (low, high) == (9, 10)
    assert verdict(made[10], 3) == "unknown"


@pytest.mark.parametrize(
    ("found", "survive", "expected"),
    [
        ([True] * 4, 1.0, "holds"),
        ([True] * 3, 1.0, "open"),
        ([True, False], 1.0, "fails"),
        ([True, None], 1.0, "unknown"),
        ([True, None, False], 1.0, "fails"),
        ([True, True, True, None], 0.75, "holds"),
        ([True, True, False, None], 0.75, "unknown"),
        ([False, False, True, None], 0.75, "fails"),
    ],
)
def test_a_verdict_needs_so_many_of_four_seeds(found, survive, expected):
    assert verdict(found, 4, survive) == expected


def test_the_last_seed_counts_as_much_as_the_first():
    made, (low, _) = found_by(Boundary(8, SEEDS, 1.0, 3), lambda value, seed: value < 3 or seed != 19)
    assert low == 2
    assert len(made[3]) == len(SEEDS)


@pytest.mark.parametrize(("survive", "last"), [(1.0, 4), (0.95, 5), (0.9, 6), (0.05, 23)])
def test_a_share_that_must_stand_lets_the_others_fall(survive, last):
    """Of 20 seeds, value - 4 fall."""
    search = Boundary(30, SEEDS, survive, 0)
    _, (low, _) = found_by(search, lambda value, seed: seed >= value - 4)
    assert low == last


@pytest.mark.parametrize("seeds", [1, 3, 4, 5])
def test_few_seeds_are_enough(seeds):
    _, (low, _) = found_by(Boundary(10, range(seeds), 1.0, 3), lambda value, _: value < 5)
    assert low == 4


@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilsons_ends_are_where_the_score_test_just_refuses(counts):
    """|k/n - p| = z sqrt(p (1 - p) / n) at both ends p."""
    successes, runs = counts
    z = 1.959963984540054
    for end in wilson_interval(successes, runs):
        distance = z * math.sqrt(end * (1 - end) / runs)
        assert abs(successes / runs - end) == pytest.approx(distance, abs=1e-9)


def test_wilson_where_none_fell():
    """n / (n + z^2) with z^2 = 3.8415."""
    assert wilson_interval(20, 20) == (pytest.approx(20 / 23.8415, abs=1e-5), 1.0)
    assert wilson_interval(0, 20) == (0.0, pytest.approx(3.8415 / 23.8415, abs=1e-5))
    assert wilson_interval(0, 0) == (0.0, 1.0)
