"""Push the marching NAO, with and without the circuit, and say what became of it.

Run it with: python examples/push_the_nao.py
"""

from __future__ import annotations

from circuitkit.simulation import load_scenario, simulate

# Any field of a scenario can be changed in Python; the file stays as it is.
scenario = load_scenario("nao_push").model_copy(update={"gait": "gait_march", "duration": 9.0})

for controller in ("open_loop", "circuit"):
    verdict = simulate(scenario, controller=controller).verdict
    outcome = "stands" if verdict.survived else f"falls at {verdict.time_of_fall_s:.2f} s"
    print(f"{controller}: {outcome}, ZMP at most {verdict.max_zmp_excursion_m * 1e3:.1f} mm outside")
