"""Controllers that have nothing to do leave the walk as it is, by the figures that gaits are judged by."""

from __future__ import annotations

import pytest
from walking import plan_of, walk_all

from circuitkit.paper.gait_figures import gait_figures
from circuitkit.simulation import RunSpec


@pytest.mark.parametrize("name", ["mpc", "mpc_full", "dcm_ankle"])
def test_undisturbed_it_walks_as_the_open_loop_does(name):
    """Judged as gaits are; a minute of it is measured in docs/controllers.md."""
    plan = plan_of(duration=5.0)
    figures = gait_figures(walk_all(plan, name, [RunSpec(100)]))
    assert not figures.fell
    assert figures.inside_10mm == 1.0
    assert figures.swing_free > 0.8
    assert figures.ankle_rms_deg < 2.0
