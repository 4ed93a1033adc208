"""The one way from circuit files to a `CircuitGraph`: read, check, resolve; all errors of all files at once.

`parts` reads the files, `resolving` has the sections of a file one by one, `analyse` puts them together.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

from circuitkit.base.errors import InputError, Problem, UnknownNameError, warn_once
from circuitkit.base.source import Document, find_data_file, scan_text, scan_yaml
from circuitkit.circuit.graph import CircuitGraph, Projection, Synapse
from circuitkit.circuit.memory import Budget
from circuitkit.circuit.names import node_of
from circuitkit.circuit.parts import FOLDER, Module, read_module
from circuitkit.circuit.resolving.declarations import Findings
from circuitkit.circuit.resolving.declared_models import DeclaredModels
from circuitkit.circuit.resolving.header import HEADER_KEYS, read_header
from circuitkit.circuit.resolving.nodes import Nodes, inputs, neurons, outputs, populations
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.resolving.signals import Signals, unknown_inputs
from circuitkit.circuit.resolving.synapses import Synapses


def load_circuit(
    name_or_path: str | Path, settings: Mapping[str, object] | None = None, *, option: str = ""
) -> CircuitGraph:
    """Read a circuit file, check it, and resolve it to a graph.

    Args:
        name_or_path: The name of a shipped circuit, or a path.
        settings: Values that take the place of the file's, by name: of parameters (`{"w": "0.5 deg"}`, in an
            instance `lateral.w`), of nodes (`q1.slope`, `ring.tau`, `ankle_roll.integrate.leak`), and of the
            whole circuit (`control_step`, `substeps`, `timing`, `seed`).
        option: The option of a command that gave the settings, such as `--set`; stands in messages.

    Raises:
        UnknownNameError: The circuit has no value of a name in `settings`.
        InputError: With every error of the file and of those it includes, or of what the settings make of it.
    """
    return _graph(_sound(partial(scan_yaml, find_data_file(name_or_path, FOLDER))), settings, option)


def parse_circuit(
    text: str, path: str = "<text>", settings: Mapping[str, object] | None = None, *, option: str = ""
) -> CircuitGraph:
    """Read the text of a circuit file, check it, and resolve it to a graph.

    Args:
        text: The text.
        path: What stands in messages; includes start from its folder.
        settings: As for `load_circuit`.
        option: As for `load_circuit`.

    Raises:
        UnknownNameError: The circuit has no value of a name in `settings`.
        InputError: With every error of the text and of the files it includes, or of what the settings make
            of it.
    """
    return _graph(_sound(partial(scan_text, text, path)), settings, option)


def read_circuit(name_or_path: str | Path) -> Module:
    """Read a circuit file in its own terms, for what writes circuit files; `.spec` has the file as it stands.

    Args:
        name_or_path: The name of a shipped circuit, or a path.

    Raises:
        InputError: With every error of the file and of those it includes.
    """
    return _sound(partial(scan_yaml, find_data_file(name_or_path, FOLDER))).module


def check(name_or_path: str | Path) -> tuple[tuple[Problem, ...], tuple[Problem, ...]]:
    """List all errors and all warnings of a circuit file and of those it includes, in the order of the text.

    Args:
        name_or_path: The name of a shipped circuit, or a path.

    Returns:
        The errors and the warnings.
    """
    try:
        path = find_data_file(name_or_path, FOLDER)
    except InputError as error:
        return error.problems, ()
    _, errors, findings = _examine(partial(scan_yaml, path))
    return errors, _in_order([*findings.warnings, *findings.unused])


_Read: TypeAlias = Callable[[], tuple[Document | None, list[Problem]]]


@dataclass(frozen=True)
class _Sound:
    """A circuit without errors: its files, and the graph that they give as they stand."""

    module: Module
    graph: CircuitGraph


def _sound(read: _Read) -> _Sound:
    found, errors, findings = _examine(read)
    if found is None:
        raise InputError(*errors)
    for warning in _in_order(findings.warnings):
        warn_once(f"{warning} (warning)")
    return found


def _graph(found: _Sound, settings: Mapping[str, object] | None, option: str) -> CircuitGraph:
    """Resolve a circuit with other values; what these break is said to come from the option."""
    if not settings:
        return found.graph
    try:
        return resolve(found.module, settings)
    except InputError as error:
        if not option:
            raise
        raise InputError(*(_blaming(each, option) for each in error.problems)) from error


def _blaming(problem: Problem, option: str) -> Problem:
    if not (problem.file or problem.where):
        return replace(problem, where=option)
    return replace(problem, message=f"{problem.message} (with {option})")


@contextmanager
def _collecting_later() -> Iterator[None]:
    """No search for garbage meanwhile: reading makes very many objects that stay, and hardly any garbage."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _examine(read: _Read) -> tuple[_Sound | None, tuple[Problem, ...], Findings]:
    """Read files; the circuit if it has no errors, then all errors, and what is doubtful."""
    findings = Findings()
    with _collecting_later():
        document, problems = read()
        if document is None:
            return None, tuple(problems), findings
        module, form = read_module(document)
        graph = analyse(module, findings, is_whole=not (problems or form))
    errors = _in_order([*problems, *form, *findings.errors])
    found = None if graph is None or errors else _Sound(module, graph)
    return found, errors, findings


def _in_order(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Sort problems by the text, one for each place: the first one there caused the others."""
    by_place: dict[tuple[str, int, int, str], Problem] = {}
    for problem in problems:
        by_place.setdefault((problem.file, problem.line, problem.column, problem.where), problem)
    files = list(dict.fromkeys(problem.file for problem in by_place.values()))
    return tuple(sorted(by_place.values(), key=lambda each: (files.index(each.file), each.line, each.column)))


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
        nodes.inputs.update((node.name, node) for node in inputs(each))
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
        findings.unused.extend(_unused(graph, scope))
    return graph


def _unused(graph: CircuitGraph, scope: Scope) -> Iterator[Problem]:
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
