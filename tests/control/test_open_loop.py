"""The open loop: it reads nothing, writes nothing, records nothing."""

from __future__ import annotations

import numpy as np

from circuitkit.control import Controller, OpenLoop


def test_the_open_loop_adds_nothing_for_any_number_of_robots():
    controller = OpenLoop()
    assert controller.name == "open_loop"
    assert (controller.observations, controller.commands) == ((), ())
    assert isinstance(controller, Controller)
    for batch in (1, 4):
        controller.reset(batch)
        assert controller.step(np.zeros((batch, 0))).shape == (batch, 0)
