"""A commented circuit to start from: one of a few templates, under the author's own name."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

from circuitkit.base.errors import CircuitkitError, InputError, Problem, UnknownNameError
from circuitkit.base.files import write_text
from circuitkit.circuit.authoring.schema import circuit_schema
from circuitkit.circuit.spec import NAME_PATTERN

_FOLDER = Path(__file__).parent / "starters"
TEMPLATES: tuple[str, ...] = tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))
SCHEMA_NAME = "circuit.schema.json"
_SUFFIXES = (".yaml", ".yml")


class ExistsError(CircuitkitError):
    """There is a file already, which is not overwritten unasked."""

    exit_code = 1


def starter_text(template: str, file_name: str) -> str:
    """Return the text of a template for a file of this name, after which the circuit is called too.

    Args:
        template: One of `TEMPLATES`.
        file_name: Such as `my_circuit.yaml`.

    Raises:
        UnknownNameError: There is no such template.
    """
    if template not in TEMPLATES:
        kind = "template"
        raise UnknownNameError(kind, template, TEMPLATES)
    text = (_FOLDER / f"{template}.yaml").read_text(encoding="utf-8")
    name = re.sub(r"\W", "_", Path(file_name).stem, flags=re.ASCII)
    if re.match(NAME_PATTERN, name):
        text = text.replace(f"circuit: {template}\n", f"circuit: {name}\n", 1)
    return re.sub(rf"\b{template}\.(yaml|svg)\b", lambda match: _renamed(match[1], file_name), text)


def _renamed(suffix: str, file_name: str) -> str:
    return shlex.quote(file_name if suffix == "yaml" else str(Path(file_name).with_suffix(f".{suffix}")))


def write_starter(path: str | Path, template: str, *, force: bool = False) -> list[Path]:
    """Write a starter, and beside it the JSON Schema that its first line names, if there is none yet.

    Args:
        path: Where the circuit goes; ends in .yaml or .yml.
        template: One of `TEMPLATES`.
        force: Overwrite a file that is there.

    Returns:
        The files that were written.

    Raises:
        UnknownNameError: There is no such template.
        InputError: The path has another suffix.
        ExistsError: There is a file already.
        OutputError: The file cannot be written.
    """
    file = Path(path)
    if file.suffix.lower() not in _SUFFIXES:
        found = f"the suffix '{file.suffix}'" if file.suffix else "no suffix"
        hint = f"did you mean '{file.with_suffix('.yaml')}'?" if file.name else ""
        raise InputError(
            Problem("", 0, 0, str(path), f"found {found}; allowed: {', '.join(_SUFFIXES)}", hint)
        )
    text = starter_text(template, file.name)
    if file.is_file() and not force:
        message = f"'{path}' exists already; name another file, or overwrite it with --force"
        raise ExistsError(message)
    write_text(file, text)
    schema = file.with_name(SCHEMA_NAME)
    if schema.exists():
        return [file]
    write_text(schema, json.dumps(circuit_schema(), indent=2, ensure_ascii=False) + "\n")
    return [file, schema]
