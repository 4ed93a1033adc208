"""Execution backends: each module here named `NAME_backend` makes kernels, which do a program's arithmetic.

A new backend is a new module with a function `make_kernel(program, batch)`.
"""

from __future__ import annotations

import importlib
from functools import lru_cache
from pathlib import Path

from circuitkit.base.errors import UnknownNameError
from circuitkit.engine.backends.kernel import KernelMaker

AUTO = "auto"
COMPILED = "compiled"
_SUFFIX = "_backend"
BACKEND_NAMES: tuple[str, ...] = tuple(
    sorted(path.stem.removesuffix(_SUFFIX) for path in Path(__file__).parent.glob(f"*{_SUFFIX}.py"))
)


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
