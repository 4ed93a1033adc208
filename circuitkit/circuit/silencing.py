"""Lesions: a circuit in which a neuron no longer sends, or a connection no longer carries, anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.circuit.graph import CircuitGraph, OutputNode, Projection, Synapse
from circuitkit.circuit.models import STATIC

ARROW = "->"

_Edge = TypeVar("_Edge", Synapse, Projection)


def silence(graph: CircuitGraph, names: Sequence[str]) -> CircuitGraph:
    """Return the circuit with some of its parts silenced.

    A static synapse and a share in an output get the weight zero, so that all others keep their place in the
    order of a step; a synapse of another model goes, for its weight may grow again.

    Args:
        graph: The circuit; stays as it is.
        names: Each the name of a neuron, population or input, none of whose output then arrives anywhere; or
            a connection such as `q1 -> p1`, also to an output: `p1 -> ankle_roll`.

    Raises:
        InputError: The circuit has no such part, or what is silenced opens the gate of a synapse.
    """
    if not names:
        return graph
    silent = frozenset(_edges_of(graph, names))
    synapses = tuple(left for each in graph.synapses for left in _without(each, silent))
    projections = tuple(left for each in graph.projections for left in _without(each, silent))
    outputs = tuple(_output_without(each, silent) for each in graph.outputs)
    return replace(graph, synapses=synapses, projections=projections, outputs=outputs)


def connections(graph: CircuitGraph) -> tuple[tuple[str, str], ...]:
    """Return every pair of names between which something is sent, each once, in file order, outputs last."""
    edges = [(each.source, each.target) for each in _all(graph)]
    edges += [(name, output.name) for output in graph.outputs for name, _ in output.readout]
    return tuple(dict.fromkeys(edges))


def _all(graph: CircuitGraph) -> tuple[Synapse | Projection, ...]:
    return (*graph.synapses, *graph.projections)


def _edges_of(graph: CircuitGraph, names: Sequence[str]) -> list[tuple[str, str]]:
    edges = connections(graph)
    sources = tuple(dict.fromkeys(source for source, _ in edges))
    found, problems = [], []
    for name in names:
        source, arrow, target = (part.strip() for part in name.partition(ARROW))
        those = [edge for edge in edges if edge[0] == source and (not arrow or edge[1] == target)]
        if those:
            found += those
            problems += [] if arrow else _gates(graph, source)
        else:
            allowed = [f"{a} {ARROW} {b}" for a, b in edges] if arrow else sources
            what = "connection" if arrow else "neuron or input that sends anything"
            message = f"found '{name}': no {what} in '{graph.name}'; allowed: {listing(allowed)}"
            problems.append(Problem("", 0, 0, "silenced", message, suggest(name, allowed)))
    if problems:
        raise InputError(*problems)
    return found


def _gates(graph: CircuitGraph, name: str) -> list[Problem]:
    gated = [each for each in _all(graph) if each.gate == name]
    if not gated:
        return []
    those = listing(f"{each.source} {ARROW} {each.target}" for each in gated)
    message = f"found '{name}', which gates {those}; allowed: neurons that gate nothing, or connections"
    return [Problem("", 0, 0, "silenced", message)]


def _without(edge: _Edge, silent: frozenset[tuple[str, str]]) -> tuple[_Edge, ...]:
    """Find what is left of it: itself, itself with no weight, or nothing."""
    if (edge.source, edge.target) not in silent:
        return (edge,)
    if edge.model != STATIC:
        return ()
    nothing: dict[str, Any] = {"weights" if isinstance(edge, Projection) else "weight": 0.0}
    return (replace(edge, **nothing),)


def _output_without(output: OutputNode, silent: frozenset[tuple[str, str]]) -> OutputNode:
    readout = tuple((name, 0.0 if (name, output.name) in silent else w) for name, w in output.readout)
    return replace(output, readout=readout)
