"""What neurons answer to an activation that is held, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.draw.activations import activations_figure, make_panels
from circuitkit.draw.responses import member, response, span

HEAD = "circuit: c\ncontrol_step: 10 ms\ntiming: ordered\n"


def neuron(model, **values):
    keys = ", ".join(f"{name}: {value}" for name, value in values.items())
    text = (
        f"{HEAD}neurons:\n  n: {{model: {model}, role: excitatory, {keys}}}\n"
        "outputs: {y: {unit: '1', readout: {n: 1}}}\n"
    )
    return parse_circuit(text).neurons[0]


def test_a_memoryless_neuron_answers_with_its_function():
    found = response(neuron("sigmoid", slope=2, shift=0.5), -1.0, 2.0)
    np.testing.assert_allclose(found.output, 1 / (1 + np.exp(-2 * (found.activation - 0.5))), rtol=1e-9)
    assert found.what == "output"


def test_a_leaky_integrator_settles_on_its_sigmoid():
    found = response(neuron("leaky_integrator", tau="10 ms", slope=2, shift=0.5), -1.0, 2.0)
    np.testing.assert_allclose(found.output, 1 / (1 + np.exp(-2 * (found.activation - 0.5))), rtol=1e-5)
    assert found.what == "steady output"


def test_matsuokas_neuron_settles_on_what_is_left_of_its_drive():
    values = {"tau": "50 ms", "tau_adaptation": "100 ms", "beta": 2.5, "drive": 1}
    found = response(neuron("matsuoka", **values), -3.0, 6.0)
    np.testing.assert_allclose(found.output, np.maximum(0, (found.activation + 1) / 3.5), atol=1e-3)


def test_a_spiking_neuron_answers_with_its_rate():
    volts = {"rest": "-65 mV", "reset": "-65 mV", "threshold": "-50 mV"}
    values = {"tau": "10 ms", "resistance": "10 Mohm", "refractory": "0 ms"}
    cell = neuron("leaky_integrate_and_fire", **volts, **values)
    low, high = span([cell])
    found = response(cell, low, high)
    assert (found.what, str(found.unit)) == ("rate", "Hz")
    drive = 1e7 * found.activation  # [V]
    above = drive > 1.1 * 0.015
    rate = 1 / (0.010 * np.log(drive[above] / (drive[above] - 0.015)))
    np.testing.assert_allclose(found.output[above], rate, rtol=0.05)
    assert (found.output[drive < 0.015] == 0).all()
    assert low < 0
    assert high > 1.5e-9


def test_a_member_has_the_values_of_its_place():
    text = HEAD + (
        "populations:\n"
        "  ring: {size: 5, model: sigmoid, role: excitatory, slope: 1, shift: {range: [0, 8]}}\n"
        "outputs: {y: {unit: '1', readout: {ring: 1}}}\n"
    )
    graph = parse_circuit(text)
    assert member(graph.populations[0], 2).parameters == {"slope": 1.0, "shift": 4.0}
    assert [panel.title for panel in make_panels(graph)] == ["ring[0], ring[2], ring[4] (excitatory)"]


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("matsuoka_half_centre", {"steady output O [1]"}),
        ("spiking_reflex", {"rate [Hz]"}),
    ],
)
def test_curves_of_circuits_with_states(name, labels):
    figure = activations_figure(load_circuit(name))
    assert {axes.get_ylabel() for axes in figure.axes} == labels
