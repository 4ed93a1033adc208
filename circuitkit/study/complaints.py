"""Complaints about a changed scenario and its files, told where the study makes the changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from circuitkit.base.errors import InputError, Problem
from circuitkit.base.source import Data, Document, Finding, Place, model_problems, place_text
from circuitkit.study.paths import Change, PathError

ModelT = TypeVar("ModelT", bound=BaseModel)
T = TypeVar("T")


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

    def about_path(self, change: Change, error: PathError) -> InputError:
        """A complaint about a path that leads nowhere."""
        return InputError(self.about(change, str(error), error.hint, is_name=True))

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

    def guarded(self, make: Callable[[], T], key: str, name: str, changes: Sequence[Change]) -> T:
        """Make something from a file that the scenario names.

        Args:
            make: Makes it.
            key: The key of the scenario that names the file.
            name: How it is named.
            changes: Those of the scenario.

        Raises:
            InputError: If the study named the file and it cannot be found, that is told in the study.
        """
        try:
            return make()
        except InputError as error:
            named = [change for change in changes if place_text(change.at) == key]
            files = {problem.file for problem in error.problems} - {"", self.scenario}
            inside = [file for file in files if file != name or Path(file).is_file()]
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


def about_file(study: Document, place: Place, error: InputError, name: str) -> InputError:
    """Complaints about a file that cannot be found, told where the study names it."""
    return InputError(
        *(study.problem(place, p.message, p.hint) if p.file in {"", name} else p for p in error.problems)
    )


def _overlap(one: str, other: str) -> bool:
    """Whether one place is in the other."""
    short, long = sorted((one, other), key=len)
    return long.startswith(short) and long[len(short) : len(short) + 1] in {"", ".", "["}
