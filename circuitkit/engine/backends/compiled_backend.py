"""Compiled backend: the program as C, built by the system's compiler; numpy where that is not possible."""

from __future__ import annotations

import logging

from circuitkit.base.errors import CircuitkitError
from circuitkit.engine.backends.c.build import BuildError, load_program, load_runtime, unavailable
from circuitkit.engine.backends.c.kernel import CompiledKernel
from circuitkit.engine.backends.c.source import print_program
from circuitkit.engine.backends.kernel import Kernel
from circuitkit.engine.backends.numpy_backend import NumpyKernel
from circuitkit.engine.program import Program

__all__ = ["make_kernel", "prepare", "unavailable", "warn"]
_LOG = logging.getLogger("circuitkit")


def make_kernel(program: Program, batch: int) -> Kernel:
    """A kernel for B = `batch` copies of the circuit; numpy's, with a warning, if none can be built."""
    try:
        return CompiledKernel(program, batch)
    except (CircuitkitError, MemoryError):
        raise
    except Exception as error:
        warn(_reason(error), program)
        return NumpyKernel(program, batch)


def prepare(program: Program) -> str:
    """Compile a program for one circuit, or for the members of a sweep, or find it in the cache.

    Returns:
        Why it is not possible; empty if it is.
    """
    try:
        load_runtime()
        load_program(print_program(program, program.members or 1).text)
    except (CircuitkitError, MemoryError):
        raise
    except Exception as error:
        return _reason(error)
    return ""


def warn(problem: str, program: Program) -> None:
    """Say that numpy runs a program for which the compiled backend was asked, and why."""
    _LOG.warning("%s; the circuit '%s' is run by the numpy backend", problem, program.name)


def _reason(error: Exception) -> str:
    """What went wrong; a mistake in the making of the C must not keep a circuit from running either."""
    if isinstance(error, BuildError):
        return str(error)
    return f"internal error of the compiled backend, {type(error).__name__}: {error}"
