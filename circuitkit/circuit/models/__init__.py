"""Neuron models as data: each YAML file here declares one model, its parameters and its equation.

A new model is a new file; the engine, the drawing and the exports follow from the equation.
"""

from circuitkit.circuit.models.model import MODEL_NAMES, ModelParameter, NeuronModel, UnitRule, neuron_model

__all__ = ["MODEL_NAMES", "ModelParameter", "NeuronModel", "UnitRule", "neuron_model"]
