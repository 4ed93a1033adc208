"""What a walk intends, as circuits read it: by eq. 2, in the frame of the sensed channels, tick by tick."""

from __future__ import annotations

import numpy as np
import pytest
from walking import known_of, plan_of

from circuitkit.biped.gait.lipm import GRAVITY_M_S2
from circuitkit.circuit import load_circuit
from circuitkit.engine import compile_circuit, step

TICKS = 300


@pytest.fixture(scope="module")
def plan():
    return plan_of("binn_lateral_capture", gait="gait_walk_2cm", duration=TICKS * 0.01)


def test_the_planned_com_has_the_planned_zmp(plan):
    reference, dt = known_of(plan), 0.01
    channels = reference.planned_channels()
    for axis, letter in enumerate("xy"):
        middle = reference.ankles_m[:TICKS, :, axis].mean(axis=1)
        com = channels[f"planned_com_{letter}"].values + middle
        bend = (com[2:] - 2 * com[1:-1] + com[:-2]) / dt**2
        zmp = com[1:-1] - reference.com_height_m / GRAVITY_M_S2 * bend
        np.testing.assert_allclose(zmp, reference.zmp_m[1 : TICKS - 1, axis], atol=1e-9)
        speed = channels[f"planned_com_velocity_{letter}"].values
        np.testing.assert_allclose(speed[1:-1], (com[2:] - com[:-2]) / (2 * dt), atol=1e-9)


def test_a_circuit_reads_the_plan_of_its_own_tick(plan):
    channels = known_of(plan).planned_channels()
    program = compile_circuit(load_circuit("binn_lateral_capture"))
    controller = plan.controller("circuit")
    controller.reset(1)
    assert not [name for name in controller.observations if name.startswith("planned")]
    rng, state = np.random.default_rng(3), program.initial_state()
    trace = np.empty((1, len(controller.trace_names)))
    for tick in range(TICKS):
        values = rng.normal(0.0, 0.03, (1, len(controller.observations)))
        sensed = dict(zip(controller.observations, values[0], strict=True))
        intended = {name: each.values[tick] for name, each in channels.items() if name.endswith("_y")}
        state = step(program, state, program.pack_inputs(sensed | intended))
        np.testing.assert_allclose(controller.step(values), state.readout, atol=1e-12)
        controller.store_trace(trace)
        np.testing.assert_allclose(trace[0], state.output[0], atol=1e-12)
