"""A resolved circuit as a circuit file again: no includes, no parameters, every value written out."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any

from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode, Synapse
from circuitkit.circuit.models import ModelParameter
from circuitkit.source import dump_yaml
from circuitkit.units import DIMENSIONLESS, Dimension, Unit, parse_quantity, parse_unit

MOST_DIGITS = 17  # with so many, every float is told from its neighbours
MANY_DIGITS = 25  # with so many, it still is after conversion to another unit


def flat_document(graph: CircuitGraph) -> dict[str, Any]:
    """The circuit in the form of its file; resolving it gives an equal graph, but for the parameters."""
    document: dict[str, Any] = {"circuit": graph.name}
    if graph.description:
        document["description"] = graph.description
    document["control_step"] = exact(graph.step_s, parse_unit("ms"))
    document["timing"] = graph.timing
    document["inputs"] = {node.name: _input(node) for node in graph.inputs}
    document["neurons"] = {neuron.name: _neuron(neuron) for neuron in graph.neurons}
    document["synapses"] = [_synapse(graph, synapse) for synapse in graph.synapses]
    document["outputs"] = {node.name: _output(node) for node in graph.outputs}
    return document


def flat_yaml(graph: CircuitGraph) -> str:
    """The circuit as the text of a circuit file; see `flat_document`."""
    return dump_yaml(flat_document(graph))


def exact(value_si: float, unit: Unit) -> float | str:
    """A number, or text such as `-80 mm`, that reads back to exactly this SI value, as short as that allows.

    Args:
        value_si: The value, [SI].
        unit: The unit to write it in.
    """
    if unit == DIMENSIONLESS:
        return int(value_si) if value_si == int(value_si) else value_si
    for digits in range(1, MOST_DIGITS + 1):
        text = _with_unit(float(f"{unit.from_si(value_si):.{digits}g}"), unit.symbol)
        if parse_quantity(text).value_si == value_si:
            return text
    exact_value = Fraction(value_si) / unit.factor  # no float in this unit reads back exactly, but this does
    with localcontext(prec=MANY_DIGITS):
        number = Decimal(exact_value.numerator) / Decimal(exact_value.denominator)
    return f"{number} {unit}"


def _with_unit(number: float, symbol: str) -> str:
    """`80 mm`; `100 /m` for the unit `1/m`."""
    unit = symbol.removeprefix("1") if symbol.startswith("1/") else symbol
    return f"{repr(number).removesuffix('.0')} {unit}"


def _si(dimension: Dimension) -> Unit:
    return parse_unit(dimension.si_symbol)


def parameter_unit(neuron: Neuron, parameter: ModelParameter) -> Unit:
    """The unit in which a parameter of a neuron is shown."""
    dimension = parameter.unit_rule.dimension(neuron.activation_unit.dimension)
    return neuron.activation_unit if dimension == neuron.activation_unit.dimension else _si(dimension)


def weight_unit(graph: CircuitGraph, synapse: Synapse) -> Unit:
    """The unit in which the weight of a synapse is shown: activation of the target per unit of the source."""
    target = next(neuron for neuron in graph.neurons if neuron.name == synapse.target)
    source = next((node.unit for node in graph.inputs if node.name == synapse.source), DIMENSIONLESS)
    return _si(target.activation_unit.dimension.times(source.dimension, -1))


def _input(node: InputNode) -> dict[str, Any]:
    limits = [exact(node.low, node.unit), exact(node.high, node.unit)]
    return {"unit": node.unit.symbol, "range": limits, **_described(node.description)}


def _neuron(neuron: Neuron) -> dict[str, Any]:
    values = {
        parameter.name: exact(neuron.parameters[parameter.name], parameter_unit(neuron, parameter))
        for parameter in neuron.model.parameters
    }
    return {"model": neuron.model.name, "role": neuron.role, **values, **_described(neuron.description)}


def _synapse(graph: CircuitGraph, synapse: Synapse) -> dict[str, Any]:
    weight = exact(synapse.weight, weight_unit(graph, synapse))
    return {"from": synapse.source, "to": synapse.target, "weight": weight}


def _output(node: OutputNode) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "unit": node.unit.symbol,
        "readout": {name: exact(weight, node.unit) for name, weight in node.readout},
    }
    if node.leak is not None:
        entry["integrate"] = {"leak": exact(node.leak, parse_unit("%"))}
    if math.isfinite(node.low) or math.isfinite(node.high):
        entry["limits"] = [exact(node.low, node.unit), exact(node.high, node.unit)]
    return {**entry, **_described(node.description)}


def _described(description: str) -> dict[str, str]:
    return {"description": description} if description else {}
