"""Cases: everything that determines a run but its seed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import BaseModel

from circuitkit.control import ControllerSpec
from circuitkit.simulation import Plan, Reference, RunSpec, Scenario
from circuitkit.simulation.plan import Body, Circuits, make_body

FILES = ("robot", "reference", "controller", "circuit")  # keys of a scenario that name files
_NAMES = {"scenario", "description", "seed", *FILES}  # keys whose text determines nothing by itself
_OWN_FORM = {"disturbances", "measures", "reference"}  # keys that are written as a file has them
_SEED_MARK = "\N{SYMBOL FOR SUBSTITUTE}seed"  # where the seed goes in a description


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
        names = {"servo_profile", "duration", "control_step", "until"}
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
