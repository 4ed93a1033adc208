"""Entries of `synapses` to `Synapse`: endpoints, weights with unit and sign, parameters, delays and gates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Quantity, Unit, format_quantity, parse_unit
from circuitkit.circuit.expressions.expression import Number
from circuitkit.circuit.expressions.symbolic import constant, derivative, simplify, substitute
from circuitkit.circuit.expressions.values import Amount
from circuitkit.circuit.graph import Synapse, SynapseKind
from circuitkit.circuit.models import SynapseModel
from circuitkit.circuit.models.model import INPUT, PRE, SPIKE
from circuitkit.circuit.resolving.declarations import Item
from circuitkit.circuit.resolving.declared_models import (
    DeclaredModels,
    check_order,
    reader,
    written_parameters,
)
from circuitkit.circuit.resolving.header import Header
from circuitkit.circuit.resolving.nodes import Endpoint, Nodes, in_unit, shown_unit, start
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.resolving.signals import Signals, Term
from circuitkit.circuit.spec import SynapseSpec

_SECOND, _MILLISECOND = parse_unit("s"), parse_unit("ms")
_LONGEST_DELAY_S = 3600.0
_FAR_FROM_WHOLE = 0.01  # part of a delay that rounding may change without a warning
_SOURCES, _TARGETS = ("input", "neuron", "member"), ("neuron", "member")
_SIDES = {"pre": "source", "post": "target"}


class Synapses:
    """The single synapses of a circuit, in the order of the files; each connects two nodes once."""

    def __init__(self, nodes: Nodes, signals: Signals, header: Header | None) -> None:
        self.nodes = nodes
        self.signals = signals
        self.header = header
        self.first: dict[tuple[str, ...], tuple[Item[SynapseSpec], Scope]] = {}
        self.found: dict[tuple[object, ...], Synapse] = {}

    def add(self, scope: Scope, models: DeclaredModels) -> None:
        """Add the synapses that a scope declares, as far as they are sound."""
        for item in scope.synapses():
            model = models.synapse(item)
            source = source_end(scope, item, self.nodes, self.signals, _SOURCES, "an input or a neuron")
            gate = "" if model is None else gate_name(scope, item, model, self.nodes)
            targets = list(self._targets(scope, item, gate))
            if model is not None:
                wiring = _Wiring(scope, item, model, gate, self.header)
                for synapse in wiring.synapses(source, targets):
                    self._keep(synapse)

    def _targets(self, scope: Scope, item: Item[SynapseSpec], gate: str) -> Iterator[Endpoint]:
        spec = item.spec
        source = scope.locate(spec.source)
        source_name = source.name if source else spec.source
        for place, target in _target_places(item):
            located = scope.find(item, place, target, _TARGETS, "target", "a neuron")
            if located is None:
                continue
            key = (source_name, located.name, spec.model, gate)
            if key in self.first:
                where = self.first[key][0].seen_from(item.part)
                message = (
                    f"duplicate synapse {spec.source} -> {target}, first {where}; allowed: each one once"
                )
                scope.errors.append(item.problem(place, message))
                continue
            self.first[key] = (item, scope)
            if (end := self.nodes.located(scope, item, place, located)) is not None:
                yield end

    def _keep(self, synapse: Synapse) -> None:
        """Add a synapse; two that instances' inputs lead between the same nodes become one."""
        key = (
            synapse.source,
            synapse.target,
            synapse.model.name,
            synapse.gate,
            synapse.delay_s,
            synapse.kind,
        )
        if (other := self.found.get(key)) is not None:
            synapse = replace(other, weight=other.weight + synapse.weight)
        self.found[key] = synapse


