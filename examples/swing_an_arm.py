"""A half-centre swings the shipped arm. Feeling it, it takes over the arm's own frequency, loaded or not.

Run it with: python examples/swing_an_arm.py
"""

from __future__ import annotations

import math

from circuitkit import load_scenario, simulate
from circuitkit.simulation.disturbances.body import Body

# Any field of a scenario can be changed in Python; the file stays as it is.
scenario = load_scenario("arm_rhythm").model_copy(update={"duration": 60.0})

for payload_kg in (0.0, 0.5, 1.0):
    loaded = scenario.with_disturbances((Body(body="hand", payload=payload_kg),))
    for felt, silenced in ((True, ()), (False, ("feedback",))):
        measures = simulate(loaded.model_copy(update={"silenced": silenced})).measures
        swing_deg = math.degrees(measures["amplitude"])
        words = "feels the arm" if felt else "feels nothing"
        print(f"{payload_kg:.1f} kg, {words}: {measures['frequency']:.2f} Hz, {swing_deg:.0f} degrees")
