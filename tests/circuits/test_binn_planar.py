"""Two networks of one file: each does what it does alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.circuit import check, load_circuit
from circuitkit.control import CircuitController, Interface
from circuitkit.engine import compile_circuit, run
from circuitkit.robots import build_model, load_robot

_WALKS = st.lists(
    st.tuples(
        st.sampled_from([-1.0, 0.0, 1.0]) | st.floats(-1, 1), st.floats(-0.1, 0.15), st.floats(-0.15, 0.15)
    ),
    min_size=1,
    max_size=30,
)


def _compiled(name):
    """With the backend that rounds alike whatever stands beside a neuron."""
    return compile_circuit(load_circuit(name), backend="numpy", reproducible=True)


@pytest.fixture(scope="module")
def planar():
    return _compiled("binn_planar")


@pytest.fixture(scope="module")
def lateral():
    return _compiled("binn_lateral")


@pytest.fixture(scope="module")
def sagittal():
    return _compiled("binn_sagittal")


def _run(program, **series):
    inputs = np.stack([series[name] for name in program.input_names], axis=-1)
    return run(program, inputs[:, np.newaxis])


def test_there_are_no_errors_and_no_warnings():
    assert check("binn_planar") == ((), ())


@settings(max_examples=100, deadline=None)
@given(walk=_WALKS)
def test_the_lateral_part_does_to_the_last_bit_what_binn_lateral_does(planar, lateral, walk):
    force, zmp_x, zmp_y = np.array(walk).T
    both = _run(planar, force_difference=force, zmp_x=zmp_x, zmp_y=zmp_y)
    alone = _run(lateral, force_difference=force, zmp_y=zmp_y)
    for name in lateral.neuron_names:
        ours = both.output[:, 0, planar.neuron_index[f"lateral.{name}"]]
        np.testing.assert_array_equal(ours, alone.output[:, 0, lateral.neuron_index[name]], err_msg=name)
    roll = both.readout[:, 0, planar.output_index["ankle_roll"]]
    np.testing.assert_array_equal(roll, alone.readout[:, 0, 0])


@pytest.mark.parametrize("force", [-1.0, -0.5, 0.0, 0.5, 1.0])
@settings(max_examples=40, deadline=None)
@given(walk=_WALKS)
def test_the_sagittal_part_does_what_binn_sagittal_does_whichever_foot_carries(planar, sagittal, force, walk):
    """With three edges equal, choosing between them is no choice; only while both feet change it matters."""
    _, zmp_x, zmp_y = np.array(walk).T
    both = _run(planar, force_difference=np.full(len(zmp_x), force), zmp_x=zmp_x, zmp_y=zmp_y)
    alone = _run(sagittal, zmp_x=zmp_x)
    pitch = both.readout[:, 0, planar.output_index["ankle_pitch"]]
    # An inhibited q still says sigmoid(100 (zmp - edge - 1)) < 1e-35, which two q of one p add up.
    np.testing.assert_allclose(pitch, alone.readout[:, 0, 0], rtol=1e-9, atol=1e-15)


@settings(max_examples=40, deadline=None)
@given(walk=_WALKS)
def test_no_direction_disturbs_the_other(planar, walk):
    force, zmp_x, zmp_y = np.array(walk).T
    roll, pitch = (planar.output_index[name] for name in ("ankle_roll", "ankle_pitch"))
    both = _run(planar, force_difference=force, zmp_x=zmp_x, zmp_y=zmp_y).readout[:, 0]
    still = np.zeros_like(force)
    only_y = _run(planar, force_difference=force, zmp_x=still, zmp_y=zmp_y).readout[:, 0]
    only_x = _run(planar, force_difference=force, zmp_x=zmp_x, zmp_y=still).readout[:, 0]
    np.testing.assert_array_equal(both[:, roll], only_y[:, roll])
    np.testing.assert_array_equal(both[:, pitch], only_x[:, pitch])


@pytest.mark.parametrize("name", ["binn_sagittal", "binn_planar", "binn_omnidirectional"])
def test_the_nao_has_all_channels(name):
    model = build_model(load_robot("nao").with_servos(None))
    known = Interface(model.channel_units, model.command_units, 0.01)
    controller = CircuitController(load_circuit(name)).bind(known)
    assert set(controller.commands) <= {"ankle_roll", "ankle_pitch"}
