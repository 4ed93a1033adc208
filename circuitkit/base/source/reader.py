"""YAML text to a `Document`, with every complaint about the text collected instead of only the first.

Built on the events of PyYAML's parser (the one of libyaml where it is there). Refused are equal keys in a
mapping, tags, merge keys, aliases that contain themselves or grow without bound, and what readers of
different YAML versions take for different numbers (`010`, `1_000`, `1:30`, `0x1F`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeAlias, TypedDict, Unpack

import yaml

from circuitkit.base.errors import InputError, Problem, suggest
from circuitkit.base.reading import INTEGERS_END, not_a_name, not_a_text, read_text, require_printable

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


_MOST_BY_ALIASES = 200_000
_DEEPEST = 50
_KEPT = 60  # letters of a name that is refused

# What shows only lines later, such as a bracket that is never closed: the mistake is where it begins.
_NEVER_ENDS = re.compile("flow|quoted|simple key")


def read_yaml(path: str | Path) -> Document:
    """Read a YAML file.

    Raises:
        InputError: The file cannot be read; carries every problem of the text, not only the first.
    """
    return _whole(*scan_yaml(path))


def parse_yaml(text: str, path: str = "<text>") -> Document:
    """Read YAML text; `path` stands in messages.

    Raises:
        InputError: The text cannot be read; carries every problem of the text, not only the first.
    """
    return _whole(*scan_text(text, path))


def _whole(document: Document | None, problems: list[Problem]) -> Document:
    if problems or document is None:
        raise InputError(*problems)
    return document


def scan_yaml(path: str | Path) -> tuple[Document | None, list[Problem]]:
    """Read a YAML file as far as it can be read, with what is wrong with it.

    Where a value is refused, the document holds its text, so that the rest can still be checked; there is no
    document if the text is not YAML at all.
    """
    try:
        text = read_text(path, "a YAML file")
    except InputError as error:
        return None, list(error.problems)
    return scan_text(text, str(path))


def scan_text(text: str, path: str) -> tuple[Document | None, list[Problem]]:
    """Read YAML text as far as it can be read, with what is wrong with it; see `scan_yaml`."""
    try:
        require_printable(text, path)
    except InputError as error:
        return None, list(error.problems)
    builder = _Builder(path, text)
    try:
        data = builder.document()
    except yaml.MarkedYAMLError as error:
        return None, [*builder.problems, _syntax_problem(error, text, path)]
    except _UnreadableError:
        return None, builder.problems
    return Document(path, data, builder.marks, builder.shifts), builder.problems


def _syntax_problem(error: yaml.MarkedYAMLError, text: str, path: str) -> Problem:
    mark = error.problem_mark or error.context_mark
    begun = error.context_mark
    if mark and begun and begun.line < mark.line and _NEVER_ENDS.search(str(error.context)):
        mark = begun
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    context = f" {error.context}" if error.context else ""
    lines = text.splitlines()
    rest = lines[line - 1][column - 1 :] if line <= len(lines) else ""
    hint = ""
    if rest.startswith("\t"):
        hint = "indent with spaces, not with tabs"
    elif rest[:1] in {"%", "@", "`"}:
        hint = f"put a text that starts with {rest[0]} in quotes"
    elif rest.startswith("[") and "'}'" in str(error.problem):
        hint = 'between braces, put a name with brackets in quotes, such as "push[0].force"'
    return Problem(path, line, column, "", f"this is not YAML: {error.problem}{context}", hint)


class _UnreadableError(Exception):
    """The rest of the text cannot be read; the reason is among the problems."""


@dataclass(frozen=True)
class _Anchored:
    data: Data
    size: int


@dataclass
class _Builder:
    """Turns the events of PyYAML's parser into data, and collects marks and problems on the way."""

    path: str
    text: str
    marks: dict[Place, Mark] = field(default_factory=dict)
    shifts: dict[Place, int | None] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    anchors: dict[str, _Anchored | None] = field(default_factory=dict)
    brought: int = 0
    parser: Any = None

    def document(self) -> Data:
        """The data of the one document of the text."""
        self.parser = getattr(yaml, "CSafeLoader", yaml.SafeLoader)(self.text)
        try:
            self.parser.get_event()  # the start of the stream
            start = self.parser.get_event()
            if isinstance(start, yaml.StreamEndEvent):
                self.give_up(start, "the file is empty; allowed: a mapping of keys and values")
            data = self.build(self.parser.get_event(), ())
            self.parser.get_event()  # the end of the document
            after = self.parser.get_event()
            if not isinstance(after, yaml.StreamEndEvent):
                self.complain(after, (), "found a second document; allowed: one document a file")
        finally:
            self.parser.dispose()
        return data

    def build(self, event: Any, place: Place, key: Any = None) -> Data:  # noqa: ANN401 - PyYAML has no types
        """The data that starts with an event; `key` is the event of its key in the mapping around it."""
        at = event.start_mark
        key_at = key.start_mark if key else at
        line, column = at.line + 1, at.column + 1
        # Made without its own checks: a large file has hundreds of thousands.
        self.marks[place] = tuple.__new__(Mark, (line, column, key_at.line + 1, key_at.column + 1))
        kind = type(event)
        if kind is yaml.ScalarEvent and event.tag is None and event.anchor is None:
            return self.scalar(event, place, line)
        if kind is yaml.AliasEvent:
            return self.alias(event, place)
        if event.tag is not None:
            self.complain(event, place, f"found the tag '{event.tag}'; allowed: values without tags")
        before = len(self.marks) + self.brought
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if kind is yaml.ScalarEvent:
            data = self.scalar(event, place, line)
        elif len(place) >= _DEEPEST:
            self.give_up(event, f"found lists or mappings nested too deep; allowed: {_DEEPEST}")
        elif kind is yaml.SequenceStartEvent:
            data = self.sequence(place)
        else:
            data = self.mapping(place)
        if event.anchor is not None:
            self.anchors[event.anchor] = _Anchored(data, len(self.marks) + self.brought - before + 1)
        return data

    def alias(self, event: Any, place: Place) -> Data:  # noqa: ANN401 - as above
        """The data that an alias stands for; complaints about it will point at the alias."""
        if event.anchor not in self.anchors:
            hint = suggest(event.anchor, self.anchors)
            self.complain(event, place, f"unknown alias '*{event.anchor}'; allowed: an anchor above it", hint)
            return None
        anchored = self.anchors[event.anchor]
        if anchored is None:
            self.complain(event, place, "found an alias inside what it stands for; allowed: aliases that end")
            return None
        self.brought += anchored.size
        if self.brought > _MOST_BY_ALIASES:
            message = f"found aliases that bring more than {_MOST_BY_ALIASES} values; allowed: fewer"
            self.give_up(event, message)
        return anchored.data

    def scalar(self, event: Any, place: Place, line: int) -> Data:  # noqa: ANN401 - as above
        """The value of a scalar on a line; what is refused is reported, and stays as its text."""
        text: str = event.value
        if event.style == '"' and (complaint := not_a_text(text)):  # an escape such as \e may write anything
            self.complain(event, place, complaint)
            return "".join(each for each in text if each.isprintable())
        if event.style or "\n" in text or " " in text:
            is_on_one_line = event.end_mark.line + 1 == line
            if event.style or not is_on_one_line:
                self.shifts[place] = 1 if is_on_one_line else None
        if not event.implicit[0]:
            return text
        try:
            return plain_scalar(text)
        except RefusedScalarError as error:
            self.complain(event, place, str(error))
            return text

    def sequence(self, place: Place) -> list[Data]:
        """The items up to the end of a list."""
        items: list[Data] = []
        next_event, build = self.parser.get_event, self.build
        while type(event := next_event()) is not yaml.SequenceEndEvent:
            items.append(build(event, (*place, len(items))))
        return items

    def mapping(self, place: Place) -> dict[str, Data]:
        """The entries up to the end of a mapping; equal keys are reported, and the first one counts."""
        data: dict[str, Data] = {}
        next_event, build = self.parser.get_event, self.build
        while type(key := next_event()) is not yaml.MappingEndEvent:
            if type(key) is not yaml.ScalarEvent or key.value == "":
                self.give_up(key, "found a key that is no text; allowed: a name as key")
            name: str = key.value
            if complaint := not_a_name(name):
                self.complain(key, place, complaint)
                name = "".join(each for each in name if each.isprintable())[:_KEPT]
            inner = (*place, name)
            if name in data:
                first = self.marks[inner]
                if not complaint:  # what is left of refused names may be alike
                    again = f"duplicate key '{name}', first on line {first.key_line}; allowed: each key once"
                    self.complain(key, inner, again)
                build(next_event(), inner, key)
                self.marks[inner] = first
            elif name == "<<" and key.implicit[0]:
                self.complain(key, place, "found the merge key '<<'; allowed: every entry written out")
                build(next_event(), inner, key)
            else:
                data[name] = build(next_event(), inner, key)
        return data

    def complain(self, event: Any, place: Place, message: str, hint: str = "") -> None:  # noqa: ANN401 - as above
        """Note a problem at an event."""
        mark = event.start_mark
        problem = Problem(self.path, mark.line + 1, mark.column + 1, place_text(place), message, hint)
        self.problems.append(problem)

    def give_up(self, event: Any, message: str) -> NoReturn:  # noqa: ANN401 - as above
        """Note a problem after which the rest cannot be read."""
        self.complain(event, (), message)
        raise _UnreadableError


