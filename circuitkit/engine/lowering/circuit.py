"""`lower`: a circuit as rows and operations, in the order of a control step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name
from circuitkit.circuit.graph import CircuitGraph, OutputNode, Population, Synapse
from circuitkit.circuit.models import SynapseModel
from circuitkit.engine.lowering.arithmetic import Arrivals, Matrix, Term, copy_rows, list_sum, make_map
from circuitkit.engine.lowering.neurons import (
    begin_count,
    begin_outputs,
    continuous_step,
    discrete_step,
    noise,
)
from circuitkit.engine.lowering.plan import (
    Group,
    Plan,
    StateNames,
    make_plan,
    place_states,
)
from circuitkit.engine.lowering.sources import Sources, require_delays
from circuitkit.engine.lowering.synapses import (
    Bundle,
    ProjectedSynapses,
    SingleSynapses,
    counts_spikes,
    make_bundle,
    only_weighs,
)
from circuitkit.engine.operations import IndexArray, Lowered, Operation, Sum


def lower(graph: CircuitGraph) -> Lowered:
    """Turn a circuit into rows and operations.

    Raises:
        InputError: Its delays need more memory than the machine has.
    """
    require_delays(graph)
    plan = make_plan(graph)
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
        *(
            operation
            for bundle in bundles
            if not (bundle.runs_in_substeps or bundle.sees_spikes)
            for operation in bundle.progress()
        ),
        *(operation for bundle in bundles for operation in bundle.update()),
        *_read_out(plan, readout),
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


def _bundles(plan: Plan, sources: Sources) -> Iterator[Bundle]:
    """Synapses that do more than weigh: single ones by model and stage of their targets, and projections."""
    stage_of = {id(group): i for i, stage in enumerate(plan.stages) for group in stage}
    alike: dict[tuple[SynapseModel, int, bool], list[Synapse]] = {}
    for synapse in plan.graph.synapses:
        if not only_weighs(synapse.model):
            target, _ = plan.find(synapse.target)
            key = synapse.model, stage_of.get(id(target.group), -1), counts_spikes(plan, synapse.source)
            alike.setdefault(key, []).append(synapse)
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
    counting = [bundle for bundle in bundles if bundle.sees_spikes]
    for bundle in (*own, *counting):
        yield from bundle.progress()
    yield from continuous_step(plan, plan.continuous, arrivals)
    for bundle in counting:
        yield from bundle.spiked()


def _neuron_rows(groups: Sequence[Group]) -> tuple[IndexArray, IndexArray]:
    """Return rows of activations and of outputs, in file order of the neurons."""
    n = sum(group.count for group in groups)
    activation, output = np.empty(n, np.int32), np.empty(n, np.int32)
    for group in groups:
        columns, rows = group.columns(), np.arange(group.count, dtype=np.int32)
        activation[columns], output[columns] = group.activation + rows, group.output + rows
    activation.flags.writeable = output.flags.writeable = False
    return activation, output


_SUM, _BEFORE, _KEEP, _LOW, _HIGH = (Name(name) for name in ("sum", "before", "keep", "low", "high"))


def _read_out(plan: Plan, start: int) -> Iterator[Operation]:
    """`y' = clip(keep y + r, low, high)` for all outputs, in the rows from `start`."""
    row = start
    for is_plain, nodes in groupby(plan.graph.outputs, key=lambda node: _kind(node) == (False, False)):
        outputs = list(nodes)
        total = row if is_plain else plan.table.take(len(outputs))
        yield _weighted(plan, outputs, total)
        for kind, alike in groupby(outputs, key=_kind):
            part = list(alike)
            if any(kind):
                yield _accumulated(part, kind, total, row)
            total, row = total + len(part), row + len(part)


def _kind(node: OutputNode) -> tuple[bool, bool]:
    """Check whether it integrates, and whether it has limits."""
    return node.leak is not None, bool(np.isfinite(node.low) or np.isfinite(node.high))


def _weighted(plan: Plan, outputs: list[OutputNode], start: int) -> Sum:
    sources: list[npt.NDArray[Any]] = []
    weights: list[npt.NDArray[Any]] = []
    lengths = []
    for output in outputs:
        length = 0
        for name, weight in output.readout:
            block, member = plan.find(name)
            rows = block.output + (np.arange(block.size) if name == block.node.name else np.array([member]))
            sources.append(rows)
            weights.append(np.broadcast_to(np.asarray(weight, dtype=np.float64), rows.shape))
            length += len(rows)
        lengths.append(length)
    return list_sum(start, lengths, np.concatenate([[], *sources]), np.concatenate([[], *weights]))


def _accumulated(outputs: list[OutputNode], kind: tuple[bool, bool], total: int, row: int) -> Operation:
    integrates, is_limited = kind
    value: Expression = _SUM
    if integrates:
        value = Binary("+", Binary("*", _KEEP, _BEFORE), value)
    if is_limited:
        value = Call("min", (Call("max", (value, _LOW)), _HIGH))
    constants = {
        _KEEP.name: np.array([1.0 - (node.leak or 0.0) for node in outputs]),
        _LOW.name: np.array([node.low for node in outputs]),
        _HIGH.name: np.array([node.high for node in outputs]),
    }
    rows = {_SUM.name: total, _BEFORE.name: row}
    return make_map(len(outputs), [(row, value)], rows, constants)
