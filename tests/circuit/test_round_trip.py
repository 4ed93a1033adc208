"""Random circuits: what is valid validates, and what is written reads back as the same circuit."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import strategies
from hypothesis import given, settings
from hypothesis import strategies as st

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import Document, dump_yaml, parse_yaml
from circuitkit.circuit import CircuitSpec, parse_circuit
from circuitkit.circuit.authoring.flat import flat_yaml
from circuitkit.circuit.load import resolve
from circuitkit.circuit.parts import Module, Part, read_module

few = settings(max_examples=40, deadline=None)


def spec_of(text: str) -> CircuitSpec:
    return read_module(parse_yaml(text))[0].spec


@given(strategies.circuit_data())
@few
def test_random_circuits_validate_and_say_what_was_written(data):
    graph = parse_circuit(dump_yaml(data))
    assert [node.name for node in graph.inputs] == list(data["inputs"])
    assert [node.name for node in graph.neurons] == list(data["neurons"])
    assert [node.name for node in graph.outputs] == list(data["outputs"])
    assert len(graph.synapses) == len(data["synapses"])
    assert [synapse.source for synapse in graph.synapses] == [entry["from"] for entry in data["synapses"]]
    assert graph.timing == data["timing"]
    assert list(graph.parameters) == list(data["parameters"])


@given(strategies.circuit_texts())
@few
def test_a_spec_written_out_reads_back_as_the_same_circuit(text):
    spec = spec_of(text)
    again = dump_yaml(spec.model_dump(mode="json", by_alias=True, exclude_unset=True))
    assert spec_of(again).model_dump() == spec.model_dump()
    assert parse_circuit(again) == parse_circuit(text)


@given(strategies.circuit_graphs())
@few
def test_a_graph_written_out_reads_back_as_the_same_circuit(graph):
    assert parse_circuit(flat_yaml(graph)) == replace(graph, parameters={})


@given(strategies.many_of_a_kind())
@few
def test_populations_and_projections_written_out_read_back_as_the_same_circuit(data):
    text = dump_yaml(data)
    graph = parse_circuit(text)
    assert parse_circuit(flat_yaml(graph)) == replace(graph, parameters={})
    again = dump_yaml(spec_of(text).model_dump(mode="json", by_alias=True, exclude_unset=True))
    assert parse_circuit(again) == graph
    assert pickle.loads(pickle.dumps(graph)) == graph


@given(strategies.circuit_data())
@few
def test_a_spec_made_in_python_resolves_to_the_same_circuit(data):
    text = dump_yaml(data)
    made = CircuitSpec.model_validate_json(json.dumps(data))
    own_models = made.model_dump(include={"neuron_models", "synapse_models"})
    module = Module((Part(Document("", own_models, {}), made),))  # from no file, so without line and column
    assert resolve(module) == parse_circuit(text)


def problems_of(text: str) -> tuple[Problem, ...]:
    """What is wrong with the text; any other exception than an input error is a failure."""
    try:
        parse_circuit(text, "f.yaml")
    except InputError as error:
        return error.problems
    return ()


@given(strategies.circuit_texts() | strategies.many_of_a_kind().map(dump_yaml), st.data())
@few
def test_a_file_with_one_line_missing_never_crashes(text, data):
    lines = text.splitlines(keepends=True)
    gone = data.draw(st.integers(0, len(lines) - 1))
    problems = problems_of("".join(lines[:gone] + lines[gone + 1 :]))
    assert all(problem.file == "f.yaml" and problem.line >= 1 for problem in problems)


keys = st.sampled_from([each.alias or name for name, each in CircuitSpec.model_fields.items()])
leaves = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
)
anything = st.recursive(
    leaves,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(min_size=1), inner, max_size=3),
)


@given(st.dictionaries(keys, anything, max_size=4), strategies.many_of_a_kind())
@few
def test_nonsense_in_a_section_is_an_input_error(nonsense, data):
    text = dump_yaml({**data, **nonsense})
    assert all(problem.line >= 1 and problem.message for problem in problems_of(text))
