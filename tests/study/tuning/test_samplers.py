"""Samplers: edges of the unit cube, whose turn it is, and what a candidate without a value counts for."""

from __future__ import annotations

import math

import pytest

from circuitkit.study.tuning.samplers import Cmaes, OtherCandidateError, Space, Told, Tpe, _Axis
from circuitkit.study.tuning.space import Searched

RANGE = Searched.model_validate({"from": "-2 deg", "to": "2 deg"})
LOG = Searched.model_validate({"from": "1 %", "to": "100 %", "log": True})


def space(start=None, *, seed=1, maximise=False) -> Space:
    return Space({"w": RANGE, "leak": LOG}, start or {}, seed, maximise)


def told(candidates, values) -> list[Told]:
    return [Told(each, value) for each, value in zip(candidates, values, strict=True)]


@pytest.mark.parametrize(
    ("axis", "unit", "value"),
    [
        (_Axis(2.0, 6.0, log=False, whole=False), 0.25, 3.0),
        (_Axis(2.0, 6.0, log=False, whole=False), 0.0, 2.0),
        (_Axis(2.0, 6.0, log=False, whole=False), 1.0, math.nextafter(6.0, 5.0)),  # open above
        (_Axis(1.0, 100.0, log=True, whole=False), 0.5, 10.0),
        (_Axis(1.0, 100.0, log=True, whole=False), 1.0, math.nextafter(100.0, 99.0)),
        (_Axis(2, 6, log=False, whole=True), 0.0, 2),
        (_Axis(2, 6, log=False, whole=True), 0.12, 2),
        (_Axis(2, 6, log=False, whole=True), 0.125, 3),  # a half is rounded up
        (_Axis(3, 6, log=False, whole=True), 0.5, 5),
        (_Axis(2, 6, log=False, whole=True), 1.0, 6),
        (_Axis(1, 100, log=True, whole=True), 0.5, 10),
        (_Axis(1, 100, log=True, whole=True), 1.0, 100),
        (_Axis(1, 100, log=True, whole=True), 0.0, 1),
    ],
)
def test_an_edge_of_the_cube_is_a_range(axis, unit, value):
    found = axis.value(unit)
    assert found == pytest.approx(value, abs=0 if value in {2.0, 6.0} else 1e-14)
    assert axis.low <= found <= axis.high
    if not axis.whole and 0 < unit < 1:
        assert axis.unit(found) == pytest.approx(unit)


def test_steps_are_those_of_whole_numbers_that_are_no_logarithms():
    assert _Axis(2, 6, log=False, whole=True).step == 0.25
    assert _Axis(2, 6, log=True, whole=True).step == 0.0
    assert _Axis(2.0, 6.0, log=False, whole=False).step == 0.0


@pytest.mark.parametrize("make", [Tpe, lambda over: Cmaes(over, 4, 0.2)], ids=["tpe", "cmaes"])
def test_the_start_is_the_first_candidate_and_no_other(make):
    start = {"w": 1.0, "leak": 50.0}
    first = make(space(start))([], 3)
    assert first[0] == start
    assert start not in first[1:]
    after = make(space(start))([told(first, [3.0, 1.0, 2.0])], 2)
    assert start not in after
    assert start not in make(space())([], 3)
    assert make(space())([], 3) != make(space(seed=2))([], 3)


@pytest.mark.parametrize("sampler", ["tpe", "cmaes"])
def test_candidates_follow_from_the_seed_and_what_was_told(sampler):
    def candidates(over: Space, *values):
        made = Tpe(over) if sampler == "tpe" else Cmaes(over, 4, 0.2)
        rounds = []
        for some in values:
            rounds.append(told(made(rounds, len(some)), some))
        return made(rounds, 4)

    first, second = [1.0, 2.0, 3.0, 4.0], [1.5, 2.5, 0.5, 3.5]
    one = candidates(space(), first, second)
    assert candidates(space(), first, second) == one
    assert candidates(space(maximise=True), *([-x for x in some] for some in (first, second))) == one
    if sampler == "cmaes":  # TPE begins with ten drawn evenly
        assert candidates(space(), first[::-1], second) != one


def test_a_candidate_without_a_value_counts_for_nothing():
    """A generation of four: with three that were measured it is not over, with one more it is."""
    made = Cmaes(space(), 4, 0.2)
    first = made([], 4)
    three = told(first, [1.0, None, 2.0, 3.0])
    second = made([three], 4)
    assert second != made([told(first, [1.0, 4.0, 2.0, 3.0])], 4)
    assert second == made([], 8)[4:]  # the distribution has not moved
    third = made([three, told(second, [4.0, 5.0, 6.0, 7.0])], 4)
    assert third != made([], 12)[8:]
    # Of the second round only the first candidate was of the generation that is over.
    assert third == made([three, told(second, [4.0, 9.0, 1.0, 7.0])], 4)


def test_the_start_moves_nothing():
    """It stands beside the generations, so a generation is over one candidate later."""
    made = Cmaes(space({"w": 1.0, "leak": 50.0}), 4, 0.2)
    first = made([], 4)
    assert made([told(first, [1.0, 2.0, 3.0, 4.0])], 2) == made([], 6)[4:]
    five = made([], 5)
    moved = made([told(five, [1.0, 2.0, 3.0, 4.0, 5.0])], 2)
    assert moved != made([], 7)[5:]
    assert moved == made([told(five, [9.0, 2.0, 3.0, 4.0, 5.0])], 2)


def test_what_was_not_proposed_is_told_by_its_number():
    made = Cmaes(space(), 4, 0.2)
    first = made([], 4)
    other = [*told(first[:2], [1.0, 2.0]), Told({**first[2], "w": 0.123}, 3.0), Told(first[3], 4.0)]
    with pytest.raises(OtherCandidateError) as caught:
        made([other], 4)
    assert caught.value.number == 2


def test_the_first_generation_lies_about_the_start_or_the_middle():
    start = {"w": 1.0, "leak": 50.0}
    about_start = Cmaes(space(start), 4, 1e-12)([], 4)
    about_middle = Cmaes(space(), 4, 0.0)([], 4)
    for each in about_start:
        assert each["w"] == pytest.approx(1.0, abs=1e-8)
        assert each["leak"] == pytest.approx(50.0, abs=1e-6)
    for each in about_middle:
        assert each["w"] == pytest.approx(0.0, abs=1e-8)
        assert each["leak"] == pytest.approx(10.0, abs=1e-6)
