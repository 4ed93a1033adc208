"""Scenarios that silence parts of their circuit."""

from __future__ import annotations

import numpy as np
from walking import a_push, plan_of, walk_alone


def test_a_circuit_whose_ends_are_silenced_is_the_open_loop() -> None:
    push = a_push(force=30.0)
    cut = plan_of(duration=2.4, disturbances=[push], silenced=("p1", "p2 -> ankle_roll"))
    whole = plan_of(duration=2.4, disturbances=[push])
    runs = {
        name: walk_alone(plan, controller)
        for name, plan, controller in (
            ("cut", cut, "circuit"),
            ("open", whole, "open_loop"),
            ("whole", whole, "circuit"),
        )
    }
    assert np.array_equal(runs["cut"].qpos, runs["open"].qpos)
    assert np.abs(runs["whole"].commands).max() > 0
    (of_cut,), (of_whole,) = runs["cut"].judge.kinds, runs["whole"].judge.kinds
    # Where its thresholds stand does not change.
    np.testing.assert_array_equal(of_cut.lines_m, of_whole.lines_m)
