"""Several spikes in one control step: each acts by itself on a synapse, whatever the rate of its target."""

import numpy as np
import pytest

from circuitkit.circuit import parse_circuit
from circuitkit.engine import compile_circuit, run

SUBSTEPS = 10
DT = 1e-3
HEAD = f"""
circuit: burst
control_step: {SUBSTEPS} ms
timing: synchronous
substeps: {SUBSTEPS}
inputs: {{i: {{unit: nA, range: [0 nA, 1000 nA]}}}}
"""
LIF = "model: leaky_integrate_and_fire, role: excitatory, refractory: 0 ms, tau: 0.01 ms"
TIRED = "model: depressing_facilitating, use: 0.5, tau_depression: 10 s, tau_facilitation: 1 ms, tau: 10 s"
SINGLE = f"""
neurons:
  pre: {{{LIF}}}
  slow: {{model: identity, role: excitatory}}
  too: {{model: identity, role: excitatory}}
synapses:
  - {{from: i, to: pre, weight: 1}}
  - {{from: pre, to: [slow, too], weight: 1, DELAY{TIRED}}}
outputs: {{y: {{unit: "1", readout: {{slow: 1, too: 1}}}}}}
"""
MANY = f"""
populations:
  pre: {{size: 1, {LIF}}}
  slow: {{size: 2, model: identity, role: excitatory}}
synapses: [{{from: i, to: "pre[0]", weight: 1}}]
projections: [{{from: pre, to: slow, connect: all_to_all, weight: 1, DELAY{TIRED}}}]
outputs: {{y: {{unit: "1", readout: {{slow: 1}}}}}}
"""


def by_hand(n_spikes):
    """The current after the last of spikes 1 ms apart (Tsodyks, Pawelzik and Markram 1998)."""
    u, x, s = 0.0, 1.0, 0.0
    for k in range(n_spikes):
        if k:
            u, x, s = u * np.exp(-DT / 1e-3), 1 - (1 - x) * np.exp(-DT / 10), s * np.exp(-DT / 10)
        used = u + 0.5 * (1 - u)
        s, x, u = s + used * x, x - used * x, used
    return s


@pytest.mark.parametrize("backend", ["numpy", "auto"])
@pytest.mark.parametrize("body", [SINGLE, MANY], ids=["synapses", "projection"])
@pytest.mark.parametrize("delay_steps", [0, 2])
def test_every_spike_of_a_burst_uses_up_its_part(backend, body, delay_steps):
    delay = f"delay: {delay_steps * SUBSTEPS} ms, " if delay_steps else ""
    program = compile_circuit(parse_circuit(HEAD + body.replace("DELAY", delay)), backend)
    inputs = np.full((5, 1, 1), 1000e-9)
    inputs[1:] = 0.0  # ten spikes in the first control step, then silence
    trace = run(program, inputs)
    column = program.neuron_index
    slow = [column[name] for name in ("slow", "too" if "slow" in column else "slow[1]") if name in column]
    slow = slow or [column["slow[0]"], column["slow[1]"]]
    np.testing.assert_allclose(trace.activation[1 + delay_steps, 0, slow], by_hand(10), rtol=1e-12)
    assert by_hand(10) == pytest.approx(0.9996, abs=3e-4)  # not 5, as ten spikes at once would use up


IMPULSE = """
synapse_models:
  tired:
    weight: activation/source
    states: {x: {unit: 1, initial: 1}}
    jumps: {x: x - 0.5 * x * pre}
    current: weight * pre * x
"""


@pytest.mark.parametrize("backend", ["numpy", "auto"])
def test_what_spikes_deliver_at_once_adds_up(backend):
    """Each spike halves x and delivers it: 1/2 + 1/4 + ... + 2^-10; nothing after them."""
    body = SINGLE.replace("DELAY" + TIRED, "model: tired").replace(
        "from: pre, to: [slow, too]", "from: pre, to: slow"
    )
    program = compile_circuit(parse_circuit(HEAD + IMPULSE + body), backend)
    inputs = np.full((3, 1, 1), 1000e-9)
    inputs[1:] = 0.0
    slow = run(program, inputs).activation[:, 0, program.neuron_index["slow"]]
    np.testing.assert_allclose(slow, [0.0, 1 - 2.0**-10, 0.0], rtol=1e-12)
