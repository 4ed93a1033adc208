"""Neuron and synapse models as data: each YAML file here declares one, its parameters and its equations.

A new model is a new file; the engine, the drawing and the exports follow from the equations.
"""

from circuitkit.circuit.models.model import (
    ModelParameter,
    ModelState,
    NeuronModel,
    Spike,
    SynapseModel,
    UnitRule,
)
from circuitkit.circuit.models.reading import (
    NEURON_MODEL_NAMES,
    STATIC,
    SYNAPSE_MODEL_NAMES,
    neuron_model,
    read_neuron_model,
    read_synapse_model,
    synapse_model,
)

__all__ = [
    "NEURON_MODEL_NAMES",
    "STATIC",
    "SYNAPSE_MODEL_NAMES",
    "ModelParameter",
    "ModelState",
    "NeuronModel",
    "Spike",
    "SynapseModel",
    "UnitRule",
    "neuron_model",
    "read_neuron_model",
    "read_synapse_model",
    "synapse_model",
]
