"""Values for every member of a population: one for all, a list, a range, a distribution, or an expression."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from circuitkit.base.errors import listing, suggest
from circuitkit.base.source import Place, describe
from circuitkit.base.units import DIMENSIONLESS, Quantity
from circuitkit.circuit.expressions.values import Amount
from circuitkit.circuit.resolving.declarations import Item
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.spec import DISTRIBUTIONS

_PAIR = 2


def generator(seed: int, name: str) -> np.random.Generator:
    """Return the source of random numbers of one entry: its own stream, whatever else the circuit has.

    Args:
        seed: Seed of the circuit.
        name: Name of the entry in the whole circuit, with what is drawn for it.
    """
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "little")))


def member_values(scope: Scope, item: Item[Any], place: Place, value: object, size: int) -> Amount | None:
    """Return values for the members of a population; expressions may use `i` (from 0) and `n`.

    Args:
        scope: Where the values stand.
        item: The entry with the values.
        place: Where in it.
        value: As written.
        size: How many members.

    Returns:
        One number or an array of shape (size,), [SI]; None after complaining.
    """
    address, is_given = scope.address(item, place), scope.is_given(item, place)
    written = scope.findings.overrides[address] if is_given else value
    if isinstance(written, list | tuple | dict):
        return listed(scope.root if is_given else scope, item, place, written, size, address)
    members = Amount(np.arange(size, dtype=np.float64), DIMENSIONLESS)
    return scope.amounts(item, place, value, {"i": members, "n": Amount(float(size), DIMENSIONLESS)})


def listed(
    scope: Scope,
    item: Item[Any],
    place: Place,
    value: Sequence[object] | dict[str, object],
    size: int,
    stream: str,
) -> Amount | None:
    """Return values from a list, a range or a distribution.

    Args:
        scope: Where the values stand.
        item: The entry with the values.
        place: Where in it.
        value: As written.
        size: How many values.
        stream: What names the random numbers.

    Returns:
        An array of shape (size,), [SI]; None after complaining.
    """
    if isinstance(value, dict):
        return _drawn(scope, item, place, value, size, stream)
    if len(value) != size:
        message = f"found a list of {len(value)}; allowed: one value, or a list of {size}"
        scope.errors.append(item.problem(place, message))
        return None
    return _array(scope, item, place, value)


def _array(scope: Scope, item: Item[Any], place: Place, values: Sequence[object]) -> Amount | None:
    """Return values one by one, all of the same dimension."""
    if all(type(value) in {int, float} for value in values):
        return Amount(np.array(values, dtype=np.float64), DIMENSIONLESS)
    found = [scope.value(item, (*place, number), value) for number, value in enumerate(values)]
    quantities = [quantity for quantity in found if quantity is not None]
    if len(quantities) != len(found):
        return None
    unit = quantities[0].unit
    for number, quantity in enumerate(quantities):
        reason = f"the first one is {quantities[0]}"
        if not scope.fits(item, (*place, number), quantity, unit, reason):
            return None
    return Amount(np.array([quantity.value_si for quantity in quantities]), unit)


def _drawn(
    scope: Scope, item: Item[Any], place: Place, value: dict[str, object], size: int, stream: str
) -> Amount | None:
    """Return a range or a distribution."""
    kinds = [*value]
    if len(kinds) != 1 or kinds[0] not in DISTRIBUTIONS:
        wrong = next((kind for kind in kinds if kind not in DISTRIBUTIONS), "")
        found = f"'{wrong}'" if wrong else f"{len(kinds)} keys"
        message = f"found {found}; allowed: one of {listing(DISTRIBUTIONS)}, with a list of two values"
        inner = (*place, wrong) if wrong else place
        scope.errors.append(item.problem(inner, message, suggest(wrong, DISTRIBUTIONS), at_key=bool(wrong)))
        return None
    (kind,) = kinds
    pair = value[kind]
    if not isinstance(pair, list | tuple) or len(pair) != _PAIR:
        found = f"a list of {len(pair)}" if isinstance(pair, list | tuple) else describe(pair)
        scope.errors.append(item.problem((*place, kind), f"found {found}; allowed: a list of two values"))
        return None
    first, second = (scope.value(item, (*place, kind, k), each) for k, each in enumerate(pair))
    if first is None or second is None:
        return None
    if not scope.fits(item, (*place, kind, 1), second, first.unit, f"the first one is {first}"):
        return None
    if (kind == "uniform" and second.value_si < first.value_si) or (kind == "normal" and second.value_si < 0):
        allowed = (
            "the smaller value, then the larger one"
            if kind == "uniform"
            else "a mean, then a deviation of 0 or more"
        )
        scope.errors.append(item.problem((*place, kind), f"found {first} and {second}; allowed: {allowed}"))
        return None
    return Amount(_numbers(kind, first, second, size, generator(scope.findings.seed, stream)), first.unit)


def _numbers(
    kind: str, first: Quantity, second: Quantity, size: int, random: np.random.Generator
) -> npt.NDArray[np.float64]:
    """Shape (size,), [SI]; made in place, for there may be many."""
    if kind == "range":
        return np.linspace(first.value_si, second.value_si, size)
    numbers = np.empty(size)
    if kind == "uniform":
        random.random(out=numbers)
        numbers *= second.value_si - first.value_si
    else:
        random.standard_normal(out=numbers)
        numbers *= second.value_si
    numbers += first.value_si
    return numbers
