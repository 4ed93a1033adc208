"""`compile_circuit`: a circuit graph becomes a `Program` of frozen arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine.backends import load_backend
from circuitkit.engine.layout import Group, blocks, frozen, make_groups
from circuitkit.engine.program import Gather, IndexArray, Program, Readout, Stage
from circuitkit.engine.schedule import Schedule, make_schedule

if TYPE_CHECKING:
    from circuitkit.circuit.spec import CircuitSpec

# A sum is filled up with zeros to the length of its neighbours while this many zeros, or as many as terms,
# are wasted.
_MAX_PADDING = 256
Terms = Sequence[tuple[int, float]]  # rows of the source table with weights


def compile_circuit(circuit: CircuitGraph | CircuitSpec | str | Path, backend: str = "numpy") -> Program:
    """Compile a circuit.

    Args:
        circuit: A resolved graph, a specification, a path, or the name of a shipped circuit.
        backend: Name of the execution backend.

    Raises:
        InputError: The circuit cannot be loaded or resolved.
        UnknownNameError: There is no such backend.
    """
    load_backend(backend)
    graph = _as_graph(circuit)
    names = tuple(neuron.name for neuron in graph.neurons)
    schedule = make_schedule(graph)
    stages = make_groups(graph, schedule)
    members = [neuron.name for groups in stages for group in groups for neuron in group.members]
    rows = _source_rows(graph, members, schedule.held)
    terms = _terms(graph, rows, schedule)
    n_inputs = len(graph.inputs)
    return Program(
        name=graph.name,
        step_s=graph.step_s,
        input_names=tuple(node.name for node in graph.inputs),
        neuron_names=names,
        output_names=tuple(output.name for output in graph.outputs),
        stages=tuple(_stage(groups, terms) for groups in stages),
        readout=_readout(graph, rows),
        neuron_of_row=_frozen_index([names.index(name) for name in members]),
        row_of_neuron=_frozen_index([rows[name] - 1 - n_inputs for name in names]),
        held=_frozen_index([rows[name] - 1 - n_inputs for name in schedule.held]),
        outputs_first=schedule.outputs_first,
        backend=backend,
    )


def _as_graph(circuit: CircuitGraph | CircuitSpec | str | Path) -> CircuitGraph:
    if isinstance(circuit, CircuitGraph):
        return circuit
    from circuitkit.circuit.load import load_circuit
    from circuitkit.circuit.resolve import resolve

    return resolve(load_circuit(circuit) if isinstance(circuit, str | Path) else circuit)


def _source_rows(graph: CircuitGraph, members: Sequence[str], held: Sequence[str]) -> dict[str, int]:
    """Rows of the source table by name; row 0 is zero, and the first of a neuron's rows holds its output."""
    names = [*(node.name for node in graph.inputs), *members, *map(_held, held)]
    return {name: row for row, name in reversed(list(enumerate(names, start=1)))}


def _held(name: str) -> str:
    return f"last output of {name}"  # no name of a file has a space


def _terms(graph: CircuitGraph, rows: Mapping[str, int], schedule: Schedule) -> dict[str, Terms]:
    """The terms of every neuron's sum: those of neurons in file order, then those of inputs in file order."""
    names = [*(neuron.name for neuron in graph.neurons), *(node.name for node in graph.inputs)]
    order = {name: i for i, name in enumerate(names)}
    stage_of = {name: i for i, stage in enumerate(schedule.stages) for name in stage}
    terms: dict[str, list[tuple[int, float]]] = {neuron.name: [] for neuron in graph.neurons}
    for synapse in sorted(graph.synapses, key=lambda synapse: order[synapse.source]):
        source, target = synapse.source, synapse.target
        overwritten = (source, target) in schedule.from_last_tick and stage_of[source] < stage_of[target]
        terms[target].append((rows[_held(source) if overwritten else source], synapse.weight))
    return dict(terms)


def _stage(groups: Sequence[Group], terms: Mapping[str, Terms]) -> Stage:
    sums = [terms[neuron.name] for group in groups for neuron in group.members]
    return Stage(
        gathers=tuple(_gathers(sums, groups[0].start)),
        blocks=tuple(block for group in groups for block in blocks(group)),
    )


def _gathers(sums: Sequence[Terms], start: int) -> Iterable[Gather]:
    """Neighbouring sums in rectangular tables; a new table begins where filling up would waste too much."""
    begin = 0
    for end in range(1, len(sums) + 1):
        lengths = [len(terms) for terms in sums[begin : end + 1]]
        wasted = max(lengths) * len(lengths) - sum(lengths)
        if end == len(sums) or wasted > max(_MAX_PADDING, sum(lengths)):
            yield _gather(sums[begin:end], start + begin)
            begin = end


def _gather(sums: Sequence[Terms], start: int) -> Gather:
    shape = (max(1, *map(len, sums)), len(sums))
    sources, weights = np.zeros(shape, dtype=np.intp), np.zeros(shape)
    for column, terms in enumerate(sums):
        for i, (row, weight) in enumerate(terms):
            sources[i, column], weights[i, column] = row, weight
    sources.flags.writeable = weights.flags.writeable = False
    return Gather(start, start + len(sums), sources, weights)


def _readout(graph: CircuitGraph, rows: Mapping[str, int]) -> Readout:
    outputs = graph.outputs
    sums = [[(rows[name], weight) for name, weight in output.readout] for output in outputs]
    integrates = [output.leak is not None for output in outputs]
    edges = [i for i, flag in enumerate(integrates) if i == 0 or flag != integrates[i - 1]]
    runs = [(begin, end) for begin, end in pairwise([*edges, len(outputs)]) if integrates[begin]]
    return Readout(
        gathers=tuple(_gathers(sums, 0)),
        integrating=tuple(runs),
        keep=frozen([0.0 if output.leak is None else 1.0 - output.leak for output in outputs]),
        low=frozen([output.low for output in outputs]),
        high=frozen([output.high for output in outputs]),
    )


def _frozen_index(values: Sequence[int]) -> IndexArray:
    array = np.array(values, dtype=np.intp)
    array.flags.writeable = False
    return array
