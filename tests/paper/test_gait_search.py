"""The search for the gaits' numbers: what it charges, and that the shipped gaits have what it found."""

from __future__ import annotations

import dataclasses

from circuitkit.paper import gait_search
from circuitkit.paper.gait_figures import GaitFigures


def test_the_search_charges_a_fall_more_than_anything_else():
    clean = GaitFigures(False, 1.0, 1.0, 0.044, 1.0, 0.0, 0.0, 0.0)
    assert gait_search.cost(clean) == 0.0
    dirty = dataclasses.replace(clean, margin_5pct_m=-0.01, swing_free=0.0, drift_per_2m_m=1.0)
    fallen = dataclasses.replace(clean, fell=True)
    assert 0.0 < gait_search.cost(dirty) < gait_search.cost(fallen)


def test_the_shipped_gaits_share_the_numbers_of_the_search():
    found = {
        "zmp_forward": 0.0257,
        "zmp_sideways": 0.059,
        "lift_start": 0.0,
        "lift_end": 1.0,
        "swing_start": 0.24,
        "swing_end": 0.65,
    }
    for name in gait_search.GAITS:
        gait = gait_search.load_gait(name)
        assert gait_search.with_numbers(gait, found) == gait
