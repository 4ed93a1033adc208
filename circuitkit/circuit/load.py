"""Circuit files to `CircuitSpec`, with every error of all files at once."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import Document, find_data_file, scan_text, scan_yaml
from circuitkit.circuit.parts import read_module
from circuitkit.circuit.resolve import analyse
from circuitkit.circuit.resolving.items import Findings
from circuitkit.circuit.spec import CircuitSpec

FOLDER = "circuits"


def load_circuit(path_or_name: str | Path) -> CircuitSpec:
    """Read a circuit file and check it.

    Args:
        path_or_name: A path, or the name of a shipped circuit.

    Raises:
        InputError: With every error of the file and of those it includes.
    """
    return _sound(_examine(partial(scan_yaml, find_data_file(path_or_name, FOLDER))))


def parse_circuit(text: str, path: str = "<text>") -> CircuitSpec:
    """Read the text of a circuit file and check it.

    Args:
        text: The text.
        path: What stands in messages; includes start from its folder.

    Raises:
        InputError: With every error of the text and of the files it includes.
    """
    return _sound(_examine(partial(scan_text, text, path)))


def check(path_or_name: str | Path) -> tuple[tuple[Problem, ...], tuple[Problem, ...]]:
    """All errors and all warnings of a circuit file and of those it includes, in the order of the text.

    Args:
        path_or_name: A path, or the name of a shipped circuit.

    Returns:
        The errors and the warnings.
    """
    try:
        path = find_data_file(path_or_name, FOLDER)
    except InputError as error:
        return error.problems, ()
    found = _examine(partial(scan_yaml, path))
    return found.errors, found.warnings


@dataclass(frozen=True)
class _Examined:
    spec: CircuitSpec | None
    errors: tuple[Problem, ...]
    warnings: tuple[Problem, ...]


def _sound(found: _Examined) -> CircuitSpec:
    if found.spec is None or found.errors:
        raise InputError(*found.errors)
    return found.spec


@contextmanager
def _collecting_later() -> Iterator[None]:
    """No search for garbage meanwhile: reading makes very many objects that stay, and hardly any garbage."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _examine(read: Callable[[], tuple[Document | None, list[Problem]]]) -> _Examined:
    with _collecting_later():
        return _examined(*read())


def _examined(document: Document | None, problems: list[Problem]) -> _Examined:
    if document is None:
        return _Examined(None, tuple(problems), ())
    module, spec, form = read_module(document)
    findings = Findings()
    graph = analyse(module, findings, is_whole=not (problems or form))
    errors = _in_order([*problems, *form, *findings.errors])
    remembering = spec.from_files(module, graph) if spec and not errors else None
    return _Examined(remembering, errors, _in_order(findings.warnings))


def _in_order(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """The problems in the order of the text, one for each place: the first one there caused the others."""
    by_place: dict[tuple[str, int, int, str], Problem] = {}
    for problem in problems:
        by_place.setdefault((problem.file, problem.line, problem.column, problem.where), problem)
    files = list(dict.fromkeys(problem.file for problem in by_place.values()))
    return tuple(sorted(by_place.values(), key=lambda each: (files.index(each.file), each.line, each.column)))
