"""In which row a target finds a source: as it is, as it was before the step, or long ago; and delays."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit.graph import CircuitGraph, Neuron, Population, Projection, Synapse
from circuitkit.circuit.memory import shortage
from circuitkit.circuit.names import node_of
from circuitkit.engine.lowering.arithmetic import copy_rows
from circuitkit.engine.lowering.plan import Block, Plan, delay_steps
from circuitkit.engine.operations import Operation, Recall, Remember

_BYTES = 3 * 8  # of a number: in a state, in the one before it, and in what runs it
_MOST_STEPS = 2**31 - 1  # they are counted with 32 bits


class _Delay(NamedTuple):
    synapse: Synapse | Projection
    in_substeps: bool
    steps: int


def require_delays(graph: CircuitGraph) -> None:
    """Refuse delays that need more memory than the machine has; the longest one is named.

    Raises:
        InputError: They need more, or one has more than 2^31 - 1 steps.
    """
    sizes = {neuron.name: 1 for neuron in graph.neurons} | {
        each.name: each.size for each in graph.populations
    }
    delays = list(_delays(graph))
    if not delays:
        return
    synapse, _, steps = max(delays, key=lambda delay: delay.steps)
    complaint = shortage(f"{steps} steps of delay", _needed(delays, sizes))
    if not complaint and steps > _MOST_STEPS:
        complaint = f"found {steps} steps of delay; allowed: up to {_MOST_STEPS}"
    if complaint:
        kind = "projection" if isinstance(synapse, Projection) else "synapse"
        where, place = f"{kind} {synapse.source} -> {synapse.target}", synapse.origin
        raise InputError(Problem(place.file, place.line, place.column, where, complaint))


def _delays(graph: CircuitGraph) -> Iterator[_Delay]:
    """Yield those of at least one step; of a substep where both endpoints are continuous."""
    nodes: tuple[Neuron | Population, ...] = (*graph.neurons, *graph.populations)
    continuous = {node.name for node in nodes if node.model.continuous}
    spiking = {node.name for node in nodes if node.model.counts_spikes}
    synapses: tuple[Synapse | Projection, ...] = (*graph.synapses, *graph.projections)
    for synapse in synapses:
        if synapse.delay_s:
            in_substeps = continuous.issuperset((node_of(synapse.source), node_of(synapse.target)))
            steps = delay_steps(synapse.delay_s, graph.step_s / (graph.substeps if in_substeps else 1))
            if not in_substeps and synapse.model.jumps and node_of(synapse.source) in spiking:
                in_substeps, steps = True, steps * graph.substeps
            if steps:
                yield _Delay(synapse, in_substeps, steps)


def _needed(delays: Sequence[_Delay], sizes: Mapping[str, int]) -> float:
    """Give bytes: single sources share a memory as deep as the longest delay, each population has its own."""
    depths: dict[tuple[bool, str], int] = defaultdict(int)
    sources: dict[tuple[bool, str], set[str]] = defaultdict(set)
    for synapse, in_substeps, steps in delays:
        own = synapse.source if sizes.get(synapse.source, 1) > 1 else ""
        depths[in_substeps, own] = max(depths[in_substeps, own], steps)
        sources[in_substeps, own].add(synapse.source)
    return sum(
        _BYTES * float(depth) * sum(sizes.get(name, 1) for name in sources[memory])
        for memory, depth in depths.items()
    )


Part = Literal["before", "substep", "after"]


@dataclass(eq=False)
class _Memory:
    """Values of the past of one population, or of any number of single rows, at one of the two rates."""

    number: int
    part: Part
    slots: dict[int, int] = field(default_factory=dict)  # first slot by first row
    sources: list[int] = field(default_factory=list)
    depth: int = 0

    def slot(self, row: int, count: int) -> int:
        """Return first of the slots of these rows."""
        if row not in self.slots:
            self.slots[row] = len(self.sources)
            self.sources.extend(range(row, row + count))
        return self.slots[row]


@dataclass(frozen=True)
class _Request:
    memory: _Memory
    row: int
    count: int
    slot: int
    steps: int


class Sources:
    """Finds rows, and collects the copies and memories that this takes."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._held: dict[int, tuple[int, int]] = {}
        self._memories: dict[tuple[Part, int], _Memory] = {}
        self._requests: dict[Part, list[_Request]] = {"before": [], "substep": [], "after": []}
        self._recalled: dict[tuple[Part, int, int, int], int] = {}

    def row(self, name: str, target: Block, delay_s: float = 0.0) -> int:
        """Give row of what a block sees of an input, neuron or member; of the first member for a population.

        Without a delay: of an input, this step's; of a discrete neuron, what the timing says, or this step's
        if the target is continuous; of a continuous neuron, that at the end of the last step or substep. With
        a delay of D steps: what stood there D steps before; under the timing `ordered`, the output of D steps
        ago.
        """
        plan = self._plan
        to_continuous = target.node.model.continuous
        if name in plan.inputs:
            row, count, lag, fine = plan.inputs[name], 1, 0, False
        else:
            source, member = plan.find(name)
            fine = source.node.model.continuous and to_continuous
            row = (source.momentary if fine else source.output) + member
            count = source.size if name == source.node.name else 1
            lag = 1
            if not source.node.model.continuous and (to_continuous or plan.graph.timing == "ordered"):
                lag = 0
        steps = delay_steps(delay_s, plan.dt if fine else plan.graph.step_s)
        if steps > 0:
            return self._past("substep" if fine else "before", row, count, steps + lag)
        if name not in plan.inputs and (source.node.name, target.node.name) in plan.order.held:
            return self.held(source.output, source.size) + member
        return row

    def momentary(self, name: str, delay_s: float = 0.0) -> int:
        """Give row of the output of a continuous neuron at the end of a substep, or of what it was before."""
        plan = self._plan
        source, member = plan.find(name)
        row, count = source.momentary + member, source.size if name == source.node.name else 1
        steps = delay_steps(delay_s, plan.graph.step_s) * plan.graph.substeps
        return self._past("substep", row, count, steps) if steps > 0 else row

    def newest(self, name: str, delay_s: float = 0.0) -> int:
        """Return row of an output at the end of a control step, or of what it was there so long ago."""
        plan = self._plan
        steps = delay_steps(delay_s, plan.graph.step_s)
        if name in plan.inputs:
            row, count = plan.inputs[name], 1
        else:
            source, member = plan.find(name)
            row, count = source.output + member, source.size if name == source.node.name else 1
        return self._past("after", row, count, steps) if steps > 0 else row

    def held(self, row: int, count: int) -> int:
        """Return first of the rows that keep what these rows were at the beginning of the control step."""
        if row not in self._held:
            self._held[row] = (self._plan.table.take(count), count)
        return self._held[row][0]

    def _past(self, part: Part, row: int, count: int, steps: int) -> int:
        """Find the first of the rows that get what these rows were so many times ago."""
        if (part, row, count, steps) not in self._recalled:
            rate: Part = "substep" if part == "substep" else "after"
            key = (rate, row if count > 1 else 0)
            memory = self._memories.setdefault(key, _Memory(len(self._memories), rate))
            memory.depth = max(memory.depth, steps)
            start = self._plan.table.take(count)
            self._requests[part].append(_Request(memory, start, count, memory.slot(row, count), steps))
            self._recalled[part, row, count, steps] = start
        return self._recalled[part, row, count, steps]

    def copies(self) -> Iterator[Operation]:
        """Find what fills the rows that `held` has given."""
        for row, (target, count) in self._held.items():
            yield copy_rows(count, row, target)

    def recalls(self, part: Part) -> Iterator[Operation]:
        """Find what fills the rows of delayed values that are read in a part of the control step."""
        runs: list[list[_Request]] = []
        for request in self._requests[part]:
            last = runs[-1][-1] if runs else None
            if last and last.memory is request.memory and last.row + last.count == request.row:
                runs[-1].append(request)
            else:
                runs.append([request])
        for run in runs:
            slots = np.concatenate([np.arange(each.slot, each.slot + each.count) for each in run])
            steps = np.repeat([each.steps for each in run], [each.count for each in run])
            start = run[0].row
            yield Recall(
                run[0].memory.number,
                start,
                start + len(slots),
                slots.astype(np.int32),
                steps.astype(np.int32),
            )

    def remembers(self, part: Part) -> Iterator[Operation]:
        """Find what keeps the values for later, at the end of the substep or of the control step."""
        for memory in self._memories.values():
            if memory.part == part:
                yield Remember(memory.number, np.array(memory.sources, dtype=np.int32), memory.depth)
