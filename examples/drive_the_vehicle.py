"""Drive the shipped vehicle through its arena with a circuit of six neurons, and draw the way it went.

Run it with: python examples/drive_the_vehicle.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from circuitkit import simulate

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/vehicle")
result = simulate("vehicle_avoids", output=folder)

path_m, touched_s = result.measures["path"], result.measures["touched_s"]
print(f"drove {path_m:.1f} m in {result.scenario.duration:g} s, and touched something for {touched_s:.2f} s")

# What was recorded is at hand as arrays, one row a control step; all in SI units.
left, right = (result.recording.channel(f"distance_{side}")[:, 0] for side in ("left", "right"))
print(f"nearest to the left {100 * left.min():.0f} cm, to the right {100 * right.min():.0f} cm")
print(f"the way from above is drawn in {folder / 'path.png'}, the neurons in {folder / 'neurons.png'}")
