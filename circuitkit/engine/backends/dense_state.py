"""What a dense kernel computes on: blocks of a batch, and how activations are got back from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from circuitkit.engine.backends.dense_plan import Layout
from circuitkit.engine.program import Program
from circuitkit.engine.state import FloatArray


class Block:
    """The numbers of some members of a batch, in arrays of their own.

    Attributes:
        members: Which.
        numbers: By places, shape (count, members).
        arguments: For every stage x of its elements, shape (n_elements, members).
    """

    def __init__(
        self, members: slice, layout: Layout, products: Sequence[FloatArray], number: np.dtype[Any]
    ) -> None:
        size = members.stop - members.start
        self.members = members
        self.numbers: FloatArray = np.zeros((layout.count, size), dtype=number)
        self.numbers[0] = 1.0
        self.arguments: list[FloatArray] = [np.zeros((len(each), size), dtype=number) for each in products]


class Activations:
    """Works out A from x = gain A + constant, by the element of each neuron with the largest gain."""

    def __init__(self, program: Program, layout: Layout, sigmoid: float) -> None:
        """Look for the elements.

        Args:
            program: The compiled circuit.
            layout: Its layout.
            sigmoid: Sign of the arguments of sigmoids.
        """
        self._parts: list[tuple[list[int], list[int], FloatArray, FloatArray]] = []
        column = {row: i for i, row in enumerate(program.activation_rows.tolist())}
        for elements in layout.elements:
            best: dict[int, int] = {}
            for i, element in enumerate(elements):
                if element.row not in best or abs(element.gain) > abs(elements[best[element.row]].gain):
                    best[element.row] = i
            columns, rows = [column[row] for row in best], list(best.values())
            signs = np.array([sigmoid if elements[i].function == "sigmoid" else 1.0 for i in rows])
            gains = (signs * [elements[i].gain for i in rows])[:, np.newaxis]
            constants = (signs * [elements[i].constant for i in rows])[:, np.newaxis]
            self._parts.append((columns, rows, gains, constants))

    def store(self, arguments: Sequence[FloatArray], activation: FloatArray) -> None:
        """Write the activations into an array of shape (members, n_neurons)."""
        for x, (columns, rows, gains, constants) in zip(arguments, self._parts, strict=True):
            activation[:, columns] = ((x[rows] - constants) / gains).T
