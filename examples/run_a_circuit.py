"""A circuit alone: the right foot carries, and the ZMP moves over its right edge and back again.

Run it with: python examples/run_a_circuit.py
"""

import numpy as np

from circuitkit import compile_circuit, load_circuit, run

program = compile_circuit(load_circuit("binn_lateral"))

time_s = np.arange(100) * program.step_s
inputs = np.zeros((len(time_s), 1, len(program.input_names)))  # steps, batch, inputs; all SI
inputs[:, 0, program.input_index["force_difference"]] = -1.0  # all weight on the right foot
inputs[:, 0, program.input_index["zmp_y"]] = -0.06 - 0.04 * np.sin(np.pi * time_s / time_s[-1])

trace = run(program, inputs)
ankle_deg = np.rad2deg(trace.readout[:, 0, program.output_index["ankle_roll"]])
p1 = trace.output[:, 0, program.neuron_index["p1"]]
for i in range(0, len(time_s), 10):
    zmp_mm = 1e3 * inputs[i, 0, program.input_index["zmp_y"]]
    print(f"{time_s[i]:.1f} s   ZMP {zmp_mm:6.1f} mm   p1 {p1[i]:.2f}   ankle {ankle_deg[i]:6.2f}°")
