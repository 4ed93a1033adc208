"""What ships: every folder of data files, with a line about each file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.source import data_folder, read_yaml

# Where the files of a kind lie, as patterns from the top of the data.
FOLDERS = {
    "circuits": "circuits/*.yaml",
    "robots": "robots/*/robot.yaml",
    "scenarios": "sims/*.yaml",
    "controllers": "sims/controllers/*.yaml",
    "gaits": "sims/gaits/*.yaml",
    "studies": "sims/studies/*.yaml",
}


@dataclass(frozen=True)
class Shipped:
    """A file that ships.

    Attributes:
        kind: Such as "circuits".
        name: By which commands find it.
        description: What it says of itself.
        path: Where it lies.
    """

    kind: str
    name: str
    description: str
    path: Path


def catalogue(kind: str | None = None) -> tuple[Shipped, ...]:
    """All shipped files of a kind, or of all kinds.

    Args:
        kind: Such as "circuits"; all if None.

    Raises:
        UnknownNameError: There is no such kind; lists those there are.
    """
    if kind is not None and kind not in FOLDERS:
        what = "kind"
        raise UnknownNameError(what, kind, FOLDERS)
    found = []
    for each, pattern in FOLDERS.items():
        if kind in {None, each}:
            top, _, rest = pattern.partition("/")
            for path in sorted(data_folder(top).glob(rest)):
                name = path.parent.name if path.stem == "robot" else path.stem
                found.append(Shipped(each, name, _description(path), path))
    return tuple(found)


def _description(path: Path) -> str:
    data = read_yaml(path).data
    text = data.get("description", "") if isinstance(data, dict) else ""
    return str(text).partition("\n")[0].strip()