# Plain scalars: only `true` and `false` are booleans, and `1e-3` is a number.
_WORDS: dict[str, bool | None] = {"": None, "~": None, "null": None, "true": True, "false": False}
_STARTS_A_NUMBER = frozenset("0123456789+-.")
_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_REAL = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF|nan|NaN|NAN)")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9][0-9_]*(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?")
_OTHER_BASE = re.compile(r"[-+]?0(?:[xX][0-9a-fA-F_]+|[oO][0-7_]+|[bB][01_]+)")
_UNDERSCORE = re.compile(r"[-+]?[0-9][0-9_]*(?:\.[0-9_]*)?(?:[eE][-+]?[0-9]+)?")
_SEXAGESIMAL = re.compile(r"[-+]?[0-9][0-9_]*(?::[0-5]?[0-9])+(?:\.[0-9]*)?")
_NOT_ZERO = re.compile(r"[-+]?[0.]*[1-9]")
_LONGEST_INTEGER = 300

_REFUSED = (
    (_NOT_FINITE, "a finite number"),
    (_LEADING_ZERO, "a number without leading zeros (some take these for octal), or quotes for a text"),
    (_OTHER_BASE, "a decimal number, or quotes for a text"),
    (_SEXAGESIMAL, "a decimal number (some take colons for base 60), or quotes for a text"),
    (_UNDERSCORE, "a number without underscores, or quotes for a text"),
)


