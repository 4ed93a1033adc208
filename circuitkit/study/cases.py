"""Cases: everything that determines a run but its seed, how long it lasts, and what becomes of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from circuitkit.base.errors import CircuitkitError, InputError, Problem, UnknownNameError
from circuitkit.control import ControllerSpec
from circuitkit.simulation import Disturbance, Plan, Reference, RunSpec, Scenario
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.effects import require_before
from circuitkit.simulation.formulas import Value
from circuitkit.simulation.measures import INVALID
from circuitkit.simulation.plan import Body, Circuits, make_body, robot_of
from circuitkit.simulation.scenario import LONGEST_S
from circuitkit.study.identity import Part, robot_parts, scenario_data
from circuitkit.study.plain import digest, plain
from circuitkit.study.spec import is_measure

FILES = ("robot", "reference", "controller", "circuit")  # keys of a scenario that name files
_OWN_FORM = {"disturbances", "measures", "reference"}  # keys that are written as a file has them
_SEED_MARK = "\N{SYMBOL FOR SUBSTITUTE}seed"  # where the seed goes in a description
WATCH = "watch"  # the key of a study
_OF_BODY = ("robot", "MJCF", "model", "reference")  # the parts that a robot and its motion depend on
_HORIZONS_S = (60.0, 600.0, LONGEST_S)  # in which moments of the reference are looked for, the cheapest first
_KEPT_BODIES = 16  # robots with their motions that a process keeps


@dataclass(frozen=True)
class Case:
    """Everything that determines a run but its seed; it is checked, and can be sent elsewhere.

    Attributes:
        scenario: The scenario, with its own duration.
        reference: What its commands are added to.
        controller: `open_loop` or `circuit`, or the numbers of a controller file.
        circuits: The circuit, in use or not, and where it came from.
        circuit_settings: What was set in the circuit.
        numbers: What the files of reference, controller and robot say, by key, as JSON data; None for a file
            that is as it ships or lies, or for none.
        parts: All else that determines its runs, by kind: what its files say, backends, and versions.
    """

    scenario: Scenario
    reference: Reference
    controller: str | ControllerSpec
    circuits: Circuits
    circuit_settings: Mapping[str, str]
    numbers: Mapping[str, Any]
    parts: Mapping[str, Part]

    def plan(self, body: Body | None = None) -> Plan:
        """The plan of its runs.

        Args:
            body: Robot and motion, if they are there already; those of another case with the same `body_key`.
        """
        made = make_body(self.scenario, self.reference, self.circuits.used) if body is None else body
        return Plan(self.scenario, self.reference, made, self.circuits)

    def spec(self, seed: int) -> RunSpec:
        """One of its runs."""
        return RunSpec(seed, self.scenario.befalling)

    @cached_property
    def body_key(self) -> str:
        """The same for cases whose robot and its motion are the same."""
        shaping = ("servo_profile", "duration", "control_step", "until", "valid")
        kept = {key: self._said[key] for key in shaping}
        changing = [data for each, data in self._befalling if each.changes_model]
        step_s = None if self.circuits.used is None else self.circuits.used.step_s
        return digest([kept, self.scenario.formulas, changing, self._digests(*_OF_BODY), step_s])

    @cached_property
    def shared_key(self) -> str:
        """The same for cases whose robots can be stepped together."""
        shared = [data for each, data in self._befalling if not each.per_robot]
        return digest([self._said, shared, self._digests(*self.parts)])

    @cached_property
    def key(self) -> str:
        """The same for cases whose runs are the same: a checksum of all that determines them but seeds."""
        apart = [data for each, data in self._befalling if each.per_robot]
        return digest([self.shared_key, apart])

    @property
    def identity(self) -> dict[str, Part]:
        """All that determines its runs but their seeds, by kind; the keys are made of the same."""
        said = {**self._said, "disturbances": [data for _, data in self._befalling]}
        return {"scenario": Part("the scenario", lambda: said), **self.parts}

    @cached_property
    def _said(self) -> dict[str, Any]:
        return scenario_data(self.scenario)

    @cached_property
    def _befalling(self) -> list[tuple[Disturbance, Any]]:
        """What befalls the robot, in order, each with what it says as plain data."""
        return [(each, {each.kind: plain(each)}) for each in self.scenario.befalling]

    def _digests(self, *kinds: str) -> dict[str, str]:
        return {kind: self.parts[kind].digest for kind in kinds if kind in self.parts}

    def __getstate__(self) -> dict[str, Any]:
        """Other processes get the fields, not what was made of them."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def run_key(self, seed: int) -> str:
        """The name of a run: equal for equal runs."""
        return f"{self.key}-{seed}"

    def description(self, seed: int) -> str:
        """The complete scenario of a run as JSON, with the numbers of the files that it names."""
        return self._description.replace(_SEED_MARK, str(seed), 1)

    @cached_property
    def _description(self) -> str:
        everything = {
            **_as_in_a_file(self.scenario),
            "seed": _SEED_MARK,
            "circuit_settings": dict(self.circuit_settings),
            **{f"{key}_numbers": numbers for key, numbers in self.numbers.items()},
        }
        return json.dumps(everything, ensure_ascii=False).replace(f'"{_SEED_MARK}"', _SEED_MARK, 1)


