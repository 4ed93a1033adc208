"""C source to a loaded library by the system's compiler, or out of the cache of what it has made."""

from __future__ import annotations

import ctypes
import hashlib
import importlib.machinery
import importlib.util
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType

from circuitkit.base.errors import warn_once
from circuitkit.base.files import scratch
from circuitkit.base.reading import environment
from circuitkit.engine.backends.c.cache import cache_folder, find_library, keep_library

HERE = Path(__file__).parent
HEADERS = tuple(sorted(HERE.glob("*.h")))
_FLAGS = (
    "-std=gnu11",
    "-O3",
    "-fPIC",
    "-shared",
    "-w",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-tree-vectorize",  # vectors are written out: packed stores and gathered loads beyond them cost time
)
_NATIVE = "-march=native"
_LIMIT_S = 120.0  # for one source; a large circuit takes some seconds


class BuildError(Exception):
    """A library could not be made; the message says why."""


def unavailable() -> str:
    """Find why nothing can be compiled here; empty if it can."""
    if os.name != "posix":
        return f"the compiled backend knows no compiler of {platform.system()}"
    if not (Path(sysconfig.get_path("include")) / "Python.h").is_file():
        return "the headers of Python (Python.h) are not installed"
    try:
        _compiler()
    except BuildError as error:
        return str(error)
    return ""


def load_program(source: str) -> int:
    """Load address of the function `ck_work` of a source.

    Raises:
        BuildError: It cannot be compiled.
    """
    library = _library(source)
    return ctypes.cast(library.ck_work, ctypes.c_void_p).value or 0


@cache
def load_runtime() -> ModuleType:
    """Load the extension module made of `runtime.c`.

    Raises:
        BuildError: It cannot be compiled.
    """
    name = "circuitkit_runtime"
    flags = [f"-I{sysconfig.get_path('include')}", "-pthread"]
    if sys.platform == "darwin":
        flags += ["-undefined", "dynamic_lookup"]
    path = _built((HERE / "runtime.c").read_text(encoding="utf-8"), flags)
    loader = importlib.machinery.ExtensionFileLoader(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    try:
        module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]  # a loader is given: never None
        loader.exec_module(module)
    except ImportError as error:
        message = f"the runtime cannot be loaded: {error}"
        raise BuildError(message) from error
    return module


@cache
def _library(source: str) -> ctypes.CDLL:
    path = _built(source, ["-lm"])
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        message = f"the program cannot be loaded: {error}"
        raise BuildError(message) from error


def _built(source: str, flags: list[str]) -> Path:
    """Return the library of a source, from the cache if it is there."""
    if reason := unavailable():
        raise BuildError(reason)
    try:
        folder, key = cache_folder(), _key(source, flags)
        if (path := find_library(folder, key)) is not None:
            return path
        with scratch(folder, is_folder=True) as place:
            (place / "program.c").write_text(source, encoding="utf-8")
            _compile(place, "program.so", flags)
            return keep_library(folder, key, place / "program.so")
    except OSError as error:
        message = f"the cache cannot be used: {error}"
        raise BuildError(message) from error


def _key(source: str, flags: list[str]) -> str:
    headers = [path.read_text(encoding="utf-8") for path in HEADERS]
    parts = (
        source,
        *headers,
        *_FLAGS,
        *_words("CIRCUITKIT_CFLAGS"),
        *flags,
        *_compiler_identity(),
        _processor(),
        _abi(),
    )
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def _words(variable: str) -> list[str]:
    """The words of a variable as a shell, and with it make, reads them.

    Raises:
        BuildError: A quotation has no end.
    """
    text = environment(variable)
    try:
        return shlex.split(text)
    except ValueError as error:
        message = f"cannot read ${variable}: {error}; found '{text}'"
        raise BuildError(message) from error


def _compiler() -> list[str]:
    """Return the compiler's command: the words of `$CC`, of which the first exists, or a usual one.

    A path with spaces that has no quotation marks is taken as it is, if a program is there.

    Raises:
        BuildError: There is none.
    """
    chosen = environment("CC")
    whole = str(Path(chosen).expanduser()) if chosen else ""
    words = [whole] if whole and shutil.which(whole) else _words("CC")
    for first, *others in [words] if words else [["cc"], ["gcc"], ["clang"]]:
        if path := shutil.which(os.path.expanduser(first)):  # noqa: PTH111 - a name without a folder stays one
            return [os.path.abspath(path), *others]  # noqa: PTH100 - it runs in another folder; links stay
    looked = f"'{words[0]}', as $CC says" if words else "$CC, cc, gcc, clang"
    message = f"no C compiler was found (looked for {looked})"
    if words:
        warn_once(message)
    raise BuildError(message)


def _compiler_identity() -> Iterator[str]:
    """Changes when another compiler is installed, without running it; all programs that `$CC` names count."""
    for word in _compiler():
        yield word
        if path := shutil.which(word):
            found = Path(path).resolve().stat()
            yield from (str(found.st_size), str(found.st_mtime_ns))


@cache
def _processor() -> str:
    """Find which instructions `-march=native` may use."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as file:
            lines = file.read(8192).split("\n\n", maxsplit=1)[0].splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    named = ("model", "flags", "Features", "CPU ", "isa", "uarch")
    return "\n".join([platform.machine(), *(line for line in lines if line.startswith(named))])


def _abi() -> str:
    return f"{sys.version_info[:2]} {sysconfig.get_config_var('SOABI')}"


def _compile(folder: Path, target: str, flags: list[str]) -> None:
    """Run the compiler; once more without the flag that not all know, if it fails."""
    reason = ""
    compiler = _compiler()
    for native in ([_NATIVE], []):
        before = [*compiler, *_FLAGS, *native, *_words("CIRCUITKIT_CFLAGS")]
        command = [*before, f"-I{HERE}", "program.c", "-o", target, *flags]
        status, said = _run(command, folder)
        if status == 0 and (folder / target).is_file():
            return
        lines = sorted(said.strip().splitlines(), key=lambda line: "error" not in line)
        reason = next(iter(lines), f"exit status {status}")
    message = f"the compiler {shlex.join(compiler)} failed: {reason}"
    raise BuildError(message)


_hanging: set[str] = set()


def _run(command: list[str], folder: Path) -> tuple[int, str]:
    """Run a command in a folder, which also takes its temporary files: its exit status and complaints.

    It is ended with all processes that it started when it takes too long, and when this one is interrupted.

    Raises:
        BuildError: It took too long, now or earlier.
    """
    message = f"the compiler {command[0]} was ended after {_LIMIT_S:g} s without a result"
    if command[0] in _hanging:
        raise BuildError(message)
    with subprocess.Popen(
        command,
        cwd=folder,
        env={**os.environ, "TMPDIR": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            _, said = process.communicate(timeout=_LIMIT_S)
        except BaseException as error:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
            if not isinstance(error, subprocess.TimeoutExpired):
                raise
            _hanging.add(command[0])
            warn_once(message)
            raise BuildError(message) from error
    return process.returncode, said
