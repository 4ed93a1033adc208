"""Compiled backend: the program as C, built by the system's compiler; numpy where that is not possible."""

from __future__ import annotations

import logging

from circuitkit.base.errors import CircuitkitError
from circuitkit.engine.backends.c.build import BuildError, unavailable
from circuitkit.engine.backends.c.kernel import CompiledKernel
from circuitkit.engine.backends.kernel import Kernel
from circuitkit.engine.backends.numpy_backend import NumpyKernel
from circuitkit.engine.program import Program

__all__ = ["build_kernel", "make_kernel", "unavailable", "warn"]
_LOG = logging.getLogger("circuitkit")


def make_kernel(program: Program, batch: int) -> Kernel:
    """Make a kernel for B = `batch` copies of the circuit; numpy's, with a warning, if none can be built."""
    kernel = build_kernel(program, batch)
    if isinstance(kernel, str):
        warn(kernel, program)
        return NumpyKernel(program, batch)
    return kernel


def build_kernel(program: Program, batch: int) -> CompiledKernel | str:
    """Compile a kernel for B = `batch` copies, or find it in the cache; if that is not possible, say why."""
    try:
        return CompiledKernel(program, batch)
    except (CircuitkitError, MemoryError):
        raise
    except Exception as error:
        return _reason(error)


def warn(problem: str, program: Program) -> None:
    """Say that numpy runs a program for which the compiled backend was asked, and why."""
    _LOG.warning("%s; the circuit '%s' is run by the numpy backend", problem, program.name)


def _reason(error: Exception) -> str:
    """Say what went wrong; a mistake in the making of the C must not keep a circuit from running either."""
    if isinstance(error, BuildError):
        return str(error)
    return f"internal error of the compiled backend, {type(error).__name__}: {error}"
