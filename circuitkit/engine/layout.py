"""Where each neuron stands among the rows: stage after stage, and in a stage side by side with its like."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from circuitkit.circuit.expression import Expression
from circuitkit.circuit.graph import CircuitGraph, Neuron
from circuitkit.circuit.models.model import ACTIVATION
from circuitkit.engine.forms import FIRST, GAIN, OFFSET, SECOND, Form, form_of
from circuitkit.engine.schedule import Schedule
from circuitkit.engine.state import FloatArray


@dataclass(frozen=True, eq=False)
class Block:
    """Neighbouring rows that one equation gives their outputs.

    Attributes:
        equation: In terms of the activation, of outputs of other rows, and of constants.
        start: First row.
        stop: The row after the last one.
        reads_activation: The name in the equation that stands for the activations of these rows; empty for
            none.
        reads_output: First rows of the outputs, as many as these rows, by their names in the equation.
        constants: A value for every row, shape (stop - start,), [SI], by name.
    """

    equation: Expression
    start: int
    stop: int
    reads_activation: str
    reads_output: Mapping[str, int]
    constants: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Group:
    """Neurons of a stage that are computed together: of one form's function, or else of one model.

    Its rows are the neurons', those of two elements first; then come the first elements of these, then the
    second.

    Attributes:
        neurons: Those of two elements first.
        start: First row.
    """

    neurons: tuple[Neuron, ...]
    start: int

    @property
    def pairs(self) -> tuple[Neuron, ...]:
        """The neurons of two elements."""
        return tuple(neuron for neuron in self.neurons if _elements(neuron) > 1)

    @property
    def members(self) -> tuple[Neuron, ...]:
        """The neuron of every row."""
        return (*self.neurons, *self.pairs, *self.pairs)


def make_groups(graph: CircuitGraph, schedule: Schedule) -> list[list[Group]]:
    """The groups of every stage."""
    fan_in = Counter(synapse.target for synapse in graph.synapses)
    by_name = {neuron.name: neuron for neuron in graph.neurons}
    stages: list[list[Group]] = []
    start = 0
    for names in schedule.stages:
        alike: dict[Hashable, list[Neuron]] = {}
        for name in names:
            alike.setdefault(_kin(by_name[name]), []).append(by_name[name])
        stages.append([])
        for neurons in alike.values():
            # Short sums before ones that are much longer; else in file order, in which sources often are
            # neighbours.
            neurons.sort(key=lambda each: (-_elements(each), _joint(each), fan_in[each.name].bit_length()))
            group = Group(tuple(neurons), start)
            stages[-1].append(group)
            start += len(group.members)
    return stages


def blocks(group: Group) -> Iterable[Block]:
    """The blocks that give the neurons of a group their outputs, to be computed in this order."""
    first = group.neurons[0]
    form = form_of(first.model.output)
    if form is None:
        names = first.model.parameter_names
        constants = {name: frozen([neuron.parameters[name] for neuron in group.neurons]) for name in names}
        stop = group.start + len(group.neurons)
        yield Block(first.model.output, group.start, stop, ACTIVATION, {}, constants)
        return
    singles = group.neurons[len(group.pairs) :]
    parts = [(neuron, 0) for neuron in (*singles, *group.pairs)] + [(neuron, 1) for neuron in group.pairs]
    values = [_form(neuron).elements[i].values(neuron.parameters) for neuron, i in parts]
    gains, offsets = zip(*values, strict=True)
    constants = {GAIN.name: frozen(gains), OFFSET.name: frozen(offsets)}
    start = group.start + len(group.pairs)
    yield Block(form.elements[0].equation, start, start + len(parts), ACTIVATION, {}, constants)
    yield from _joints(group)


def _joints(group: Group) -> Iterable[Block]:
    """For each operator, the block that joins the two elements of its neurons."""
    operators = [_joint(neuron) for neuron in group.pairs]
    first = group.start + len(group.neurons)
    for operator, count in Counter(operators).items():
        offset = operators.index(operator)
        reads = {FIRST.name: first + offset, SECOND.name: first + len(operators) + offset}
        start = group.start + offset
        yield Block(_form(group.pairs[offset]).equation, start, start + count, "", reads, {})


def _kin(neuron: Neuron) -> Hashable:
    form = form_of(neuron.model.output)
    return neuron.model if form is None else form.function


def _elements(neuron: Neuron) -> int:
    form = form_of(neuron.model.output)
    return 1 if form is None else len(form.elements)


def _joint(neuron: Neuron) -> str:
    form = form_of(neuron.model.output)
    return "" if form is None else form.joint


def _form(neuron: Neuron) -> Form:
    form = form_of(neuron.model.output)
    if form is None:
        message = f"model '{neuron.model.name}' has no form"
        raise TypeError(message)
    return form


def frozen(values: Sequence[float]) -> FloatArray:
    """A read-only array."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array
