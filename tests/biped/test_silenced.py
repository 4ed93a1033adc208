"""Scenarios that silence parts of their circuit."""

from __future__ import annotations

import numpy as np
import pytest
from simulate.test_scenario import TEXT, written
from walking import a_push, scenario

from circuitkit.base.errors import InputError
from circuitkit.simulation import load_scenario, make_plan
from circuitkit.simulation.disturbance import Trial
from circuitkit.simulation.loop import run_loop


def test_a_circuit_whose_ends_are_silenced_is_the_open_loop() -> None:
    push = a_push(force=30.0)
    cut = make_plan(scenario(duration=2.4, silenced=("p1", "p2 -> ankle_roll")))
    whole = make_plan(scenario(duration=2.4))
    runs = {
        name: run_loop(plan.setup(controller, [Trial(0, (push,))]))
        for name, plan, controller in (
            ("cut", cut, "circuit"),
            ("open", whole, "open_loop"),
            ("whole", whole, "circuit"),
        )
    }
    assert np.array_equal(runs["cut"].qpos, runs["open"].qpos)
    assert np.abs(runs["whole"].commands).max() > 0
    assert runs["cut"].yardstick == whole.circuit  # where its thresholds stand does not change


def test_what_the_circuit_lacks_is_refused_at_its_line(tmp_path) -> None:
    text = TEXT + "silenced: [q1 -> p3]\n"
    with pytest.raises(InputError, match=r"mine\.yaml:\d+:\d+: silenced: found 'q1 -> p3': no conn"):
        make_plan(load_scenario(written(tmp_path, text)))
