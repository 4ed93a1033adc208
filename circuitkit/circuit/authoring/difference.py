"""What changed between two circuits, in their own terms: neurons, synapses, parameters and so on.

Compared is what the files mean, after includes and parameters, not their text. A node that has gone and one
that has come are one renamed node if they are alike and stand alike among the others: nodes are coloured by
their own values, then again and again by the colours of their neighbours (Weisfeiler and Leman 1968).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from circuitkit.circuit.authoring.elements import Element, elements_of, value_text
from circuitkit.circuit.graph import CircuitGraph, same

What = Literal["added", "removed", "changed", "renamed"]
_NODES = ("input", "neuron", "population", "output")
_ROUNDS = 8
_ALL_DIGITS = 17


@dataclass(frozen=True)
class Change:
    """One difference between two circuits.

    Attributes:
        kind: Of what, such as "neuron" or "synapse".
        name: Its name, in the new circuit if it is there; a synapse's is `q1 -> p1`.
        what: "added", "removed", "changed" or "renamed".
        field: Which of its values changed; empty unless "changed".
        old: The value before, or the old name; for "removed" what it was; empty for "added".
        new: The value now, or the new name; for "added" what it is; empty for "removed".
    """

    kind: str
    name: str
    what: What
    field: str
    old: str
    new: str


def compare_circuits(old: CircuitGraph, new: CircuitGraph) -> tuple[Change, ...]:
    """Return everything in which two circuits differ; nothing if they mean the same.

    Args:
        old: The circuit before.
        new: The circuit now.

    Returns:
        The changes: of the circuit as a whole, then by kind, each in file order.
    """
    before, after = list(elements_of(old)), list(elements_of(new))
    renamed = _renamed(before, after)
    if renamed:
        before = list(elements_of(old, {name: element.title for name, element in renamed.items()}))
    changes: list[Change] = []
    for kind in dict.fromkeys(element.kind for element in (*after, *before)):
        changes += (
            Change(kind, element.title, "renamed", "", name, element.title)
            for name, element in renamed.items()
            if element.kind == kind
        )
        changes += _changes_of(
            [element for element in before if element.kind == kind],
            [element for element in after if element.kind == kind],
        )
    return tuple(changes)


def _changes_of(before: Sequence[Element], after: Sequence[Element]) -> Iterator[Change]:
    """Yield the changes among the elements of one kind."""
    old, new = ({element.title: element for element in each} for each in (before, after))
    for title, element in old.items():
        if title not in new:
            yield Change(element.kind, title, "removed", "", _summary(element), "")
    for title, element in new.items():
        if title not in old:
            yield Change(element.kind, title, "added", "", "", _summary(element))
        else:
            yield from _changed_fields(old[title], element)
    common = [[title for title in each if title in old and title in new] for each in (old, new)]
    if common[0] != common[1] and after[0].kind in _NODES:
        yield Change(after[0].kind, "", "changed", "order", *(", ".join(titles) for titles in common))


def _changed_fields(old: Element, new: Element) -> Iterator[Change]:
    for field in dict.fromkeys((*old.fields, *new.fields)):
        one, other = old.fields.get(field, ("", None)), new.fields.get(field, ("", None))
        if same(one[0], other[0]):
            continue
        texts = value_text(*one), value_text(*other)
        if texts[0] == texts[1]:
            texts = value_text(*one, _ALL_DIGITS), value_text(*other, _ALL_DIGITS)
        if texts[0] == texts[1]:
            texts = texts[0], f"{texts[1]}, other ones"
        yield Change(new.kind, new.title, "changed", field, *texts)


def _summary(element: Element) -> str:
    """Find what an element is, on one line."""
    parts = []
    for field, (value, unit) in element.fields.items():
        if not (isinstance(value, str) and not value):
            text = value_text(value, unit)
            parts.append(text if field in {"model", "role", "value"} else f"{field} {text}")
    return ", ".join(parts)


def _renamed(before: Sequence[Element], after: Sequence[Element]) -> dict[str, Element]:
    """Return the nodes that are called otherwise now, by their old name."""
    names = [{each.title: each for each in nodes if each.kind in _NODES} for nodes in (before, after)]
    gone, come = ([name for name in one if name not in other] for one, other in (names, names[::-1]))
    if not (gone and come):
        return {}
    kept = [name for name in names[0] if name in names[1]]
    colours = [_colours(each, frozenset(kept)) for each in (before, after)]
    waiting: dict[int, list[str]] = {}
    for name in come:
        waiting.setdefault(colours[1][name], []).append(name)
    found = {}
    for name in gone:
        if alike := waiting.get(colours[0][name]):
            found[name] = names[1][alike.pop(0)]
    return found


def _colours(elements: Sequence[Element], kept: frozenset[str]) -> dict[str, int]:
    """Return a number for every node, the same for nodes that are alike and have alike neighbours."""
    nodes = {each.title: each for each in elements if each.kind in _NODES}
    colour = {
        name: hash(name) if name in kept else hash((node.kind, _content(node)))
        for name, node in nodes.items()
    }
    edges = [(each.endpoints, hash((each.kind, _content(each)))) for each in elements if each.endpoints]
    for _ in range(_ROUNDS):
        around: dict[str, list[tuple[int, ...]]] = {name: [] for name in nodes if name not in kept}
        for endpoints, content in edges:
            for place, end in enumerate(endpoints):
                if end in around:
                    around[end].append((place, content, *(colour[each] for each in endpoints)))
        colour |= {name: hash((colour[name], *sorted(each))) for name, each in around.items()}
    return colour


def _content(element: Element) -> tuple[object, ...]:
    """Bring an element's values into a form to compare by its hash, without names of other nodes."""
    values = ((field, value) for field, (value, _) in element.fields.items() if field not in element.naming)
    return tuple((field, value.tobytes() if hasattr(value, "tobytes") else value) for field, value in values)
