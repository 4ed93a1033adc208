"""What a program does in a control step, as a short list of operations on one table of numbers.

The table has rows and, as its second axis, the batch: shape (n_rows, B). Row 0 is always zero, the inputs
follow. Activations, outputs, states, delayed outputs, intermediate values and the circuit's outputs are
further rows; which are which is written down in `Program`. Operations run one after the other, each from the
values that the ones before it left. All backends do just these operations; the order of additions is part of
their meaning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Expression

FloatArray: TypeAlias = npt.NDArray[np.float64]
IndexArray: TypeAlias = npt.NDArray[np.int32]
PointerArray: TypeAlias = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sum:
    """Weighted sums (eq. 11): `row[start + i] = sum_k weights[k] * row[base + sources[k]]`.

    k runs from indptr[i] to indptr[i + 1] - 1, and the terms are added in this order, to zero or to the row.

    Attributes:
        start: First row that is written.
        stop: The row after the last one.
        indptr: Where the terms of each sum begin, shape (stop - start + 1,).
        sources: Row of every term less `base`, shape (n_terms,); never one of the rows that are written.
        weights: Weight of every term, shape (n_terms,), () for one weight for all, or (n_terms, B) for one of
            each member of the batch; [SI].
        add: Whether the terms are added to what stands in the row, instead of replacing it.
        base: Row to which the sources are counted: a projection's own array of sources serves as it is.
    """

    start: int
    stop: int
    indptr: PointerArray
    sources: IndexArray
    weights: FloatArray
    add: bool = False
    base: int = 0


@dataclass(frozen=True, eq=False)
class Map:
    """Expressions evaluated side by side: for every i < count and result, `row[target + i] = expression`.

    All results are of the values before the operation: it reads everything for an i before it writes for that
    i, and no i reads what another one writes.

    Attributes:
        count: How many.
        results: Pairs of the first row that is written and the expression that is written there.
        rows: First of the rows that a name in the expressions stands for: name i is in row `rows[name] + i`.
        picks: Rows that a name stands for, where they are no neighbours, shape (count,).
        constants: Values that a name stands for, shape (count,), () or (count, B), [SI].
    """

    count: int
    results: tuple[tuple[int, Expression], ...]
    rows: Mapping[str, int] = field(default_factory=dict)
    picks: Mapping[str, IndexArray] = field(default_factory=dict)
    constants: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Noise:
    """Adds Gaussian noise: `row[start + i] += scale[i] * normal(seed, streams[i], time)`; see `noise`.

    The number drawn depends on the seed of the member of the batch, the stream and the time alone: not on the
    batch, its order, or the backend. `time` counts control steps, or substeps if it stands in the substeps.

    Attributes:
        start: First row.
        stop: The row after the last one.
        scale: Standard deviation, shape (stop - start,), (), or (stop - start, B), [SI].
        streams: Number of every row's stream, shape (stop - start,); no two rows of a program share one.
    """

    start: int
    stop: int
    scale: FloatArray
    streams: IndexArray


@dataclass(frozen=True, eq=False)
class Recall:
    """Delayed values: `row[start + i] = ` what row `sources[i]` was when `Remember` ran `steps[i]` times ago.

    steps[i] is from 1 to the depth of the memory; before so many have passed it is the row's initial value.

    Attributes:
        memory: Number of the memory.
        start: First row that is written.
        stop: The row after the last one.
        slots: Place of every source in the memory, shape (stop - start,).
        steps: Age, shape (stop - start,).
    """

    memory: int
    start: int
    stop: int
    slots: IndexArray
    steps: IndexArray


@dataclass(frozen=True, eq=False)
class Remember:
    """Puts the present values of rows into a memory, a ring of the last `depth` values of each.

    Attributes:
        memory: Number of the memory; each has one `Remember`.
        sources: Rows, shape (n_slots,).
        depth: How many values are kept.
    """

    memory: int
    sources: IndexArray
    depth: int


Operation: TypeAlias = Sum | Map | Noise | Recall | Remember


@dataclass(frozen=True, eq=False, kw_only=True)
class Lowered:
    """A circuit as rows and operations.

    Attributes:
        n_rows: Rows of the table, row 0 (always zero) included.
        before: Operations at the beginning of a control step.
        substep: Operations of a substep.
        after: Operations at the end of a control step.
        initial: Every row at the start, shape (n_rows,), or (n_rows, B) in a sweep, [SI].
        activation_rows: Row of the activation of every neuron, shape (n_neurons,).
        output_rows: Row of the output of every neuron, shape (n_neurons,).
        readout_rows: First row of the outputs of the circuit and the row after the last one.
        state_rows: Every other row that must survive a control step, shape (n_states,). All rows that are in
            none of these four and are no inputs are written before they are read, in every control step.
        state_names: What is in the state rows, shape (n_states,).
        population_columns: Columns of the members of every population.
    """

    n_rows: int
    before: tuple[Operation, ...]
    substep: tuple[Operation, ...]
    after: tuple[Operation, ...]
    initial: FloatArray
    activation_rows: IndexArray
    output_rows: IndexArray
    readout_rows: tuple[int, int]
    state_rows: IndexArray
    state_names: Sequence[str]
    population_columns: Mapping[str, range] = field(default_factory=dict)
