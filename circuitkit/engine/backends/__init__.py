"""Execution backends: each module here named `NAME_backend` makes kernels, which do a program's arithmetic.

A new backend is a new module with a function `make_kernel(program, batch)`; calls of `step` and `run` borrow
kernels and return them.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from circuitkit.base.errors import UnknownNameError
from circuitkit.engine.operations import FloatArray, IndexArray
from circuitkit.engine.program import Program
from circuitkit.engine.state import State

AUTO = "auto"
COMPILED = "compiled"
_SUFFIX = "_backend"
BACKEND_NAMES: tuple[str, ...] = tuple(
    sorted(path.stem.removesuffix(_SUFFIX) for path in Path(__file__).parent.glob(f"*{_SUFFIX}.py"))
)
_MOST_IDLE_SIZES = 8


class Kernel(Protocol):
    """A program bound to arrays for one batch size; not to be shared between threads.

    Attributes:
        batch: Number of copies B of the circuit.
        inputs: Where the inputs of the next step are written, shape (B, n_inputs), [SI].
        readout: Outputs of the circuit after the last step, a read-only view of shape (B, n_outputs), [SI].
        bind_step: May be there: `bind_step(take, fail)` gives one function `step(inputs=None)` that does all
            that `Stepper.step` does, or None; `take` puts inputs in their place, `fail` raises.
        advance: Does one control step with what stands in `inputs`; says whether all is finite: the inputs,
            and all rows that survive the step.
    """

    batch: int
    inputs: FloatArray
    readout: FloatArray
    advance: Callable[[], bool]

    def load(self, state: State) -> None:
        """Take over a state."""

    def store(self, state: State) -> None:
        """Write the state into the arrays of another one."""

    def store_output(self, output: FloatArray) -> None:
        """Write the neurons' outputs alone into an array of shape (B, n_neurons)."""

    def run(self, inputs: FloatArray, rows: IndexArray, record: FloatArray) -> int:
        """Do T control steps and record rows of the table.

        Args:
            inputs: Shape (T, B, n_inputs), contiguous, [SI].
            rows: Which rows to record: activations, outputs, outputs of the circuit or states, shape (R,).
            record: Takes them as they are after each step, shape (T, B, R), contiguous.

        Returns:
            T, or the first step, from 0, after which something was not finite; the kernel is then left as it
            was after that step.
        """


class KernelMaker(Protocol):
    """Makes kernels; what a backend module must have under the name `make_kernel`."""

    def __call__(self, program: Program, batch: int) -> Kernel:
        """Return a kernel, whose state is yet to be loaded, for B = `batch` copies."""


@lru_cache
def load_backend(name: str) -> KernelMaker:
    """Load the kernel maker of a backend.

    Raises:
        UnknownNameError: There is no backend of this name; the message lists those there are.
    """
    if name not in BACKEND_NAMES:
        kind = "backend"
        raise UnknownNameError(kind, name, (AUTO, *BACKEND_NAMES))
    module = importlib.import_module(f"{__name__}.{name}{_SUFFIX}")
    make_kernel: KernelMaker = module.make_kernel
    return make_kernel


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
