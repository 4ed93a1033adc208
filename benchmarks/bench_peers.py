"""Against other simulators, as far as they are installed: `make test-peers` brings Nengo and Brian2.

    .venv-peers/bin/circuitkit bench against

All compute the same sigmoid neurons with the timing `synchronous`, in the form that is fastest for them, with
constant inputs, and without recording anything; what they find is compared with what plain numpy finds.
"""

from __future__ import annotations

import contextlib
import importlib
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.bench_sparse import SHIFT, SLOPE, by_hand, checked, sparse_circuit, steps
from benchmarks.plain import INPUTS, FloatArray, PlainBinn, binn, compiled_binn, loop, steps_of, threads
from benchmarks.script import scratch
from circuitkit.circuit import load_circuit
from circuitkit.engine import Stepper, compile_circuit, run
from circuitkit.study.bench import AnyCase, AnyWork, Case, LeftOutError, Timed

_SETTLED = 20  # steps, after which nothing changes any more
_INSIDE = 2_000  # steps of ours in one call
_BRIAN_STEPS = 200_000
_BALANCED_SUBSTEPS = 400
_EXCITATORY = 80_000  # neurons of the balanced network
_SPARSE_STEPS = {1_000: 20_000, 10_000: 2_000, 100_000: 200}


def cases() -> tuple[AnyCase, ...]:
    """One call a step, many steps in a call, and sparse circuits."""
    return (
        Case("numpy: a call a step, against Nengo", "Nengo: Simulator.step", _nengo, 1 / 15),
        Case("numpy: a call a step, against PyRates", "PyRates: one call of its function", _pyrates, 1 / 6),
        Case("numpy: a call a step, against SNS-Toolbox", "as many neurons of SNS-Toolbox", _sns, 1 / 10),
        Case("compiled: inside run, against Brian2", "Brian2 standalone C++", _brian_binn, 1 / 3, _INSIDE),
        Case("compiled: inside run, against ANNarchy", "ANNarchy: simulate", _annarchy, 1.0, _INSIDE),
        *(
            Case(
                f"compiled: sparse, {size} neurons, against Brian2",
                "Brian2 standalone C++",
                _brian_sparse(size),
                0.5,
            )
            for size in _SPARSE_STEPS
        ),
        *(
            Case(
                f"compiled: balanced network, {cores} core{'s' * (cores > 1)}, against Brian2",
                "Brian2 standalone C++",
                _brian_balanced(cores),
                0.5,
            )
            for cores in (1, 2)
        ),
    )


def _peer(name: str, module: str) -> ModuleType:
    try:
        with contextlib.redirect_stdout(sys.stderr):  # some greet
            return importlib.import_module(module)
    except ImportError as error:
        message = f"{name} is not installed ({error})"
        raise LeftOutError(message) from error


def _require_settled(outputs: FloatArray, plain: PlainBinn, tolerance: float = 1e-9) -> None:
    """Compare what a simulator found with what plain numpy finds."""
    plain.steps(_SETTLED)
    np.testing.assert_allclose(outputs, plain.outputs, rtol=0, atol=tolerance)


def _nengo() -> tuple[AnyWork, AnyWork]:
    nengo = _peer("Nengo", "nengo")
    plain = PlainBinn(binn())
    weights = -plain.minus_slope[:, np.newaxis] * plain.weights
    n = len(weights)

    def simulator(*, recording: bool) -> tuple[Any, Any]:
        with nengo.Network() as network:
            cells = nengo.Ensemble(
                n,
                1,
                neuron_type=nengo.Sigmoid(tau_ref=1.0),
                gain=np.ones(n),
                bias=plain.minus_slope * plain.shift,
            ).neurons
            nengo.Connection(nengo.Node(INPUTS), cells, transform=weights[:, :2], synapse=None)
            nengo.Connection(cells, cells, transform=weights[:, 2:], synapse=0)
            probe = nengo.Probe(cells) if recording else None
        return nengo.Simulator(network, dt=0.01, progress_bar=False), probe

    recorded, probe = simulator(recording=True)
    recorded.run_steps(_SETTLED, progress_bar=False)
    _require_settled(recorded.data[probe][-1], plain)
    return steps_of(compiled_binn("numpy"), 1), loop(simulator(recording=False)[0].step)


