"""The models that ship, in this folder, and those of plug-ins, read when they are first asked for."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.source import read_yaml, shipped_file, shipped_names
from circuitkit.circuit.models.model import NeuronModel, SynapseModel
from circuitkit.circuit.models.reading import read_neuron_model, read_synapse_model

_NEURONS, _SYNAPSES = "models/neurons", "models/synapses"
NEURON_MODEL_NAMES: tuple[str, ...] = shipped_names(_NEURONS)
SYNAPSE_MODEL_NAMES: tuple[str, ...] = shipped_names(_SYNAPSES)


@lru_cache
def neuron_model(name: str) -> NeuronModel:
    """Return the neuron model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    return read_neuron_model(read_yaml(_file(_NEURONS, name)))


@lru_cache
def synapse_model(name: str) -> SynapseModel:
    """Return the synapse model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    return read_synapse_model(read_yaml(_file(_SYNAPSES, name)))


def _file(folder: str, name: str) -> Path:
    found = shipped_file(folder, f"{name}.yaml")
    if found is None:
        kind = "model"
        raise UnknownNameError(kind, name, shipped_names(folder))
    return found


STATIC = synapse_model("static")
