"""Push the marching NAO, with and without the circuit, and print what becomes of it.

Run it with: python examples/push_the_nao.py
"""

from __future__ import annotations

from circuitkit import load_scenario, simulate
from circuitkit.biped.gait import load_gait
from circuitkit.biped.references import GaitReference

# Any field of a scenario can be changed in Python; the file stays as it is.
changes = {"reference": GaitReference(load_gait("gait_march")), "duration": 9.0}
scenario = load_scenario("nao_push").model_copy(update=changes)

for controller in ("open_loop", "circuit"):
    result = simulate(scenario, controller=controller)
    beyond_mm = 1e3 * result.measures["max_zmp_excursion_m"]
    print(f"{controller}: {result.outcome}, ZMP at most {beyond_mm:.1f} mm outside")
