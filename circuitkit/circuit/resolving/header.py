"""What a circuit file says about the whole circuit: its name, timing, control step, substeps and seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

from circuitkit.base.errors import listing, suggest
from circuitkit.base.units import DIMENSIONLESS, Quantity, parse_unit
from circuitkit.circuit.graph import Timing
from circuitkit.circuit.parts import Part
from circuitkit.circuit.resolving.declarations import Item
from circuitkit.circuit.resolving.scope import Scope
from circuitkit.circuit.spec import FileSpec

_SECOND = parse_unit("s")
_SHORTEST_STEP_S, _LONGEST_STEP_S = 1e-9, 3600.0
MOST_COUNT = 2**53  # up to which floats have every whole number
MOST_SUBSTEPS = 1_000_000
HEADER_KEYS = ("control_step", "timing", "substeps", "seed")
_TIMINGS: tuple[Timing, ...] = get_args(Timing)


@dataclass(frozen=True)
class Header:
    """What holds for the whole circuit.

    Attributes:
        timing: When a neuron sees what.
        step_s: Control step, [s].
        substeps: Substeps of continuous models in a control step.
        seed: Seed of distributions and random connections.
    """

    timing: Timing
    step_s: float
    substeps: int
    seed: int


def read_header(scope: Scope) -> Header | None:
    """Read the header of a circuit; complain about included files made for another step or timing."""
    main, spec = scope.main, scope.main.spec
    timing = _timing(scope)
    step = None
    if spec.control_step is not None or scope.is_given(main, ("control_step",)):
        step = scope.value(main, ("control_step",), spec.control_step, _SECOND)
        if step is not None and not _SHORTEST_STEP_S <= step.value_si <= _LONGEST_STEP_S:
            allowed = "more than 0 s" if step.value_si <= 0 else "1 ns to 1 h"
            scope.errors.append(main.problem(("control_step",), f"found {step}; allowed: {allowed}"))
            step = None
    substeps = whole_number(scope, "substeps", 1, 1, MOST_SUBSTEPS)
    seed = whole_number(scope, "seed", 0, 0)
    finest = substeps
    for each in scope.everything():
        _compare(scope, each, step)
        finest = None if finest is None else max(finest, *_substeps_within(scope, each))
    substeps = substeps if scope.is_given(main, ("substeps",)) else finest
    _require_sections(scope)
    if timing is None or step is None or substeps is None or seed is None:
        return None
    return Header(timing, step.value_si, substeps, seed)


def _timing(scope: Scope) -> Timing | None:
    if not scope.is_given(scope.main, ("timing",)):
        return scope.main.spec.timing
    given = scope.findings.overrides["timing"]
    for timing in _TIMINGS:
        if given == timing:
            return timing
    message = f"found '{given}'; allowed: {listing(_TIMINGS)}"
    scope.errors.append(scope.main.problem(("timing",), message, suggest(str(given), _TIMINGS)))
    return None


def whole_number(scope: Scope, key: str, absent: int, least: int, most: int = MOST_COUNT) -> int | None:
    """Return a whole number of the circuit file; None after complaining."""
    value = getattr(scope.main.spec, key)
    if value is None and not scope.is_given(scope.main, (key,)):
        return absent
    quantity = scope.value(scope.main, (key,), value, DIMENSIONLESS, f"{key} is a number")
    if quantity is None:
        return None
    return _counted_in(scope, scope.main, key, quantity, least, most)


def _counted_in(
    scope: Scope, item: Item[FileSpec], key: str, quantity: Quantity, least: int, most: int
) -> int | None:
    """A quantity as a whole number within bounds; None after complaining."""
    if (count := counted(quantity.value_si, least, most)) is None:
        bounds = f"from {least} on" if quantity.value_si <= most else f"from {least} to {most}"
        scope.errors.append(item.problem((key,), f"found {quantity}; allowed: a whole number {bounds}"))
    return count


def counted(value: float, least: int, most: int = MOST_COUNT) -> int | None:
    """A number as a whole one within bounds; None if it is none."""
    return int(value) if least <= value <= most and value == int(value) else None


def _compare(root: Scope, scope: Scope, step: Quantity | None) -> None:
    """Complain about included files that are made for another timing or control step."""
    timing = root.main.spec.timing
    for part, item in _included(root, scope):
        if part.spec.timing not in {None, timing}:
            message = f"found {part.spec.timing}, but the file that includes this one has {timing}"
            scope.errors.append(item.problem(("timing",), f"{message}; allowed: the same"))
        value = part.spec.control_step
        if value is None or step is None or "control_step" in root.findings.overrides:
            continue
        found = scope.value(item, ("control_step",), value, _SECOND)
        if found is not None and found.value_si != step.value_si:
            message = f"found {found}, but the file that includes this one has {step}; allowed: the same"
            scope.errors.append(item.problem(("control_step",), message))


def _substeps_within(root: Scope, scope: Scope) -> list[int]:
    """Return the substeps that included files ask for; the whole is stepped as finely as the finest."""
    found = [1]
    for part, item in _included(root, scope):
        if part.spec.substeps is not None:
            quantity = scope.value(item, ("substeps",), part.spec.substeps, DIMENSIONLESS)
            if quantity is not None:
                found.append(_counted_in(scope, item, "substeps", quantity, 1, MOST_SUBSTEPS) or 1)
    return found


def _included(root: Scope, scope: Scope) -> Iterator[tuple[Part, Item[FileSpec]]]:
    for part in scope.parts:
        if part is not root.parts[-1]:
            yield part, Item("", part.spec, part, ())


def _require_sections(scope: Scope) -> None:
    """Complain about a circuit without neurons or outputs."""
    if scope.incomplete or scope.lost or scope.lost_instances:
        return
    has_neurons = any(each.neurons or each.populations for each in scope.everything())
    for section, is_there in (("neurons", has_neurons), ("outputs", bool(scope.published))):
        if not is_there:
            message = f"the circuit has no {section}; allowed: at least one"
            scope.errors.append(scope.main.problem((section,), message))
