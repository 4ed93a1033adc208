"""Cases: everything that determines a run but its seed, how long it lasts, and what becomes of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from pydantic import BaseModel

from circuitkit.base.errors import CircuitkitError, InputError, Problem, UnknownNameError
from circuitkit.control import ControllerSpec
from circuitkit.simulation import Plan, Reference, RunSpec, Scenario
from circuitkit.simulation.disturbances.push import Push
from circuitkit.simulation.effects import require_before
from circuitkit.simulation.formulas import Value
from circuitkit.simulation.plan import Body, Circuits, make_body
from circuitkit.simulation.scenario import LONGEST_S
from circuitkit.study.spec import INVALID, is_measure

FILES = ("robot", "reference", "controller", "circuit")  # keys of a scenario that name files
_NAMES = {"scenario", "description", "seed", *FILES}  # keys whose text determines nothing by itself
_OWN_FORM = {"disturbances", "measures", "reference"}  # keys that are written as a file has them
_SEED_MARK = "\N{SYMBOL FOR SUBSTITUTE}seed"  # where the seed goes in a description
WATCH = "watch"  # the key of a study
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
        inputs: Fingerprint of what each of its files says, by kind and name.
    """

    scenario: Scenario
    reference: Reference
    controller: str | ControllerSpec
    circuits: Circuits
    circuit_settings: Mapping[str, str]
    numbers: Mapping[str, Any]
    inputs: Mapping[str, str]

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
        names = {"servo_profile", "duration", "control_step", "until", "valid"}
        changing = [(each.kind, each) for each in self.scenario.befalling if each.changes_model]
        files = [
            content
            for name, content in self.inputs.items()
            if name.partition(" ")[0] in {"robot", "reference"}
        ]
        step_s = None if self.circuits.used is None else self.circuits.used.step_s
        scenario = self.scenario.model_dump(mode="json", include=names)
        return fingerprint((scenario, self.scenario.formulas, changing, files, step_s))

    @cached_property
    def shared_key(self) -> str:
        """The same for cases whose robots can be stepped together."""
        scenario = self.scenario.model_dump(mode="json", exclude={*_NAMES, *_OWN_FORM})
        shared = [(each.kind, each) for each in self.scenario.befalling if not each.per_robot]
        measures = [self.scenario.formulas, [(each.kind, each) for each in self.scenario.measure_kinds]]
        files = [(name.partition(" ")[0], content) for name, content in self.inputs.items()]
        controller = self.controller if isinstance(self.controller, str) else None
        return fingerprint((scenario, shared, measures, controller, files))

    @cached_property
    def key(self) -> str:
        """The same for cases whose runs are the same."""
        apart = [(each.kind, each) for each in self.scenario.befalling if each.per_robot]
        return fingerprint((self.shared_key, apart))

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
    """The plan of a case; robots and their motions are made once, as long as they are in use."""
    return case.plan(_body(_Keyed(case.body_key, lambda: case.plan().body)))


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


def fingerprint(value: object) -> str:
    """32 hexadecimal digits that are equal for equal values: of models, dataclasses, arrays and plain data.

    Descriptions and places in files do not count.
    """
    return hashlib.sha256(json.dumps(_plain(value, {}), ensure_ascii=False).encode()).hexdigest()[:32]


def _plain(value: Any, seen: dict[int, Any]) -> Any:  # noqa: ANN401, PLR0911 - any value, and a line for each type
    """A value as JSON data; what stands in it several times is looked at once."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
        return [_plain(each, seen) for each in value]
    if isinstance(value, Mapping):
        return [[_plain(key, seen), _plain(each, seen)] for key, each in value.items()]
    if isinstance(value, set | frozenset):
        return sorted(json.dumps(_plain(each, seen)) for each in value)
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value)
        return [str(data.dtype), list(data.shape), hashlib.sha256(data.tobytes()).hexdigest()]
    if isinstance(value, BaseModel):
        return _plain(value.model_dump(mode="json", exclude={"description"}), seen)
    if is_dataclass(value):
        if id(value) not in seen:
            parts = {
                each.name: _plain(getattr(value, each.name), seen)
                for each in fields(value)
                if each.compare and each.name != "description"
            }
            text = json.dumps(parts, ensure_ascii=False)
            seen[id(value)] = [type(value).__name__, hashlib.sha256(text.encode()).hexdigest()]
        return seen[id(value)]
    return [type(value).__name__, str(value)]
