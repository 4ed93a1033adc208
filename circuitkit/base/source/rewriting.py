"""The tree of `commented` to text: two spaces a level, lines of a limited width, comments under each other.

What is in braces or brackets stays so if it fits, also over several lines; else it is written as a block.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from circuitkit.base.source.commented import Collection, CommentedText, Entry, Scalar

_INDENT = 2
_BEFORE_COMMENT = 2
_JOINT = re.compile(r"(?<=[^\s\\]) (?=[^\s])")


@dataclass(frozen=True)
class _Line:
    """A line of the text and the comment behind it; `inside` a text of several lines, empty ones count."""

    text: str
    comment: str = ""
    inside: bool = False


def write_commented(tree: CommentedText, width: int) -> str:
    """The text of a tree.

    Args:
        tree: The tree.
        width: Characters in a line; only words and comments that are longer pass it.
    """
    lines = [*map(_Line, tree.header), *_Writer(width).entries(tree.top, 0)]
    return "\n".join([*_aligned(_without_doubles(lines)), ""])


def _without_doubles(lines: Iterable[_Line]) -> list[_Line]:
    """The lines without empty ones at the ends or after each other."""
    kept: list[_Line] = []
    for line in lines:
        if line.text or line.inside or (kept and (kept[-1].text or kept[-1].inside)):
            kept.append(line)
    while kept and not kept[-1].text:
        kept.pop()
    return kept


def _aligned(lines: Sequence[_Line]) -> Iterator[str]:
    """The lines with their comments, those of neighbouring lines of one indent under each other."""
    at = 0
    for number, line in enumerate(lines):
        if not line.comment:
            yield line.text
            continue
        if number == 0 or not _are_in_a_row(lines[number - 1], line):
            end = number + 1
            while end < len(lines) and _are_in_a_row(lines[end - 1], lines[end]):
                end += 1
            at = max(len(each.text) for each in lines[number:end]) + _BEFORE_COMMENT
        yield line.text.ljust(at) + line.comment


def _are_in_a_row(one: _Line, other: _Line) -> bool:
    indents = [len(line.text) - len(line.text.lstrip(" ")) for line in (one, other)]
    return bool(one.comment and other.comment) and indents[0] == indents[1]


class _Writer:
    """Writes entries at an indent, as lines."""

    def __init__(self, width: int) -> None:
        self.width = width

    def entries(self, node: Collection, indent: int) -> Iterator[_Line]:
        """The entries of a block, with their comments."""
        pad = " " * indent
        for number, entry in enumerate(node.entries):
            above = entry.above
            while number == 0 and above and not above[0]:
                above = above[1:]
            for text in above:
                yield _Line(pad + text if text else "")
            yield from self._entry(entry, indent)
        for text in node.below:
            yield _Line(pad + text if text else "")

    def _entry(self, entry: Entry, indent: int) -> Iterator[_Line]:
        value, head = entry.value, self._head(entry, indent)
        if isinstance(value, Scalar):
            lines = self._scalar(value, head, indent)
        elif not value.entries and not value.below:
            lines = [f"{head} {'{}' if value.is_mapping else '[]'}"]
        elif value.flow and (found := self._flow(value, head)) is not None:
            lines = found
        else:
            yield from self._block(entry, value, head, indent)
            return
        comments = [text for text in (entry.beside_key, entry.beside) if text]
        literal = isinstance(value, Scalar) and value.literal
        for text in comments[:-1]:
            yield _Line(" " * indent + text)
        for number, line in enumerate(lines):
            last = number == (0 if literal else len(lines) - 1)
            yield _Line(line, comments[-1] if comments and last else "", inside=number > 0)

    def _block(self, entry: Entry, value: Collection, head: str, indent: int) -> Iterator[_Line]:
        """A mapping or list below its key; behind a dash it begins on the same line."""
        besides = [text for text in (entry.beside_key, entry.beside) if text]
        for text in besides[:-1] if entry.key else besides:
            yield _Line(" " * indent + text)
        inner = self.entries(value, indent + _INDENT)
        if entry.key or value.anchor:
            yield _Line(head, besides[-1] if besides and entry.key else "")
            yield from inner
            return
        for line in inner:
            if line.text and not line.text.lstrip(" ").startswith("#"):
                yield _Line(f"{head} {line.text.lstrip(' ')}", line.comment)
                break
            yield _Line(" " * indent + line.text.lstrip(" ") if line.text else "")
        yield from inner

    def _head(self, entry: Entry, indent: int) -> str:
        anchor = f" &{entry.value.anchor}" if entry.value.anchor else ""
        return " " * indent + (f"{entry.key}:" if entry.key else "-") + anchor

    def _scalar(self, value: Scalar, head: str, indent: int) -> list[str]:
        """A value on the line of its key, folded at spaces where it is too long."""
        pad = " " * (indent + _INDENT)
        if value.literal or len(value.lines) > 1:
            rest = [pad + line if line else "" for line in value.lines[1:]]
            return [f"{head} {value.lines[0]}", *rest]
        text = value.lines[0]
        if len(head) + 1 + len(text) <= self.width or text.startswith("*"):
            return [f"{head} {text}".rstrip(" ")]
        return _filled(_JOINT.split(text), f"{head} ", pad, self.width, " ")

    def _flow(self, node: Collection, head: str) -> list[str] | None:
        """A value in braces or brackets, on as many lines as needed; None if a piece is too long for one."""
        opening, closing = ("{", "}") if node.is_mapping else ("[", "]")
        pieces = [_flow_text(entry) for entry in node.entries]
        start = f"{head} {opening}"
        pad = " " * len(start)
        if any(len(pad) + len(piece) + 1 > self.width for piece in pieces):
            return None
        pieces[-1] += closing
        return _filled(pieces, start, pad, self.width, ", ")


def _filled(pieces: Sequence[str], start: str, pad: str, width: int, joint: str) -> list[str]:
    """The pieces on as few lines as possible."""
    lines = [start + pieces[0]]
    for piece in pieces[1:]:
        longer = lines[-1] + joint + piece
        if len(longer) + len(joint.rstrip(" ")) <= width:
            lines[-1] = longer
        else:
            lines[-1] += joint.rstrip(" ")
            lines.append(pad + piece)
    return lines


def _flow_text(entry: Entry) -> str:
    """An entry in braces or brackets, on one line."""
    value = entry.value
    if isinstance(value, Scalar):
        text = " ".join(value.lines)
    else:
        inner = ", ".join(_flow_text(each) for each in value.entries)
        text = f"{{{inner}}}" if value.is_mapping else f"[{inner}]"
    if value.anchor:
        text = f"&{value.anchor} {text}".rstrip(" ")
    return f"{entry.key}: {text}".rstrip(" ") if entry.key else text
