"""`NeuronModel`: what a neuron computes from its activation, read from the YAML files of this folder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

from circuitkit.circuit.expression import Expression, parse_expression
from circuitkit.errors import UnknownNameError
from circuitkit.source import FileModel, read_yaml, validate_model

ACTIVATION = "A"
UnitRule = Literal["activation", "1/activation", "1"]
_FOLDER = Path(__file__).parent
MODEL_NAMES: tuple[str, ...] = tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))


@dataclass(frozen=True)
class ModelParameter:
    """A parameter of a neuron model.

    Attributes:
        name: Its name, as in the equation and in the circuit file.
        unit_rule: Its unit in terms of the neuron's activation: the same, the reciprocal, or dimensionless.
        default: The value of a neuron that does not give one, [SI]; None if it must be given.
        description: In words.
    """

    name: str
    unit_rule: UnitRule
    default: float | None
    description: str


@dataclass(frozen=True)
class NeuronModel:
    """What a neuron computes from its activation.

    Attributes:
        name: Its name, as in the circuit file.
        description: In words.
        source: Where the equation comes from.
        parameters: In the order of the file.
        output: The dimensionless output, in terms of the activation `A` and of the parameters.
        increasing: Names of parameters of which each must be below the next.
    """

    name: str
    description: str
    source: str
    parameters: tuple[ModelParameter, ...]
    output: Expression
    increasing: tuple[str, ...] = ()

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)


class _ParameterFile(FileModel):
    unit: UnitRule
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
    if name not in MODEL_NAMES:
        kind = "model"
        raise UnknownNameError(kind, name, MODEL_NAMES)
    file = validate_model(read_yaml(_FOLDER / f"{name}.yaml"), _ModelFile)
    parameters = tuple(
        ModelParameter(key, entry.unit, entry.default, entry.description)
        for key, entry in file.parameters.items()
    )
    output = parse_expression(file.output, (ACTIVATION, *file.parameters))
    return NeuronModel(file.model, file.description, file.source, parameters, output, file.increasing)
