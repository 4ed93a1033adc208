"""Reading an MJCF as its author wrote it: every part gets a name, and what MuJoCo says reaches the user."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import mujoco

from circuitkit.base.errors import InputError, Problem

_LOG = logging.getLogger(__name__)
_Made = TypeVar("_Made")
_NAMED = ("bodies", "joints", "sites", "tendons", "actuators", "sensors", "keys")
_SINGULAR = {"bodies": "body"}
_GONE = dict.fromkeys(  # what MuJoCo had before version 4, by how its complaints name it
    ("'composite'", "mujoco.elasticity"),
    "MuJoCo 4 has neither; a flexcomp with <elasticity> takes their place",
)


def read_mjcf(path: Path) -> Any:  # noqa: ANN401 - MjSpec is not typed
    """Read an MJCF; its files are found from its own folder. Parts without a name get one, see `name_parts`.

    Raises:
        InputError: It cannot be read; says why.
    """
    with _said_by_mujoco(path):
        what = f"MuJoCo {mujoco.__version__} cannot read it"
        spec = _or_complain(path, what, lambda: mujoco.MjSpec.from_file(str(path)))
    name_parts(spec)
    return spec


def compile_mjcf(spec: Any, path: Path) -> mujoco.MjModel:  # noqa: ANN401 - as above
    """Compile what was read.

    Raises:
        InputError: MuJoCo refuses it; says why.
    """
    with _said_by_mujoco(path):
        return _or_complain(path, "MuJoCo refuses the model", spec.compile)


def name_parts(spec: Any) -> None:  # noqa: ANN401 - as above
    """Give a name to every body, joint, site, tendon, actuator, sensor and keyframe that has none.

    An actuator is called like the part that it drives, and everything else by kind and number from 0, such as
    `joint_3`; where that is taken, an underscore follows. Names change nothing in the physics.
    """
    for plural in _NAMED:
        kind = _SINGULAR.get(plural, plural.removesuffix("s"))
        parts = list(getattr(spec, plural))
        taken = {part.name for part in parts}
        for number, part in enumerate(parts):
            if not part.name:
                name = (plural == "actuators" and part.target) or f"{kind}_{number}"
                while name in taken:
                    name += "_"
                part.name = name
                taken.add(name)


def flex_bodies(model: mujoco.MjModel) -> set[int]:
    """Numbers of the bodies that are no more than the vertices of something soft."""
    vertices = {*model.flex_vertbodyid.tolist(), *model.flex_nodebodyid.tolist()}
    return {body for body in vertices if body >= 0 and not model.body_geomnum[body]}


def _or_complain(path: Path, what: str, make: Callable[[], _Made]) -> _Made:
    try:
        return make()
    except (ValueError, mujoco.FatalError) as error:
        text = "; ".join(line.strip() for line in str(error).splitlines() if line.strip())
        hint = next((words for part, words in _GONE.items() if part in text), "")
        raise InputError(Problem(str(path), 1, 1, "", f"{what}: {text}", hint)) from error


@contextmanager
def _said_by_mujoco(path: Path) -> Iterator[None]:
    """Pass on MuJoCo's warnings, each one once, as lines that name the file."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        yield
    for each in said:
        _tell(str(path), str(each.message))


@cache
def _tell(path: str, text: str) -> None:
    _LOG.warning("%s: MuJoCo says: %s", path, text)
