"""Names of the nodes of a circuit, in order; those of members of populations are made when asked for."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from typing import overload


def node_of(name: str) -> str:
    """Return the population of a member such as `ring[3]`; any other name as it is."""
    return name.partition("[")[0]


class Names(Sequence[str]):
    """Names in order: single ones, then those of the members of populations, `NAME[0]` and so on.

    It compares equal to a sequence of the same names, and takes no more memory for large populations.
    """

    def __init__(
        self, before: Iterable[str], populations: Iterable[tuple[str, int]], after: Iterable[str] = ()
    ) -> None:
        """Put names together.

        Args:
            before: Single names.
            populations: Names and sizes of populations.
            after: Single names behind the members.
        """
        self._before, self._after = tuple(before), tuple(after)
        self._starts: list[int] = []
        self._populations: list[str] = []
        self._start_of: dict[str, tuple[int, int]] = {}
        position = len(self._before)
        for name, size in populations:
            self._starts.append(position)
            self._populations.append(name)
            self._start_of[name] = (position, size)
            position += size
        self._end = position
        singles = (*enumerate(self._before), *enumerate(self._after, start=position))
        self._position: dict[str, int] = {name: at for at, name in reversed(singles)}

    def __len__(self) -> int:
        return self._end + len(self._after)

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[str, ...]: ...
    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:
        """Return the name at a position, or several."""
        if isinstance(index, slice):
            return tuple(self[position] for position in range(len(self))[index])
        position = range(len(self))[index]
        if position < len(self._before):
            return self._before[position]
        if position >= self._end:
            return self._after[position - self._end]
        number = bisect_right(self._starts, position) - 1
        return f"{self._populations[number]}[{position - self._starts[number]}]"

    def __iter__(self) -> Iterator[str]:
        yield from self._before
        for name, (_, size) in self._start_of.items():
            for member in range(size):
                yield f"{name}[{member}]"
        yield from self._after

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def index(self, value: str, start: int = 0, stop: int | None = None) -> int:
        """Return the position of a name.

        Raises:
            ValueError: It is not among them.
        """
        position = self._find(value)
        if position is None or not start <= position < (len(self) if stop is None else stop):
            message = f"'{value}' is not among the names"
            raise ValueError(message)
        return position

    def _find(self, name: str) -> int | None:
        if name in self._position:
            return self._position[name]
        population, bracket, member = name.removesuffix("]").rpartition("[")
        if bracket and name.endswith("]") and population in self._start_of and member.isdecimal():
            start, size = self._start_of[population]
            if int(member) < size and member == str(int(member)):
                return start + int(member)
        return None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence) or isinstance(other, str):
            return NotImplemented
        if isinstance(other, Names) and self._start_of == other._start_of:
            return self._before == other._before and self._after == other._after
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash((self._before, tuple(self._populations), self._after))

    def __repr__(self) -> str:
        return f"Names({', '.join(self[:20])}{', …' if len(self) > 20 else ''})"  # noqa: PLR2004 - for people
