"""Files with other values: comments, order and spelling of everything else stay."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from circuitkit.base.source import dump_yaml
from circuitkit.base.source.commented import Collection, Entry, Scalar, read_commented
from circuitkit.base.source.rewriting import write_commented

_WIDTH = 110
_SECTIONS = ("parameters", "neurons", "populations", "inputs", "outputs")
_HEADER = ("control_step", "timing", "substeps", "seed")
_SCHEMA = "# yaml-language-server:"


class ElsewhereError(LookupError):
    """What shall be changed stands in another file."""


def changed_file(text: str, values: Mapping[str, str], comment: Sequence[str]) -> str:
    """A file in which values are others; fields that it lacks are added.

    Args:
        text: The text of the file.
        values: By path, such as `lateral.limit`.
        comment: Lines that stand above it.
    """
    tree = read_commented(text)
    for path, value in values.items():
        _put(tree.top, path.split("."), value)
    return _headed(write_commented(tree, _WIDTH), comment)


def changed_circuit(
    text: str, values: Mapping[str, str], comment: Sequence[str], folders: tuple[Path, Path]
) -> str:
    """A circuit file in which values are others, by the names that `--set` takes.

    Args:
        text: The text of the file.
        values: Of parameters, of nodes, or of parameters of instances that the file includes; by name.
        comment: Lines that stand above it.
        folders: Where the file lies, and where the new one will lie: the paths of includes follow.

    Raises:
        ElsewhereError: A value does not stand in this file.
    """
    tree = read_commented(text)
    for name, value in values.items():
        _put(*_place(tree.top, name), value)
    include = _inside(tree.top, "include")
    for entry in () if include is None else include.entries:
        holder = entry if isinstance(entry.value, Scalar) else _entry(entry.value, "file")
        if holder is not None and isinstance(holder.value, Scalar):
            path = os.path.relpath((folders[0] / holder.value.value).resolve(), folders[1].resolve())
            holder.value = _scalar(path)
    return _headed(write_commented(tree, _WIDTH), comment)


def _place(top: Collection, name: str) -> tuple[Collection, Sequence[str]]:
    """The mapping in which a value stands, and the way from there."""
    if name in (*_HEADER, "circuit", "description"):
        return top, (name,)
    first, *rest = name.split(".")
    for section in _SECTIONS:
        found = _inside(top, section)
        entry = None if found is None else _entry(found, name if section == "parameters" else first)
        if found is not None and entry is not None:
            if section != "parameters":
                return found, (first, *rest)
            return found, (name, "value") if isinstance(entry.value, Collection) else (name,)
    include = _inside(top, "include")
    for entry in () if include is None else include.entries:
        if isinstance(entry.value, Collection) and len(rest) == 1:
            instance = _entry(entry.value, "as")
            if instance and isinstance(instance.value, Scalar) and instance.value.value == first:
                return entry.value, ("parameters", *rest)
    raise ElsewhereError(name)


def _inside(mapping: Collection, name: str) -> Collection | None:
    entry = _entry(mapping, name)
    return entry.value if entry is not None and isinstance(entry.value, Collection) else None


def _entry(mapping: Collection, name: str) -> Entry | None:
    if not mapping.is_mapping:
        return mapping.entries[int(name)] if name.isdigit() and int(name) < len(mapping.entries) else None
    return next((each for each in mapping.entries if each.name == name), None)


def _scalar(value: str) -> Scalar:
    return Scalar((dump_yaml(value).splitlines()[0],), value)


def _put(mapping: Collection, path: Sequence[str], value: str) -> None:
    """Change or add a value of a mapping, or of one in it."""
    name, *inner = path
    entry = _entry(mapping, name)
    if entry is None:
        content = Collection(is_mapping=True, flow=True) if inner else _scalar(value)
        entry = Entry(name, name, content, (0, 0), (0, 0), mapping)
        mapping.entries.append(entry)
    if not inner:
        entry.value = _scalar(value)
    elif isinstance(entry.value, Collection):
        _put(entry.value, inner, value)
    else:
        raise ElsewhereError(".".join(path))


def _headed(text: str, comment: Sequence[str]) -> str:
    """The text with a comment above it, below a line for editors."""
    first, _, rest = text.partition("\n")
    head = [f"{first}\n#"] if first.startswith(_SCHEMA) else []
    below = rest if head else text
    above = "\n".join([*head, *commented(comment)])
    return (
        f"{above}\n#\n{below.removeprefix('#').lstrip()}" if below.startswith("#\n") else f"{above}\n{below}"
    )


def commented(lines: Sequence[str]) -> list[str]:
    """Lines as comments."""
    return [f"# {line}".rstrip() for line in lines]
