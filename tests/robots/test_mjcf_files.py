"""The files of an MJCF are looked at before MuJoCo opens them, wherever and however they are named."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from circuitkit.base.errors import InputError
from circuitkit.robots.mjcf_files import Attribute, files_of, require_files


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    os.mkfifo("pipe.obj")
    os.mkfifo("sub/deep.obj")
    Path("dirs.xml").write_text('<mujoco><compiler meshdir="sub"/></mujoco>')


def test_a_folder_that_an_included_file_tells_counts_for_names_before_it():
    Path("m.xml").write_text(
        '<mujoco>\n<asset><mesh file="deep.obj"/></asset>\n<include file="dirs.xml"/></mujoco>'
    )
    with pytest.raises(InputError, match=r"^m\.xml:2:20: file: found a named pipe; allowed: a regular file$"):
        require_files(Path("m.xml"))


@pytest.mark.parametrize(
    "text",
    [
        '<mujoco><mesh\nfile="pipe.obj">',  # not closed
        '<mujoco>" a=\'<mesh\nfile="pipe.obj"/>',
        "<mujoco><text a=\"it's &undefined;\"/><mesh\nfile='pipe.obj'/></mujoco>",
        '<mujoco><mesh\nfile="p&#105;pe.obj"/></mujoco>',
        '<mujoco><mesh\nfile="/elsewhere/pipe.obj"/></mujoco>',  # strippath
    ],
)
def test_no_way_of_writing_hides_a_file(text):
    Path("m.xml").write_text(text)
    with pytest.raises(InputError, match=r"^m\.xml:2:7: file: found a named pipe; allowed: a regular file$"):
        require_files(Path("m.xml"))


def test_what_is_no_file_to_mujoco_is_not_looked_at():
    Path("m.xml").write_text('<mujoco><!-- <mesh file="pipe.obj"/> --><text name="pipe.obj"/></mujoco>')
    require_files(Path("m.xml"))


def test_text_that_is_not_printable_is_told_in_the_file_itself():
    Path("sub/in.xml").write_bytes(b"<mujoco>\n<!-- \x9b --></mujoco>")
    Path("m.xml").write_text('<mujoco><include file="sub/in.xml"/></mujoco>')
    with pytest.raises(InputError, match=r"^sub/in\.xml:2:6: found the byte 0x9b, which is no UTF-8"):
        require_files(Path("m.xml"))


def test_files_that_include_each_other_are_there_once():
    Path("a.xml").write_text('<mujoco><include file="b.xml"/></mujoco>')
    Path("b.xml").write_text('<mujoco><include file="a.xml"/><include file="./b.xml"/></mujoco>')
    assert [str(each.path) for each in files_of(Path("a.xml"))] == ["a.xml", "b.xml"]


def test_text_that_is_not_printable_is_told_in_the_mjcf_too():
    Path("m.xml").write_bytes("<mujoco>\n<!-- \u200b --></mujoco>".encode())
    with pytest.raises(InputError, match=r"^m\.xml:2:6: found the invisible character U\+200B"):
        require_files(Path("m.xml"))
    with pytest.raises(InputError, match=r"^n\.xml:1:1: there is no such file; allowed: the path of an MJCF"):
        require_files(Path("n.xml"))


def test_each_file_says_which_one_names_it_and_how():
    Path("m.xml").write_text(
        '<mujoco><include file="dirs.xml"/><asset><model name="b" file="sub/b.xml"/>'
        '<mesh file="c.obj"/></asset></mujoco>'
    )
    Path("sub/b.xml").write_text("<mujoco/>")
    Path("sub/c.obj").write_text("v 0 0 0")
    files = {each.path.name: each for each in files_of(Path("m.xml"))}
    assert {name: each.title(Path()) for name, each in files.items()} == {
        "m.xml": "m.xml",
        "dirs.xml": "dirs.xml, which m.xml includes",
        "b.xml": "sub/b.xml, which m.xml attaches",
        "c.obj": "sub/c.obj, which m.xml loads",
    }
    assert (files["c.obj"].content, files["b.xml"].content) == (b"", b"<mujoco/>")


def test_an_attribute_has_a_place_and_one_that_is_not_there_has_the_first():
    Path("m.xml").write_text('<mujoco>\n<mesh name="a" file="a.obj"/><mesh file="b.obj"/></mujoco>')
    (file,) = files_of(Path("m.xml"))
    assert file.place_of(Attribute("mesh", "file", "b.obj")) == (2, 42)
    assert file.place_of(Attribute("mesh", "file", "c.obj")) == (1, 1)


def test_what_is_xml_is_read_whatever_its_name():
    Path("sub/a.urdf").write_bytes(b'\xef\xbb\xbf \n<robot><mesh file="x.obj"/></robot>')
    Path("sub/x.obj").write_text("v 0 0 0")
    Path("m.xml").write_text('<mujoco><model file="sub/a.urdf"/></mujoco>')
    assert [each.path.name for each in files_of(Path("m.xml"))] == ["m.xml", "a.urdf", "x.obj"]
