"""What a dense kernel computes on: blocks of a batch, and how activations are got back from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from circuitkit.engine.backends.dense_plan import Layout
from circuitkit.engine.operations import FloatArray
from circuitkit.engine.program import Program


class Block:
    """The numbers of some members of a batch, in arrays of their own.

    Attributes:
        members: Which.
        numbers: By places, shape (count, members).
        arguments: For every stage x of its elements, shape (n_elements, members).
        products: Where the products go: the arguments, or what these are in the next step.
    """

    def __init__(
        self,
        members: slice,
        layout: Layout,
        matrices: Sequence[FloatArray],
        number: np.dtype[Any],
        *,
        outputs_first: bool,
    ) -> None:
        """Make the arrays.

        Args:
            members: Which members of the batch.
            layout: What stands where.
            matrices: For every stage G of x = G s.
            number: The type of the numbers.
            outputs_first: Whether outputs follow from the arguments of the last step.
        """
        size = members.stop - members.start
        self.members = members
        self.numbers: FloatArray = np.zeros((layout.count, size), dtype=number)
        self.numbers[0] = 1.0
        self.arguments: list[FloatArray] = [np.zeros((len(each), size), dtype=number) for each in matrices]
        self.products = [x.copy() for x in self.arguments] if outputs_first else self.arguments


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
        self._all: list[tuple[list[int], FloatArray, FloatArray]] = []
        column = {row: i for i, row in enumerate(program.activation_rows.tolist())}
        for elements in layout.elements:
            best: dict[int, int] = {}
            for i, element in enumerate(elements):
                if element.row not in best or abs(element.gain) > abs(elements[best[element.row]].gain):
                    best[element.row] = i
            columns, rows = [column[row] for row in best], list(best.values())
            signs = np.array([[sigmoid if each.function == "sigmoid" else 1.0] for each in elements])
            gains = signs * np.array([[each.gain] for each in elements])
            constants = signs * np.array([[each.constant] for each in elements])
            self._parts.append((columns, rows, gains[rows], constants[rows]))
            self._all.append(([column[each.row] for each in elements], gains, constants))

    def load(self, arguments: Sequence[FloatArray], activation: FloatArray) -> None:
        """Take over activations of shape (members, n_neurons)."""
        with np.errstate(over="ignore"):  # of x; the activations themselves are finite
            for x, (columns, gains, constants) in zip(arguments, self._all, strict=True):
                x[: len(columns)] = gains * activation[:, columns].T + constants

    def store(self, arguments: Sequence[FloatArray], activation: FloatArray) -> None:
        """Write the activations into an array of shape (members, n_neurons)."""
        for x, (columns, rows, gains, constants) in zip(arguments, self._parts, strict=True):
            activation[:, columns] = ((x[rows] - constants) / gains).T
