"""A tuning that is killed at any moment and resumed leaves what one leaves that was never stopped."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]


def kills(folder, *points):
    words = [sys.executable, str(TESTS / "tuning_kills.py"), str(folder), *map(str, points)]
    path = os.pathsep.join([str(TESTS.parent), str(TESTS)])
    env = os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=env)
    return json.loads(done.stdout)


def test_every_seventh_moment(tmp_path):
    found = kills(tmp_path, *range(1, 658, 7))
    assert found["differing"] == []
    assert found["moments"] >= 600