@dataclass(frozen=True)
class Outcome:
    """What became of one run.

    Attributes:
        seed: Its seed.
        values: The scenario's measures, `clamped_share`, the part of the run in which commands were cut to
            their limits, and `rms_COMMAND`, the root mean square of every command of the controller up to the
            end, [SI unit]; None for what has no value.
        invalid: When and why its physics became invalid, so that nothing has a value; None if it did not.
    """

    seed: int
    values: Mapping[str, Value]
    invalid: str | None = None

    @property
    def survived(self) -> bool | None:
        """Whether the robot got through; see `holds`."""
        return self.holds("survived")

    def holds(self, measure: str) -> bool | None:
        """Whether a measure is true; None if it has no value, as in an invalid run, since then nobody knows.

        Raises:
            UnknownNameError: There is no such measure; lists those there are.
            CircuitkitError: It is a number.
        """
        if measure not in self.values:
            kind = "measure"
            raise UnknownNameError(kind, measure, filter(is_measure, self.values))
        value = self.values[measure]
        if value is not None and not isinstance(value, bool):
            message = f"found the measure '{measure}', which is a number; allowed: one that is true or false"
            raise CircuitkitError(message)
        return value

    def row(self) -> dict[str, Any]:
        """The outcome as columns."""
        return {"seed": self.seed, INVALID: self.invalid, **self.values}


def plan_of(case: Case) -> Plan:
    """The plan of a case; robots and their motions are made once, as long as they are in use.

    Raises:
        ChangedError: A file of the robot says something else than when the case was made.
    """
    return case.plan(_body(_Keyed(case.body_key, lambda: _made(case))))


class ChangedError(CircuitkitError):
    """Something that determines runs has changed while they are under way."""


def _made(case: Case) -> Body:
    body = case.plan().body
    robot = robot_of(case.scenario.model_copy(update={"servo_profile": None}))
    now = robot_parts(robot, "")
    for kind, what in (
        ("robot", case.parts["robot"].title),
        ("MJCF", f"'{robot.mjcf_path}', or what it loads,"),
    ):
        if now[kind].digest != case.parts[kind].digest:
            message = f"{what} has changed while its runs are under way; run them again"
            raise ChangedError(message)
    return body


@dataclass(frozen=True)
class _Keyed:
    """How to make something, and what it depends on."""

    key: str
    make: Callable[[], Body] = field(compare=False)


@lru_cache(maxsize=_KEPT_BODIES)
def _body(wanted: _Keyed) -> Body:
    return wanted.make()


def watched(scenario: Scenario, reference: Reference, step_s: float, watch_s: float) -> Scenario:
    """The scenario that ends so long after the end of its last push; as it is without a push.

    Args:
        scenario: The scenario.
        reference: Its reference.
        step_s: The control step.
        watch_s: How long.

    Raises:
        InputError: A push starts at no moment of the reference, or the run would last too long.
    """
    if not scenario.pushes:
        return scenario
    ticks = int(np.ceil(round((max(_ends_s(scenario, reference)) + watch_s) / step_s, 6)))
    duration = round(ticks * step_s, 9)
    if duration > LONGEST_S:
        message = f"found {watch_s:g} s, so that a run lasts {duration:g} s; allowed: {LONGEST_S:g} s in all"
        raise InputError(Problem("", 0, 0, WATCH, message))
    for k, each in enumerate(scenario.befalling):
        if isinstance(each.begins, float) and each.begins >= duration:
            which = f"disturbances[{k}].{each.kind}"
            message = f"{which} starts at {each.begins:g} s, after the end; allowed: before {duration:g} s"
            raise InputError(Problem("", 0, 0, WATCH, message))
    return scenario.model_copy(update={"duration": duration})


def require_moments(scenario: Scenario, reference: Reference) -> None:
    """See whether everything that has a start begins before the end.

    Raises:
        InputError: There is no such moment.
    """
    for k, each in enumerate(scenario.befalling):
        where = f"disturbances[{k}].{each.kind}"
        if isinstance(start := each.begins, Mapping):
            _start_s(reference, start, where, (scenario.duration,))
        elif start is not None:
            try:
                require_before(float(start), scenario.duration)
            except InputError as error:
                raise InputError(*(replace(p, where=f"{where}.{p.where}") for p in error.problems)) from error


def _ends_s(scenario: Scenario, reference: Reference) -> Iterator[float]:
    """When each push ends, [s]."""
    for k, each in enumerate(scenario.befalling):
        if isinstance(each, Push):
            start = _start_s(reference, each.start, f"disturbances[{k}].{each.kind}", _HORIZONS_S)
            yield start + each.duration


def _start_s(reference: Reference, start: Any, where: str, horizons_s: Sequence[float]) -> float:  # noqa: ANN401 - as files have it
    """When a disturbance starts, [s]: at a time, or at a moment of the reference.

    Args:
        reference: Knows moments.
        start: The time, or the words of the moment.
        where: The disturbance, for complaints.
        horizons_s: Ends of the runs in which it is looked for, one after the other.

    Raises:
        InputError: There is no such moment.
    """
    if not isinstance(start, Mapping):
        return float(start)
    for horizon_s in horizons_s:
        try:
            return reference.moment(start, horizon_s).time_s
        except InputError as error:
            problems = error.problems
    raise InputError(*(replace(each, where=f"{where}.{each.where}") for each in problems))


def _as_in_a_file(scenario: Scenario) -> dict[str, Any]:
    """A scenario as data: every key with its value in SI units, and of the kinds only those that it uses."""
    data = scenario.model_dump(mode="json", exclude={*_OWN_FORM, "robot"})
    data["robot"] = scenario.robot if isinstance(scenario.robot, str) else scenario.robot.robot
    data["reference"] = scenario.model_dump(mode="json", include={"reference"}, exclude_unset=True).get(
        "reference"
    )
    data["disturbances"] = [{each.kind: each.model_dump(mode="json")} for each in scenario.befalling]
    kinds = {each.kind: each.model_dump(mode="json") for each in scenario.measure_kinds}
    data["measures"] = {**scenario.formulas, **kinds}
    return data
