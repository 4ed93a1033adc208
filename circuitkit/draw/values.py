"""Values in pictures: the unit in which a parameter or a weight is shown, and the text that stands there."""

from __future__ import annotations

from circuitkit.circuit.models import ModelParameter, UnitRule
from circuitkit.draw.style import number
from circuitkit.errors import UnitError
from circuitkit.units import DIMENSIONLESS, Unit, parse_unit


def parameter_text(parameter: ModelParameter, value_si: float, activation: Unit) -> str:
    """A parameter's name and value, such as `shift 79.9 mm` or `slope 0.1 /mm`.

    Args:
        parameter: The parameter.
        value_si: Its value, [SI].
        activation: Unit of the activation of the neuron that has it.
    """
    unit = parameter.unit or _unit(parameter.unit_rule, activation)
    return f"{parameter.name} {quantity_text(value_si, unit)}"


def quantity_text(value_si: float, unit: Unit) -> str:
    """An SI value in a unit, as one prints it: `-80 mm`, `0.1 /mm`, `7`."""
    symbol = unit.symbol.removeprefix("1")
    return f"{number(value_si / unit.scale)} {symbol}" if symbol else number(value_si)


def _unit(rule: UnitRule, activation: Unit) -> Unit:
    """The unit of a rule: made of the activation's unit where that can be written, else in SI."""
    dimension = rule.dimension(activation.dimension)
    if dimension == activation.dimension:
        return activation
    try:
        reciprocal = parse_unit(f"/{activation}") if activation != DIMENSIONLESS else DIMENSIONLESS
    except UnitError:
        reciprocal = dimension.si_unit
    return reciprocal if reciprocal.dimension == dimension else dimension.si_unit
