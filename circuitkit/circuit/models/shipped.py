"""The models of this folder, read when they are first asked for."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.source import read_yaml
from circuitkit.circuit.models.model import NeuronModel, SynapseModel
from circuitkit.circuit.models.reading import read_neuron_model, read_synapse_model

_FOLDER = Path(__file__).parent
NEURON_MODEL_NAMES: tuple[str, ...] = tuple(sorted(path.stem for path in _FOLDER.glob("neurons/*.yaml")))
SYNAPSE_MODEL_NAMES: tuple[str, ...] = tuple(sorted(path.stem for path in _FOLDER.glob("synapses/*.yaml")))


@lru_cache
def neuron_model(name: str) -> NeuronModel:
    """Return the neuron model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    if name not in NEURON_MODEL_NAMES:
        kind = "model"
        raise UnknownNameError(kind, name, NEURON_MODEL_NAMES)
    return read_neuron_model(read_yaml(_FOLDER / "neurons" / f"{name}.yaml"))


@lru_cache
def synapse_model(name: str) -> SynapseModel:
    """Return the synapse model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    if name not in SYNAPSE_MODEL_NAMES:
        kind = "model"
        raise UnknownNameError(kind, name, SYNAPSE_MODEL_NAMES)
    return read_synapse_model(read_yaml(_FOLDER / "synapses" / f"{name}.yaml"))


STATIC = synapse_model("static")
