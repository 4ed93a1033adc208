"""What a study changes: paths of fields such as `push.force`, values put there, and what is wrong with them.

Complaints about a changed scenario and its files are told where the study makes the changes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from pydantic import BaseModel

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.source import Data, Document, Finding, Place, model_problems, place_text
from circuitkit.simulation.disturbance import DISTURBANCES
from circuitkit.simulation.reference import REFERENCES
from circuitkit.simulation.scenario import scenario_class

LIST = "disturbances"
_STEP = re.compile(r"(?P<name>[^.\[\]]+)|\[(?P<index>[0-9]+)\]")
_PATH = re.compile(r"[^.\[\]]+(?:\[[0-9]+\])*(?:\.[^.\[\]]+(?:\[[0-9]+\])*)*")

ModelT = TypeVar("ModelT", bound=BaseModel)
T = TypeVar("T")


class PathError(ValueError):
    """A path leads nowhere.

    Attributes:
        hint: What was probably meant; may be empty.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True)
class Change:
    """One field that a study changes.

    Attributes:
        path: As it was written.
        parts: The same in parts.
        value: The new value.
        place: Where in the study the value stands; None if it does not.
        at: Where in the data of the file it has been put; the parts, unless the path is a short one.
    """

    path: str
    parts: Place
    value: Any
    place: Place | None
    at: Place = ()

    def reaches(self, place: Place) -> bool:
        """Whether a part of a file is what was changed, or lies in it, or around it."""
        return place[: len(self.at)] == self.at or self.at[: len(place)] == place

    def shown(self, place: Place) -> str:
        """A part of the file that it reaches, in the words of its path."""
        inner = place_text(place[len(self.at) :])
        return f"{self.path}{'.' if inner and not inner.startswith('[') else ''}{inner}"


def read_change(path: str, value: Any, place: Place | None) -> Change:  # noqa: ANN401 - any value
    """A change from its path.

    Raises:
        PathError: This is no path.
    """
    if not _PATH.fullmatch(path):
        message = f"found '{path}'; allowed: the path of a field, such as push.force or reference.step_length"
        raise PathError(message)
    steps: Iterator[re.Match[str]] = _STEP.finditer(path)
    parts = tuple(step["name"] if step["index"] is None else int(step["index"]) for step in steps)
    return Change(path, parts, value, place, parts)


def put_into_scenario(data: Data, change: Change) -> list[Change]:
    """Put a value into the data of a scenario, in place.

    The first part of the path is a key of the scenario, or a kind of disturbance: `push.force` is a field of
    the first push, `push[1].force` of the second one. A disturbance that is not there is added at the end.
    `push: {...}` is one whole push; `push: [...]` stands for all pushes, and `push: []` for none.

    Returns:
        The change with its place in the data; several, or none, for a list of disturbances.

    Raises:
        PathError: The path leads nowhere.
    """
    head = change.parts[0]
    keys = scenario_class().model_fields
    if head in keys:
        if change.parts[:1] == ("reference",) and change.parts[1:2] and isinstance(data, dict):
            _choose_reference(data, str(change.parts[1]))
        put(data, change.parts, change.value)
        return [change]
    if head not in DISTURBANCES.kinds:
        names = [*keys, *DISTURBANCES.kinds]
        kinds = f"a kind of disturbance: {listing(DISTURBANCES.kinds)}"
        message = f"unknown field '{head}'; allowed: {listing(keys)}, or {kinds}"
        raise PathError(message, suggest(str(head), names))
    return _put_disturbance(data, str(head), change)


def _choose_reference(data: dict[str, Data], kind: str) -> None:
    """Let another kind of reference take the place of the scenario's."""
    found = data.get("reference")
    if kind in REFERENCES.kinds and not (isinstance(found, dict) and kind in found):
        data["reference"] = {}


