"""Runs pieces of Python in processes of their own, which begin without anything that this one has loaded."""

from __future__ import annotations

import os
import subprocess
import sys


def number_of(script: str, *arguments: str, **environment: str) -> float:
    """The number that a script prints on its last line.

    Raises:
        subprocess.CalledProcessError: The script fails.
    """
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        env={**os.environ, **environment},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    return float(done.stdout.splitlines()[-1])
