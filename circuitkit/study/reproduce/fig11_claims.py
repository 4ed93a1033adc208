"""What the paper says of its Fig. 11, and what we say beyond it, against measured forces."""

from __future__ import annotations

import math

from circuitkit.study.reproduce.finding import Claim, Verdict, agrees, all_hold, reaches
from circuitkit.study.reproduce.forces import Forces
from circuitkit.study.reproduce.numbers import count, plain, signed_percent, words

DIRECTIONS = ("outward", "inward")
IMPROVEMENT, LARGEST_N, BOUND_N = 1.5255, 22.0, 22.48  # the paper's
WANTED_OF_BOUND = 0.85
_SHORT_S = 0.3
_TUNED_FOR_S = (0.1, 0.2, 0.4)
_SOURCE, _BEYOND = "section 5.2", "beyond the paper"
_PAPER, _TUNED = "circuit binn_lateral, all numbers as the paper reads", "circuit binn_lateral_tuned"


def claims_of(forces: Forces, runs: int) -> tuple[Claim, ...]:
    """The rows of Fig. 11.

    Args:
        forces: Of the contenders binn, binn_tuned, mpc and mpc_full.
        runs: How many had to be survived.
    """
    how = f"largest force survived in all of {runs} runs, mean of the ratios over durations and directions"
    return (
        _every_duration(forces, runs),
        _improvement("tuned", forces.ratio("binn_tuned", "mpc"), f"{_TUNED} over mpc; {how}"),
        _improvement(
            "as the paper reads",
            forces.ratio("binn", "mpc"),
            f"{_PAPER}, over mpc; {how}",
            why=_why_not_as_read(forces),
        ),
        _shorter(forces, how),
        _largest(forces, runs),
        _bound(forces, runs),
        _of_bound(forces),
        _full_feedback(forces, how),
    )


def _why_not_as_read(forces: Forces) -> str:
    alone = "It falls even without a push. " if "binn" in forces.falls_unpushed else ""
    return f"{alone}On this plant the paper's w is too quick and lifts the edge of the foot: see Fig. 9."


def _every_duration(forces: Forces, runs: int) -> Claim:
    won, pushes = forces.wins("binn_tuned", "mpc"), len(forces.kinds)
    return Claim(
        "The BiNN withstands more than the MPC for every duration",
        "all",
        count(won, pushes),
        f"{_TUNED} against mpc, durations and directions in which it survives more; {runs} runs each",
        reaches(won, pushes, 0),
        source=_SOURCE,
    )


def _improvement(which: str, ratio: float, how: str, why: str = "") -> Claim:
    verdict = reaches(ratio, IMPROVEMENT, 1.0)
    return Claim(
        f"The BiNN is on average 52.55 % better than the MPC ({which})",
        "+52.55 %",
        signed_percent(ratio),
        how,
        verdict,
        why=why if verdict is not Verdict.HOLDS else "",
        source=_SOURCE,
    )


def _shorter(forces: Forces, how: str) -> Claim:
    short = forces.ratio("binn_tuned", "mpc", [k for k in forces.kinds if k.duration_s <= _SHORT_S + 1e-9])
    long = forces.ratio("binn_tuned", "mpc", [k for k in forces.kinds if k.duration_s > _SHORT_S + 1e-9])
    return Claim(
        "The improvement is larger for shorter durations",
        "larger",
        f"{signed_percent(short)} up to {_SHORT_S:g} s, {signed_percent(long)} beyond",
        f"{_TUNED} over mpc; {how}",
        all_hold(short > long),
        source=_SOURCE,
    )


def _largest(forces: Forces, runs: int) -> Claim:
    kinds = [forces.shortest(direction) for direction in DIRECTIONS]
    found = {kind: forces.survived["binn_tuned"][kind] for kind in kinds}
    return Claim(
        "The largest force, for 0.1 s, is 22 N",
        f"{LARGEST_N:g} N",
        ", ".join(f"{plain(force)} N {kind.direction}" for kind, force in found.items()),
        f"{_TUNED}, {kinds[0].duration_s:g} s, all of {runs} runs; the paper does not tell the direction",
        all_hold(*(agrees(force, LARGEST_N, 0.1) is Verdict.HOLDS for force in found.values())),
        why=words("""
        Inward, the foot in the air comes down and catches the robot, so that more can be held than on one
        foot; outward the edge of the foot that carries is near."""),
        source=_SOURCE,
    )


def _bound(forces: Forces, runs: int) -> Claim:
    kind = forces.largest("binn_tuned")
    force = forces.survived["binn_tuned"][kind]
    return Claim(
        "Ankles hold no force above the 22.48 N of eq. 22",
        f"{BOUND_N} N",
        f"{plain(force)} N, {kind.direction} for {kind.duration_s:g} s",
        f"{_TUNED}, the largest force of all, survived in all of {runs} runs",
        all_hold(force <= BOUND_N),
        why=words("""
        Eq. 22 is the bound for a push that lasts, at the height of the CoM. A short one ends before the
        capture point has gone far, so that m ω² L / (1 - exp(-ω d)) stands in its place; for long d that
        is eq. 22 with its own distance L."""),
        source="eq. 22",
    )


def _of_bound(forces: Forces) -> Claim:
    kinds = [k for k in forces.kinds if any(math.isclose(k.duration_s, d) for d in _TUNED_FOR_S)]
    part = forces.of_bound("binn_tuned", kinds)
    return Claim(
        "The tuned BiNN reaches 85 % of what ankles can hold",
        "-",
        f"{part * 100:.0f} %",
        f"{_TUNED} over the DCM bound for a push at the torso, mean over 0.1, 0.2, 0.4 s and both directions",
        reaches(part, WANTED_OF_BOUND, WANTED_OF_BOUND / 2),
        source=_BEYOND,
    )


def _full_feedback(forces: Forces, how: str) -> Claim:
    ratio = forces.ratio("binn_tuned", "mpc_full")
    return Claim(
        "The tuned BiNN withstands more than an MPC that knows the true centre of mass",
        "-",
        signed_percent(ratio),
        f"{_TUNED} over mpc_full; {how}",
        reaches(ratio, 1.0, 0.9),
        source=_BEYOND,
    )
