"""The circuit file in its own terms: what may stand in it, as pydantic models.

References, units and signs are checked afterwards, on the way to the graph; here a value is still a
number, a quantity such as `-80 mm`, or an expression such as `2 * (edge - margin)`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import CoreSchema

from circuitkit.base.source import FileModel, describe
from circuitkit.base.source.fields import NUMBER_OR_TEXT
from circuitkit.base.units import parse_unit
from circuitkit.circuit.expressions.values import not_a_value
from circuitkit.circuit.graph import Role, Timing

PLAIN_NAME_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*$"
# Dots are for flat files, in which the neurons of instances keep their names, such as `lateral.q1`.
NAME_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*$"


def _check_name(text: str) -> str:
    if not re.match(NAME_PATTERN, text):
        message = f"found '{text}'; allowed: a name of letters, digits and _, not starting with a digit"
        raise ValueError(message)
    return text


def _check_plain_name(text: str) -> str:
    if "." in text:
        message = f"found '{text}'; allowed: a name without dots"
        raise ValueError(message)
    return _check_name(text)


def _check_value(value: object) -> object:
    if (complaint := not_a_value(value)) is not None:
        raise ValueError(complaint)
    return value


def _check_unit(value: object) -> object:
    if isinstance(value, int) and not isinstance(value, bool) and value == 1:
        return "1"
    if not isinstance(value, str):
        message = f"found {describe(value)}; allowed: a unit such as 'mm' or '1'"
        raise ValueError(message)  # noqa: TRY004 - pydantic collects ValueError, not TypeError
    parse_unit(value)
    return value


def _as_tuple(value: object) -> object:
    """Make a tuple of a name or of a list, which pydantic would refuse behind this validator."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


_ONE_OR_MORE_NAMES = {
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]
}
_NAME = {"type": "string", "pattern": NAME_PATTERN}
_PAIR = {"type": "array", "items": NUMBER_OR_TEXT, "minItems": 2, "maxItems": 2}
DISTRIBUTIONS: Mapping[str, str] = {
    "range": "Evenly from the first value to the second one, both included.",
    "uniform": "Drawn evenly between the two values, by the seed of the circuit.",
    "normal": "Drawn from a normal distribution of this mean and standard deviation, by the seed.",
}

_VALUES = {
    "anyOf": [
        *NUMBER_OR_TEXT["anyOf"],
        {"type": "array", "items": NUMBER_OR_TEXT, "minItems": 1},
        *(
            {
                "type": "object",
                "properties": {kind: {**_PAIR, "description": meaning}},
                "required": [kind],
                "additionalProperties": False,
            }
            for kind, meaning in DISTRIBUTIONS.items()
        ),
    ]
}

Name = Annotated[str, AfterValidator(_check_name), WithJsonSchema(_NAME)]
PlainName = Annotated[
    str, AfterValidator(_check_plain_name), WithJsonSchema({"type": "string", "pattern": PLAIN_NAME_PATTERN})
]
Value = Annotated[float | str, BeforeValidator(_check_value), WithJsonSchema(NUMBER_OR_TEXT)]
# For every member of a population or synapse of a projection; looked at when it is known how many there are.
Values = Annotated[Any, WithJsonSchema(_VALUES)]
UnitText = Annotated[str, BeforeValidator(_check_unit)]
Targets = Annotated[
    tuple[str, ...], BeforeValidator(_as_tuple), Field(min_length=1), WithJsonSchema(_ONE_OR_MORE_NAMES)
]
Description = Annotated[str, Field(description="What this is, in words.")]


