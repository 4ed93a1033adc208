"""The measure `thresholds`: how far the ZMP went beyond a circuit's own thresholds, and when it was back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from circuitkit.base.errors import InputError, Problem, listing, suggest
from circuitkit.base.source import FileModel
from circuitkit.base.units import Unit, parse_unit
from circuitkit.biped.sensing import support_by_load
from circuitkit.circuit import CircuitGraph, load_circuit
from circuitkit.control import Array
from circuitkit.simulation.formulas import Track, Value
from circuitkit.simulation.measures import BoundMeasure, MeasureKind
from circuitkit.simulation.plan import Plan

_NOTHING_M = 1e-9  # rounding, not a crossing
EXCURSION, RECOVERY = "max_zmp_excursion_m", "recovery_time_s"


class Edges(FileModel):
    """Neurons that stand at the edges of a support polygon."""

    right: str
    left: str


class Thresholds(MeasureKind):
    """Measures how far the ZMP goes beyond a circuit's thresholds, and how long it takes to be back."""

    kind: ClassVar[str] = "thresholds"

    channel: str = Field(description="The circuit's input that they compare.")
    left_foot: Edges = Field(
        description="Neurons at the `right` and `left` edge while the left foot carries."
    )
    right_foot: Edges = Field(description="The same for the right foot.")
    both_feet: Edges = Field(description="The same for both feet.")
    circuit: str | None = Field(
        default=None,
        description="The circuit whose neurons they are, if neither the one in use nor the scenario's.",
    )

    def bind(self, plan: Plan) -> ThresholdMeasure:
        """Find the lines in the first circuit that has such neurons.

        Raises:
            InputError: No circuit has, or the robot has no such channel.
        """
        graphs = plan.circuits.candidates
        if self.circuit is not None:
            graphs = (load_circuit(plan.scenario.file(self.circuit)),)
        if not graphs:
            message = (
                "the scenario has no circuit; allowed: circuit: NAME here, whose neurons stand at the edges"
            )
            raise InputError(Problem("", 0, 0, "measures.thresholds", message))
        if self.channel not in plan.robot.channels:
            channels = plan.robot.channels
            message = f"the robot has no channel '{self.channel}'; allowed: {listing(channels)}"
            raise InputError(
                Problem("", 0, 0, "measures.thresholds.channel", message, suggest(self.channel, channels))
            )
        return ThresholdMeasure(self.channel, *self._lines(graphs))

    def _lines(self, graphs: tuple[CircuitGraph, ...]) -> tuple[Array, str]:
        """The lines of the first circuit that has some, and its name."""
        for graph in graphs[:-1]:
            try:
                return threshold_lines(graph, self), graph.name
            except InputError:
                continue
        return threshold_lines(graphs[-1], self), graphs[-1].name


def threshold_lines(circuit: CircuitGraph, thresholds: Thresholds) -> Array:
    """Where the ZMP crosses the circuit's thresholds, by who carries.

    A neuron with shift s that takes the ZMP with weight w is half active where w times the ZMP is s.

    Returns:
        Shape (3, 2): left foot, right foot, both; right edge, left edge; [m].

    Raises:
        InputError: The circuit has no such neuron, or it does not take the ZMP.
    """
    neurons = {neuron.name: neuron for neuron in circuit.neurons}
    weights = {s.target: s.weight for s in circuit.synapses if s.source == thresholds.channel}
    lines = np.zeros((3, 2))
    for i, part in enumerate(("left_foot", "right_foot", "both_feet")):
        edges = getattr(thresholds, part)
        for j, name in enumerate((edges.right, edges.left)):
            neuron = neurons.get(name)
            if neuron is None or name not in weights or "shift" not in neuron.parameters:
                allowed = [n for n in weights if "shift" in neurons[n].parameters]
                found = (
                    f"'{name}': no neuron of '{circuit.name}' with a shift that reads '{thresholds.channel}'"
                )
                message = f"found {found}; allowed: {listing(allowed)}"
                where = f"measures.thresholds.{part}"
                raise InputError(Problem("", 0, 0, where, message, suggest(name, allowed)))
            lines[i, j] = neuron.parameters["shift"] / weights[name]
    return lines


class ThresholdMeasure(BoundMeasure):
    """Judges by lines for the ZMP, which depend on who carries.

    Attributes:
        lines_m: Shape (3, 2): left foot, right foot, both; right edge, left edge.
        circuit: Name of the circuit whose thresholds they are.
    """

    units: Mapping[str, Unit] = {EXCURSION: parse_unit("m"), RECOVERY: parse_unit("s")}

    def __init__(self, channel: str, lines_m: Array, circuit: str = "the circuit") -> None:
        """Name the channel, its lines and whose they are."""
        self.channel, self.circuit = channel, circuit
        self.lines_m = lines_m
        self.channels = (channel, "load_left", "load_right")

    def measure(self, track: Track) -> Mapping[str, Value]:
        """How far the ZMP was outside after the push began, at most, and how long it took to be back.

        The excursion is 0 if it never was outside. Recovery is from the first time outside to being back
        inside for at least a whole step; None if it never was outside, or never came back.
        """
        low, high = self._lines(track.values)
        zmp, dt = track.values(self.channel), track.step_s
        begin = 0 if np.isnan(track.push_s) else round(track.push_s / dt)
        inside = slice(begin, track.before_end)
        beyond = np.maximum(low - zmp, zmp - high)[inside]
        pace = round(track.pace_s / dt)
        return {
            EXCURSION: float(max(beyond.max(initial=0.0), 0.0)),
            RECOVERY: _recovery_s(beyond > _NOTHING_M, pace, dt),
        }

    def bounds_known(self, channel: str) -> bool:
        """Those of its own channel."""
        return channel == self.channel

    def bounds(self, channel: str, values: Callable[[str], Array]) -> tuple[Array, Array] | None:
        """The lines of who carries, tick by tick; shape (T,) each."""
        return self._lines(values) if channel == self.channel else None

    def _lines(self, values: Callable[[str], Array]) -> tuple[Array, Array]:
        loads = np.stack([values("load_left"), values("load_right")], axis=-1)
        lines = self.lines_m[support_by_load(loads)]
        return lines[..., 0], lines[..., 1]


def _recovery_s(outside: NDArray[np.bool_], pace: int, dt: float) -> float | None:
    """From the first tick outside to the first after which a whole step is spent inside."""
    crossings = np.flatnonzero(outside)
    if len(crossings) == 0:
        return None
    quiet = np.diff(np.append(crossings, len(outside))) > pace
    if not quiet.any():
        return None
    back = crossings[quiet.argmax()] + 1
    return float((back - crossings[0]) * dt)
