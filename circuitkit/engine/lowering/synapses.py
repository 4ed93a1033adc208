"""Synapses whose models are more than a weight: bundles of one model that are computed side by side."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from circuitkit.circuit.expressions.expression import Binary, Expression, Name, Number
from circuitkit.circuit.expressions.symbolic import substitute
from circuitkit.circuit.graph import PerMember, Projection, Synapse
from circuitkit.circuit.models import STATIC
from circuitkit.circuit.models.model import (
    GATE,
    INPUT,
    POST,
    POST_STATE,
    PRE,
    PRE_STATE,
    WEIGHT,
    SynapseModel,
)
from circuitkit.engine.lowering.arithmetic import Matrix, Term, copy_rows, make_map, matrix_sum
from circuitkit.engine.lowering.methods import System, advance
from circuitkit.engine.lowering.plan import Block, Connections, Listed, Members, Naming, Plan, StateNames
from circuitkit.engine.lowering.sources import Sources
from circuitkit.engine.operations import FloatArray, IndexArray, Map, Operation

Moment = Literal["arrival", "spike", "end"]  # spike: at the end of a substep
_WEIGHTED = Binary("*", Name(WEIGHT), Name(PRE))
_PLAIN = frozenset({_WEIGHTED, Binary("*", Name(PRE), Name(WEIGHT)), Name(INPUT)})
_ONE = np.array(1.0)
_TOTAL = "total__"


def only_weighs(model: SynapseModel) -> bool:
    """Check whether a synapse of this model is just a term of a sum: `weight * pre`."""
    return model is STATIC or (not model.states and model.current in _PLAIN)


def counts_spikes(plan: Plan, source: str) -> bool:
    """Check whether what is seen of a source at control rate is the sum of its spikes over the substeps."""
    return source not in plan.inputs and plan.find(source)[0].group.counts_spikes


class Bundle(ABC):
    """Synapses of one model, or targets for which it keeps states, with their values in neighbouring rows.

    Attributes:
        model: The equations.
        count: How many.
        states: First row of every state.
        delivered: First row of what they deliver.
        target: Where they lead, or one of the blocks of the stage where they do.
        runs_in_substeps: Whether they run with their targets in substeps.
        sees_spikes: Whether they take every spike of a substep by itself, although their targets, which are
            discrete, only see what has come of it: jumps do not add up.
    """

    def __init__(
        self,
        plan: Plan,
        sources: Sources,
        model: SynapseModel,
        count: int,
        target: Block,
        *,
        counted: bool,
    ) -> None:
        self.plan, self.sources = plan, sources
        self.model, self.count = model, count
        self.target = target
        self.runs_in_substeps = target.node.model.continuous
        self.sees_spikes = counted and bool(model.jumps) and not self.runs_in_substeps
        self._adds_up = self.sees_spikes and not model.current.names().isdisjoint((PRE, INPUT))
        self._total = 0
        self.states: dict[str, int] = {}
        self.delivered = 0

    def place(self, names: StateNames) -> None:
        """Give the states and what is delivered their rows."""
        for state in self.model.states:
            self.states[state.name] = self.plan.table.take(self.count, self.initial(state.name))
            names.add(self.states[state.name], self.count, self.naming(), state.name)
        self.delivered = self.plan.table.take(self.count)
        if self._adds_up:
            self._total = self.plan.table.take(self.count)
            names.add(self._total, self.count, self.naming(), "delivered")

    @abstractmethod
    def naming(self) -> Naming:
        """Find what they are called, such as `a -> b`."""

    @abstractmethod
    def initial(self, state: str) -> FloatArray:
        """Return start of a state, shape (count,) or ()."""

    @abstractmethod
    def constants(self) -> dict[str, FloatArray]:
        """Return parameters and weights."""

    @abstractmethod
    def rows_of(self, name: str, moment: Moment) -> IndexArray:
        """Find the rows of `pre`, `post`, `gate` or a state of source or target, shape (count,)."""

    def prepared(self, expression: Expression) -> Expression:
        """Return an expression of the model in terms of what the bundle has."""
        return expression

    def arrive(self) -> Iterator[Operation]:
        """Jumps, then what is delivered, in every step or substep."""
        if self._adds_up:
            yield copy_rows(self.count, self._total, self.delivered)
            yield make_map(self.count, [(self._total, Number(0.0))], {})
            return
        if self.model.jumps and not self.sees_spikes:
            yield self._map([(self.states[name], new) for name, new in self.model.jumps.items()], "arrival")
        yield self._map([(self.delivered, self.model.current)], "arrival")

    def spiked(self) -> Iterator[Operation]:
        """Jumps by the spikes of a substep, and what they deliver added to what those before have."""
        yield self._map([(self.states[name], new) for name, new in self.model.jumps.items()], "spike")
        if self._adds_up:
            total = Binary("+", Name(_TOTAL), self.prepared(self.model.current))
            yield self._map([(self._total, total)], "spike", {_TOTAL: self._total})

    def progress(self) -> Iterator[Operation]:
        """States advance by their derivatives: in substeps by what arrived, else by the newest outputs."""
        if self.model.derivatives:
            moment = self._moment()
            slopes = {name: self.prepared(slope) for name, slope in self.model.derivatives.items()}
            rows, picks = self._rows(list(slopes.values()), moment, self.states)
            dt = self.plan.graph.step_s if moment == "end" else self.plan.dt
            constants = self.constants()
            system = System(self.model.name, self.count, self.states, slopes, rows, picks, constants, dt)
            yield from advance(system, self.model.method, self.plan.table)

    def update(self) -> Iterator[Operation]:
        """Yield new values of states once a control step, by the newest outputs."""
        if self.model.updates:
            yield self._map([(self.states[name], new) for name, new in self.model.updates.items()], "end")

    def _moment(self) -> Moment:
        """Find by the outputs of when the states advance."""
        if self.sees_spikes:
            return "spike"
        return "arrival" if self.runs_in_substeps else "end"

    def _map(
        self,
        results: Sequence[tuple[int, Expression]],
        moment: Moment,
        own: Mapping[str, int] | None = None,
    ) -> Map:
        prepared = [(row, self.prepared(expression)) for row, expression in results]
        own = {**self.states, **(own or {})}
        rows, picks = self._rows([expression for _, expression in prepared], moment, own)
        return make_map(self.count, prepared, {**rows, **own}, self.constants(), picks)

    def _rows(
        self, expressions: Sequence[Expression], moment: Moment, own: Mapping[str, int]
    ) -> tuple[dict[str, int], dict[str, IndexArray]]:
        """Find the first row, or all rows if they are no neighbours, of names from outside the bundle."""
        rows: dict[str, int] = {}
        picks: dict[str, IndexArray] = {}
        used = frozenset[str]().union(*(expression.names() for expression in expressions))
        for name in sorted(used - own.keys() - self.constants().keys()):
            found = self.rows_of(name, moment)
            if (np.diff(found) == 1).all():
                rows[name] = int(found[0])
            else:
                picks[name] = found
        return rows, picks

    def _node_row(
        self, name: str, target: Block, source: str, gate: str, delay_s: float, moment: Moment
    ) -> int:
        """Find the first row of a name, for synapses from a source (its first member) to a target."""
        if name.startswith(PRE_STATE) and name in self.model.reads:
            block, member = self.plan.find(source)
            row = block.state(name.removeprefix(PRE_STATE))
            if moment != "end" and (block.node.name, target.node.name) in self.plan.order.held:
                row = self.sources.held(row, block.size)
            return row + member
        if name.startswith(POST_STATE) and name in self.model.reads:
            return target.state(name.removeprefix(POST_STATE))
        if name == POST:
            return target.output if moment == "end" else target.momentary
        seen, delay_s = (gate, 0.0) if name == GATE else (source, delay_s)
        if moment == "spike" and name != GATE:
            return self.sources.momentary(seen, delay_s)
        if moment != "end":
            return self.sources.row(seen, target, delay_s)
        return self.sources.newest(seen, delay_s)


class SingleSynapses(Bundle):
    """Single synapses of one model into targets of one stage."""

    def __init__(self, plan: Plan, sources: Sources, synapses: Sequence[Synapse]) -> None:
        self.synapses = synapses
        self.targets = [plan.find(synapse.target) for synapse in synapses]
        counted = counts_spikes(plan, synapses[0].source)
        super().__init__(plan, sources, synapses[0].model, len(synapses), self.targets[0][0], counted=counted)

    def naming(self) -> Naming:
        """Find what they are called."""
        return Listed(tuple(f"{synapse.source} -> {synapse.target}" for synapse in self.synapses))

    def initial(self, state: str) -> FloatArray:
        """Return start of a state."""
        return np.array([synapse.initial[state] for synapse in self.synapses])

    def constants(self) -> dict[str, FloatArray]:
        """Return parameters and weights."""
        found = {
            name: np.array([synapse.parameters[name] for synapse in self.synapses])
            for name in self.model.parameter_names
        }
        return {WEIGHT: np.array([synapse.weight for synapse in self.synapses]), **found}

    def prepared(self, expression: Expression) -> Expression:
        """With one synapse to a target, `input` is its weight times pre."""
        return substitute(expression, {INPUT: _WEIGHTED})

    def rows_of(self, name: str, moment: Moment) -> IndexArray:
        """Return the rows that a name stands for."""
        rows = [
            self._node_row(name, block, synapse.source, synapse.gate, synapse.delay_s, moment)
            + (member if name == POST or (name.startswith(POST_STATE) and name in self.model.reads) else 0)
            for synapse, (block, member) in zip(self.synapses, self.targets, strict=True)
        ]
        return np.array(rows, dtype=np.int32)

    def terms(self, rank: int) -> Iterator[Term]:
        """Find what they deliver as terms of their targets' sums, the first with this rank."""
        for i, (block, member) in enumerate(self.targets):
            yield Term(block.activation + member, rank + i, self.delivered + i, 1.0)