class ParameterSpec(FileModel):
    """A named value; written as the bare value, or with a description."""

    value: Value = Field(description="A number, a quantity like '-80 mm', or an expression like '2 * edge'.")
    description: Description = ""

    @model_validator(mode="before")
    @classmethod
    def _accept_bare_value(cls, data: Any) -> Any:  # noqa: ANN401 - whatever stands in the file
        return data if isinstance(data, Mapping) else {"value": data}

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the bare value, or the mapping."""
        mapping = handler.resolve_ref_schema(handler(core))
        return {"anyOf": [*NUMBER_OR_TEXT["anyOf"], mapping]}


class InputSpec(FileModel):
    """A sensorial input (section 4.1): a signed signal from outside."""

    unit: UnitText = Field(description="Unit of the signal, such as mm; '1' for dimensionless.")
    range: tuple[Value, Value] = Field(description="Smallest and largest value to expect.")
    description: Description = ""


class WithModelParameters(FileModel):
    """An entry in which the parameters of its model stand beside its own keys."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Any]

    @property
    def values(self) -> Mapping[str, object]:
        """The parameters of the model, as written; not checked in any way."""
        return self.__pydantic_extra__ or {}


class NeuronSpec(WithModelParameters):
    """A neuron: its model with its parameters, which stand beside the keys below."""

    model: str = Field(description="What the neuron computes: one of the neuron models.")
    role: Role = Field(description="excitatory: outgoing weights are positive; inhibitory: negative.")
    noise: Value | None = Field(
        None,
        description="Standard deviation of the noise on the activation: in every control step, or per "
        "square root of a second for models with derivatives; in the unit of the activation.",
    )
    initial: dict[str, Value] = Field({}, description="Start of states of the model, by name.")
    description: Description = ""


class PopulationSpec(WithModelParameters):
    """Neurons of one model; member i, from 0, is called NAME[i]."""

    size: Value = Field(description="How many neurons.")
    model: str = Field(description="What the neurons compute: one of the neuron models.")
    role: Role = Field(description="excitatory: outgoing weights are positive; inhibitory: negative.")
    noise: Values = Field(None, description="As a neuron's; for all, or for each member.")
    initial: dict[str, Values] = Field({}, description="Start of states of the model, by name.")
    description: Description = ""


class SynapseSpec(WithModelParameters):
    """A connection from an input or a neuron to one or more neurons (eq. 11)."""

    source: str = Field(alias="from", description="Name of an input, a neuron or a member of a population.")
    to: Targets = Field(description="Name of a neuron or of a member of a population, or a list of names.")
    weight: Value = Field(
        description="Signed; if static, in the unit of the target's activation over that of the source."
    )
    model: str = Field("static", description="What the synapse does: one of the synapse models.")
    delay: Value | None = Field(None, description="How much later the source's output arrives, such as 5 ms.")
    gate: str | None = Field(None, description="Name of the neuron that the model calls gate.")
    kind: Literal["sensorial"] | None = Field(
        None, description="sensorial: of either sign, like a synapse from an input."
    )
    description: Description = ""


class ConnectSpec(FileModel):
    """Which members of a projection's source lead to which of its target: one of the keys."""

    probability: Value | None = Field(None, description="Probability of each synapse, 0 to 1.")
    in_degree: Value | None = Field(None, description="How many different sources each target has.")
    matrix: str | None = Field(
        None, description="A file by path from this one: CSV, NPZ or Parquet; a row for every target."
    )
    sources: tuple[tuple[int, ...], ...] | None = Field(
        None, description="For every target the numbers of its sources, ascending, from 0."
    )


class ProjectionSpec(WithModelParameters):
    """Synapses of one model from an input, neuron or population to a neuron or population."""

    source: str = Field(alias="from", description="Name of an input, a neuron or a population.")
    to: str = Field(description="Name of a neuron or of a population.")
    connect: Literal["all_to_all", "one_to_one"] | ConnectSpec = Field(
        description="all_to_all, one_to_one, or one of probability, in_degree, matrix and sources as key."
    )
    self_connections: bool = Field(
        True,
        alias="self",
        description="Whether a member of a population may connect to itself; true if absent.",
    )
    weight: Values = Field(
        None,
        description="As a synapse's, for all or for each; times what stands in the matrix, if there is one.",
    )
    model: str = Field("static", description="What the synapses do: one of the synapse models.")
    delay: Value | None = Field(None, description="How much later the source's output arrives, such as 5 ms.")
    gate: str | None = Field(None, description="Name of the neuron that the model calls gate.")
    kind: Literal["sensorial"] | None = Field(
        None, description="sensorial: of either sign, like a synapse from an input."
    )
    description: Description = ""


