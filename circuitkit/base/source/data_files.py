"""Finding a file by its path, or a shipped one by its name."""

from __future__ import annotations

from pathlib import Path

from circuitkit.base.errors import InputError, Problem, listing, suggest

_PACKAGE = Path(__file__).parents[2]
_SUFFIX = ".yaml"


def data_folder(folder: str) -> Path:
    """Where shipped files of a kind lie: inside an installed package, or at the top of a source checkout.

    Args:
        folder: Such as "circuits" or "sims/studies".
    """
    installed = _PACKAGE / "_data" / folder
    return installed if installed.is_dir() else _PACKAGE.parent / folder


def shipped_names(folder: str) -> tuple[str, ...]:
    """Names of the shipped files of a kind, sorted.

    Args:
        folder: Such as "circuits" or "sims/studies".
    """
    return tuple(sorted(path.stem for path in data_folder(folder).glob(f"*{_SUFFIX}")))


def find_data_file(name_or_path: str | Path, folder: str) -> Path:
    """The path of a file: a path is returned as it is, a bare name is looked up among the shipped files.

    A bare name has no folder and no suffix. A file of that very name in the working folder goes first.

    Args:
        name_or_path: Such as `my/circuit.yaml` or `binn_lateral`.
        folder: Such as "circuits" or "sims/studies".

    Raises:
        InputError: There is no shipped file of this name; lists those there are.
    """
    path = Path(name_or_path)
    if path.suffix or len(path.parts) != 1 or path.is_file():
        return path
    names = shipped_names(folder)
    if path.name in names:
        return data_folder(folder) / f"{path.name}{_SUFFIX}"
    shipped = f"one of the shipped {Path(folder).name}: {listing(names)}"
    message = f"unknown name '{path}'; allowed: a path, or {shipped}"
    raise InputError(Problem(str(path), 1, 1, "", message, suggest(path.name, names)))
