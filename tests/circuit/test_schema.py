"""The JSON Schema: every key described, what is valid accepted, what an editor should underline refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import strategies
from hypothesis import given, settings

from circuitkit import circuit
from circuitkit.base.source import data_folder, read_yaml, shipped_names
from circuitkit.circuit import circuit_schema
from circuitkit.circuit.models import NEURON_MODEL_NAMES, SYNAPSE_MODEL_NAMES, neuron_model, synapse_model
from circuitkit.circuit.spec import CircuitSpec

PACKAGE = Path(circuit.__file__).parent
SCHEMA = circuit_schema()
TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}


def accepts(data: Any, schema: Any) -> bool:
    """Whether data fits a JSON Schema, for the keywords that ours uses; an unknown keyword is a failure."""
    return all(_KEYWORDS[keyword](data, value, schema) for keyword, value in schema.items())


def _resolve(data: Any, reference: str, _: Any) -> bool:
    return accepts(data, SCHEMA["$defs"][reference.removeprefix("#/$defs/")])


def _type(data: Any, name: str, _: Any) -> bool:
    if name in {"number", "integer"}:
        return isinstance(data, int | float if name == "number" else int) and not isinstance(data, bool)
    return isinstance(data, TYPES[name])


def _properties(data: Any, properties: Any, _: Any) -> bool:
    return all(accepts(data[key], value) for key, value in properties.items() if key in data)


def _additional(data: Any, value: Any, schema: Any) -> bool:
    patterns = schema.get("patternProperties", {})
    rest = [
        key
        for key in data
        if key not in schema.get("properties", {}) and not any(re.search(p, key) for p in patterns)
    ]
    return not rest if value is False else all(accepts(data[key], value) for key in rest)


def _if(data: Any, condition: Any, schema: Any) -> bool:
    return accepts(data, schema["then"] if accepts(data, condition) else schema.get("else", {}))


def _patterns(data: Any, patterns: Any, _: Any) -> bool:
    return all(
        accepts(data[key], value) for p, value in patterns.items() for key in data if re.search(p, key)
    )


_KEYWORDS: dict[str, Any] = {
    **dict.fromkeys(["$schema", "$defs", "title", "description", "default", "then", "else"], lambda *_: True),
    "$ref": _resolve,
    "type": _type,
    "enum": lambda data, values, _: data in values,
    "const": lambda data, value, _: data == value,
    "pattern": lambda data, pattern, _: re.search(pattern, data) is not None,
    "properties": _properties,
    "patternProperties": _patterns,
    "additionalProperties": _additional,
    "propertyNames": lambda data, value, _: all(accepts(key, value) for key in data),
    "required": lambda data, keys, _: all(key in data for key in keys),
    "items": lambda data, value, _: all(accepts(each, value) for each in data),
    "anyOf": lambda data, branches, _: any(accepts(data, branch) for branch in branches),
    "allOf": lambda data, branches, _: all(accepts(data, branch) for branch in branches),
    "if": _if,
    "minItems": lambda data, number, _: len(data) >= number,
    "maxItems": lambda data, number, _: len(data) <= number,
    "minProperties": lambda data, number, _: len(data) >= number,
}


def test_every_key_is_described():
    for name, definition in {**SCHEMA["$defs"], "circuit": SCHEMA}.items():
        mappings = definition.get("anyOf", [definition])
        for key, value in [pair for each in mappings for pair in each.get("properties", {}).items()]:
            assert value.get("description"), f"{name}.{key}"


@pytest.mark.parametrize(
    ("entry", "names", "model"),
    [
        ("NeuronSpec", NEURON_MODEL_NAMES, neuron_model),
        ("PopulationSpec", NEURON_MODEL_NAMES, neuron_model),
        ("SynapseSpec", SYNAPSE_MODEL_NAMES, synapse_model),
        ("ProjectionSpec", SYNAPSE_MODEL_NAMES, synapse_model),
    ],
)
def test_every_model_has_its_parameters_beside_the_keys(entry, names, model):
    branches = SCHEMA["$defs"][entry]["allOf"]
    for name, branch in zip(names, branches, strict=True):
        assert list(branch["then"]["properties"]) == list(model(name).parameter_names)
        assert all(value["description"] for value in branch["then"]["properties"].values())


def test_the_keys_are_those_of_the_file():
    keys = {field.alias or name for name, field in CircuitSpec.model_fields.items()}
    assert set(SCHEMA["properties"]) == keys
    assert SCHEMA["required"] == ["circuit", "control_step", "timing"]


@pytest.mark.parametrize("name", shipped_names("circuits"))
def test_shipped_circuits_fit(name):
    assert accepts(read_yaml(data_folder("circuits") / f"{name}.yaml").data, SCHEMA)


@pytest.mark.parametrize(
    "path", sorted((PACKAGE / "authoring" / "starters").glob("*.yaml")), ids=lambda path: path.stem
)
def test_starters_fit(path):
    assert accepts(read_yaml(path).data, SCHEMA)


@given(strategies.circuit_data() | strategies.many_of_a_kind())
@settings(max_examples=40, deadline=None)
def test_random_circuits_fit(data):
    assert accepts(json.loads(json.dumps(data)), SCHEMA)


NEURON = {"model": "sigmoid", "role": "excitatory", "slope": 1, "shift": "edge"}
PROJECTION = {"from": "r", "to": "r", "connect": "all_to_all", "weight": "i - j"}
SYNAPSE = {"from": "a", "to": ["b"], "weight": 1}


@pytest.mark.parametrize(
    "change",
    [
        {"timing": "orderd"},
        {"circuit": "two words"},
        {"nuerons": {}},
        {"neurons": {"a": {**NEURON, "model": "sigmoyd"}}},
        {"neurons": {"a": {**NEURON, "low": 1}}},
        {"neurons": {"a": {"model": "sigmoid", "role": "excitatory", "slope": 1}}},
        {"neurons": {"a": {**NEURON, "shift": [1]}}},
        {"neurons": {"2a": NEURON}},
        {"synapses": [{**SYNAPSE, "to": []}]},
        {"synapses": [{**SYNAPSE, "wieght": 1}]},
        {"inputs": {"u": {"unit": "mm", "range": [1]}}},
        {"outputs": {"y": {"unit": "mm", "readout": {}}}},
        {"parameters": {"w": {"valu": 1}}},
        {"synapses": [{**SYNAPSE, "model": "first_order"}]},
        {"synapses": [{**SYNAPSE, "model": "gated"}]},
        {"synapses": [{**SYNAPSE, "model": "sttic"}]},
        {"synapses": [{**SYNAPSE, "tau": "5 ms"}]},
        {"populations": {"r": {**NEURON, "size": 3, "shift": {"unifrom": [0, 1]}}}},
        {"populations": {"r": NEURON}},
        {"populations": {"r": {**NEURON, "size": 3, "low": [1, 2, 3]}}},
        {"projections": [{**PROJECTION, "connect": "all"}]},
        {"projections": [{**PROJECTION, "connect": {"probabilty": 0.1}}]},
        {"projections": [{**PROJECTION, "self": "no"}]},
        {"include": [{"file": "a.yaml"}]},
        {"include": [{"file": "a.yaml", "as": "b.c"}]},
        {"neuron_models": {"mine": {"parameters": {}}}},
        {"neuron_models": {"mine": {"output": "A", "method": "eulr"}}},
        {"synapse_models": {"mine": {"current": "weight * pre", "per": "neuron"}}},
    ],
)
def test_what_is_wrong_is_underlined(change):
    good = {
        "circuit": "a",
        "control_step": "1 ms",
        "timing": "ordered",
        "neurons": {"a": NEURON},
        "synapses": [SYNAPSE],
    }
    assert accepts(good, SCHEMA)
    assert not accepts({**good, **change}, SCHEMA)


def test_the_shipped_schema_is_the_present_one():
    """Circuits name it in their first line; `circuitkit schema -o circuits/circuit.schema.json` renews it."""
    text = (data_folder("circuits") / "circuit.schema.json").read_text(encoding="utf-8")
    assert json.loads(text) == SCHEMA
