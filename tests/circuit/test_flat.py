"""A resolved circuit written out says the same as the file that it came from."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.base.source import shipped_names
from circuitkit.base.units import parse_quantity, parse_unit
from circuitkit.circuit import load_circuit, parse_circuit
from circuitkit.circuit.authoring.flat import exact, flat_yaml

SMALLER = {"balanced_network": {"excitatory.size": 800, "inhibitory.size": 200}}
finite = st.floats(min_value=-1e100, max_value=1e100)


@pytest.mark.parametrize("name", shipped_names("circuits"))
def test_resolving_the_flat_text_gives_an_equal_circuit(name, tmp_path):
    graph = load_circuit(name, SMALLER.get(name))
    again = parse_circuit(flat_yaml(graph, tmp_path), str(tmp_path / "flat.yaml"))
    assert again == replace(graph, parameters={})


def test_the_flat_text_has_one_line_for_each_neuron_and_synapse():
    lines = flat_yaml(load_circuit("binn_lateral")).splitlines()
    assert (
        "  h1: {model: sigmoid, role: inhibitory, slope: 500, shift: 0.1, description: silences p2}" in lines
    )
    assert "- {from: lf, to: q1, weight: -1 m}" in lines
    assert "control_step: 10 ms" in lines


@given(value=finite, symbol=st.sampled_from(["mm", "deg", "1/m", "%", "ms", "m/s"]))
def test_values_are_written_so_that_they_read_back_exactly(value, symbol):
    text = exact(value, parse_unit(symbol))
    assert isinstance(text, str)
    assert parse_quantity(text).value_si == value


@pytest.mark.parametrize(
    ("value", "symbol", "text"),
    [
        (0.0799, "mm", "79.9 mm"),
        (0.05, "%", "5 %"),
        (100.0, "1/m", "100 /m"),
        (500.0, "1", 500),
        (0.1, "1", 0.1),
    ],
)
def test_values_are_written_as_short_as_that_allows(value, symbol, text):
    assert exact(value, parse_unit(symbol)) == text


def test_slopes_of_angles_are_written_per_degree():
    text = """\
circuit: a
control_step: 1 ms
timing: ordered
neurons: {q: {model: sigmoid, role: excitatory, slope: 2 /deg, shift: 3 deg}}
outputs: {y: {unit: "1", readout: {q: 1}}}
"""
    assert (
        "  q: {model: sigmoid, role: excitatory, slope: 2 /deg, shift: 3 deg}"
        in flat_yaml(parse_circuit(text)).splitlines()
    )
