"""Compiled backend: the program as C, built by the system's compiler; numpy where that is not possible."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from circuitkit.engine.backends.c.build import BuildError, unavailable

if TYPE_CHECKING:
    from circuitkit.engine.backends import Kernel
    from circuitkit.engine.program import Program

__all__ = ["make_kernel", "prepare", "unavailable"]
_LOG = logging.getLogger("circuitkit")


def make_kernel(program: Program, batch: int) -> Kernel:
    """A kernel for B = `batch` copies of the circuit; numpy's, with a warning, if none can be built."""
    from circuitkit.engine.backends.c.kernel import CompiledKernel
    from circuitkit.engine.backends.numpy_backend import NumpyKernel

    try:
        return CompiledKernel(program, batch)
    except BuildError as error:
        _LOG.warning("%s; the circuit '%s' is run by the numpy backend", error, program.name)
        return NumpyKernel(program, batch)


def prepare(program: Program) -> str:
    """Compile a program for one circuit, or for the members of a sweep, or find it in the cache.

    Returns:
        Why it is not possible; empty if it is.
    """
    from circuitkit.engine.backends.c.build import load_program, load_runtime
    from circuitkit.engine.backends.c.source import print_program

    try:
        load_runtime()
        load_program(print_program(program, program.members or 1).text)
    except BuildError as error:
        return str(error)
    return ""
