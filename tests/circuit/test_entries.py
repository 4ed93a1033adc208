"""Keys of neurons, synapses and the whole circuit: models, states, noise, delays, gates, and values from outside."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

from pathlib import Path

import pytest

from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.circuit import check, load, load_circuit, parse_circuit
from circuitkit.circuit.load import analyse

BASE = """\
circuit: keys
control_step: 10 ms
timing: ordered
substeps: 10
parameters: {tau: 20 ms}
neuron_models:
  resonator:
    parameters: {tau: {unit: s}, damping: {unit: "1", default: 0.5}}
    states: {x: {unit: activation}, y: {unit: activation}}
    derivatives: {x: y / tau, y: (A - x - 2 * damping * y) / tau}
    output: 1 - exp(-x / (1 mm))
    activation: mm
inputs: {u: {unit: "1", range: [-1, 1]}}
neurons:
  a: {model: leaky_integrator, role: excitatory, tau: tau, slope: 4, shift: 0.5, noise: 0.1, initial: {v: 0.2}}
  b: {model: sigmoid, role: inhibitory, slope: 10, shift: 0.5}
  c: {model: leaky_integrate_and_fire, role: excitatory}
  r: {model: resonator, role: excitatory, tau: 5 ms}
synapses:
  - {from: u, to: a, weight: 1}
  - {from: a, to: b, weight: 1, delay: 20 ms}
  - {from: b, to: a, weight: -1, model: gated, gate: c}
  - {from: a, to: c, weight: 10 nS, model: conductance, reversal: 0 mV}
  - {from: c, to: r, weight: 2 mm}
  - {from: r, to: b, weight: 0.5, model: hebbian, rate: 1 %, low: 0, high: 1}
  - {from: r, to: b, weight: 0.5}
outputs:
  y: {unit: "1", readout: {b: 1, c: 1}, integrate: {leak: 5 %}}
