"""Makes cases: a scenario with the fields that a study changes; complaints point at where it does so."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

from circuitkit.base.errors import InputError, Problem, UnknownNameError
from circuitkit.base.source import Data, Document, Place, find_data_file, read_yaml, validate_model
from circuitkit.circuit import CircuitGraph
from circuitkit.control import load_controller, shipped_controllers
from circuitkit.control.spec import FOLDER as CONTROLLERS
from circuitkit.control.spec import without_kind
from circuitkit.robots import load_robot
from circuitkit.robots.spec import robot_class, robot_path
from circuitkit.simulation import Reference, Scenario
from circuitkit.simulation.plan import BUILT_IN, CIRCUIT, OPEN_LOOP, Circuits, control_step, load_circuits
from circuitkit.simulation.reference import REFERENCES
from circuitkit.simulation.scenario import FOLDER, LONGEST_S, scenario_class
from circuitkit.study.cases import FILES, WATCH, Case, require_moments, watched
from circuitkit.study.changes import (
    Change,
    Complaints,
    about_file,
    put,
    put_into_scenario,
    read_change,
    without_gaps,
)
from circuitkit.study.identity import Part, all_versions, backend_part, robot_parts
from circuitkit.study.plain import plain
from circuitkit.study.spec import Cell, Settings, Study, beside, cell_of, value_text

T = TypeVar("T")


@dataclass(frozen=True)
class _File:
    """What a file that a scenario names has become.

    Attributes:
        value: What was made of it.
        parts: What it adds to the identity of a case.
        numbers: What it says as JSON data, for the description of a case; None if it changes nothing there.
        circuits: The circuits that it names.
    """

    value: Any
    parts: Mapping[str, Part]
    numbers: Any = None
    circuits: Mapping[str, CircuitGraph] = field(default_factory=dict)


class CaseBuilder:
    """Makes the cases of a study; what several of them share is read once."""

    def __init__(self, study: Study) -> None:
        """Take a study; nothing is read yet."""
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
                    self.of_cell(cell_of(values), searched)
        if problems:
            each = {str(problem): problem for problem in problems}.values()
            raise InputError(*sorted(each, key=lambda problem: (problem.file, problem.line, problem.column)))

    def of_cell(self, cell: Cell, searched: str | None = None) -> Case:
        """The case of a cell.

        Args:
            cell: The cell.
            searched: The value of the searched field, as it would be written.

        Raises:
            InputError: As of `case`.
        """
        settings, places = dict(cell.settings), dict(cell.places)
        search = self._study.search
        if searched is not None and search is not None:
            settings[search.field] = searched
            places[search.field] = ("search", "field")
        return self.case(settings, places)

    def case(self, settings: Settings | None = None, places: Mapping[str, Place] | None = None) -> Case:
        """The study's scenario with its `set`, and then these settings.

        Args:
            settings: Fields by path, such as `{"circuit.w": "-0.5 deg", "push.force": "20 N"}`.
            places: Where in the study they stand.

        Raises:
            InputError: Fields do not exist, or their values do not fit; carries every problem.
        """
        problems: list[Problem] = []
        changes = self._changes(settings or {}, places or {}, problems)
        inner = {key: [c for c in changes if _is_inside(key, c)] for key in FILES}
        outer = [change for change in changes if not any(change in some for some in inner.values())]
        scenario, outer = self._scenario(outer, inner, problems)
        robot = reference = controller = circuits = None
        with _collected(problems):
            robot = self._robot(scenario, outer, inner["robot"])
        with _collected(problems):
            reference = self._reference(scenario, outer, inner["reference"])
        with _collected(problems):
            controller = self._controller(scenario, outer, inner["controller"])
        set_in_circuit = {change.path.partition(".")[2]: change for change in inner["circuit"]}
        with _collected(problems):
            circuits = self._circuits(scenario, outer, set_in_circuit)
        with _collected(problems):
            if reference is not None and circuits is not None:
                scenario = self._timed(scenario, reference.value, circuits, outer)
        if problems or robot is None or reference is None or controller is None or circuits is None:
            raise InputError(*problems)
        if inner["robot"]:
            scenario = scenario.model_copy(update={"robot": robot.value})
        return Case(
            scenario=scenario,
            reference=reference.value,
            controller=controller.value,
            circuits=circuits,
            circuit_settings={name: value_text(change.value) for name, change in set_in_circuit.items()},
            numbers={
                "reference": reference.numbers,
                "controller": controller.numbers,
                "robot": robot.numbers,
            },
            parts=self._parts(scenario, robot, reference, controller, circuits),
        )

    def _changes(
        self, settings: Settings, places: Mapping[str, Place], problems: list[Problem]
    ) -> list[Change]:
        given = [(path, value, ("set", path)) for path, value in self._study.file.set.items()]
        changes = []
        for path, value, place in [*given, *((p, v, places.get(p)) for p, v in settings.items())]:
            with _collected(problems), self._complaints.on_path(Change(path, (path,), value, place)):
                changes.append(read_change(path, value, place))
        return changes

    # --- what a case consists of ---------------------------------------------------------------------------

    @cached_property
    def _base(self) -> Document:
        name = self._study.file.scenario
        try:
            return read_yaml(find_data_file(beside(self._study.document, name), FOLDER))
        except InputError as error:
            raise about_file(self._study.document, ("scenario",), error) from error

    @cached_property
    def _complaints(self) -> Complaints:
        return Complaints(self._study.document, self._base.path)

    @cached_property
    def _base_circuit(self) -> str | None:
        circuit: str | None = validate_model(self._base, scenario_class()).circuit
        return circuit

    def _scenario(
        self, outer: Sequence[Change], inner: Mapping[str, Sequence[Change]], problems: list[Problem]
    ) -> tuple[Scenario, list[Change]]:
        """The scenario with its changes; if some do not fit, with the files that it names, to go on with."""
        data, only_files = deepcopy(self._base.data), deepcopy(self._base.data)
        fine = len(problems)
        done: list[Change] = []
        for change in outer:
            changed, names_file = change, change.parts[0] in FILES and isinstance(change.value, str)
            if names_file:
                changed = replace(change, value=beside(self._study.document, change.value))
                with _collected([]):
                    self._put(only_files, changed)
            with _collected(problems):
                done += self._put(data, changed)
        for change in inner["reference"]:
            with _collected(problems):
                done += self._put_into_reference(data, change)
        moves = any(change.value is None or isinstance(change.value, list) for change in outer)
        done = without_gaps(data, done)
        if self._study.file.watch is not None and isinstance(data, dict) and _has_push(data):
            data["duration"] = f"{LONGEST_S} s"
        with _collected(problems):
            scenario = self._scenario_of(data, done, moves=moves)
            if len(problems) == fine:
                return scenario, done
        return self._scenario_of(only_files, done), done

    def _put(self, data: Data, change: Change) -> list[Change]:
        with self._complaints.on_path(change):
            return put_into_scenario(data, change)

    def _put_into_reference(self, data: Data, change: Change) -> list[Change]:
        """A field of a reference whose numbers stand in the scenario itself; nothing for one with a file."""
        given = data.get("reference") if isinstance(data, dict) else None
        if not isinstance(given, dict) or len(given) != 1:
            message = (
                "the scenario has no reference with fields; allowed: fields of the reference that it has"
            )
            raise InputError(self._complaints.about(change, message, is_name=True))
        (kind,) = given
        if kind not in REFERENCES.kinds or REFERENCES[kind].file is not None:
            return []
        at = ("reference", kind, *change.parts[1:])
        with self._complaints.on_path(change):
            put(data, at, change.value, 2, "reference")
        return [replace(change, at=at)]

    def _scenario_of(self, data: Data, changes: Sequence[Change], *, moves: bool = False) -> Scenario:
        key = json.dumps(data)
        document = self._base
        if moves:  # the numbers of the disturbances are no longer those of the file
            marks = {
                place: mark
                for place, mark in document.marks.items()
                if place[:1] != ("disturbances",) or len(place) == 1
            }
            document = replace(document, marks=marks)

        def make() -> Scenario:
            made = self._complaints.validated(self._base, scenario_class(), data, changes)
            made._document = document  # what `load_scenario` does
            return made

        return self._once(("scenario", key), make)

    def _timed(
        self, scenario: Scenario, reference: Reference, circuits: Circuits, changes: Sequence[Change]
    ) -> Scenario:
        """The scenario with its duration, in which everything begins before the end."""
        watch, document = self._study.file.watch, self._study.document
        try:
            with scenario.located("disturbances"):
                if watch is not None:
                    step_s = control_step(scenario, reference, circuits.used)
                    scenario = watched(scenario, reference, step_s, watch)
                require_moments(scenario, reference)
        except InputError as error:
            of_watch = [document.problem((WATCH,), p.message) for p in error.problems if p.where == WATCH]
            raise InputError(*of_watch) if of_watch else self._complaints.relocated(error, changes) from error
        return scenario

    def _robot(self, scenario: Scenario, outer: Sequence[Change], inner: Sequence[Change]) -> _File:
        """The robot file."""
        file = scenario.file(str(scenario.robot))

        def make() -> _File:
            with scenario.located("robot"):
                robot = load_robot(file)
            if inner:
                document = read_yaml(robot_path(file))
                robot = self._complaints.validated(
                    document, robot_class(), self._with(document, inner), inner, 1
                )
                robot._document = document  # what `load_robot` does
            parts = robot_parts(robot, str(scenario.robot))
            return _File(robot, parts, robot.model_dump(mode="json") if inner else None)

        key = ("robot", file, _changed(inner))
        return self._once(key, lambda: self._complaints.guarded(make, "robot", [*outer, *inner]))

    def _reference(self, scenario: Scenario, outer: Sequence[Change], inner: Sequence[Change]) -> _File:
        """The reference, from the file that the scenario names or from what it says itself."""
        if scenario.reference is None:
            return self._once(("reference", ""), lambda: _File(Reference(), {}))
        kind = next(iter(scenario.reference.model_fields_set))
        given, made = getattr(scenario.reference, kind), REFERENCES[kind]
        if made.file is None:
            settings = {kind: plain(given)}
            part = Part("the scenario's reference", lambda: settings)
            return self._once(
                ("reference", json.dumps(settings)),
                lambda: _File(scenario.made_reference(), {"reference": part}),
            )
        folder, model = made.file.folder, made.file.model
        file = scenario.file(str(given))

        def make() -> _File:
            with scenario.located(f"reference.{kind}"):
                document = read_yaml(find_data_file(file, folder))
                numbers = self._complaints.validated(document, model, self._with(document, inner), inner, 1)
            build: Callable[[Any], Reference] = made
            part = Part(f"reference {given}", lambda: {kind: plain(numbers)})
            return _File(build(numbers), {"reference": part}, numbers.model_dump(mode="json"))

        key = ("reference", file, _changed(inner))
        return self._once(key, lambda: self._complaints.guarded(make, f"reference.{kind}", [*outer, *inner]))

    def _controller(self, scenario: Scenario, outer: Sequence[Change], inner: Sequence[Change]) -> _File:
        """The controller file, or the name of a controller without one."""
        name = scenario.controller or (OPEN_LOOP if scenario.circuit is None else CIRCUIT)
        if name in BUILT_IN:
            if inner:
                message = (
                    f"the controller '{name}' has no file with fields; allowed: a controller that has one"
                )
                raise InputError(self._complaints.about(inner[0], message, is_name=True))
            part = Part("controller", lambda: name)
            return self._once(("controller", name), lambda: _File(name, {"controller": part}))
        file = scenario.file(name)

        def make() -> _File:
            with scenario.located("controller"):
                try:
                    spec = load_controller(file)
                except UnknownNameError as error:
                    kind = "controller"
                    raise UnknownNameError(kind, name, (*BUILT_IN, *shipped_controllers())) from error
            if inner:
                document = without_kind(read_yaml(find_data_file(file, CONTROLLERS)))
                spec = self._complaints.validated(document, type(spec), self._with(document, inner), inner, 1)
            circuits = spec.circuits()
            parts = {"controller": Part(f"controller {name}", lambda: {spec.kind: plain(spec)})}
            for each, graph in circuits.items():
                parts[f"controller's {each}"] = self._of_circuit(graph, f"{each} of the controller {name}")
            return _File(spec, parts, spec.model_dump(mode="json"), circuits)

        key = ("controller", file, _changed(inner))
        return self._once(key, lambda: self._complaints.guarded(make, "controller", [*outer, *inner]))

    def _circuits(
        self, scenario: Scenario, outer: Sequence[Change], changes: Mapping[str, Change]
    ) -> Circuits:
        """The circuit; another circuit than the scenario's may be judged by the scenario's own."""
        values = {name: value_text(change.value) for name, change in changes.items()}
        base = self._base_circuit
        if scenario.circuit is None:
            if changes:
                message = "the scenario has no circuit; allowed: fields of the circuit that it has"
                raise InputError(self._complaints.about(next(iter(changes.values())), message, is_name=True))
            return Circuits()
        other = scenario.circuit if scenario.circuit != base else None
        own = scenario if other is None else scenario.model_copy(update={"circuit": base})

        def load(values: Mapping[str, str]) -> Circuits:
            return load_circuits(own, None if other is None else scenario.file(other), values)

        def make() -> Circuits:
            try:
                return load(values)
            except InputError as error:
                for name, change in changes.items():  # whose fault is it?
                    try:
                        load({name: values[name]})
                    except InputError as alone:
                        raise InputError(
                            *(self._complaints.about_setting(change, p) for p in alone.problems)
                        ) from error
                raise

        key = ("circuit", scenario.circuit, json.dumps([values, dict(scenario.settings), scenario.silenced]))
        return self._once(key, lambda: self._complaints.guarded(make, "circuit", outer))

    def _parts(
        self, scenario: Scenario, robot: _File, reference: _File, controller: _File, circuits: Circuits
    ) -> dict[str, Part]:
        """All that determines a case beside its scenario's own words; what cases share is made once."""
        parts = {**robot.parts, **reference.parts, **controller.parts}
        if circuits.used is not None:
            parts["circuit"] = self._of_circuit(circuits.used, f"circuit {scenario.circuit}")
        if circuits.own is not None:
            parts["scenario's circuit"] = self._of_circuit(circuits.own, f"circuit {self._base_circuit}")
        run = controller.circuits
        if controller.value == CIRCUIT and circuits.used is not None:
            run = {CIRCUIT: circuits.used}
        # Circuits of one file differ in their numbers: the first one tells what runs them all.
        of_files = ("backend", *run, scenario.circuit, *(part.title for part in controller.parts.values()))
        parts["backend"] = self._once(of_files, lambda: backend_part(run))
        return parts | self._versions(scenario, robot, reference, controller)

    def _versions(
        self, scenario: Scenario, robot: _File, reference: _File, controller: _File
    ) -> dict[str, Part]:
        made = (*scenario.befalling, *scenario.measure_kinds, reference.value, controller.value)
        key = frozenset(map(type, made)), id(robot), id(controller)
        every = (scenario, robot.value, reference.value, controller.value)
        return {"versions": self._once(key, lambda: Part("versions", lambda: all_versions(*every)))}

    def _of_circuit(self, graph: CircuitGraph, title: str) -> Part:
        """The part of a circuit that stays in the cache, so that its address is its own."""
        return self._once(("part", id(graph)), lambda: Part(title, lambda: plain(graph)))

    # --- data and complaints -------------------------------------------------------------------------------

    def _once(self, key: Any, make: Callable[[], T]) -> T:  # noqa: ANN401 - any key
        if key not in self._cache:
            self._cache[key] = make()
        value: T = self._cache[key]
        return value

    def _with(self, document: Document, changes: Sequence[Change]) -> Data:
        data = deepcopy(document.data)
        for change in changes:
            with self._complaints.on_path(change):
                put(data, change.parts[1:], change.value)
        return data


def _is_inside(key: str, change: Change) -> bool:
    """Whether a change is one of a field of the file that a key of the scenario names."""
    inside = change.parts[0] == key and len(change.parts) > 1
    return inside and not (key == "reference" and change.parts[1] in REFERENCES.kinds)


def _has_push(data: Mapping[str, Any]) -> bool:
    return any("push" in item for item in data.get("disturbances") or () if isinstance(item, dict))


@contextmanager
def _collected(problems: list[Problem]) -> Iterator[None]:
    """Keep complaints, to go on and find more."""
    try:
        yield
    except InputError as error:
        problems += error.problems


def _changed(changes: Sequence[Change]) -> str:
    return json.dumps([(change.path, change.value) for change in changes])
