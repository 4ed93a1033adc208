"""Generated C and the runtime: no warning of gcc or clang, and nothing that the sanitizers find."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from cases import CASES

from circuitkit.circuit import load_circuit
from circuitkit.engine import compile_circuit
from circuitkit.engine.backends.c import build
from circuitkit.engine.backends.compiled_backend import print_program

CIRCUITS = max(1, CASES // 300)
HERE = Path(__file__).parent


def sources():
    """The runtime, and circuits of both forms, alone and in a batch, in both precisions."""
    yield "runtime", (build.HERE / "runtime.c").read_text(encoding="utf-8")
    for name in ("binn_lateral", "spiking_reflex", "balanced_network"):
        for precision in ("float64", "float32"):
            program = compile_circuit(load_circuit(name), "numpy", precision)
            yield from (
                (f"{name}_{precision}_{batch}", print_program(program, batch).text) for batch in (1, 9)
            )


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_compilers_have_nothing_to_warn_of(compiler, tmp_path):
    path = shutil.which(compiler)
    if path is None or build.unavailable():
        pytest.skip(f"there is no {compiler}")
    flags = [flag for flag in build._FLAGS if flag not in {"-w", "-shared", "-O3"}]
    wanted = ["-O1", "-march=native", "-Wall", "-Wextra", "-Werror", "-c"]
    folders = [f"-I{build.HERE}", f"-I{sysconfig.get_path('include')}"]
    for name, text in sources():
        (tmp_path / f"{name}.c").write_text(text, encoding="utf-8")
        command = [path, *flags, *wanted, *folders, f"{name}.c", "-o", f"{name}.o"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (name, done.stderr)


def test_sanitizers_find_nothing(tmp_path):
    gcc = shutil.which("gcc")
    if gcc is None or build.unavailable() or sys.platform != "linux":
        pytest.skip("there is no gcc with its sanitizers")
    found = subprocess.run([gcc, "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    library = found.stdout.strip()
    if not Path(library).is_absolute():
        pytest.skip("gcc has no AddressSanitizer here")
    environment = {
        **os.environ,
        "CC": gcc,
        "CIRCUITKIT_CACHE": str(tmp_path),
        "CIRCUITKIT_CFLAGS": "-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined",
        "LD_PRELOAD": library,
        "ASAN_OPTIONS": "detect_leaks=0",  # Python frees little at its end
        "PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parents[1])]),
    }
    command = [sys.executable, str(HERE / "sanitized.py"), str(CIRCUITS)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.endswith("clean\n"), done.stderr[-3000:]
