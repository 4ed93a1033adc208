"""What is allowed in a circuit, but probably not meant: warnings."""

from __future__ import annotations

from collections.abc import Iterator

from circuitkit.base.errors import Problem
from circuitkit.base.units import format_quantity, parse_unit
from circuitkit.circuit.graph import CircuitGraph, Projection, Synapse
from circuitkit.circuit.names import node_of
from circuitkit.circuit.resolving.scope import Scope

_FAR_FROM_WHOLE = 0.01
_MILLISECOND = parse_unit("ms")


def warnings_of(graph: CircuitGraph, scope: Scope) -> Iterator[Problem]:
    """Yield parameters, inputs, neurons and instances without any effect on an output; delays between steps.

    Of an instance's own declarations nothing is said: another circuit may use them.
    """
    for name, parameter in scope.parameters.items():
        if name not in scope.used_parameters:
            yield parameter.problem((), "unused parameter; nothing uses its name", at_key=True)
    effective = _effective(graph)
    for kind in ("input", "neuron", "population"):
        for name, (own_kind, node) in scope.nodes.items():
            if own_kind == kind and name not in effective:
                yield node.problem((), f"unused {kind}; no path leads from it to an output", at_key=True)
    for instance in scope.instances.values():
        if instance.entry and not any(name.startswith(instance.prefix) for name in effective):
            message = "unused instance; no path leads from it to an output"
            yield instance.entry.problem((), message)


def _effective(graph: CircuitGraph) -> frozenset[str]:
    """Return names of the inputs, neurons and populations from which a path leads to an output."""
    sources: dict[str, list[str]] = {}
    links: tuple[Synapse | Projection, ...] = (*graph.synapses, *graph.projections)
    for synapse in links:
        target = sources.setdefault(node_of(synapse.target), [])
        target.append(node_of(synapse.source))
        if synapse.gate:
            target.append(node_of(synapse.gate))
    reached: set[str] = set()
    waiting = [node_of(name) for output in graph.outputs for name, _ in output.readout]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting.extend(sources.get(name, ()))
    return frozenset(reached)


def rounded_delay(delay_s: float, step_s: float) -> str:
    """Find what a delay is rounded to, in words, if that changes it by more than 1 %; else empty."""
    rounded = round(delay_s / step_s) * step_s
    if abs(rounded - delay_s) <= _FAR_FROM_WHOLE * delay_s:
        return ""
    becomes, step = format_quantity(rounded, _MILLISECOND), format_quantity(step_s, _MILLISECOND)
    return f"it becomes {becomes}, a multiple of {step}"
