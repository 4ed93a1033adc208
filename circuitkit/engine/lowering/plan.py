"""The plan of a circuit: which rows of the table its neurons have got, and what its states are called.

Neurons of one model in one stage stand side by side, in neighbouring rows.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import Protocol, overload

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.graph import CircuitGraph, Neuron, PerMember, Population, Projection, Synapse
from circuitkit.circuit.models.model import SPIKE, NeuronModel
from circuitkit.circuit.names import node_of
from circuitkit.engine.lowering.order import Order, make_order
from circuitkit.engine.operations import FloatArray, IndexArray, PointerArray


class Table:
    """Rows in the order in which they are asked for; row 0 is zero.

    Attributes:
        n_rows: How many there are so far.
    """

    def __init__(self) -> None:
        self.n_rows = 1
        self._initial: list[tuple[int, int, npt.ArrayLike]] = []

    def take(self, count: int, initial: npt.ArrayLike = 0.0) -> int:
        """Return the first of `count` new rows, which begin with these values."""
        start = self.n_rows
        self.n_rows += count
        self.begin_with(start, count, initial)
        return start

    def begin_with(self, start: int, count: int, initial: npt.ArrayLike) -> None:
        """Let rows begin with these values."""
        if np.any(initial):
            self._initial.append((start, count, initial))

    def initial(self) -> FloatArray:
        """Return the value of every row at the start, shape (n_rows,), [SI]."""
        values = np.zeros(self.n_rows)
        for start, count, initial in self._initial:
            values[start : start + count] = initial
        return values


@dataclass(eq=False)
class Block:
    """A neuron or a population.

    Attributes:
        node: The one or the other.
        size: Number of neurons.
        column: Index of its first neuron in file order.
        group: With which others it stands side by side.
        offset: How many neurons of the group stand before it.
    """

    node: Neuron | Population
    size: int
    column: int
    group: Group = field(init=False)
    offset: int = field(init=False)

    @property
    def activation(self) -> int:
        """First row of its activations."""
        return self.group.activation + self.offset

    @property
    def output(self) -> int:
        """First row of its outputs at control rate."""
        return self.group.output + self.offset

    @property
    def momentary(self) -> int:
        """First row of its outputs in a substep."""
        return self.group.momentary + self.offset

    def state(self, name: str) -> int:
        """Return first row of a state."""
        return self.group.states[name] + self.offset


@dataclass(eq=False)
class Group:
    """Neurons of one model that are evaluated together; each kind of value in neighbouring rows.

    Attributes:
        model: The equations.
        blocks: Neurons before populations, each in file order.
        count: Number of neurons.
        activation: First row of the activations.
        output: First row of the outputs as they are seen at control rate.
        momentary: First row of the outputs of a substep; where a model spikes these are others than `output`.
        states: First row of every state.
    """

    model: NeuronModel
    blocks: list[Block]
    count: int = 0
    activation: int = 0
    output: int = 0
    momentary: int = 0
    states: dict[str, int] = field(default_factory=dict)

    def values(self, pick: Callable[[Neuron | Population], PerMember]) -> FloatArray:
        """Return a value of every neuron, shape (count,), or shape () if it is the same for all."""
        return _joined([(pick(block.node), block.size) for block in self.blocks])

    def parameters(self) -> dict[str, FloatArray]:
        """Return the values of all parameters of the model, [SI]."""
        return {name: self.values(partial(_parameter, name)) for name in self.model.parameter_names}

    def initial(self, state: str) -> FloatArray:
        """Return the start of a state, [SI]."""
        return self.values(partial(_initial, state))

    def namings(self) -> list[tuple[int, int, Naming]]:
        """Find which neurons, from the first on, are called what: offset, number, names."""
        singles = tuple(block.node.name for block in self.blocks if isinstance(block.node, Neuron))
        populations = [block for block in self.blocks if isinstance(block.node, Population)]
        return [
            (0, len(singles), Listed(singles)),
            *((block.offset, block.size, Members(block.node.name)) for block in populations),
        ]

    def columns(self) -> npt.NDArray[np.int64]:
        """Return index in file order of every neuron, shape (count,)."""
        return np.concatenate([np.arange(block.column, block.column + block.size) for block in self.blocks])

    @property
    def counts_spikes(self) -> bool:
        """Whether what is seen at control rate is the sum over the substeps."""
        return self.model.counts_spikes


class Naming(Protocol):
    """Says what number i of some neurons or synapses is called."""

    def __call__(self, i: int, /) -> str:
        """Return the name."""


@dataclass(frozen=True)
class Listed:
    """Names that stand in a list."""

    names: tuple[str, ...]

    def __call__(self, i: int, /) -> str:
        """Return the name."""
        return self.names[i]


@dataclass(frozen=True)
class Members:
    """Members of a population, or the targets of a projection."""

    name: str

    def __call__(self, i: int, /) -> str:
        """Return the name."""
        return f"{self.name}[{i}]"


@dataclass(frozen=True, eq=False)
class Connections:
    """Synapses of a projection."""

    source: str
    target: str
    indptr: PointerArray
    sources: IndexArray

    def __call__(self, i: int, /) -> str:
        """Return the name."""
        target = int(np.searchsorted(self.indptr, i, side="right")) - 1
        return f"{self.source}[{self.sources[i]}] -> {self.target}[{target}]"


class StateNames(Sequence[str]):
    """Names of states in the order in which their rows are added: `q1.v`, `ring[3].v`, `a -> b.x`."""

    def __init__(self) -> None:
        self._parts: list[tuple[Naming, str]] = []
        self._stops: list[int] = []
        self._rows: list[IndexArray] = []

    def add(self, row: int, count: int, naming: Naming, state: str) -> None:
        """Add the neighbouring rows of a state of some neurons or synapses."""
        if count:
            self._rows.append(np.arange(row, row + count, dtype=np.int32))
            self._parts.append((naming, state))
            self._stops.append(len(self) + count)

    def rows(self) -> IndexArray:
        """Return all rows that have been added, shape (n_states,)."""
        return np.concatenate([np.empty(0, np.int32), *self._rows])

    def __len__(self) -> int:
        return self._stops[-1] if self._stops else 0

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        place = range(len(self))[index]
        part = bisect_right(self._stops, place)
        naming, state = self._parts[part]
        return f"{naming(place - (self._stops[part - 1] if part else 0))}.{state}"


@dataclass(frozen=True, eq=False)
class Plan:
    """What all parts of the lowering know.

    Attributes:
        graph: The circuit.
        table: Hands out rows.
        inputs: Row of every input, by name.
        blocks: Neurons and populations by name.
        stages: Groups of the discrete neurons, stage after stage.
        continuous: Groups of the continuous neurons.
        order: Whose value of which step a discrete neuron sees.
        pending: What must be added to the row of an activation to get the row where its new value waits.
    """

    graph: CircuitGraph
    table: Table
    inputs: dict[str, int]
    blocks: dict[str, Block]
    stages: list[list[Group]]
    continuous: list[Group]
    order: Order
    pending: int

    @property
    def dt(self) -> float:
        """Duration of a substep, [s]."""
        return self.graph.step_s / self.graph.substeps

    def find(self, name: str) -> tuple[Block, int]:
        """Find the block of a neuron or of a member such as `ring[3]`, and its place in it."""
        block = self.blocks.get(name)
        if block is not None:
            return block, 0
        population, _, member = name.removesuffix("]").rpartition("[")
        return self.blocks[population], int(member)


def delay_steps(delay_s: float, step_s: float) -> int:
    """Return the nearest number of whole steps."""
    return round(delay_s / step_s)


def make_plan(graph: CircuitGraph) -> Plan:
    """Give inputs and neurons their rows, in the order in which they are evaluated."""
    table = Table()
    inputs = {node.name: table.take(1) for node in graph.inputs}
    blocks = _make_blocks(graph)
    discrete = [name for name, block in blocks.items() if not block.node.model.continuous]
    order = make_order(discrete, _edges(graph, set(discrete)), graph.timing)
    *stages, continuous = _make_stages(blocks, order)
    _place_groups([*chain(*stages), *continuous], table)
    count = sum(group.count for stage in stages for group in stage)
    pending = table.take(count) - stages[0][0].activation if order.outputs_first and count else 0
    return Plan(graph, table, inputs, blocks, stages, continuous, order, pending)


def _edges(graph: CircuitGraph, discrete: set[str]) -> Iterator[tuple[str, str]]:
    """Yield pairs of discrete nodes of which one sees the other without a delay."""
    synapses: Iterable[Synapse | Projection] = (*graph.synapses, *graph.projections)
    for synapse in synapses:
        target = node_of(synapse.target)
        is_delayed = delay_steps(synapse.delay_s, graph.step_s) > 0
        for source in map(node_of, [synapse.gate] if is_delayed else [synapse.source, synapse.gate]):
            if source in discrete and target in discrete:
                yield source, target


def _make_blocks(graph: CircuitGraph) -> dict[str, Block]:
    """Make neurons and populations by name, in file order."""
    blocks = {neuron.name: Block(neuron, 1, column) for column, neuron in enumerate(graph.neurons)}
    column = len(blocks)
    for population in graph.populations:
        blocks[population.name] = Block(population, population.size, column)
        column += population.size
    return blocks


def _make_stages(blocks: Mapping[str, Block], order: Order) -> list[list[Group]]:
    """Make the groups of every stage of the discrete neurons, and behind them those of the continuous ones.

    Among the latter those whose method needs the sums more than once are neighbours.
    """
    stages = [_grouped([blocks[name] for name in names]) for names in order.stages]
    continuous = [block for block in blocks.values() if block.node.model.continuous]
    return [*stages, sorted(_grouped(continuous), key=lambda group: group.model.method == "rk4")]


def _place_groups(groups: Sequence[Group], table: Table) -> None:
    """Give all groups their rows: all activations, then all outputs, then the rest."""
    for group in groups:
        group.activation = table.take(group.count)
    for group in groups:
        group.output = group.momentary = table.take(group.count)


def place_states(group: Group, table: Table, names: StateNames) -> None:
    """Give the states of a group their rows, and spikes theirs where a step counts them."""
    for state in group.model.states:
        group.states[state.name] = table.take(group.count, group.initial(state.name))
        for offset, count, naming in group.namings():
            names.add(group.states[state.name] + offset, count, naming, state.name)
    if group.counts_spikes:
        group.momentary = table.take(group.count)
        for offset, count, naming in group.namings():
            names.add(group.momentary + offset, count, naming, SPIKE)


def _grouped(blocks: Sequence[Block]) -> list[Group]:
    groups: dict[NeuronModel, Group] = {}
    seen: dict[int, Group] = {}  # hashing a model takes its time
    for block in blocks:
        model = block.node.model
        if id(model) not in seen:
            seen[id(model)] = groups.setdefault(model, Group(model, []))
        seen[id(model)].blocks.append(block)
    for group in groups.values():
        group.blocks.sort(key=lambda block: isinstance(block.node, Population))
        for block in group.blocks:
            block.group, block.offset = group, group.count
            group.count += block.size
    return list(groups.values())


def _parameter(name: str, node: Neuron | Population) -> PerMember:
    return node.parameters[name]


def _initial(name: str, node: Neuron | Population) -> PerMember:
    return node.initial[name]


def _joined(parts: Sequence[tuple[PerMember, int]]) -> FloatArray:
    """Give values one after the other, shape (sum of sizes,), or shape () if they are all the same number."""
    numbers = {value if isinstance(value, float | int) else None for value, _ in parts}
    if len(numbers) == 1 and None not in numbers:
        return np.array(numbers.pop(), dtype=np.float64)
    if None not in numbers and len(parts) == sum(size for _, size in parts):
        return np.array([value for value, _ in parts], dtype=np.float64)
    return np.concatenate([np.broadcast_to(np.asarray(value, np.float64), (size,)) for value, size in parts])
