"""Sliding friction of the contacts of chosen bodies; nothing else of any contact changes.

Of two surfaces that touch, MuJoCo takes everything from the one with the higher priority. Of equals it takes
the larger friction, and stiffness and damping mixed. A pair of the MJCF says everything itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from circuitkit.base.errors import InputError, Problem
from circuitkit.control import Array

_ARRAYS = ("priority", "condim", "solmix", "solref", "solimp", "friction")
_LEAST = 1e-15  # what MuJoCo takes for no weight at all
_FILTERS_PARENTS = int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)


class _Touch(NamedTuple):
    """What MuJoCo makes of two surfaces that touch, but for the sliding friction."""

    dimensions: int
    reference: tuple[float, ...]
    impedance: tuple[float, ...]
    rolling: tuple[float, ...]


class _Surface(NamedTuple):
    """Views of what a model says of a geom, or of a flex.

    Attributes:
        name: For complaints.
        body: Number of the body of a geom; -1 for a flex.
        priority: Shape (); as are `condim` and `solmix`.
        condim: Number of dimensions of a contact.
        solmix: Weight in mixtures.
        solref: Shape (2,).
        solimp: Shape (5,).
        friction: Sliding, torsional, rolling; shape (3,).
        kinds: The bits of `contype` and `conaffinity`.
    """

    name: str
    body: int
    priority: Array
    condim: Array
    solmix: Array
    solref: Array
    solimp: Array
    friction: Array
    kinds: tuple[int, int]


def rub(model: mujoco.MjModel, bodies: Sequence[int] | None, friction: float) -> None:
    """Give all contacts of some bodies a sliding friction.

    Args:
        model: The model, changed in place.
        bodies: Their numbers; None for everything.
        friction: The coefficient.

    Raises:
        InputError: It would take other changes of the contacts as well.
    """
    for pair in range(model.npair):
        touching = {int(model.geom_bodyid[g[pair]]) for g in (model.pair_geom1, model.pair_geom2)}
        if bodies is None or touching & set(bodies):
            model.pair_friction[pair, :2] = friction
    if bodies is None:
        model.geom_friction[:, 0] = friction
        model.flex_friction[:, 0] = friction
        return
    surfaces = _surfaces(model)
    before = [_copied(each) for each in surfaces]
    for number, surface in enumerate(surfaces):
        if surface.body in bodies:
            others = [before[k] for k in _partners(model, before, number)]
            strangers = [each for each in others if each.body not in bodies]
            rough = any(_outdoes(each, before[number], friction) for each in strangers)
            _set(surface, before[number], others if rough else [], friction)


def _outdoes(other: _Surface, own: _Surface, friction: float) -> bool:
    """Whether another surface would still decide on the friction, and otherwise."""
    if other.priority > own.priority:
        return bool(other.friction[0] != friction)
    return bool(other.priority == own.priority and other.friction[0] > friction)


def _set(surface: _Surface, own: _Surface, others: list[_Surface], friction: float) -> None:
    """Give a surface a friction that counts against others, and leave what else they say together."""
    surface.friction[0] = friction
    if not others:
        return
    together = {_touch(own, each): each for each in others}
    if len(together) > 1:
        first, second = list(together.values())[:2]
        message = (
            f"'{own.name}' meets '{first.name}' and '{second.name}' each in its own way (condim, solref, "
            "solimp, or torsional and rolling friction), so that a friction below theirs cannot be set "
            'for it alone; allowed: a <pair> of the MJCF for what meets, or the friction of all, body: "*"'
        )
        raise InputError(Problem("", 0, 0, "friction", message))
    touch = next(iter(together))
    surface.priority[...] = max(int(each.priority) for each in others) + 1
    surface.condim[...] = touch.dimensions
    surface.solref[:], surface.solimp[:] = touch.reference, touch.impedance
    surface.friction[1:] = touch.rolling


def _touch(a: _Surface, b: _Surface) -> _Touch:
    """By MuJoCo's rules for the parameters of a contact."""
    if a.priority != b.priority:
        one = a if a.priority > b.priority else b
        return _Touch(int(one.condim), tuple(one.solref), tuple(one.solimp), tuple(one.friction[1:]))
    if a.solmix >= _LEAST and b.solmix >= _LEAST:
        share = float(a.solmix / (a.solmix + b.solmix))
    elif a.solmix < _LEAST and b.solmix < _LEAST:
        share = 0.5
    else:
        share = 0.0 if a.solmix < _LEAST else 1.0
    mixed = a.solref[0] > 0 and b.solref[0] > 0
    reference = share * a.solref + (1 - share) * b.solref if mixed else np.minimum(a.solref, b.solref)
    impedance = share * a.solimp + (1 - share) * b.solimp
    return _Touch(
        max(int(a.condim), int(b.condim)), tuple(reference), tuple(impedance),
        tuple(np.maximum(a.friction[1:], b.friction[1:])),
    )  # fmt: skip


def _surfaces(model: mujoco.MjModel) -> list[_Surface]:
    """All geoms, then all flexes."""
    found = []
    for kind, sort, count in (
        ("geom", mujoco.mjtObj.mjOBJ_GEOM, model.ngeom),
        ("flex", mujoco.mjtObj.mjOBJ_FLEX, model.nflex),  # has no `model.flex(i)`
    ):
        arrays = {name: getattr(model, f"{kind}_{name}") for name in _ARRAYS}
        for i in range(count):
            kinds = (
                int(getattr(model, f"{kind}_contype")[i]),
                int(getattr(model, f"{kind}_conaffinity")[i]),
            )
            found.append(
                _Surface(
                    name=mujoco.mj_id2name(model, int(sort), i) or f"{kind} {i}",
                    body=int(model.geom_bodyid[i]) if kind == "geom" else -1,
                    kinds=kinds,
                    **{name: values[i, ...] for name, values in arrays.items()},
                )
            )
    return found


def _copied(surface: _Surface) -> _Surface:
    return surface._replace(**{name: getattr(surface, name).copy() for name in _ARRAYS})


def _partners(model: mujoco.MjModel, surfaces: list[_Surface], number: int) -> Iterator[int]:
    """The surfaces that one may touch, but for those of a pair, which says everything itself."""
    own = surfaces[number]
    paired = {frozenset(map(int, ids)) for ids in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    excluded = {int(each) for each in model.exclude_signature}
    weld = model.body_weldid
    for k, other in enumerate(surfaces):
        meet = own.kinds[0] & other.kinds[1] or other.kinds[0] & own.kinds[1]
        if not meet or k == number:
            continue
        if other.body >= 0:
            a, b = int(weld[own.body]), int(weld[other.body])
            if a == b or frozenset((number, k)) in paired:
                continue
            first, second = sorted((own.body, other.body))
            if (first << 16) + second in excluded:
                continue
            related = weld[model.body_parentid[a]] == b or weld[model.body_parentid[b]] == a
            if a and b and related and not int(model.opt.disableflags) & _FILTERS_PARENTS:
                continue
        yield k
