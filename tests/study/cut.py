"""A small cut of the shipped study of push limits: marching, two contenders, few seeds, short watch."""

from __future__ import annotations

from typing import Any

from circuitkit.study import Study, load_study

STEP_N = 15.0
FORCES_N = (0.0, 15.0, 30.0, 45.0)
SEEDS = (0, 1)


def small_study(**changes: Any) -> Study:
    """Twenty runs of 2.35 s or less."""
    return load_study("push_limits").with_(
        {
            "seeds": {"count": len(SEEDS)},
            "set": {"push.start.step": 0},
            "watch": "1 s",
            "search": {"low": "0 N", "high": "45 N", "step": "15 N", "check_below": 1},
            "axes": {
                "reference.gait": ["gait_march"],
                "contender": ["open loop", "tuned, towards the edge"],
                "push.duration": ["0.2 s"],
            },
            **changes,
        }
    )
