"""What neurons make of their activations (eq. 12): new states, spikes, outputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number
from circuitkit.circuit.graph import Neuron, PerMember, Population
from circuitkit.circuit.models.model import ACTIVATION, DT, SPIKE, NeuronModel
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.lowering.arithmetic import Arrivals, Moved, make_map
from circuitkit.engine.lowering.methods import STAGES, RungeKutta, System, advance
from circuitkit.engine.lowering.plan import Group, Plan
from circuitkit.engine.operations import IndexArray, Noise, Operation

_ZERO, _ONE = Number(0.0), Number(1.0)
_COUNT = "count__"


def begin_outputs(plan: Plan, group: Group) -> None:
    """Let the outputs of a model with states begin with what follows from these; those of others with 0."""
    if group.model.states:
        states = {state.name: group.initial(state.name) for state in group.model.states}
        known = {**group.parameters(), **states, SPIKE: np.array(0.0)}
        with np.errstate(all="ignore"):
            value = group.model.output.evaluate(known, NUMPY_FUNCTIONS)
        plan.table.begin_with(group.momentary, group.count, value)


def noise(plan: Plan, group: Group, start: int) -> Iterator[Noise]:
    """Adds the noise of a group to rows: sigma times a normal number, over sqrt(dt) for continuous models."""
    scale = group.values(_noise)
    if group.model.continuous:
        scale = np.asarray(scale / np.sqrt(plan.dt))
    if scale.any():
        yield Noise(start, start + group.count, scale, group.columns().astype(np.int32))


def discrete_step(plan: Plan, group: Group) -> Iterator[Operation]:
    """Yield new states by `updates`, all from the old ones, then spikes and outputs."""
    if group.model.updates:
        results = [(group.states[name], new) for name, new in group.model.updates.items()]
        yield make_map(group.count, results, _rows(group), group.parameters())
    yield from outputs(plan, group)


def continuous_step(plan: Plan, groups: Sequence[Group], arrivals: Arrivals) -> Iterator[Operation]:
    """Noise, the states by their methods, spikes, outputs; the activations are in their rows already."""
    together = [group for group in groups if group.model.method == "rk4"]
    for group in groups:
        if group not in together:
            yield from noise(plan, group, group.activation)
            yield from advance(_system(plan, group), group.model.method, plan.table)
    yield from _runge_kutta(plan, together, arrivals)
    for group in groups:
        yield from outputs(plan, group)


def outputs(plan: Plan, group: Group) -> Iterator[Operation]:
    """Spikes and resets by the new states, then the outputs by what the resets left."""
    model, rows = group.model, _rows(group)
    parameters = {**group.parameters(), DT: np.array(plan.dt)}
    results: list[tuple[int, Expression]]
    if model.spike is not None:
        rows[SPIKE] = group.momentary if model.output == Name(SPIKE) else plan.table.take(group.count)
        results = [(rows[SPIKE], _where_it_spikes(model, _ONE, _ZERO))]
        for name, new in model.spike.reset.items():
            results.append((group.states[name], _where_it_spikes(model, new, Name(name))))
        yield make_map(group.count, results, rows, parameters)
    results = [] if rows.get(SPIKE) == group.momentary else [(group.momentary, model.output)]
    if group.counts_spikes:
        rows[_COUNT] = group.output
        results.append((group.output, Binary("+", Name(_COUNT), model.output)))
    if results:
        yield make_map(group.count, results, rows, parameters)


def begin_count(group: Group) -> Operation:
    """Sets what is counted over the substeps to zero."""
    return make_map(group.count, [(group.output, _ZERO)], {})


def _runge_kutta(plan: Plan, groups: Sequence[Group], arrivals: Arrivals) -> Iterator[Operation]:
    """Yield all groups by rk4 together: at every stage the sums are made again from the outputs as tried."""
    if not groups:
        return
    shift = plan.table.take(sum(group.count for group in groups)) - groups[0].activation
    parts = [RungeKutta(_system(plan, group), plan.table) for group in groups]
    tried = {group: plan.table.take(group.count) for group in groups if not group.counts_spikes}
    drawn = [_drawn_noise(plan, group) for group in groups]
    for operations, _ in drawn:
        yield from operations
    for stage in range(STAGES):
        if stage > 0:
            states = {group: part.states for group, part in zip(groups, parts, strict=True)}
            yield from (_tried_outputs(group, row, states[group]) for group, row in tried.items())
            yield from arrivals.sums(groups, shift, _swapped(tried))
        for group, part, (_, extra) in zip(groups, parts, drawn, strict=True):
            activation = group.activation + (shift if stage else 0)
            if extra:
                yield _added(group.count, extra, activation)
            yield part.slope(stage, {ACTIVATION: activation})
            yield from part.trial(stage)
    for part in parts:
        yield part.result()


def _tried_outputs(group: Group, row: int, states: Mapping[str, int]) -> Operation:
    return make_map(group.count, [(row, group.model.output)], states, group.parameters())


def _drawn_noise(plan: Plan, group: Group) -> tuple[list[Operation], int]:
    """Find what draws the noise of a substep once, for all stages, and its rows; 0 for no noise."""
    row = plan.table.take(group.count)
    drawn = list(noise(plan, group, row))
    if not drawn:
        return [], 0
    return [make_map(group.count, [(row, _ZERO)], {}), *drawn], row


def _added(count: int, source: int, target: int) -> Operation:
    return make_map(count, [(target, Binary("+", Name("x"), Name("y")))], {"x": target, "y": source})


def _swapped(tried: Mapping[Group, int]) -> Moved:
    """Has the outputs of these groups read from other rows."""

    def moved(rows: IndexArray) -> IndexArray:
        result = rows.copy()
        for group, row in tried.items():
            inside = (rows >= group.momentary) & (rows < group.momentary + group.count)
            result[inside] += row - group.momentary
        return result

    return moved


def _system(plan: Plan, group: Group) -> System:
    return System(
        name=group.model.name,
        count=group.count,
        states=group.states,
        derivatives=group.model.derivatives,
        rows={ACTIVATION: group.activation},
        picks={},
        constants=group.parameters(),
        dt=plan.dt,
    )


def _rows(group: Group) -> dict[str, int]:
    return {ACTIVATION: group.activation, **group.states}


def _noise(node: Neuron | Population) -> PerMember:
    return node.noise


def _where_it_spikes(model: NeuronModel, then: Expression, otherwise: Expression) -> Expression:
    if model.spike is None:
        return otherwise
    return Call("where", (Binary(">", model.spike.when, _ZERO), then, otherwise))
