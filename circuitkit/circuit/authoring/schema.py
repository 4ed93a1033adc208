"""The JSON Schema of the circuit file, for editors: completion, descriptions, errors while typing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from circuitkit.base.source.fields import NUMBER_OR_TEXT
from circuitkit.circuit.models import (
    NEURON_MODEL_NAMES,
    SYNAPSE_MODEL_NAMES,
    NeuronModel,
    SynapseModel,
    neuron_model,
    synapse_model,
)
from circuitkit.circuit.models.declaration import NeuronForm, SynapseForm
from circuitkit.circuit.spec import CircuitSpec

Schema = dict[str, Any]
_VALUES: Schema = {"$ref": "#/$defs/Values"}


def circuit_schema() -> Schema:
    """Give the JSON Schema of the circuit file (draft 7): every key with its description, for every model."""
    schema = CircuitSpec.model_json_schema()
    schema["$schema"] = "http://json-schema.org/draft-07/schema#"
    definitions: Schema = schema["$defs"]
    for form in (NeuronForm, SynapseForm):
        own = form.model_json_schema()
        definitions |= own.pop("$defs", {})
        definitions[form.__name__] = own
    definitions["Values"] = definitions["PopulationSpec"]["properties"]["noise"] | {
        "description": "One value for all, a list, a range, a distribution, or an expression."
    }
    definitions["Values"].pop("default", None)
    _simplify(schema)
    schema["title"] = "circuitkit circuit"
    neurons = [neuron_model(name) for name in NEURON_MODEL_NAMES]
    synapses = [synapse_model(name) for name in SYNAPSE_MODEL_NAMES]
    _add_models(definitions["NeuronSpec"], neurons, NUMBER_OR_TEXT)
    _add_models(definitions["PopulationSpec"], neurons, _VALUES)
    _add_models(definitions["SynapseSpec"], synapses, NUMBER_OR_TEXT)
    _add_models(definitions["ProjectionSpec"], synapses, _VALUES)
    for section, form in (("neuron_models", NeuronForm), ("synapse_models", SynapseForm)):
        (pattern,) = schema["properties"][section]["patternProperties"]
        schema["properties"][section]["patternProperties"][pattern] = {"$ref": f"#/$defs/{form.__name__}"}
    schema["allOf"] = [_refuse_unknown_models()]
    return schema


def _add_models(entry: Schema, models: Sequence[NeuronModel | SynapseModel], value: Schema) -> None:
    """Add the parameters of the shipped models, which stand beside an entry's own keys."""
    own_keys = list(entry["properties"])
    names = [model.name for model in models]
    model_key = entry["properties"]["model"]
    entry["properties"]["model"] = {
        "anyOf": [{"enum": names}, {"type": "string"}],
        **{key: text for key, text in model_key.items() if key in {"default", "description"}},
    }
    entry["additionalProperties"] = value
    entry["allOf"] = [
        {
            "if": _has_model(model, model_key),
            "then": {
                "description": model.description,
                "properties": {
                    each.name: {"allOf": [value], "description": each.description}
                    for each in model.parameters
                },
                "required": _required(model),
                "propertyNames": {"enum": [*own_keys, *model.parameter_names]},
            },
        }
        for model in models
    ]


def _has_model(model: NeuronModel | SynapseModel, model_key: Schema) -> Schema:
    """True of an entry of this model; an entry that names none has the one that is there by default."""
    named: Schema = {"properties": {"model": {"const": model.name}}}
    return named if model_key.get("default") == model.name else {**named, "required": ["model"]}


def _required(model: NeuronModel | SynapseModel) -> list[str]:
    gate = ["gate"] if isinstance(model, SynapseModel) and model.gated else []
    return [*gate, *(each.name for each in model.parameters if each.default is None)]


def _refuse_unknown_models() -> Schema:
    """Only models that are shipped, where the file declares none and includes no file that might."""
    declares: Schema = {
        "anyOf": [{"required": [key]} for key in ("include", "neuron_models", "synapse_models")]
    }
    neuron: Schema = {"properties": {"model": {"enum": list(NEURON_MODEL_NAMES)}}}
    synapse: Schema = {"properties": {"model": {"enum": list(SYNAPSE_MODEL_NAMES)}}}
    sections: Schema = {
        "neurons": {"additionalProperties": neuron},
        "populations": {"additionalProperties": neuron},
        "synapses": {"items": synapse},
        "projections": {"items": synapse},
    }
    return {"if": declares, "then": {}, "else": {"properties": sections}}


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
