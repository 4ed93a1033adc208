"""Points: everything that determines a run but its seed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import BaseModel

from circuitkit.circuit import CircuitGraph
from circuitkit.control import ControllerSpec
from circuitkit.biped.gait import GaitSpec
from circuitkit.simulation import Plan, Scenario

FILES = ("robot", "gait", "controller", "circuit")  # keys of a scenario that name files
_NAMES = {"scenario", "description", "seed", *FILES}  # keys whose text determines nothing by itself


@dataclass(frozen=True)
class Point:
    """Everything that determines a run but its seed; it is checked, and can be sent elsewhere.

    Attributes:
        scenario: The scenario, with its own duration.
        gait: The walk's numbers.
        controller: `open_loop` or `circuit`, or the numbers of a controller file.
        circuit: The circuit, in use or not.
        yardstick: The circuit whose thresholds count if this one has none.
        circuit_settings: What was set in the circuit.
        inputs: Fingerprint of what each of its files says, by kind and name.
    """

    scenario: Scenario
    gait: GaitSpec
    controller: str | ControllerSpec
    circuit: CircuitGraph
    yardstick: CircuitGraph | None
    circuit_settings: Mapping[str, str]
    inputs: Mapping[str, str]

    def plan(self) -> Plan:
        """The plan of its runs."""
        from circuitkit.study.jobs import plan_of

        return plan_of(self)

    @cached_property
    def shared_key(self) -> str:
        """The same for points that differ in nothing but pushes, whose robots can be stepped together."""
        scenario = self.scenario.model_dump(mode="json", exclude={*_NAMES, "pushes"})
        files = [(name.partition(" ")[0], content) for name, content in self.inputs.items()]
        controller = self.controller if isinstance(self.controller, str) else None
        return fingerprint((scenario, controller, files))

    @cached_property
    def key(self) -> str:
        """The same for points whose runs are the same."""
        return fingerprint((self.shared_key, self.scenario.model_dump(mode="json", include={"pushes"})))

    def run_key(self, seed: int) -> str:
        """The name of a run: equal for equal runs."""
        return f"{self.key}-{seed}"

    def description(self, seed: int) -> str:
        """The complete scenario of a run as JSON, with the numbers of the files that it names."""
        return self._description.replace(_SEED_MARK, str(seed), 1)

    @cached_property
    def _description(self) -> str:
        everything = {
            **self.scenario.model_dump(mode="json"),
            "seed": _SEED_MARK,
            "circuit_settings": dict(self.circuit_settings),
            "gait_numbers": self.gait.model_dump(mode="json"),
            "controller_numbers": None
            if isinstance(self.controller, str)
            else self.controller.model_dump(mode="json"),
        }
        return json.dumps(everything, ensure_ascii=False).replace(f'"{_SEED_MARK}"', _SEED_MARK, 1)


_SEED_MARK = "\N{SYMBOL FOR SUBSTITUTE}seed"


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