def source_end(
    scope: Scope,
    item: Item[Any],
    nodes: Nodes,
    signals: Signals,
    kinds: Sequence[str],
    allowed: str,
) -> tuple[Endpoint, Sequence[Term]] | None:
    """Return the end that an entry names as its source, and the weighted sum of nodes that it stands for.

    That is the node itself, unless it is an input of an instance that is fed by others.
    """
    located = scope.find(item, ("from",), item.spec.source, kinds, "source", allowed)
    if located is None:
        return None
    if located.kind == "input":
        return signals.input(located)
    end = nodes.located(scope, item, ("from",), located)
    return None if end is None else (end, (Term(end, 1.0),))


def _target_places(item: Item[SynapseSpec]) -> Iterator[tuple[Place, str]]:
    """Yield the targets of a synapse with their places: one name, or the names of a list."""
    targets = item.spec.to
    is_list = len(targets) > 1 or (*item.place, "to", 0) in item.part.document.marks
    for number, target in enumerate(targets):
        yield ("to", number) if is_list else ("to",), target


def gate_name(scope: Scope, item: Item[Any], model: SynapseModel, nodes: Nodes) -> str:
    """Return the neuron that an entry names as its gate, by its name in the whole circuit; empty for none."""
    gate = item.spec.gate
    if gate is None:
        if model.gated:
            message = f"missing key 'gate'; the model {model.name} needs a neuron as gate"
            scope.errors.append(item.problem((), message, at_key=True))
        return ""
    if not model.gated:
        message = (
            f"found a gate, but the model {model.name} has none; allowed: no key 'gate', or another model"
        )
        scope.errors.append(item.problem(("gate",), message, at_key=True))
        return ""
    located = scope.find(item, ("gate",), gate, _TARGETS, "gate", "a neuron")
    end = nodes.located(scope, item, ("gate",), located) if located else None
    return end.name if end else ""


class _Wiring:
    """One entry's synapses: everything about it that does not depend on which of its synapses it is."""

    def __init__(
        self,
        scope: Scope,
        item: Item[SynapseSpec],
        model: SynapseModel,
        gate: str,
        header: Header | None,
    ) -> None:
        self.scope, self.item, self.model, self.gate, self.header = scope, item, model, gate, header

    def synapses(
        self, source: tuple[Endpoint, Sequence[Term]] | None, targets: Sequence[Endpoint]
    ) -> Iterator[Synapse]:
        """Yield the synapses; complains about units and signs once."""
        scope, item, model = self.scope, self.item, self.model
        weight = scope.value(item, ("weight",), item.spec.weight)
        parameters = written_parameters(scope, item, model, reader(scope, item))
        delay = delay_s(scope, item)
        if weight is None or source is None:
            return
        end, terms = source
        for target in targets:
            if not check_reads(scope, item, model, end, target):
                return
            if not weight_fits(scope, item, model, Amount(weight.value_si, weight.unit), end, target):
                return
            check_parameters(scope, item, model, parameters, weight.unit, end, target)
        warn_of_delay(scope, item, delay, end, targets, self.header)
        warn_of_rate(scope, item, model, end)
        kind: SynapseKind = item.spec.kind or end.role or "sensorial"
        _check_weight(scope, item, model, weight, kind, end)
        if len(terms) != 1 or terms[0].factor != 1.0:
            check_linear(scope, item, model, end)
        values: dict[str, Any] = {**model.defaults, **{name: each.value for name, each in parameters.items()}}
        origin = item.origin
        for target in targets:
            for term in terms:
                through = term.endpoint.name != end.name or term.factor != 1.0
                scaled = weight.value_si * term.factor
                yield Synapse(
                    source=term.endpoint.name,
                    target=target.name,
                    weight=scaled,
                    kind="sensorial" if through else kind,
                    model=model,
                    parameters=values,
                    initial=start(model, {**values, "weight": scaled}) if model.states else {},
                    delay_s=delay,
                    gate=self.gate,
                    weight_unit=None if through else weight.unit,
                    origin=origin,
                )


