"""Values as plain data, their checksums, and what differs between two of them, in words.

Plain data is what JSON can hold. A quantity is `{"=": [SI value, SI unit], "as": "200 ms"}`, of which only
the first part counts; a long array, or a file that is no text, is `{"sha256": …}`.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from circuitkit.base.errors import UnitError
from circuitkit.base.units import Quantity, Unit, parse_quantity
from circuitkit.circuit import CircuitGraph
from circuitkit.circuit.expressions.expression import Expression
from circuitkit.circuit.models import NeuronModel, SynapseModel

_WORDS = "description"  # what determines nothing wherever it is a text
_SI, _AS, _SUM = "=", "as", "sha256"
_MOST_ELEMENTS = 16  # of an array that is written out
_LONGEST = 60  # letters of a value that is shown
_DIGITS = 6


def _quantity(value_si: float, unit: str, text: str = "") -> Any:  # noqa: ANN401 - plain data
    """A quantity as plain data.

    Args:
        value_si: Its value, [SI].
        unit: The SI unit.
        text: How it was written, if that is known.
    """
    return {_SI: [plain(value_si), unit], _AS: text}


def plain(value: Any, keys: set[str] | None = None) -> Any:  # noqa: ANN401, C901, PLR0911 - any value, a line each
    """A value as plain data: of models, dataclasses, arrays and containers.

    Words that describe, and places in files, are left out. What is of another type is known by its class.

    Args:
        value: The value.
        keys: Of a model, these fields only.
    """
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else repr(float(value))
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, BaseModel):
        return _without_words(value, value.model_dump(mode="json", include=keys, context=_quantity))
    if isinstance(value, Quantity):
        return _quantity(value.value_si, value.dimension.si_symbol, str(value))
    if isinstance(value, Unit):
        return value.dimension.si_symbol  # values are in SI units, whatever they are shown in
    if isinstance(value, Expression | Path):
        return str(value)
    if isinstance(value, CircuitGraph):
        return _of_circuit(value)
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, set | frozenset):
        return sorted((plain(each) for each in value), key=json.dumps)
    if isinstance(value, np.ndarray | np.generic):
        return _of_array(np.asarray(value))
    if isinstance(value, Sequence):
        return [plain(each) for each in value]
    if is_dataclass(value):
        return {
            each.name: plain(getattr(value, each.name))
            for each in fields(value)
            if each.compare and each.name != _WORDS
        }
    return {"class": f"{type(value).__module__}.{type(value).__qualname__}"}


def _without_words(value: Any, data: Any) -> Any:  # noqa: ANN401 - any part of a model, and the same dumped
    """The data of a model without the texts that describe it or a part of it."""
    if isinstance(value, BaseModel):
        kept = {
            key: each for key, each in data.items() if key != _WORDS or key not in type(value).model_fields
        }
        return {key: _without_words(getattr(value, key, None), each) for key, each in kept.items()}
    if isinstance(value, Mapping) and isinstance(data, dict):
        return {key: _without_words(value.get(key), each) for key, each in data.items()}
    if isinstance(value, list | tuple) and isinstance(data, list):
        return [_without_words(each, its) for each, its in zip(value, data, strict=True)]
    return plain(data) if isinstance(data, float) else data


def _of_circuit(graph: CircuitGraph) -> dict[str, Any]:
    """A circuit whose models stand beside it, once each."""
    models: dict[str, Any] = {}
    names: dict[int, str] = {}

    def named(model: NeuronModel | SynapseModel) -> str:
        if id(model) not in names:
            data = {
                each.name: plain(getattr(model, each.name))
                for each in fields(model)
                if each.name not in {_WORDS, "source"}
            }
            name = model.name
            while models.setdefault(name, data) != data:  # another one of the same name
                name += "'"
            names[id(model)] = name
        return names[id(model)]

    data: dict[str, Any] = {"parameters": plain(graph.parameters)}  # first, since others follow from them
    for each in fields(graph):
        found = getattr(graph, each.name)
        if isinstance(found, tuple):
            data[each.name] = [_of_node(node, named) for node in found]
        elif each.name != _WORDS:
            data[each.name] = plain(found)
    return {**data, "models": models}


def _of_node(node: Any, named: Any) -> dict[str, Any]:  # noqa: ANN401 - a part of a graph, and who names models
    return {
        each.name: named(found) if isinstance(found, NeuronModel | SynapseModel) else plain(found)
        for each in fields(node)
        if each.compare and each.name != _WORDS
        for found in (getattr(node, each.name),)
    }


def _of_array(array: np.ndarray[Any, Any]) -> Any:  # noqa: ANN401 - plain data
    if array.size <= _MOST_ELEMENTS:
        return plain(array.tolist())
    data = np.ascontiguousarray(array)
    return {
        "array": f"{'x'.join(map(str, data.shape))} {data.dtype}",
        _SUM: hashlib.sha256(data.tobytes()).hexdigest(),
    }


def as_written(data: Any) -> Any:  # noqa: ANN401 - data of a file
    """Data without types, as a file has it: texts that are quantities with a unit become such."""
    if isinstance(data, dict):
        return data if _SI in data else {key: as_written(each) for key, each in data.items()}
    if isinstance(data, list):
        return [as_written(each) for each in data]
    if isinstance(data, str):
        try:
            quantity = parse_quantity(data)
        except UnitError:
            return data
        if quantity.unit.symbol != "1":
            return {**plain(quantity), _AS: data}
    return plain(data)


def digest(data: Any) -> str:  # noqa: ANN401 - plain data
    """32 hexadecimal digits that are equal for equal plain data; the order of keys does not count."""
    text = json.dumps(_counting(data), sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _counting(data: Any) -> Any:  # noqa: ANN401 - plain data
    """What counts of plain data: of quantities not how they are written."""
    if isinstance(data, dict):
        return data[_SI] if _SI in data else {key: _counting(each) for key, each in data.items()}
    return [_counting(each) for each in data] if isinstance(data, list) else data


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:  # noqa: ANN401 - plain data
    """What differs between plain data, leaf by leaf: `push.force was 20 N, is 30 N`.

    Args:
        old: What was.
        new: What is.
        where: The place of both.
    """
    if _counting(old) == _counting(new):
        return
    if _is_branch(old, dict) and _is_branch(new, dict):
        for key in dict.fromkeys((*old, *new)):
            inner = f"{where}.{key}" if where else str(key)
            yield from differences(old.get(key, _Nothing), new.get(key, _Nothing), inner)
    elif _is_branch(old, list) and _is_branch(new, list):
        mine, its = _by_place(old), _by_place(new)
        if mine.keys() == its.keys() and list(mine) != list(its):
            yield f"{where} has another order".lstrip()
        for key in dict.fromkeys((*mine, *its)):
            yield from differences(mine.get(key, _Nothing), its.get(key, _Nothing), f"{where}[{key}]")
    else:
        yield f"{where} {_changed(old, new)}".lstrip()


def _changed(old: Any, new: Any) -> str:  # noqa: ANN401 - plain data
    if old is _Nothing:
        return f"is new: {_shown(new)}"
    if new is _Nothing:
        return f"is gone: it was {_shown(old)}"
    if isinstance(old, dict) and isinstance(new, dict) and _SUM in old and _SUM in new:
        return "says something else"
    words = _shown if _shown(old) != _shown(new) else _exactly
    return f"was {words(old)}, is {words(new)}"


class _Nothing:
    """What is not there."""


def _is_branch(data: Any, kind: type) -> bool:  # noqa: ANN401 - plain data
    return isinstance(data, kind) and not (isinstance(data, dict) and (_SI in data or _SUM in data))


def _by_place(items: list[Any]) -> dict[str, Any]:
    """The items of a list by number; by names, if all have one of their own."""
    names = [_name(item) for item in items]
    if all(names) and len(set(names)) == len(names):
        return dict(zip(map(str, names), items, strict=True))
    return {str(number): item for number, item in enumerate(items)}


def _name(item: Any) -> str | None:  # noqa: ANN401 - plain data
    if not isinstance(item, dict):
        return None
    if "source" in item and "target" in item:
        return f"{item['source']} -> {item['target']}"
    name = item.get("name")
    return name if isinstance(name, str) else None


def _shown(value: Any) -> str:  # noqa: ANN401 - plain data
    if isinstance(value, dict) and _SI in value:
        number, unit = value[_SI]
        if unit == "rad" and not value[_AS]:
            number, unit = math.degrees(number), "deg"
        return str(value[_AS] or f"{number:.{_DIGITS}g}{'' if unit == '1' else f' {unit}'}")
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _exactly(value: Any) -> str:  # noqa: ANN401 - plain data
    """With all digits and letters."""
    if isinstance(value, dict) and _SI in value:
        number, unit = value[_SI]
        return f"{number!r} {unit}"
    return json.dumps(value, ensure_ascii=False)
