"""When a discrete neuron is evaluated and whose value of which step it sees: the three timings of eqs. 11 and 12."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from circuitkit.circuit.graph import Timing


@dataclass(frozen=True)
class Order:
    """The order of evaluation inside a control step; a population is one node.

    Attributes:
        stages: Names of the nodes that are evaluated together, stage after stage, each stage in file order.
        held: Pairs (source, target) whose target sees the source's output of the last step although the new
            one has been written by then: the last one must be kept.
        outputs_first: Whether a neuron's output follows from its last activation, not from its new one (eq.
            12).
    """

    stages: tuple[tuple[str, ...], ...]
    held: frozenset[tuple[str, str]]
    outputs_first: bool


def make_order(names: Sequence[str], edges: Iterable[tuple[str, str]], timing: Timing) -> Order:
    """Arrange discrete nodes in the smallest number of stages that the timing allows.

    With u the inputs read in this step, A the activations and O the outputs:

    - `as_printed`, eqs. 11 and 12 literally: `A' = W_in u + W O`, `O' = f(A)`. One stage, two steps a layer.
    - `synchronous`: `A' = W_in u + W O`, `O' = f(A')`. One stage, one step a layer.
    - `ordered`: layer after layer inside the step. Inside a cycle, a node sees this step's output of those
      declared above it and the last step's of those below it and of itself. Stages: the longest chain of
      nodes that see each other's new output.

    Args:
        names: The nodes, in file order.
        edges: Pairs (source, target) of those that see each other without a delay.
        timing: One of the three.
    """
    if timing == "ordered":
        return _ordered(names, list(edges))
    return Order((tuple(names),) if names else (), frozenset(), timing == "as_printed")


def _ordered(names: Sequence[str], edges: Sequence[tuple[str, str]]) -> Order:
    import networkx as nx

    network = nx.DiGraph()
    network.add_nodes_from(names)
    network.add_edges_from(edges)
    cycles = nx.strongly_connected_components(network)
    cycle_of = {name: i for i, cycle in enumerate(cycles) for name in cycle}
    position = {name: i for i, name in enumerate(names)}
    from_last_step = {
        (source, target)
        for source, target in edges
        if cycle_of[source] == cycle_of[target] and position[source] >= position[target]
    }
    network.remove_edges_from(from_last_step)
    level = dict.fromkeys(names, 0)
    for name in nx.topological_sort(network):
        level[name] = max((level[source] + 1 for source in network.predecessors(name)), default=0)
    stages: list[list[str]] = [[] for _ in range(max(level.values(), default=-1) + 1)]
    for name in names:
        stages[level[name]].append(name)
    return Order(
        stages=tuple(tuple(stage) for stage in stages),
        held=frozenset(pair for pair in from_last_step if level[pair[0]] < level[pair[1]]),
        outputs_first=False,
    )
