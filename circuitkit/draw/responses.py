"""What a neuron answers to an activation: its function (eq. 12), or if it has states, what the engine says.

A neuron with states is held at each activation until it has settled. One that spikes then answers with its
rate, another one with its steady output, or with the mean of an output that does not settle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from circuitkit.base.errors import DivergedError
from circuitkit.base.units import DIMENSIONLESS, Dimension, Unit, parse_unit
from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode, Population, Synapse
from circuitkit.circuit.models import ModelParameter
from circuitkit.circuit.models.model import ACTIVATION
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.backends.numpy_expression import NUMPY_FUNCTIONS
from circuitkit.engine.operations import FloatArray

_TAILS = 6.0  # how many widths of a curve are shown beside its centre
_POINTS, _HELD_POINTS = 801, 65
_TRIED = np.logspace(-2, 2, 33)  # activations in the neuron's unit, to find where it answers
_ANSWERS = 1e-3  # of all that its output can do: more is an answer
_SETTLED = 1e-3  # of the largest output: less is no change
_HELD_FOR = 15.0  # in units of the slowest time constant
_LEAST_S, _LEAST_SPIKING_S, _MOST_S = 0.3, 1.2, 3.0
_STEP_S = 1e-3  # control step, in which spikes are counted
_SPIKING, _FINEST = 10, 20  # substeps: at least of spiking neurons, and at most
_SECONDS, _PER_SECOND = Dimension(time=1), Dimension(time=-1)
_HERTZ = parse_unit("Hz")


@dataclass(frozen=True, eq=False)
class Response:
    """Outputs over activations.

    Attributes:
        activation: Ascending, shape (k,), [SI].
        output: Shape (k,), in `unit`.
        unit: Of the output: Hz for a rate, else dimensionless.
        what: "output", "steady output", "mean output" or "rate".
    """

    activation: FloatArray
    output: FloatArray
    unit: Unit
    what: str


def centres(neuron: Neuron) -> list[float]:
    """Return activations at which a memoryless neuron's curve has its middle or its corner, [SI]."""
    parameters = neuron.model.parameters
    return [neuron.parameters[p.name] for p in parameters if _power(p) == 1]


def width(neuron: Neuron) -> float:
    """Find how much activation a memoryless neuron's curve needs to rise, [SI]; 0 if it jumps."""
    parameters = neuron.model.parameters
    slopes = [neuron.parameters[p.name] for p in parameters if _power(p) == -1]
    return max((1 / abs(slope) for slope in slopes if slope), default=0.0)


def _power(parameter: ModelParameter) -> int:
    """1 for a parameter in the unit of the activation, -1 for its reciprocal, else 0."""
    rule = parameter.unit_rule
    return rule.activation if not any(rule.fixed) else 0


def span(neurons: list[Neuron]) -> tuple[float, float]:
    """Return the activations that show what the curves of neurons do, and 0, [SI]."""
    if neurons[0].model.activation is not None:
        spans = [_held_span(neuron) for neuron in neurons]
        return min(low for low, _ in spans), max(high for _, high in spans)
    every = [centre for neuron in neurons for centre in centres(neuron)] or [0.0]
    tail = _TAILS * max(width(neuron) for neuron in neurons)
    low, high = min(every), max(every)
    beside = max(tail, 0.5 * (high - low), 0.5 * max(abs(low), abs(high))) or 1.0
    return min(low - beside, 0.0), max(high + beside, 0.0)


def response(neuron: Neuron, low: float, high: float) -> Response:
    """Find what a neuron answers between two activations, [SI]."""
    if neuron.model.states:
        return _held(neuron, np.linspace(low, high, _HELD_POINTS))
    activation = _grid(neuron, low, high)
    return Response(activation, function(neuron, activation), DIMENSIONLESS, "output")


def function(neuron: Neuron, activation: FloatArray) -> FloatArray:
    """Return the output of a memoryless neuron at activations, [SI]."""
    with np.errstate(all="ignore"):
        found = neuron.model.output.evaluate({**neuron.parameters, ACTIVATION: activation}, NUMPY_FUNCTIONS)
    return np.broadcast_to(np.asarray(found, dtype=np.float64), activation.shape)


def member(population: Population, index: int) -> Neuron:
    """Return a member of a population as a neuron of its own."""

    def one(values: object) -> float:
        return float(np.broadcast_to(np.asarray(values), (population.size,))[index])

    return Neuron(
        f"{population.name}[{index}]",
        population.model,
        population.role,
        {name: one(values) for name, values in population.parameters.items()},
        population.activation_unit,
        population.description,
        {name: one(values) for name, values in population.initial.items()},
        one(population.noise),
        population.origin,
    )


