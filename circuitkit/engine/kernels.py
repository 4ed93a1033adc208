"""Kernels for programs: made by the program's backend, and lent to calls of `step` and `run`."""

from __future__ import annotations

from dataclasses import replace

from circuitkit.engine.backends import AUTO, COMPILED, compiled_backend, load_backend
from circuitkit.engine.backends.kernel import Kernel
from circuitkit.engine.program import Program

_MOST_IDLE_SIZES = 8


def new_kernel(program: Program, batch: int) -> Kernel:
    """Make a kernel of the program's backend for B = `batch` copies; its state is zero."""
    return load_backend(program.backend)(program, batch)


def borrow_kernel(program: Program, batch: int) -> Kernel:
    """Take a kernel that nobody else uses until `return_kernel`; its state is undefined."""
    try:
        kernel: Kernel = program.idle.setdefault(batch, []).pop()
    except IndexError:
        return new_kernel(program, batch)
    return kernel


def return_kernel(program: Program, kernel: Kernel) -> None:
    """Keep a kernel for the next caller with the same program and batch size."""
    if len(program.idle) > _MOST_IDLE_SIZES:
        program.idle.clear()
    program.idle.setdefault(kernel.batch, []).append(kernel)


def with_chosen_backend(program: Program) -> Program:
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