class RefusedScalarError(ValueError):
    """A plain scalar that different YAML readers take for different values, or that is not finite."""


def plain_scalar(text: str) -> bool | float | int | str | None:
    """The value of an unquoted scalar.

    Raises:
        RefusedScalarError: It is ambiguous or not finite; the message says what is allowed.
    """
    if text in _WORDS:
        return _WORDS[text]
    if text[0] not in _STARTS_A_NUMBER:
        return text
    if _INTEGER.fullmatch(text) and len(text) < _LONGEST_INTEGER:
        if abs(number := int(text)) < INTEGERS_END:
            return number
        raise RefusedScalarError(
            _refusal(text, "whole numbers below 2^63; as a real number, with an exponent")
        )
    if _REAL.fullmatch(text):
        real = float(text)
        if not math.isfinite(real):
            raise RefusedScalarError(_refusal(text, "a finite number"))
        if not real and _NOT_ZERO.match(text):
            raise RefusedScalarError(_refusal(text, "0, or a number that a float can hold"))
        return real
    for pattern, allowed in _REFUSED:
        if pattern.fullmatch(text):
            raise RefusedScalarError(_refusal(text, allowed))
    return text


def _refusal(text: str, allowed: str) -> str:
    shown = text if len(text) < _LONGEST_INTEGER else f"{text[:20]}…"
    return f"found {shown}; allowed: {allowed}"
