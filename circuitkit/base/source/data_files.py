"""Finding a file by its path, or by its name one that ships or that a plug-in brings.

A plug-in brings files by an entry point of the group `circuitkit.data`, which names a package whose folder
has some of the folders `circuits`, `models`, `robots` and `sims`, arranged as ours. What ships comes first,
then the plug-ins in the alphabetical order of their entry points: where two have a file of one name, the name
is the first one's, a warning says so, and the other file is found by its path.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from circuitkit.base.errors import InputError, Problem, Unopened, listing, suggest, warn_once
from circuitkit.base.reading import is_file
from circuitkit.base.registry import plugged_in
from circuitkit.base.source.validation import describe

_PACKAGE = Path(__file__).parents[2]
_TOPS = ("circuits", "models", "robots", "sims")
_SUFFIX = ".yaml"


def data_folder(folder: str) -> Path:
    """Where shipped files of a kind lie: inside an installed package, or at the top of a source checkout.

    Args:
        folder: Such as "circuits" or "sims/studies"; models lie in the package anyway.
    """
    if folder.partition("/")[0] == "models":
        return _PACKAGE / "circuit" / folder
    installed = _PACKAGE / "_data" / folder
    return installed if installed.is_dir() else _PACKAGE.parent / folder


def data_folders(folder: str) -> tuple[Path, ...]:
    """The folders in which files of a kind lie: that of the shipped ones, and then those of plug-ins.

    Args:
        folder: As of `data_folder`.
    """
    others = (top / folder for top in _plugged_in())
    return (data_folder(folder), *(each for each in others if each.is_dir()))


@cache
def _plugged_in() -> tuple[Path, ...]:
    """The folders that plug-ins bring, each once.

    Nothing of theirs is imported but the packages around the named one.
    """
    return tuple(dict.fromkeys(plugged_in("data", _folders_of)))


def _folders_of(point: EntryPoint) -> Iterator[Path]:
    spec = find_spec(point.value)
    places = [Path(each) for each in (spec and spec.submodule_search_locations) or ()]
    found = [place for place in places if any((place / top).is_dir() for top in _TOPS)]
    if not found:
        message = f"'{point.value}' is no package with one of the folders {listing(_TOPS)}"
        raise LookupError(message)
    yield from found


def files_by_name(folder: str, pattern: str = f"*{_SUFFIX}") -> dict[str, tuple[Path, ...]]:
    """The files of a kind by their path in its folder, sorted; of several, the first has the name.

    Args:
        folder: Such as "circuits" or "sims/studies".
        pattern: What their paths look like, from there.
    """
    found: dict[str, tuple[Path, ...]] = {}
    for place in data_folders(folder):
        for path in place.glob(pattern):
            name = path.relative_to(place).as_posix()
            found[name] = (*found.get(name, ()), path)
    return dict(sorted(found.items()))


def shipped_names(folder: str) -> tuple[str, ...]:
    """Names of the files of a kind that ship or that a plug-in brings, sorted.

    Args:
        folder: Such as "circuits" or "sims/studies".
    """
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in files_by_name(folder)))


def shipped_file(folder: str, inner: str) -> Path | None:
    """The file at a path in the folder of its kind; None if nobody has it.

    Args:
        folder: Such as "circuits" or "robots".
        inner: Such as "binn_lateral.yaml" or "nao/robot.yaml".
    """
    found = [place / inner for place in data_folders(folder) if is_file(place / inner)]
    for other in found[1:]:
        warn_once(f"'{inner}' stands for '{found[0]}'; '{other}' has the same name: use its path")
    return found[0] if found else None


def path_of(name_or_path: object, what: str) -> Path:
    """A name or a path as a path.

    Args:
        name_or_path: Such as `my/circuit.yaml` or `binn_lateral`; in Python it may be anything.
        what: What such a file holds, such as "circuits".

    Raises:
        InputError: It is neither.
    """
    if isinstance(name_or_path, str | PathLike):
        return Path(name_or_path)
    message = f"found {describe(name_or_path)}; allowed: the name of one of the shipped {what}, or a path"
    raise InputError(Problem("", 0, 0, "", message))


def find_data_file(name_or_path: str | Path, folder: str) -> Path:
    """The path of a file: a path is returned as it is, a bare name is looked up as `shipped_file` does.

    A bare name has no folder and no suffix. A file of that very name in the working folder goes first.

    Args:
        name_or_path: Such as `my/circuit.yaml` or `binn_lateral`.
        folder: Such as "circuits" or "sims/studies".

    Raises:
        InputError: There is no shipped file of this name; lists those there are.
    """
    path = path_of(name_or_path, Path(folder).name)
    if path.suffix or len(path.parts) != 1 or is_file(path):
        return path
    if found := shipped_file(folder, f"{path.name}{_SUFFIX}"):
        return found
    names = shipped_names(folder)
    shipped = f"one of the shipped {Path(folder).name}: {listing(names)}"
    message = f"unknown name '{path}'; allowed: a path, or {shipped}"
    raise InputError(Unopened(str(path), 1, 1, "", message, suggest(path.name, names)))
