"""The models that a circuit's neurons and synapses name: its files' own ones and those that are shipped."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar

from circuitkit.base.errors import InputError, listing, suggest
from circuitkit.base.source import STRAY_TEXT, Document, Place, keys_of
from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.expressions.values import Amount
from circuitkit.circuit.models import (
    NEURON_MODEL_NAMES,
    SYNAPSE_MODEL_NAMES,
    NeuronModel,
    SynapseModel,
    neuron_model,
    read_neuron_model,
    read_synapse_model,
    synapse_model,
)
from circuitkit.circuit.resolving.declarations import Item
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.spec import WithModelParameters

ModelT = TypeVar("ModelT", NeuronModel, SynapseModel)
# How the values of an entry are read: a neuron's as one number each, a population's perhaps as arrays.
Reader = Callable[[Place, object], Amount | None]


class DeclaredModels:
    """The models that the files of a scope may name."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        findings = scope.findings
        self.neurons = _own(
            scope, "neuron_models", read_neuron_model, NEURON_MODEL_NAMES, findings.neuron_models
        )
        self.synapses = _own(
            scope, "synapse_models", read_synapse_model, SYNAPSE_MODEL_NAMES, findings.synapse_models
        )

    def neuron(self, item: Item[Any]) -> NeuronModel | None:
        """Return the model that a neuron or population names, or None after complaining."""
        return self._find(item, self.neurons, NEURON_MODEL_NAMES, neuron_model)

    def synapse(self, item: Item[Any]) -> SynapseModel | None:
        """Return the model that a synapse or projection names, or None after complaining."""
        return self._find(item, self.synapses, SYNAPSE_MODEL_NAMES, synapse_model)

    def _find(
        self,
        item: Item[Any],
        own: Mapping[str, ModelT],
        shipped: Sequence[str],
        read: Callable[[str], ModelT],
    ) -> ModelT | None:
        name = item.spec.model
        if name in own:
            return own[name]
        if name in shipped:
            return read(name)
        if not self._scope.is_lost(name):
            names = (*own, *shipped)
            message = f"unknown model '{name}'; allowed: {listing(names)}"
            self._scope.errors.append(item.problem(("model",), message, suggest(name, names)))
        return None


def _own(
    scope: Scope,
    section: str,
    read: Callable[[Document, Place], ModelT],
    shipped: Sequence[str],
    all_models: dict[str, ModelT],
) -> dict[str, ModelT]:
    """Return the models that the files declare; a name stands for the same equations in the whole circuit."""
    own: dict[str, ModelT] = {}
    for part in scope.parts:
        for name in getattr(part.spec, section):
            item: Item[Any] = Item(name, part.spec, part, (section, name))
            if name in shipped:
                message = f"the name '{name}' is taken by a shipped model; allowed: a name of its own"
                scope.errors.append(item.problem((), message, at_key=True))
                continue
            try:
                model = read(part.document, (section, name))
            except InputError as error:
                scope.errors.extend(error.problems)
                scope.lost = scope.lost | {name}
                continue
            if all_models.setdefault(name, model) != model:
                message = (
                    f"the name '{name}' is taken by another model of the circuit; allowed: each name once"
                )
                scope.errors.append(item.problem((), message, at_key=True))
            own[name] = model
    return own


def reader(scope: Scope, item: Item[Any]) -> Reader:
    """Read the values of an entry as one number each."""

    def read(place: Place, value: object) -> Amount | None:
        quantity = scope.value(item, place, value)
        return None if quantity is None else Amount(quantity.value_si, quantity.unit)

    return read


def written_parameters(
    scope: Scope, item: Item[Any], model: NeuronModel | SynapseModel, read: Reader
) -> dict[str, Amount]:
    """Return the parameters of a model that an entry gives; complains about missing and unknown ones.

    Args:
        scope: Where the entry stands.
        item: The entry.
        model: Its model.
        read: How its values are read.
    """
    spec: WithModelParameters = item.spec
    if not spec.values and not model.parameters:
        return {}
    fields = keys_of(type(spec))
    names = model.parameter_names
    for key in spec.values:
        if key not in names:
            allowed = sorted((*fields, *names))
            message = f"unknown key '{key}' for the model {model.name}; allowed: {listing(allowed)}"
            hint = STRAY_TEXT if spec.values[key] is None else suggest(key, allowed)
            scope.errors.append(item.problem((key,), message, hint, at_key=True))
    found: dict[str, Amount] = {}
    for parameter in model.parameters:
        name = parameter.name
        if name in spec.values or scope.is_given(item, (name,)):
            if (value := read((name,), spec.values.get(name))) is not None:
                found[name] = value
        elif parameter.default is None:
            required = (
                *(key for key, is_required in fields.items() if is_required),
                *(each.name for each in model.parameters if each.default is None),
            )
            message = f"missing key '{name}'; required by {model.name}: {listing(required)}"
            scope.errors.append(item.problem((), message, at_key=True))
    return found


def check_order(
    scope: Scope, item: Item[Any], model: NeuronModel | SynapseModel, written: Mapping[str, Amount]
) -> None:
    """Complain about parameters that must increase and do not."""
    if not model.increasing:
        return
    ordered = [*_ordered(model, written)]
    for (smaller, low), (larger, high) in pairwise(ordered):
        if low.dimension != high.dimension or (smaller not in written and larger not in written):
            continue
        wrong = low.value >= high.value
        if not isinstance(wrong, bool):
            wrong = bool(wrong.any())
        if wrong:
            found = " and ".join(
                f"{name} {value}" if name in written else f"{name} {value} (by default)"
                for name, value in ((smaller, low), (larger, high))
            )
            place = smaller if smaller in written else larger
            message = f"found {found}; allowed: {smaller} below {larger}"
            scope.errors.append(item.problem((place,), message))


def _ordered(
    model: NeuronModel | SynapseModel, written: Mapping[str, Amount]
) -> Iterator[tuple[str, Amount]]:
    """Yield the parameters of a model that must increase, as written or by default."""
    parameters = {parameter.name: parameter for parameter in model.parameters}
    for name in model.increasing:
        parameter = parameters[name]
        if name in written:
            yield name, written[name]
        elif parameter.default is not None:
            others = (written[other].unit for other in model.increasing if other in written)
            yield name, Amount(parameter.default, parameter.unit or next(others, DIMENSIONLESS))
