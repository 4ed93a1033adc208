"""In which row a target finds what it sees of a source."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from circuitkit.circuit.expression import Name
from circuitkit.engine.lowering.cells import Block
from circuitkit.engine.lowering.maps import copy_rows
from circuitkit.engine.lowering.plan import Plan
from circuitkit.engine.operations import Map, Operation


class Sources:
    """Finds rows, and collects the copies of last outputs that this takes."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._held: dict[int, tuple[int, int]] = {}

    def row(self, name: str, target: Block) -> int:
        """Row of what a block sees of an input, neuron or member; of the first member for a population."""
        if name in self._plan.inputs:
            return self._plan.inputs[name]
        source, member = self._plan.find(name)
        if target.node.model.continuous:
            return source.momentary + member
        if (source.node.name, target.node.name) in self._plan.order.held:
            return self.held(source.output, source.size) + member
        return source.output + member

    def held(self, row: int, count: int) -> int:
        """First of the rows that keep what these rows were at the beginning of the control step."""
        if row not in self._held:
            self._held[row] = (self._plan.table.take(count), count)
        return self._held[row][0]

    def copies(self) -> Iterator[Operation]:
        """What fills the rows that `held` has given."""
        singles = {row: target for row, (target, count) in self._held.items() if count == 1}
        targets = sorted(singles.values())
        if targets and targets[-1] - targets[0] == len(targets) - 1:
            rows = sorted(singles, key=singles.__getitem__)
            pick = np.array(rows, dtype=np.int32)
            yield Map(len(rows), ((targets[0], Name("x")),), picks={"x": pick})
            singles_done = True
        else:
            singles_done = False
        for row, (target, count) in self._held.items():
            if count > 1 or not singles_done:
                yield copy_rows(count, row, target)
