"""A result is whole or not there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from circuitkit.base.files import OutputError, replacing, write_text


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
        OutputError, match=re.escape(f"cannot write '{tmp_path}': it is a folder; name a file in it")
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


def test_what_is_no_regular_file_is_written_directly():
    write_text(Path("/dev/null"), "text")
    assert not Path("/dev/null").is_file()
