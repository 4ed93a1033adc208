"""The circuits to start from: valid, in their normal form, and what their comments say to try works."""

from __future__ import annotations

import json
import re
import shlex

import pytest

from circuitkit.base.errors import InputError
from circuitkit.base.source import data_folder, shipped_names
from circuitkit.circuit import check, circuit_schema
from circuitkit.circuit.authoring.formatting import format_text
from circuitkit.circuit.authoring.starter import TEMPLATES, ExistsError, starter_text, write_starter
from circuitkit.cli.main import main

MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+)")


@pytest.mark.parametrize("template", TEMPLATES)
def test_a_starter_is_valid_without_a_doubt_and_in_its_normal_form(template, tmp_path):
    write_starter(tmp_path / "mine.yaml", template)
    assert check(tmp_path / "mine.yaml") == ((), ())
    text = starter_text(template, f"{template}.yaml")
    assert format_text(text) == text


@pytest.mark.parametrize("template", TEMPLATES)
def test_what_a_starter_says_to_try_works(template, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_starter("my circuit.yaml", template)
    text = (tmp_path / "my circuit.yaml").read_text(encoding="utf-8")
    lines = re.findall(r"^#   (circuitkit .*?)(?:  .*)?$", text, re.MULTILINE)
    assert len(lines) == 4
    for line in lines:
        assert main(shlex.split(line)[1:]) == 0, capsys.readouterr().err
    assert (tmp_path / "my circuit.svg").exists()


@pytest.mark.parametrize("template", TEMPLATES)
def test_the_first_line_leads_to_the_schema_beside_the_file(template, tmp_path):
    file, schema = write_starter(tmp_path / "new" / "mine.yml", template)
    match = MODELINE.fullmatch(file.read_text(encoding="utf-8").splitlines()[0])
    assert match is not None
    assert file.parent / match[1] == schema
    assert json.loads(schema.read_text(encoding="utf-8")) == circuit_schema()


@pytest.mark.parametrize("name", shipped_names("circuits"))
def test_the_first_line_of_a_shipped_circuit_leads_to_the_schema(name):
    folder = data_folder("circuits")
    match = MODELINE.fullmatch((folder / f"{name}.yaml").read_text(encoding="utf-8").splitlines()[0])
    assert match is not None
    assert (folder / match[1]).is_file()


def test_the_circuit_is_called_after_its_file():
    text = starter_text("reflex", "my-robot.yaml")
    assert "\ncircuit: my_robot\n" in text
    assert "circuitkit draw my-robot.yaml -o my-robot.svg" in text
    assert "\ncircuit: reflex\n" in starter_text("reflex", "2nd try.yaml")


def test_a_file_that_is_there_is_not_overwritten_unasked(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("precious", encoding="utf-8")
    with pytest.raises(ExistsError) as error:
        write_starter(file, "reflex")
    assert str(error.value) == f"'{file}' exists already; name another file, or overwrite it with --force"
    assert file.read_text(encoding="utf-8") == "precious"
    write_starter(file, "reflex", force=True)
    assert "circuit: mine" in file.read_text(encoding="utf-8")


def test_a_schema_that_is_there_stays(tmp_path):
    (tmp_path / "circuit.schema.json").write_text("{}", encoding="utf-8")
    assert write_starter(tmp_path / "mine.yaml", "reflex") == [tmp_path / "mine.yaml"]
    assert (tmp_path / "circuit.schema.json").read_text(encoding="utf-8") == "{}"


def test_an_unknown_template_is_told_with_those_there_are(tmp_path):
    with pytest.raises(InputError) as error:
        write_starter(tmp_path / "mine.yaml", "reflx")
    assert str(error.value) == (
        f"unknown template 'reflx'; allowed: {', '.join(TEMPLATES)}; did you mean 'reflex'?"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mine", "mine: found no suffix; allowed: .yaml, .yml; did you mean 'mine.yaml'?"),
        ("mine.txt", "mine.txt: found the suffix '.txt'; allowed: .yaml, .yml; did you mean 'mine.yaml'?"),
    ],
)
def test_a_circuit_file_has_its_suffix(name, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as error:
        write_starter(name, "reflex")
    assert str(error.value) == message
