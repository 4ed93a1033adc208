"""A controller of your own, in Python, in the place of a circuit: any object with these names will do.

Run it with: python examples/your_own_controller.py
"""

from __future__ import annotations

import numpy as np

from circuitkit import simulate


class StateFeedback:
    """Pushes the cart against the lean of the pole: force = K (cart, its speed, pole, its speed)."""

    name = "state_feedback"
    observations = ("cart", "cart_speed", "pole", "pole_speed")  # channels of the robot
    commands = ("force",)
    gains = np.array([[2.0], [4.0], [60.0], [8.0]])  # N/m, N*s/m, N/rad, N*s/rad

    def reset(self, batch: int) -> None:
        """Nothing to forget."""

    def step(self, observation: np.ndarray) -> np.ndarray:
        """Commands of shape (batch, 1), [N], from observations of shape (batch, 4), SI units."""
        return observation @ self.gains


for controller in (StateFeedback(), "circuit", "open_loop"):
    result = simulate("cartpole_balances", controller=controller)
    lean_deg = np.degrees(result.measures["largest_lean"])
    print(f"{result.recording.controller}: {result.outcome}, largest lean {lean_deg:.0f} degrees")
