"""Search the largest push that the marching NAO survives in open loop and with a circuit.

Run it with: python examples/largest_push.py
"""

from __future__ import annotations

import tempfile

from circuitkit.study import load_study, sweep

# A shipped study, made small: two contenders, one kind of push, two seeds, coarse steps of force.
study = load_study("fig11").with_(
    {
        "watch": "2 s",
        "axes": {
            "contender": ["open_loop", "binn_capture"],
            "push.direction": ["outward"],
            "push.duration": ["0.2 s"],
        },
        "seeds": {"count": 2},
        "search": {"high": "16 N", "step": "2 N", "check_below": 0},
    }
)

if __name__ == "__main__":  # with more workers than one, they are processes that import this file
    with tempfile.TemporaryDirectory() as folder:
        for limit in sweep(study, folder, workers=1, progress=False).limits():
            stood = f"{limit.survived} of {limit.runs}"
            print(f"{limit.labels['contender']}: {limit.largest:.0f} N, stood in {stood} runs")
