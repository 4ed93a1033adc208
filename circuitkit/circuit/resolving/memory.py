"""What a circuit needs of memory, estimated before anything is allocated."""

from __future__ import annotations

from dataclasses import dataclass

from circuitkit.circuit.memory import shortage

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
