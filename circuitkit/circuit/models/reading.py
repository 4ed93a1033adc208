"""Model declarations to `NeuronModel` and `SynapseModel`."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from circuitkit.circuit.expression import parse_expression
from circuitkit.circuit.models.model import (
    ACTIVATION,
    PRE,
    WEIGHT,
    ModelParameter,
    NeuronModel,
    SynapseModel,
    UnitRule,
)
from circuitkit.errors import UnknownNameError
from circuitkit.source import FileModel, read_yaml, validate_model

_FOLDER = Path(__file__).parent
NEURON_MODEL_NAMES: tuple[str, ...] = tuple(sorted(path.stem for path in _FOLDER.glob("neurons/*.yaml")))
_RULES = {
    "activation": UnitRule("activation", activation=1),
    "1/activation": UnitRule("1/activation", activation=-1),
    "1": UnitRule("1"),
}
STATIC = SynapseModel(
    name="static",
    description="Adds its weight times the source's output.",
    source="eq. 11 of Castro et al.",
    parameters=(),
    current=parse_expression("weight * pre", (WEIGHT, PRE)),
    weight=UnitRule("activation/source", activation=1, source=-1),
)


class _ParameterFile(FileModel):
    unit: str
    default: float | None = None
    description: str


class _ModelFile(FileModel):
    model: str
    description: str
    source: str
    parameters: dict[str, _ParameterFile]
    increasing: tuple[str, ...] = ()
    output: str


@lru_cache
def neuron_model(name: str) -> NeuronModel:
    """The model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    if name not in NEURON_MODEL_NAMES:
        kind = "model"
        raise UnknownNameError(kind, name, NEURON_MODEL_NAMES)
    file = validate_model(read_yaml(_FOLDER / "neurons" / f"{name}.yaml"), _ModelFile)
    parameters = tuple(
        ModelParameter(key, _RULES[entry.unit], entry.default, entry.description)
        for key, entry in file.parameters.items()
    )
    output = parse_expression(file.output, (ACTIVATION, *file.parameters))
    return NeuronModel(file.model, file.description, file.source, parameters, output, file.increasing)
