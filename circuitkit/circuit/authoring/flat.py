"""A resolved circuit as a circuit file again: no includes, parameters or rules, every value written out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from circuitkit.base.errors import CircuitkitError
from circuitkit.base.files import replacing
from circuitkit.base.source import dump_yaml
from circuitkit.base.units import DIMENSIONLESS, Dimension, Unit, parse_unit
from circuitkit.circuit.expressions.exact import exact
from circuitkit.circuit.graph import (
    CircuitGraph,
    InputNode,
    Neuron,
    OutputNode,
    PerMember,
    Population,
    Projection,
    Synapse,
    same,
)
from circuitkit.circuit.models import (
    NEURON_MODEL_NAMES,
    STATIC,
    SYNAPSE_MODEL_NAMES,
    ModelParameter,
    ModelState,
    NeuronModel,
    SynapseModel,
)
from circuitkit.circuit.models.writing import model_data
from circuitkit.circuit.names import node_of
from circuitkit.circuit.resolving.nodes import Endpoint, Nodes, shown_unit, start

_PER_ANGLE = Dimension(angle=-1)
MOST_LISTED = 10_000  # values that are listed for one population or projection


class TooLargeError(CircuitkitError):
    """Something has too many values to list them in a circuit file."""


def flat_document(graph: CircuitGraph, folder: Path | None = None) -> dict[str, Any]:
    """Return the circuit in the form of its file; resolving it gives an equal graph, but for the parameters.

    Args:
        graph: The circuit.
        folder: Where the file will lie. If it is given, connections of more than 10 000 synapses are written
            there, as matrix files, and any number of other values is listed.

    Raises:
        TooLargeError: A population or projection has more than 10 000 values to list, and there is no folder.
    """
    return _Flat(graph, folder).document()


def flat_yaml(graph: CircuitGraph, folder: Path | None = None) -> str:
    """Return the circuit as the text of a circuit file; see `flat_document`.

    Raises:
        TooLargeError: See `flat_document`.
    """
    return dump_yaml(flat_document(graph, folder))


def parameter_unit(neuron: Neuron | Population, parameter: ModelParameter | ModelState) -> Unit:
    """Return the unit in which a parameter or state of a neuron is shown."""
    activation = neuron.activation_unit
    dimension = parameter.unit_rule.dimension(activation.dimension)
    if dimension == _PER_ANGLE and activation.symbol.isalpha():  # per degree, for nobody thinks in radians
        return DIMENSIONLESS.over(activation)
    return shown_unit(parameter, dimension, activation)


def nodes_of(graph: CircuitGraph) -> Nodes:
    """Return the nodes of a circuit by name."""
    return Nodes(
        {node.name: node for node in graph.inputs},
        {node.name: node for node in graph.neurons},
        {node.name: node for node in graph.populations},
    )


def endpoint(nodes: Nodes, name: str) -> Endpoint:
    """Return a node as the end of a synapse; of a member its population."""
    end = nodes.endpoint(node_of(name))
    if end is None:
        message = f"the circuit has no node {name}"
        raise KeyError(message)
    return end


def weight_unit(synapse: Synapse | Projection, nodes: Nodes) -> Unit:
    """The SI unit of the weight of a synapse: what its model gives it at its endpoints."""
    target, source = endpoint(nodes, synapse.target), endpoint(nodes, synapse.source)
    return synapse.model.weight.dimension(target.activation.dimension, source.unit.dimension).si_unit


class _Flat:
    """A circuit on its way to a file."""

    def __init__(self, graph: CircuitGraph, folder: Path | None) -> None:
        self.graph = graph
        self.folder = folder
        self.most = MOST_LISTED if folder is None else math.inf
        self.nodes = nodes_of(graph)

    def document(self) -> dict[str, Any]:
        """Return the file's data."""
        graph = self.graph
        sections: dict[str, Any] = {
            "neuron_models": _models((*graph.neurons, *graph.populations), NEURON_MODEL_NAMES),
            "synapse_models": _models((*graph.synapses, *graph.projections), SYNAPSE_MODEL_NAMES),
            "inputs": {node.name: _input(node) for node in graph.inputs},
            "neurons": {neuron.name: self.neuron(neuron) for neuron in graph.neurons},
            "populations": {each.name: self.population(each) for each in graph.populations},
            "synapses": [self.synapse(synapse) for synapse in graph.synapses],
            "projections": [self.projection(i, each) for i, each in enumerate(graph.projections)],
            "outputs": {node.name: self.output(node) for node in graph.outputs},
        }
        document: dict[str, Any] = {"circuit": graph.name}
        if graph.description:
            document["description"] = graph.description
        document["control_step"] = exact(graph.step_s, parse_unit("ms"))
        document["timing"] = graph.timing
        if graph.substeps != 1:
            document["substeps"] = graph.substeps
        always = ("inputs", "neurons", "synapses", "outputs")
        return document | {key: value for key, value in sections.items() if value or key in always}

    def synapse(self, synapse: Synapse) -> dict[str, Any]:
        """Return an entry of `synapses`."""
        unit = weight_unit(synapse, self.nodes)
        entry = {"from": synapse.source, "to": synapse.target, "weight": exact(synapse.weight, unit)}
        return entry | self.of_model(synapse, unit, f"{synapse.source} -> {synapse.target}")

    def of_model(self, synapse: Synapse | Projection, weight: Unit, what: str) -> dict[str, Any]:
        """Return the keys of a synapse or projection that depend on its model."""
        model = synapse.model
        target, source = endpoint(self.nodes, synapse.target), endpoint(self.nodes, synapse.source)
        entry: dict[str, Any] = {}
        if model != STATIC:
            entry["model"] = model.name
        if synapse.delay_s:
            entry["delay"] = exact(synapse.delay_s, parse_unit("ms"))
        if synapse.gate:
            entry["gate"] = synapse.gate
        if synapse.kind == "sensorial" and source.role is not None:
            entry["kind"] = "sensorial"
        for parameter in model.parameters:
            dimension = parameter.unit_rule.dimension(
                target.activation.dimension, source.unit.dimension, weight.dimension
            )
            unit = shown_unit(parameter, dimension, DIMENSIONLESS)
            entry[parameter.name] = self.values(synapse.parameters[parameter.name], unit, what)
        return entry

    def projection(self, number: int, projection: Projection) -> dict[str, Any]:
        """Return an entry of `projections`."""
        what = f"{projection.source} -> {projection.target}"
        unit = weight_unit(projection, self.nodes)
        entry: dict[str, Any] = {"from": projection.source, "to": projection.target}
        n_source, n_target = (
            endpoint(self.nodes, name).size for name in (projection.source, projection.target)
        )
        rule = _rule(projection, n_source, n_target)
        if rule or len(projection.sources) <= MOST_LISTED or self.folder is None:
            entry["connect"] = rule or {"sources": self.rows(projection, what)}
            entry["weight"] = self.values(projection.weights, unit, what)
        else:
            name = f"{self.graph.name}_{number}.npz"
            has_weights = not isinstance(projection.weights, int | float)
            _write_matrix(self.folder / name, projection, (n_target, n_source))
            entry["connect"] = {"matrix": name}
            entry["weight"] = self.values(1.0 if has_weights else projection.weights, unit, what)
        return entry | self.of_model(projection, unit, what)

    def neuron(self, neuron: Neuron | Population) -> dict[str, Any]:
        entry: dict[str, Any] = {"model": neuron.model.name, "role": neuron.role}
        for parameter in neuron.model.parameters:
            unit = parameter_unit(neuron, parameter)
            entry[parameter.name] = self.values(neuron.parameters[parameter.name], unit, neuron.name)
        usual = start(neuron.model, neuron.parameters)
        initial = {
            state.name: self.values(neuron.initial[state.name], parameter_unit(neuron, state), neuron.name)
            for state in neuron.model.states
            if not same(neuron.initial[state.name], usual[state.name])
        }
        if initial:
            entry["initial"] = initial
        if not same(neuron.noise, 0.0):
            entry["noise"] = self.values(neuron.noise, neuron.activation_unit, neuron.name)
        return {**entry, **_described(neuron.description)}

    def population(self, population: Population) -> dict[str, Any]:
        return {"size": population.size, **self.neuron(population)}

    def rows(self, projection: Projection, what: str) -> list[list[int]]:
        """For every target the numbers of its sources."""
        self.check_size(len(projection.sources), what)
        bounds = projection.indptr.tolist()
        sources = projection.sources.tolist()
        return [sources[begin:end] for begin, end in pairwise(bounds)]

    def values(self, value: PerMember, unit: Unit, what: str) -> Any:  # noqa: ANN401 - a value or a list of them
        """Return one value, or a list of one for each."""
        if isinstance(value, int | float):
            return exact(value, unit)
        self.check_size(len(value), what)
        return [exact(each, unit) for each in value.tolist()]

    def check_size(self, count: int, what: str) -> None:
        if count > self.most:
            message = f"{what} has {count} values; a flat file lists up to {MOST_LISTED}"
            raise TooLargeError(message)

    def output(self, node: OutputNode) -> dict[str, Any]:
        entry: dict[str, Any] = {
            "unit": node.unit.symbol,
            "readout": {name: self.values(weight, node.unit, name) for name, weight in node.readout},
        }
        if node.leak is not None:
            entry["integrate"] = {"leak": exact(node.leak, parse_unit("%"))}
        if math.isfinite(node.low) or math.isfinite(node.high):
            entry["limits"] = [exact(node.low, node.unit), exact(node.high, node.unit)]
        return {**entry, **_described(node.description)}


