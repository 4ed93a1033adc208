"""A result is whole or not there."""

from __future__ import annotations

import errno
import os
import re
import secrets
import signal
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from circuitkit.base import files
from circuitkit.base.errors import InputError
from circuitkit.base.files import (
    SEAL,
    DamagedFileError,
    OutputError,
    make_folder,
    replacing,
    scratch,
    seal,
    verified,
    write_text,
)

_IMPORTS = "from pathlib import Path; from circuitkit.base.files import write_text"


def test_missing_folders_are_made(tmp_path):
    write_text(tmp_path / "a" / "b" / "text.txt", "α\n")
    assert (tmp_path / "a" / "b" / "text.txt").read_text(encoding="utf-8") == "α\n"
    assert list((tmp_path / "a" / "b").iterdir()) == [tmp_path / "a" / "b" / "text.txt"]


def test_an_older_file_stays_whole_until_the_new_one_is(tmp_path):
    path = tmp_path / "text.txt"
    path.write_text("old", encoding="utf-8")
    with replacing(path) as part:
        part.write_text("new", encoding="utf-8")
        assert path.read_text(encoding="utf-8") == "old"
        assert part.suffix == ".txt"
        assert part.parent == tmp_path
    assert path.read_text(encoding="utf-8") == "new"


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_nothing_half_written_stays_behind(tmp_path, error):
    path = tmp_path / "text.txt"
    path.write_text("old", encoding="utf-8")

    def write() -> None:
        with replacing(path) as part:
            part.write_text("half", encoding="utf-8")
            raise error

    with pytest.raises(error):
        write()
    assert path.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_keeps_pointing_to_what_is_written(tmp_path):
    (tmp_path / "real.txt").write_text("old", encoding="utf-8")
    (tmp_path / "link.txt").symlink_to("real.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text(encoding="utf-8") == "new"


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(
        OutputError, match=re.escape(f"cannot write '{tmp_path}': it is a folder; name a file in it") + "$"
    ):
        write_text(tmp_path, "text")


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    path = tmp_path / "file" / "text.txt"
    with pytest.raises(OutputError, match=rf"^cannot write '{re.escape(str(path))}': 'file' is no folder$"):
        write_text(path, "text")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_named():
    with pytest.raises(OutputError, match=r"^cannot write '/dev/full': No space left on device$"):
        write_text(Path("/dev/full"), "text")


def test_what_is_no_regular_file_is_written_directly(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    opened = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text(tmp_path / "pipe", "text")
    assert os.read(opened, 9) == b"text"
    os.close(opened)
    assert (tmp_path / "pipe").is_fifo()


def test_text_is_utf_8_with_plain_line_ends_whatever_the_locale(tmp_path):
    script = f"{_IMPORTS}; write_text(Path('f'), '\\u03b1\\n')"
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, check=True)
    assert (tmp_path / "f").read_bytes() == "α\n".encode()


@pytest.mark.parametrize("mode", [0o600, 0o644, 0o664, 0o755])
def test_permissions_of_a_file_that_is_there_are_kept(tmp_path, mode):
    path = tmp_path / "f"
    path.write_text("old", encoding="utf-8")
    path.chmod(mode)
    write_text(path, "new")
    assert (path.read_text(encoding="utf-8"), path.stat().st_mode & 0o7777) == ("new", mode)


@pytest.mark.parametrize("mask", [0o022, 0o002, 0o077])
def test_a_new_file_has_the_permissions_that_the_user_wants_for_files(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_text(tmp_path / "f", "new")
    finally:
        os.umask(before)
    assert (tmp_path / "f").stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_file_is_on_the_disk_before_it_has_its_name_and_then_the_name_is(tmp_path, monkeypatch):
    done = []
    sync, replace = os.fsync, Path.replace

    def synced(opened):
        done.append("folder" if stat.S_ISDIR(os.fstat(opened).st_mode) else "file")
        sync(opened)

    def renamed(path, target):
        done.append("renamed")
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", renamed)
    write_text(tmp_path / "f", "text")
    assert done == ["file", "renamed", "folder"]


@pytest.mark.parametrize(
    ("number", "is_told"), [(errno.EINVAL, False), (errno.ENOTSUP, False), (errno.EIO, True)]
)
def test_a_disk_that_fails_is_told_and_a_file_system_without_sync_is_not(
    tmp_path, monkeypatch, number, is_told
):
    def fails(_: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fails)
    path = tmp_path / "f"
    if not is_told:
        write_text(path, "text")
        return
    with pytest.raises(OutputError) as caught:
        write_text(path, "text")
    assert str(caught.value) == f"cannot write '{path}': {os.strerror(number)}"
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for folder in (tmp_path / "file", tmp_path / "file" / "a"):
        with pytest.raises(OutputError) as caught:
            make_folder(folder)
        assert str(caught.value) == f"cannot write to '{folder}': 'file' is no folder"


def test_a_result_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match=r": there is no such file; allowed: what was written here$"):
        verified(tmp_path / "f", "")


def test_threads_that_write_the_same_file_do_not_disturb_each_other(tmp_path):
    path = tmp_path / "f"
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda i: write_text(path, f"{i}" * 100_000), range(1, 10)))
    text = path.read_text(encoding="utf-8")
    assert text == text[0] * 100_000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["x" * 255, "a%d{}b.txt", "-x.txt", "[a]*?.txt", "ä ö\n$é.txt", "a.b" * 60])