class ProjectedSynapses(Bundle):
    """The synapses of a projection, each with states of its own."""

    def __init__(self, plan: Plan, sources: Sources, projection: Projection) -> None:
        self.projection = projection
        target, counted = plan.blocks[projection.target], counts_spikes(plan, projection.source)
        super().__init__(plan, sources, projection.model, self._size(), target, counted=counted)

    def _size(self) -> int:
        return len(self.projection.sources)

    def naming(self) -> Naming:
        """Find what they are called."""
        p = self.projection
        return Connections(p.source, p.target, p.indptr, p.sources)

    def initial(self, state: str) -> FloatArray:
        """Return start of a state."""
        return _array(self.projection.initial[state])

    def constants(self) -> dict[str, FloatArray]:
        """Return parameters and weights."""
        found = {name: _array(value) for name, value in self.projection.parameters.items()}
        return {WEIGHT: _array(self.projection.weights), **found}

    def rows_of(self, name: str, moment: Moment) -> IndexArray:
        """Return the rows that a name stands for."""
        p = self.projection
        first = self._node_row(name, self.target, p.source, p.gate, p.delay_s, moment)
        if name == GATE:
            return np.full(self.count, first, dtype=np.int32)
        if name == PRE or name.startswith(PRE_STATE):
            return (p.sources + np.int32(first)).astype(np.int32)
        members = np.repeat(np.arange(self.target.size, dtype=np.int32), np.diff(p.indptr))
        return members + np.int32(first)

    def matrix(self) -> Matrix:
        """Find what adds up what they deliver."""
        everything = np.arange(self.count, dtype=np.int32)
        return Matrix(self.target, self.projection.indptr, everything, _ONE, self.delivered)


