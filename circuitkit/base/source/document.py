"""`Document`: the data of a YAML file, with the line and column of every part of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias, TypedDict, Unpack

from circuitkit.base.errors import Problem

# What a file can hold. Keys are always text.
Data: TypeAlias = "bool | int | float | str | list[Data] | dict[str, Data] | None"
# Where a part stands: keys and list positions from the top, such as ("synapses", 3, "to").
Place: TypeAlias = tuple[str | int, ...]


class Mark(NamedTuple):
    """Where a part stands in the text, all from 1.

    Attributes:
        line: Line of the value.
        column: Column of the value.
        key_line: Line of the key, or of the value for a list item.
        key_column: Column of the key, or of the value for a list item.
    """

    line: int
    column: int
    key_line: int
    key_column: int


class Pointing(TypedDict, total=False):
    """Where at a part a complaint points; at the beginning of its value if nothing is said.

    Attributes:
        at_key: Point at the key instead of the value.
        offset: Point at this character of the value, from 0.
    """

    at_key: bool
    offset: int | None


@dataclass(frozen=True)
class Document:
    """The data of a file, with the place of every part in the text.

    Attributes:
        path: The file as the user named it, for messages.
        data: The data.
        marks: Line and column of every part; empty for data that came from no text.
        shifts: For a text in quotes, how far behind its mark it begins; None for one of several lines.
    """

    path: str
    data: Data
    marks: Mapping[Place, Mark]
    shifts: Mapping[Place, int | None] = field(default_factory=dict)

    def mark(self, place: Place) -> Mark:
        """The mark of a part, or of the nearest part around it that has one."""
        for length in range(len(place), -1, -1):
            if (mark := self.marks.get(place[:length])) is not None:
                return mark
        return Mark(1, 1, 1, 1)

    def problem(self, place: Place, message: str, hint: str = "", **pointing: Unpack[Pointing]) -> Problem:
        """A complaint about a part of this document.

        Args:
            place: The part.
            message: What was found; what is allowed.
            hint: What was probably meant.
            **pointing: Where at it; see `Pointing`.
        """
        mark, offset, shift = self.mark(place), pointing.get("offset"), self.shifts.get(place, 0)
        line, column = mark[2:] if pointing.get("at_key") else mark[:2]
        if offset is not None and shift is not None and place in self.marks:
            column += offset + shift
        return Problem(self.path, line, column, place_text(place), message, hint)


def place_text(place: Place) -> str:
    """A place as text, such as `synapses[3].to`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return text.removeprefix(".")
