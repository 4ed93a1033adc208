"""Draws the picture of docs/robots/nao.md: what `circuitkit compare` plots of the NAO that stands."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from circuitkit import compare

PICTURE = Path(__file__).parent / "img" / "nao_stands.png"
CONTROLLERS = ("open_loop", "circuit", "dcm_ankle")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        compare(
            "nao_stands",
            CONTROLLERS,
            circuit="binn_lateral_capture_tuned",
            push="20N,200ms,left",
            output=folder,
        )
        shutil.copy(Path(folder) / "compare.png", PICTURE)
