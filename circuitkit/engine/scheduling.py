"""Real-time scheduling of this thread by the operating system, where it is allowed."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

PRIORITIES = range(1, 100)  # of SCHED_FIFO on Linux
HOW_TO_ALLOW = (
    "allowed: to root, to a program with the capabilities cap_sys_nice and cap_ipc_lock, and to those with "
    "rtprio and memlock in /etc/security/limits.conf"
)
_CURRENT = 1  # MCL_CURRENT of <sys/mman.h>


@dataclass(frozen=True)
class Scheduling:
    """What the operating system granted.

    Attributes:
        priority: Of SCHED_FIFO; None if the thread is scheduled as all others are.
        is_locked: Whether the memory of the process cannot be paged out.
        refusals: What was asked for and refused, each with the reason.
    """

    priority: int | None = None
    is_locked: bool = False
    refusals: tuple[str, ...] = ()


@contextmanager
def scheduled(priority: int | None) -> Iterator[Scheduling]:
    """Let this thread go before all others for a while, and keep the memory that it has from being paged out.

    What is refused is told, and the thread goes on without it.

    Args:
        priority: Of SCHED_FIFO, from 1 to 99; None asks for nothing.
    """
    if priority is None:
        yield Scheduling()
        return
    no_fifo, no_lock = _set_fifo(priority), _lock_memory()
    try:
        refusals = tuple(text for text in (no_fifo, no_lock) if text)
        yield Scheduling(None if no_fifo else priority, not no_lock, refusals)
    finally:
        if not no_fifo:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        if not no_lock:
            ctypes.CDLL(None).munlockall()


def _set_fifo(priority: int) -> str:
    """Ask for SCHED_FIFO; returns why it is refused, or an empty text."""
    if not hasattr(os, "sched_setscheduler"):
        return "SCHED_FIFO: this system has none"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return f"SCHED_FIFO: {error.strerror}"
    return ""


def _lock_memory() -> str:
    """Ask for memory that stays; returns why it is refused, or an empty text."""
    library = ctypes.CDLL(None, use_errno=True)
    if not hasattr(library, "mlockall"):
        return "mlockall: this system has none"
    return f"mlockall: {os.strerror(ctypes.get_errno())}" if library.mlockall(_CURRENT) else ""
