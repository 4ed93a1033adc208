from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from circuitkit import compile_circuit, load_circuit
from circuitkit.base.errors import InputError
from circuitkit.circuit import CircuitGraph, parse_circuit
from circuitkit.circuit.silencing import connections, silence
from circuitkit.engine import run


def binn() -> CircuitGraph:
    return load_circuit("binn_lateral")


def drive(graph: CircuitGraph, **inputs: float) -> np.ndarray:
    """The first output over 20 steps with steady inputs."""
    program = compile_circuit(graph, "numpy")
    table = np.broadcast_to(program.pack_inputs(inputs), (20, 1, len(program.input_names)))
    return run(program, table).readout[:, 0, 0]


def on_left_foot(graph: CircuitGraph, zmp_y_m: float) -> np.ndarray:
    return drive(graph, zmp_y=zmp_y_m, force_difference=1.0)


def test_every_pair_of_the_binn_is_listed_once() -> None:
    edges = connections(binn())
    # 3 + 4 sensorial, 6 from the feet, 8 from the q, 4 between p and h, 2 shares in the output
    assert len(edges) == 3 + 4 + 6 + 8 + 4 + 2
    assert len(set(edges)) == len(edges)
    assert ("p1", "ankle_roll") in edges


def test_nothing_silenced_is_the_same_circuit() -> None:
    graph = binn()
    assert silence(graph, ()) is graph


@pytest.mark.parametrize("part", ["q4", "q4 -> p2", "p2", "p2->ankle_roll"])
def test_without_the_way_from_the_left_edge_nothing_answers_there(part: str) -> None:
    graph = binn()
    cut = silence(graph, [part])
    assert abs(on_left_foot(graph, 0.12)[-1]) > abs(on_left_foot(cut, 0.12)[-1]) * 2
    same = np.abs(on_left_foot(graph, 0.0) - on_left_foot(cut, 0.0)).max()
    assert same < 0.03 * abs(on_left_foot(graph, 0.0)[-1])  # the right edge is another way


def test_what_a_silenced_neuron_receives_still_arrives() -> None:
    cut = silence(binn(), ["q4"])
    weights = {(s.source, s.target): s.weight for s in cut.synapses}
    assert weights["zmp_y", "q4"] == 1
    assert weights["q4", "p2"] == weights["q4", "h2"] == 0
    assert weights["q3", "p1"] == 1


def test_a_silenced_circuit_has_as_many_synapses_in_the_same_order() -> None:
    graph = binn()
    cut = silence(graph, ["p1 -> h1"])
    assert [(s.source, s.target) for s in cut.synapses] == [(s.source, s.target) for s in graph.synapses]


def test_a_plastic_synapse_goes_for_its_weight_may_grow_again() -> None:
    graph = load_circuit("conditioned_reflex")
    plastic = next(s for s in graph.synapses if s.model.states)
    cut = silence(graph, [f"{plastic.source} -> {plastic.target}"])
    assert (plastic.source, plastic.target) not in [(s.source, s.target) for s in cut.synapses]


def test_a_population_falls_silent() -> None:
    text = """
circuit: two_rings
description: one drives the other
control_step: 10 ms
timing: ordered
inputs: {x: {unit: "1", range: [0, 1]}}
populations:
  a: {size: 3, model: leaky_linear, role: excitatory, tau: 20 ms}
  b: {size: 3, model: leaky_linear, role: excitatory, tau: 20 ms}
projections:
  - {from: x, to: a, connect: all_to_all, weight: 1}
  - {from: a, to: b, connect: one_to_one, weight: 1}
outputs: {y: {unit: "1", readout: {b: 1}}}
"""
    graph = parse_circuit(text)
    assert drive(graph, x=1.0)[-1] > 0
    assert drive(silence(graph, ["a"]), x=1.0)[-1] == 0
    assert drive(silence(graph, ["b -> y"]), x=1.0)[-1] == 0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "q5",
            "neuron or input that sends anything in 'binn_lateral'; allowed: force_difference",
        ),
        ("q1 -> p2", "connection in 'binn_lateral'; allowed: force_difference -> lf"),
    ],
)
def test_what_is_not_there_is_refused_with_what_is(name: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        silence(binn(), [name])
    assert str(caught.value).startswith(f"silenced: found '{name}': no {message}")
    assert "did you mean 'q" in str(caught.value)


def test_a_gate_is_not_silenced_as_a_neuron(tmp_path: Path) -> None:
    file = tmp_path / "gated.yaml"
    file.write_text(
        """
circuit: gated
description: one neuron opens the way of another
control_step: 10 ms
timing: ordered
inputs: {x: {unit: "1", range: [0, 1]}}
neurons:
  a: {model: sigmoid, role: excitatory, slope: 10, shift: 0.5}
  g: {model: sigmoid, role: excitatory, slope: 10, shift: 0.5}
  b: {model: sigmoid, role: excitatory, slope: 10, shift: 0.5}
synapses:
  - {from: x, to: [a, g], weight: 1}
  - {from: g, to: b, weight: 1}
  - {from: a, to: b, weight: 1, model: gated, gate: g}
outputs: {y: {unit: "1", readout: {b: 1}}}
""",
        encoding="utf-8",
    )
    with pytest.raises(InputError, match="found 'g', which gates a -> b; allowed: neurons that gate nothing"):
        silence(load_circuit(file), ["g"])