def delay_s(scope: Scope, item: Item[Any]) -> float:
    """Return the delay of an entry, [s]."""
    if item.spec.delay is None:
        return 0.0
    delay = scope.value(item, ("delay",), item.spec.delay, _SECOND)
    if delay is None:
        return 0.0
    if delay.value_si < 0:
        scope.errors.append(item.problem(("delay",), f"found {delay}; allowed: 0 s or more"))
    if delay.value_si > _LONGEST_DELAY_S:
        scope.errors.append(item.problem(("delay",), f"found {delay}; allowed: up to 1 h"))
        return 0.0
    return delay.value_si


def warn_of_delay(
    scope: Scope,
    item: Item[Any],
    delay_s: float,
    source: Endpoint,
    targets: Sequence[Endpoint],
    header: Header | None,
) -> None:
    """Warn of a delay that is changed by being rounded to whole steps."""
    if not delay_s or header is None:
        return
    for target in targets:
        both = all(end.model is not None and end.model.continuous for end in (source, target))
        changed = _rounded_delay(delay_s, header.step_s / header.substeps if both else header.step_s)
        if changed:
            scope.warnings.append(item.problem(("delay",), f"found {item.spec.delay}; {changed}"))
            return


def warn_of_rate(scope: Scope, item: Item[Any], model: SynapseModel, source: Endpoint) -> None:
    """Warn of a model that jumps by what arrives, at each spike, where a source delivers in every step.

    What such a source brings grows with the number of steps in a second.
    """
    seen = frozenset[str]().union(*(new.names() for new in model.jumps.values()))
    if seen.isdisjoint((PRE, INPUT)):
        return
    if source.model is None or SPIKE not in source.model.output.names():
        message = (
            f"found {source.name}, which does not spike; {model.name} jumps by it again in every step, "
            "so that results depend on the number of substeps"
        )
        allowed = "a source that spikes, or a model without jumps, such as first_order"
        scope.warnings.append(item.problem(("from",), f"{message}; use {allowed}"))


def _rounded_delay(delay_s: float, step_s: float) -> str:
    """Find what a delay is rounded to, in words, if that changes it by more than 1 %; else empty."""
    rounded = round(delay_s / step_s) * step_s
    if abs(rounded - delay_s) <= _FAR_FROM_WHOLE * delay_s:
        return ""
    becomes, step = format_quantity(rounded, _MILLISECOND), format_quantity(step_s, _MILLISECOND)
    return f"it becomes {becomes}, a multiple of {step}"


def weight_fits(
    scope: Scope, item: Item[Any], model: SynapseModel, weight: Amount, source: Endpoint, target: Endpoint
) -> bool:
    """Check whether a weight has the dimension that its model gives it between two nodes."""
    if model.plain_source and any(source.unit.dimension):
        found = f"found {source.name} {in_unit(source.unit)}"
        message = f"{found}; allowed: sources without unit for the model {model.name}"
        scope.errors.append(item.problem(("from",), message))
        return False
    rule = model.weight.dimension(target.activation.dimension, source.unit.dimension)
    if weight.dimension == rule:
        return True
    reason = f"the activation of {target.name} is {in_unit(target.activation)}"
    reason += f" and {source.name} is {in_unit(source.unit)}"
    if any(model.weight.fixed):
        reason = f"the weight of {model.name} is in {model.weight}, and {reason}"
    unit = target.activation if rule == target.activation.dimension else rule.si_unit
    return scope.fits(item, ("weight",), weight, unit, reason)


def check_parameters(
    scope: Scope,
    item: Item[Any],
    model: SynapseModel,
    parameters: Mapping[str, Amount],
    weight: Unit,
    source: Endpoint,
    target: Endpoint,
) -> None:
    """Complain about parameters of a synapse that do not fit its endpoints and its weight."""
    for parameter in model.parameters:
        if parameter.name not in parameters:
            continue
        dimension = parameter.unit_rule.dimension(
            target.activation.dimension, source.unit.dimension, weight.dimension
        )
        activation = target.activation if parameter.unit_rule.activation else DIMENSIONLESS
        wanted = shown_unit(parameter, dimension, activation)
        if dimension == weight.dimension and parameter.unit_rule.weight:
            wanted = weight
        reason = f"{parameter.name} is in {parameter.unit_rule}"
        scope.fits(item, (parameter.name,), parameters[parameter.name], wanted, reason)
    check_order(scope, item, model, parameters)