def _put_disturbance(data: Data, kind: str, change: Change) -> list[Change]:
    if not isinstance(data, dict):
        message = f"the file has no {LIST}; allowed: a scenario"
        raise PathError(message)
    if not isinstance(data.get(LIST), list):
        data[LIST] = []
    items = data[LIST]
    assert isinstance(items, list)
    there = [k for k, item in enumerate(items) if isinstance(item, dict) and kind in item]
    if len(change.parts) == 1 and (change.value is None or isinstance(change.value, list)):
        for k in there:
            items[k] = None  # so that the others keep their numbers; see `without_gaps`
        made = []
        for i, value in enumerate(change.value or ()):
            items.append({kind: deepcopy(value)})
            place = None if change.place is None else (*change.place, i)
            made.append(replace(change, path=f"{kind}[{i}]", place=place, at=(LIST, len(items) - 1, kind)))
        return made
    number = change.parts[1] if len(change.parts) > 1 and isinstance(change.parts[1], int) else 0
    inner = (
        change.parts[2:] if len(change.parts) > 1 and isinstance(change.parts[1], int) else change.parts[1:]
    )
    if number > len(there):
        count = str(len(there)) if there else "no"
        allowed = (
            kind if not there else f"{kind}, {kind}[{len(there)}]" if there[1:] else f"{kind}, or {kind}[1]"
        )
        verb = "is" if len(there) == 1 else "are"
        message = f"there {verb} {count} {kind}; allowed: {allowed} for a new one"
        raise PathError(message)
    if number == len(there):
        items.append({kind: {}})
        there.append(len(items) - 1)
    at = (LIST, there[number], kind, *inner)
    put(
        data,
        at,
        change.value,
        len(at) - len(inner),
        place_text(change.parts[: len(change.parts) - len(inner)]),
    )
    return [replace(change, at=at)]


def without_gaps(data: Data, changes: Sequence[Change]) -> list[Change]:
    """Take away, in place, the disturbances that were removed; the changes with their new places."""
    items = data.get(LIST) if isinstance(data, dict) else None
    if not isinstance(items, list):
        return list(changes)
    kept = [k for k, item in enumerate(items) if item is not None]
    number = {old: new for new, old in enumerate(kept)}
    items[:] = [items[k] for k in kept]
    moved = []
    for change in changes:
        if change.at[:1] == (LIST,) and len(change.at) > 1 and change.parts[0] != LIST:
            if change.at[1] not in number:
                continue  # it was a change of what has been taken away since
            change = replace(change, at=(LIST, number[int(change.at[1])], *change.at[2:]))  # noqa: PLW2901
        moved.append(change)
    return moved


def put(data: Data, parts: Place, value: Any, known: int = 0, words: str = "") -> None:  # noqa: ANN401 - any value
    """Put a value where a path leads, in place; mappings on the way are made.

    Args:
        data: The data.
        parts: The path.
        value: The value.
        known: The first so many parts are there, and are called otherwise in complaints.
        words: What they are called.

    Raises:
        PathError: The path leads nowhere.
    """
    around: Any = data
    for depth, part in enumerate(parts):
        before = place_text(parts[known:depth])
        there = (
            f"{words}{'.' if words and before and before[0] != '[' else ''}{before}" if depth >= known else ""
        )
        there = there or "the file"
        last = depth == len(parts) - 1
        _require_inside(around, part, there)
        if last:
            around[part] = deepcopy(value)
        else:
            if isinstance(around, dict) and around.get(part) is None:
                around[part] = {}
            around = around[part]


def _require_inside(around: Any, part: str | int, there: str) -> None:  # noqa: ANN401 - data
    if isinstance(part, int):
        if not isinstance(around, list):
            message = f"{there} is no list; allowed: a list before [{part}]"
            raise PathError(message)
        if part >= len(around):
            have = f"[0] to [{len(around) - 1}]" if around[1:] else "[0]" if around else "nothing"
            items = "item" if len(around) == 1 else "items"
            message = f"{there} has {len(around)} {items}; allowed: {have}"
            raise PathError(message)
    elif isinstance(around, list):
        message = f"{there} is a list; allowed: an item of it, such as {there}[0].{part}"
        raise PathError(message)
    elif not isinstance(around, dict):
        message = f"{there} has no fields; allowed: a value"
        raise PathError(message)


