"""`compile_circuit`: a circuit graph becomes a `Program`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import get_args

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine.backends import AUTO, COMPILED, compiled_backend, load_backend, return_kernel
from circuitkit.engine.lowering import in_single_precision, lower, side_by_side
from circuitkit.engine.program import Precision, Program


def compile_circuit(
    circuit: CircuitGraph | Sequence[CircuitGraph],
    backend: str = AUTO,
    precision: Precision = "float64",
    *,
    reproducible: bool = False,
) -> Program:
    """Compile a circuit, or a sweep.

    Args:
        circuit: A graph, as `load_circuit` gives it. A list of graphs that differ in numbers alone makes a
            sweep: member b of its batch is circuit b.
        backend: Name of the execution backend; "auto" takes the compiled one if it works here.
            Where that does not work, numpy does the same; if "compiled" was asked for, with a warning.
        precision: In which all is computed.
        reproducible: Whether a member of a batch must get the same bits whatever the size of the batch. The
            compiled backend gives these always; numpy then is several times slower on small circuits.

    Raises:
        InputError: There is no graph, or the circuits of a sweep do not fit together.
        UnknownNameError: There is no such backend or precision.
    """
    if backend != AUTO:
        load_backend(backend)
    if precision not in get_args(Precision):
        kind = "precision"
        raise UnknownNameError(kind, precision, get_args(Precision))
    graphs = circuit if isinstance(circuit, Sequence) else (circuit,)
    is_sweep = graphs is circuit
    graph = _require_alike(graphs)
    lowered = side_by_side([lower(each) for each in graphs]) if is_sweep else lower(graph)
    if precision == "float32":
        lowered = in_single_precision(lowered)
    program = Program(
        name=graph.name,
        step_s=graph.step_s,
        substeps=graph.substeps,
        input_names=tuple(node.name for node in graph.inputs),
        neuron_names=graph.neuron_names,
        output_names=tuple(output.name for output in graph.outputs),
        **{field.name: getattr(lowered, field.name) for field in fields(lowered)},
        members=len(graphs) if is_sweep else 0,
        backend=backend,
        precision=precision,
        reproducible=reproducible,
    )
    return _with_chosen_backend(program) if backend in {AUTO, COMPILED} else program


def _with_chosen_backend(program: Program) -> Program:
    """Choose the compiled backend if it works here, else numpy, with a warning if "compiled" was asked for.

    That it works is seen from a kernel for one circuit, or for the members of a sweep, which then waits for
    whoever steps the program first.
    """
    chosen = replace(program, backend=COMPILED, note="backend compiled: C built by the system's compiler")
    kernel = compiled_backend.build_kernel(chosen, program.members or 1)
    if isinstance(kernel, str):
        if program.backend != AUTO:
            compiled_backend.warn(kernel, program)
        return replace(program, backend="numpy", note=f"backend numpy: {kernel}")
    return_kernel(chosen, kernel)
    return chosen


def _require_alike(graphs: Sequence[CircuitGraph]) -> CircuitGraph:
    """Return the first of the circuits, whose names and times all others must have."""
    if not graphs:
        raise InputError(Problem("", 0, 0, "sweep", "found no circuit; allowed: at least one"))
    for graph in graphs:
        if not isinstance(graph, CircuitGraph):
            message = f"found {type(graph).__name__}; allowed: a CircuitGraph, such as load_circuit gives"
            raise InputError(Problem("", 0, 0, "circuit", message))
    first = graphs[0]
    for number, graph in enumerate(graphs):
        for what, found, wanted in (
            ("names", graph.names(), first.names()),
            ("control step", graph.step_s, first.step_s),
            ("number of substeps", graph.substeps, first.substeps),
        ):
            if found != wanted:
                message = f"found another {what} in circuit {number} than in circuit 0; allowed: the same"
                raise InputError(Problem("", 0, 0, "sweep", message))
    return first
