"""A neural circuit as a controller: its inputs are sensor channels, its outputs are commands, by name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.units import Unit
from circuitkit.biped.control.planned import PlannedChannel
from circuitkit.circuit import CircuitGraph
from circuitkit.control.controller import Array
from circuitkit.engine import Stepper, compile_circuit


class CircuitController:
    """Steps a circuit once a control step.

    Where a reading is missing (not a number), that robot's circuit is not stepped: its command stays what it
    was, and the rest of the batch goes on.
    """

    name = "circuit"

    def __init__(
        self,
        graph: CircuitGraph,
        observations: Mapping[str, Unit],
        commands: Mapping[str, Unit],
        step_s: float,
        backend: str = "auto",
        planned: Mapping[str, PlannedChannel] | None = None,
    ) -> None:
        """Bind a circuit to a robot.

        Args:
            graph: The circuit.
            observations: Channels of the robot that can be read, with their units.
            commands: Channels of the robot that can be written, with their units.
            step_s: The control step of the loop.
            backend: What runs the circuit; see `compile_circuit`.
            planned: Channels of the walk's plan, which the circuit may read like the robot's.

        Raises:
            InputError: The robot lacks a channel, its unit is of another dimension, or the control steps
                differ; lists all that is wrong.
        """
        planned = planned or {}
        readable = {**observations, **{name: channel.unit for name, channel in planned.items()}}
        problems = [
            *_mismatches("input", graph.inputs, readable, "sensor channel"),
            *_mismatches("output", graph.outputs, commands, "command"),
        ]
        if not math.isclose(graph.step_s, step_s, rel_tol=1e-9):
            message = (
                f"found {graph.step_s * 1e3:g} ms; allowed: the control step of the walk, {step_s * 1e3:g} ms"
            )
            file = graph.outputs[0].origin.file if graph.outputs else graph.name
            problems.append(Problem(file, 1, 1, "control_step", message))
        if problems:
            raise InputError(*problems)
        self.graph = graph
        names = [node.name for node in graph.inputs]
        self.observations = tuple(name for name in names if name not in planned)
        self._sensed = [i for i, name in enumerate(names) if name not in planned]
        self._intended = [i for i, name in enumerate(names) if name in planned]
        columns = [planned[names[i]].values for i in self._intended]
        self._plan = np.column_stack(columns) if columns else None
        self.commands = tuple(node.name for node in graph.outputs)
        self._program = compile_circuit(graph, backend, reproducible=True)
        self.trace_names = tuple(self._program.neuron_names)
        self.backend = self._program.note or f"backend {self._program.backend}"
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self._tick = 0
        self._stepper = Stepper(self._program, batch)
        self._inputs = self._stepper.inputs

    def step(self, observation: Array, trace: Array) -> Array:
        """Outputs of the circuit, shape (B, m), SI units; its neurons' outputs go to `trace`."""
        # One call for all of it: the sum of squares is finite where every reading is.
        if math.isfinite(np.vdot(observation, observation)):
            self._take(observation)
            readout = self._stepper.step()
        else:
            readout = self._step_where_finite(observation)
        self._stepper.store_output(trace)
        return readout

    def _take(self, observation: Array) -> None:
        """What the circuit reads in this step: what is sensed, and what the plan says."""
        if self._plan is None:
            self._inputs[...] = observation
            return
        self._inputs[:, self._sensed] = observation
        self._inputs[:, self._intended] = self._plan[self._tick]
        self._tick += 1

    def _step_where_finite(self, observation: Array) -> Array:
        missing = np.logical_not(np.isfinite(observation).all(axis=1))
        before = self._stepper.state
        self._take(np.where(missing[:, np.newaxis], 0.0, observation))
        self._stepper.step()
        after = self._stepper.state
        for old, new in zip(before.arrays(), after.arrays(), strict=True):
            new[missing] = old[missing]
        self._stepper.state = after
        return self._stepper.readout


def _mismatches(
    kind: str, nodes: Iterable[object], channels: Mapping[str, Unit], word: str
) -> Iterable[Problem]:
    """What keeps the inputs or outputs of a circuit from being channels of a robot."""
    for node in nodes:
        name, unit, origin = node.name, node.unit, node.origin  # type: ignore[attr-defined]  # either node has them
        where = f"{kind}s.{name}"
        place = (origin.file, origin.line, origin.column)
        if name not in channels:
            message = f"the robot has no {word} '{name}'; allowed: {listing(channels)}"
            yield Problem(*place, where, message, suggest(name, channels))
        elif unit.dimension != channels[name].dimension:
            message = (
                f"found the unit '{unit}'; allowed: the robot's {word} has '{channels[name]}', or like it"
            )
            yield Problem(*place, where, message)