def _pyrates() -> tuple[AnyWork, AnyWork]:
    """Its equations are differential: with tau = 1 and Euler's step of 1, v becomes the activation."""
    pyrates = _peer("PyRates", "pyrates")
    plain = PlainBinn(binn())
    constants = {"drive": 0.0, "tau": 1.0, "m": 1.0, "s": 0.0}
    states = {"v": "variable(0.0)", "o": "output(0.0)", "arriving": "input(0.0)"}
    equations = ["d/dt * v = (drive + arriving - v) / tau", "o = 1 / (1 + exp(-m * (v - s)))"]
    cell = pyrates.OperatorTemplate(name="cell", path=None, equations=equations, variables=states | constants)
    names = [f"n{i}" for i in range(len(plain.weights))]
    nodes, edges = {}, []
    for i, (name, row) in enumerate(zip(names, plain.weights, strict=True)):
        own = {
            "drive": float(row[:2] @ INPUTS),
            "m": float(-plain.minus_slope[i]),
            "s": float(plain.shift[i]),
        }
        nodes[name] = pyrates.NodeTemplate(name=name, path=None, operators={cell: own})
        edges += [
            (f"{names[j]}/cell/o", f"{name}/cell/arriving", None, {"weight": float(row[2 + j])})
            for j in np.flatnonzero(row[2:])
        ]
    circuit = pyrates.CircuitTemplate(name="binn", path=None, nodes=nodes, edges=edges)
    with contextlib.chdir(scratch()):  # it writes the function to a file
        function, (t, v, *rest), _, _ = circuit.get_run_func(
            "step", step_size=1.0, vectorize=True, float_precision="float64", verbose=False
        )

    def step() -> None:
        v.__iadd__(function(t, v, *rest))

    for _ in range(_SETTLED + 1):
        step()
    _require_settled(1 / (1 + np.exp(plain.minus_slope * (v - plain.shift))), plain, 1e-6)
    return steps_of(compiled_binn("numpy"), 1), loop(step)


def _sns() -> tuple[AnyWork, AnyWork]:
    """It has no sigmoid neurons: its own non-spiking ones, with the synapses of the BiNN."""
    networks = _peer("SNS-Toolbox", "sns_toolbox.networks")
    neurons = importlib.import_module("sns_toolbox.neurons")
    connections = importlib.import_module("sns_toolbox.connections")
    graph = binn()
    network = networks.Network(name="binn")
    for neuron in graph.neurons:
        network.add_neuron(neurons.NonSpikingNeuron(), name=neuron.name)
    excitatory = connections.NonSpikingSynapse(max_conductance=1.0, reversal_potential=100.0)
    inhibitory = connections.NonSpikingSynapse(max_conductance=1.0, reversal_potential=-40.0)
    for synapse in graph.synapses:
        if synapse.kind != "sensorial":
            network.add_connection(
                excitatory if synapse.weight > 0 else inhibitory, synapse.source, synapse.target
            )
    for name in ("lf", "q1"):
        network.add_input(name)
    for name in ("p1", "p2"):
        network.add_output(name)
    model = network.compile(backend="numpy", dt=0.1)
    return steps_of(compiled_binn("numpy"), 1), loop(lambda: model(INPUTS))


def _inside_run() -> Callable[[], object]:
    program = compiled_binn("compiled")
    inputs = np.tile(INPUTS, (_INSIDE, 1, 1))
    return lambda: run(program, inputs)


def _brian_binn() -> tuple[AnyWork, AnyWork]:
    plain = PlainBinn(binn())
    sources, targets = np.nonzero(plain.weights[:, 2:].T)
    seconds, results = _standalone(
        "brian_standalone.py",
        sources=sources,
        targets=targets,
        weights=plain.weights[targets, 2 + sources],
        slope=-plain.minus_slope,
        shift=plain.shift,
        drive=plain.weights[:, :2] @ INPUTS,
        steps=_BRIAN_STEPS,
    )
    _require_settled(results("o"), plain)
    return _inside_run(), Timed(lambda: seconds() / _BRIAN_STEPS * _INSIDE)


def _brian_sparse(size: int) -> Callable[[], tuple[AnyWork, AnyWork]]:
    def prepare() -> tuple[AnyWork, AnyWork]:
        _peer("Brian2", "brian2")
        graph = sparse_circuit(size)
        (projection,) = graph.projections
        times = _SPARSE_STEPS[size]
        seconds, results = _standalone(
            "brian_standalone.py",
            sources=projection.sources,
            targets=np.repeat(np.arange(size), np.diff(projection.indptr)),
            weights=np.broadcast_to(projection.weights, projection.sources.shape),
            slope=np.full(size, SLOPE),
            shift=np.full(size, SHIFT),
            drive=np.zeros(size),
            steps=times,
        )
        step, expected = by_hand(graph)
        for _ in range(times):
            step()
        np.testing.assert_allclose(results("o"), expected, rtol=0, atol=1e-9)
        return steps(checked(graph, "compiled", 1), 1), Timed(lambda: seconds() / times)

    return prepare


