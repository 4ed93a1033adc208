"""The identity of runs: all that determines them, in one value, which caches, keys, manifests and resume ask.

It consists of parts: the scenario, the robot file, the MJCF with all that it includes and loads, what MuJoCo
compiles of it, reference, controller and circuits with all that they include and load, the backends that run
the circuits, and the versions of the packages. A part is plain data, so that what differs can be told, and a
checksum of it, which is all that goes to workers.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.metadata
import json
import platform
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import scipy

import circuitkit
from circuitkit.circuit import CircuitGraph
from circuitkit.control import ControllerSpec
from circuitkit.engine import compile_circuit
from circuitkit.robots import Robot
from circuitkit.robots.mjcf_identity import compiled_sum, mjcf_files
from circuitkit.simulation import Reference, Scenario
from circuitkit.study.plain import differences, digest, plain

_OURS = circuitkit.__name__
_MOST_SHOWN = 6
_LONGEST = 60_000  # letters that a TEXT of MySQL and a name of Optuna's JSON take
_OF_ALL = ("is ", "was ", "says ")  # what is told of a thing as a whole begins with one of these
_OTHER_FORMS = "says something else in some of the runs"  # may well follow from what another file says
_COMPILED = "what MuJoCo compiles of"
# Fields of a scenario that determine nothing themselves, or are parts of their own; all others count.
_ELSEWHERE = {
    "scenario", "description", "seed", "robot", "reference", "controller", "circuit", "settings",
    "disturbances", "measures",
}  # fmt: skip


class Part:
    """One of the things that determine a run; its data is made when somebody asks.

    Attributes:
        title: What it is in words, such as `circuit binn_lateral`; it does not count.
        folder: Of files, where they lie, in words; None for anything else.
    """

    def __init__(self, title: str, make: Callable[[], Any], folder: Path | None = None) -> None:
        """Say what it is, and how its data is made."""
        self.title = title
        self.folder = folder
        self._make = make
        self._data: Any = None
        self._digest = ""

    @property
    def data(self) -> Any:  # noqa: ANN401 - plain data
        """All that it says; not there in other processes."""
        if self._data is None:
            self._data = self._make()
        return self._data

    @property
    def digest(self) -> str:
        """Equal for parts that say the same."""
        self._digest = self._digest or digest(self.data)
        return self._digest

    def titled(self) -> Iterator[tuple[str, Any]]:
        """Its data by title; of files, that of each."""
        if self.folder is None:
            yield self.title, self.data
        else:
            yield from ((str(self.folder / name), data) for name, data in self.data.items())

    def __reduce__(self) -> tuple[Any, ...]:
        """Other processes get the checksum alone."""
        return _sent, (self.title, self.digest)


def _sent(title: str, known: str) -> Part:
    part = Part(title, dict)
    part._digest = known
    return part


def robot_parts(robot: Robot, name: str) -> dict[str, Part]:
    """The parts of a robot: its file, the files of its MJCF, and what MuJoCo compiles of these.

    Args:
        robot: The robot file.
        name: How it is called, for words.
    """
    path, folder = robot.mjcf_path, Path(name).parent

    def file() -> Any:  # noqa: ANN401 - plain data
        return {key: value for key, value in plain(robot).items() if key != "mjcf"}  # where it lies

    return {
        "robot": Part(f"robot {name}", file),
        "MJCF": Part(f"files of {folder / path.name}", lambda: mjcf_files(path), folder),
        "model": Part(f"{_COMPILED} {folder / path.name}", lambda: {"sha256": compiled_sum(path)}),
    }


def scenario_data(scenario: Scenario) -> dict[str, Any]:
    """What a scenario says itself, without the files that it names and what befalls the robot."""
    formulas = {name: " ".join(text.split()) for name, text in scenario.formulas.items()}
    kinds = {each.kind: plain(each) for each in scenario.measure_kinds}
    own = set(type(scenario).model_fields) - _ELSEWHERE
    return {**plain(scenario, own), "measures": {**formulas, **kinds}}


def backend_part(circuits: Mapping[str, CircuitGraph]) -> Part:
    """The backends that run circuits here, by what they are called."""

    def backends() -> dict[str, str]:
        return {name: compile_circuit(each, reproducible=True).backend for name, each in circuits.items()}

    return Part("backend", backends)


def versions() -> dict[str, str]:
    """The packages on which the bits of every run depend, with their versions."""
    return {
        "circuitkit": circuitkit.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "python": ".".join(platform.python_version_tuple()[:2]),
    }


def all_versions(
    scenario: Scenario, robot: Robot | None, reference: Reference, controller: object
) -> dict[str, str]:
    """The versions on which the bits of a run depend, those of the plug-ins that it uses included.

    Args:
        scenario: The scenario.
        robot: The robot file, if it is known.
        reference: The reference.
        controller: The name of a controller, or the numbers of its file.
    """
    blocks = () if robot is None else robot.given_blocks.values()
    used = (*scenario.befalling, *scenario.measure_kinds, *blocks, reference, controller)
    found = versions()
    for each in used:
        found |= _of_plug_in(type(each).__module__)
    if isinstance(controller, ControllerSpec):
        found |= {name: _version(name) for name in controller.packages()}
    return found


@cache
def _of_plug_in(module: str) -> dict[str, str]:
    """The version of the distribution of a module, and the checksum of its text; of our own nothing."""
    top = module.partition(".")[0]
    if top in {_OURS, "builtins"}:
        return {}
    names = importlib.metadata.packages_distributions().get(top, ())
    found = {name: _version(name) for name in names}
    file = getattr(sys.modules.get(module), "__file__", None)
    if file and Path(file).is_file():
        found[module] = hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16]
    return found


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


@dataclass(frozen=True)
class Identity:
    """The identity of many runs, such as those of a study.

    Attributes:
        digest: Equal if all of them are the same; this decides.
        data: What they are, for words: plain data by title. Of a thing that comes in several forms, such as a
            circuit with several values, it is the first one.
        forms: By title, a checksum of all forms of the thing.
    """

    digest: str
    data: Mapping[str, Any]
    forms: Mapping[str, str]

    def as_json(self) -> dict[str, Any]:
        """What is stored of it."""
        return {"digest": self.digest, "data": dict(self.data), "forms": dict(self.forms)}

    def packed(self) -> str:
        """The same as a short text; its words only as far as a column of a database takes them."""
        for data in (self.data, {}):
            text = json.dumps({**self.as_json(), "data": dict(data)}, ensure_ascii=False)
            packed = base64.b85encode(zlib.compress(text.encode(), 9)).decode()
            if len(packed) <= _LONGEST:
                break
        return packed

    def differences(self, stored: Any) -> str:  # noqa: ANN401 - as it was read
        """What differs from what was stored, in words; empty if it is the same.

        Args:
            stored: What `as_json` once gave.
        """
        old = stored if isinstance(stored, dict) else {}
        if old.get("digest") == self.digest:
            return ""
        if not old.get("data"):
            return "what it was is not known in detail"
        found = dict(self._named(old["data"], old.get("forms", {})))
        causes = {title: each for title, each in found.items() if not title.startswith(_COMPILED)} or found
        causes = {title: each for title, each in causes.items() if each != [_OTHER_FORMS]} or causes
        # Each is told with its title where that begins, and without it as long as it lasts.
        texts = [text for title, (first, *more) in causes.items() for text in (_titled(title, first), *more)]
        shown = texts[:_MOST_SHOWN] or ["some of the runs are others"]
        more = len(texts) - len(shown)
        return "; ".join(shown) + (f"; and {more} more" if more > 0 else "")

    def _named(self, data: Mapping[str, Any], forms: Mapping[str, str]) -> Iterator[tuple[str, list[str]]]:
        """What differs from what was, by title."""
        for title in dict.fromkeys((*data, *self.data)):
            if title not in data or title not in self.data:
                yield title, ["is new" if title in self.data else "is no longer used"]
            elif named := list(differences(data[title], self.data[title])):
                yield title, named
            elif forms.get(title) != self.forms.get(title):
                yield title, [_OTHER_FORMS]


def _titled(title: str, text: str) -> str:
    return f"{title}{' ' if text.startswith(_OF_ALL) else ': '}{text}"


def unpacked(text: object) -> Any:  # noqa: ANN401 - as JSON has it
    """What `Identity.packed` has made a text of; None for anything else."""
    try:
        return json.loads(zlib.decompress(base64.b85decode(str(text))))
    except (ValueError, zlib.error):
        return None


def identity_of(
    own: Mapping[str, Any], words: Mapping[str, Any], cases: Iterable[tuple[Any, Mapping[str, Part]]]
) -> Identity:
    """The identity of the runs of several cases.

    Args:
        own: What else determines which runs there are and how they are called, as plain data.
        words: In which words that is said, by title; what differs is looked for there first.
        cases: How each case is called, as plain data, and its parts by kind.
    """
    data: dict[str, Any] = dict(words)
    forms: dict[str, set[str]] = {}
    whole = []
    for label, parts in cases:
        for part in parts.values():
            for title, each in part.titled():
                data.setdefault(title, each)
            forms.setdefault(part.title, set()).add(part.digest)
        whole.append([label, {kind: part.digest for kind, part in parts.items()}])
    sums = {title: digest(sorted(each)) for title, each in forms.items()}
    return Identity(digest([dict(own), whole]), data, sums)
