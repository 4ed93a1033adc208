"""Model declarations, of this folder or of a circuit file, to `NeuronModel` and `SynapseModel`.

Those of this folder are read when they are first asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from circuitkit.base.errors import InputError, UnknownNameError, listing
from circuitkit.base.source import Document, Place, read_yaml, shipped_file, shipped_names, validate_model
from circuitkit.base.units import Dimension, Unit
from circuitkit.circuit.expressions.dimensions import NO_DIMENSION, OpenDimension
from circuitkit.circuit.expressions.expression import Expression
from circuitkit.circuit.models.declaration import Declaration, NeuronForm, SpikeForm, SynapseForm
from circuitkit.circuit.models.model import (
    ACTIVATION,
    DT,
    GATE,
    INPUT,
    NEURON_WORDS,
    POST,
    POST_STATE,
    PRE,
    PRE_STATE,
    SPIKE,
    SYNAPSE_WORDS,
    WEIGHT,
    NeuronModel,
    Spike,
    SynapseModel,
    UnitRule,
)

_TIME = OpenDimension(Dimension(time=1))
_ACTIVATION_DIMENSION = OpenDimension(activation=1)
# Keys of neurons and synapses in a circuit file, beside which the parameters stand, and names of equations.
_KEYS = ("model", "description", "initial")
_TAKEN_BY_NEURONS = frozenset((*_KEYS, "role", "noise", "size", ACTIVATION, DT, SPIKE, *NEURON_WORDS))
_TAKEN_BY_SYNAPSES = frozenset(
    (*_KEYS, "from", "to", "delay", "connect", "self", "kind", PRE, POST, INPUT, GATE, *SYNAPSE_WORDS)
)


def read_neuron_model(document: Document, place: Place = ()) -> NeuronModel:
    """Read the neuron model declared at a place of a document; the last key of the place is its name.

    Raises:
        InputError: It is no sound declaration; carries every problem, with line and column.
    """
    form = validate_model(document, NeuronForm, place)
    declaration = Declaration(document, place, NEURON_WORDS, _TAKEN_BY_NEURONS)
    activation = _activation(declaration, form)
    declaration.dimensions |= {ACTIVATION: declaration.dimension(UnitRule("", activation=1)), DT: _TIME}
    parameters = declaration.parameters(form.parameters)
    names = tuple(form.parameters)
    states = declaration.states(form.states, names)
    own = (*names, *form.states)
    derivatives = declaration.equations(
        ("derivatives",), form.derivatives, form.states, (ACTIVATION, DT, *own)
    )
    updates = declaration.equations(("updates",), form.updates, form.states, (ACTIVATION, *own))
    spike = None if form.spike is None else _spike(declaration, form.spike, form, own)
    output = _output(declaration, form, own)
    declaration.order(form.increasing, names)
    declaration.method(form.method, derivatives, (ACTIVATION, *form.states))
    _check_kind(declaration, form)
    declaration.finish()
    return NeuronModel(
        name=declaration.name or form.model,
        description=form.description,
        source=form.source,
        parameters=parameters,
        output=output,
        increasing=form.increasing,
        states=states,
        derivatives=derivatives,
        updates=updates,
        spike=spike,
        method=form.method,
        activation=activation,
    )


def read_synapse_model(document: Document, place: Place = ()) -> SynapseModel:
    """Read the synapse model declared at a place of a document; the last key of the place is its name.

    The units of its equations should fit whatever the source's is. If they fit only where the source has
    none, as neurons have none, and its parameters and states do not speak of the source's, the model is for
    such sources.

    Raises:
        InputError: It is no sound declaration; carries every problem, with line and column.
    """
    form = validate_model(document, SynapseForm, place)
    declaration = Declaration(document, place, SYNAPSE_WORDS[:-1], _TAKEN_BY_SYNAPSES)
    try:
        return _synapse_model(declaration, form)
    except InputError:
        parameters, states = form.parameters.values(), form.states.values()
        if any("source" in unit for unit in (*(p.unit for p in parameters), *(s.unit for s in states))):
            raise
        declaration = replace(declaration, plain_source=True, dimensions={}, problems=[])
        return _synapse_model(declaration, form)


def _synapse_model(declaration: Declaration, form: SynapseForm) -> SynapseModel:
    weight, _ = declaration.rule(("weight",), form.weight)
    declaration = replace(declaration, weight=declaration.dimension(weight), words=SYNAPSE_WORDS)
    outer = _outer_names(declaration, form)
    reads = _reads(declaration, form)
    parameters = declaration.parameters(form.parameters)
    names = tuple(form.parameters)
    at_start = (WEIGHT,) if form.per == "synapse" else ()
    states = declaration.states(form.states, names, at_start)
    every = (*outer, *reads, *names, *form.states)
    derivatives = declaration.equations(("derivatives",), form.derivatives, form.states, every)
    updates = declaration.equations(("updates",), form.updates, form.states, every)
    jumps = declaration.equations(("jumps",), form.jumps, form.states, every)
    current = declaration.equation(("current",), form.current, every)
    declaration.check(("current",), current, _ACTIVATION_DIMENSION)
    declaration.order(form.increasing, names)
    declaration.method(form.method, derivatives, (*outer, *reads, *form.states))
    declaration.finish()
    return SynapseModel(
        name=declaration.name or form.model,
        description=form.description,
        source=form.source,
        parameters=parameters,
        current=current,
        weight=weight,
        sign=form.sign,
        per=form.per,
        states=states,
        derivatives=derivatives,
        updates=updates,
        jumps=jumps,
        reads=reads,
        method=form.method,
        increasing=form.increasing,
        plain_source=declaration.plain_source,
    )


def _activation(declaration: Declaration, form: NeuronForm) -> Unit | None:
    """Return the unit of the activation if the model fixes it; the declaration knows it from here on."""
    if form.activation is None:
        return None
    rule, unit = declaration.rule(("activation",), form.activation)
    if unit is None:
        message = f"found '{form.activation}'; allowed: a unit such as nA"
        declaration.complain(("activation",), message)
        return None
    declaration.activation = rule.fixed
    return unit


def _spike(declaration: Declaration, spike: SpikeForm, form: NeuronForm, names: tuple[str, ...]) -> Spike:
    when = declaration.equation(("spike", "when"), spike.when, names)
    declaration.check(("spike", "when"), when, None)
    return Spike(when, declaration.equations(("spike", "reset"), spike.reset, form.states, (DT, *names)))


def _output(declaration: Declaration, form: NeuronForm, own: tuple[str, ...]) -> Expression:
    declaration.dimensions[SPIKE] = NO_DIMENSION
    names = (*own, *([SPIKE] if form.spike else []), *([] if form.states else [ACTIVATION]))
    output = declaration.equation(("output",), form.output, names)
    declaration.check(("output",), output, NO_DIMENSION)
    return output


def _check_kind(declaration: Declaration, form: NeuronForm) -> None:
    """Complain about a model that is neither memoryless, nor continuous, nor discrete."""
    if form.derivatives and form.updates:
        message = "found derivatives and updates; allowed: one of them: derivatives for a continuous model, "
        declaration.complain(("updates",), f"{message}updates for one that changes once a control step")
    elif form.states and not (form.derivatives or form.updates):
        message = "found states without derivatives or updates; allowed: states that change"
        declaration.complain(("states",), message, at_key=True)
    if form.spike is not None and not form.derivatives:
        message = "found a spike without derivatives; allowed: in continuous models"
        declaration.complain(("spike",), message, at_key=True)


def _outer_names(declaration: Declaration, form: SynapseForm) -> tuple[str, ...]:
    """Note what a synapse sees beside its own states and parameters, with its dimensions."""
    source = declaration.dimension(UnitRule("", source=1))
    seen = {POST: NO_DIMENSION, GATE: NO_DIMENSION}
    if form.per == "target":
        seen |= {INPUT: declaration.weight.times(source)}
    else:
        seen |= {WEIGHT: declaration.weight, PRE: source}
    declaration.dimensions |= seen
    return tuple(seen)


def _reads(declaration: Declaration, form: SynapseForm) -> Mapping[str, UnitRule]:
    prefixes = (POST_STATE,) if form.per == "target" else (PRE_STATE, POST_STATE)
    found = {}
    for name, text in form.reads.items():
        if not name.startswith(prefixes) or name in prefixes:
            allowed = listing(f"{prefix}NAME" for prefix in prefixes)
            message = f"found '{name}'; allowed: {allowed} of a state"
            declaration.complain(("reads", name), message, at_key=True)
            continue
        found[name], _ = declaration.rule(("reads", name), text)
        declaration.dimensions[name] = declaration.dimension(found[name])
    return found


_NEURONS, _SYNAPSES = "models/neurons", "models/synapses"
NEURON_MODEL_NAMES: tuple[str, ...] = shipped_names(_NEURONS)
SYNAPSE_MODEL_NAMES: tuple[str, ...] = shipped_names(_SYNAPSES)


def neuron_model(name: str) -> NeuronModel:
    """Return the neuron model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    path = _file(_NEURONS, name)
    return _neuron_model(path, _state(path))


def synapse_model(name: str) -> SynapseModel:
    """Return the synapse model of this name.

    Raises:
        UnknownNameError: There is none; the message lists those there are.
    """
    path = _file(_SYNAPSES, name)
    return _synapse_model_of(path, _state(path))


def _state(path: Path) -> tuple[int, ...]:
    """Changes when a file does, for a model that is edited while a process lives."""
    found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


@lru_cache
def _neuron_model(path: Path, _: tuple[int, ...]) -> NeuronModel:
    return read_neuron_model(read_yaml(path))


@lru_cache
def _synapse_model_of(path: Path, _: tuple[int, ...]) -> SynapseModel:
    return read_synapse_model(read_yaml(path))


def _file(folder: str, name: str) -> Path:
    found = shipped_file(folder, f"{name}.yaml")
    if found is None:
        kind = "model"
        raise UnknownNameError(kind, name, shipped_names(folder))
    return found


STATIC = synapse_model("static")
