"""Delays that need more memory than the machine has: 24 bytes a step and source, as the estimate says."""

import pytest

from circuitkit.base.errors import InputError
from circuitkit.circuit import memory, parse_circuit
from circuitkit.engine import compile_circuit

CIRCUIT = """\
circuit: late
control_step: 10 ms
timing: ordered
substeps: 5
inputs: {{u: {{unit: "1", range: [0, 1]}}}}
neurons: {{q: {{model: leaky_integrator, role: excitatory, tau: 10 ms}}}}
populations: {{ring: {{size: 100, model: leaky_integrator, role: excitatory, tau: 10 ms}}}}
synapses:
  - {{from: u, to: q, weight: 1, delay: {0}}}
  - {{from: q, to: "ring[1]", weight: 1, delay: {1}}}
projections:
  - {{from: ring, to: ring, connect: one_to_one, weight: 1, delay: {2}}}
outputs: {{y: {{unit: "1", readout: {{ring: 1}}}}}}
"""


@pytest.mark.parametrize(
    ("delays", "place", "steps", "need"),
    [
        (("1 h", "1 s", "1 s"), "f.yaml:9:5: synapse u -> q", 360_000, "0.00985 GB"),
        (("1 s", "1 h", "1 s"), "f.yaml:10:5: synapse q -> ring[1]", 1_800_000, "0.0444 GB"),
        (("1 s", "1 s", "1e3 s"), "f.yaml:12:5: projection ring -> ring", 500_000, "1.2 GB"),
    ],
)
def test_a_delay_that_does_not_fit_into_memory_is_named(monkeypatch, delays, place, steps, need):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 5_000_000)
    graph = parse_circuit(CIRCUIT.format(*delays), "f.yaml")
    with pytest.raises(InputError) as caught:
        compile_circuit(graph)
    assert str(caught.value) == (
        f"{place}: found {steps} steps of delay, which need about {need} of memory, "
        "but this machine has 0.005 GB; allowed: fewer"
    )


def test_steps_of_a_delay_are_counted_with_32_bits(monkeypatch):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 10**15)
    graph = parse_circuit(
        CIRCUIT.format("1 h", "1 s", "1 s").replace("control_step: 10 ms", "control_step: 1 us"), "f.yaml"
    )
    with pytest.raises(InputError) as caught:
        compile_circuit(graph)
    assert str(caught.value) == (
        "f.yaml:9:5: synapse u -> q: found 3600000000 steps of delay; allowed: up to 2147483647"
    )


def test_delays_that_fit_are_let_through(monkeypatch):
    monkeypatch.setattr(memory, "machine_bytes", lambda: 24_000_000_000)
    graph = parse_circuit(CIRCUIT.format("1 s", "0 s", "2 s"), "f.yaml")
    assert [found.depth for found in compile_circuit(graph, "numpy").memories] == [100, 1001]
