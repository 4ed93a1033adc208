"""`circuitkit show` and `circuitkit schema`."""

from __future__ import annotations

import json
from pathlib import Path

from circuitkit.circuit import circuit_schema


def test_tables_say_everything_about_a_circuit(circuitkit):
    outcome = circuitkit("show", "binn_lateral")
    assert (outcome.code, outcome.err) == (0, "")
    rows = [tuple(line.split()) for line in outcome.out.splitlines()]
    assert [row[0] for row in rows if row[:1] and row[0] in {"inputs", "neurons", "synapses", "outputs"}] == [
        "inputs",
        "neurons",
        "synapses",
        "outputs",
    ]
    assert ("lf", "q1", "-1", "m", "inhibitory") in rows
    assert ("zmp_y", "q3", "-1", "sensorial") in rows
    assert any(row[:7] == ("q4", "sigmoid", "excitatory", "slope", "100", "/m,", "shift") for row in rows)
    assert any("adds up, leaks 5 %" in line and "-22 deg" in line for line in outcome.out.splitlines())
    assert "…" not in outcome.out


def test_resolved_is_a_circuit_file_that_shows_the_same(circuitkit):
    flat = circuitkit("show", "binn_lateral", "--resolved")
    Path("flat.yaml").write_text(flat.out, encoding="utf-8")
    assert circuitkit("validate", "flat.yaml").out == "flat.yaml: valid\n"
    assert circuitkit("show", "flat.yaml").out == circuitkit("show", "binn_lateral").out


def test_json_is_the_resolved_circuit(circuitkit):
    shown = json.loads(circuitkit("show", "binn_lateral", "--json").out)
    assert shown["circuit"] == "binn_lateral"
    assert shown["neurons"]["h1"] == {
        "model": "sigmoid",
        "role": "inhibitory",
        "slope": 500,
        "shift": 0.1,
        "description": "silences p2",
    }
    assert {"from": "h1", "to": "p2", "weight": -1} in shown["synapses"]


def test_an_invalid_file_is_not_shown(circuitkit):
    Path("bad.yaml").write_text("circuit: bad\nnonsense: 1\n", encoding="utf-8")
    outcome = circuitkit("show", "bad.yaml")
    assert (outcome.code, outcome.out) == (1, "")
    assert "bad.yaml:2:1: " in outcome.err


def test_schema_is_printed_or_written(circuitkit):
    assert json.loads(circuitkit("schema").out) == circuit_schema()
    written = circuitkit("schema", "-o", "new/circuit.schema.json")
    assert (written.code, written.out, written.err) == (0, "", "wrote new/circuit.schema.json\n")
    assert json.loads(Path("new/circuit.schema.json").read_text(encoding="utf-8")) == circuit_schema()