def _models(parts: Sequence[Any], shipped: Sequence[str]) -> dict[str, Any]:
    """Return the models that are not shipped, by name."""
    models: dict[str, NeuronModel | SynapseModel] = {part.model.name: part.model for part in parts}
    return {name: model_data(model) for name, model in models.items() if name not in shipped}


def _input(node: InputNode) -> dict[str, Any]:
    limits = [exact(node.low, node.unit), exact(node.high, node.unit)]
    return {"unit": node.unit.symbol, "range": limits, **_described(node.description)}


def _rule(projection: Projection, n_source: int, n_target: int) -> str:
    """Return the rule that says the same as the connections of a projection, if there is one."""
    import numpy as np  # 0.1 s, which most files are checked without

    if len(projection.sources) == n_source * n_target:
        return "all_to_all"
    numbers = np.arange(n_target + 1)
    if n_source == n_target == len(projection.sources) and same(projection.indptr, numbers):
        return "one_to_one" if same(projection.sources, numbers[:-1]) else ""
    return ""


def _write_matrix(path: Path, projection: Projection, shape: tuple[int, int]) -> None:
    """Write connections, and weights if they differ, in the way scipy writes a sparse matrix."""
    import numpy as np  # 0.1 s, which most files are checked without

    arrays: dict[str, Any] = {"indices": projection.sources, "indptr": projection.indptr, "shape": shape}
    if not isinstance(projection.weights, int | float):
        arrays |= {"format": b"csr", "data": projection.weights}
    with replacing(path) as part:
        np.savez(part, **arrays)


def _described(description: str) -> dict[str, str]:
    return {"description": description} if description else {}
