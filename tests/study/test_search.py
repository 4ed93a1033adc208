"""The search for a boundary against looking at every value, and Wilson's interval against its definition."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.study import wilson_interval
from circuitkit.study.search import FIRST_SEEDS, Boundary, boundary

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
    holds = {
        value: ups.count(False) <= search.may_fail and len(ups) == len(search.seeds)
        for value, ups in made.items()
    }
    return made, boundary(holds, search.count)


@given(st.integers(1, 200), st.integers(-1, 200), st.integers(0, 5))
def test_where_all_below_holds_it_is_what_looking_at_each_finds(count, last, below):
    last = min(last, count - 1)
    made, (low, high) = found_by(Boundary(count, SEEDS, 1.0, below), lambda value, _: value <= last)
    assert (low, high) == (last, last + 1)
    assert len(made) <= math.ceil(math.log2(count + 1)) + below + 1


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
    for value, ups in made.items():
        assert len(ups) == (len(SEEDS) if value <= 11 else FIRST_SEEDS)


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
