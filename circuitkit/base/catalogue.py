"""What files and commands can name, a line about each: data files, and kinds that register themselves."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.registry import Registry
from circuitkit.base.source import data_folders, files_by_name, read_yaml


@dataclass(frozen=True)
class Listed:
    """Something that can be named.

    Attributes:
        kind: Such as "circuits", or "kinds-of-measures".
        name: By which commands and files find it; the path of a file whose name is another one's.
        description: What it says of itself.
        path: Where it lies; of a kind, where its class does.
    """

    kind: str
    name: str
    description: str
    path: Path


def catalogue(kind: str | None = None, registries: Iterable[Registry[Any]] = ()) -> tuple[Listed, ...]:
    """All data files of a kind, or of all kinds; then the kinds of registries.

    Args:
        kind: Such as "circuits"; all if None.
        registries: Their kinds are listed too: those of `Registry("measures", ...)` as "kinds-of-measures".

    Raises:
        UnknownNameError: There is no such kind; lists those there are.
    """
    listings: dict[str, Callable[[str], Iterable[Listed]]] = {
        **{name: partial(_files, folders) for name, folders in file_kinds().items()},
        **{f"kinds-of-{each.word.replace('_', '-')}": partial(_kinds, each) for each in registries},
    }
    if kind is not None and kind not in listings:
        what = "kind"
        raise UnknownNameError(what, kind, listings)
    return tuple(listed for name, give in listings.items() if kind in {None, name} for listed in give(name))


def file_kinds() -> dict[str, list[str]]:
    """The kinds of data files, and the folders in which each kind lies."""
    return {
        "circuits": ["circuits"],
        "robots": ["robots"],
        "scenarios": ["sims"],
        **{inner: [f"sims/{inner}"] for inner in _folders_in("sims")},
        "models": [f"models/{inner}" for inner in _folders_in("models")],
    }


def _folders_in(folder: str) -> list[str]:
    """The folders in the folders of a kind, each of which holds files of a kind."""
    inner = (path.name for place in data_folders(folder) for path in place.iterdir() if path.is_dir())
    return sorted(name for name in set(inner) if files_by_name(f"{folder}/{name}"))


def _files(folders: Iterable[str], kind: str) -> Iterator[Listed]:
    for folder in folders:
        for paths in files_by_name(folder, "*/robot.yaml" if folder == "robots" else "*.yaml").values():
            for path in paths:
                name, said = path.parent.name if folder == "robots" else path.stem, _description(path)
                if path == paths[0]:
                    yield Listed(kind, name, said, path)
                else:
                    yield Listed(kind, str(path), f"{said} (the name '{name}' is that of {paths[0]})", path)


def _description(path: Path) -> str:
    """The first line of what a file says of itself; a model's begins with what it is a model of."""
    data = read_yaml(path).data
    known = data if isinstance(data, dict) else {}
    first = str(known.get("description", "")).partition("\n")[0].strip()
    return f"{path.parent.name.removesuffix('s')}: {first}" if "model" in known else first


def _kinds(registry: Registry[Any], kind: str) -> Iterator[Listed]:
    for name, made in registry.kinds.items():
        yield Listed(kind, name, summary(made), Path(inspect.getfile(made)))


def summary(made: type) -> str:
    """The first paragraph of what a class says of itself, on one line."""
    return " ".join((made.__doc__ or "").partition("\n\n")[0].split())
