"""Start-up: the help of every command comes at once."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from circuitkit.cli.app import COMMANDS

LONGEST_S = 0.3


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_the_help_takes_less_than_0_3_s_of_the_processor(command):
    """Of the processor, not of the clock, for others may use the machine; the best of three."""
    words = [sys.executable, "-m", "circuitkit", *([command] if command else []), "--help"]
    taken = []
    for _ in range(3):
        before = os.times()
        subprocess.run(words, capture_output=True, check=True)
        after = os.times()
        taken.append(
            after.children_user + after.children_system - before.children_user - before.children_system
        )
        if taken[-1] < LONGEST_S:
            break
    assert min(taken) < LONGEST_S
