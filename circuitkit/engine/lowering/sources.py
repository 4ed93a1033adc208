"""In which row a target finds what it sees of a source: as it is, as it was before the step, or long ago."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from circuitkit.engine.lowering.cells import Block
from circuitkit.engine.lowering.delays import delay_steps
from circuitkit.engine.lowering.maps import copy_rows
from circuitkit.engine.lowering.plan import Plan
from circuitkit.engine.operations import Operation, Recall, Remember

Part = Literal["before", "substep", "after"]


@dataclass(eq=False)
class _Memory:
    """Values of the past of one population, or of any number of single rows, at one of the two rates."""

    number: int
    part: Part
    slots: dict[int, int] = field(default_factory=dict)  # first slot by first row
    sources: list[int] = field(default_factory=list)
    depth: int = 0

    def slot(self, row: int, count: int) -> int:
        """Return first of the slots of these rows."""
        if row not in self.slots:
            self.slots[row] = len(self.sources)
            self.sources.extend(range(row, row + count))
        return self.slots[row]


@dataclass(frozen=True)
class _Request:
    memory: _Memory
    row: int
    count: int
    slot: int
    steps: int


class Sources:
    """Finds rows, and collects the copies and memories that this takes."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._held: dict[int, tuple[int, int]] = {}
        self._memories: dict[tuple[Part, int], _Memory] = {}
        self._requests: dict[Part, list[_Request]] = {"before": [], "substep": [], "after": []}
        self._recalled: dict[tuple[Part, int, int, int], int] = {}

    def row(self, name: str, target: Block, delay_s: float = 0.0) -> int:
        """Give row of what a block sees of an input, neuron or member; of the first member for a population.

        Without a delay: of an input, this step's; of a discrete neuron, what the timing says, or this step's
        if the target is continuous; of a continuous neuron, that at the end of the last step or substep. With
        a delay of D steps: what stood there D steps before; under the timing `ordered`, the output of D steps
        ago.
        """
        plan = self._plan
        to_continuous = target.node.model.continuous
        if name in plan.inputs:
            row, count, lag, fine = plan.inputs[name], 1, 0, False
        else:
            source, member = plan.find(name)
            fine = source.node.model.continuous and to_continuous
            row = (source.momentary if fine else source.output) + member
            count = source.size if name == source.node.name else 1
            lag = 1
            if not source.node.model.continuous and (to_continuous or plan.graph.timing == "ordered"):
                lag = 0
        steps = delay_steps(delay_s, plan.dt if fine else plan.graph.step_s)
        if steps > 0:
            return self._past("substep" if fine else "before", row, count, steps + lag)
        if name not in plan.inputs and (source.node.name, target.node.name) in plan.order.held:
            return self.held(source.output, source.size) + member
        return row

    def newest(self, name: str, delay_s: float = 0.0) -> int:
        """Return row of an output at the end of a control step, or of what it was there so long ago."""
        plan = self._plan
        steps = delay_steps(delay_s, plan.graph.step_s)
        if name in plan.inputs:
            row, count = plan.inputs[name], 1
        else:
            source, member = plan.find(name)
            row, count = source.output + member, source.size if name == source.node.name else 1
        return self._past("after", row, count, steps) if steps > 0 else row

    def held(self, row: int, count: int) -> int:
        """Return first of the rows that keep what these rows were at the beginning of the control step."""
        if row not in self._held:
            self._held[row] = (self._plan.table.take(count), count)
        return self._held[row][0]

    def _past(self, part: Part, row: int, count: int, steps: int) -> int:
        """Find the first of the rows that get what these rows were so many times ago."""
        if (part, row, count, steps) not in self._recalled:
            rate: Part = "substep" if part == "substep" else "after"
            key = (rate, row if count > 1 else 0)
            memory = self._memories.setdefault(key, _Memory(len(self._memories), rate))
            memory.depth = max(memory.depth, steps)
            start = self._plan.table.take(count)
            self._requests[part].append(_Request(memory, start, count, memory.slot(row, count), steps))
            self._recalled[part, row, count, steps] = start
        return self._recalled[part, row, count, steps]

    def copies(self) -> Iterator[Operation]:
        """Find what fills the rows that `held` has given."""
        for row, (target, count) in self._held.items():
            yield copy_rows(count, row, target)

    def recalls(self, part: Part) -> Iterator[Operation]:
        """Find what fills the rows of delayed values that are read in a part of the control step."""
        runs: list[list[_Request]] = []
        for request in self._requests[part]:
            last = runs[-1][-1] if runs else None
            if last and last.memory is request.memory and last.row + last.count == request.row:
                runs[-1].append(request)
            else:
                runs.append([request])
        for run in runs:
            slots = np.concatenate([np.arange(each.slot, each.slot + each.count) for each in run])
            steps = np.repeat([each.steps for each in run], [each.count for each in run])
            start = run[0].row
            yield Recall(
                run[0].memory.number,
                start,
                start + len(slots),
                slots.astype(np.int32),
                steps.astype(np.int32),
            )

    def remembers(self, part: Part) -> Iterator[Operation]:
        """Find what keeps the values for later, at the end of the substep or of the control step."""
        for memory in self._memories.values():
            if memory.part == part:
                yield Remember(memory.number, np.array(memory.sources, dtype=np.int32), memory.depth)
