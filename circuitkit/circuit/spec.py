"""The circuit file in its own terms: what may stand in it, as pydantic models.

References, units and signs are checked afterwards, by `resolve`; here a value is still a number, a quantity
such as `-80 mm`, or a sum of parameters such as `edge - margin`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PrivateAttr,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import CoreSchema

from circuitkit.circuit.graph import Role, Timing
from circuitkit.circuit.values import not_a_value
from circuitkit.source import FileModel, describe
from circuitkit.units import parse_unit

if TYPE_CHECKING:
    from circuitkit.circuit.parts import Part

NAME_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*$"


def _check_name(text: str) -> str:
    if not re.match(NAME_PATTERN, text):
        message = f"found '{text}'; allowed: a name of letters, digits and _, not starting with a digit"
        raise ValueError(message)
    return text


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
    """A name is a list of one; a list becomes a tuple here, for behind this validator pydantic refuses it."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


_ONE_OR_MORE_NAMES = {
    "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]
}
_NAME = {"type": "string", "pattern": NAME_PATTERN}
_NUMBER_OR_TEXT = {"anyOf": [{"type": "number"}, {"type": "string"}]}

Name = Annotated[str, AfterValidator(_check_name), WithJsonSchema(_NAME)]
Value = Annotated[float | str, BeforeValidator(_check_value), WithJsonSchema(_NUMBER_OR_TEXT)]
UnitText = Annotated[str, BeforeValidator(_check_unit)]
Targets = Annotated[
    tuple[str, ...], BeforeValidator(_as_tuple), Field(min_length=1), WithJsonSchema(_ONE_OR_MORE_NAMES)
]
Description = Annotated[str, Field(description="What this is, in words.")]


class ParameterSpec(FileModel):
    """A named value; written as the bare value, or with a description."""

    value: Value = Field(description="A number, a quantity like '-80 mm', or a sum like 'edge - margin'.")
    description: Description = ""

    @model_validator(mode="before")
    @classmethod
    def _accept_bare_value(cls, data: Any) -> Any:  # noqa: ANN401 - whatever stands in the file
        return data if isinstance(data, Mapping) else {"value": data}

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """The bare value, or the mapping."""
        mapping = handler.resolve_ref_schema(handler(core))
        return {"anyOf": [{"type": "number"}, {"type": "string"}, mapping]}


class InputSpec(FileModel):
    """A sensorial input (section 4.1): a signed signal from outside."""

    unit: UnitText = Field(description="Unit of the signal, such as mm; '1' for dimensionless.")
    range: tuple[Value, Value] = Field(description="Smallest and largest value to expect.")
    description: Description = ""


class NeuronSpec(FileModel):
    """A neuron: an activation function with its parameters, which stand beside the keys below."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Any]

    model: str = Field(description="The activation function: one of the neuron models.")
    role: Role = Field(description="excitatory: outgoing weights are positive; inhibitory: negative.")
    description: Description = ""

    @property
    def values(self) -> Mapping[str, object]:
        """The parameters of the model, as written; not checked in any way."""
        return self.__pydantic_extra__ or {}


class SynapseSpec(FileModel):
    """A connection from an input or a neuron to one or more neurons (eq. 11)."""

    source: str = Field(alias="from", description="Name of an input or of a neuron.")
    to: Targets = Field(description="Name of a neuron, or a list of names.")
    weight: Value = Field(description="Signed; unit of the target's activation over the unit of the source.")
    description: Description = ""


class IntegrateSpec(FileModel):
    """Makes an output accumulate: the readout is then an increment for each control step (eq. 14)."""

    leak: Value = Field(description="Part of the output that each control step loses, 0 to 1, such as 5 %.")


class OutputSpec(FileModel):
    """An output of the circuit: a weighted sum of neuron outputs."""

    unit: UnitText = Field(description="Unit of the output, such as deg; '1' for dimensionless.")
    readout: dict[str, Value] = Field(
        min_length=1, description="Weight of every neuron that is read, in the dimension of the output."
    )
    integrate: IntegrateSpec | None = Field(None, description="Accumulate the readout, with a leak.")
    limits: tuple[Value, Value] | None = Field(
        None, description="Smallest and largest output; an accumulated output stops there."
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
    include: tuple[str, ...] = Field(
        (), description="Other files whose sections are added to this one's, by path from this file."
    )
    parameters: dict[Name, ParameterSpec] = Field({}, description="Named values; used by name.")
    inputs: dict[Name, InputSpec] = Field({}, description="Sensorial inputs, by name.")
    neurons: dict[Name, NeuronSpec] = Field({}, description="Neurons, by name.")
    synapses: tuple[SynapseSpec, ...] = Field((), description="Connections.")
    outputs: dict[Name, OutputSpec] = Field({}, description="Outputs, by name.")


class CircuitSpec(FileSpec):
    """A circuit file."""

    circuit: Name = Field(description="Name of the circuit.")
    control_step: Value = Field(description="Time between two updates, such as 10 ms.")
    timing: Timing = Field(description=FileSpec.model_fields["timing"].description)
    _parts: tuple[Part, ...] = PrivateAttr(())

    @property
    def parts(self) -> tuple[Part, ...]:
        """This file and those it includes, with line and column; empty if it came from no file."""
        return self._parts

    def with_parts(self, parts: tuple[Part, ...]) -> CircuitSpec:
        """The same spec, remembering the files it came from."""
        remembering = self.model_copy()
        remembering._parts = parts
        return remembering
