"""A neural circuit as a controller: its inputs are channels, its outputs are commands."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.units import Unit
from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.circuit.graph import InputNode, OutputNode
from circuitkit.circuit.silencing import silence
from circuitkit.control.controller import Array, Interface
from circuitkit.engine import Program, Stepper, compile_circuit
from circuitkit.engine.dependence import Dependence, dependence


class CircuitController:
    """A circuit that can be bound to a robot; see `BoundCircuit` for what then runs.

    Attributes:
        graph: The circuit.
    """

    name = "circuit"

    def __init__(
        self,
        circuit: CircuitGraph | str | Path,
        *,
        connect: Mapping[str, Mapping[str, str | None]] | None = None,
        settings: Mapping[str, str] | None = None,
        silenced: Sequence[str] = (),
        backend: str = "auto",
        name: str = "circuit",
    ) -> None:
        """Load a circuit.

        Args:
            circuit: The circuit, its file, or the name of a shipped one.
            connect: `inputs`, the channel that an input reads, and `outputs`, the command that an output
                writes, where their names differ; None for an output that writes none.
            settings: Values that take the place of the circuit's, such as `{"w": "2 deg"}`; only for a file.
            silenced: Neurons, inputs and connections that are silent; see `silence`.
            backend: What runs the circuit; see `compile_circuit`.
            name: As the user calls it.

        Raises:
            InputError: The circuit is wrong or missing.
        """
        graph = circuit if isinstance(circuit, CircuitGraph) else load_circuit(circuit, settings)
        self.graph = silence(graph, silenced) if silenced else graph
        self.name = name
        self._connect = {side: dict((connect or {}).get(side, {})) for side in ("inputs", "outputs")}
        self._backend = backend

    def bind(self, interface: Interface) -> BoundCircuit:
        """Compile the circuit, and bind its names to channels and commands.

        Raises:
            InputError: The robot lacks a channel or command, its unit is of another dimension, the control
                steps differ, or `connect` names what is not there; lists all that is wrong.
        """
        graph, inputs, outputs = self.graph, self._connect["inputs"], self._connect["outputs"]
        readable = {**interface.observations, **{n: c.unit for n, c in interface.planned.items()}}
        problems = [
            *_strangers("inputs", inputs, graph.inputs),
            *_strangers("outputs", outputs, graph.outputs),
            *_mismatches("input", graph.inputs, readable, inputs, "channel"),
            *_mismatches("output", graph.outputs, interface.commands, outputs, "command"),
            *_written_twice(graph.outputs, outputs),
            *_other_step(graph, interface.step_s),
        ]
        if problems:
            raise InputError(*problems)
        program = compile_circuit(graph, self._backend, reproducible=True)
        return BoundCircuit(self.name, graph, program, interface, inputs, outputs)


class BoundCircuit:
    """Steps a circuit once a control step.

    Where a reading is missing (not a number), what depends on it stays what it was in that robot's circuit,
    and an output that depends on it is no command (not a number). All else goes on as if the reading were
    there, whatever it were: other neurons and outputs, and the rest of the batch.

    Attributes:
        graph: The circuit.
        observations: The channels that its inputs read, without those of the reference.
        commands: The commands that its outputs write.
        trace_names: Its neurons.
        backend: What runs it, and why that.
        backends: The name of what runs it, by the name of the circuit.
    """

    def __init__(
        self,
        name: str,
        graph: CircuitGraph,
        program: Program,
        interface: Interface,
        inputs: Mapping[str, str | None],
        outputs: Mapping[str, str | None],
    ) -> None:
        self.name = name
        self.graph = graph
        names = [inputs.get(node.name) or node.name for node in graph.inputs]
        planned = interface.planned
        self.observations = tuple(name for name in names if name not in planned)
        self._sensed = [i for i, name in enumerate(names) if name not in planned]
        self._intended = [i for i, name in enumerate(names) if name in planned]
        columns = [planned[names[i]].values for i in self._intended]
        self._plan = np.column_stack(columns) if columns else None
        written = [outputs.get(node.name, node.name) for node in graph.outputs]
        self.commands = tuple(name for name in written if name is not None)
        kept = [i for i, name in enumerate(written) if name is not None]
        self._kept = None if len(kept) == len(written) else kept
        self._program = program
        self._known: dict[bytes, Dependence] = {}
        self.trace_names = tuple(program.neuron_names)
        self.backend = program.note or f"backend {program.backend}"
        self.backends: Mapping[str, str] = {name: program.backend}
        self.reset(1)

    def reset(self, batch: int) -> None:
        """Start again, with `batch` robots."""
        self._tick = 0
        self._stepper = Stepper(self._program, batch)
        self._inputs = self._stepper.inputs
        low, high = ([getattr(node, end) for node in self.graph.inputs] for end in ("low", "high"))
        self._inputs[...] = np.clip(0.0, low, high)  # of readings that are missing from the beginning on

    def seed_noise(self, seeds: Sequence[int]) -> None:
        """Let the noise of each robot's circuit follow from the robot's seed."""
        state = self._stepper.state
        state.seed = np.array([seed % 2**64 for seed in seeds], dtype=np.uint64)
        self._stepper.state = state

    def step(self, observation: Array) -> Array:
        """Outputs of the circuit, shape (B, m), SI units; not a number where one needs what is missing."""
        # One call for all of it: the sum of squares is finite where every reading is.
        if math.isfinite(np.vdot(observation, observation)):
            self._take(observation)
            readout = self._stepper.step()
        else:
            readout = self._step_without(~np.isfinite(observation), observation)
        return readout if self._kept is None else readout[:, self._kept]

    def store_trace(self, row: Array) -> None:
        """Write the outputs of all neurons; shape (B, n)."""
        self._stepper.store_output(row)

    def _take(self, observation: Array) -> None:
        """What the circuit reads in this step: what is sensed, and what the reference says."""
        if self._plan is None:
            self._inputs[...] = observation
            return
        self._inputs[:, self._sensed] = observation
        self._inputs[:, self._intended] = self._plan[self._tick]
        self._tick += 1

    def _step_without(self, missing: NDArray[np.bool_], observation: Array) -> Array:
        """Step with the last readings for those that are missing, and take back what depends on them."""
        patterns, which = np.unique(missing, axis=0, return_inverse=True)
        known = [self._dependence(pattern) for pattern in patterns]
        remembers = any(columns.any() for each in known for columns in each.state)
        before = self._stepper.state if remembers else None
        self._take(np.where(missing, self._inputs[:, self._sensed], observation))
        readout = self._stepper.step().copy()
        if before is not None:
            after = self._stepper.state
            for number, each in enumerate(known):
                each.put_back(which.ravel() == number, before, after)
            self._stepper.state = after
        readout[np.array([each.outputs for each in known])[which.ravel()]] = np.nan
        return readout

    def _dependence(self, missing: NDArray[np.bool_]) -> Dependence:
        """What depends on some of the observations; found once for each set of them."""
        key = missing.tobytes()
        if key not in self._known:
            inputs = np.zeros(len(self.graph.inputs), dtype=bool)
            inputs[self._sensed] = missing
            self._known[key] = dependence(self._program, inputs)
        return self._known[key]


def _strangers(
    side: str, joined: Mapping[str, str | None], nodes: Iterable[InputNode | OutputNode]
) -> Iterable[Problem]:
    """Names in `connect` that the circuit does not have."""
    names = [node.name for node in nodes]
    for name in joined:
        if name not in names:
            message = f"the circuit has no {side[:-1]} '{name}'; allowed: {listing(names)}"
            yield Problem("", 0, 0, f"connect.{side}.{name}", message, suggest(name, names))


def _mismatches(
    kind: str,
    nodes: Iterable[InputNode | OutputNode],
    channels: Mapping[str, Unit],
    joined: Mapping[str, str | None],
    word: str,
) -> Iterable[Problem]:
    """What keeps the inputs or outputs of a circuit from being channels or commands of a robot."""
    for node in nodes:
        name, origin = joined.get(node.name, node.name), node.origin
        place, where = (origin.file, origin.line, origin.column), f"{kind}s.{node.name}"
        if node.name in joined:
            place, where = ("", 0, 0), f"connect.{kind}s.{node.name}"
        if name is None:
            continue
        if name not in channels:
            message = f"the robot has no {word} '{name}'; allowed: {listing(channels)}"
            more = (
                ""
                if node.name in joined
                else f"connect: {{{kind}s: {{{name}: NAME}}}} in the scenario joins another name"
            )
            yield Problem(*place, where, message, suggest(name, channels) or more)
        elif node.unit.dimension != channels[name].dimension:
            message = (
                f"found the unit '{node.unit}'; allowed: the robot's {word} '{name}' has '{channels[name]}', "
                "or like it"
            )
            yield Problem(*place, where, message)


def _written_twice(nodes: Iterable[OutputNode], joined: Mapping[str, str | None]) -> Iterable[Problem]:
    """Outputs that write a command which another one writes."""
    writers: dict[str, str] = {}
    for node in nodes:
        command = joined.get(node.name, node.name)
        if command is not None and writers.setdefault(command, node.name) != node.name:
            message = (
                f"found the command '{command}', which the output '{writers[command]}' writes; "
                "allowed: one output for each command"
            )
            hint = "an output may read out several neurons: their sum"
            yield Problem("", 0, 0, f"connect.outputs.{node.name}", message, hint)


def _other_step(graph: CircuitGraph, step_s: float) -> Iterable[Problem]:
    if not math.isclose(graph.step_s, step_s, rel_tol=1e-9):
        found = f"found {graph.step_s * 1e3:g} ms"
        message = f"{found}; allowed: the control step of the run, {step_s * 1e3:g} ms"
        file = graph.outputs[0].origin.file if graph.outputs else graph.name
        yield Problem(file, 1, 1, "control_step", message)
