"""The circuit language: YAML text to `CircuitSpec` to `CircuitGraph`, and the neuron models.

Read in the order in which the data flows: `load` (the one way from a file to a graph), `parts` (the files),
`spec` (a file's own terms), `resolving` (section by section to nodes and connections, with every check on the
way), `graph` (what everything else reads). Beside these stand `expressions` (values and equations),
`models` (what a neuron or a synapse does), `memory` (whether something fits into the machine's) and
`authoring` (starters, normal form, schema, differences, explanations).
"""

from circuitkit.circuit.authoring.schema import circuit_schema
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.circuit.load import check, load_circuit, parse_circuit, read_circuit
from circuitkit.circuit.spec import CircuitSpec

__all__ = [
    "CircuitGraph",
    "CircuitSpec",
    "check",
    "circuit_schema",
    "load_circuit",
    "parse_circuit",
    "read_circuit",
]
