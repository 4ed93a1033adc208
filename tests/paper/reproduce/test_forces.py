"""Ratios and claims of Fig. 11 from made-up forces, worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from circuitkit.paper.push_bounds import PushKind
from circuitkit.paper.reproduce.fig11 import claims_of
from circuitkit.paper.reproduce.finding import Verdict
from circuitkit.paper.reproduce.forces import Forces

KINDS = tuple(
    PushKind(direction, duration) for direction in ("outward", "inward") for duration in (0.1, 0.2, 0.4, 1.0)
)


def forces(**survived):
    by_kind = {name: dict(zip(KINDS, values, strict=True)) for name, values in survived.items()}
    bound = dict.fromkeys(KINDS, 40.0)
    return Forces(by_kind, bound, dict.fromkeys(KINDS, 50.0))


def paper_like(**changes):
    """As the paper has it: more than the MPC everywhere, by more the shorter the push; 22 N at most."""
    return forces(
        **{
            "open_loop": (4,) * 8,
            "mpc": (10, 10, 8, 6) * 2,
            "mpc_full": (12,) * 8,
            "binn": (22, 18, 10, 7) * 2,
            "binn_tuned": (22, 18, 10, 7) * 2,
            "binn_capture": (22, 18, 10, 7) * 2,
            **changes,
        }
    )


def verdicts(found):
    return {claim.claim: claim.verdict for claim in claims_of(found, found, 20)}


BETTER = "The BiNN (tuned) is on average 52.55 % better than the MPC"
EVERY = "The BiNN (tuned) withstands more than the MPC for every duration"
OF_BOUND = "The BiNN (tuned) reaches 85 % of what ankles can hold, pushed at the torso"
FULL = "The BiNN (tuned) withstands more than an MPC that knows the centre of mass"


def test_the_mean_is_that_of_the_ratios_as_in_the_paper():
    found = paper_like()
    expected = (2.2 + 1.8 + 1.25 + 7 / 6) / 4
    assert found.ratio("binn_tuned", "mpc") == pytest.approx(expected)
    assert found.of_bound("binn_tuned") == pytest.approx((22 + 18 + 10 + 7) / 4 / 40)


def test_pushes_of_which_the_baseline_survives_none_are_left_out():
    found = paper_like(mpc=(0, 10, 0, 0) * 2)
    assert found.ratio("binn_tuned", "mpc") == pytest.approx(1.8)
    assert math.isnan(paper_like(mpc=(0,) * 8).ratio("binn_tuned", "mpc"))


def test_the_papers_numbers_bear_out_the_papers_claims():
    found = verdicts(paper_like())
    assert found[EVERY] is Verdict.HOLDS
    assert found[BETTER] is Verdict.HOLDS
    assert found["The improvement is larger for shorter durations"] is Verdict.HOLDS
    assert found["The largest force, for 0.1 s, is 22 N"] is Verdict.HOLDS
    assert found["Ankles hold no force above the 22.48 N of eq. 22"] is Verdict.HOLDS
    assert found[OF_BOUND] is Verdict.FAILS


def test_a_small_gain_holds_in_part_and_a_loss_does_not():
    assert verdicts(paper_like(binn_tuned=(11, 11, 9, 7) * 2))[BETTER] is Verdict.PARTLY
    assert verdicts(paper_like(binn_tuned=(9, 9, 7, 5) * 2))[BETTER] is Verdict.FAILS


def test_the_reading_of_the_paper_is_judged_by_itself():
    made_up = paper_like(binn=(0,) * 8)
    falling = replace(made_up, falls_unpushed=frozenset({"binn"}), circuits={"binn": "binn_lateral"})
    found = {c.claim: c for c in claims_of(falling, falling, 20)}
    claim = found["The BiNN (as the paper reads) is on average 52.55 % better than the MPC"]
    assert claim.verdict is Verdict.FAILS
    assert claim.ours == "\N{MINUS SIGN}100.0 %"
    assert claim.why.startswith("It falls even without a push.")
    assert claim.how.startswith("circuit binn_lateral over mpc;")


def test_pushes_through_the_centre_of_mass_are_judged_by_their_own_forces():
    at_com = paper_like(binn_capture=(38,) * 8)
    found = {c.claim: c.verdict for c in claims_of(paper_like(), at_com, 20)}
    where = "The BiNN (reading the capture point) reaches 85 % of what ankles can hold, pushed"
    assert found[f"{where} through the centre of mass"] is Verdict.HOLDS
    assert found[f"{where} at the torso"] is Verdict.FAILS


def test_more_than_the_mpc_in_some_pushes_holds_in_part():
    found = verdicts(paper_like(binn_tuned=(22, 18, 10, 6) * 2))
    assert found[EVERY] is Verdict.PARTLY


def test_more_than_eq_22_and_most_of_the_bound():
    found = verdicts(paper_like(binn_tuned=(36,) * 8))
    assert found["Ankles hold no force above the 22.48 N of eq. 22"] is Verdict.FAILS
    assert found[OF_BOUND] is Verdict.HOLDS
    assert found[FULL] is Verdict.HOLDS


def test_what_is_short_of_the_bound_or_of_the_better_mpc_does_not_hold_in_part():
    found = verdicts(paper_like(binn_tuned=(33,) * 8, mpc_full=(34,) * 8))
    assert found[OF_BOUND] is Verdict.FAILS
    assert found[FULL] is Verdict.FAILS


def test_more_than_the_mpc_by_knowing_more_is_said_to_be_that():
    claims = {claim.claim: claim for claim in claims_of(paper_like(), paper_like(), 20)}
    why = claims["The BiNN (reading the capture point) is on average 52.55 % better than the MPC"].why
    assert why.startswith("It reads the true centre of mass, which this MPC is not")
    assert not claims[BETTER].why


def test_directions_and_durations_come_sorted():
    found = paper_like()
    assert [kind.duration_s for kind in found.of_direction("inward")] == [0.1, 0.2, 0.4, 1.0]
    assert found.shortest("outward") == PushKind("outward", 0.1)
    assert found.largest("binn_tuned").duration_s == 0.1
