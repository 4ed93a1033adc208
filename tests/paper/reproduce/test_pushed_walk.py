"""Times beyond thresholds and back to the limit cycle, from made-up motions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from circuitkit.biped.robot import biped_of
from circuitkit.paper.reproduce.fig10 import verdict_on_return
from circuitkit.paper.reproduce.finding import Verdict
from circuitkit.paper.reproduce.pushed_walk import (
    Excursions,
    PushedWalk,
    beyond,
    cell_edges_m,
    excursions,
    time_to_limit_cycle_s,
)
from circuitkit.robots import build_model, load_robot


def flags(*runs):
    """Alternately inside and outside, for so many ticks each."""
    return np.concatenate([np.full(ticks, bool(number % 2)) for number, ticks in enumerate(runs)])


def test_times_outside_are_counted_from_the_first_crossing():
    found = excursions(flags(5, 3, 10, 8, 60), 0.01, calm_ticks=55)
    assert found == Excursions(
        first=pytest.approx(0.03), longest=pytest.approx(0.08), total=pytest.approx(0.11), until_calm=0.21
    )


def test_a_step_inside_between_crossings_is_calm_already():
    assert excursions(flags(0, 3, 56, 8, 60), 0.01, calm_ticks=55).until_calm == pytest.approx(0.03)


def test_never_outside_and_never_back():
    assert excursions(flags(100), 0.01, 55) == Excursions(None, None, 0.0, None)
    assert excursions(flags(10, 90), 0.01, 55).until_calm is None
    assert excursions(flags(10, 5, 20), 0.01, 55).until_calm is None  # the end came too soon to tell


def test_beyond_is_outside_of_either_line():
    lines = np.array([[[-0.1, 0.05]]])
    assert [bool(beyond(np.array([[y]]), lines)[0, 0]) for y in (-0.2, -0.1, 0.0, 0.05, 0.06)] == [
        True, False, False, False, True,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("first", "calm", "verdict"),
    [
        ([0.03, 0.05], [0.08, 0.09], Verdict.HOLDS),
        ([0.03, 0.05], [1.2, None], Verdict.PARTLY),
        ([0.3, 0.5], [1.2, None], Verdict.FAILS),
        ([None], [None], Verdict.FAILS),
        ([], [], Verdict.FAILS),
    ],
)
def test_the_return_is_as_quick_as_the_papers_for_good_at_first_or_not(first, calm, verdict):
    assert verdict_on_return(first, calm) is verdict


def test_the_cells_hull_lies_inside_the_soles():
    edges = cell_edges_m(biped_of(build_model(load_robot("nao"))).block)
    assert edges == pytest.approx(np.array([[0.0269, 0.0799], [-0.0799, -0.0269], [-0.0799, 0.0799]]))


def circling(leaves, survived=True):
    """A walk of 12 s on a circle in the plane of y and y'/omega, pushed at 6 s; off it by `leaves(t)`."""
    time = np.arange(1, 1201) * 0.01
    height = 0.27
    omega = np.sqrt(9.81 / height)
    phase = 2 * np.pi * time / 1.1
    radius = 0.03 + np.where(time > 6.0, leaves(time - 6.0), 0.0)
    com = np.zeros((1200, 1, 3))
    velocity = np.zeros((1200, 1, 3))
    com[:, 0, 1], com[..., 2] = radius * np.cos(phase), height
    velocity[:, 0, 1] = radius * np.sin(phase) * omega
    recording = SimpleNamespace(
        step_s=0.01,
        motion=SimpleNamespace(pace_s=0.55),
        effects=SimpleNamespace(windows_s=np.array([[6.0, 6.2]])),
    )
    walk = PushedWalk(None, recording, np.array([survived]))
    vars(walk)["view"] = SimpleNamespace(com_m=com, com_velocity=velocity)
    return walk


def test_a_walk_is_back_once_it_stays_within_five_millimetres():
    (found,) = time_to_limit_cycle_s(circling(lambda t: 0.02 * np.exp(-t)))
    assert found == pytest.approx(np.log(4.0), abs=0.02)  # 20 mm e^-t = 5 mm


def test_who_stays_away_or_falls_does_not_return():
    assert time_to_limit_cycle_s(circling(lambda t: 0.02 + 0 * t)) == (None,)
    assert time_to_limit_cycle_s(circling(lambda t: 0 * t, survived=False)) == (None,)
    assert time_to_limit_cycle_s(circling(lambda t: 0 * t)) == (0.0,)
