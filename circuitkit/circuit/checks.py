"""What is allowed in a circuit, but probably not meant: warnings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from circuitkit.errors import Problem

if TYPE_CHECKING:
    from circuitkit.circuit.graph import CircuitGraph
    from circuitkit.circuit.scope import Scope


def doubts(graph: CircuitGraph, scope: Scope) -> Iterator[Problem]:
    """Parameters, inputs and neurons without any effect on an output."""
    for name, parameter in scope.parameters.items():
        if name not in scope.used_parameters:
            yield parameter.problem((), "unused parameter; nothing uses its name", at_key=True)
    effective = _effective(graph)
    for name, signal in scope.inputs.items():
        if name not in effective:
            yield signal.problem((), "unused input; no path leads from it to an output", at_key=True)
    for name, neuron in scope.neurons.items():
        if name not in effective:
            yield neuron.problem((), "unused neuron; no path leads from it to an output", at_key=True)


def _effective(graph: CircuitGraph) -> frozenset[str]:
    """Names of the inputs and neurons from which a path leads to an output."""
    sources: dict[str, list[str]] = {}
    for synapse in graph.synapses:
        sources.setdefault(synapse.target, []).append(synapse.source)
    reached: set[str] = set()
    waiting = [neuron for output in graph.outputs for neuron, _ in output.readout]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting.extend(sources.get(name, ()))
    return frozenset(reached)
