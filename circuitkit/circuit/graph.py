"""`CircuitGraph`: a circuit with everything resolved; the engine, the drawing and the exports read this.

All values are SI floats, every reference is known to exist, and every unit is known to fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from circuitkit.base.units import Quantity, Unit
from circuitkit.circuit.models import STATIC, NeuronModel, SynapseModel
from circuitkit.circuit.names import Names

if TYPE_CHECKING:
    import networkx
    import numpy as np
    import numpy.typing as npt

# One value for all members of a population or synapses of a projection, or an array with one for each. In
# quotes, since a file is checked without numpy.
PerMember: TypeAlias = "float | npt.NDArray[np.float64]"

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


def same(first: Any, second: Any) -> bool:  # noqa: ANN401 - values, arrays, and mappings and tuples of these
    """Check whether two values are equal, arrays by their elements."""
    if isinstance(first, Mapping):
        return (
            isinstance(second, Mapping)
            and first.keys() == second.keys()
            and all(same(value, second[key]) for key, value in first.items())
        )
    if isinstance(first, tuple):
        return (
            isinstance(second, tuple)
            and len(first) == len(second)
            and all(same(mine, theirs) for mine, theirs in zip(first, second, strict=True))
        )
    if hasattr(first, "shape") or hasattr(second, "shape"):
        import numpy as np  # 0.1 s, which most files are checked without

        return np.array_equal(first, second)
    return bool(first == second)


def _same_fields(first: Any, second: Any) -> bool:  # noqa: ANN401 - dataclasses of one kind
    return all(
        same(getattr(first, each.name), getattr(second, each.name)) for each in fields(first) if each.compare
    )


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
        initial: Start of every state of the model, [SI].
        noise: Standard deviation of the noise on its activation: for a continuous model that of white noise,
            [SI unit of the activation * sqrt(s)], for others that of every control step, [SI unit of it].
        origin: Where it is declared.
    """

    name: str
    model: NeuronModel
    role: Role
    parameters: Mapping[str, float]
    activation_unit: Unit
    description: str = ""
    initial: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.0
    origin: Origin = field(default=NO_ORIGIN, compare=False)


@dataclass(frozen=True, eq=False)
class Population:
    """Neurons of one model, each with its own values; member i is called `NAME[i]`, from 0.

    Attributes:
        name: Its name.
        size: Number of neurons.
        model: The equations.
        role: What the outgoing weights may be.
        parameters: As a neuron's, per member, shape () or (size,), [SI].
        activation_unit: The unit in which the activations are shown.
        description: In words.
        initial: As a neuron's, per member.
        noise: As a neuron's, per member.
        origin: Where it is declared.
    """

    name: str
    size: int
    model: NeuronModel
    role: Role
    parameters: Mapping[str, PerMember]
    activation_unit: Unit
    description: str = ""
    initial: Mapping[str, PerMember] = field(default_factory=dict)
    noise: PerMember = 0.0
    origin: Origin = field(default=NO_ORIGIN, compare=False)

    def __eq__(self, other: object) -> bool:
        return _same_fields(self, other) if isinstance(other, Population) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # it holds arrays


@dataclass(frozen=True)
class Synapse:
    """A connection: adds what its model says, else `weight * source`, to the target's activation (eq. 11).

    Attributes:
        source: Name of an input, of a neuron, or of a member of a population.
        target: Name of a neuron or of a member of a population.
        weight: Weight; of a static synapse signed, [SI unit of the target's activation / that of the source].
        kind: Sensorial if it comes from an input, else the role of the source neuron.
        model: The equations.
        parameters: A value for every parameter of the model, [SI].
        initial: Start of every state of the model, [SI].
        delay_s: Age of the source's output that arrives, beyond what the timing makes it, [s].
        gate: Name of the neuron (or member) whose output the model calls `gate`; empty for none.
        weight_unit: The unit in which the weight was written; None if it was made of several.
        origin: Where it is declared.
    """

    source: str
    target: str
    weight: float
    kind: SynapseKind
    model: SynapseModel = STATIC
    parameters: Mapping[str, float] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    delay_s: float = 0.0
    gate: str = ""
    weight_unit: Unit | None = field(default=None, compare=False)
    origin: Origin = field(default=NO_ORIGIN, compare=False)


@dataclass(frozen=True, eq=False)
class Projection:
    """Many synapses of one model from one node to another, as a sparse matrix by rows of targets (CSR).

    Synapses k = indptr[j] ... indptr[j + 1] - 1 lead to member j of the target, from members `sources[k]`.

    Attributes:
        source: Name of an input, a neuron or a population.
        target: Name of a neuron or a population.
        indptr: Shape (n_target + 1,), int64.
        sources: Members of the source, shape (n_synapses,), int32; ascending for every target.
        weights: As a synapse's, one for all or shape (n_synapses,).
        kind: As a synapse's.
        model: The equations.
        parameters: As a synapse's; one for all, or shape (n_synapses,); shape (n_target,) where the model
            keeps its states per target.
        initial: As the parameters.
        delay_s: As a synapse's.
        gate: As a synapse's.
        weight_unit: As a synapse's.
        origin: Where it is declared.
    """

    source: str
    target: str
    indptr: npt.NDArray[np.int64]
    sources: npt.NDArray[np.int32]
    weights: PerMember
    kind: SynapseKind
    model: SynapseModel = STATIC
    parameters: Mapping[str, PerMember] = field(default_factory=dict)
    initial: Mapping[str, PerMember] = field(default_factory=dict)
    delay_s: float = 0.0
    gate: str = ""
    weight_unit: Unit | None = field(default=None, compare=False)
    origin: Origin = field(default=NO_ORIGIN, compare=False)

    def __eq__(self, other: object) -> bool:
        return _same_fields(self, other) if isinstance(other, Projection) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # it holds arrays


