"""How circuits are compiled and kept: a damaged cache, no compiler, no place to write, two at once."""

from __future__ import annotations

import logging
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from circuitkit.base.errors import warn_once
from circuitkit.circuit import load_circuit
from circuitkit.engine import compile_circuit, run
from circuitkit.engine.backends import compiled_backend, new_kernel
from circuitkit.engine.backends.c import build
from circuitkit.engine.backends.c.build import BuildError, load_program, unavailable
from circuitkit.engine.backends.c.cache import cache_folder
from circuitkit.engine.backends.compiled_backend import CompiledKernel
from circuitkit.engine.backends.numpy_backend import NumpyKernel

pytestmark = pytest.mark.skipif(bool(unavailable()), reason=unavailable())
SOURCE = '#include "context.h"\nint64_t ck_work(void) {{ return {}; }}\n'
WARNING = "{}; the circuit 'binn_lateral' is run by the numpy backend"
WORK = """
import sys
from circuitkit.engine.backends.c.build import load_program
print(*(load_program(open(name).read()) != 0 for name in sys.argv[1:]))
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, and none of the libraries that are loaded already."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("CIRCUITKIT_CACHE", str(folder))
    monkeypatch.setenv("CIRCUITKIT_CFLAGS", "-O1")
    build._library.cache_clear()
    return folder


@pytest.fixture
def no_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)


def result(source):
    """What the function of a source returns."""
    import ctypes

    return ctypes.CFUNCTYPE(ctypes.c_int64)(load_program(source))()


def libraries(folder):
    return sorted(path for path in folder.iterdir() if path.suffix == ".so")


def test_a_source_is_compiled_once_and_leaves_only_the_library(cache):
    assert result(SOURCE.format(1)) == 1
    (library,) = cache.iterdir()
    written = library.stat().st_ino
    build._library.cache_clear()
    assert result(SOURCE.format(1)) == 1
    assert [path.stat().st_ino for path in cache.iterdir()] == [written]
    assert result(SOURCE.format(2)) == 2
    assert len(libraries(cache)) == len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damage", ["cut short", "changed", "empty"])
def test_a_damaged_library_is_made_anew_and_not_loaded(cache, damage, caplog):
    load_program(SOURCE.format(3))
    (library,) = libraries(cache)
    content = library.read_bytes()
    library.unlink()  # it stays mapped into this process
    broken = {"cut short": content[:4000], "changed": content[:-1] + b"x", "empty": b""}[damage]
    library.write_bytes(broken)
    build._library.cache_clear()
    with caplog.at_level(logging.WARNING, "circuitkit"):
        assert result(SOURCE.format(3)) == 3
    assert f"the compiled circuit {library} in the cache is damaged; it is made anew" in caplog.text
    assert [path.read_bytes() for path in libraries(cache)] == [content]


@pytest.mark.usefixtures("cache", "no_compiler")
def test_without_a_compiler_numpy_does_the_same_and_says_so(caplog):
    reason = "no C compiler was found (looked for $CC, cc, gcc, clang)"
    assert unavailable() == reason
    for backend, warnings in (("auto", []), ("compiled", [WARNING.format(reason)])):
        with caplog.at_level(logging.WARNING, "circuitkit"):
            program = compile_circuit(load_circuit("binn_lateral"), backend=backend)
        assert caplog.messages == warnings
        assert (program.backend, program.note) == ("numpy", f"backend numpy: {reason}")
        assert not isinstance(new_kernel(program, 1), CompiledKernel)


@pytest.mark.usefixtures("cache")
def test_a_mistake_in_the_making_of_the_c_leads_to_numpy(monkeypatch, caplog):
    before = compile_circuit(load_circuit("binn_lateral"), backend="compiled")

    def mistaken(*_):
        return {}["row 7"]

    monkeypatch.setattr(compiled_backend, "print_program", mistaken)
    reason = "internal error of the compiled backend, KeyError: 'row 7'"
    assert compiled_backend.build_kernel(before, 1) == reason
    with caplog.at_level(logging.WARNING, "circuitkit"):
        assert isinstance(new_kernel(before, 1), NumpyKernel)
        for backend in ("auto", "compiled"):
            program = compile_circuit(load_circuit("binn_lateral"), backend=backend)
            assert (program.backend, program.note) == ("numpy", f"backend numpy: {reason}")
    assert caplog.messages == [WARNING.format(reason)] * 2


@pytest.mark.usefixtures("cache")
def test_without_the_headers_of_python_numpy_is_taken(monkeypatch, tmp_path):
    monkeypatch.setattr("sysconfig.get_path", lambda _: str(tmp_path))
    assert unavailable() == "the headers of Python (Python.h) are not installed"


def test_a_compiler_that_fails_is_named_with_its_first_complaint(cache, tmp_path, monkeypatch):
    compiler = tmp_path / "mycc"
    compiler.write_text("#!/bin/sh\necho 'out of disk' >&2\nexit 1\n", encoding="utf-8")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    with pytest.raises(BuildError, match=f"the compiler {compiler} failed: out of disk"):
        load_program(SOURCE.format(4))
    assert not list(cache.iterdir())
    program = compile_circuit(load_circuit("binn_lateral"), backend="auto")
    assert program.note == f"backend numpy: the compiler {compiler} failed: out of disk"


def test_a_full_disk_leads_to_numpy(cache, monkeypatch):
    def full(*_args, **_more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(build, "scratch", full)
    with pytest.raises(BuildError, match=r"the cache cannot be used: .*No space left on device"):
        load_program(SOURCE.format(5))
    assert not list(cache.iterdir())


def test_a_cache_that_cannot_be_written_is_replaced_by_a_folder_of_the_users_own(tmp_path, monkeypatch):
    monkeypatch.setenv("CIRCUITKIT_CACHE", "/proc/no/such/folder")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    build._library.cache_clear()
    assert result(SOURCE.format(6)) == 6
    (folder,) = tmp_path.iterdir()
    assert folder.name == f"circuitkit-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)  # now somebody else could have put something there
    build._library.cache_clear()
    with pytest.raises(BuildError, match="is not a folder of this user alone"):
        load_program(SOURCE.format(6))


def test_two_processes_at_once_do_not_harm_each_other(cache, tmp_path):
    names = []
    for i in range(4):
        names.append(tmp_path / f"{i}.c")
        names[-1].write_text(SOURCE.format(i), encoding="utf-8")
    command = [sys.executable, "-c", WORK, *map(str, names)]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate(timeout=60)[0] for process in started] == ["True True True True\n"] * 2
    assert [process.returncode for process in started] == [0, 0]
    keys = {path.stem.split("-")[0] for path in libraries(cache)}
    assert len(keys) == 4
    assert len(list(cache.iterdir())) == len(libraries(cache))


def test_the_oldest_libraries_go_when_there_are_many(cache, monkeypatch):
    monkeypatch.setattr("circuitkit.engine.backends.c.cache._MAX_KEPT", 2)
    for i in range(3):
        load_program(SOURCE.format(10 + i))
        for age, path in enumerate(libraries(cache)):
            os.utime(path, ns=(0, path.stat().st_mtime_ns - 10**9 * (age + 1)))
    assert len(libraries(cache)) == 2


def test_flags_compiler_and_processor_are_part_of_the_key(cache, monkeypatch):
    load_program(SOURCE.format(7))
    monkeypatch.setenv("CIRCUITKIT_CFLAGS", "-O0")
    build._library.cache_clear()
    load_program(SOURCE.format(7))
    assert len(libraries(cache)) == 2
    monkeypatch.setattr(build, "_processor", lambda: "another one")
    build._library.cache_clear()
    load_program(SOURCE.format(7))
    assert len(libraries(cache)) == 3


def test_the_binn_is_built_within_3_s_and_found_again_within_100_ms(cache, monkeypatch):
    monkeypatch.delenv("CIRCUITKIT_CFLAGS")
    build.load_runtime.cache_clear()
    program = compile_circuit(load_circuit("binn_lateral"), backend="numpy")
    times = []
    for _ in range(2):
        start = time.perf_counter()
        assert isinstance(CompiledKernel(program, 1), CompiledKernel)
        times.append(time.perf_counter() - start)
        build._library.cache_clear()
    assert times[0] < 3.0
    assert times[1] < 0.1
    assert len(libraries(cache)) == 2  # the runtime and the circuit


@pytest.mark.usefixtures("cache")
@pytest.mark.parametrize("text", ["abc", "-1", "0"])
def test_numbers_of_threads_without_sense_are_passed_over_with_a_warning(monkeypatch, caplog, text):
    monkeypatch.setenv("CIRCUITKIT_THREADS", text)
    program = compile_circuit(load_circuit("binn_lateral"), backend="compiled")
    with caplog.at_level(logging.WARNING, "circuitkit"):
        for _ in range(2):
            assert isinstance(new_kernel(program, 1), CompiledKernel)
    assert caplog.messages == [
        f"CIRCUITKIT_THREADS is passed over: found '{text}'; allowed: whole numbers from 1"
    ]


def test_a_forked_process_can_use_threads_too(monkeypatch, tmp_path):
    """Worker threads do not follow into a fork; they are made anew."""
    monkeypatch.setenv("CIRCUITKIT_THREADS", "2")
    monkeypatch.setenv("CIRCUITKIT_CFLAGS", "-O1")
    program = compile_circuit(load_circuit("binn_lateral"), backend="compiled")
    inputs = np.random.default_rng(0).normal(size=(5, 100, 2))
    wanted = run(program, inputs).readout
    script = Path(tmp_path) / "fork.py"
    script.write_text(
        "import os, numpy as np\n"
        "from circuitkit import compile_circuit, load_circuit, run\n"
        "program = compile_circuit(load_circuit('binn_lateral'), backend='compiled')\n"
        "inputs = np.random.default_rng(0).normal(size=(5, 100, 2))\n"
        "run(program, inputs)\n"
        "child = os.fork()\n"
        "total = run(program, inputs).readout.sum()\n"
        "if child:\n"
        "    assert os.waitpid(child, 0)[1] == 0\n"
        "    print(repr(float(total)))\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.strip() == repr(float(wanted.sum())), done.stderr


@pytest.mark.parametrize("how", ["words", "flag", "path with spaces", "quoted path", "home", "here"])
@pytest.mark.usefixtures("cache")
def test_the_compiler_is_what_make_would_run(tmp_path, monkeypatch, how):
    """A compiler that notes its arguments, as `ccache` does its cache."""
    folder = tmp_path / "a folder"
    folder.mkdir()
    own = folder / "my cc"
    own.write_text(
        f'#!/bin/sh\necho "$@" >>"{tmp_path}/called"\ncase $1 in gcc) shift;; esac\nexec gcc "$@"\n'
    )
    own.chmod(0o755)
    monkeypatch.setenv("HOME", str(folder))
    chosen = {
        "words": f"'{own}' gcc",
        "flag": f"'{own}' -m64 -DNAME='a b'",
        "path with spaces": str(own),
        "quoted path": f'"{own}"',
        "home": "'~/my cc'",
        "here": "'./my cc'",
    }[how]
    monkeypatch.chdir(folder)
    monkeypatch.setenv("CC", chosen)
    assert result(SOURCE.format(20)) == 20
    called = (tmp_path / "called").read_text()
    assert called.startswith({"words": "gcc -std", "flag": "-m64 -DNAME=a b -std"}.get(how, "-std"))


@pytest.mark.usefixtures("cache")
@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ("nothing -m64", "no C compiler was found (looked for 'nothing', as $CC says)"),
        ("gcc 'x", "cannot read $CC: No closing quotation; found 'gcc 'x'"),
    ],
)
def test_a_compiler_that_is_not_there_is_named_and_no_other_is_taken(monkeypatch, chosen, said):
    monkeypatch.setenv("CC", chosen)
    with pytest.raises(BuildError, match=f"^{re.escape(said)}$"):
        load_program(SOURCE.format(21))


def test_a_compiler_that_hangs_is_ended_with_its_children_and_not_tried_again(
    cache, tmp_path, monkeypatch, caplog
):
    hanging = tmp_path / "hang"
    hanging.write_text(f"#!/bin/sh\nsleep 600 &\necho $! >>{tmp_path}/children\nwait\n")
    hanging.chmod(0o755)
    monkeypatch.setenv("CC", str(hanging))
    monkeypatch.setattr(build, "_LIMIT_S", 0.5)
    for _ in range(2):
        with pytest.raises(BuildError, match=r"hang was ended after 0.5 s without a result$"):
            load_program(SOURCE.format(22))
    (child,) = (tmp_path / "children").read_text().split()
    state = Path(f"/proc/{child}/stat")
    assert not state.exists() or state.read_text().split()[2] == "Z"
    assert caplog.messages == [f"the compiler {hanging} was ended after 0.5 s without a result"]
    assert not list(cache.iterdir())


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_process_that_is_ended_while_it_compiles_leaves_nothing(cache, tmp_path, monkeypatch, number):
    hanging = tmp_path / "hang"
    hanging.write_text(f"#!/bin/sh\necho half >program.so\ntouch {tmp_path}/begun\nexec sleep 600\n")
    hanging.chmod(0o755)
    monkeypatch.setenv("CC", str(hanging))
    (tmp_path / "a.c").write_text(SOURCE.format(23), encoding="utf-8")
    words = [sys.executable, "-c", WORK, str(tmp_path / "a.c")]
    with subprocess.Popen(words, stderr=subprocess.DEVNULL) as process:
        while not (tmp_path / "begun").exists():
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(number)
        assert process.wait(timeout=20) == -number
    assert not list(cache.iterdir())


@pytest.mark.parametrize("how", ["mode", "owner", "parent", "owner of the parent", "a file"])
def test_a_cache_in_which_others_can_put_something_is_not_used(tmp_path, monkeypatch, caplog, how):
    """`chown` needs root."""
    if "owner" in how and os.getuid() != 0:
        pytest.skip("needs root")
    parent = tmp_path / "parent"
    folder, private = parent / "cache", tmp_path / "private"
    if how == "a file":
        parent.mkdir()
        folder.write_text("", encoding="utf-8")
    else:
        folder.mkdir(parents=True)
    private.mkdir()
    target = parent if "parent" in how else folder
    if "owner" in how:
        os.chown(target, 12345, -1)
    elif how != "a file":
        target.chmod(0o777)
    monkeypatch.setenv("CIRCUITKIT_CACHE", str(folder))
    monkeypatch.setattr("tempfile.tempdir", str(private))
    warn_once.cache_clear()
    build._library.cache_clear()
    for i in range(2):
        assert result(SOURCE.format(30 + i)) == 30 + i
    (said,) = caplog.messages
    assert said.startswith(f"the cache '{folder}' is not used: ")
    assert said.endswith(f"'{private}/circuitkit-{os.getuid()}' is used instead")
    assert how == "a file" or not list(folder.iterdir())


def test_a_folder_above_in_which_all_may_write_is_safe_if_it_is_sticky(tmp_path, monkeypatch, caplog):
    (tmp_path / "parent").mkdir()
    (tmp_path / "parent").chmod(0o1777)
    build._library.cache_clear()
    monkeypatch.setenv("CIRCUITKIT_CACHE", str(tmp_path / "parent" / "cache"))
    assert result(SOURCE.format(40)) == 40
    assert libraries(tmp_path / "parent" / "cache")
    assert not caplog.messages


@pytest.mark.parametrize("how", ["mode", "owner", "link"])
def test_a_library_that_somebody_else_can_change_is_not_loaded(cache, tmp_path, caplog, how):
    if how == "owner" and os.getuid() != 0:
        pytest.skip("needs root")
    load_program(SOURCE.format(41))
    (library,) = libraries(cache)
    if how == "mode":
        library.chmod(0o777)
    elif how == "owner":
        os.chown(library, 12345, -1)
    else:
        library.rename(tmp_path / "elsewhere")
        library.symlink_to(tmp_path / "elsewhere")
    build._library.cache_clear()
    assert result(SOURCE.format(41)) == 41
    assert caplog.messages == [f"the compiled circuit {library} in the cache is damaged; it is made anew"]
    assert libraries(cache)[0].stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("text", ["~/cache", "relative/cache", ""])
def test_names_of_the_cache_folder_are_those_of_a_shell(tmp_path, monkeypatch, text):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CIRCUITKIT_CACHE", text)
    wanted = {"~/cache": "cache", "relative/cache": "relative/cache", "": ".cache/circuitkit"}[text]
    assert cache_folder() == tmp_path / wanted
    assert (tmp_path / wanted).stat().st_mode & 0o777 == 0o700