"""


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def findings(old: str, new: str) -> tuple[list[str], list[str]]:
    assert old in BASE
    Path("f.yaml").write_text(BASE.replace(old, new, 1), encoding="utf-8")
    errors, warnings = check("f.yaml")
    return [str(error) for error in errors], [str(warning) for warning in warnings]


def test_everything_is_resolved_to_si_values():
    graph = parse_circuit(BASE)
    neurons = {neuron.name: neuron for neuron in graph.neurons}
    assert graph.substeps == 10
    assert (neurons["a"].noise, neurons["a"].initial) == (0.1, {"v": 0.2})
    assert neurons["c"].initial["v"] == pytest.approx(neurons["c"].parameters["rest"])
    assert neurons["c"].activation_unit.symbol == "nA"
    assert neurons["r"].model.method == "exponential_euler"
    assert neurons["r"].parameters == {"tau": 0.005, "damping": 0.5}
    synapses = {(synapse.source, synapse.target, synapse.model.name): synapse for synapse in graph.synapses}
    assert synapses["a", "b", "static"].delay_s == 0.02
    assert synapses["b", "a", "gated"].gate == "c"
    assert synapses["a", "c", "conductance"].weight == pytest.approx(1e-8)
    assert synapses["a", "c", "conductance"].parameters["reversal"] == 0
    assert synapses["r", "b", "hebbian"].initial == {"w": 0.5}
    assert synapses["r", "b", "hebbian"].parameters == {"rate": 0.01, "decay": 0, "low": 0, "high": 1}


def test_two_synapses_of_different_models_may_connect_the_same_neurons():
    assert findings("x", "x") == ([], [])
    errors, _ = findings("weight: 0.5}", "weight: 0.5, model: hebbian, rate: 1 %, low: 0, high: 1}")
    assert errors == [
        "f.yaml:26:19: synapses[6].to: duplicate synapse r -> b, first on line 25; allowed: each one once"
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("initial: {v: 0.2}", "initial: {w: 0.2}", "f.yaml:15:104: neurons.a.initial.w: unknown state 'w' of the model leaky_integrator; allowed: v"),
        ("initial: {v: 0.2}", "initial: {v: 2 mm}", "f.yaml:15:107: neurons.a.initial.v: found 2 mm (length); allowed: a number without unit, since the activation is dimensionless"),
        ("noise: 0.1", "noise: 0.1 mm", "f.yaml:15:89: neurons.a.noise: found 0.1 mm (length); allowed: a number without unit, since the activation is dimensionless"),
        ("noise: 0.1", "noise: -0.1", "f.yaml:15:89: neurons.a.noise: found -0.1; allowed: 0 or more"),
        ("tau: tau", "tau: 0.02", "f.yaml:15:55: neurons.a.tau: found 0.02 (dimensionless); allowed: time, such as '1 s', since tau is in s; did you mean '0.02 s'?"),
        ("delay: 20 ms", "delay: 20 mm", "f.yaml:21:40: synapses[1].delay: found 20 mm (length); allowed: time, such as '1 s'"),
        ("delay: 20 ms", "delay: -20 ms", "f.yaml:21:40: synapses[1].delay: found -20 ms; allowed: 0 s or more"),
        (", gate: c", "", "f.yaml:22:5: synapses[2]: missing key 'gate'; the model gated needs a neuron as gate"),
        ("gate: c", "gate: cc", "f.yaml:22:54: synapses[2].gate: unknown gate 'cc'; allowed: a neuron: a, b, c, r; did you mean 'c'?"),
        ("gate: c", "gate: u", "f.yaml:22:54: synapses[2].gate: found 'u', which is an input; allowed: a neuron: a, b, c, r"),
        ("model: gated", "model: gatd", "f.yaml:22:41: synapses[2].model: unknown model 'gatd'; allowed: conductance, depressing_facilitating, depressing_facilitating_rate, exponential, exponential_conductance, first_order, gated, hebbian, oja, static; did you mean 'gated'?"),
        ("model: conductance, reversal: 0 mV", "model: conductance", "f.yaml:23:5: synapses[3]: missing key 'reversal'; required by conductance: from, to, weight, reversal"),
        ("weight: 10 nS", "weight: 10 nA", "f.yaml:23:30: synapses[3].weight: found 10 nA (current); allowed: "),
        ("weight: 10 nS", "weight: -10 nS", "f.yaml:23:30: synapses[3].weight: found -10 nS; allowed: a positive weight, as the model conductance needs"),
        ("a, to: c,", "a, to: b,", "f.yaml:23:19: synapses[3].to: the synapse model conductance reads the state v of its target, but the model sigmoid of b has none; allowed: a neuron whose model has it"),
        ("weight: 2 mm", "weight: 2 mm, model: hebbian, rate: 1 mm, low: 0, high: 1 mm", "f.yaml:24:69: synapses[4].low: found 0 (dimensionless); allowed: length, such as '1 mm', since low is in weight; did you mean '0 mm'?"),
        ("rate: 1 %", "rate: 1 mm", "f.yaml:25:57: synapses[5].rate: found 1 mm (length); allowed: a number without unit, since rate is in weight/source"),
        ("low: 0, high: 1", "low: 1, high: 0", "f.yaml:25:67: synapses[5].low: found low 1 and high 0; allowed: low below high"),
        ("weight: 2 mm", "weight: 2", "f.yaml:24:30: synapses[4].weight: found 2 (dimensionless); allowed: length, such as '1 mm', since the activation of r is in mm and c is dimensionless; did you mean '2 mm'?"),
        ("substeps: 10", "substeps: 2.5", "f.yaml:4:11: substeps: found 2.5; allowed: a whole number from 1 on"),
        ("substeps: 10", "substeps: 0", "f.yaml:4:11: substeps: found 0; allowed: a whole number from 1 on"),
        ("substeps: 10", "substeps: 10 ms", "f.yaml:4:11: substeps: found 10 ms (time); allowed: a number without unit, since substeps is a number"),
        ("substeps: 10", "seed: -1", "f.yaml:4:7: seed: found -1; allowed: a whole number from 0 on"),
        ("resonator:", "sigmoid:", "f.yaml:7:3: neuron_models.sigmoid: the name 'sigmoid' is taken by a shipped model; allowed: a name of its own"),
        ("model: resonator", "model: resonatr", "f.yaml:18:14: neurons.r.model: unknown model 'resonatr'; allowed: resonator, adaptive_exponential, conductance, "),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_place(old, new, message):
    errors, _ = findings(old, new)
    if message.endswith((": ", ", ")):  # a long list follows
        assert any(error.startswith(message) for error in errors), errors
    else:
        assert message in errors


@pytest.mark.parametrize(
    ("delay", "warning"),
    [
        ("20 ms", ""),
        ("20.1 ms", ""),
        ("24 ms", "f.yaml:21:40: synapses[1].delay: found 24 ms; it becomes 20 ms, a multiple of 10 ms"),
        ("2 ms", "f.yaml:21:40: synapses[1].delay: found 2 ms; it becomes 0 ms, a multiple of 10 ms"),
    ],
)
def test_a_delay_between_steps_is_doubted(delay, warning):
    assert findings("delay: 20 ms", f"delay: {delay}") == ([], [warning] if warning else [])


def test_a_delay_between_continuous_neurons_is_made_of_substeps():
    assert findings("reversal: 0 mV", "reversal: 0 mV, delay: 2 ms") == ([], [])
    assert findings("reversal: 0 mV", "reversal: 0 mV, delay: 2.5 ms")[1] == [
        "f.yaml:23:80: synapses[3].delay: found 2.5 ms; it becomes 2 ms, a multiple of 1 ms"
    ]


def test_a_mistake_in_an_own_model_is_named_with_its_place():
    errors, _ = findings("x: y / tau", "x: y * tau")
    assert errors
    assert errors[0].startswith("f.yaml:10:22: neuron_models.resonator.derivatives.x: ")


@pytest.mark.parametrize(
    ("overrides", "seen"),
    [
        ({"tau": "5 ms"}, lambda graph: graph.neurons[0].parameters["tau"] == 0.005),
        ({"a.tau": "tau / 2"}, lambda graph: graph.neurons[0].parameters["tau"] == 0.01),
        ({"r.damping": 2}, lambda graph: graph.neurons[3].parameters["damping"] == 2),
        ({"b.noise": 0.5}, lambda graph: graph.neurons[1].noise == 0.5),
        ({"a.initial.v": 1}, lambda graph: graph.neurons[0].initial == {"v": 1}),
        ({"control_step": "5 ms"}, lambda graph: graph.step_s == 0.005),
        ({"substeps": 20}, lambda graph: graph.substeps == 20),
        ({"timing": "synchronous"}, lambda graph: graph.timing == "synchronous"),
        ({"y.integrate.leak": "4 %"}, lambda graph: graph.outputs[0].leak == 0.04),
        ({"y.readout.c": 3}, lambda graph: graph.outputs[0].readout == (("b", 1), ("c", 3))),
        ({"u.range.1": 7}, lambda graph: graph.inputs[0].high == 7),
    ],
)
def test_every_value_can_be_given_from_outside(overrides, seen):
    assert seen(parse_circuit(BASE, settings=overrides))
    assert not seen(parse_circuit(BASE))
    Path("f.yaml").write_text(BASE, encoding="utf-8")
    assert load_circuit("f.yaml", overrides) == parse_circuit(BASE, "f.yaml", overrides)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("a.taw", "a.tau"),
        ("substep", "substeps"),
        ("tua", "tau"),
        ("y.integrate.laek", "y.integrate.leak"),
        ("a.initial.V", "a.initial.v"),
    ],
)
def test_a_name_that_stands_for_nothing_is_refused(name, hint):
    with pytest.raises(UnknownNameError) as caught:
        parse_circuit(BASE, settings={name: 1})
    assert str(caught.value).startswith(f"unknown name '{name}'; allowed: tau, ")
    assert str(caught.value).endswith(f"; did you mean '{hint}'?")


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"a.tau": "5 mm"}, "<text>:15:55: neurons.a.tau: found 5 mm (length); allowed: time, such as '1 s', since tau is in s"),
        ({"timing": "orderd"}, "<text>:3:9: timing: found 'orderd'; allowed: as_printed, synchronous, ordered; did you mean 'ordered'?"),
        ({"substeps": 0}, "<text>:4:11: substeps: found 0; allowed: a whole number from 1 on"),
        ({"control_step": "-1 ms"}, "<text>:2:15: control_step: found -1 ms; allowed: more than 0 s"),
        ({"b.noise": "far"}, "<text>:16:6: neurons.b.noise: unknown parameter 'far'; allowed: a number, a quantity such as '-80 mm', or a parameter: tau"),
        ({"b.slope": "2 * far"}, "<text>:16:48: neurons.b.slope: unknown parameter 'far'; allowed: a number, a quantity such as '-80 mm', or a parameter: tau"),
        ({"tau": "2 * far"}, ": parameters.tau: unknown parameter 'far'; allowed: a number, a quantity such as '-80 mm', or a parameter: tau"),
        ({"a.tau": [1, 2]}, "<text>:15:55: neurons.a.tau: found a list of 2; allowed: a number, a quantity such as '-80 mm', or a parameter"),
    ],
)  # fmt: skip
def test_a_value_from_outside_must_fit(overrides, message):
    with pytest.raises(InputError) as caught:
        parse_circuit(BASE, settings=overrides)
    assert message in str(caught.value)


def test_settings_of_a_command_are_named_in_messages():
    with pytest.raises(InputError, match=r"^--set: unknown name 'tua'; allowed: tau, "):
        parse_circuit(BASE, settings={"tua": 1}, option="--set")
    with pytest.raises(InputError, match=r": found 0; allowed: a whole number from 1 on \(with --set\)$"):
        parse_circuit(BASE, settings={"substeps": 0}, option="--set")
    with pytest.raises(InputError, match=r"^f\.yaml:4:11: substeps: found 0; [^(]*$"):
        parse_circuit(BASE.replace("substeps: 10", "substeps: 0"), "f.yaml", {"tau": "1 s"}, option="--set")


def test_a_circuit_is_resolved_once(monkeypatch):
    calls = []
    monkeypatch.setattr(load, "analyse", lambda *args, **named: calls.append(1) or analyse(*args, **named))
    parse_circuit(BASE)
    assert len(calls) == 1


def test_the_model_must_take_the_source_s_unit():
    errors, _ = findings(
        'inputs: {u: {unit: "1", range: [-1, 1]}}', "inputs: {u: {unit: mm, range: [-1 mm, 1 mm]}}"
    )
    assert errors == [
        "f.yaml:20:30: synapses[0].weight: found 1 (dimensionless); allowed: 1/length, such as '1 /m', since the activation "
        "of a is dimensionless and u is in mm; did you mean '1 /m'?"
    ]
