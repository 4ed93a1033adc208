"""When a discrete neuron is evaluated and whose value of which step it sees: the three timings."""

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
    position = {name: i for i, name in enumerate(names)}
    pairs = [(position[source], position[target]) for source, target in edges]
    successors: list[list[int]] = [[] for _ in names]
    for source, target in pairs:
        successors[source].append(target)
    cycles = _cycles(successors)
    cycle_of = {node: i for i, cycle in enumerate(cycles) for node in cycle}
    from_last_step = {(s, t) for s, t in pairs if cycle_of[s] == cycle_of[t] and s >= t}
    level = [0] * len(names)
    for cycle in reversed(cycles):  # sources before targets
        for node in sorted(cycle):
            for target in successors[node]:
                if (node, target) not in from_last_step:
                    level[target] = max(level[target], level[node] + 1)
    stages: list[list[str]] = [[] for _ in range(max(level, default=-1) + 1)]
    for name, stage in zip(names, level, strict=True):
        stages[stage].append(name)
    return Order(
        stages=tuple(tuple(stage) for stage in stages),
        held=frozenset((names[s], names[t]) for s, t in from_last_step if level[s] < level[t]),
        outputs_first=False,
    )


def _cycles(successors: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly connected components, targets before sources (Tarjan 1972, without recursion)."""
    n = len(successors)
    number, lowest = [-1] * n, [0] * n
    open_nodes: list[int] = []
    is_open = [False] * n
    found: list[list[int]] = []
    counter = 0
    for root in range(n):
        todo = [(root, 0)] if number[root] < 0 else []
        while todo:
            node, done = todo.pop()
            if done == 0:
                number[node] = lowest[node] = counter
                counter += 1
                open_nodes.append(node)
                is_open[node] = True
            elif is_open[successors[node][done - 1]]:
                lowest[node] = min(lowest[node], lowest[successors[node][done - 1]])
            while done < len(successors[node]):
                target = successors[node][done]
                done += 1
                if number[target] < 0:
                    todo += [(node, done), (target, 0)]
                    break
                if is_open[target]:
                    lowest[node] = min(lowest[node], number[target])
            else:
                if lowest[node] == number[node]:
                    found.append([])
                    while is_open[node]:
                        found[-1].append(open_nodes.pop())
                        is_open[found[-1][-1]] = False
    return found
