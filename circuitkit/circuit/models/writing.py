"""Models to declarations as data: what stands under `neuron_models` or `synapse_models` in a circuit file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.expressions.exact import exact
from circuitkit.circuit.expressions.expression import Expression
from circuitkit.circuit.models.model import ModelParameter, ModelState, NeuronModel, SynapseModel


def model_data(model: NeuronModel | SynapseModel) -> dict[str, Any]:
    """Return the declaration of a model; reading it gives an equal model."""
    parts: dict[str, Any] = {
        "description": model.description,
        "source": model.source,
        **(_neuron_keys(model) if isinstance(model, NeuronModel) else _synapse_keys(model)),
        "parameters": {each.name: _parameter(each) for each in model.parameters},
        "increasing": list(model.increasing),
        "states": {each.name: _state(each) for each in model.states},
        "derivatives": _texts(model.derivatives),
        "updates": _texts(model.updates),
    }
    if model.derivatives:
        parts["method"] = model.method
    if isinstance(model, NeuronModel):
        if model.spike is not None:
            parts["spike"] = {"when": str(model.spike.when), "reset": _texts(model.spike.reset)}
        parts["output"] = str(model.output)
    else:
        parts |= {"jumps": _texts(model.jumps), "current": str(model.current)}
    return {key: value for key, value in parts.items() if value}


def _neuron_keys(model: NeuronModel) -> dict[str, Any]:
    return {"activation": model.activation.symbol} if model.activation else {}


def _synapse_keys(model: SynapseModel) -> dict[str, Any]:
    reads = {name: rule.text for name, rule in model.reads.items()}
    return {"weight": model.weight.text, "sign": model.sign, "per": model.per, "reads": reads}


def _parameter(parameter: ModelParameter) -> dict[str, Any]:
    entry: dict[str, Any] = {"unit": parameter.unit_rule.text}
    if parameter.default is not None:
        entry["default"] = exact(parameter.default, parameter.unit or DIMENSIONLESS)
    return {**entry, "description": parameter.description}


def _state(state: ModelState) -> dict[str, Any]:
    initial = str(state.initial)
    return {"unit": state.unit_rule.text, "initial": initial, "description": state.description}


def _texts(equations: Mapping[str, Expression]) -> dict[str, str]:
    return {name: str(expression) for name, expression in equations.items()}
