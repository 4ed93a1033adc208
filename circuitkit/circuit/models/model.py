"""What a model is: parameters with units, states, their change in time, an output; where it spikes, a reset.

Models are read from YAML, those of this folder or an author's own, by `reading`; all the rest of circuitkit
reads these classes and knows no model by name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from circuitkit.base.errors import UnitError, listing, suggest
from circuitkit.base.units import DIMENSIONLESS, UNIT_SYMBOLS, Dimension, Unit, parse_unit
from circuitkit.circuit.expressions.expression import Expression

NEURON_WORDS = ("activation",)
SYNAPSE_WORDS = ("activation", "source", "weight")
_PIECE = re.compile(r"(?P<word>[A-Za-z]+)(?:\^(?P<power>-?[0-9]))?")


def parse_unit_rule(text: str, words: Iterable[str]) -> tuple[UnitRule, Unit | None]:
    """Read a unit such as `mV`, `activation/s` or `1/activation`.

    Args:
        text: The unit; every `/` divides by the one factor after it.
        words: Those of activation, source and weight that mean something here.

    Returns:
        The rule, and the unit if it has none of the words.

    Raises:
        UnitError: It is no such unit; or one with a prefix beside a word, where only SI units have a meaning.
    """
    allowed = tuple(words)
    powers = dict.fromkeys(SYNAPSE_WORDS, 0)
    pieces = re.split(r"\s*([*/])\s*", text.strip())
    rest = ""
    for sign, piece in zip(["*", *pieces[1::2]], pieces[::2], strict=True):
        match = _PIECE.fullmatch(piece)
        if match is not None and match["word"] in allowed:
            powers[match["word"]] += int(match["power"] or 1) * (-1 if sign == "/" else 1)
            continue
        if (
            match is not None
            and match["word"] not in UNIT_SYMBOLS
            and (hint := suggest(match["word"], allowed))
        ):
            message = f"unknown unit '{match['word']}'; allowed: a unit, or {listing(allowed)}; {hint}"
            raise UnitError(message)
        rest += piece if not rest and sign == "*" else sign + piece
    unit = parse_unit(rest) if rest else DIMENSIONLESS
    if not any(powers.values()):
        return UnitRule(text.strip(), unit.dimension), unit
    if unit.factor != 1:
        example = listing(word for word, power in powers.items() if power)
        message = f"found '{text.strip()}'; allowed: units without a prefix beside {example}, such as s or V"
        raise UnitError(message)
    return UnitRule(text.strip(), unit.dimension, **powers), None


# Names that expressions of neuron models may use beside their own parameters and states:
ACTIVATION = "A"  # sum of what the synapses deliver (eq. 11), with the noise
DT = "dt"  # of a substep, in derivatives and resets: what is counted in steps begins with a whole number
SPIKE = "spike"  # 1 in the substep in which the condition was met, else 0; in the output of a spiking model
# ... and those of synapse models:
WEIGHT = "weight"
PRE, POST = "pre", "post"  # output of the source and of the target
INPUT = "input"  # sum of weight times pre over the synapses of a target, where states are kept per target
GATE = "gate"  # output of the neuron that the synapse names as its gate
PRE_STATE, POST_STATE = "pre_", "post_"  # with the name of a state behind: that state of the source or target

_PLAIN = Dimension()

Method = Literal["euler", "exponential_euler", "exact", "rk4"]


@dataclass(frozen=True)
class UnitRule:
    """A dimension that may depend on the circuit: a fixed one times powers of three that a circuit decides.

    Attributes:
        text: As written in the model's file, such as `activation/s`, `1/activation` or `mV`.
        fixed: The fixed factor's dimension.
        activation: Power of the activation of the neuron (of the target, in a synapse).
        source: Power of the source's dimension: an input's unit, dimensionless for a neuron.
        weight: Power of the dimension of the synapse's weight.
    """

    text: str
    fixed: Dimension = _PLAIN
    activation: int = 0
    source: int = 0
    weight: int = 0

    def dimension(
        self,
        activation: Dimension = _PLAIN,
        source: Dimension = _PLAIN,
        weight: Dimension = _PLAIN,
    ) -> Dimension:
        """Return the dimension in a circuit where the three are these."""
        found = self.fixed.times(activation, self.activation)
        return found.times(source, self.source).times(weight, self.weight)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class ModelParameter:
    """A parameter of a model.

    Attributes:
        name: Its name, as in the equations and in the circuit file.
        unit_rule: Its dimension.
        default: The value where a circuit gives none, [SI]; None if it must be given.
        description: In words.
        unit: The unit in which it is shown if the rule is fixed, such as mV; None for the SI unit.
    """

    name: str
    unit_rule: UnitRule
    default: float | None
    description: str
    unit: Unit | None = None


@dataclass(frozen=True)
class ModelState:
    """A state variable.

    Attributes:
        name: Its name, as in the equations.
        unit_rule: Its dimension.
        initial: Its value at the start, in terms of the parameters.
        description: In words.
        unit: The unit in which it is shown if the rule is fixed; None for the SI unit.
    """

    name: str
    unit_rule: UnitRule
    initial: Expression
    description: str
    unit: Unit | None = None


@dataclass(frozen=True)
class Spike:
    """When a neuron spikes, and what then happens to its states.

    Attributes:
        when: Above zero: it spikes. In terms of the parameters and of the new states.
        reset: New value of each state that changes, in terms of the parameters and states, all at once.
    """

    when: Expression
    reset: Mapping[str, Expression]


class _WithParameters:
    """What neuron and synapse models tell of their parameters."""

    parameters: tuple[ModelParameter, ...]

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def defaults(self) -> Mapping[str, float]:
        """A value for every parameter: its default, or zero where a circuit must give one, [SI]."""
        return {parameter.name: parameter.default or 0.0 for parameter in self.parameters}


@dataclass(frozen=True)
class NeuronModel(_WithParameters):
    """What a neuron computes from its activation.

    Without states it is a function of the activation (eq. 12). With `derivatives` it is continuous: it
    advances in substeps by its `method`. With `updates` it is discrete: new values once a control step. It
    cannot have both.

    Attributes:
        name: Its name, as in the circuit file.
        description: In words.
        source: Where the equations come from.
        parameters: In the order of the file.
        output: The output in terms of A (only if there are no states), parameters, states and `spike`.
        increasing: Names of parameters of which each must be below the next.
        states: State variables, in the order of the file.
        derivatives: Change per second of states, in terms of A, parameters and states.
        updates: New values of states once a control step, all from the old ones, in the same terms.
        spike: Where the model spikes.
        method: How the derivatives are integrated.
        activation: The activation's dimension if the model fixes it, such as ampere; None if a neuron's
            parameters decide.
    """

    name: str
    description: str
    source: str
    parameters: tuple[ModelParameter, ...]
    output: Expression
    increasing: tuple[str, ...] = ()
    states: tuple[ModelState, ...] = ()
    derivatives: Mapping[str, Expression] = field(default_factory=dict)
    updates: Mapping[str, Expression] = field(default_factory=dict)
    spike: Spike | None = None
    method: Method = "exponential_euler"
    activation: Unit | None = None

    @cached_property
    def continuous(self) -> bool:
        """Whether it advances in substeps."""
        return bool(self.derivatives)

    @cached_property
    def counts_spikes(self) -> bool:
        """Whether what is seen of it once a control step is the sum of its spikes over the substeps."""
        return self.continuous and SPIKE in self.output.names()

    def __hash__(self) -> int:
        return hash((self.name, self.output))


@dataclass(frozen=True)
class SynapseModel(_WithParameters):
    """What a synapse delivers to its target's activation.

    With `per` "synapse", expressions are in terms of `weight`, `pre`, `post`, `gate`, states of the source
    and target (`pre_v`, `post_v`), parameters and own states, which every synapse has for itself. With `per`
    "target", `input` stands for the sum of weight times pre over all synapses that one entry of the file
    leads to a target, instead of `weight` and `pre`: the states are kept once for the target.

    In every step or substep: the sources' outputs are read, then `jumps` change the states, then `current` is
    delivered; at its end the states advance by `derivatives`. `updates` run once a control step, at its end.

    Attributes:
        name: Its name, as in the circuit file.
        description: In words.
        source: Where the equations come from.
        parameters: In the order of the file.
        current: What is added to the target's activation.
        weight: Dimension of the weight.
        sign: `role`: the weight's sign follows the source's role; `positive`: never negative; `any`.
        per: Whether states are kept for every synapse or once for every target.
        states: State variables.
        derivatives: Change per second of states.
        updates: New values of states once a control step, after all neurons.
        jumps: New values of states on arrival of the sources' outputs, before `current`.
        reads: Dimension of every state of source or target that the expressions use, such as `post_v`.
        method: How the derivatives are integrated.
        increasing: Names of parameters of which each must be below the next.
        plain_source: Whether sources must be dimensionless, as neurons are, for the equations to fit.
    """

    name: str
    description: str
    source: str
    parameters: tuple[ModelParameter, ...]
    current: Expression
    weight: UnitRule
    sign: Literal["role", "positive", "any"] = "role"
    per: Literal["synapse", "target"] = "synapse"
    states: tuple[ModelState, ...] = ()
    derivatives: Mapping[str, Expression] = field(default_factory=dict)
    updates: Mapping[str, Expression] = field(default_factory=dict)
    jumps: Mapping[str, Expression] = field(default_factory=dict)
    reads: Mapping[str, UnitRule] = field(default_factory=dict)
    method: Method = "exponential_euler"
    increasing: tuple[str, ...] = ()
    plain_source: bool = False

    @cached_property
    def gated(self) -> bool:
        """Whether a neuron that gates it must be named."""
        equations = (self.current, *self.derivatives.values(), *self.updates.values(), *self.jumps.values())
        return any(GATE in equation.names() for equation in equations)

    def __hash__(self) -> int:
        return hash((self.name, self.current))
