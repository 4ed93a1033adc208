"""Start-up: the help of every command comes at once; a module that imports late says why, once."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from circuitkit import cli
from circuitkit.cli.app import COMMANDS

MODULES = sorted(Path(next(iter(cli.__path__))).glob("*.py"))
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


@pytest.mark.parametrize("module", MODULES, ids=[module.stem for module in MODULES])
def test_imports_inside_functions_say_why_once_a_module(module):
    text = module.read_text(encoding="utf-8")
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    inner = [
        text.splitlines()[node.lineno - 1]
        for function in functions
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    assert not inner or any("  # " in line for line in inner)
