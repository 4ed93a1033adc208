"""`circuitkit validate`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

WRONG = """\
circuit: wrong
control_step: 10 ms
timing: ordered
inputs:
  u: {unit: mm, range: [-1 mm, 1 mm]}
neurons:
  n: {model: sigmoid, role: excitatory, slope: 100 /m, shift: 1 deg}
synapses:
  - {from: v, to: n, weight: 1}
outputs:
  y: {unit: "1", readout: {m: 1}}
"""
DOUBTFUL = """\
circuit: doubtful
control_step: 10 ms
timing: ordered
inputs:
  u: {unit: "1", range: [-1, 1]}
neurons:
  n: {model: identity, role: excitatory}
  idle: {model: identity, role: excitatory}
synapses:
  - {from: u, to: [n, idle], weight: 1}
outputs:
  y: {unit: "1", readout: {n: 1}}
"""


@pytest.fixture
def files(tmp_path):
    (tmp_path / "wrong.yaml").write_text(WRONG, encoding="utf-8")
    (tmp_path / "doubtful.yaml").write_text(DOUBTFUL, encoding="utf-8")


def test_a_valid_file(circuitkit):
    outcome = circuitkit("validate", "binn_lateral")
    assert (outcome.code, outcome.out, outcome.err) == (0, "binn_lateral: valid\n", "")


@pytest.mark.usefixtures("files")
def test_all_errors_are_listed_with_their_places(circuitkit):
    outcome = circuitkit("validate", "wrong.yaml")
    assert outcome.code == 1
    lines = outcome.err.splitlines()
    assert [line.split(": ")[0].split(":")[:2] for line in lines] == [
        ["wrong.yaml", "7"],
        ["wrong.yaml", "9"],
        ["wrong.yaml", "11"],
    ]
    assert outcome.out == "wrong.yaml: 3 errors\n"


@pytest.mark.usefixtures("files")
def test_warnings_do_not_make_a_file_invalid(circuitkit):
    outcome = circuitkit("validate", "doubtful.yaml")
    assert outcome.code == 0
    assert outcome.out == "doubtful.yaml: valid, 1 warning\n"
    assert outcome.err.startswith("doubtful.yaml:8:3: neurons.idle: ")
    assert outcome.err.endswith(" (warning)\n")


@pytest.mark.usefixtures("files")
def test_of_several_files_each_gets_its_line_and_one_wrong_one_decides(circuitkit):
    outcome = circuitkit("validate", "binn_lateral", "wrong.yaml", "doubtful.yaml", "no_such")
    assert outcome.code == 1
    assert outcome.out.splitlines() == [
        "binn_lateral: valid",
        "wrong.yaml: 3 errors",
        "doubtful.yaml: valid, 1 warning",
        "no_such: 1 error",
    ]
    assert "unknown name 'no_such'; allowed: a path, or one of the shipped circuits: " in outcome.err


@pytest.mark.usefixtures("files")
def test_json_has_the_keys_of_the_contract(circuitkit):
    outcome = circuitkit("validate", "wrong.yaml", "doubtful.yaml", "--json")
    assert (outcome.code, outcome.err) == (1, "")
    found = json.loads(outcome.out)
    assert list(found) == ["valid", "errors", "warnings"]
    assert found["valid"] is False
    assert [(each["file"], each["line"]) for each in found["errors"]] == [
        ("wrong.yaml", line) for line in (7, 9, 11)
    ]
    assert [each["where"] for each in found["warnings"]] == ["neurons.idle"]
    for each in (*found["errors"], *found["warnings"]):
        assert list(each) == ["file", "line", "column", "where", "message", "hint"]


def test_json_of_a_valid_file(circuitkit):
    outcome = circuitkit("validate", "binn_lateral", "--json")
    assert (outcome.code, json.loads(outcome.out)) == (0, {"valid": True, "errors": [], "warnings": []})


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no.yaml", "no.yaml:1:1: "),
        ("folder", "folder"),
    ],
)
def test_what_is_no_file_is_wrong_input(circuitkit, name, message):
    Path("folder").mkdir()
    outcome = circuitkit("validate", name)
    assert outcome.code == 1
    assert outcome.err.startswith(message)
    assert len(outcome.err.splitlines()) == 1


def test_values_can_be_set(circuitkit):
    assert circuitkit("validate", "binn_lateral", "--set", "w=2deg").out == "binn_lateral: valid\n"
    outcome = circuitkit("validate", "binn_lateral", "--set", "w=2mm", "--set", "leak=200%")
    assert (outcome.code, outcome.out) == (1, "binn_lateral: 2 errors\n")
    assert all("(with --set)" in line for line in outcome.err.splitlines())
