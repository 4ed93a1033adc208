"""Latency and rate of the reflex against the closed form of the leaky integrate-and-fire neuron."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from circuitkit.circuit import check, load_circuit
from circuitkit.engine import compile_circuit, run

STEP_S = 1e-4
TAU, REFRACTORY, DELAY = 20e-3, 4e-3, 8e-3
NEEDED = 15.0  # from rest to the threshold, [mV]
DRIVE = 200.0  # 20 nA times 10 Mohm, per unit of lean, [mV]


@pytest.fixture(scope="module")
def program():
    """A control step is one substep of the file, so that every single spike is seen."""
    changes = {"control_step": "0.1 ms", "substeps": 1}
    return compile_circuit(load_circuit("spiking_reflex", changes))


def _spikes(program, tilt, duration_s=0.4):
    """Times of the spikes of each neuron, [s], and the trace."""
    trace = run(program, np.full((round(duration_s / STEP_S), 1, 1), tilt))
    times = (np.arange(len(trace.output)) + 1) * STEP_S
    names = [*program.neuron_names]
    return {name: times[trace.output[:, 0, i] > 0] for i, name in enumerate(names)}, trace


def _rise(tilt):
    return TAU * math.log(DRIVE * tilt / (DRIVE * tilt - NEEDED))


def test_there_are_no_errors_and_no_warnings():
    assert check("spiking_reflex") == ((), ())


@pytest.mark.parametrize("tilt", [0.08, 0.1, 0.15, 0.3, 0.8])
def test_latency_and_interval_of_the_sensory_neuron(program, tilt):
    spikes = _spikes(program, tilt)[0]["sensory_left"]
    assert spikes[0] == pytest.approx(_rise(tilt), abs=1.01 * STEP_S)
    np.testing.assert_allclose(np.diff(spikes), REFRACTORY + _rise(tilt), atol=2.01 * STEP_S)
    assert 1 / np.diff(spikes).mean() <= 1 / REFRACTORY


@pytest.mark.parametrize("tilt", [0.0, 0.05, 0.0749])
def test_a_small_lean_is_not_answered(program, tilt):
    spikes, trace = _spikes(program, tilt)
    assert not any(len(times) for times in spikes.values())
    assert not trace.readout.any()


def test_each_sensory_spike_makes_one_motor_spike_a_delay_and_a_rise_later(program):
    """The synaptic current w exp(-t / 1 ms) lifts the motor neuron (5 ms) by
    w R tau_s / (tau - tau_s) (exp(-t / tau) - exp(-t / tau_s)) = 40 mV (exp(-t / 5 ms) - exp(-t / 1 ms))."""
    rise = brentq(lambda t: 40 * (math.exp(-t / 5e-3) - math.exp(-t / 1e-3)) - NEEDED, 0, 2e-3)
    spikes, _ = _spikes(program, 0.15)
    sensory, motor = spikes["sensory_left"], spikes["motor_left"]
    answered = sensory[: len(motor)]
    assert len(sensory) - len(motor) <= 1
    np.testing.assert_allclose(motor - answered, DELAY + rise, atol=2.01 * STEP_S)


def test_leaning_to_the_left_turns_the_body_to_the_right_and_the_mirror_image(program):
    left, right = (_spikes(program, tilt)[1].readout[:, 0, 0] for tilt in (0.2, -0.2))
    assert (left <= 0).all()
    assert left.min() < 0
    np.testing.assert_allclose(left, -right, atol=1e-15)


def test_in_control_steps_of_10_ms_no_spike_is_lost():
    program = compile_circuit(load_circuit("spiking_reflex"))
    trace = run(program, np.full((200, 1, 1), 0.3))
    sensory = trace.output[:, 0, program.neuron_index["sensory_left"]].sum()
    assert sensory == pytest.approx(2.0 / (REFRACTORY + _rise(0.3)), rel=0.02)  # substeps of 0.2 ms
    motor = trace.output[:, 0, program.neuron_index["motor_left"]]
    roll = 0.0
    for count, found in zip(motor, trace.readout[:, 0, 0], strict=True):
        roll = max(0.98 * roll - math.radians(0.1) * count, -math.radians(22))
        assert found == pytest.approx(roll, abs=1e-12)
