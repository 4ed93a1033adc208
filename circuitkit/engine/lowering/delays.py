"""How many steps a delay is, and whether what delays keep fits into memory, before anything is made."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit.graph import CircuitGraph, Neuron, Population, Projection, Synapse
from circuitkit.circuit.memory import shortage

_BYTES = 3 * 8  # of a number: in a state, in the one before it, and in what runs it
_MOST_STEPS = 2**31 - 1  # they are counted with 32 bits


class _Delay(NamedTuple):
    synapse: Synapse | Projection
    in_substeps: bool
    steps: int


def delay_steps(delay_s: float, step_s: float) -> int:
    """Return the nearest number of whole steps."""
    return round(delay_s / step_s)


def require_delays(graph: CircuitGraph) -> None:
    """Refuse delays that need more memory than the machine has; the longest one is named.

    Raises:
        InputError: They need more, or one has more than 2^31 - 1 steps.
    """
    sizes = {neuron.name: 1 for neuron in graph.neurons} | {
        each.name: each.size for each in graph.populations
    }
    delays = list(_delays(graph, sizes))
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


def _delays(graph: CircuitGraph, sizes: Mapping[str, int]) -> Iterator[_Delay]:
    """Yield those of at least one step; of a substep where both endpoints are continuous."""
    nodes: tuple[Neuron | Population, ...] = (*graph.neurons, *graph.populations)
    continuous = {node.name for node in nodes if node.model.continuous}
    synapses: tuple[Synapse | Projection, ...] = (*graph.synapses, *graph.projections)
    for synapse in synapses:
        if synapse.delay_s:
            endpoints = (_node(name, sizes) for name in (synapse.source, synapse.target))
            in_substeps = continuous.issuperset(endpoints)
            steps = delay_steps(synapse.delay_s, graph.step_s / (graph.substeps if in_substeps else 1))
            if steps:
                yield _Delay(synapse, in_substeps, steps)


def _node(name: str, nodes: Mapping[str, int]) -> str:
    return name if name in nodes else name.rpartition("[")[0]


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
