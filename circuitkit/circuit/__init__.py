"""The circuit language: YAML text to `CircuitSpec` to `CircuitGraph`, and the neuron models.

Read in the order in which the data flows: `load` (file to spec), `spec` (the file's own terms), `resolve`
(spec to graph, with every check on the way), `graph` (what everything else reads), `models` and `expression`
(what a neuron does).
"""

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.circuit.load import check, load_circuit, parse_circuit
from circuitkit.circuit.resolve import resolve
from circuitkit.circuit.schema import circuit_schema
from circuitkit.circuit.spec import CircuitSpec

__all__ = [
    "CircuitGraph",
    "CircuitSpec",
    "check",
    "circuit_schema",
    "load_circuit",
    "parse_circuit",
    "resolve",
]
