"""Declarations of models in their own terms: what may stand in them, as pydantic models.

Names, units and equations are checked afterwards, by `reading`.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema

from circuitkit.base.source import FileModel
from circuitkit.circuit.models.model import Method


def _as_text(value: object) -> object:
    """Return a bare number is an expression, a unit (1) or a quantity, too."""
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


Text: TypeAlias = Annotated[
    str,
    BeforeValidator(_as_text),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]}),
]
Equations: TypeAlias = dict[str, Text]

_UNIT = "A unit such as mV or 1, or one with the words activation, source, weight, such as activation/s."


class _Form(FileModel):
    """Builds its validator when it is first needed: those of the parts never are by themselves."""

    model_config = ConfigDict(defer_build=True)


class ParameterForm(_Form):
    """A parameter of a model."""

    unit: Text = Field(description=_UNIT)
    default: Text | None = Field(None, description="A number with its unit, for circuits that give none.")
    description: str = Field("", description="What this is, in words.")


class StateForm(_Form):
    """A state variable of a model."""

    unit: Text = Field(description=_UNIT)
    initial: Text = Field("0", description="Its value at the start, from the parameters.")
    description: str = Field("", description="What this is, in words.")


class SpikeForm(_Form):
    """When a neuron spikes, and what then happens."""

    when: Text = Field(description="It spikes when this is above zero; from parameters and states.")
    reset: Equations = Field({}, description="New value of each state that changes.")


class _ModelForm(_Form):
    """What declarations of neurons and synapses have in common."""

    model: str = Field("", description="Name of the model; in a circuit file it is the key.")
    description: str = Field("", description="What the model does, in words.")
    source: str = Field("", description="Where the equations come from.")
    parameters: dict[str, ParameterForm] = Field({}, description="By name.")
    increasing: tuple[str, ...] = Field((), description="Parameters of which each must be below the next.")
    states: dict[str, StateForm] = Field({}, description="State variables, by name.")
    derivatives: Equations = Field({}, description="Change of states per second.")
    updates: Equations = Field({}, description="New values of states once a control step.")
    method: Method = Field("exponential_euler", description="How the derivatives are integrated.")


class NeuronForm(_ModelForm):
    """A neuron model: equations in A (the activation), parameters and states."""

    activation: Text | None = Field(None, description="Unit of the activation, if the model fixes it.")
    spike: SpikeForm | None = Field(None, description="When it spikes, and what then happens.")
    output: Text = Field(description="The output: of A, or of states and spike (1 when it just spiked).")


class SynapseForm(_ModelForm):
    """A synapse model: equations in weight, pre, post (or input), gate, parameters and states."""

    weight: Text = Field("activation/source", description="Unit of the weight.")
    sign: Literal["role", "positive", "any"] = Field(
        "role", description="role: the weight's sign follows the source's role; positive; any."
    )
    per: Literal["synapse", "target"] = Field(
        "synapse",
        description="target: states are kept once for a target; `input` is the sum of weight * pre.",
    )
    reads: Equations = Field({}, description="Unit of states of the other side, such as post_v: mV.")
    jumps: Equations = Field({}, description="New values of states when the sources' outputs arrive.")
    current: Text = Field(description="What is added to the target's activation.")