class IntegrateSpec(FileModel):
    """Makes an output accumulate: the readout is then an increment for each control step (eq. 14)."""

    leak: Value = Field(description="Part of the output that each control step loses, 0 to 1, such as 5 %.")


class OutputSpec(FileModel):
    """An output of the circuit: a weighted sum of neuron outputs."""

    unit: UnitText = Field(description="Unit of the output, such as deg; '1' for dimensionless.")
    readout: dict[str, Values] = Field(
        min_length=1,
        description="Weight of every neuron, member or population read, in the unit of the output.",
    )
    integrate: IntegrateSpec | None = Field(None, description="Accumulate the readout, with a leak.")
    limits: tuple[Value, Value] | None = Field(
        None, description="Smallest and largest output; an accumulated output stops there."
    )
    description: Description = ""


class InstanceSpec(FileModel):
    """A circuit inside this one: everything in it is called NAME.… here."""

    file: str = Field(description="The circuit file, by path from this file.")
    name: PlainName = Field(alias="as", description="Name of the instance.")
    parameters: dict[str, Value] = Field({}, description="Values that take the place of the file's own.")
    inputs: dict[str, str | dict[str, Value]] = Field(
        {}, description="For inputs of the file, what they are here: a name, or a weighted sum of names."
    )
    outputs: dict[str, PlainName] | None = Field(
        None, description="Outputs of the file that are outputs here, and their names here; all if absent."
    )
    description: Description = ""


class FileSpec(FileModel):
    """A circuit file that another one includes: everything that a circuit has, all of it optional."""

    circuit: Name | None = Field(None, description="Name of the circuit.")
    description: Description = ""
    control_step: Value | None = Field(None, description="Time between two updates, such as 10 ms.")
    timing: Timing | None = Field(
        None,
        description="as_printed: two steps a layer, eqs. 11-12 word for word; synchronous: one step a layer; "
        "ordered: no delay along the graph, file order inside a cycle.",
    )
    substeps: Value | None = Field(
        None, description="In how many steps models with derivatives advance in a control step; 1 if absent."
    )
    seed: Value | None = Field(
        None, description="Seed of distributions and random connections, a whole number; 0 if absent."
    )
    neuron_models: dict[PlainName, Any] = Field(
        {}, description="Neuron models of this circuit, by name; written like the shipped ones."
    )
    synapse_models: dict[PlainName, Any] = Field(
        {}, description="Synapse models of this circuit, by name; written like the shipped ones."
    )
    include: tuple[str | InstanceSpec, ...] = Field(
        (),
        description="Other files, by path from this file: a path adds its sections to this file's; a mapping "
        "with file and as makes a circuit inside this one of it.",
    )
    parameters: dict[Name, ParameterSpec] = Field({}, description="Named values; used by name.")
    inputs: dict[Name, InputSpec] = Field({}, description="Sensorial inputs, by name.")
    neurons: dict[Name, NeuronSpec] = Field({}, description="Neurons, by name.")
    populations: dict[Name, PopulationSpec] = Field({}, description="Many neurons of a kind, by name.")
    synapses: tuple[SynapseSpec, ...] = Field((), description="Connections.")
    projections: tuple[ProjectionSpec, ...] = Field((), description="Many connections of a kind.")
    outputs: dict[Name, OutputSpec] = Field({}, description="Outputs, by name.")


class CircuitSpec(FileSpec):
    """A circuit file."""

    circuit: Name = Field(description="Name of the circuit.")
    control_step: Value = Field(description="Time between two updates, such as 10 ms.")
    timing: Timing = Field(description=FileSpec.model_fields["timing"].description)