@dataclass(frozen=True, eq=False)
class OutputNode:
    r"""An output of the circuit: a weighted sum of neuron outputs, optionally accumulated with a leak.

    With `r = sum_i w_i O_i`: `y[t] = clip(r[t], low, high)`, or with a leak
    `y[t] = clip((1 - leak) y[t-1] + r[t], low, high)`, eq. 14 as an increment per step.

    Attributes:
        name: Its name.
        unit: The unit in which it is written and shown.
        readout: Pairs of the name of a neuron, member or population, and weight, [SI]; a population's weights
            may be an array, one for each member.
        low: Lower limit, [SI]; minus infinity without limits.
        high: Upper limit, [SI]; infinity without limits.
        leak: Part of the output that is lost each control step, dimensionless; None without integration.
        description: In words.
        origin: Where it is declared.
    """

    name: str
    unit: Unit
    readout: tuple[tuple[str, PerMember], ...]
    low: float
    high: float
    leak: float | None = None
    description: str = ""
    origin: Origin = field(default=NO_ORIGIN, compare=False)

    def __eq__(self, other: object) -> bool:
        return _same_fields(self, other) if isinstance(other, OutputNode) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # it may hold arrays


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
        substeps: How many substeps continuous models do in a control step.
        populations: In file order, after all neurons where an order counts.
        projections: In file order, after all synapses where an order counts.
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
    substeps: int = 1
    populations: tuple[Population, ...] = ()
    projections: tuple[Projection, ...] = ()

    @property
    def neuron_names(self) -> Names:
        """Names of the neurons and of the members of populations, in this order."""
        sizes = ((population.name, population.size) for population in self.populations)
        return Names((neuron.name for neuron in self.neurons), sizes)

    def names(self) -> Names:
        """Return the names of inputs, neurons, members and outputs, in this order; none occurs twice."""
        singles: tuple[InputNode | Neuron, ...] = (*self.inputs, *self.neurons)
        sizes = ((population.name, population.size) for population in self.populations)
        return Names((node.name for node in singles), sizes, (node.name for node in self.outputs))

    def edges(self) -> Iterator[tuple[str, str, float, str]]:
        """Yield every connection from neuron to neuron: source, target, weight [SI], and its kind."""
        sizes = {population.name: population.size for population in self.populations}
        for synapse in self.synapses:
            yield synapse.source, synapse.target, synapse.weight, synapse.kind
        for projection in self.projections:
            yield from _edges_of(projection, sizes)
        for output in self.outputs:
            for name, weights in output.readout:
                members = _members(name, sizes)
                for member, weight in zip(members, _each(weights, len(members)), strict=True):
                    yield member, output.name, weight, "readout"

    def to_networkx(self) -> networkx.DiGraph:
        """Make a directed graph of networkx, with a node for every member of a population.

        Every node has the attributes `kind` ("input", "neuron" or "output") and `node` (the dataclass; of a
        member its population); every edge has `weight` [SI] and `kind` ("sensorial", "excitatory",
        "inhibitory"; "readout" to an output). Several connections between two nodes are one edge with the sum
        of their weights.
        """
        import networkx as nx  # 0.2 s, which nobody else needs

        view = nx.DiGraph(name=self.name)
        view.add_nodes_from((node.name, {"kind": "input", "node": node}) for node in self.inputs)
        view.add_nodes_from((node.name, {"kind": "neuron", "node": node}) for node in self.neurons)
        for population in self.populations:
            members = Names((), [(population.name, population.size)])
            view.add_nodes_from((member, {"kind": "neuron", "node": population}) for member in members)
        view.add_nodes_from((node.name, {"kind": "output", "node": node}) for node in self.outputs)
        for source, target, weight, kind in self.edges():
            if view.has_edge(source, target):
                view.edges[source, target]["weight"] += weight
            else:
                view.add_edge(source, target, weight=weight, kind=kind)
        return view


def _edges_of(projection: Projection, sizes: Mapping[str, int]) -> Iterator[tuple[str, str, float, str]]:
    sources, targets = _members(projection.source, sizes), _members(projection.target, sizes)
    weights = iter(_each(projection.weights, len(projection.sources)))
    for row, target in enumerate(targets):
        for source in projection.sources[projection.indptr[row] : projection.indptr[row + 1]].tolist():
            yield sources[source], target, next(weights), projection.kind


def _members(name: str, sizes: Mapping[str, int]) -> Names:
    """Name the members of a population, or the one node of this name."""
    return Names((), [(name, sizes[name])]) if name in sizes else Names((name,), ())


def _each(values: PerMember, size: int) -> list[float]:
    """Spread a value to one for each."""
    return [float(values)] * size if isinstance(values, int | float) else values.tolist()
