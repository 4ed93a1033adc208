"""Values that a user sets from outside, as the command line does, with messages that say so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from circuitkit.base.errors import InputError, Problem
from circuitkit.circuit.graph import CircuitGraph
from circuitkit.circuit.resolve import resolve
from circuitkit.circuit.spec import CircuitSpec


def resolve_with(spec: CircuitSpec, settings: Mapping[str, str], option: str = "--set") -> CircuitGraph:
    """A circuit in which some values are others; see `resolve`.

    Args:
        spec: A circuit without errors.
        settings: The values by name.
        option: What they were given with; stands in messages.

    Raises:
        InputError: There is no such name, or the circuit is wrong with these values.
    """
    if not settings:
        return resolve(spec)
    try:
        return resolve(spec, settings)
    except InputError as error:
        raise InputError(*(_told(each, option) for each in error.problems)) from error


def _told(problem: Problem, option: str) -> Problem:
    """A problem whose message names the option."""
    if not (problem.file or problem.where):
        return replace(problem, where=option)
    return replace(problem, message=f"{problem.message} (with {option})")
