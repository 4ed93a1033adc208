"""What the machine has of memory, and what to say of something that needs more."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

_UNKNOWN = 16 * 2**30  # where the system does not say: what a common laptop has
_LIMIT_OF_GROUP = Path("/sys/fs/cgroup/memory.max")


def machine_bytes() -> int:
    """Return memory of this machine, or of the group of processes that this one is confined to."""
    total = _UNKNOWN
    with suppress(AttributeError, ValueError, OSError):
        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    with suppress(OSError, ValueError):
        total = min(total, int(_LIMIT_OF_GROUP.read_text(encoding="utf-8")))
    return total


def shortage(what: str, needed: float, rest: float = 0.0) -> str:
    """Return the complaint about something that does not fit into memory; empty if it does.

    Args:
        what: What was found, such as "5 neurons".
        needed: What it needs, [bytes].
        rest: What the rest of the circuit needs, [bytes].
    """
    has = machine_bytes()
    if needed + rest <= has:
        return ""
    beside = f" (with the rest of the circuit {_size(needed + rest)})" if rest else ""
    needs = f"about {_size(needed)} of memory{beside}, but this machine has {_size(has)}"
    return f"found {what}, which need {needs}; allowed: fewer"


def _size(bytes_needed: float) -> str:
    return f"{bytes_needed / 1e9:.3g} GB"
