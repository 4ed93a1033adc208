"""The words of pictures: values in the units in which one writes them, and who is connected with whom."""

from __future__ import annotations

import numpy as np

from circuitkit.base.errors import UnitError
from circuitkit.base.units import DIMENSIONLESS, Unit, parse_unit
from circuitkit.circuit.graph import Neuron, PerMember, Population, Projection
from circuitkit.circuit.models import ModelParameter, UnitRule
from circuitkit.draw.style import number

_DASH = "\N{EN DASH}"


def parameter_text(parameter: ModelParameter, value_si: PerMember, activation: Unit) -> str:
    """Return a parameter's name and value, such as `shift 79.9 mm` or `slope 0.1 /mm`.

    Args:
        parameter: The parameter.
        value_si: Its value or values, [SI].
        activation: Unit of the activation of the neuron that has it.
    """
    unit = parameter.unit or _unit(parameter.unit_rule, activation)
    return f"{parameter.name} {quantity_text(value_si, unit)}"


def parameter_texts(node: Neuron | Population) -> list[str]:
    """Return all parameters of a neuron or population."""
    values, unit = node.parameters, node.activation_unit
    return [parameter_text(each, values[each.name], unit) for each in node.model.parameters]


def quantity_text(value_si: PerMember, unit: Unit) -> str:
    """Return SI values in a unit, as one prints them: `-80 mm`, `0.1 /mm`, `7`, `0 to 3 mm`."""
    symbol = unit.symbol.removeprefix("1")
    shown = _span_text(value_si, unit)
    return f"{shown} {symbol}" if symbol else shown


def _span_text(value_si: PerMember, unit: Unit) -> str:
    if isinstance(value_si, float | int):
        return number(value_si / unit.scale)
    if not value_si.size:
        return _DASH
    low, high = (number(float(edge) / unit.scale) for edge in (value_si.min(), value_si.max()))
    return low if low == high else f"{low} to {high}"


def weight_text(weight_si: PerMember, target: Unit, source: Unit) -> str:
    """Return a weight in the unit of its target over the unit of its source, such as `-2 mm/N`."""
    if source.dimension == target.dimension:
        return quantity_text(weight_si, DIMENSIONLESS)
    above = "" if target.symbol == "1" else target.symbol
    below = "" if source.symbol == "1" else f"/{source.symbol}"
    quotient = Unit(f"{above}{below}", target.factor / source.factor, target.dimension)
    return quantity_text(weight_si, quotient)


def rule_text(projection: Projection, n_source: int, n_target: int) -> str:
    """Say who is connected with whom: `all to all`, `one to one`, `10 from each`, `5000 synapses`."""
    count = len(projection.sources)
    degrees = np.diff(projection.indptr)
    if count == n_source * n_target:
        if n_source == 1 or n_target == 1:
            return "to all" if n_source == 1 else "from all"
        return "all to all"
    targets = np.repeat(np.arange(n_target), degrees)
    if count == n_source == n_target and np.array_equal(projection.sources, targets):
        return "one to one"
    others = n_source == n_target and (degrees == n_source - 1).all()
    if others and projection.source == projection.target and not (projection.sources == targets).any():
        return "all to all others"
    if degrees.size and (degrees == degrees[0]).all():
        return f"{degrees[0]} to each"
    return f"{100 * count / (n_source * n_target):.2g} % of all pairs"


def _unit(rule: UnitRule, activation: Unit) -> Unit:
    """Return the unit of a rule: made of the activation's unit where that can be written, else in SI."""
    dimension = rule.dimension(activation.dimension)
    if dimension == activation.dimension:
        return activation
    try:
        reciprocal = parse_unit(f"/{activation}") if activation != DIMENSIONLESS else DIMENSIONLESS
    except UnitError:
        reciprocal = dimension.si_unit
    return reciprocal if reciprocal.dimension == dimension else dimension.si_unit
