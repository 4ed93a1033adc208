"""Makes points: a scenario with the fields that a study changes; complaints point at where it does so."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
from pydantic import BaseModel

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.base.source import (
    Data,
    Document,
    Finding,
    find_data_file,
    model_problems,
    place_text,
    read_yaml,
    validate_model,
)
from circuitkit.circuit import CircuitGraph
from circuitkit.control import ControllerSpec, load_controller, shipped_controllers
from circuitkit.control.spec import FOLDER as CONTROLLER_FOLDER
from circuitkit.biped.gait import GaitSpec, Walk, load_gait
from circuitkit.biped.gait.schedule import plan_steps
from circuitkit.biped.gait.spec import FOLDER as GAIT_FOLDER
from circuitkit.robots import load_robot
from circuitkit.simulation import Scenario
from circuitkit.simulation.disturbance import push_start
from circuitkit.simulation.run import CONTROLLERS, load_graphs
from circuitkit.study.points import FILES, Point, fingerprint
from circuitkit.study.spec import Settings, Study, cell_of

Parts: TypeAlias = tuple[str | int, ...]

_FOLDER = "sims"
_LONGEST_S = 3600.0
_STEP = re.compile(r"(?P<name>[^.\[\]]+)|\[(?P<index>\d+)\]")
_PATH = re.compile(r"[^.\[\]]+(?:\[\d+\])*(?:\.[^.\[\]]+(?:\[\d+\])*)*")

ModelT = TypeVar("ModelT", bound=BaseModel)
T = TypeVar("T")


@dataclass(frozen=True)
class _Change:
    """One field that the study changes.

    Attributes:
        path: As it was written.
        parts: The same in parts.
        value: The new value.
        place: Where in the study the value stands; None if it does not.
    """

    path: str
    parts: Parts
    value: Any
    place: Parts | None

    def reaches(self, place: Parts) -> bool:
        """Whether a part of a file is what was changed, or lies in it, or around it."""
        return place[: len(self.parts)] == self.parts or self.parts[: len(place)] == place


class PointMaker:
    """Makes the points of a study; what several of them share is read once."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._cache: dict[Any, Any] = {}

    def check(self) -> None:
        """See whether every value of every axis fits by itself, with the first values of the others.

        Raises:
            InputError: With everything that does not.
        """
        study, search = self._study, self._study.search
        first = {axis: values[0] for axis, values in study.axes.items()}
        chosen = [first]
        chosen += [first | {axis: value} for axis, values in study.axes.items() for value in values[1:]]
        problems: list[Problem] = []
        for number, values in enumerate(chosen):
            ends = () if search is None else (0, search.count - 1)[: 1 if number else 2]
            for searched in [None if search is None else search.value(end) for end in ends] or [None]:
                with _collected(problems):
                    study.point_of(cell_of(values), searched)
        if problems:
            each = {str(problem): problem for problem in problems}.values()
            raise InputError(*sorted(each, key=lambda problem: (problem.file, problem.line, problem.column)))

    def point(self, settings: Settings, places: Mapping[str, Parts] | None = None) -> Point:
        """The study's scenario with its `set` and then these settings.

        Raises:
            InputError: Fields do not exist, or their values do not fit; carries every problem.
        """
        problems: list[Problem] = []
        changes: list[_Change] = []
        given = [(path, value, ("set", path)) for path, value in self._study.file.set.items()]
        for path, value, place in [*given, *((p, v, (places or {}).get(p)) for p, v in settings.items())]:
            with _collected(problems):
                changes.append(self._change(path, value, place))
        inner = {name: [c for c in changes if c.parts[0] == name and len(c.parts) > 1] for name in FILES[1:]}
        outer = [change for change in changes if not any(change in some for some in inner.values())]
        scenario = self._scenario(outer, problems)
        gait = controller = graphs = inputs = None
        with _collected(problems):
            gait = self._gait(scenario, outer, inner["gait"])
        with _collected(problems):
            if gait is not None:
                scenario = self._watched(scenario, gait, outer)
        with _collected(problems):
            controller = self._controller(scenario, outer, inner["controller"])
        set_in_circuit = {change.path.partition(".")[2]: change for change in inner["circuit"]}
        with _collected(problems):
            graphs = self._graphs(scenario, outer, set_in_circuit)
        with _collected(problems):
            robot = self._robot(scenario, outer)
            if gait is not None and controller is not None and graphs is not None:
                inputs = robot | self._inputs(scenario, gait, controller, graphs)
        if problems or gait is None or controller is None or graphs is None or inputs is None:
            raise InputError(*problems)
        values = {name: _text(change.value) for name, change in set_in_circuit.items()}
        return Point(scenario, gait, controller, *graphs, circuit_settings=values, inputs=inputs)

    def _change(self, path: str, value: Any, place: Parts | None) -> _Change:  # noqa: ANN401 - any value
        if not _PATH.fullmatch(path):
            message = (
                f"found '{path}'; allowed: the path of a field, such as pushes[0].force or gait.step_length"
            )
            raise InputError(self._problem(_Change(path, (path,), value, place), message, is_name=True))
        steps: Iterator[re.Match[str]] = _STEP.finditer(path)
        parts = tuple(step["name"] if step["index"] is None else int(step["index"]) for step in steps)
        return _Change(path, parts, value, place)

    # --- what a point consists of --------------------------------------------------------------------------

    @cached_property
    def _base(self) -> Document:
        name = self._study.file.scenario
        try:
            return read_yaml(find_data_file(self._beside(name), _FOLDER))
        except InputError as error:
            raise self._at(("scenario",), error, name) from error

    @cached_property
    def _base_circuit(self) -> str:
        return validate_model(self._base, Scenario).circuit

    def _scenario(self, changes: Sequence[_Change], problems: list[Problem]) -> Scenario:
        """The scenario with its changes; if some do not fit, with the files that it names, to go on with."""
        data, only_files = deepcopy(self._base.data), deepcopy(self._base.data)
        fine = len(problems)
        for change in changes:
            value = change.value
            if len(change.parts) == 1 and change.parts[0] in FILES and isinstance(value, str):
                value = self._beside(value)
                self._put(only_files, change, value)
            with _collected(problems):
                self._put(data, change, value)
        if self._study.file.watch is not None and isinstance(data, dict) and data.get("pushes"):
            data["duration"] = f"{_LONGEST_S} s"
        with _collected(problems):
            scenario = self._scenario_of(data, changes)
            if len(problems) == fine:
                return scenario
        return self._scenario_of(only_files, changes)

    def _scenario_of(self, data: Data, changes: Sequence[_Change]) -> Scenario:
        key = json.dumps(data)
        return self._once(("scenario", key), lambda: self._validated(self._base, Scenario, data, changes))

    def _watched(self, scenario: Scenario, gait: GaitSpec, changes: Sequence[_Change]) -> Scenario:
        """The scenario that ends so long after the last push."""
        watch = self._study.file.watch
        if watch is None or not scenario.pushes:
            return scenario
        last_step = max(push.start.step for push in scenario.pushes)
        schedule = plan_steps(gait, last_step + 2)
        nothing = np.zeros((len(schedule.step), 0))
        walk = Walk(gait, schedule, nothing, nothing)
        try:
            with scenario.located("pushes"):
                ends = [
                    push_start(push, walk, i)[0] + push.duration for i, push in enumerate(scenario.pushes)
                ]
        except InputError as error:
            raise self._relocated(error, changes) from error
        ticks = int(np.ceil(round((max(ends) + watch) / gait.control_step, 6)))
        duration = round(ticks * gait.control_step, 9)
        if duration > _LONGEST_S:
            message = (
                f"found {watch:g} s, so that a run lasts {duration:g} s; allowed: {_LONGEST_S:g} s in all"
            )
            raise InputError(self._study.document.problem(("watch",), message))
        ended = scenario.model_copy(update={"duration": duration})
        if late := [fault for fault in ended.faults if fault.start >= duration]:
            message = f"the fault of {late[0].cell} starts after the end; allowed: before {duration:g} s"
            raise InputError(self._study.document.problem(("watch",), message))
        return ended

    def _gait(self, scenario: Scenario, outer: Sequence[_Change], inner: Sequence[_Change]) -> GaitSpec:
        file = scenario.file(scenario.gait)
        key = ("gait", file, json.dumps([(change.path, change.value) for change in inner]))

        def make() -> GaitSpec:
            if not inner:
                with scenario.located("gait"):
                    return load_gait(file)
            document = read_yaml(find_data_file(file, GAIT_FOLDER))
            return self._validated(document, GaitSpec, self._with(document, inner), inner, 1)

        return self._once(key, lambda: self._guarded(make, "gait", scenario.gait, [*outer, *inner]))

    def _controller(
        self, scenario: Scenario, outer: Sequence[_Change], inner: Sequence[_Change]
    ) -> str | ControllerSpec:
        name = scenario.controller
        if name in CONTROLLERS:
            if inner:
                message = (
                    f"the controller '{name}' has no file with fields; allowed: a controller that has one"
                )
                raise InputError(self._problem(inner[0], message, is_name=True))
            return name
        file = scenario.file(name)
        key = ("controller", file, json.dumps([(change.path, change.value) for change in inner]))

        def make() -> ControllerSpec:
            with scenario.located("controller"):
                try:
                    spec = load_controller(file)
                except UnknownNameError as error:
                    kind = "controller"
                    raise UnknownNameError(kind, name, (*CONTROLLERS, *shipped_controllers())) from error
            if not inner:
                return spec
            document = read_yaml(find_data_file(file, CONTROLLER_FOLDER))
            return self._validated(document, type(spec), self._with(document, inner), inner, 1)

        return self._once(key, lambda: self._guarded(make, "controller", name, [*outer, *inner]))

    def _graphs(
        self, scenario: Scenario, outer: Sequence[_Change], changes: Mapping[str, _Change]
    ) -> tuple[CircuitGraph, CircuitGraph | None]:
        """The circuit and the yardstick; another circuit may be judged by the scenario's own."""
        values = {name: _text(change.value) for name, change in changes.items()}
        other = scenario.circuit if scenario.circuit != self._base_circuit else None
        own = scenario if other is None else scenario.model_copy(update={"circuit": self._base_circuit})
        used = scenario.model_dump(mode="json", include={"silenced", "thresholds"})
        key = ("circuit", scenario.circuit, json.dumps([values, used]))

        def load(values: Mapping[str, str]) -> tuple[CircuitGraph, CircuitGraph | None]:
            return load_graphs(own, None if other is None else scenario.file(other), values)

        def make() -> tuple[CircuitGraph, CircuitGraph | None]:
            try:
                return load(values)
            except InputError as error:
                for name, change in changes.items():  # who is it?
                    try:
                        load({name: values[name]})
                    except InputError as alone:
                        raise InputError(*(self._set_problem(change, p) for p in alone.problems)) from error
                raise

        return self._once(key, lambda: self._guarded(make, "circuit", scenario.circuit, outer))

    def _set_problem(self, change: _Change, problem: Problem) -> Problem:
        """A complaint about a value that was set in the circuit."""
        message = problem.message.replace(" (with --set)", "")
        if problem.file and problem.file != self._base.path:
            message = f"{message} ({problem.file}:{problem.line}:{problem.column})"
        is_name = problem.message.startswith("unknown name")
        return self._problem(change, message, problem.hint, is_name=is_name)

    def _robot(self, scenario: Scenario, outer: Sequence[_Change]) -> dict[str, str]:
        """What the robot's files say."""
        file = scenario.file(scenario.robot)

        def contents() -> str:
            with scenario.located("robot"):
                spec = load_robot(file)
            return fingerprint((_without_paths(spec), spec.mjcf_path.read_bytes().hex()))

        said = self._once(("robot", file), lambda: self._guarded(contents, "robot", scenario.robot, outer))
        return {f"robot {scenario.robot}": said}

    def _inputs(
        self,
        scenario: Scenario,
        gait: GaitSpec,
        controller: str | ControllerSpec,
        graphs: tuple[CircuitGraph, CircuitGraph | None],
    ) -> dict[str, str]:
        """What a point's other files say, so that a change between two runs of a study can be told."""
        prints = {
            f"gait {scenario.gait}": self._print(gait),
            f"circuit {scenario.circuit}": self._print(graphs[0]),
        }
        if graphs[1] is not None:
            prints[f"yardstick {self._base_circuit}"] = self._print(graphs[1])
        if not isinstance(controller, str):
            prints[f"controller {scenario.controller}"] = self._print(controller)
            inner = self._once(("inner", id(controller)), lambda: _circuits_of(controller))
            prints |= {f"inner {name}": self._print(graph) for name, graph in inner.items()}
        return prints

    def _print(self, value: object) -> str:
        """The fingerprint of something that stays in the cache, so that its address is its own."""
        return self._once(("print", id(value)), lambda: fingerprint(value))

    # --- data and complaints -------------------------------------------------------------------------------

    def _once(self, key: Any, make: Callable[[], T]) -> T:  # noqa: ANN401 - any key
        if key not in self._cache:
            self._cache[key] = make()
        value: T = self._cache[key]
        return value

    def _beside(self, name: str) -> str:
        """A file that the study names, from the study's own folder if it is a relative path."""
        path = Path(name)
        beside = Path(self._study.document.path).parent / path
        return str(beside) if (path.suffix and not path.is_absolute() and beside.is_file()) else name

    def _with(self, document: Document, changes: Sequence[_Change]) -> Data:
        data = deepcopy(document.data)
        for change in changes:
            self._put(data, replace(change, parts=change.parts[1:]), change.value)
        return data

    def _put(self, data: Data, change: _Change, value: Any) -> None:  # noqa: ANN401 - any value
        """Put a value where a path leads; mappings on the way are made.

        Raises:
            InputError: The path leads nowhere.
        """
        around: Any = data
        for depth, part in enumerate(change.parts):
            there = place_text(change.parts[:depth]) or "the file"
            last = depth == len(change.parts) - 1
            if isinstance(part, int):
                if not isinstance(around, list):
                    message = f"{there} is no list; allowed: a list before [{part}]"
                    raise InputError(self._problem(change, message, is_name=True))
                if part >= len(around):
                    have = f"[0] to [{len(around) - 1}]" if around[1:] else "[0]" if around else "nothing"
                    items = "item" if len(around) == 1 else "items"
                    message = f"{there} has {len(around)} {items}; allowed: {have}"
                    raise InputError(self._problem(change, message, is_name=True))
            elif isinstance(around, list):
                message = f"{there} is a list; allowed: an item of it, such as {there}[0].{part}"
                raise InputError(self._problem(change, message, is_name=True))
            elif not isinstance(around, dict):
                message = f"{there} has no fields; allowed: a value"
                raise InputError(self._problem(change, message, is_name=True))
            if last:
                around[part] = deepcopy(value)
            else:
                if isinstance(around, dict) and around.get(part) is None:
                    around[part] = {}
                around = around[part]

    def _validated(
        self, document: Document, model: type[ModelT], data: Data, changes: Sequence[_Change], skip: int = 0
    ) -> ModelT:
        """A model of changed data; what is wrong with a change is told where the study makes it."""
        result, findings = model_problems(document, model, data)
        if result is None:
            prefix = changes[0].parts[:skip] if changes else ()
            raise InputError(*(self._told(finding, changes, prefix) for finding in findings))
        if isinstance(result, Scenario):
            result._document = document  # what `load_scenario` does
        return result

    def _told(self, finding: Finding, changes: Sequence[_Change], prefix: Parts) -> Problem:
        place = (*prefix, *finding.place)
        if not finding.place:  # of the file as a whole
            return finding.problem
        for change in reversed(changes):
            if change.reaches(place):
                is_name = finding.kind == "extra_forbidden" and place == change.parts
                told = self._problem(change, finding.problem.message, finding.problem.hint, is_name=is_name)
                return replace(told, where=place_text(place))
        return finding.problem

    def _guarded(self, make: Callable[[], T], key: str, name: str, changes: Sequence[_Change]) -> T:
        """Make something from a file that a scenario names; if the study named it, complain there."""
        try:
            return make()
        except InputError as error:
            named = [change for change in changes if change.parts == (key,)]
            files = {problem.file for problem in error.problems} - {"", self._base.path}
            inside = [file for file in files if file != name or Path(file).is_file()]
            if named and not inside:
                problems = [p for p in error.problems if p.where in {"", key}]
                if problems:
                    told = (self._problem(named[-1], p.message, p.hint) for p in problems)
                    raise InputError(*told) from error
            raise self._relocated(error, changes) from error

    def _relocated(self, error: InputError, changes: Iterable[_Change]) -> InputError:
        """Complaints about the scenario file, told where the study changed it."""
        by_text = {place_text(change.parts): change for change in changes}
        problems = []
        for problem in error.problems:
            hits = [
                change
                for text, change in by_text.items()
                if problem.file == self._base.path and problem.where.startswith(text)
            ]
            told = self._problem(hits[-1], problem.message, problem.hint) if hits else problem
            problems.append(replace(told, where=problem.where))
        return InputError(*problems)

    def _problem(self, change: _Change, message: str, hint: str = "", *, is_name: bool = False) -> Problem:
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
        return replace(self._study.document.problem(place, message, hint, at_key=at_key), where=change.path)

    def _at(self, place: Parts, error: InputError, name: str) -> InputError:
        """Complaints about a file that cannot be found, told where the study names it."""
        return InputError(
            *(
                self._study.document.problem(place, p.message, p.hint) if p.file in {"", name} else p
                for p in error.problems
            )
        )


@contextmanager
def _collected(problems: list[Problem]) -> Iterator[None]:
    """Keep complaints, to go on and find more."""
    try:
        yield
    except InputError as error:
        problems += error.problems


def _without_paths(spec: BaseModel) -> dict[str, Any]:
    return {key: value for key, value in spec.model_dump(mode="json").items() if key != "mjcf"}


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _circuits_of(controller: ControllerSpec) -> Mapping[str, CircuitGraph]:
    """The circuits that a controller file names, if its kind has any."""
    circuits = getattr(controller, "circuits", None)
    return circuits() if circuits else {}
