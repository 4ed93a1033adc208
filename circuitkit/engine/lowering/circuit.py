"""`lower`: a circuit as rows and operations, in the order of a control step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain

import numpy as np

from circuitkit.circuit.graph import CircuitGraph, Population, Projection, Synapse
from circuitkit.circuit.models import SynapseModel
from circuitkit.circuit.names import node_of
from circuitkit.engine.lowering.cells import (
    Group,
    Table,
    make_blocks,
    make_stages,
    place_groups,
    place_states,
)
from circuitkit.engine.lowering.maps import copy_rows
from circuitkit.engine.lowering.names import StateNames
from circuitkit.engine.lowering.neurons import (
    begin_count,
    begin_outputs,
    continuous_step,
    discrete_step,
    noise,
)
from circuitkit.engine.lowering.order import make_order
from circuitkit.engine.lowering.plan import Plan
from circuitkit.engine.lowering.readout import read_out
from circuitkit.engine.lowering.sources import Sources, delay_steps, require_delays
from circuitkit.engine.lowering.sums import Arrivals, Matrix, Term
from circuitkit.engine.lowering.synapses import (
    Bundle,
    ProjectedSynapses,
    SingleSynapses,
    make_bundle,
    only_weighs,
)
from circuitkit.engine.operations import IndexArray, Lowered, Operation


def lower(graph: CircuitGraph) -> Lowered:
    """Turn a circuit into rows and operations.

    Raises:
        InputError: Its delays need more memory than the machine has.
    """
    require_delays(graph)
    plan = _plan(graph)
    groups = [*chain(*plan.stages), *plan.continuous]
    readout = plan.table.take(len(graph.outputs))
    names = StateNames()
    for group in groups:
        place_states(group, plan.table, names)
        begin_outputs(plan, group)
    sources = Sources(plan)
    bundles = list(_bundles(plan, sources))
    for bundle in bundles:
        bundle.place(names)
    arrivals = Arrivals(list(_terms(plan, sources, bundles)), list(_matrices(plan, sources, bundles)))
    before = list(_before(plan, bundles, arrivals))
    substep = list(_substep(plan, bundles, arrivals)) if plan.continuous else []
    after = [
        *(operation for bundle in bundles if not bundle.runs_in_substeps for operation in bundle.progress()),
        *(operation for bundle in bundles for operation in bundle.update()),
        *read_out(plan, readout),
    ]
    activation_rows, output_rows = _neuron_rows(groups)
    return Lowered(
        before=(*sources.copies(), *sources.recalls("before"), *before),
        substep=(*sources.recalls("substep"), *substep, *sources.remembers("substep")),
        after=(*sources.recalls("after"), *after, *sources.remembers("after")),
        n_rows=plan.table.n_rows,
        initial=plan.table.initial(),
        activation_rows=activation_rows,
        output_rows=output_rows,
        readout_rows=(readout, readout + len(graph.outputs)),
        state_rows=names.rows(),
        state_names=names,
        population_columns={
            name: range(block.column, block.column + block.size)
            for name, block in plan.blocks.items()
            if isinstance(block.node, Population)
        },
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


def _bundles(plan: Plan, sources: Sources) -> Iterator[Bundle]:
    """Synapses that do more than weigh: single ones by model and stage of their targets, and projections."""
    stage_of = {id(group): i for i, stage in enumerate(plan.stages) for group in stage}
    alike: dict[tuple[SynapseModel, int], list[Synapse]] = {}
    for synapse in plan.graph.synapses:
        if not only_weighs(synapse.model):
            target, _ = plan.find(synapse.target)
            alike.setdefault((synapse.model, stage_of.get(id(target.group), -1)), []).append(synapse)
    for synapses in alike.values():
        yield SingleSynapses(plan, sources, synapses)
    for projection in plan.graph.projections:
        if not only_weighs(projection.model) and (
            len(projection.sources) or projection.model.per == "target"
        ):
            yield make_bundle(plan, sources, projection)


def _terms(plan: Plan, sources: Sources, bundles: Sequence[Bundle]) -> Iterator[Term]:
    """Yield the terms of single synapses: from neurons and from inputs in file order, then from bundles."""
    n = sum(block.size for block in plan.blocks.values())
    ranks = {name: n + i for i, name in enumerate(plan.inputs)}
    for synapse in plan.graph.synapses:
        if only_weighs(synapse.model):
            target, member = plan.find(synapse.target)
            if synapse.source in ranks:
                rank = ranks[synapse.source]
            else:
                source, place = plan.find(synapse.source)
                rank = source.column + place
            row = sources.row(synapse.source, target, synapse.delay_s)
            yield Term(target.activation + member, rank, row, synapse.weight)
    rank = n + len(plan.inputs)
    for bundle in bundles:
        if isinstance(bundle, SingleSynapses):
            yield from bundle.terms(rank)
            rank += bundle.count


def _matrices(plan: Plan, sources: Sources, bundles: Sequence[Bundle]) -> Iterator[Matrix]:
    """Find what projections deliver, in file order."""
    by_projection = {
        id(bundle.projection): bundle for bundle in bundles if isinstance(bundle, ProjectedSynapses)
    }
    for projection in plan.graph.projections:
        bundle = by_projection.get(id(projection))
        if bundle is not None:
            yield bundle.matrix()
        elif only_weighs(projection.model):
            target = plan.blocks[projection.target]
            base = sources.row(projection.source, target, projection.delay_s)
            weights = np.asarray(projection.weights, dtype=np.float64)
            yield Matrix(target, projection.indptr, projection.sources, weights, base)


def _before(plan: Plan, bundles: Sequence[Bundle], arrivals: Arrivals) -> Iterator[Operation]:
    """Yield discrete neurons, stage after stage; counts of spikes begin anew once these have seen them."""
    for groups in plan.stages:
        for bundle in bundles:
            if not bundle.runs_in_substeps and any(bundle.target.group is group for group in groups):
                yield from bundle.arrive()
        yield from arrivals.sums(groups, plan.pending)
        for group in groups:
            yield from noise(plan, group, group.activation + plan.pending)
        for group in groups:
            yield from discrete_step(plan, group)
        if plan.pending:
            start = groups[0].activation
            yield copy_rows(sum(group.count for group in groups), start + plan.pending, start)
    for group in plan.continuous:
        if group.counts_spikes:
            yield begin_count(group)


def _substep(plan: Plan, bundles: Sequence[Bundle], arrivals: Arrivals) -> Iterator[Operation]:
    """Synapses into continuous neurons, then these neurons."""
    own = [bundle for bundle in bundles if bundle.runs_in_substeps]
    for bundle in own:
        yield from bundle.arrive()
    yield from arrivals.sums(plan.continuous)
    for bundle in own:
        yield from bundle.progress()
    yield from continuous_step(plan, plan.continuous, arrivals)


def _neuron_rows(groups: Sequence[Group]) -> tuple[IndexArray, IndexArray]:
    """Return rows of activations and of outputs, in file order of the neurons."""
    n = sum(group.count for group in groups)
    activation, output = np.empty(n, np.int32), np.empty(n, np.int32)
    for group in groups:
        columns, rows = group.columns(), np.arange(group.count, dtype=np.int32)
        activation[columns], output[columns] = group.activation + rows, group.output + rows
    activation.flags.writeable = output.flags.writeable = False
    return activation, output
