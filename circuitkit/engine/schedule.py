"""When a neuron is evaluated and whose value of which tick it sees: the three timings of eqs. 11 and 12."""

from __future__ import annotations

from dataclasses import dataclass

from circuitkit.circuit.graph import CircuitGraph


@dataclass(frozen=True)
class Schedule:
    """The order of evaluation inside one tick.

    Attributes:
        stages: Names of the neurons that are evaluated together, stage after stage, each stage in file order.
        from_last_tick: Pairs (source, target) whose target sees the source's output of the last tick.
        held: Sources whose last output is still read after their new one is written; it must be kept.
        outputs_first: Whether a neuron's output follows from its last activation, not from its new one (eq.
            12).
    """

    stages: tuple[tuple[str, ...], ...]
    from_last_tick: frozenset[tuple[str, str]]
    held: tuple[str, ...]
    outputs_first: bool


def make_schedule(graph: CircuitGraph) -> Schedule:
    """Arrange the neurons of a circuit in the smallest number of stages that its timing allows.

    With u the inputs read in this tick, A the activations and O the outputs:

    - `as_printed`, eqs. 11 and 12 literally: `A' = W_in u + W O`, `O' = f(A)`. One stage, two ticks a layer.
    - `synchronous`: `A' = W_in u + W O`, `O' = f(A')`. One stage, one tick a layer.
    - `ordered`: layer after layer inside the tick. Inside a cycle, a neuron sees this tick's output of those
      declared above it and the last tick's of those below it and of itself. Stages: the longest chain of
      neurons that see each other's new output.
    """
    names = tuple(neuron.name for neuron in graph.neurons)
    inputs = {node.name for node in graph.inputs}
    between = [(s.source, s.target) for s in graph.synapses if s.source not in inputs]
    if graph.timing == "ordered":
        return _ordered(names, between)
    return Schedule((names,) if names else (), frozenset(between), (), graph.timing == "as_printed")


def _ordered(names: tuple[str, ...], between: list[tuple[str, str]]) -> Schedule:
    import networkx as nx

    network = nx.DiGraph()
    network.add_nodes_from(names)
    network.add_edges_from(between)
    cycles = nx.strongly_connected_components(network)
    cycle_of = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    position = {name: i for i, name in enumerate(names)}
    last = frozenset(
        (source, target)
        for source, target in between
        if cycle_of[source] == cycle_of[target] and position[source] >= position[target]
    )
    network.remove_edges_from(last)
    level = dict.fromkeys(names, 0)
    for name in nx.topological_sort(network):
        level[name] = max((level[source] + 1 for source in network.predecessors(name)), default=0)
    n_levels = max(level.values(), default=-1) + 1
    stages = [[name for name in names if level[name] == i] for i in range(n_levels)]
    held = {source for source, target in last if level[source] < level[target]}
    return Schedule(
        stages=tuple(tuple(stage) for stage in stages),
        from_last_tick=last,
        held=tuple(name for name in names if name in held),
        outputs_first=False,
    )
