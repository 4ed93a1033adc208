"""Pieces of Python in processes of their own, which begin without what this one has loaded; and folders."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path


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


def scratch() -> Path:
    """A folder that is there as long as this process."""
    folder = tempfile.mkdtemp(prefix="circuitkit_bench_")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
