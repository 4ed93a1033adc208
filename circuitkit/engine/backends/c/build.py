"""C source to a loaded library: the system's compiler, and a cache of what it has made.

A library is called `KEY-SUM.so`: KEY is the hash of everything that it depends on, SUM that of its own
content. So it appears with one renaming, several processes can make it at once, and a damaged one is noticed
before it is loaded.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.machinery
import importlib.util
import logging
import os
import platform
import shutil
import stat
import subprocess
import sys
import sysconfig
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

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
_MAX_KEPT = 1000
_LOG = logging.getLogger("circuitkit")


class BuildError(Exception):
    """A library could not be made; the message says why."""


def unavailable() -> str:
    """Find why nothing can be compiled here; empty if it can."""
    if os.name != "posix":
        return f"the compiled backend knows no compiler of {platform.system()}"
    if not (Path(sysconfig.get_path("include")) / "Python.h").is_file():
        return "the headers of Python (Python.h) are not installed"
    if _compiler() is None:
        return "no C compiler was found (looked for $CC, cc, gcc, clang)"
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
        folder = _cache_folder()
        key = _key(source, flags)
        return _found(folder, key) or _compiled(folder, key, source, flags)
    except OSError as error:
        message = f"the cache cannot be used: {error}"
        raise BuildError(message) from error


def _cache_folder() -> Path:
    """Return the folder of the cache; one of the temporary folder if it cannot be written."""
    chosen = os.environ.get("CIRCUITKIT_CACHE")
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(chosen) if chosen else Path(home).expanduser() / "circuitkit"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
    except (OSError, RuntimeError):
        pass
    return _private_folder()


def _private_folder() -> Path:
    """Make a folder of the user's own: what lies there is run, so nobody else may write to it."""
    folder = Path(tempfile.gettempdir()) / f"circuitkit-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if found.st_uid != os.getuid() or not stat.S_ISDIR(found.st_mode) or found.st_mode & 0o022:
        message = f"{folder} is not a folder of this user alone"
        raise PermissionError(message)
    return folder


def _key(source: str, flags: list[str]) -> str:
    headers = [path.read_text(encoding="utf-8") for path in HEADERS]
    parts = (source, *headers, *_FLAGS, *_more_flags(), *flags, *_compiler_identity(), _processor(), _abi())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def _more_flags() -> list[str]:
    return os.environ.get("CIRCUITKIT_CFLAGS", "").split()


def _compiler() -> str | None:
    """Return path of the compiler."""
    names = (*os.environ.get("CC", "").split()[:1], "cc", "gcc", "clang")
    return next((path for name in names if (path := shutil.which(name))), None)


def _compiler_identity() -> tuple[str, ...]:
    """Changes when another compiler is installed, without running it."""
    path = Path(_compiler() or "").resolve()
    found = path.stat()
    return str(path), str(found.st_size), str(found.st_mtime_ns)


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


def _found(folder: Path, key: str) -> Path | None:
    """Return the library of a key, if it is whole."""
    for path in folder.glob(f"{key}-*.so"):
        if path.stem == f"{key}-{_sum(path)}":
            os.utime(path)
            return path
        _LOG.warning("the compiled circuit %s in the cache is damaged; it is made anew", path)
        path.unlink(missing_ok=True)
    return None


def _sum(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:32]
    except OSError:
        return ""


def _compiled(folder: Path, key: str, source: str, flags: list[str]) -> Path:
    with tempfile.TemporaryDirectory(prefix="building-", dir=folder) as name:
        made = Path(name) / "program.so"
        (Path(name) / "program.c").write_text(source, encoding="utf-8")
        _compile(Path(name), made.name, flags)
        path = folder / f"{key}-{_sum(made)}.so"
        made.replace(path)
    _prune(folder)
    return path


def _compile(folder: Path, target: str, flags: list[str]) -> None:
    """Run the compiler; once more without the flag that not all know, if it fails."""
    reason = ""
    for native in ([_NATIVE], []):
        before = [_compiler() or "cc", *_FLAGS, *native, *_more_flags()]
        command = [*before, f"-I{HERE}", "program.c", "-o", target, *flags]
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", check=False
        )
        if done.returncode == 0 and (folder / target).is_file():
            return
        lines = sorted(done.stderr.strip().splitlines(), key=lambda line: "error" not in line)
        reason = next(iter(lines), f"exit status {done.returncode}")
    message = f"the compiler {command[0]} failed: {reason}"
    raise BuildError(message)


def _prune(folder: Path) -> None:
    """Remove what has not been used for longest, if there is much."""
    kept = sorted(folder.glob("*-*.so"), key=lambda path: path.stat().st_mtime_ns, reverse=True)
    for path in kept[_MAX_KEPT:]:
        path.unlink(missing_ok=True)
