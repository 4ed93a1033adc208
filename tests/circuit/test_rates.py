"""Synapses that jump at each spike, fed by what does not spike: the result would depend on the substeps."""

import logging

import pytest

from circuitkit.circuit.load import check, load_circuit

HEAD = """circuit: c
control_step: 1 ms
substeps: 10
timing: ordered
inputs: {u: {unit: "1", range: [0, 1]}}
"""
BODY = """neurons:
  r: {model: leaky_linear, role: excitatory, tau: 10 ms}
  s: {model: leaky_integrate_and_fire, role: excitatory}
  cell: {model: conductance, role: excitatory}
populations:
  many: {size: 2, model: conductance, role: excitatory}
"""
MODELS = ["exponential", "depressing_facilitating, use: 0.5, tau_depression: 1 s, tau_facilitation: 1 s"]


def warnings_of(tmp_path, source, model, section="synapses", target="cell", extra=""):
    entry = f"  - {{from: {source}, to: {target}, weight: 1 nA, model: {model}, tau: 5 ms{extra}}}\n"
    path = tmp_path / "c.yaml"
    readout = "outputs: {y: {unit: '1', readout: {cell: 1}}}"
    path.write_text(f"{HEAD}{BODY}{section}:\n{entry}{readout}\n", encoding="utf-8")
    _, found = check(path)
    return [str(each) for each in found if "does not spike" in str(each)]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("source", ["r", "u", "cell"])
def test_a_source_that_does_not_spike_is_doubted(source, model, tmp_path):
    (found,) = warnings_of(tmp_path, source, model)
    assert "c.yaml:13:12: synapses[0].from: found " in found
    assert "use a source that spikes, or a model without jumps, such as first_order" in found


def test_a_projection_is_looked_at_as_well(tmp_path):
    assert len(warnings_of(tmp_path, "r", "exponential", "projections", "many", ", connect: all_to_all")) == 1


@pytest.mark.parametrize("model", ["exponential", "first_order"])
def test_spikes_and_models_without_jumps_are_left_alone(model, tmp_path):
    assert not warnings_of(tmp_path, "s", model)
    assert not warnings_of(tmp_path, "u", "first_order")


def test_who_runs_it_is_told_as_well(tmp_path, caplog):
    (found,) = warnings_of(tmp_path, "r", "exponential")
    with caplog.at_level(logging.WARNING, "circuitkit"):
        load_circuit(tmp_path / "c.yaml")
        load_circuit(tmp_path / "c.yaml")
    assert caplog.messages.count(f"{found} (warning)") == 1
