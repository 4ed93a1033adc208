"""One call, many circuits: the response of the lateral network over the whole range of both inputs.

Run it with: python examples/circuits_in_a_batch.py
"""

import numpy as np

from circuitkit import compile_circuit, load_circuit, run

STEPS = 50

program = compile_circuit(load_circuit("binn_lateral"))

load, zmp_y = np.meshgrid([-1.0, 0.0, 1.0], np.linspace(-0.12, 0.12, 13), indexing="ij")  # SI
inputs = program.pack_inputs({"force_difference": load.ravel(), "zmp_y": zmp_y.ravel()})  # (batch, inputs)
trace = run(program, np.broadcast_to(inputs, (STEPS, *inputs.shape)))

ankle_deg = np.rad2deg(trace.readout[-1, :, 0]).reshape(load.shape)
print("ZMP [mm]    right foot   both feet   left foot   (ankle roll after half a second, degrees)")
for column, zmp_m in enumerate(zmp_y[0]):
    right, both, left = ankle_deg[:, column]
    print(f"{1e3 * zmp_m:8.0f}   {right:10.2f}  {both:10.2f}  {left:10.2f}")
