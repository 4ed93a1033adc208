"""Entries of `projections` to `Projection`: which members are connected, and values for every synapse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import suggest
from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, format_quantity
from circuitkit.circuit.expressions.values import Amount, names_in
from circuitkit.circuit.graph import PerMember, Projection, SynapseKind
from circuitkit.circuit.memory import Budget
from circuitkit.circuit.models import SynapseModel
from circuitkit.circuit.resolving import connectivity
from circuitkit.circuit.resolving.connectivity import Connections
from circuitkit.circuit.resolving.declarations import Item
from circuitkit.circuit.resolving.declared_models import DeclaredModels, Reader, written_parameters
from circuitkit.circuit.resolving.header import Header
from circuitkit.circuit.resolving.matrices import MatrixFileError, read_matrix
from circuitkit.circuit.resolving.member_values import generator, listed
from circuitkit.circuit.resolving.nodes import Endpoint, Nodes, start
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.resolving.signals import Signals, Term
from circuitkit.circuit.resolving.synapses import (
    check_linear,
    check_parameters,
    check_reads,
    check_sign,
    delay_s,
    gate_name,
    source_end,
    warn_of_delay,
    warn_of_rate,
    weight_fits,
)
from circuitkit.circuit.spec import ConnectSpec, ProjectionSpec

_SOURCES = ("input", "neuron", "population")
_TARGETS = ("neuron", "population")
_CHUNK = 1 << 19  # synapses for which an expression is worked out at a time


def projections(
    scope: Scope,
    models: DeclaredModels,
    nodes: Nodes,
    signals: Signals,
    budget: Budget,
    header: Header | None,
) -> Iterator[Projection]:
    """Yield the projections that a scope declares, as far as they are sound."""
    numbers: dict[str, int] = {}
    first: dict[tuple[object, ...], Item[ProjectionSpec]] = {}
    for item in scope.projections():
        pair = f"{item.spec.source}->{item.spec.to}"
        numbers[pair] = numbers.get(pair, 0) + 1
        model = models.synapse(item)
        source = source_end(scope, item, nodes, signals, _SOURCES, "an input, a neuron or a population")
        target = _target(scope, item, nodes)
        gate = gate_name(scope, item, model, nodes) if model else ""
        if model is None or source is None or target is None:
            continue
        if not _is_first(scope, item, source[0], target, first):
            continue
        stream = f"{scope.prefix}{pair}#{numbers[pair]}"
        making = _Making(scope, item, model, source[0], target, budget, stream)
        yield from making.projections(source[1], gate, header)


def _is_first(
    scope: Scope,
    item: Item[ProjectionSpec],
    source: Endpoint,
    target: Endpoint,
    first: dict[tuple[object, ...], Item[ProjectionSpec]],
) -> bool:
    """Check whether an entry says something new; complain about one that says the same as another."""
    spec = item.spec
    rule = spec.connect if isinstance(spec.connect, str) else spec.connect.model_dump_json()
    key = (source.name, target.name, rule, spec.model, spec.gate, spec.delay)
    if key in first:
        where = first[key].seen_from(item.part)
        message = f"duplicate projection {spec.source} -> {spec.to}, first {where}; allowed: each one once"
        scope.errors.append(item.problem(("to",), message))
        return False
    first[key] = item
    return True


def _target(scope: Scope, item: Item[ProjectionSpec], nodes: Nodes) -> Endpoint | None:
    located = scope.find(item, ("to",), item.spec.to, _TARGETS, "target", "a neuron or a population")
    return nodes.located(scope, item, ("to",), located) if located else None


class _Making:
    """One entry, on its way to a projection."""

    def __init__(
        self,
        scope: Scope,
        item: Item[ProjectionSpec],
        model: SynapseModel,
        source: Endpoint,
        target: Endpoint,
        budget: Budget,
        stream: str,
    ) -> None:
        self.scope, self.item, self.model = scope, item, model
        self.source, self.target = source, target
        self.budget, self.stream = budget, stream
        self.is_loop = source.name == target.name
        self.without_self = self.is_loop and not item.spec.self_connections

    def projections(self, terms: Sequence[Term], gate: str, header: Header | None) -> Iterator[Projection]:
        """Yield the projection, or one for each node that feeds an instance's input; complains on the way."""
        scope, item, model = self.scope, self.item, self.model
        delay = delay_s(scope, item)
        warn_of_delay(scope, item, delay, self.source, [self.target], header)
        warn_of_rate(scope, item, model, self.source)
        if not check_reads(scope, item, model, self.source, self.target):
            return
        found = self._connections()
        if found is None:
            return
        connections, entries = found
        if not len(connections[1]):
            scope.warnings.append(
                item.problem(("connect",), "found no synapse; the projection has no effect")
            )
        weight = self._weight(connections, entries)
        written = written_parameters(scope, item, model, self._reader(connections))
        if weight is None or not weight_fits(scope, item, model, weight, self.source, self.target):
            return
        check_parameters(scope, item, model, written, weight.unit, self.source, self.target)
        kind: SynapseKind = item.spec.kind or self.source.role or "sensorial"
        self._check_sign(weight, kind)
        if len(terms) != 1 or terms[0].factor != 1.0:
            check_linear(scope, item, model, self.source)
        values: dict[str, PerMember] = dict(model.defaults)
        values |= {name: each.value for name, each in written.items()}
        for term in terms:
            if "[" in term.endpoint.name:
                message = f"found '{self.source.name}', which the member {term.endpoint.name} feeds"
                allowed = "inputs and neurons as the source of a projection"
                scope.errors.append(item.problem(("from",), f"{message}; allowed: {allowed}"))
                return
            through = term.endpoint.name != self.source.name or term.factor != 1.0
            weights = weight.value if term.factor == 1.0 else weight.value * term.factor
            yield Projection(
                source=term.endpoint.name,
                target=self.target.name,
                indptr=connections[0],
                sources=connections[1],
                weights=weights,
                kind="sensorial" if through else kind,
                model=model,
                parameters=values,
                initial=start(model, {**values, "weight": weights}) if model.states else {},
                delay_s=delay,
                gate=gate,
                weight_unit=None if through else weight.unit,
                origin=item.origin,
            )

    def _connections(self) -> tuple[Connections, npt.NDArray[np.float64] | None] | None:
        """Find which members are connected, and a matrix file's entries; None after complaining."""
        connect, n_source, n_target = self.item.spec.connect, self.source.size, self.target.size
        if connect == "all_to_all":
            if self._is_too_much(float(n_source) * n_target):
                return None
            return connectivity.all_to_all(n_source, n_target, without_self=self.without_self), None
        if connect == "one_to_one":
            return self._one_to_one()
        given = [key for key in ConnectSpec.model_fields if getattr(connect, key) is not None]
        if len(given) != 1 or not isinstance(connect, ConnectSpec):
            found = " and ".join(given) if given else "none of its keys"
            self._complain((), f"found {found}; allowed: one of probability, in_degree, matrix, sources")
            return None
        rules = {
            "probability": self._probability,
            "in_degree": self._in_degree,
            "matrix": self._matrix,
            "sources": self._sources,
        }
        return rules[given[0]](connect)

    def _one_to_one(self) -> tuple[Connections, None] | None:
        if self.source.size != self.target.size:
            sizes = f"{self.source.size} in {self.source.name} and {self.target.size} in {self.target.name}"
            self._complain((), f"found one_to_one between {sizes}; allowed: equal numbers")
            return None
        if self.without_self:
            self._complain(
                (), "found one_to_one of a population onto itself with self: false, which is nothing"
            )
            return None
        return connectivity.one_to_one(self.source.size), None

    def _probability(self, connect: ConnectSpec) -> tuple[Connections, None] | None:
        place = ("connect", "probability")
        chance = self.scope.value(self.item, place, connect.probability, DIMENSIONLESS, "it is a probability")
        if chance is None:
            return None
        if not 0 <= chance.value_si <= 1:
            self._complain(("probability",), f"found {chance}; allowed: from 0 to 1, or 0 % to 100 %")
            return None
        if self._is_too_much(float(self.source.size) * self.target.size * chance.value_si):
            return None
        random = generator(self.scope.findings.seed, self.stream)
        sizes = (self.source.size, self.target.size)
        return connectivity.probability(chance.value_si, *sizes, random, without_self=self.without_self), None

    def _in_degree(self, connect: ConnectSpec) -> tuple[Connections, None] | None:
        place = ("connect", "in_degree")
        degree = self.scope.value(
            self.item, place, connect.in_degree, DIMENSIONLESS, "it is a number of sources"
        )
        if degree is None:
            return None
        count, most = int(degree.value_si), self.source.size - self.without_self
        if count != degree.value_si or count < 1:
            self._complain(("in_degree",), f"found {degree}; allowed: a whole number from 1 on")
            return None
        if count > most:
            others = " other" if self.without_self else ""
            found = f"found {degree}, but {self.source.name} has only {most}{others} members"
            self._complain(("in_degree",), f"{found}; allowed: up to {most}")
            return None
        if self._is_too_much(float(count) * self.target.size):
            return None
        random = generator(self.scope.findings.seed, self.stream)
        sizes = (self.source.size, self.target.size)
        return connectivity.in_degree(count, *sizes, random, without_self=self.without_self), None

    def _matrix(self, connect: ConnectSpec) -> tuple[Connections, npt.NDArray[np.float64] | None] | None:
        path = Path(self.item.part.document.path).parent / str(connect.matrix)
        try:
            return read_matrix(path, self.target.size, self.source.size)
        except MatrixFileError as error:
            beside = (other.name for other in path.parent.glob(f"*{path.suffix}") if path.suffix)
            hint = "" if path.is_file() else suggest(path.name, sorted(beside))
            self.scope.errors.append(self.item.problem(("connect", "matrix"), str(error), hint))
        return None

    def _sources(self, connect: ConnectSpec) -> tuple[Connections, None] | None:
        rows = connect.sources or ()
        if len(rows) != self.target.size:
            found = f"found {len(rows)} lists, but {self.target.name} has {self.target.size} members"
            self._complain(("sources",), f"{found}; allowed: one for each")
            return None
        for number, row in enumerate(rows):
            ascending = all(first < second for first, second in pairwise(row))
            if row and not (ascending and row[0] >= 0 and row[-1] < self.source.size):
                allowed = f"ascending numbers from 0 to {self.source.size - 1}"
                self._complain(("sources", number), f"found {list(row)}; allowed: {allowed}")
                return None
        return connectivity.listed(rows), None

    def _is_too_much(self, expected: float) -> bool:
        """Complain about synapses that do not fit into memory."""
        spec, model = self.item.spec, self.model
        per_synapse = () if model.per == "target" else spec.values.values()
        varied = [value for value in (spec.weight, *per_synapse) if not isinstance(value, int | float)]
        n_arrays = len(varied) + (len(model.states) if model.per == "synapse" else 0)
        complaint = self.budget.synapses(expected, n_arrays, self.target.size)
        if complaint:
            self._complain((), complaint)
        return bool(complaint)

    def _complain(self, inner: Place, message: str) -> None:
        self.scope.errors.append(self.item.problem(("connect", *inner), message))

    def _weight(self, connections: Connections, entries: npt.NDArray[np.float64] | None) -> Amount | None:
        """Return the weights, [SI]: as written, times what a matrix file has; None after complaining."""
        written = self.item.spec.weight
        if written is None:
            if entries is None:
                message = "missing key 'weight'; required: from, to, connect, weight"
                self.scope.errors.append(self.item.problem((), message, at_key=True))
                return None
            return Amount(entries, DIMENSIONLESS)
        weight = self._reader(connections, per_target=False)(("weight",), written)
        if weight is None or entries is None:
            return weight
        entries *= weight.value  # in place, for there may be many
        return Amount(entries, weight.unit)

    def _reader(self, connections: Connections, *, per_target: bool | None = None) -> Reader:
        """Reads values for every synapse, or for every target where the model has them so."""
        if per_target is None:
            per_target = self.model.per == "target"

        def read(place: Place, value: object) -> Amount | None:
            count = self.target.size if per_target else len(connections[1])
            if isinstance(value, list | tuple | dict):
                stream = f"{self.stream}.{place[0]}"
                return listed(self.scope, self.item, place, value, count, stream)
            variables = {
                "n_source": Amount(float(self.source.size), DIMENSIONLESS),
                "n_target": Amount(float(self.target.size), DIMENSIONLESS),
            }
            names = names_in(value)
            if per_target:
                targets = np.arange(self.target.size, dtype=np.float64)
                return self.scope.amounts(
                    self.item, place, value, {**variables, "j": Amount(targets, DIMENSIONLESS)}
                )
            if not names & {"i", "j"}:
                return self.scope.amounts(self.item, place, value, variables)
            return self._by_synapse(place, value, variables, connections)

        return read

    def _by_synapse(
        self, place: Place, value: object, variables: Mapping[str, Amount], connections: Connections
    ) -> Amount | None:
        """Return an expression for every synapse, worked out for some rows at a time."""
        indptr, sources = connections
        numbers = np.empty(len(sources))
        unit = None
        begin = 0
        while begin < self.target.size:
            end = int(np.searchsorted(indptr, indptr[begin] + _CHUNK, side="right")) - 1
            end = min(max(end, begin + 1), self.target.size)
            first, last = indptr[begin], indptr[end]
            targets = np.repeat(np.arange(begin, end, dtype=np.float64), np.diff(indptr[begin : end + 1]))
            some = {
                **variables,
                "i": Amount(sources[first:last].astype(np.float64), DIMENSIONLESS),
                "j": Amount(targets, DIMENSIONLESS),
            }
            found = self.scope.amounts(self.item, place, value, some)
            if found is None:
                return None
            numbers[first:last] = found.value
            unit, begin = found.unit, end
        return None if unit is None else Amount(numbers, unit)

    def _check_sign(self, weight: Amount, kind: SynapseKind) -> None:
        """Complain about weights of a sign that the model or the role of the source forbids."""
        values = weight.value
        if isinstance(values, int | float):
            lowest = highest = float(values)
            found = format_quantity(lowest, weight.unit)
        elif len(values):
            lowest, highest = float(values.min()), float(values.max())
            bounds = (format_quantity(bound, weight.unit) for bound in (lowest, highest))
            found = f"weights from {' to '.join(bounds)}"
        else:
            return
        if lowest == highest == 0:
            message = "found a weight of 0; the projection has no effect"
            self.scope.warnings.append(self.item.problem(("weight",), message))
        check_sign(self.scope, self.item, self.model, found, (lowest, highest), kind, self.source)
