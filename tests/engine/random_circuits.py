"""Random circuits of all kinds: states, spikes, populations, synapses with states, delays, noise."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from circuitkit.base.units import DIMENSIONLESS
from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.circuit.graph import (
    CircuitGraph,
    InputNode,
    Neuron,
    OutputNode,
    Population,
    Projection,
    Synapse,
    Timing,
)
from circuitkit.circuit.models import STATIC, NeuronModel, Spike, SynapseModel, UnitRule, neuron_model
from circuitkit.circuit.models.model import Method, ModelParameter, ModelState

RULE = UnitRule("1")
TIMINGS: tuple[Timing, ...] = ("as_printed", "synchronous", "ordered")
METHODS: tuple[Method, ...] = ("euler", "exponential_euler", "exact", "rk4")


def _parameters(names: Sequence[str]) -> tuple[ModelParameter, ...]:
    return tuple(ModelParameter(name, RULE, None, "") for name in names)


def _states(names: Sequence[str]) -> tuple[ModelState, ...]:
    return tuple(ModelState(name, RULE, parse_expression("0", ()), "") for name in names)


def neuron_kind(name, parameters, states, output, method="exponential_euler", spike=None, **equations):
    """A neuron model from texts; `derivatives` or `updates` by state, `spike` as (when, {state: reset})."""
    names = (*parameters, *states, "A")
    read = {
        kind: {key: parse_expression(text, names) for key, text in texts.items()}
        for kind, texts in equations.items()
    }
    declared = None
    if spike is not None:
        reset = {key: parse_expression(text, names) for key, text in spike[1].items()}
        declared = Spike(parse_expression(spike[0], names), reset)
    return NeuronModel(
        name,
        "",
        "",
        _parameters(parameters),
        parse_expression(output, (*names, "spike")),
        states=_states(states),
        spike=declared,
        method=method,
        **read,
    )


def synapse_kind(
    name, parameters, states, current, method="exponential_euler", reads=(), per="synapse", **equations
):
    """A synapse model from texts."""
    names = (*parameters, *states, *reads, "weight", "pre", "post", "gate", "input")
    read = {
        kind: {key: parse_expression(text, names) for key, text in texts.items()}
        for kind, texts in equations.items()
    }
    return SynapseModel(
        name,
        "",
        "",
        _parameters(parameters),
        parse_expression(current, names),
        RULE,
        states=_states(states),
        method=method,
        reads=dict.fromkeys(reads, RULE),
        per=per,
        **read,
    )


def leaky(method: Method) -> NeuronModel:
    """tau v' = A - v."""
    return neuron_kind("leaky", ["tau"], ["v"], "tanh(v)", method, derivatives={"v": "(A - v) / tau"})


def pair(method: Method) -> NeuronModel:
    """A damped oscillation."""
    slopes = {"v": "(A - v - 2 * w) / tau", "w": "(v - 0.3 * w) / tau"}
    return neuron_kind("pair", ["tau"], ["v", "w"], "v - w", method, derivatives=slopes)