def _brian_balanced(cores: int) -> Callable[[], tuple[AnyWork, AnyWork]]:
    def prepare() -> tuple[AnyWork, AnyWork]:
        _peer("Brian2", "brian2")
        graph = load_circuit("balanced_network")
        program = compile_circuit(graph, backend="compiled", reproducible=False)
        first = dict(zip((each.name for each in graph.populations), (0, _EXCITATORY), strict=True))
        pairs: dict[str, list[FloatArray]] = {"excitatory": [], "inhibitory": []}
        weights = {projection.kind: float(projection.weights) for projection in graph.projections}
        for projection in graph.projections:
            targets = np.repeat(np.arange(len(projection.indptr) - 1), np.diff(projection.indptr))
            pairs[projection.kind].append(
                np.stack([first[projection.source] + projection.sources, first[projection.target] + targets])
            )
        seconds, results = _standalone(
            "brian_balanced.py",
            **{kind: np.concatenate(found, axis=1) for kind, found in pairs.items()},
            weights=[weights[kind] for kind in pairs],
            v=np.concatenate([population.initial["v"] for population in graph.populations]),
            substeps=_BALANCED_SUBSTEPS,
        )
        with threads(cores):
            stepper = Stepper(program, 1)
        control_steps = _BALANCED_SUBSTEPS // graph.substeps
        spikes = sum(float(stepper.step(np.zeros((1, 0)))[0, 0]) for _ in range(control_steps))
        # What one does is the other's to the last bits, which soon make other spikes, but as many of them.
        np.testing.assert_allclose(spikes, results("spikes")[:_EXCITATORY].mean(), rtol=0.01)

        def substeps() -> float:
            begin = time.perf_counter()
            for _ in range(control_steps):
                stepper.step()
            return (time.perf_counter() - begin) / _BALANCED_SUBSTEPS

        return Timed(substeps), Timed(lambda: seconds() / _BALANCED_SUBSTEPS)

    return prepare


def _standalone(script: str, **circuit: object) -> tuple[Callable[[], float], Callable[[str], FloatArray]]:
    """A program made by Brian2.

    Returns:
        What runs it and says how long it took after its start, [s]; what gives a variable's last values.
    """
    _peer("Brian2", "brian2")
    folder = scratch()
    np.savez(folder / "circuit.npz", **circuit)
    path = Path(__file__).with_name(script)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    arguments = [str(path), str(folder / "circuit.npz"), str(folder / "made")]
    built = subprocess.run([sys.executable, "-W", "ignore", *arguments], check=False, **quiet)
    if built.returncode:
        message = f"Brian2 could not build its program: python {' '.join(arguments)}"
        raise LeftOutError(message)
    results = folder / "made" / "results"

    def seconds() -> float:
        subprocess.run(["./main"], cwd=folder / "made", check=True, **quiet)
        return float((results / "last_run_info.txt").read_text().split()[0])

    def values(name: str) -> FloatArray:
        (file,) = results.glob(f"_array_neurongroup_{name}_*")
        return np.fromfile(file)

    seconds()
    return seconds, values


def _annarchy() -> tuple[AnyWork, AnyWork]:
    ann = _peer("ANNarchy", "ANNarchy")
    plain = PlainBinn(binn())
    import scipy.sparse

    network = ann.Network(dt=1.0)
    local = {name: ann.Parameter(0.0, locality="local") for name in ("slope", "shift", "drive")}
    cell = ann.Neuron(parameters=local, equations=["r = 1 / (1 + exp(-slope * (sum(exc) + drive - shift)))"])
    cells = network.create(geometry=len(plain.weights), neuron=cell)
    cells.slope, cells.shift, cells.drive = -plain.minus_slope, plain.shift, plain.weights[:, :2] @ INPUTS
    network.connect(cells, cells, target="exc").from_sparse(scipy.sparse.lil_matrix(plain.weights[:, 2:].T))
    if shutil.which("cmake") is None:
        message = "ANNarchy builds with CMake, which is not installed"
        raise LeftOutError(message)
    network.compile(directory=str(scratch()), silent=True)
    network.simulate(float(_SETTLED))
    _require_settled(cells.r, plain)
    return _inside_run(), lambda: network.simulate(float(_INSIDE))
