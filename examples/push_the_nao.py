"""Push the marching NAO, with and without the circuit, and say what became of it.

Run it with: python examples/push_the_nao.py
"""

from __future__ import annotations

import math

from circuitkit import Scenario, compare

scenario = Scenario(
    scenario="march",
    robot="nao",
    reference={"gait": "gait_march"},
    circuit="binn_lateral_tuned",
    duration=9.0,
    disturbances=[
        {"push": {"body": "torso", "force": "20 N", "direction": "inward", "duration": "200 ms",
                  "start": {"step": 8, "phase": "lift", "at": "40 %"}}},
        {"noise": {"channel": "*Fsr*", "std": "0.2 N"}},
    ],
    until="upright < 0.7",
    measures={"lean": "atan2(sqrt(max(1 - min(upright) * min(upright), 0)), min(upright))"},
)  # fmt: skip

for result in compare(scenario, ["open_loop", "circuit"]):
    lean_deg = math.degrees(result.measures["lean"])
    print(f"{result.recording.controller}: {result.outcome}, leaned by {lean_deg:.0f} degrees at most")
