"""What every command has in common: help, exit codes, messages, Ctrl-C, pipes and full disks."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import circuitkit as package
from circuitkit.base.errors import InputError, Problem, SimulationError
from circuitkit.cli.app import COMMANDS

MODULE = [sys.executable, "-m", "circuitkit"]


def test_help_lists_the_commands_in_the_order_of_use(circuitkit):
    outcome = circuitkit("--help")
    assert outcome.code == 0
    listed = outcome.out.split("Commands:")[1]
    names = re.findall(r"^  (\w+)  ", listed, re.MULTILINE)
    assert tuple(names) == COMMANDS
    circuits = ["init", "list", "validate", "format", "show", "diff", "draw", "run", "schema"]
    others = ["simulate", "compare", "sweep", "tune", "reproduce", "design", "bench"]
    contract = [*circuits, *others]  # more may come
    assert [name for name in names if name in contract] == contract


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_examples(circuitkit, command):
    outcome = circuitkit(command, "--help")
    assert outcome.code == 0
    assert f"Usage: circuitkit {command}" in outcome.out
    assert "-h, --help" in outcome.out
    lines = outcome.out.split("Examples:\n")[1].splitlines()
    assert len(lines) >= 2
    assert all(line.strip().startswith(f"circuitkit {command}") for line in lines if line.strip())
    assert max(len(line) for line in outcome.out.splitlines()) <= 110


def test_no_command_prints_the_help_and_is_wrong_usage(circuitkit):
    outcome = circuitkit()
    assert outcome.code == 2
    assert "Commands:" in outcome.out + outcome.err


def test_version(circuitkit):
    assert circuitkit("--version").out == f"circuitkit {package.__version__}\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("validat", "x"), "Error: No such command 'validat'. Did you mean 'validate'?"),
        (("validate",), "Error: Missing argument 'FILE'."),
        (("run", "binn_lateral", "--step", "3"), "Error: No such option: --step"),
        (
            ("run", "binn_lateral", "--steps", "0"),
            "Error: Invalid value for '--steps': ",
        ),
        (
            ("run", "binn_lateral"),
            "Error: Invalid value: give --steps N, or --inputs TABLE.csv with one row a step",
        ),
        (
            ("run", "binn_lateral", "--input", "zmp_y", "--steps", "3"),
            "Error: Invalid value for --input: found 'zmp_y'; allowed: NAME=VALUE, such as zmp_y=70mm",
        ),
        (
            ("simulate", "nao_push", "--circuit", "a.yaml", "--controller", "circuit"),
            "Error: Invalid value: give --circuit or --controller, not both",
        ),
        (
            ("simulate", "nao_push", "--video"),
            "Error: Invalid value: --video needs a folder to write to: -o DIR",
        ),
        (("compare", "nao_push"), "Error: Missing option '--controllers'."),
    ],
)
def test_wrong_usage_exits_with_2_and_says_what_is_wrong(circuitkit, words, message):
    outcome = circuitkit(*words)
    assert outcome.code == 2
    assert message in outcome.err
    assert outcome.out == ""


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (
            InputError(Problem("a.yaml", 3, 5, "neurons.q1", "bad", "try this")),
            1,
            "a.yaml:3:5: neurons.q1: bad; try this\n",
        ),
        (SimulationError("the robot has left the world"), 3, "the robot has left the world\n"),
        (
            FileNotFoundError(2, "No such file or directory", "x.csv"),
            3,
            "cannot use 'x.csv': No such file or directory\n",
        ),
        (OSError(28, "No space left on device"), 3, "No space left on device\n"),
        (MemoryError("1 TiB"), 3, "not enough memory: 1 TiB\n"),
        (
            ZeroDivisionError("division by zero"),
            3,
            "internal error: ZeroDivisionError: division by zero; --debug shows where, please report it\n",
        ),
        (KeyboardInterrupt(), 130, "interrupted\n"),
    ],
)
def test_errors_become_exit_codes_and_one_message(circuitkit, monkeypatch, error, code, message):
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("circuitkit.circuit.check", fail)
    outcome = circuitkit("validate", "x.yaml")
    assert (outcome.code, outcome.out, outcome.err) == (code, "", message)


@pytest.mark.parametrize("words", [("--debug", "validate", "x.yaml"), ("validate", "x.yaml", "--debug")])
def test_debug_shows_the_traceback_with_the_same_exit_code(circuitkit, monkeypatch, words):
    def fail(*_: object) -> None:
        raise InputError(Problem("", 0, 0, "", "bad"))

    monkeypatch.setattr("circuitkit.circuit.check", fail)
    outcome = circuitkit(*words)
    assert outcome.code == 1
    assert outcome.err.startswith("Traceback (most recent call last)")
    assert outcome.err.endswith("InputError: bad\n")


def test_a_broken_pipe_is_quiet():
    words = [*MODULE, "run", "binn_lateral", "--steps", "20000"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.read(7) == b"time_s,"
        process.stdout.close()
        errors = process.stderr.read().decode()
    assert process.returncode == 141
    assert errors == "note: held at 0, for no value was given: force_difference, zmp_y\n"


def test_ctrl_c_ends_with_one_line(tmp_path: Path):
    words = [*MODULE, "run", "binn_lateral", "--steps", "2000000", "-o", str(tmp_path / "out.csv")]
    with subprocess.Popen(words, stderr=subprocess.PIPE) as process:
        time.sleep(1.5)
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        errors = process.stderr.read().decode()
    assert errors == "interrupted\n"
    # Hit inside `exec`, as while importing, Python from 3.12 on ends by the signal itself: 130 to a shell.
    assert process.returncode in (130, -signal.SIGINT)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_told():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*MODULE, "schema"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (3, "No space left on device\n")


def test_text_that_the_terminal_cannot_show_does_no_harm():
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [*MODULE, "show", "binn_lateral"], capture_output=True, env=environment, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")


def test_help_and_validate_import_nothing_heavy():
    """Start-up times depend on the machine; what makes them long is the imports."""
    heavy = {"numpy", "scipy", "networkx", "matplotlib", "mujoco", "rich", "pydantic"}
    helps = [(["--help"], "0 []"), *((([command, "--help"]), "0 []") for command in COMMANDS)]
    for words, imported in (*helps, (["validate", "binn_lateral"], "0 ['pydantic']")):
        code = (
            f"import sys; from circuitkit.cli.main import main; code = main({words}); "
            f"print(code, sorted({heavy} & set(sys.modules)))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == imported
