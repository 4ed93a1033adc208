"""Small circuits built in Python, random ones, and eqs. 11 and 12 by hand: loops over floats, no numpy."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import strategies as st

from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.graph import CircuitGraph, InputNode, Neuron, OutputNode, Synapse, Timing
from circuitkit.circuit.models import neuron_model
from circuitkit.engine.backends import compiled_backend
from circuitkit.engine.backends.c.build import unavailable

sys.path.insert(0, str(Path(__file__).parent))  # for `reference` and `random_circuits`
TIMINGS: tuple[Timing, ...] = ("as_printed", "synchronous", "ordered")


def logistic(x: float) -> float:
    """Eq. 12 without overflow."""
    return 1 / (1 + math.exp(-x)) if x > 0 else math.exp(x) / (1 + math.exp(x))


# Written by hand from the literature, not taken from the model files.
FUNCTIONS: Mapping[str, Callable[[float, Mapping[str, float]], float]] = {
    "identity": lambda a, p: p["gain"] * a,
    "sigmoid": lambda a, p: logistic(p["slope"] * (a - p["shift"])),
    "step": lambda a, p: 1.0 if a >= p["shift"] else 0.0,
    "tanh": lambda a, p: math.tanh(p["slope"] * (a - p["shift"])),
    "threshold_linear": lambda a, p: max(0.0, p["slope"] * (a - p["shift"])),
    "window": lambda a, p: logistic(p["slope"] * (a - p["low"])) * logistic(p["slope"] * (p["high"] - a)),
}


@dataclass
class ByHand:
    """One circuit, one copy, one neuron after the other."""

    graph: CircuitGraph

    def __post_init__(self) -> None:
        self.names = [neuron.name for neuron in self.graph.neurons]
        self.activation = dict.fromkeys(self.names, 0.0)
        self.output = dict.fromkeys(self.names, 0.0)
        self.readout = {output.name: 0.0 for output in self.graph.outputs}
        if self.graph.timing == "ordered":
            self._after = {name: self._reachable(name) for name in self.names}
        order = [*self.names, *(node.name for node in self.graph.inputs)]
        self._terms: dict[str, list[tuple[str, float]]] = {name: [] for name in self.names}
        for synapse in sorted(self.graph.synapses, key=lambda synapse: order.index(synapse.source)):
            self._terms[synapse.target].append((synapse.source, synapse.weight))

    def tick(self, inputs: Mapping[str, float]) -> tuple[list[float], list[float], list[float]]:
        """Activations, outputs and the outputs of the circuit after one more tick."""
        old = dict(self.output)
        if self.graph.timing == "as_printed":
            new = {name: self._function(name, self.activation[name]) for name in self.names}
            self.activation = {name: self._sum(name, inputs, old) for name in self.names}
            self.output = new
        elif self.graph.timing == "synchronous":
            self.activation = {name: self._sum(name, inputs, old) for name in self.names}
            self.output = {name: self._function(name, self.activation[name]) for name in self.names}
        else:
            self._in_order(inputs, old)
        self._read_out()
        return (
            [self.activation[name] for name in self.names],
            [self.output[name] for name in self.names],
            list(self.readout.values()),
        )

    def _in_order(self, inputs: Mapping[str, float], old: Mapping[str, float]) -> None:
        """Each neuron asks those before it for their new value, and they ask on."""
        new: dict[str, float] = {}

        def value(name: str) -> float:
            if name not in new:
                seen = {s: value(s) if self._is_before(s, name) else old[s] for s in self._sources(name)}
                self.activation[name] = self._sum(name, inputs, seen)
                new[name] = self._function(name, self.activation[name])
            return new[name]

        self.output = {name: value(name) for name in self.names}

    def _is_before(self, source: str, target: str) -> bool:
        in_a_cycle = source in self._after[target]
        return not in_a_cycle or self.names.index(source) < self.names.index(target)

    def _reachable(self, name: str) -> set[str]:
        found: set[str] = set()
        todo = [name]
        while todo:
            here = todo.pop()
            for synapse in self.graph.synapses:
                if synapse.source == here and synapse.target not in found:
                    found.add(synapse.target)
                    todo.append(synapse.target)
        return found

    def _sources(self, name: str) -> list[str]:
        return [source for source, _ in self._terms[name] if source in self.names]

    def _sum(self, name: str, inputs: Mapping[str, float], outputs: Mapping[str, float]) -> float:
        """Eq. 11: neurons in file order, then inputs in file order."""
        total = 0.0
        for source, weight in self._terms[name]:
            total += weight * (inputs[source] if source in inputs else outputs[source])
        return total

    def _function(self, name: str, activation: float) -> float:
        neuron = self.graph.neurons[self.names.index(name)]
        return FUNCTIONS[neuron.model.name](activation, neuron.parameters)

    def _read_out(self) -> None:
        for output in self.graph.outputs:
            total = 0.0
            for name, weight in output.readout:
                total += weight * self.output[name]
            if output.leak is not None:
                total += (1 - output.leak) * self.readout[output.name]
            self.readout[output.name] = min(max(total, output.low), output.high)


def neuron(name: str, model: str = "identity", **parameters: float) -> Neuron:
    """A neuron; an identity has the gain 1 unless told otherwise."""
    given = parameters or {"gain": 1.0}
    return Neuron(name, neuron_model(model), "excitatory", given, DIMENSIONLESS)


def circuit(
    neurons: Sequence[Neuron],
    synapses: Iterable[tuple[str, str, float]],
    outputs: Sequence[OutputNode] = (),
    inputs: Sequence[str] = ("u",),
    timing: Timing = "ordered",
) -> CircuitGraph:
    """A circuit from short descriptions."""
    sources = tuple(InputNode(name, DIMENSIONLESS, -1.0, 1.0) for name in inputs)
    edges = tuple(
        Synapse(source, target, weight, "sensorial" if source in inputs else "excitatory")
        for source, target, weight in synapses
    )
    return CircuitGraph("test", "", timing, 0.01, sources, tuple(neurons), edges, tuple(outputs), {})


def output(
    name: str, readout: Mapping[str, float], leak: float | None = None, limit: float = math.inf
) -> OutputNode:
    """An output of the circuit."""
    return OutputNode(name, DIMENSIONLESS, tuple(readout.items()), -limit, limit, leak)


_WEIGHTS = st.sampled_from([1.0, -1.0, 0.5]) | st.floats(-1.0, 1.0)
_SLOPES = st.sampled_from([1.0, -3.0]) | st.floats(-3.0, 3.0)
_SHIFTS = st.sampled_from([0.0, 0.1]) | st.floats(-1.0, 1.0)
_PARAMETERS = {
    "identity": {"gain": st.floats(-1.0, 1.0)},
    "sigmoid": {"slope": _SLOPES, "shift": _SHIFTS},
    "step": {"shift": st.floats(-0.5, 0.5).map(lambda x: x + 1e-3 * math.pi)},
    "tanh": {"slope": st.floats(-1.0, 1.0), "shift": _SHIFTS},
    "threshold_linear": {"slope": st.floats(-1.0, 1.0), "shift": _SHIFTS},
    "window": {"slope": _SLOPES, "low": st.floats(-1.0, 0.0), "high": st.floats(0.0, 1.0)},
}


@st.composite
def _circuits(
    draw: st.DrawFn, models: Sequence[str] = tuple(sorted(_PARAMETERS)), timings: Sequence[Timing] = TIMINGS
) -> CircuitGraph:
    inputs = [f"u{i}" for i in range(draw(st.integers(1, 3)))]
    neurons = [
        neuron(f"n{i}", model, **{key: draw(values) for key, values in _PARAMETERS[model].items()})
        for i, model in enumerate(draw(st.lists(st.sampled_from(models), min_size=1, max_size=8)))
    ]
    names = [each.name for each in neurons]
    pairs = st.tuples(st.sampled_from([*inputs, *names]), st.sampled_from(names))
    edges = draw(st.lists(pairs, unique=True, max_size=4 * len(names)))
    outputs = [
        output(
            f"y{i}",
            dict.fromkeys(draw(st.lists(st.sampled_from(names), unique=True, max_size=6)), draw(_WEIGHTS)),
            draw(st.none() | st.floats(0.0, 1.0)),
            draw(st.sampled_from([math.inf, 1.0])),
        )
        for i in range(draw(st.integers(0, 3)))
    ]
    synapses = [(*pair, draw(_WEIGHTS)) for pair in edges]
    return circuit(neurons, synapses, outputs, inputs, draw(st.sampled_from(timings)))


@pytest.fixture(scope="module")
def no_fallback() -> Iterator[None]:
    """Skips without a C compiler; with one, a mistake in the making of C fails and does not lead to numpy."""
    if reason := unavailable():
        pytest.skip(reason)

    def fail(error: Exception) -> str:
        raise error

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_backend, "_reason", fail)
        yield


@pytest.fixture
def quick_builds(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache of the tests' own, which they share; optimisation that is quick to do."""
    monkeypatch.setenv("CIRCUITKIT_CACHE", str(tmp_path_factory.getbasetemp() / "compiled"))
    monkeypatch.setenv("CIRCUITKIT_CFLAGS", "-O1")


@pytest.fixture(scope="session")
def by_hand() -> Callable[[CircuitGraph], ByHand]:
    return ByHand


@pytest.fixture(scope="session")
def circuits() -> Callable[..., st.SearchStrategy[CircuitGraph]]:
    """Random circuits: recurrent, with self-connections, with neurons that have no source, of all models."""
    return _circuits


@dataclass(frozen=True)
class Build:
    """Short ways to write a circuit in a test."""

    neuron: Callable[..., Neuron]
    circuit: Callable[..., CircuitGraph]
    output: Callable[..., OutputNode]


@pytest.fixture(scope="session")
def build() -> Build:
    return Build(neuron, circuit, output)