BENT = neuron_kind(
    "bent", ["tau", "gain"], ["v"], "sigmoid(v)", "exponential_euler",
    derivatives={"v": "(A - v - gain * v * abs(v)) / tau"},
)  # fmt: skip
BENT_RK4 = neuron_kind(
    "bent_rk4",
    ["tau", "gain"],
    ["v"],
    "sigmoid(v)",
    "rk4",
    derivatives={"v": "(sin(A) - gain * v ** 3) / tau"},
)
SPIKING = neuron_kind(
    "spiking", ["tau"], ["v", "w"], "spike",
    derivatives={"v": "(A + 2.1 - v - w) / tau", "w": "-w / (3 * tau)"},
    spike=("v - 1.0123", {"v": "-0.5", "w": "w + 0.2"}),
)  # fmt: skip
SPIKING_RK4 = neuron_kind(
    "spiking_rk4", ["tau"], ["v"], "spike * 0.5", "rk4",
    derivatives={"v": "(A + 2.3 - v) / tau"}, spike=("v - 1.0071", {"v": "v - 1.3"}),
)  # fmt: skip
COUNTER = neuron_kind(
    "counter",
    ["gain"],
    ["x", "y"],
    "tanh(x + y)",
    updates={"x": "0.5 * x + gain * A", "y": "0.9 * y - 0.1 * x"},
)
TICKER = neuron_kind(
    "ticker", ["gain"], ["x"], "spike", updates={"x": "x + gain * abs(A) + 0.3111"},
    spike=("x - 1", {"x": "x - 1"}),
)  # fmt: skip
NEURON_KINDS = (
    *(leaky(method) for method in METHODS),
    *(pair(method) for method in METHODS),
    BENT,
    BENT_RK4,
    SPIKING,
    SPIKING_RK4,
    COUNTER,
    TICKER,
    neuron_model("sigmoid"),
    neuron_model("window"),
    neuron_model("tanh"),
    neuron_model("identity"),
)
SYNAPSE_KINDS = (
    STATIC,
    *(
        synapse_kind(
            "lagging", ["tau_s"], ["s"], "weight * s", method, derivatives={"s": "(pre - s) / tau_s"}
        )
        for method in METHODS
    ),
    synapse_kind(
        "shared", ["tau_s"], ["s"], "s", "exact", per="target",
        derivatives={"s": "-s / tau_s"}, jumps={"s": "s + input"},
    ),
    synapse_kind("gated", [], [], "weight * pre * gate"),
    synapse_kind("pulled", ["e"], [], "weight * pre * (e - post_v)", reads=["post_v"]),
    synapse_kind("coupled", [], [], "weight * (pre_v - post_v)", reads=["pre_v", "post_v"]),
    synapse_kind(
        "tired", ["tau_s"], ["r"], "weight * pre * r", jumps={"r": "r - 0.2 * r * min(abs(pre), 1)"},
        derivatives={"r": "(1 - r) / tau_s"},
    ),
    synapse_kind(
        "learning", ["rate"], ["w"], "w * pre",
        updates={"w": "clip(w + rate * post * (pre - post * w), -1, 1)"},
    ),
)  # fmt: skip

_VALUES = {
    "tau": st.floats(0.005, 0.05),
    "tau_s": st.floats(0.005, 0.05),
    "gain": st.floats(-0.5, 0.5),
    "slope": st.floats(-3.0, 3.0),
    "shift": st.floats(-1.0, 1.0),
    "low": st.floats(-1.0, 0.0),
    "high": st.floats(0.0, 1.0),
    "e": st.floats(-1.0, 1.0),
    "rate": st.floats(0.0, 0.1),
}
_GAIN_ABOVE_0 = st.floats(0.0, 0.5)
_WEIGHTS = st.floats(-0.6, 0.6)
_STARTS = st.floats(-0.4, 0.4)


def _arrays(draw: st.DrawFn, values: st.SearchStrategy[float], count: int):
    """One value for all, or an array."""
    if draw(st.booleans()):
        return draw(values)
    return np.array(draw(st.lists(values, min_size=count, max_size=count)))


def _parameter(model, name: str) -> st.SearchStrategy[float]:
    return _GAIN_ABOVE_0 if name == "gain" and model.states else _VALUES[name]


