"""Whether a tuning can be run: everything that its first runs would complain about, before they are made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.source import Place
from circuitkit.study.case_builder import CaseBuilder
from circuitkit.study.cases import Case
from circuitkit.study.jobs import plan_of
from circuitkit.study.spec import RMS
from circuitkit.study.tuning.objective import LIMIT
from circuitkit.study.tuning.runs import Condition, Runs
from circuitkit.study.tuning.spec import Tuning


def check(tuning: Tuning, runs: Sequence[Runs]) -> None:
    """See whether what is searched exists and may have the values of its range, and the cases are sound.

    So are the figures of the objective: whatever the first runs would have complained about.

    Raises:
        InputError: With everything that is not; says where in the file of the tuning.
    """
    spec, document = tuning.spec, tuning.document
    problems: list[Problem] = []
    for each in runs:
        builder = CaseBuilder(each.study)
        for condition in each.conditions:
            try:
                builder.case({**condition.settings, **tuning.settings({})})
            except InputError as error:
                problems += [_placed(tuning, condition, problem) for problem in error.problems]
    builder, first_condition = CaseBuilder(runs[0].study), runs[0].conditions[0]
    for name, searched in () if problems else spec.parameters.items():
        ends = searched.choices or (searched.low, searched.high)
        for text in map(str, ends):
            try:
                builder.case({**first_condition.settings, **tuning.settings({name: text})})
            except InputError as error:
                found = error.problems[0]
                at_key = found.message.startswith("unknown")
                place: Place = ("tune", "parameters", name)
                problems.append(document.problem(place, found.message, found.hint, at_key=at_key))
                break
    problems += () if problems else _unknown_figures(tuning, runs)
    if problems:
        first = {(problem.file, problem.line, problem.column): problem for problem in reversed(problems)}
        raise InputError(*sorted(first.values(), key=lambda each: (each.file, each.line, each.column)))


def _unknown_figures(tuning: Tuning, runs: Sequence[Runs]) -> Iterator[Problem]:
    """Terms of the objective whose figure some of their runs will not have."""
    spec = tuning.spec
    direction = "maximise" if spec.maximise else "minimise"
    by_name = {each.name: each for each in runs}
    known: dict[str, tuple[str, ...]] = {}
    for number, term in enumerate(spec.terms):
        if term.figure == LIMIT:
            continue
        used = by_name[term.runs] if term.runs else runs[0]
        builder = CaseBuilder(used.study)
        for condition in used.conditions:
            case = builder.case({**condition.settings, **tuning.settings({})})
            if case.shared_key not in known:
                known[case.shared_key] = _columns(case)
            allowed = (LIMIT, *known[case.shared_key])
            if term.figure not in allowed:
                message = f"unknown figure '{term.figure}'; allowed: {listing(allowed)}"
                place: Place = ("tune", direction, number, "figure")
                yield tuning.document.problem(place, message, suggest(term.figure, allowed))
                break


def _columns(case: Case) -> tuple[str, ...]:
    """The columns of a case's results that a figure can be, known without a run."""
    plan = plan_of(case)
    commands = plan.controller(case.controller).commands
    return (*plan.judge.units, *(f"{RMS}{name}" for name in commands))


def _placed(tuning: Tuning, condition: Condition, problem: Problem) -> Problem:
    """A problem with a place in the file of the tuning, if it has none of its own."""
    if problem.file:
        return problem
    fallback: Place = ("tune", tuning.spec.target)
    place = next((at for path, at in condition.places.items() if problem.where.startswith(path)), fallback)
    return replace(tuning.document.problem(place, problem.message, problem.hint), where=problem.where)
