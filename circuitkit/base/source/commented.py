"""YAML text to a tree that keeps the comments and the spelling of every value, for rewriting a file.

PyYAML's events say where every value begins and ends; a `#` anywhere else begins a comment. A comment belongs
to what it stands beside, else to what follows it, else to the end of the list or mapping it is indented like.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import yaml

Position: TypeAlias = tuple[int, int]  # line and column, from 0
_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")


@dataclass(eq=False)
class Scalar:
    """A single value, or an alias.

    Attributes:
        lines: As written, with its quotes; more than one line only where the breaks count.
        value: What it stands for.
        literal: Whether it is a block of text behind `|` or `>`, the first line being that sign.
        anchor: Name of its anchor; empty for none.
    """

    lines: tuple[str, ...]
    value: str
    literal: bool = False
    anchor: str = ""


@dataclass(eq=False)
class Collection:
    """A mapping or a list.

    Attributes:
        is_mapping: Whether it is a mapping.
        flow: Whether it is written in braces or brackets.
        entries: In the order of the text.
        below: Comments after the last entry; an empty text is an empty line.
        anchor: Name of its anchor; empty for none.
    """

    is_mapping: bool
    flow: bool
    entries: list[Entry] = field(default_factory=list)
    below: list[str] = field(default_factory=list)
    anchor: str = ""


@dataclass(eq=False)
class Entry:
    """An entry of a mapping or an item of a list.

    Attributes:
        key: The key as written; empty for an item.
        name: The key without quotes; empty for an item.
        value: What it holds.
        above: Comments above it; an empty text is an empty line.
        beside_key: Comment on the line of the key, where the value follows below.
        beside: Comment behind it.
        start: Where it begins.
        end: Where its value ends.
        parent: The mapping or list it belongs to.
    """

    key: str
    name: str
    value: Scalar | Collection
    start: Position
    end: Position
    parent: Collection
    above: list[str] = field(default_factory=list)
    beside_key: str = ""
    beside: str = ""


@dataclass(eq=False)
class CommentedText:
    """The tree of a text.

    Attributes:
        header: Comments that belong to the file, not to its first entry.
        top: Everything else.
        comments: All comments, in order.
        has_aliases: Whether the order of entries may count, since aliases come after their anchors.
    """

    header: list[str]
    top: Collection
    comments: tuple[str, ...]
    has_aliases: bool


@dataclass(frozen=True)
class _Comment:
    at: Position
    text: str
    alone: bool  # on its line


def read_commented(text: str) -> CommentedText:
    """The tree of a YAML text whose top is a mapping, and which `scan_text` has found no fault with."""
    lines = _BREAK.split(text.removeprefix("\N{ZERO WIDTH NO-BREAK SPACE}"))
    builder = _Builder(lines)
    top = builder.document()
    comments = list(_comments(lines, builder.spans))
    header = _attach(top, builder, comments)
    words = tuple(comment.text for comment in comments)
    return CommentedText(header, top, words, builder.has_aliases)


class _Builder:
    """Turns events into the tree.

    Attributes:
        spans: Begin and end of every scalar, in the order of the text.
        entries: All entries in the order of the text, parents before children.
        flows: Begin and end of every collection in braces or brackets.
        owner: The entry whose value a collection is.
        column: Column of the entries of every collection.
    """

    def __init__(self, lines: list[str]) -> None:
        self.lines = lines
        self.spans: list[tuple[Position, Position]] = []
        self.entries: list[Entry] = []
        self.flows: dict[Collection, tuple[Position, Position]] = {}
        self.owner: dict[Collection, Entry] = {}
        self.column: dict[Collection, int] = {}
        self.has_aliases = False
        self._events: Iterator[Any] = iter(())

    def document(self) -> Collection:
        """The top of the tree."""
        loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
        self._events = iter(yaml.parse("\n".join(self.lines), Loader=loader))
        event = next(event for event in self._events if isinstance(event, yaml.MappingStartEvent))
        return self._collection(event)[0]

    def is_empty(self, line: int) -> bool:
        """Whether a line is there and empty."""
        return 0 <= line < len(self.lines) and not self.lines[line].strip(" \t")

    def _node(self, event: Any) -> tuple[Scalar | Collection, Position]:  # noqa: ANN401 - PyYAML has no types
        """The value that starts with an event, and where it ends."""
        scalar = isinstance(event, yaml.ScalarEvent | yaml.AliasEvent)
        return self._scalar(event) if scalar else self._collection(event)

    def _collection(self, event: Any) -> tuple[Collection, Position]:  # noqa: ANN401 - as above
        is_mapping = isinstance(event, yaml.MappingStartEvent)
        node = Collection(is_mapping, bool(event.flow_style), anchor=event.anchor or "")
        self.column[node] = _at(event.start_mark)[1]
        end = _at(event.start_mark)
        while not isinstance(first := next(self._events), yaml.MappingEndEvent | yaml.SequenceEndEvent):
            key = first if is_mapping else None
            if key is not None:
                self.spans.append((_at(key.start_mark), _at(key.end_mark)))
            value_event = next(self._events) if is_mapping else first
            name = key.value if key is not None else ""
            raw = " ".join(self._raw(key)) if key is not None else ""
            entry = Entry(raw, name, Scalar(("",), ""), _at(first.start_mark), end, node)
            self.entries.append(entry)
            entry.value, entry.end = self._node(value_event)
            if isinstance(entry.value, Collection):
                self.owner[entry.value] = entry
            elif len(entry.value.lines) > 1:
                node.flow = False  # its breaks count, and braces have none
            node.entries.append(entry)
            end = entry.end
        if event.flow_style:
            end = _at(first.end_mark)
            self.flows[node] = (_at(event.start_mark), end)
        return node, end

    def _scalar(self, event: Any) -> tuple[Scalar, Position]:  # noqa: ANN401 - as above
        start, end = _at(event.start_mark), _at(event.end_mark)
        if isinstance(event, yaml.AliasEvent):
            self.has_aliases = True
            return Scalar((f"*{event.anchor}",), ""), end
        anchor = event.anchor or ""
        if event.style in {"|", ">"}:
            self.spans.append(((start[0] + 1, 0), end))
            sign, _, _ = self.lines[start[0]][start[1] :].partition("#")
            sign = sign.removeprefix(f"&{anchor}").strip(" \t") if anchor else sign.strip(" \t")
            last = end[0] if end[1] else end[0] - 1
            block = _dedented(self.lines[start[0] + 1 : last + 1])
            return Scalar((sign, *block), event.value, literal=True, anchor=anchor), end
        if anchor and event.style is None and not event.value:
            return Scalar(("",), "", anchor=anchor), end
        self.spans.append((start, end))
        pieces = self._raw(event)
        if anchor:
            pieces[0] = pieces[0].removeprefix(f"&{anchor}").lstrip(" ")
        kept = "\n" in event.value or any(piece.endswith("\\") for piece in pieces[:-1])
        lines = tuple(pieces) if kept else (" ".join(pieces),)
        return Scalar(lines, event.value, anchor=anchor), end

    def _raw(self, event: Any) -> list[str]:  # noqa: ANN401 - as above
        """The lines of a scalar as written, without what they are indented by."""
        (first, left), (last, right) = _at(event.start_mark), _at(event.end_mark)
        if first == last:
            return [self.lines[first][left:right]]
        middle = (line.strip(" \t") for line in self.lines[first + 1 : last])
        return [self.lines[first][left:].rstrip(" "), *middle, self.lines[last][:right].lstrip(" ")]


def _at(mark: Any) -> Position:  # noqa: ANN401 - as above
    return mark.line, mark.column


def _dedented(block: list[str]) -> list[str]:
    indents = [len(line) - len(line.lstrip(" ")) for line in block if line.strip(" \t")]
    shown = [line[min(indents, default=0) :].rstrip(" ") if line.strip(" \t") else "" for line in block]
    while shown and not shown[-1]:
        shown.pop()
    return shown


def _comments(lines: list[str], spans: list[tuple[Position, Position]]) -> Iterator[_Comment]:
    """Every comment: a `#` outside all scalars, up to the end of its line."""
    ends = [span[1] for span in spans]
    for number, line in enumerate(lines):
        column = line.find("#")
        while column >= 0:
            inside = bisect_right(ends, (number, column))
            if inside == len(spans) or spans[inside][0] > (number, column):
                yield _Comment((number, column), line[column:].rstrip(" "), not line[:column].strip(" \t"))
                break
            column = line.find("#", column + 1)


def _attach(top: Collection, builder: _Builder, comments: list[_Comment]) -> list[str]:
    """Give every comment to what it belongs to, every entry the empty line above it; returns the header."""
    starts = [entry.start for entry in builder.entries]
    first = starts[0][0] if starts else len(builder.lines)
    header, rest = _header(comments, builder, first)
    for comment in rest:
        if comment.alone or not _attach_beside(comment, builder, starts):
            target = _attach_alone(comment, top, builder, starts)
            target += ["", comment.text] if builder.is_empty(comment.at[0] - 1) else [comment.text]
    for entry in builder.entries:
        if builder.is_empty(entry.start[0] - 1):
            entry.above.append("")
    return header


def _header(comments: list[_Comment], builder: _Builder, first: int) -> tuple[list[str], list[_Comment]]:
    """The comments at the top of the file, but for a last paragraph that stands right on the first entry."""
    top = [comment for comment in comments if comment.at[0] < first]
    begins = [i for i in range(1, len(top)) if top[i - 1].at[0] != top[i].at[0] - 1]
    count = begins[-1] if begins and top[-1].at[0] == first - 1 else len(top)
    header: list[str] = []
    for comment in top[:count]:
        header += [comment.text, ""] if builder.is_empty(comment.at[0] + 1) else [comment.text]
    return header, comments[count:]


def _attach_beside(comment: _Comment, builder: _Builder, starts: list[Position]) -> bool:
    """Give a comment behind a value to its entry; False if there is none on this line."""
    around = _flow_around(comment.at, builder, starts)
    last = bisect_left(starts, comment.at) - 1
    for number in range(last, -1, -1):
        entry = builder.entries[number]
        ends_here = entry.end[0] == comment.at[0] and entry.end <= comment.at
        is_block = isinstance(entry.value, Collection) and entry.value not in builder.flows
        same = entry.parent is around if around is not None else entry.parent not in builder.flows
        if ends_here and same and not is_block:
            _last_on_the_line(entry, comment.at[0], builder).beside = comment.text
            return True
        if entry.start[0] < comment.at[0] and entry.parent not in builder.flows:
            break
    owner = builder.entries[last] if last >= 0 else None
    if around is not None:
        owner = builder.owner[around]
    if owner is None or owner.start[0] != comment.at[0] or owner.beside_key:
        return False
    owner.beside_key = comment.text
    return True


def _last_on_the_line(entry: Entry, line: int, builder: _Builder) -> Entry:
    """The entry that stands before a comment: of braces of several lines that cannot stay, their last one."""
    value = entry.value
    while isinstance(value, Collection) and not value.flow and value.entries and value in builder.flows:
        last = value.entries[-1]
        if builder.flows[value][0][0] == line or last.end[0] != line:
            break
        entry, value = last, last.value
    return entry


def _flow_around(at: Position, builder: _Builder, starts: list[Position]) -> Collection | None:
    """The innermost braces or brackets around a place; they, and all around them, can no longer stay."""
    before = builder.entries[bisect_left(starts, at) - 1] if starts and starts[0] < at else None
    near = [] if before is None else [before.value, *_collections_around(before, builder)]
    around = [
        each
        for each in near
        if isinstance(each, Collection)
        and each in builder.flows
        and builder.flows[each][0] < at < builder.flows[each][1]
    ]
    for flow in around:
        flow.flow = False
    return around[0] if around else None


def _attach_alone(comment: _Comment, top: Collection, builder: _Builder, starts: list[Position]) -> list[str]:
    """Where a comment on its own line goes: above the next entry, or the end of what it is indented like."""
    around = _flow_around(comment.at, builder, starts)
    number = bisect_right(starts, comment.at)
    following = builder.entries[number] if number < len(starts) else None
    before = builder.entries[number - 1] if number else None
    if around is not None:
        return following.above if following is not None and following.parent is around else around.below
    if following is not None and following.above:
        return following.above
    least = builder.column[following.parent] if following is not None else -1
    open_still = _collections_around(following, builder)
    for ended in _collections_around(before, builder):
        is_over = ended not in builder.flows and ended not in open_still
        if is_over and least < comment.at[1] and builder.column[ended] <= comment.at[1]:
            return ended.below
    return top.below if following is None else following.above


def _collections_around(entry: Entry | None, builder: _Builder) -> list[Collection]:
    """The collections that an entry is in, the innermost first."""
    around = [] if entry is None else [entry.parent]
    while around and (owner := builder.owner.get(around[-1])) is not None:
        around.append(owner.parent)
    return around
