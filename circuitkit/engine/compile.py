"""`compile_circuit`: a circuit graph becomes a `Program`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine.backends import load_backend
from circuitkit.engine.lowering import lower
from circuitkit.engine.program import Precision, Program

if TYPE_CHECKING:
    from circuitkit.circuit.spec import CircuitSpec


def compile_circuit(
    circuit: CircuitGraph | CircuitSpec | str | Path,
    backend: str = "numpy",
    precision: Precision = "float64",
    *,
    reproducible: bool = True,
) -> Program:
    """Compile a circuit.

    Args:
        circuit: A resolved graph, a specification, a path, or the name of a shipped circuit.
        backend: Name of the execution backend.
        precision: In which all is computed.
        reproducible: Whether a member of a batch must get the same bits whatever the size of the batch.

    Raises:
        InputError: The circuit cannot be loaded or resolved.
        UnknownNameError: There is no such backend.
    """
    load_backend(backend)
    graph = _as_graph(circuit)
    lowered = lower(graph)
    return Program(
        name=graph.name,
        step_s=graph.step_s,
        substeps=graph.substeps,
        input_names=tuple(node.name for node in graph.inputs),
        neuron_names=_neuron_names(graph),
        output_names=tuple(output.name for output in graph.outputs),
        **{field.name: getattr(lowered, field.name) for field in fields(lowered)},
        backend=backend,
        precision=precision,
        reproducible=reproducible,
    )


def _neuron_names(graph: CircuitGraph) -> Sequence[str]:
    names = tuple(neuron.name for neuron in graph.neurons)
    members = (f"{each.name}[{i}]" for each in graph.populations for i in range(each.size))
    return (*names, *members)


def _as_graph(circuit: CircuitGraph | CircuitSpec | str | Path) -> CircuitGraph:
    if isinstance(circuit, CircuitGraph):
        return circuit
    from circuitkit.circuit.load import load_circuit
    from circuitkit.circuit.resolve import resolve

    return resolve(load_circuit(circuit) if isinstance(circuit, str | Path) else circuit)
