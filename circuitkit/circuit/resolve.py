"""The files' own terms to a `CircuitGraph`, with every reference, unit and sign checked on the way."""

from __future__ import annotations

from collections.abc import Mapping

from circuitkit.base.errors import InputError, UnknownNameError
from circuitkit.base.units import parse_unit
from circuitkit.circuit.graph import CircuitGraph, InputNode, Projection
from circuitkit.circuit.parts import Module
from circuitkit.circuit.resolving.checks import warnings_of
from circuitkit.circuit.resolving.declared_models import DeclaredModels
from circuitkit.circuit.resolving.endpoints import Nodes
from circuitkit.circuit.resolving.header import HEADER_KEYS, read_header
from circuitkit.circuit.resolving.items import Findings
from circuitkit.circuit.resolving.memory import Budget
from circuitkit.circuit.resolving.neurons import neurons
from circuitkit.circuit.resolving.outputs import outputs
from circuitkit.circuit.resolving.populations import populations
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.resolving.signals import Signals, unknown_inputs
from circuitkit.circuit.resolving.synapses import Synapses


def resolve(module: Module, settings: Mapping[str, object] | None = None) -> CircuitGraph:
    """Apply includes, parameters and settings, and check every reference, unit and sign.

    Args:
        module: What the files of a circuit declare.
        settings: Values that take the place of the files'; see `load_circuit`.

    Raises:
        UnknownNameError: The circuit has no value of this name.
        InputError: Something does not fit together; carries every error, not only the first.
    """
    findings = Findings(settings or {})
    graph = analyse(module, findings)
    for name in findings.overrides:
        if name not in findings.addresses:
            kind = "name"
            raise UnknownNameError(kind, name, sorted(findings.addresses, key=HEADER_KEYS.__contains__))
    if graph is None:
        raise InputError(*findings.errors)
    return graph


def analyse(module: Module, findings: Findings, *, is_whole: bool = True) -> CircuitGraph | None:
    """Return the graph of a circuit's files, or None after complaining.

    Args:
        module: What the files declare.
        findings: Takes up all errors and warnings.
        is_whole: Whether nothing had to be left out of the files; what is left may then well be of no use.
    """
    scope = Scope(module, findings)
    scopes = list(scope.everything())
    header = read_header(scope)
    findings.seed = header.seed if header else 0
    values = {each.prefix + name: each.parameter(name) for each in scopes for name in each.parameters}
    nodes, models, budget = Nodes(), {id(each): DeclaredModels(each) for each in scopes}, Budget()
    for each in scopes:
        unknown_inputs(each)
        _add_inputs(each, nodes)
        nodes.neurons.update((neuron.name, neuron) for neuron in neurons(each, models[id(each)]))
        found = populations(each, models[id(each)], budget)
        nodes.populations.update((population.name, population) for population in found)
    signals = Signals(nodes)
    synapses = Synapses(nodes, signals, header)
    many: list[Projection] = []
    for each in scopes:
        synapses.add(each, models[id(each)])
        if any(each.projections()):
            from circuitkit.circuit.resolving.projections import projections  # brings numpy: 0.1 s

            many.extend(projections(each, models[id(each)], nodes, signals, budget, header))
    read = tuple(outputs(scope, nodes))
    main = scope.main.spec
    if findings.errors or main.circuit is None or header is None:
        return None
    graph = CircuitGraph(
        name=main.circuit,
        description=main.description,
        timing=header.timing,
        step_s=header.step_s,
        inputs=tuple(nodes.inputs.values()),
        neurons=tuple(nodes.neurons.values()),
        synapses=tuple(synapses.found.values()),
        outputs=read,
        parameters={name: value for name, value in values.items() if value is not None},
        substeps=header.substeps,
        populations=tuple(nodes.populations.values()),
        projections=tuple(many),
    )
    if is_whole:
        findings.warnings.extend(warnings_of(graph, scope))
    return graph


def _add_inputs(scope: Scope, nodes: Nodes) -> None:
    """Add the inputs of the circuit: all but those of instances that something around feeds."""
    fed = scope.entry.spec.inputs if scope.entry else {}
    for name, item in scope.inputs.items():
        unit = parse_unit(item.spec.unit)
        limits = scope.pair(item, "range", item.spec.range, unit)
        if limits is not None and name not in fed:
            low, high = (limit.value_si for limit in limits)
            full_name = scope.prefix + name
            nodes.inputs[full_name] = InputNode(
                full_name, unit, low, high, item.spec.description, item.origin
            )