def test_any_name_that_a_file_can_have_can_be_written(tmp_path, name):
    write_text(tmp_path / name, "text")
    assert [each.name for each in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", ["x" * 300, "a\0b", "loop"])
def test_a_name_that_no_file_can_have_is_an_error_that_says_so(tmp_path, name):
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(OutputError, match=r"^cannot write '.*': \w"):
        write_text(tmp_path / name, "text")


_WRITING = """
import os, sys, time
from pathlib import Path
from circuitkit.base.files import replacing, scratch
def say(_):
    print("writing", flush=True)
    time.sleep(60)
if sys.argv[1] == "file":
    with replacing(Path("f.txt")) as part:
        part.write_text("half")
        say(part)
with scratch(Path(), is_folder=True) as folder:
    (folder / "program.c").write_text("half")
    say(folder)
"""


@pytest.mark.parametrize("what", ["file", "folder"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGKILL])
def test_a_process_that_is_ended_while_it_writes_leaves_nothing_or_the_next_takes_it_away(
    tmp_path, what, number
):
    (tmp_path / "f.txt").write_text("old", encoding="utf-8")
    words = [sys.executable, "-c", _WRITING, what]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(words, cwd=tmp_path, **pipes, text=True) as running:
        assert running.stdout.readline() == "writing\n"
        assert len(list(tmp_path.iterdir())) == 2
        other = [sys.executable, "-c", f"{_IMPORTS}; write_text(Path('g'), '')"]
        subprocess.run(other, cwd=tmp_path, check=True)
        assert len(list(tmp_path.iterdir())) == 3, "what is being written is no left-over"
        running.send_signal(number)
        assert running.wait(timeout=30) == -number
    if number == signal.SIGKILL:
        assert len(list(tmp_path.iterdir())) == 3
        subprocess.run(other, cwd=tmp_path, check=True)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["f.txt", "g"]
    assert (tmp_path / "f.txt").read_text(encoding="utf-8") == "old"


@pytest.mark.parametrize("twice", [False, True])
def test_in_the_command_line_being_ended_while_writing_is_an_exit_code_and_leaves_nothing(tmp_path, twice):
    (tmp_path / "f.txt").write_text("old", encoding="utf-8")
    first = "from circuitkit.base.signals import tidy_up_when_ended; tidy_up_when_ended()"
    words = [sys.executable, "-c", first + _WRITING, "file"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(words, cwd=tmp_path, **pipes, text=True) as running:
        assert running.stdout.readline() == "writing\n"
        running.send_signal(signal.SIGTERM)
        if twice:
            running.send_signal(signal.SIGHUP)
        assert running.wait(timeout=30) in ({143, 129} if twice else {143})
    assert [each.name for each in tmp_path.iterdir()] == ["f.txt"]
    assert (tmp_path / "f.txt").read_text(encoding="utf-8") == "old"


def test_files_of_others_that_look_like_ours_stay(tmp_path):
    for name in (".part", ".circuitkit-notes.part", ".circuitkit-12345678.part.bak.txt", "a.part"):
        (tmp_path / name).write_text("", encoding="utf-8")
    write_text(tmp_path / "f", "text")
    assert len(list(tmp_path.iterdir())) == 5


@pytest.mark.skipif(sys.platform == "win32", reason="needs locks")
@pytest.mark.parametrize("is_folder", [False, True])
def test_what_is_being_written_is_locked_and_what_is_not_is_a_left_over(tmp_path, is_folder):
    fcntl = pytest.importorskip("fcntl")
    (tmp_path / ".circuitkit-0123abcd.part.txt").write_text("killed", encoding="utf-8")
    (tmp_path / ".circuitkit-89ef0123.part").mkdir()
    (tmp_path / ".circuitkit-89ef0123.part" / "program.c").write_text("killed", encoding="utf-8")
    (tmp_path / ".circuitkit-0000abcd.part").symlink_to(tmp_path / "notes")
    (tmp_path / "notes").write_text("mine", encoding="utf-8")
    with scratch(tmp_path, ".txt", is_folder=is_folder) as made:
        assert re.fullmatch(r"\.circuitkit-[0-9a-f]{8}\.part\.txt", made.name)
        assert sorted(tmp_path.iterdir()) == sorted(
            [made, tmp_path / "notes", tmp_path / ".circuitkit-0000abcd.part"]  # a link is nobody's left-over
        )
        if is_folder:
            assert made.stat().st_mode & 0o777 == 0o700
        opened = os.open(made, os.O_RDONLY)
        with pytest.raises(BlockingIOError):
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
        os.close(opened)
        files._take_away_leftovers.cache_clear()
        write_text(tmp_path / "f", "")
        assert made.exists()
    assert not made.exists()


@pytest.mark.parametrize("is_folder", [False, True])
def test_a_temporary_name_that_somebody_has_is_not_taken(tmp_path, monkeypatch, is_folder):
    names = iter(["01234567", "01234567", "89abcdef"])
    monkeypatch.setattr(secrets, "token_hex", lambda _: next(names))
    with scratch(tmp_path) as first, scratch(tmp_path, is_folder=is_folder) as second:
        assert (first.name, second.name) == (".circuitkit-01234567.part", ".circuitkit-89abcdef.part")


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs the files of proc(5)")
def test_nothing_stays_open(tmp_path):
    write_text(tmp_path / "f", "")
    before = list(Path("/proc/self/fd").iterdir())
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / ".circuitkit-0123abcd.part").write_text("killed", encoding="utf-8")
    write_text(tmp_path / "a" / "f", "")
    write_text(tmp_path / "f", "")
    assert len(list(Path("/proc/self/fd").iterdir())) == len(before)


def test_a_file_without_a_seal_is_told_from_a_damaged_one(tmp_path):
    path = tmp_path / "f"
    path.write_text("nothing", encoding="utf-8")
    with pytest.raises(DamagedFileError) as caught:
        verified(path, "make it again")
    assert str(caught.value) == f"'{path}' is damaged: it has no checksum; make it again"
    path.write_text(f"{SEAL} {SEAL}", encoding="utf-8")
    with pytest.raises(DamagedFileError) as caught:
        verified(path, "make it again")
    assert str(caught.value) == (
        f"'{path}' is damaged: its bytes are not those that were written; make it again"
    )


def test_each_flipped_bit_of_a_sealed_file_is_told(tmp_path):
    path = tmp_path / "f"
    path.write_text(f'{{"checksum": "{SEAL}", "value": 1.5}}', encoding="utf-8")
    seal(path)
    content = path.read_bytes()
    assert verified(path, "") == content
    for place in range(8 * len(content)):
        broken = bytearray(content)
        broken[place // 8] ^= 1 << place % 8
        path.write_bytes(broken)
        with pytest.raises(DamagedFileError, match=r"' is damaged: .*; make it again$"):
            verified(path, "make it again")
