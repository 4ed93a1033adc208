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
        if step is not None and step.value_si <= 0:
            message = f"found {step}; allowed: more than 0 s"
            scope.errors.append(main.problem(("control_step",), message))
    substeps = whole_number(scope, "substeps", 1, 1)
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


def whole_number(scope: Scope, key: str, absent: int, least: int) -> int | None:
    """Return a whole number of the circuit file; None after complaining."""
    value = getattr(scope.main.spec, key)
    if value is None and not scope.is_given(scope.main, (key,)):
        return absent
    quantity = scope.value(scope.main, (key,), value, DIMENSIONLESS, f"{key} is a number")
    if quantity is None:
        return None
    if quantity.value_si != int(quantity.value_si) or quantity.value_si < least:
        message = f"found {quantity}; allowed: a whole number from {least} on"
        scope.errors.append(scope.main.problem((key,), message))
        return None
    return int(quantity.value_si)


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
            if quantity is not None and quantity.value_si == int(quantity.value_si):
                found.append(int(quantity.value_si))
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
