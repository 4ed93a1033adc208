"""Robots of one batch that are at ticks of their own, as vector environments need them."""

from __future__ import annotations

import numpy as np

from circuitkit.robots import Worlds
from circuitkit.simulation import load_scenario, make_plan


def test_a_robot_that_starts_anew_does_what_it_did_at_first_while_the_others_go_on():
    body = make_plan(load_scenario("nao_push").model_copy(update={"duration": 1.0})).body
    nothing = np.zeros((3, 0))

    def worlds():
        made = Worlds(body.robot, body.step_s, body.motion.targets, body.motion.start_qpos, (), 3, 1)
        made.begin()
        return made

    plain = worlds()
    history = []
    for tick in range(60):
        plain.advance(tick, nothing)
        history.append((plain.qpos.copy(), plain.readings.copy()))

    mixed = worlds()
    start, ticks = mixed.start_state(), np.zeros(3, dtype=np.int64)
    for step in range(60):
        if step == 25:
            mixed.restart(np.array([1]), start)
            ticks[1] = 0
        mixed.advance(ticks, nothing)
        for robot, tick in enumerate(ticks):
            np.testing.assert_array_equal(mixed.qpos[robot], history[tick][0][0])
            np.testing.assert_array_equal(mixed.readings[robot], history[tick][1][0])
        ticks += 1
