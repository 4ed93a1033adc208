"""The JSON Schema of the circuit file, for editors: completion, descriptions, errors while typing."""

from __future__ import annotations

from typing import Any

from circuitkit.circuit.models import NEURON_MODEL_NAMES, neuron_model
from circuitkit.circuit.spec import CircuitSpec

_VALUE = {"anyOf": [{"type": "number"}, {"type": "string"}]}


def circuit_schema() -> dict[str, Any]:
    """The JSON Schema of the circuit file (draft 7): every key with its description, for every model."""
    schema = CircuitSpec.model_json_schema()
    _simplify(schema)
    schema["$schema"] = "http://json-schema.org/draft-07/schema#"
    schema["title"] = "circuitkit circuit"
    neuron = schema["$defs"]["NeuronSpec"]
    own_keys = list(neuron["properties"])
    models = [neuron_model(name) for name in NEURON_MODEL_NAMES]
    neuron["properties"]["model"]["enum"] = list(NEURON_MODEL_NAMES)
    neuron["additionalProperties"] = _VALUE
    neuron["allOf"] = [
        {
            "if": {"properties": {"model": {"const": model.name}}, "required": ["model"]},
            "then": {
                "description": model.description,
                "properties": {
                    each.name: {**_VALUE, "description": each.description} for each in model.parameters
                },
                "required": [each.name for each in model.parameters if each.default is None],
                "propertyNames": {"enum": [*own_keys, *model.parameter_names]},
            },
        }
        for model in models
    ]
    return schema


def _simplify(node: Any) -> None:  # noqa: ANN401 - any JSON
    """Remove pydantic's titles, which repeat the keys; refuse odd names; write pairs in draft 7."""
    if isinstance(node, dict):
        if isinstance(node.get("title"), str):
            del node["title"]
        if "patternProperties" in node:
            node["additionalProperties"] = False
        if "prefixItems" in node:
            node["items"] = node.pop("prefixItems")[0]
        for value in node.values():
            _simplify(value)
    elif isinstance(node, list):
        for value in node:
            _simplify(value)
