"""Declarations of models: what may stand in them, as pydantic models, and one of them under examination.

The examination collects the names with their dimensions, the equations, and all that is wrong.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias, Unpack

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema

from circuitkit.base.errors import ExpressionError, InputError, Problem, UnitError, listing, suggest
from circuitkit.base.source import Document, FileModel, Place, Pointing
from circuitkit.base.units import DIMENSIONLESS, Dimension, Unit, parse_quantity
from circuitkit.circuit.expressions.dimensions import (
    NO_DIMENSION,
    OpenDimension,
    check_dimension,
    dimension_of,
)
from circuitkit.circuit.expressions.expression import FUNCTION_ARITY, Expression, Number
from circuitkit.circuit.expressions.parsing import parse_expression, require_values
from circuitkit.circuit.expressions.symbolic import derivative
from circuitkit.circuit.models.model import Method, ModelParameter, ModelState, UnitRule, parse_unit_rule


def _as_text(value: object) -> object:
    """Take a bare number for an expression, a unit (1) or a quantity, too."""
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


Text: TypeAlias = Annotated[
    str,
    BeforeValidator(_as_text),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]}),
]
Equations: TypeAlias = dict[str, Text]

_UNIT = "A unit such as mV or 1, or one with the words activation, source, weight, such as activation/s."


class _Form(FileModel):
    """Builds its validator when it is first needed: those of the parts never are by themselves."""

    model_config = ConfigDict(defer_build=True)


class ParameterForm(_Form):
    """A parameter of a model."""

    unit: Text = Field(description=_UNIT)
    default: Text | None = Field(None, description="A number with its unit, for circuits that give none.")
    description: str = Field("", description="What this is, in words.")


class StateForm(_Form):
    """A state variable of a model."""

    unit: Text = Field(description=_UNIT)
    initial: Text = Field("0", description="Its value at the start, from the parameters.")
    description: str = Field("", description="What this is, in words.")


class SpikeForm(_Form):
    """When a neuron spikes, and what then happens."""

    when: Text = Field(description="It spikes when this is above zero; from parameters and states.")
    reset: Equations = Field({}, description="New value of each state that changes.")


class _ModelForm(_Form):
    """What declarations of neurons and synapses have in common."""

    model: str = Field("", description="Name of the model; in a circuit file it is the key.")
    description: str = Field("", description="What the model does, in words.")
    source: str = Field("", description="Where the equations come from.")
    parameters: dict[str, ParameterForm] = Field({}, description="By name.")
    increasing: tuple[str, ...] = Field((), description="Parameters of which each must be below the next.")
    states: dict[str, StateForm] = Field({}, description="State variables, by name.")
    derivatives: Equations = Field({}, description="Change of states per second.")
    updates: Equations = Field({}, description="New values of states once a control step.")
    method: Method = Field("exponential_euler", description="How the derivatives are integrated.")


class NeuronForm(_ModelForm):
    """A neuron model: equations in A (the activation), parameters and states."""

    activation: Text | None = Field(None, description="Unit of the activation, if the model fixes it.")
    spike: SpikeForm | None = Field(None, description="When it spikes, and what then happens.")
    output: Text = Field(description="The output: of A, or of states and spike (1 when it just spiked).")


class SynapseForm(_ModelForm):
    """A synapse model: equations in weight, pre, post (or input), gate, parameters and states."""

    weight: Text = Field("activation/source", description="Unit of the weight.")
    sign: Literal["role", "positive", "any"] = Field(
        "role", description="role: the weight's sign follows the source's role; positive; any."
    )
    per: Literal["synapse", "target"] = Field(
        "synapse",
        description="target: states are kept once for a target; `input` is the sum of weight * pre.",
    )
    reads: Equations = Field({}, description="Unit of states of the other side, such as post_v: mV.")
    jumps: Equations = Field({}, description="New values of states when the sources' outputs arrive.")
    current: Text = Field(description="What is added to the target's activation.")


_NAME = re.compile("[A-Za-z_][A-Za-z0-9_]*")
_PER_SECOND = OpenDimension(Dimension(time=-1))


@dataclass
class Declaration:
    """Collects what is wrong with a declaration while its parts are read.

    Attributes:
        document: Where it stands.
        place: Its place in the document.
        words: Words that mean something in its units.
        taken: Names that mean something else, for parameters and states.
        activation: Dimension of the activation, if the model fixes it.
        weight: Dimension of the weight, in a synapse.
        plain_source: Whether the sources of a synapse are taken as dimensionless.
        dimensions: Of every name that equations may use, as far as known.
        problems: What is wrong.
    """

    document: Document
    place: Place
    words: tuple[str, ...]
    taken: Collection[str]
    activation: Dimension | None = None
    weight: OpenDimension = NO_DIMENSION
    plain_source: bool = False
    dimensions: dict[str, OpenDimension] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The last key of the place; empty if the declaration is a document of its own."""
        return str(self.place[-1]) if self.place else ""

    def complain(self, place: Place, message: str, hint: str = "", **pointing: Unpack[Pointing]) -> None:
        """Note a complaint as `Document.problem` makes it, about a place inside the declaration."""
        self.problems.append(self.document.problem((*self.place, *place), message, hint, **pointing))

    def finish(self) -> None:
        """Refuse the declaration if anything is wrong with it.

        Raises:
            InputError: With every problem, in the order of the file.
        """
        if self.problems:
            raise InputError(*sorted(self.problems, key=lambda problem: (problem.line, problem.column)))

    def rule(self, place: Place, text: str) -> tuple[UnitRule, Unit | None]:
        """Return the rule that a unit means; complains and goes on with a dimensionless one."""
        try:
            return parse_unit_rule(text, self.words)
        except UnitError as error:
            self.complain(place, str(error))
            return UnitRule(text), DIMENSIONLESS

    def dimension(self, rule: UnitRule) -> OpenDimension:
        """Return the dimension that a rule means; that of the activation put in if the model fixes it."""
        source = 0 if self.plain_source else rule.source
        found = OpenDimension(rule.fixed, rule.activation, source).times(self.weight, rule.weight)
        if self.activation is None:
            return found
        return OpenDimension(found.fixed.times(self.activation, found.activation), 0, found.source)

    def parameters(self, forms: Mapping[str, ParameterForm]) -> tuple[ModelParameter, ...]:
        """Return the parameters; from here on equations may use them."""
        found = []
        for name, form in forms.items():
            place: Place = ("parameters", name)
            self._check_name(place, name, "parameter")
            before = len(self.problems)
            rule, unit = self.rule((*place, "unit"), form.unit)
            if len(self.problems) == before:
                self.dimensions[name] = self.dimension(rule)
            default = None if form.default is None else self._default((*place, "default"), form.default, rule)
            found.append(ModelParameter(name, rule, default, form.description, unit))
        return tuple(found)

    def states(
        self, forms: Mapping[str, StateForm], parameters: Collection[str], also: Collection[str] = ()
    ) -> tuple[ModelState, ...]:
        """Give the states; from here on equations may use them. `also`: further names for initial values."""
        found = []
        for name, form in forms.items():
            place: Place = ("states", name)
            self._check_name(place, name, "state", parameters)
            before = len(self.problems)
            rule, unit = self.rule((*place, "unit"), form.unit)
            initial = self.equation((*place, "initial"), form.initial, (*parameters, *also))
            if len(self.problems) == before:
                self.dimensions[name] = self.dimension(rule)
                self.check((*place, "initial"), initial, self.dimensions[name])
            found.append(ModelState(name, rule, initial, form.description, unit))
        return tuple(found)

    def equation(self, place: Place, text: str, names: Iterable[str]) -> Expression:
        """Return the expression of these names; complains and goes on with zero."""
        try:
            found = parse_expression(text, names, units=True)
            require_values(found)
        except ExpressionError as error:
            self.complain(place, str(error), offset=error.offset)
            return Number(0.0)
        return found

    def check(self, place: Place, expression: Expression, wanted: OpenDimension | None) -> None:
        """Complain about an expression that joins what does not fit, or is not of the dimension wanted."""
        if not expression.names() <= self.dimensions.keys():
            return  # a unit is wrong, which has been said
        try:
            if wanted is None:
                dimension_of(expression, self.dimensions)
            else:
                check_dimension(expression, self.dimensions, wanted)
        except ExpressionError as error:
            self.complain(place, str(error), offset=error.offset)

    def equations(
        self, place: Place, texts: Mapping[str, str], states: Collection[str], names: Iterable[str]
    ) -> dict[str, Expression]:
        """Return an expression for each of some states, of the state's dimension; by time for derivatives."""
        allowed, found = tuple(names), {}
        for state, text in texts.items():
            if state not in states:
                message = f"unknown state '{state}'; allowed: {listing(states)}"
                self.complain((*place, state), message, suggest(state, states), at_key=True)
                continue
            found[state] = self.equation((*place, state), text, allowed)
            if state in self.dimensions:
                wanted = self.dimensions[state]
                by_time = place == ("derivatives",)
                self.check((*place, state), found[state], wanted.times(_PER_SECOND) if by_time else wanted)
        return found

    def order(self, increasing: Iterable[str], parameters: Collection[str]) -> None:
        """Complain about names that should increase and are no parameters, or have another unit."""
        first = None
        for number, name in enumerate(increasing):
            place: Place = ("increasing", number)
            if name not in parameters:
                message = f"unknown parameter '{name}'; allowed: {listing(parameters)}"
                self.complain(place, message, suggest(name, parameters))
                continue
            first = first or name
            dimensions = self.dimensions.get(first), self.dimensions.get(name)
            if None not in dimensions and dimensions[0] != dimensions[1]:
                message = f"found {first} in {dimensions[0]} and {name} in {dimensions[1]}"
                self.complain(place, f"{message}; allowed: parameters of the same dimension")

    def method(self, method: Method, derivatives: Mapping[str, Expression], inputs: Iterable[str]) -> None:
        """Complain about the exact method where the derivatives are not linear in the states."""
        varying = frozenset((*derivatives, *inputs))
        if method == "exact":
            for state, change in derivatives.items():
                for other in derivatives:
                    slope = derivative(change, other)
                    if not slope.names().isdisjoint(varying):
                        message = f"found exact, but its slope by {other} is {slope}, which varies"
                        allowed = "allowed: exact for linear derivatives, else exponential_euler or rk4"
                        self.complain(("derivatives", state), f"{message}; {allowed}")
                        return

    def _check_name(self, place: Place, name: str, kind: str, others: Collection[str] = ()) -> None:
        if not _NAME.fullmatch(name):
            message = f"found '{name}'; allowed: a name of letters, digits and _, not starting with a digit"
        elif keyword.iskeyword(name) or name in FUNCTION_ARITY or name in self.taken:
            message = f"found a {kind} '{name}', which means something else in models; allowed: other names"
        elif name in others:
            message = f"found a state '{name}', which is a parameter already; allowed: other names"
        else:
            return
        self.complain(place, message, at_key=True)

    def _default(self, place: Place, text: str, rule: UnitRule) -> float:
        """Read the default, [SI]: zero, of the rule's dimension, or a number if a circuit decides that."""
        try:
            quantity = parse_quantity(text)
        except UnitError as error:
            self.complain(place, str(error))
            return 0.0
        wanted = self.dimension(rule)
        if quantity.value_si and quantity.dimension != (Dimension() if any(wanted[1:]) else wanted.fixed):
            self.complain(place, f"found {quantity}; allowed: a quantity in {rule}, or 0")
        return quantity.value_si