def check_reads(
    scope: Scope, item: Item[Any], model: SynapseModel, source: Endpoint, target: Endpoint
) -> bool:
    """Check whether source and target have the states that the synapse's model reads; complains if not."""
    for name, rule in model.reads.items():
        side, _, state_name = name.partition("_")
        end, key = (source, "from") if side == "pre" else (target, "to")
        wanted = rule.dimension(target.activation.dimension, source.unit.dimension)
        states = {state.name: state for state in end.model.states} if end.model else {}
        what = f"the model {end.model.name} of {end.name}" if end.model else f"the input {end.name}"
        needed = f"the synapse model {model.name} reads the state {state_name} of its {_SIDES[side]}"
        if state_name not in states:
            message = f"{needed}, but {what} has none; allowed: a neuron whose model has it"
            scope.errors.append(item.problem((key,), message))
            return False
        found = states[state_name].unit_rule.dimension(end.activation.dimension)
        if found != wanted:
            message = f"{needed} in {wanted.si_symbol}, but {what} has it in {found.si_symbol}"
            scope.errors.append(item.problem((key,), f"{message}; allowed: the same dimension"))
            return False
    return True


def _check_weight(
    scope: Scope, item: Item[Any], model: SynapseModel, weight: Quantity, kind: SynapseKind, source: Endpoint
) -> None:
    """Complain about the sign of a weight, and doubt a weight of zero."""
    if weight.value_si == 0:
        message = "found a weight of 0; the synapse has no effect"
        scope.warnings.append(item.problem(("weight",), message))
    else:
        check_sign(scope, item, model, str(weight), (weight.value_si, weight.value_si), kind, source)


def check_sign(
    scope: Scope,
    item: Item[Any],
    model: SynapseModel,
    found: str,
    extent: tuple[float, float],
    kind: SynapseKind,
    source: Endpoint,
) -> None:
    """Complain about weights, from the smallest to the largest one, of a sign that model or role forbids."""
    lowest, highest = extent
    if model.sign == "positive" and lowest < 0:
        message = f"found {found}; allowed: a positive weight, as the model {model.name} needs"
        scope.errors.append(item.problem(("weight",), message))
    elif model.sign == "role" and (
        (kind == "excitatory" and lowest < 0) or (kind == "inhibitory" and highest > 0)
    ):
        sign, other = ("positive", "inhibitory") if kind == "excitatory" else ("negative", "excitatory")
        allowed = f"a {sign} weight, or the role {other} for {source.name}"
        message = f"found {found}, but {source.name} is {kind}; allowed: {allowed}"
        scope.errors.append(item.problem(("weight",), message))


def check_linear(scope: Scope, item: Item[Any], model: SynapseModel, source: Endpoint) -> None:
    """Complain about a weighted sum of nodes as the source of a model that takes one source as it is."""
    if not _is_linear(model):
        message = (
            f"found '{source.name}', which is fed by a weighted sum; the model {model.name} needs one source"
        )
        allowed = (
            "an input that is fed by one node, without a factor; or a static synapse to a neuron between"
        )
        scope.errors.append(item.problem(("from",), f"{message}; allowed: {allowed}"))


def _is_linear(model: SynapseModel) -> bool:
    """Check whether a factor on the source may as well stand on the weight."""
    if model.states or model.reads:
        return False
    current = model.current
    silent = constant(simplify(substitute(current, {"pre": Number(0.0)})))
    return (
        silent == 0.0
        and "pre" not in derivative(current, "pre").names()
        and "weight" not in derivative(current, "weight").names()
        and constant(simplify(substitute(current, {"weight": Number(0.0)}))) == 0.0
    )
