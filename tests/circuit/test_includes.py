"""Includes: what is merged, and what is complained about."""

# ruff: noqa: E501 - messages stand here as they stand on the screen

from __future__ import annotations

from pathlib import Path

import pytest

from circuitkit.circuit import check, load_circuit

MAIN = """\
circuit: main
control_step: 10 ms
timing: ordered
include: [{include}]
neurons:
  p: {{model: sigmoid, role: excitatory, slope: slope, shift: 0.5}}
synapses:
  - {{from: q, to: p, weight: 1}}
outputs:
  out: {{unit: "1", readout: {{p: 1}}}}
"""
LAYER = """\
parameters:
  slope: 10
inputs:
  u: {unit: "1", range: [-1, 1]}
neurons:
  q: {model: sigmoid, role: excitatory, slope: slope, shift: 0}
synapses:
  - {from: u, to: q, weight: 1}
"""


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write(name: str, text: str) -> None:
    path = Path(name)
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


def errors(name: str) -> list[str]:
    return [str(problem) for problem in check(name)[0]]


def test_sections_are_merged_included_ones_first():
    write("main.yaml", MAIN.format(include="parts/layer.yaml"))
    write("parts/layer.yaml", LAYER)
    assert check("main.yaml") == ((), ())
    graph = load_circuit("main.yaml")
    assert graph.names() == ("u", "q", "p", "out")
    assert [(synapse.source, synapse.target) for synapse in graph.synapses] == [("u", "q"), ("q", "p")]
    assert graph.neurons[1].parameters["slope"] == 10
    assert str(graph.neurons[0].origin) == "parts/layer.yaml:6:3"
    assert str(graph.neurons[1].origin) == "main.yaml:6:3"
    assert str(graph.synapses[1].origin) == "main.yaml:8:5"


def test_a_file_that_two_others_include_counts_once():
    write("main.yaml", MAIN.format(include="a.yaml, b.yaml"))
    write("a.yaml", "include: [layer.yaml]\n")
    write("b.yaml", "include: [layer.yaml]\n")
    write("layer.yaml", LAYER)
    assert errors("main.yaml") == []


def test_a_circle_of_includes_is_an_error():
    write("main.yaml", MAIN.format(include="a.yaml"))
    write("a.yaml", "include: [b.yaml]\n" + LAYER)
    write("b.yaml", "include: [a.yaml]\n")
    assert errors("main.yaml") == [
        "b.yaml:1:11: include[0]: found a circle of includes: a.yaml -> b.yaml -> a.yaml; allowed: includes that end"
    ]


def test_a_file_must_not_include_itself():
    write("main.yaml", MAIN.format(include="main.yaml"))
    assert errors("main.yaml")[0] == (
        "main.yaml:4:11: include[0]: found a circle of includes: main.yaml -> main.yaml; allowed: includes that end"
    )


def test_a_missing_include_is_an_error_and_hides_no_name():
    """q and slope may come from the file that is missing: nobody complains about them as well."""
    write("main.yaml", MAIN.format(include="layr.yaml"))
    write("layer.yaml", LAYER)
    assert errors("main.yaml") == [
        "main.yaml:4:11: include[0]: found 'layr.yaml', but there is no file 'layr.yaml'; allowed: a path from here; "
        "did you mean 'layer.yaml'?"
    ]


def test_a_name_in_two_files_is_an_error():
    write("main.yaml", MAIN.format(include="layer.yaml"))
    write(
        "layer.yaml",
        LAYER.replace("  q: {model", "  p: {model: step, role: excitatory, shift: 1}\n  q: {model"),
    )
    assert errors("main.yaml") == [
        "main.yaml:6:3: neurons.p: the name 'p' is declared twice, first at layer.yaml:6:3; allowed: each name once"
    ]


def test_names_of_different_kinds_in_two_files_clash():
    write("main.yaml", MAIN.format(include="layer.yaml").replace("  out: {", "  u: {"))
    write("layer.yaml", LAYER)
    assert errors("main.yaml") == [
        "main.yaml:10:3: outputs.u: the name 'u' is taken by an input at layer.yaml:4:3; allowed: a name of its own"
    ]


def test_a_synapse_in_two_files_is_an_error():
    write("layer.yaml", LAYER)
    write(
        "main.yaml",
        MAIN.format(include="layer.yaml").replace(
            "weight: 1}\n", "weight: 1}\n  - {from: u, to: q, weight: 2}\n"
        ),
    )
    assert errors("main.yaml") == [
        "main.yaml:9:19: synapses[1].to: duplicate synapse u -> q, first at layer.yaml:8:5; allowed: each one once"
    ]


def test_an_included_circuit_must_be_made_for_the_same_timing_and_step():
    write("main.yaml", MAIN.format(include="layer.yaml"))
    write("layer.yaml", "circuit: layer\ntiming: synchronous\ncontrol_step: 20 ms\n" + LAYER)
    assert errors("main.yaml") == [
        "layer.yaml:2:9: timing: found synchronous, but the file that includes this one has ordered; allowed: the same",
        "layer.yaml:3:15: control_step: found 20 ms, but the file that includes this one has 10 ms; allowed: the same",
    ]
    write("layer.yaml", "circuit: layer\ntiming: ordered\ncontrol_step: 0.01 s\n" + LAYER)
    assert errors("main.yaml") == []


def test_errors_of_all_files_are_listed():
    write("main.yaml", MAIN.format(include="layer.yaml").replace("shift: 0.5", "shfit: 0.5"))
    write("layer.yaml", LAYER.replace("slope: 10", "slope: 010").replace("from: u", "from: uu"))
    assert [error.split(": ")[0] for error in errors("main.yaml")] == [
        "layer.yaml:2:10",
        "layer.yaml:8:12",
        "main.yaml:6:3",
        "main.yaml:6:55",
    ]
