"""What the documents and the examples show works: every command and every script in them is run."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from circuitkit.base.source import find_data_file
from circuitkit.cli.main import main

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
_BLOCK = re.compile(r"^```(?:sh|console)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_FILE = re.compile(
    r"^```(?:yaml|xml|python)\n(?:#|<!--) (\S+\.(?:yaml|xml|py))\b(.*?)^```", re.MULTILINE | re.DOTALL
)
QUICK = ("init", "validate", "format", "show", "diff", "draw", "run", "schema", "design")


def commands(text):
    """The commands of `circuitkit` in the shell blocks of a page, in their order."""
    lines = [line.strip().removeprefix("$ ") for block in _BLOCK.findall(text) for line in block.splitlines()]
    return [line for line in lines if line.startswith("circuitkit ")]


def write_files(text):
    """Write the files that a page shows, those with their name in the first line, into the working folder."""
    for name, content in _FILE.findall(text):
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        begin = "<!-- " if path.suffix == ".xml" else "# "
        path.write_text(f"{begin}{name}{content}", encoding="utf-8")


def run_here(line):
    """Run one command line in this process; `> FILE` at its end is left to shells."""
    words = shlex.split(line, comments=True)
    assert main(words[1 : words.index(">") if ">" in words else None]) == 0, line


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that the examples of the help speak of: circuits, a table, an MJCF."""
    for name in ("my_circuit.yaml", "other.yaml"):
        shutil.copy(find_data_file("binn_lateral", "circuits"), tmp_path / name)
    shutil.copy(ROOT / "robots" / "cartpole" / "cartpole.xml", tmp_path / "model.xml")
    (tmp_path / "table.csv").write_text("zmp_y\n0\n40\n70 mm\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(ROOT).as_posix() for page in PAGES])
@pytest.mark.usefixtures("folder")
def test_every_command_of_a_page_runs(page):
    text = page.read_text(encoding="utf-8")
    write_files(text)
    for line in commands(text):
        run_here(line)


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(ROOT).as_posix() for page in PAGES])
@pytest.mark.usefixtures("folder")
def test_the_python_of_a_page_runs(page):
    text, names = page.read_text(encoding="utf-8"), {"__name__": "page"}
    write_files(text)
    for block in re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        exec(compile(block, str(page), "exec"), names)


@pytest.mark.parametrize("command", QUICK)
@pytest.mark.usefixtures("folder")
def test_every_example_of_the_help_runs(command, capsys):
    assert main([command, "--help"]) == 0
    examples = capsys.readouterr().out.split("Examples:\n")[1].splitlines()
    for line in filter(None, map(str.strip, examples)):
        run_here(line)


@pytest.mark.parametrize("script", EXAMPLES, ids=[script.stem for script in EXAMPLES])
@pytest.mark.usefixtures("folder")
def test_every_example_script_runs(script, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(script)])
    runpy.run_path(str(script), run_name="__main__")


def test_there_are_examples_and_commands_to_run():
    assert EXAMPLES
    assert len(commands((ROOT / "README.md").read_text(encoding="utf-8"))) >= 5


def test_links_between_files_lead_somewhere():
    for page in [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]:
        for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_the_tables_of_what_registers_itself_are_up_to_date():
    script = runpy.run_path(str(ROOT / "docs" / "kind_tables.py"))
    assert len(script["pages"]()) > 1
    for page in script["pages"]():
        text = page.read_text(encoding="utf-8")
        assert script["page_with_tables"](text) == text, "python docs/generate.py kinds writes them"


def test_the_reference_of_the_commands_is_up_to_date():
    generate = runpy.run_path(str(ROOT / "docs" / "generate.py"), run_name="generate")
    written = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    assert written == generate["commands_page"](), "run `make docs`"