def _grid(neuron: Neuron, low: float, high: float) -> FloatArray:
    """Return activations to compute at: evenly spaced, and close together where a curve is steep."""
    parts = [np.linspace(low, high, _POINTS)]
    for centre in centres(neuron):
        wide = max(width(neuron), 1e-9 * (high - low))
        parts += [
            centre + wide * np.linspace(-_TAILS, _TAILS, 61),
            np.nextafter(centre, [-np.inf, np.inf]),
        ]
    grid = np.unique(np.concatenate(parts))
    return grid[(grid >= low) & (grid <= high)]


def _held_span(neuron: Neuron) -> tuple[float, float]:
    """From a quarter below 0 up to four times the least activation that the neuron answers, [SI]."""
    tried = neuron.activation_unit.scale * _TRIED
    found = _held(neuron, tried)
    moved = np.abs(found.output - found.output[0]) > _ANSWERS * float(np.ptp(found.output))
    least = float(found.activation[int(np.argmax(moved))]) if moved.any() else float(tried[-1]) / 4
    return -least, 4 * least


def _held(neuron: Neuron, activation: FloatArray) -> Response:
    """Find what the neuron settles to at each activation, up to where it diverges."""
    while True:
        try:
            output = _run_held(neuron, activation)
        except DivergedError:
            if len(activation) <= 2:  # noqa: PLR2004 - a curve needs two points
                raise
            activation = activation[: len(activation) * 3 // 4]
        else:
            break
    half = output[len(output) // 2 :]
    if neuron.model.spike is not None:
        return Response(activation, _rates(half), _HERTZ, "rate")
    settled = np.ptp(half[len(half) // 2 :], axis=0) <= _SETTLED * max(1e-12, float(np.abs(half).max()))
    if settled.all():
        return Response(activation, output[-1], DIMENSIONLESS, "steady output")
    return Response(activation, half.mean(axis=0), DIMENSIONLESS, "mean output")


def _run_held(neuron: Neuron, activation: FloatArray) -> FloatArray:
    """Return outputs over time, shape (T, k); of a spiking neuron the spikes in every control step."""
    slow, fast = _times(neuron)
    least, finest = (_LEAST_S, 1) if neuron.model.spike is None else (_LEAST_SPIKING_S, _SPIKING)
    steps = math.ceil(min(max(_HELD_FOR * slow, least), _MOST_S) / _STEP_S)
    substeps = min(max(finest, math.ceil(_STEP_S / (fast / 20))), _FINEST)
    program = compile_circuit(_alone(neuron, substeps), "numpy")
    inputs = np.broadcast_to(activation[np.newaxis, :, np.newaxis], (steps, len(activation), 1))
    output: FloatArray = run(program, np.ascontiguousarray(inputs)).output[:, :, 0]
    return output


def _rates(spikes: FloatArray) -> FloatArray:
    """Spikes per second from the first to the last one, shape (k,); 0 if there are not two."""
    rates = np.zeros(spikes.shape[1])
    for i, counts in enumerate(spikes.T):
        at = np.flatnonzero(counts)
        if len(at) > 1:
            rates[i] = counts[at[0] + 1 :].sum() / ((at[-1] - at[0]) * _STEP_S)
    return rates


def _times(neuron: Neuron) -> tuple[float, float]:
    """Return the slowest and the quickest time constant among the parameters of a neuron, [s]."""
    found = [_LEAST_S / _HELD_FOR]
    for parameter in neuron.model.parameters:
        value = abs(neuron.parameters[parameter.name])
        dimension = parameter.unit_rule.dimension(neuron.activation_unit.dimension)
        if value and dimension in {_SECONDS, _PER_SECOND}:
            found.append(value if dimension == _SECONDS else 1 / value)
    return max(found), min(found)


def _alone(neuron: Neuron, substeps: int) -> CircuitGraph:
    """Return a circuit of one neuron whose activation is its input; without noise."""
    unit = Unit(ACTIVATION, neuron.activation_unit.dimension.si_unit.factor, neuron.activation_unit.dimension)
    return CircuitGraph(
        name="held",
        description="",
        timing="ordered",
        step_s=_STEP_S,
        inputs=(InputNode("held", unit, -math.inf, math.inf),),
        neurons=(replace(neuron, name="neuron", noise=0.0),),
        synapses=(Synapse("held", "neuron", 1.0, "sensorial"),),
        outputs=(OutputNode("output", DIMENSIONLESS, (("neuron", 1.0),), -math.inf, math.inf),),
        parameters={},
        substeps=substeps,
    )
