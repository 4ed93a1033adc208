"""The search for what each seed survives, against thresholds that are known."""

from __future__ import annotations

import pytest

from circuitkit.base.errors import InputError
from circuitkit.study import make_study
from circuitkit.study.results import Results
from circuitkit.study.search import EachBoundary

LIMITS = {0: 13, 1: 0, 2: -1, 5: 30, 7: 12}  # the last number of a grid of 0 to 30 that each seed survives


def answered(seeds, count=31):
    """All that a search asks for when the seeds survive up to their limits, round by round."""
    strategy = EachBoundary(count, seeds).runs()
    rounds = [next(strategy)]
    while True:
        try:
            rounds.append(strategy.send({(index, seed): index <= LIMITS[seed] for index, seed in rounds[-1]}))
        except StopIteration:
            return rounds


def test_each_seed_is_bisected_for_itself_in_common_rounds():
    rounds = answered(tuple(LIMITS))
    assert len(rounds) <= 6  # 31 values and "none": 32 = 2^5 answers; and a look for holes above
    assert all(len({seed for _, seed in each}) == len(each) for each in rounds[:-1])
    assert all(index > LIMITS[seed] + 1 for index, seed in rounds[-1])
    for seed, limit in LIMITS.items():
        tried = {index for each in rounds for index, name in each if name == seed}
        assert {max(limit, 0), min(limit + 1, 30)} <= tried  # both sides of the boundary have been run


def study(**search):
    return make_study(
        {
            "study": "made_up",
            "scenario": "nao_push",
            "axes": {"push.direction": ["inward"]},
            "seeds": {"first": 0, "count": 3},
            "search": {"field": "push.force", "low": "0 N", "high": "30 N", "step": "1 N", **search},
        }
    )


def rows(limits_n, forces=(0, 5, 6, 7, 12, 13, 30)):
    return tuple(
        {
            "push.direction": "inward",
            "push.force": float(force),
            "seed": seed,
            "survived": force <= limit,
        }
        for seed, limit in enumerate(limits_n)
        for force in forces
    )


def test_limits_say_what_each_seed_survived():
    (limit,) = Results(study(of="each_seed"), rows((12, 6, 30))).limits()
    assert limit.each == (12.0, 6.0, 30.0)
    assert limit.largest == 6.0
    assert limit.fails_at == 7.0
    assert (limit.survived, limit.runs) == (3, 3)


def test_a_seed_that_survives_nothing_counts_as_fallen_at_the_smallest_value():
    (limit,) = Results(study(of="each_seed"), rows((12, -1, 30))).limits()
    assert limit.each == (12.0, 0.0, 30.0)
    assert (limit.largest, limit.survived, limit.runs) == (0.0, 2, 3)
    (from_5_n,) = Results(
        study(of="each_seed", low="5 N"), rows((12, -1, 30), forces=(5, 12, 13, 30))
    ).limits()
    assert (from_5_n.largest, from_5_n.survived, from_5_n.fails_at) == (0.0, 2, 5.0)


@pytest.mark.parametrize("other", [{"survive": 0.9}, {"check_below": 1}])
def test_what_is_only_for_all_seeds_is_refused(other):
    message = f"found of: each_seed with {next(iter(other))}; allowed: these with all_seeds"
    with pytest.raises(InputError, match=message):
        study(of="each_seed", **other)
