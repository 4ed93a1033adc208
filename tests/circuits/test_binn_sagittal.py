"""The network of the x-direction: the curves of section 4.2 at the ends of the sole, and what comes out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.biped.gait import load_gait
from circuitkit.biped.references import GaitReference
from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run, step
from circuitkit.robots import load_robot
from circuitkit.simulation import load_scenario, simulate

W = math.radians(1.63)
FRONT, BACK, BEYOND = 0.07025, -0.02965, 0.05

# ZMP [m], neurons that are active, neurons at exactly one half, what the pitch turns by / w (eqs. 12 and 14)
TABLE = {
    "beyond the toes": (FRONT + BEYOND, "q2 h2 p2", "", 0.99285),
    "at the toes": (FRONT, "h2", "q2 p2", 0.5),
    "in the middle": ((FRONT + BACK) / 2, "", "", 0.0),
    "at the heel": (BACK, "h1", "q1 p1", -0.5),
    "beyond the heel": (BACK - BEYOND, "q1 h1 p1", "", -0.99285),
}


@pytest.fixture(scope="module")
def graph():
    return load_circuit("binn_sagittal")


@pytest.fixture(scope="module")
def program(graph):
    return compile_circuit(graph)


def _outputs(program, state):
    return dict(zip(program.neuron_names, state.output[0].tolist(), strict=True))


def test_there_are_no_errors_and_no_warnings():
    assert check("binn_sagittal") == ((), ())


@pytest.mark.parametrize("row", TABLE)
def test_which_neurons_fire_and_what_comes_out(program, row):
    zmp, active, half, turn = TABLE[row]
    state = step(program, program.initial_state(), np.array([[zmp]]))
    outputs = _outputs(program, state)
    assert {name for name, value in outputs.items() if value > 0.9} == set(active.split())
    assert {name for name, value in outputs.items() if 0.49 < value < 0.51} == set(half.split())
    assert all(value < 0.1 for name, value in outputs.items() if name not in f"{active} {half}".split())
    assert state.readout[0, 0] == pytest.approx(turn * W, abs=2e-5 * W)


def test_the_edges_are_those_of_the_force_cells_in_the_robot_file():
    cells = load_robot("nao").biped.feet.left.cells
    along = sorted(x for x, _ in cells.values())
    graph = load_circuit("binn_sagittal")
    assert graph.parameters["front_edge"].value_si == pytest.approx(along[-1])
    assert along[0] <= graph.parameters["back_edge"].value_si <= along[1]


@settings(max_examples=100, deadline=None)
@given(walk=st.lists(st.floats(-0.1, 0.15), min_size=1, max_size=30))
def test_mirrored_about_the_middle_of_the_sole_it_does_the_mirror_image(program, walk):
    inputs = np.array(walk)[:, np.newaxis, np.newaxis]
    trace = run(program, np.concatenate([inputs, FRONT + BACK - inputs], axis=1))
    np.testing.assert_allclose(trace.readout[:, 0], -trace.readout[:, 1], rtol=0, atol=1e-9)
    p1, p2 = (trace.output[:, 0, program.neuron_index[name]] for name in ("p1", "p2"))
    assert (np.minimum(p1, p2) < 0.5).all()


def test_held_beyond_the_toes_the_pitch_adds_up_and_leaks(program):
    pitch = run(program, np.full((10, 1, 1), FRONT + BEYOND)).readout[:, 0, 0]
    increment = 0.992846 * W
    np.testing.assert_allclose(pitch, increment * (1 - 0.95 ** np.arange(1, 11)) / 0.05, rtol=1e-5)


def test_the_nao_has_its_channels_and_carries_the_command_out():
    """Pushed from behind the circuit turns the ankles; what it says is what the joints are told."""
    march = GaitReference(load_gait("gait_march"))
    scenario = load_scenario("nao_push").model_copy(update={"reference": march, "duration": 3.0})
    start = {**scenario.pushes[0].start, "step": 2}
    push = scenario.pushes[0].model_copy(update={"start": start, "direction": "forward", "force": 5.0})
    result = simulate(scenario.with_disturbances((push,)), circuit="binn_sagittal")
    recording = result.recording
    assert (recording.observation_names, recording.command_names) == (("zmp_x",), ("ankle_pitch",))
    replayed = run(compile_circuit(recording.circuit), recording.observations).readout
    assert np.abs(recording.commands).max() > W
    np.testing.assert_allclose(recording.commands, replayed, atol=1e-12)
