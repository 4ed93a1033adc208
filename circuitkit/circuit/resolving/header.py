"""What a circuit file says about the whole circuit: its name, timing, control step, substeps and seed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

from circuitkit.base.errors import listing, suggest
from circuitkit.base.units import DIMENSIONLESS, Quantity, parse_unit
from circuitkit.circuit.graph import Timing
from circuitkit.circuit.resolving.items import Item
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
    for each in scope.everything():
        _compare(scope, each, step, substeps)
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


def _compare(root: Scope, scope: Scope, step: Quantity | None, substeps: int | None) -> None:
    """Complain about included files that are made for another timing, control step or number of substeps."""
    wanted: dict[str, Quantity | None] = {
        "control_step": step,
        "substeps": None if substeps is None else Quantity(float(substeps), DIMENSIONLESS),
    }
    timing = root.main.spec.timing
    for part in scope.parts:
        if part is root.parts[-1]:
            continue
        item: Item[FileSpec] = Item("", part.spec, part, ())
        if part.spec.timing not in {None, timing}:
            message = f"found {part.spec.timing}, but the file that includes this one has {timing}"
            scope.errors.append(item.problem(("timing",), f"{message}; allowed: the same"))
        for key, whole in wanted.items():
            value = getattr(part.spec, key)
            if value is None or whole is None or key in root.findings.overrides:
                continue
            found = scope.value(item, (key,), value, _SECOND if key == "control_step" else DIMENSIONLESS)
            if found is not None and found.value_si != whole.value_si:
                message = f"found {found}, but the file that includes this one has {whole}; allowed: the same"
                scope.errors.append(item.problem((key,), message))


def _require_sections(scope: Scope) -> None:
    """Complain about a circuit without neurons or outputs."""
    if scope.incomplete or scope.lost or scope.lost_instances:
        return
    has_neurons = any(each.neurons or each.populations for each in scope.everything())
    for section, is_there in (("neurons", has_neurons), ("outputs", bool(scope.published))):
        if not is_there:
            message = f"the circuit has no {section}; allowed: at least one"
            scope.errors.append(scope.main.problem((section,), message))
