"""What a circuit needs of memory, estimated before anything is allocated, and what the machine has of it."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from circuitkit.base.errors import InputError, Problem

_UNKNOWN = 16 * 2**30  # where the system does not say: what a common laptop has
_LITTLE = 2**26  # bytes, which every machine has
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


def require_memory(where: str, what: str, needed: float) -> None:
    """Refuse what needs more memory than the machine has.

    Args:
        where: What the user gave.
        what: What was found there.
        needed: What it needs, [bytes].

    Raises:
        InputError: It needs more.
    """
    complaint = shortage(what, needed) if needed > _LITTLE else ""
    if complaint:
        raise InputError(Problem("", 0, 0, where, complaint))


def _size(bytes_needed: float) -> str:
    return f"{bytes_needed / 1e9:.3g} GB"


_FLOAT, _INDEX, _POINTER = 8, 4, 8
# Activation, output and noise of a neuron, and its start, each held by the program and by the state.
_ROWS_OF_NEURON = 6


@dataclass
class Budget:
    """Adds up what the populations and projections of a circuit need.

    Attributes:
        needed: So far, [bytes].
    """

    needed: float = 0.0

    def neurons(self, size: int, n_parameters: int, n_states: int) -> str:
        """Return the complaint about neurons that do not fit any more; empty if they do."""
        each = _FLOAT * (_ROWS_OF_NEURON + n_parameters + 3 * n_states)
        return self._take(size * each, f"{size} neurons")

    def synapses(self, count: float, n_arrays: int, n_targets: int) -> str:
        """Return the complaint about synapses that do not fit any more; empty if they do.

        Args:
            count: How many, perhaps only expected.
            n_arrays: How many numbers each synapse has of its own.
            n_targets: Number of targets.
        """
        bytes_needed = count * (_INDEX + _FLOAT * n_arrays) + n_targets * _POINTER
        return self._take(bytes_needed, f"{count:.0f} synapses")

    def _take(self, bytes_needed: float, what: str) -> str:
        rest = self.needed
        self.needed += bytes_needed
        return shortage(what, bytes_needed, rest)
