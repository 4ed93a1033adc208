"""A half-centre swings a hanging leg; feeling the leg, it takes over its rhythm and swings it further.

Run it with: python examples/swing_a_leg.py
"""

from __future__ import annotations

import math

import numpy as np

from circuitkit import Stepper, compile_circuit, load_circuit

GRAVITY, LENGTH_M, DAMPING = 9.81, 0.15, 0.8  # a point mass on a rod; damping [1/s]
PUSH = 20.0  # acceleration by which the leg follows the oscillator's angle, [1/s^2]
PART = 10  # steps of the pendulum in a control step

program = compile_circuit(load_circuit("matsuoka_half_centre"))


def swing(felt: float, duration_s: float = 30.0) -> tuple[float, float]:
    """Frequency [Hz] and amplitude [rad] of the leg in the second half.

    Args:
        felt: How strongly the leg's angle silences the neuron of that side, [1/rad]; 0 for not at all.
        duration_s: How long.
    """
    stepper = Stepper(program, 1)
    angle, speed = 0.0, 0.0
    angles = np.empty(round(duration_s / program.step_s))
    for i in range(len(angles)):
        stepper.inputs[0] = -felt * angle
        wanted = stepper.step()[0, 0]
        for _ in range(PART):
            own = -GRAVITY / LENGTH_M * math.sin(angle) - DAMPING * speed
            speed += program.step_s / PART * (own + PUSH * wanted)
            angle += program.step_s / PART * speed
        angles[i] = angle
    late = angles[len(angles) // 2 :]
    rises = np.flatnonzero((late[:-1] < 0) & (late[1:] >= 0))
    return (len(rises) - 1) / ((rises[-1] - rises[0]) * program.step_s), float(late.max())


if __name__ == "__main__":
    print(f"own rhythm of the leg: {math.sqrt(GRAVITY / LENGTH_M) / (2 * math.pi):.2f} Hz")
    for strength in (0.0, 0.25, 0.5, 1.0):
        hertz, amplitude = swing(strength)
        print(f"felt with {strength:.2f} /rad: {hertz:.2f} Hz, {math.degrees(amplitude):.0f} degrees")
