"""The open loop: it reads nothing, writes nothing, records nothing."""

from __future__ import annotations

import numpy as np

from circuitkit.control import OpenLoop


def test_the_open_loop_adds_nothing_for_any_number_of_robots():
    controller = OpenLoop()
    assert controller.name == "open_loop"
    assert (controller.observations, controller.commands, controller.trace_names) == ((), (), ())
    for batch in (1, 4):
        controller.reset(batch)
        nothing = np.zeros((batch, 0))
        assert controller.step(nothing, nothing).shape == (batch, 0)
