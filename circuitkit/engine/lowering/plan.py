"""`Plan`: the circuit while its operations are being made: its nodes, with the rows they have got."""

from __future__ import annotations

from dataclasses import dataclass

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.engine.lowering.cells import Block, Group, Table
from circuitkit.engine.lowering.order import Order


@dataclass(frozen=True, eq=False)
class Plan:
    """What all parts of the lowering know.

    Attributes:
        graph: The circuit.
        table: Hands out rows.
        inputs: Row of every input, by name.
        blocks: Neurons and populations by name.
        stages: Groups of the discrete neurons, stage after stage.
        continuous: Groups of the continuous neurons.
        order: Whose value of which step a discrete neuron sees.
        pending: What must be added to the row of an activation to get the row where its new value waits.
    """

    graph: CircuitGraph
    table: Table
    inputs: dict[str, int]
    blocks: dict[str, Block]
    stages: list[list[Group]]
    continuous: list[Group]
    order: Order
    pending: int

    @property
    def dt(self) -> float:
        """Duration of a substep, [s]."""
        return self.graph.step_s / self.graph.substeps

    def find(self, name: str) -> tuple[Block, int]:
        """Find the block of a neuron or of a member such as `ring[3]`, and its place in it."""
        block = self.blocks.get(name)
        if block is not None:
            return block, 0
        population, _, member = name.removesuffix("]").rpartition("[")
        return self.blocks[population], int(member)
