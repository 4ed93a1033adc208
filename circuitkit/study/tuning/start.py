"""Where a search begins: at what the file of the tuning says, or at what the base has."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from circuitkit.base.errors import UnitError
from circuitkit.base.source import Data, find_data_file, read_yaml
from circuitkit.base.units import format_quantity
from circuitkit.circuit import load_circuit
from circuitkit.study.tuning.result import folder_of
from circuitkit.study.tuning.spec import Tuning

_ALL_DIGITS = 17


def start_of(tuning: Tuning) -> dict[str, Any]:
    """The first candidate: what the file gives, else what the base has, else the middle of the range."""
    own = _own_values(tuning)
    start = {}
    for name, searched in tuning.spec.parameters.items():
        start[name] = tuning.start.get(name, searched.middle())
        if name not in tuning.start and name in own:
            with suppress(UnitError):  # outside of the range
                start[name] = searched.number(own[name])
    return start


def _own_values(tuning: Tuning) -> dict[str, str]:
    """What the base has for what is searched, as far as it is known, by name."""
    if tuning.spec.target != "circuit":
        data = read_yaml(find_data_file(tuning.base, folder_of(tuning))).data
        flat = dict(_flattened(data, ""))
        return {name: flat[name] for name in tuning.spec.parameters if name in flat}
    graph = load_circuit(tuning.base)
    own: dict[str, str] = {"timing": graph.timing}
    for name, searched in tuning.spec.parameters.items():
        node, _, key = name.rpartition(".")
        parameters = next((each.parameters for each in graph.neurons if each.name == node), {})
        if name in graph.parameters:
            own[name] = format_quantity(graph.parameters[name].value_si, searched.unit, _ALL_DIGITS)
        elif key in parameters:
            own[name] = format_quantity(float(parameters[key]), searched.unit, _ALL_DIGITS)
    return own


def _flattened(data: Data, name: str) -> Iterator[tuple[str, str]]:
    """The values of mappings in mappings by their path."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _flattened(value, f"{name}.{key}" if name else key)
    elif not isinstance(data, list):
        yield name, str(data)
