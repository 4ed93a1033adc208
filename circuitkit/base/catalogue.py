"""What ships: every folder of data files, with a line about each file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from circuitkit.base.errors import UnknownNameError
from circuitkit.base.source import data_folder, read_yaml

_PACKAGE = Path(__file__).parents[1]  # models lie inside of it


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
    folders = _folders()
    if kind is not None and kind not in folders:
        what = "kind"
        raise UnknownNameError(what, kind, folders)
    found = []
    for each, pattern in folders.items():
        if kind in {None, each}:
            top, _, rest = pattern.partition("/")
            folder = _PACKAGE if top == _PACKAGE.name else data_folder(top)
            for path in sorted(folder.glob(rest)):
                name = path.parent.name if path.stem == "robot" else path.stem
                found.append(Shipped(each, name, _description(path), path))
    return tuple(found)


def _folders() -> dict[str, str]:
    """Where the files of a kind lie, as patterns from the top of the data; a folder in `sims` is a kind."""
    inner = sorted(path.name for path in data_folder("sims").iterdir() if path.is_dir())
    return {
        "circuits": "circuits/*.yaml",
        "robots": "robots/*/robot.yaml",
        "scenarios": "sims/*.yaml",
        **{name: f"sims/{name}/*.yaml" for name in inner},
        "models": f"{_PACKAGE.name}/circuit/models/*/*.yaml",
    }


def _description(path: Path) -> str:
    """The first line of what a file says of itself; a model's begins with what it is a model of."""
    data = read_yaml(path).data
    known = data if isinstance(data, dict) else {}
    first = str(known.get("description", "")).partition("\n")[0].strip()
    return f"{path.parent.name.removesuffix('s')}: {first}" if "model" in known else first
