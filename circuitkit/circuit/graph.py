"""`CircuitGraph`: a circuit with everything resolved; the engine, the drawing and the exports read this.

All values are SI floats, every reference is known to exist, and every unit is known to fit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from circuitkit.circuit.models import NeuronModel
from circuitkit.units import Quantity, Unit

if TYPE_CHECKING:
    import networkx

Timing = Literal["as_printed", "synchronous", "ordered"]
Role = Literal["excitatory", "inhibitory"]
SynapseKind = Literal["sensorial", "excitatory", "inhibitory"]


@dataclass(frozen=True)
class Origin:
    """Where something stands in the files; line and column from 1, or 0 if it came from no file."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


NO_ORIGIN = Origin("", 0, 0)


@dataclass(frozen=True)
class InputNode:
    """A sensorial input; signed.

    Attributes:
        name: Its name.
        unit: The unit in which it is written and shown.
        low: Smallest value expected, [SI].
        high: Largest value expected, [SI].
        description: In words.
        origin: Where it is declared.
    """

    name: str
    unit: Unit
    low: float
    high: float
    description: str = ""
    origin: Origin = field(default=NO_ORIGIN, compare=False)


@dataclass(frozen=True)
class Neuron:
    """A neuron: an activation function of its model with its own parameters.

    Attributes:
        name: Its name.
        model: The equations.
        role: What its outgoing weights may be: positive (excitatory) or negative (inhibitory).
        parameters: A value for every parameter of the model, [SI].
        activation_unit: The unit in which its activation is shown.
        description: In words.
        origin: Where it is declared.
    """

    name: str
    model: NeuronModel
    role: Role
    parameters: Mapping[str, float]
    activation_unit: Unit
    description: str = ""
    origin: Origin = field(default=NO_ORIGIN, compare=False)


@dataclass(frozen=True)
class Synapse:
    """A connection: adds `weight * source` to the activation of the target (eq. 11).

    Attributes:
        source: Name of an input or of a neuron.
        target: Name of a neuron.
        weight: Signed weight, [SI unit of the target's activation / SI unit of the source].
        kind: Sensorial if it comes from an input, else the role of the source neuron.
        origin: Where it is declared.
    """

    source: str
    target: str
    weight: float
    kind: SynapseKind
    origin: Origin = field(default=NO_ORIGIN, compare=False)


@dataclass(frozen=True)
class OutputNode:
    r"""An output of the circuit: a weighted sum of neuron outputs, optionally accumulated with a leak.

    With `r = sum_i w_i O_i`: `y[t] = clip(r[t], low, high)`, or with a leak
    `y[t] = clip((1 - leak) y[t-1] + r[t], low, high)`, eq. 14 as an increment per step.

    Attributes:
        name: Its name.
        unit: The unit in which it is written and shown.
        readout: Pairs of neuron name and weight, [SI].
        low: Lower limit, [SI]; minus infinity without limits.
        high: Upper limit, [SI]; infinity without limits.
        leak: Part of the output that is lost each control step, dimensionless; None without integration.
        description: In words.
        origin: Where it is declared.
    """

    name: str
    unit: Unit
    readout: tuple[tuple[str, float], ...]
    low: float
    high: float
    leak: float | None = None
    description: str = ""
    origin: Origin = field(default=NO_ORIGIN, compare=False)


@dataclass(frozen=True)
class CircuitGraph:
    """A circuit with everything resolved. Graphs are equal if they mean the same, wherever they were written.

    Attributes:
        name: Name of the circuit.
        description: In words.
        timing: When a neuron sees what; see `docs/language.md`.
        step_s: Control step, [s].
        inputs: In file order.
        neurons: In file order, which decides inside a cycle when the timing is `ordered`.
        synapses: In file order, one for each target.
        outputs: In file order.
        parameters: The named values, by name.
    """

    name: str
    description: str
    timing: Timing
    step_s: float
    inputs: tuple[InputNode, ...]
    neurons: tuple[Neuron, ...]
    synapses: tuple[Synapse, ...]
    outputs: tuple[OutputNode, ...]
    parameters: Mapping[str, Quantity]

    def names(self) -> tuple[str, ...]:
        """Names of inputs, neurons and outputs, in this order; no name occurs twice."""
        nodes: tuple[InputNode | Neuron | OutputNode, ...] = (*self.inputs, *self.neurons, *self.outputs)
        return tuple(node.name for node in nodes)

    def to_networkx(self) -> networkx.DiGraph:
        """The circuit as a directed graph.

        Every node has the attributes `kind` ("input", "neuron" or "output") and `node` (the dataclass); every
        edge has `weight` [SI] and `kind` ("sensorial", "excitatory", "inhibitory"; "readout" to an output).
        """
        import networkx as nx

        view = nx.DiGraph(name=self.name)
        view.add_nodes_from((node.name, {"kind": "input", "node": node}) for node in self.inputs)
        view.add_nodes_from((node.name, {"kind": "neuron", "node": node}) for node in self.neurons)
        view.add_nodes_from((node.name, {"kind": "output", "node": node}) for node in self.outputs)
        for synapse in self.synapses:
            view.add_edge(synapse.source, synapse.target, weight=synapse.weight, kind=synapse.kind)
        for output in self.outputs:
            for neuron, weight in output.readout:
                view.add_edge(neuron, output.name, weight=weight, kind="readout")
        return view
