"""The folder of compiled libraries: they are run, so nobody but this user may be able to put one there.

A library is called `KEY-SUM.so`: KEY is the hash of everything that it depends on, SUM that of its own
content. So it appears with one renaming, several processes can make it at once, and a damaged one is noticed
before it is loaded.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from circuitkit.base.errors import InputError, warn_once
from circuitkit.base.files import reason
from circuitkit.base.reading import environment, open_file

_MAX_KEPT = 1000
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_DAY_S = 86400.0
_LOG = logging.getLogger("circuitkit")


def cache_folder() -> Path:
    """Return the folder of the cache, made if it is missing.

    It is that of the variable CIRCUITKIT_CACHE, or the user's own; where others could write to it, or this
    user cannot, one of the temporary folder, and a warning says why.

    Raises:
        OSError: There is none that is this user's alone.
    """
    chosen = environment("CIRCUITKIT_CACHE")
    try:
        folder = Path(chosen or _folder_of_user()).expanduser().absolute()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        problem = "" if os.access(folder, os.W_OK | os.X_OK) else "it cannot be written"
        untrusted = _distrusted(folder)
    except (OSError, RuntimeError, ValueError) as error:
        folder, problem, untrusted = Path(chosen), reason(error), ""
    if not problem and not untrusted:
        return folder
    private = _private_folder()
    if chosen or untrusted:
        warn_once(f"the cache '{folder}' is not used: {untrusted or problem}; '{private}' is used instead")
    return private


def _folder_of_user() -> Path:
    home = environment("XDG_CACHE_HOME")
    return (Path(home) if Path(home).is_absolute() else Path("~/.cache")) / "circuitkit"


def _private_folder() -> Path:
    folder = Path(tempfile.gettempdir()).absolute() / f"circuitkit-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.is_symlink() or (why := _distrusted(folder)):
        message = f"{folder} is not a folder of this user alone{'' if folder.is_symlink() else f': {why}'}"
        raise PermissionError(message)
    return folder


def _distrusted(folder: Path) -> str:
    """Say who else could put something into a folder, or a folder in its place; empty if nobody can.

    Above it, others may write where the sticky bit keeps them from renaming what is not theirs, as in `/tmp`.
    """
    own = folder.resolve()
    for each in (own, *own.parents):
        found = each.stat()
        if found.st_uid not in ({os.getuid()} if each == own else {os.getuid(), 0}):
            return f"'{each}' belongs to another user"
        sticky = each != own and found.st_mode & stat.S_ISVTX
        if found.st_mode & _OTHERS_WRITE and not sticky and not _is_of_own_group(found):
            return f"others can write to '{each}', which `chmod go-w` would end"
    return ""


def _is_of_own_group(found: os.stat_result) -> bool:
    """Whether only a group can write in which, as on many systems, there is nobody but its user."""
    import grp  # POSIX only, as are the lines that need it
    import pwd  # the same

    try:
        user, group = pwd.getpwuid(os.getuid()), grp.getgrgid(found.st_gid)
    except KeyError:
        return False
    alone = group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}
    return alone and not found.st_mode & stat.S_IWOTH


def find_library(folder: Path, key: str) -> Path | None:
    """Return the library of a key, if it is there as it was made, and by this user."""
    for path in folder.glob(f"{key}-*.so"):
        if path.stem == f"{key}-{_sum(path)}":
            os.utime(path)
            return path
        _LOG.warning("the compiled circuit %s in the cache is damaged; it is made anew", path)
        path.unlink(missing_ok=True)
    return None


def keep_library(folder: Path, key: str, made: Path) -> Path:
    """Put a library into the cache, and return where it is then."""
    made.chmod(0o700)
    path = folder / f"{key}-{_sum(made)}.so"
    made.replace(path)
    _prune(folder)
    return path


def _sum(path: Path) -> str:
    """Hash of what a file holds; empty if somebody else can change it, or it is none."""
    try:
        with open_file(path, "a compiled circuit", sys.maxsize) as file:
            found = os.fstat(file.fileno())
            if found.st_uid != os.getuid() or found.st_mode & _OTHERS_WRITE or path.is_symlink():
                return ""
            return hashlib.file_digest(file, "sha256").hexdigest()[:32]
    except (InputError, OSError):
        return ""


def _prune(folder: Path) -> None:
    """Remove what has not been used for longest, if there is much, and what earlier versions left behind."""
    kept = sorted(_with_age(folder, "*-*.so"))
    for _, path in kept[_MAX_KEPT:]:
        path.unlink(missing_ok=True)
    for age_s, path in _with_age(folder, "building-*"):
        if age_s > _DAY_S:
            shutil.rmtree(path, ignore_errors=True)


def _with_age(folder: Path, pattern: str) -> Iterator[tuple[float, Path]]:
    for path in folder.glob(pattern):
        try:
            yield time.time() - path.stat().st_mtime, path
        except OSError:  # another process was quicker
            continue