class ProjectedTargets(ProjectedSynapses):
    """A projection whose states are kept once for every target, which get sums of weight times pre."""

    def __init__(self, plan: Plan, sources: Sources, projection: Projection) -> None:
        super().__init__(plan, sources, projection)
        self._sums: dict[Moment, int] = {}

    def _size(self) -> int:
        return len(self.projection.indptr) - 1

    def naming(self) -> Naming:
        """Find what they are called."""
        return Members(f"{self.projection.source} -> {self.projection.target}")

    def constants(self) -> dict[str, FloatArray]:
        """Return parameters and weights."""
        return {name: _array(value) for name, value in self.projection.parameters.items()}

    def arrive(self) -> Iterator[Operation]:
        """Yield the sums, then as usual."""
        if not self.sees_spikes:
            yield self._input("arrival")
        yield from super().arrive()

    def spiked(self) -> Iterator[Operation]:
        """As usual, with sums of the spikes."""
        yield self._input("spike")
        yield from super().spiked()

    def progress(self) -> Iterator[Operation]:
        """As usual, with sums of the newest outputs at control rate."""
        if self.model.derivatives and self._moment() != "arrival":
            yield self._input(self._moment())
        yield from super().progress()

    def update(self) -> Iterator[Operation]:
        """As usual, with sums of the newest outputs."""
        if self.model.updates:
            yield self._input("end")
        yield from super().update()

    def rows_of(self, name: str, moment: Moment) -> IndexArray:
        """Return the rows that a name stands for."""
        p = self.projection
        if name == INPUT:
            first = self._sums[moment]
        else:
            first = self._node_row(name, self.target, p.source, p.gate, p.delay_s, moment)
        if name == GATE:
            return np.full(self.count, first, dtype=np.int32)
        return np.arange(first, first + self.count, dtype=np.int32)

    def matrix(self) -> Matrix:
        """Find what adds up what they deliver."""
        everything = np.arange(self.count, dtype=np.int32)
        pointers = np.arange(self.count + 1, dtype=np.int64)
        return Matrix(self.target, pointers, everything, _ONE, self.delivered)

    def _input(self, moment: Moment) -> Operation:
        if moment not in self._sums:
            self._sums[moment] = self.plan.table.take(self.count)
        p = self.projection
        base = self._node_row(PRE, self.target, p.source, p.gate, p.delay_s, moment)
        return matrix_sum(
            Matrix(self.target, p.indptr, p.sources, _array(p.weights), base), self._sums[moment]
        )


def make_bundle(plan: Plan, sources: Sources, projection: Projection) -> ProjectedSynapses:
    """Make the bundle of a projection."""
    kind = ProjectedTargets if projection.model.per == "target" else ProjectedSynapses
    return kind(plan, sources, projection)


def _array(values: PerMember) -> npt.NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64)
