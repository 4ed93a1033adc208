"""What a neuron makes of its activation (eq. 12): new states, spikes, an output."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from circuitkit.circuit.expression import Binary, Call, Expression, Name, Number
from circuitkit.circuit.models.model import ACTIVATION, SPIKE, NeuronModel
from circuitkit.engine.lowering.cells import Group
from circuitkit.engine.lowering.maps import make_map
from circuitkit.engine.lowering.plan import Plan
from circuitkit.engine.operations import Operation

_ZERO, _ONE = Number(0.0), Number(1.0)


def discrete_step(plan: Plan, group: Group) -> Iterator[Operation]:
    """New states by `updates`, all from the old ones, spikes, then the outputs."""
    rows = {ACTIVATION: group.activation, **group.states}
    if group.model.updates:
        results = [(group.states[name], new) for name, new in group.model.updates.items()]
        yield make_map(group.count, results, rows, group.parameters())
    yield from outputs(plan, group)


def outputs(plan: Plan, group: Group) -> Iterator[Operation]:
    """Spikes and resets by the new states, then the outputs by what the resets left."""
    model = group.model
    rows = {ACTIVATION: group.activation, **group.states}
    if model.spike is not None:
        rows[SPIKE] = group.momentary if model.output == Name(SPIKE) else plan.table.take(group.count)
        results = [(rows[SPIKE], _where_it_spikes(model, _ONE, _ZERO))]
        results += [
            (group.states[name], _where_it_spikes(model, new, Name(name)))
            for name, new in model.spike.reset.items()
        ]
        yield make_map(group.count, results, rows, group.parameters())
    results = [] if rows.get(SPIKE) == group.momentary else [(group.momentary, model.output)]
    if group.counts_spikes:
        rows[_COUNT.name] = group.output
        results.append((group.output, Binary("+", _COUNT, model.output)))
    if results:
        yield make_map(group.count, results, rows, group.parameters())


_COUNT = Name("counted__")


def first_outputs(group: Group, states: Mapping[str, object]) -> object:
    """The outputs that follow from the initial states; 0 for a model without states."""
    from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS

    if not group.model.states:
        return 0.0
    return group.model.output.evaluate({**group.parameters(), **states, SPIKE: 0.0}, NUMPY_FUNCTIONS)


def _where_it_spikes(model: NeuronModel, then: Expression, otherwise: Expression) -> Expression:
    if model.spike is None:
        return otherwise
    return Call("where", (Binary(">", model.spike.when, _ZERO), then, otherwise))
