"""A folder of results holds one run, and says what else lies there."""

from __future__ import annotations

import json
import os

import pytest

from circuitkit.base.files import OutputError, write_text
from circuitkit.base.output_folder import MANIFEST, one_run


def run(folder, *names, fail=False, **more):
    """A run that writes files."""
    with one_run(folder, **more):
        for name in names:
            write_text(folder / name, f"{name} of {len(names)}")
        if fail:
            raise ZeroDivisionError


def names(folder):
    return sorted(str(each.relative_to(folder)) for each in folder.rglob("*") if each.is_file())


def test_what_the_run_before_left_goes_and_the_rest_is_named(tmp_path, caplog):
    run(tmp_path, "recording.nc", "video.mp4", "mpc/recording.nc")
    assert names(tmp_path) == [MANIFEST, "mpc/recording.nc", "recording.nc", "video.mp4"]
    assert not caplog.messages
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    run(tmp_path, "recording.nc", "path.png")
    assert names(tmp_path) == [MANIFEST, "notes.txt", "path.png", "recording.nc"]
    assert not (tmp_path / "mpc").exists()
    assert caplog.messages == [f"'{tmp_path}' also holds what this run did not write: notes.txt"]


def test_a_file_that_somebody_changed_is_theirs(tmp_path, caplog):
    run(tmp_path, "a", "b")
    (tmp_path / "b").write_text("cut for the talk", encoding="utf-8")
    run(tmp_path, "a")
    assert (tmp_path / "b").read_text(encoding="utf-8") == "cut for the talk"
    assert caplog.messages == [f"'{tmp_path}' also holds what this run did not write: b"]


def test_two_runs_at_once_do_not_share_a_folder(tmp_path):
    folder = tmp_path / "out"
    with one_run(folder):
        write_text(folder / "a", "first")
        with pytest.raises(OutputError, match="another run writes there"), one_run(folder):
            write_text(folder / "a", "second")
    assert (folder / "a").read_text(encoding="utf-8") == "first"
    with one_run(folder):
        write_text(folder / "a", "third")
    with one_run(tmp_path / "nothing"):
        pass
    assert not (tmp_path / "nothing").exists()


def test_a_run_that_writes_nothing_takes_nothing_away(tmp_path):
    run(tmp_path, "a", "b")
    run(tmp_path)
    with pytest.raises(ZeroDivisionError):
        run(tmp_path, fail=True)
    assert names(tmp_path) == ["a", "b", MANIFEST]


def test_a_run_that_fails_half_way_owns_what_it_wrote(tmp_path):
    run(tmp_path, "a", "b")
    with pytest.raises(ZeroDivisionError):
        run(tmp_path, "c", fail=True)
    assert names(tmp_path) == ["c", MANIFEST]
    run(tmp_path, "d")
    assert names(tmp_path) == ["d", MANIFEST]


def test_the_list_of_files_has_their_checksums(tmp_path):
    with one_run(tmp_path):
        write_text(tmp_path / "é", "abc")  # the sum is that of FIPS 180-2
    assert (tmp_path / MANIFEST).read_text(encoding="utf-8") == (
        '{\n "format": 1,\n "files": {\n'
        '  "é": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"\n }\n}\n'
    )


def test_files_that_a_run_knows_of_itself_are_not_listed(tmp_path, caplog):
    run(tmp_path, "db", own=["db"])  # nothing else: there is no list, before and afterwards
    assert names(tmp_path) == ["db"]
    run(tmp_path, "a", "db", own=["db"])
    assert set(json.loads((tmp_path / MANIFEST).read_text(encoding="utf-8"))["files"]) == {"a"}
    run(tmp_path, "db", own=["db"])
    assert names(tmp_path) == ["db"]
    assert not caplog.messages


def test_folders_in_the_folder_may_be_of_other_runs(tmp_path, caplog):
    (tmp_path / ".hidden").write_text("", encoding="utf-8")
    (tmp_path / "other").mkdir()
    run(tmp_path, "a", "sub/b", deep=False)
    assert set(json.loads((tmp_path / MANIFEST).read_text(encoding="utf-8"))["files"]) == {"a"}
    run(tmp_path, "c", deep=False)
    assert names(tmp_path) == [".hidden", "c", MANIFEST, "sub/b"]
    assert not caplog.messages
    run(tmp_path, "c")
    assert caplog.messages == [f"'{tmp_path}' also holds what this run did not write: other, sub"]


def test_a_run_that_goes_on_keeps_what_is_there(tmp_path, caplog):
    run(tmp_path, "a", "b")
    run(tmp_path, "c", resumed=True)
    assert names(tmp_path) == ["a", "b", "c", MANIFEST]
    assert not caplog.messages


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        '{"files": 3}',
        '{"files": {"../outside": "SUM"}}',
        '{"files": {"OUTSIDE": "SUM"}}',
    ],
)
def test_a_list_that_nobody_here_wrote_removes_nothing(tmp_path, text, caplog):
    folder, outside = tmp_path / "out", tmp_path / "outside"
    outside.write_text("", encoding="utf-8")
    folder.mkdir()
    (folder / "link").symlink_to(outside)
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    text = text.replace("SUM", empty).replace("OUTSIDE", str(outside))
    (folder / MANIFEST).write_text(text, encoding="utf-8")
    run(folder, "a")
    assert outside.exists()
    assert caplog.messages == [f"'{folder}' also holds what this run did not write: link"]
    assert set(json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["files"]) == {"a"}


def test_pipes_in_the_folder_are_not_waited_at(tmp_path, caplog):
    run(tmp_path, "a", "b")
    for name in (MANIFEST, "b"):
        (tmp_path / name).unlink()
        os.mkfifo(tmp_path / name)
    with pytest.raises(OutputError) as caught:
        run(tmp_path, "a")
    assert str(caught.value) == (
        f"cannot write '{tmp_path / MANIFEST}': it is no regular file; take it away, or name another folder"
    )
    (tmp_path / MANIFEST).unlink()
    (tmp_path / MANIFEST).write_text('{"format": 1, "files": {"b": ""}}', encoding="utf-8")
    run(tmp_path, "a")
    assert caplog.messages == [f"'{tmp_path}' also holds what this run did not write: b"]