@st.composite
def any_circuits(draw: st.DrawFn, noise: bool = True, populations: bool = True) -> CircuitGraph:
    """A circuit of a few neurons and populations of any kinds, with synapses of any kinds."""
    inputs = [f"u{i}" for i in range(draw(st.integers(1, 2)))]
    sigma = (st.just(0.0) | st.floats(0.0, 0.3)) if noise else st.just(0.0)
    step_s, substeps = 0.01, draw(st.integers(1, 4))
    neurons = []
    for i, model in enumerate(draw(st.lists(st.sampled_from(NEURON_KINDS), min_size=1, max_size=5))):
        values = {p.name: draw(_parameter(model, p.name)) for p in model.parameters}
        starts = {s.name: draw(_STARTS) for s in model.states}
        s = draw(sigma) * (math.sqrt(step_s) if model.continuous else 1.0)
        neurons.append(Neuron(f"n{i}", model, "excitatory", values, DIMENSIONLESS, initial=starts, noise=s))
    groups = []
    for i, model in enumerate(
        draw(st.lists(st.sampled_from(NEURON_KINDS), max_size=2 if populations else 0))
    ):
        size = draw(st.integers(1, 4))
        values = {p.name: _arrays(draw, _parameter(model, p.name), size) for p in model.parameters}
        starts = {s.name: _arrays(draw, _STARTS, size) for s in model.states}
        s = _arrays(draw, sigma, size) * (math.sqrt(step_s) if model.continuous else 1.0)
        groups.append(
            Population(f"p{i}", size, model, "excitatory", values, DIMENSIONLESS, initial=starts, noise=s)
        )
    members = {n.name: n.model for n in neurons}
    members |= {f"{p.name}[{i}]": p.model for p in groups for i in range(p.size)}
    names = list(members)
    synapses = []
    pairs = st.tuples(st.sampled_from([*inputs, *names]), st.sampled_from(names))
    for source, target in draw(st.lists(pairs, unique=True, max_size=2 * len(names))):
        model = draw(_fitting(members.get(source), members[target]))
        synapses.append(
            Synapse(source, target, draw(_WEIGHTS), "excitatory", model, **_details(draw, model, names))
        )
    projections = [
        draw(_projections(inputs, neurons, groups, names))
        for _ in range(draw(st.integers(0, 3)) if groups else 0)
    ]
    outputs = []
    for i in range(draw(st.integers(0, 2))):
        read = draw(st.lists(st.sampled_from([*names, *(p.name for p in groups)]), unique=True, max_size=3))
        sizes = {p.name: p.size for p in groups}
        readout = tuple(
            (name, _arrays(draw, _WEIGHTS, sizes[name]) if name in sizes else draw(_WEIGHTS)) for name in read
        )
        limit = draw(st.sampled_from([math.inf, 1.0]))
        leak = draw(st.none() | st.floats(0.0, 1.0))
        outputs.append(OutputNode(f"y{i}", DIMENSIONLESS, readout, -limit, limit, leak))
    return CircuitGraph(
        "random", "", draw(st.sampled_from(TIMINGS)), step_s,
        tuple(InputNode(name, DIMENSIONLESS, -1.0, 1.0) for name in inputs),
        tuple(neurons), tuple(synapses), tuple(outputs), {}, substeps, tuple(groups), tuple(projections),
    )  # fmt: skip


def _fitting(source: NeuronModel | None, target: NeuronModel) -> st.SearchStrategy[SynapseModel]:
    """Synapse models that read only states that are there."""
    there = {f"post_{s.name}" for s in target.states} | {
        f"pre_{s.name}" for s in (source.states if source else ())
    }
    return st.sampled_from([model for model in SYNAPSE_KINDS if set(model.reads) <= there])


def _details(draw: st.DrawFn, model: SynapseModel, names: Sequence[str], count: int = 0) -> dict[str, object]:
    """Parameters, initial states, delay and gate of a synapse, or of `count` in a projection."""
    gated = "gate" in model.current.names()

    def value(values: st.SearchStrategy[float]):
        return _arrays(draw, values, count) if count else draw(values)

    return {
        "parameters": {p.name: value(_VALUES[p.name]) for p in model.parameters},
        "initial": {s.name: value(_STARTS) for s in model.states},
        "delay_s": draw(st.sampled_from([0.0, 0.0, 0.01, 0.03, 0.02])),
        "gate": draw(st.sampled_from(names)) if gated else "",
    }


@st.composite
def _projections(draw: st.DrawFn, inputs, neurons, groups, names) -> Projection:
    target = draw(st.sampled_from(groups))
    source = draw(st.sampled_from([*inputs, *neurons, *groups]))
    n_source = source.size if isinstance(source, Population) else 1
    chosen = [
        sorted(draw(st.sets(st.integers(0, n_source - 1), max_size=n_source))) for _ in range(target.size)
    ]
    indptr = np.concatenate([[0], np.cumsum([len(each) for each in chosen])]).astype(np.int64)
    sources = np.array([i for each in chosen for i in each], dtype=np.int32)
    source_model = None if isinstance(source, str) else source.model
    model = draw(_fitting(source_model, target.model))
    count = target.size if model.per == "target" else len(sources)
    return Projection(
        source if isinstance(source, str) else source.name,
        target.name,
        indptr,
        sources,
        _arrays(draw, _WEIGHTS, len(sources)) if len(sources) else 0.5,
        "excitatory",
        model,
        **(_details(draw, model, names, count) if count else _details(draw, model, names)),
    )
