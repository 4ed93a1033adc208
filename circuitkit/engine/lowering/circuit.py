"""`lower`: a circuit as rows and operations, in the order of a control step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine.lowering.cells import (
    Group,
    make_blocks,
    make_stages,
    place_groups,
    place_states,
)
from circuitkit.engine.lowering.maps import copy_rows
from circuitkit.engine.lowering.neurons import discrete_step
from circuitkit.engine.lowering.order import make_order
from circuitkit.engine.lowering.plan import Plan
from circuitkit.engine.lowering.readout import read_out
from circuitkit.engine.lowering.sources import Sources
from circuitkit.engine.lowering.sums import Term, Terms, ranges
from circuitkit.engine.lowering.table import Table
from circuitkit.engine.operations import IndexArray, Operation
from circuitkit.engine.state import FloatArray


@dataclass(frozen=True, eq=False)
class Lowered:
    """A circuit as rows and operations; the fields are those of `Program`."""

    n_rows: int
    before: tuple[Operation, ...]
    substep: tuple[Operation, ...]
    after: tuple[Operation, ...]
    initial: FloatArray
    activation_rows: IndexArray
    output_rows: IndexArray
    readout_rows: tuple[int, int]
    state_rows: IndexArray
    state_names: tuple[str, ...]


def lower(graph: CircuitGraph) -> Lowered:
    """Turn a circuit into rows and operations."""
    plan = _plan(graph)
    groups = [*chain(*plan.stages), *plan.continuous]
    readout = plan.table.take(len(graph.outputs))
    states = list(place_states(groups, plan.table))
    sources = Sources(plan)
    terms = Terms(list(_terms(plan, sources)))
    before = [operation for stage in plan.stages for operation in _stage(plan, stage, terms)]
    after = list(read_out(plan, readout))
    activation_rows, output_rows = _neuron_rows(groups)
    return Lowered(
        n_rows=plan.table.n_rows,
        before=(*sources.copies(), *before),
        substep=(),
        after=tuple(after),
        initial=plan.table.initial(),
        activation_rows=activation_rows,
        output_rows=output_rows,
        readout_rows=(readout, readout + len(graph.outputs)),
        state_rows=np.concatenate(
            [np.empty(0, np.int32), *(np.arange(row, row + n, dtype=np.int32) for _, row, n in states)]
        ),
        state_names=tuple(name for name, _, n in states for _ in range(n)),
    )


def _plan(graph: CircuitGraph) -> Plan:
    table = Table()
    inputs = {node.name: table.take(1) for node in graph.inputs}
    blocks = make_blocks(graph)
    discrete = [name for name, block in blocks.items() if not block.node.model.continuous]
    order = make_order(discrete, _edges(graph, set(discrete)), graph.timing)
    *stages, continuous = make_stages(blocks, order)
    place_groups([*chain(*stages), *continuous], table)
    count = sum(group.count for stage in stages for group in stage)
    pending = table.take(count) - stages[0][0].activation if order.outputs_first else 0
    return Plan(graph, table, inputs, blocks, stages, continuous, order, pending)


def _edges(graph: CircuitGraph, discrete: set[str]) -> Iterator[tuple[str, str]]:
    """Pairs of discrete nodes of which one sees the other without a delay."""
    for synapse in (*graph.synapses, *graph.projections):
        source, target = _node(synapse.source, discrete), _node(synapse.target, discrete)
        if source in discrete and target in discrete:
            yield source, target


def _node(name: str, nodes: set[str]) -> str:
    return name if name in nodes else name.rpartition("[")[0]


def _terms(plan: Plan, sources: Sources) -> Iterator[Term]:
    """The terms of single synapses: those from neurons in file order, then those from inputs in file order."""
    columns = {name: -len(plan.inputs) + i for i, name in enumerate(plan.inputs)}
    n = sum(block.size for block in plan.blocks.values())
    for synapse in plan.graph.synapses:
        target, member = plan.find(synapse.target)
        if synapse.source in columns:
            rank = n + len(plan.inputs) + columns[synapse.source]
        else:
            source, place = plan.find(synapse.source)
            rank = source.column + place
        row = sources.row(synapse.source, target)
        yield Term(target.activation + member + plan.pending, rank, row, synapse.weight)


def _stage(plan: Plan, groups: Sequence[Group], terms: Terms) -> Iterator[Operation]:
    for start, stop, _ in ranges(groups):
        yield terms.sum_of(start + plan.pending, stop + plan.pending)
    for group in groups:
        yield from discrete_step(plan, group)
    if plan.pending:
        count = sum(group.count for group in groups)
        yield copy_rows(count, groups[0].activation + plan.pending, groups[0].activation)


def _neuron_rows(groups: Sequence[Group]) -> tuple[IndexArray, IndexArray]:
    """Rows of activations and of outputs, in file order of the neurons."""
    n = sum(group.count for group in groups)
    activation, output = np.empty(n, np.int32), np.empty(n, np.int32)
    for group in groups:
        columns, rows = group.columns(), np.arange(group.count, dtype=np.int32)
        activation[columns], output[columns] = group.activation + rows, group.output + rows
    activation.flags.writeable = output.flags.writeable = False
    return activation, output