@dataclass(frozen=True)
class Complaints:
    """Turns complaints about files into complaints about what a study says.

    Attributes:
        study: The file of the study.
        scenario: The path of the file of its scenario.
    """

    study: Document
    scenario: str

    def about(self, change: Change, message: str, hint: str = "", *, is_name: bool = False) -> Problem:
        """A complaint about a change, where the study makes it.

        Args:
            change: The change.
            message: What was found; what is allowed.
            hint: What was probably meant.
            is_name: Whether the path is wrong, not the value.
        """
        if change.place is None:
            return Problem("", 0, 0, change.path, message, hint)
        place = change.place
        at_key = is_name and place[:1] != ("search",)
        if is_name and place[:1] == ("axes",) and place[-1] != change.path:
            place = place[:-1]  # the axis is called after the field
        return replace(self.study.problem(place, message, hint, at_key=at_key), where=change.path)

    @contextmanager
    def on_path(self, change: Change) -> Iterator[None]:
        """Tell a path that leads nowhere where the study has it.

        Raises:
            InputError: The path of the change leads nowhere.
        """
        try:
            yield
        except PathError as error:
            raise InputError(self.about(change, str(error), error.hint, is_name=True)) from error

    def validated(
        self, document: Document, model: type[ModelT], data: Data, changes: Sequence[Change], skip: int = 0
    ) -> ModelT:
        """A model of changed data.

        Args:
            document: The file before the changes.
            model: What it becomes.
            data: The changed data.
            changes: The changes.
            skip: How many parts of their paths lead to the file.

        Raises:
            InputError: With everything that is wrong, told at the change that it comes from.
        """
        result, findings = model_problems(document, model, data)
        if result is None:
            prefix = changes[0].parts[:skip] if changes else ()
            raise InputError(*(self._traced(finding, changes, prefix) for finding in findings))
        return result

    def _traced(self, finding: Finding, changes: Sequence[Change], prefix: Place) -> Problem:
        """A finding, told at the last change that it can come from."""
        place = (*prefix, *finding.place)
        if not finding.place:  # of the file as a whole, or a key that its message begins with
            key, _, message = finding.problem.message.partition(": ")
            named = [change for change in changes if change.at == (key,)]
            return self.about(named[-1], message) if named else finding.problem
        for change in reversed(changes):
            if change.reaches(place):
                is_name = finding.kind == "extra_forbidden" and place == change.at
                moved = self.about(change, finding.problem.message, finding.problem.hint, is_name=is_name)
                return replace(moved, where=change.shown(place))
        return finding.problem

    def guarded(self, make: Callable[[], T], key: str, changes: Sequence[Change]) -> T:
        """Make something from a file that the scenario names.

        Args:
            make: Makes it.
            key: The key of the scenario that names the file.
            changes: Those of the scenario.

        Raises:
            InputError: If the study named the file and it cannot be found, that is told in the study.
        """
        try:
            return make()
        except InputError as error:
            named = [change for change in changes if place_text(change.at) == key]
            inside = [each for each in error.problems if each.is_placed and each.file != self.scenario]
            if named and not inside:
                problems = [each for each in error.problems if each.where in {"", key}]
                if problems:
                    moved = (self.about(named[-1], each.message, each.hint) for each in problems)
                    raise InputError(*moved) from error
            raise self.relocated(error, changes) from error

    def relocated(self, error: InputError, changes: Iterable[Change]) -> InputError:
        """Complaints about the scenario's file, told where the study changed it."""
        by_text = {place_text(change.at): change for change in changes}
        problems = []
        for problem in error.problems:
            here = problem.file == self.scenario
            hits = [text for text in by_text if here and _overlap(text, problem.where)]
            if not hits:
                problems.append(problem)
                continue
            change = by_text[hits[-1]]
            inner = problem.where.removeprefix(hits[-1]) if problem.where.startswith(hits[-1]) else ""
            moved = self.about(change, problem.message, problem.hint)
            problems.append(replace(moved, where=f"{change.path}{inner}"))
        return InputError(*problems)

    def about_setting(self, change: Change, problem: Problem) -> Problem:
        """A complaint about a value that was set in the circuit."""
        message = problem.message.replace(" (with --set)", "")
        if problem.file and problem.file != self.scenario:
            message = f"{message} ({problem.file}:{problem.line}:{problem.column})"
        is_name = problem.message.startswith("unknown name")
        return self.about(change, message, problem.hint, is_name=is_name)


def about_file(study: Document, place: Place, error: InputError) -> InputError:
    """Complaints about a file that cannot be found, told where the study names it."""
    return InputError(
        *(p if p.is_placed else study.problem(place, p.message, p.hint) for p in error.problems)
    )


def _overlap(one: str, other: str) -> bool:
    """Whether one place is in the other."""
    short, long = sorted((one, other), key=len)
    return long.startswith(short) and long[len(short) : len(short) + 1] in {"", ".", "["}
