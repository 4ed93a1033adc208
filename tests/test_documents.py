"""What the documents and the examples show works: every command and every script in them is run."""

from __future__ import annotations

import importlib
import math
import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import pytest
from typer.main import get_group

from circuitkit.base.source import find_data_file
from circuitkit.cli.app import app
from circuitkit.cli.main import main

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXTS = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
_BLOCK = re.compile(r"^```(?:sh|console)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SOURCES = sorted((ROOT / "circuitkit").rglob("*.py"))
_FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_FILE = re.compile(
    r"^```(?:yaml|xml|python)\n(?:#|<!--) (\S+\.(?:yaml|xml|py))\b(.*?)^```", re.MULTILINE | re.DOTALL
)
QUICK = ("init", "validate", "format", "show", "diff", "draw", "run", "schema", "design")


def commands(text):
    """The commands of `circuitkit` in the shell blocks of a page, in their order."""
    return commands_in("".join(_BLOCK.findall(text)))


def commands_in(text):
    """The lines that call `circuitkit`; one that ends in a backslash goes on in the next."""
    lines = [line.strip().removeprefix("$ ") for line in text.replace("\\\n", " ").splitlines()]
    return [line for line in lines if line.startswith("circuitkit ")]


def words_of(line):
    """What a shell passes to `circuitkit`; `> FILE` at the end is the shell's own."""
    words = shlex.split(line, comments=True)
    return words[1 : words.index(">") if ">" in words else None]


def anchors(page):
    """What links may name in a page, by its headings."""
    headings = re.findall(r"^#+ (.*)$", _FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    plain = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings)
    return {re.sub(r"[^\w -]", "", heading).strip().replace(" ", "-") for heading in plain}


def is_there(name):
    """Whether a module, or what stands in one, can be imported by its dotted name."""
    module, _, inside = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        return bool(module) and hasattr(importlib.import_module(module), inside)
    return True


def write_files(text):
    """Write the files that a page shows, those with their name in the first line, into the working folder."""
    for name, content in _FILE.findall(text):
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        begin = "<!-- " if path.suffix == ".xml" else "# "
        path.write_text(f"{begin}{name}{content}", encoding="utf-8")


def run_here(line):
    """Run one command line in this process."""
    assert main(words_of(line)) == 0, line


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


@pytest.mark.usefixtures("folder")
def test_what_readme_shows_in_python_is_worth_showing(capsys):
    """Its own controller holds through all pushes, and its own scenario starts with a lean that goes."""
    text, names = (ROOT / "README.md").read_text(encoding="utf-8"), {"__name__": "page"}
    for block in re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        exec(compile(block, "README.md", "exec"), names)
    assert capsys.readouterr().out.startswith("ran to the end ")
    theirs = names["theirs"]
    assert theirs.recording.channel("pole")[0, 0] == pytest.approx(math.radians(5), rel=0.01)
    assert theirs.measures["way"] > 0.1
    assert theirs.measures["lean"] < math.radians(0.5)


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
    for page in TEXTS:
        text = _FENCE.sub("", page.read_text(encoding="utf-8"))
        for target in re.findall(r"(?:\]\(|src=\")(?!https?:)([^)\"]+)", text):
            file, _, place = target.partition("#")
            there = page.parent / file if file else page
            assert there.exists(), f"{page.name} links to {target}"
            assert not place or place in anchors(there), f"{page.name} links to {target}"


def test_every_picture_is_on_a_page():
    shown = {
        (page.parent / target).resolve()
        for page in TEXTS
        for target in re.findall(r"(?:\]\(|src=\")([^)\"]+)", page.read_text(encoding="utf-8"))
    }
    pictures = [path for path in (ROOT / "docs").rglob("*.*") if path.suffix in {".png", ".svg", ".webp"}]
    assert pictures
    assert [path for path in pictures if path.resolve() not in shown] == []


@pytest.mark.parametrize("page", TEXTS, ids=[page.relative_to(ROOT).as_posix() for page in TEXTS])
def test_every_command_that_a_page_names_takes_these_options(page):
    """Also those that take too long to be run; a command in the text may lack what it needs."""
    text, known = page.read_text(encoding="utf-8"), get_group(app).commands
    for line in commands_in("\n".join(_FENCE.findall(text))):
        name, *words = words_of(line)
        known[name].make_context(name, words)
    for line in re.findall(r"`(circuitkit\s[^`]+)`", _FENCE.sub("", text)):
        name, *words = words_of(" ".join(line.split()))
        assert name in known, line
        options = {option for each in known[name].params for option in each.opts} | {"--help", "--debug"}
        assert {word for word in words if re.match(r"--?[a-z]", word)} <= options, line


def test_make_has_every_target_that_a_page_names_and_calls_commands_that_exist():
    makefile, known = (ROOT / "Makefile").read_text(encoding="utf-8"), get_group(app).commands
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    for page in TEXTS:
        named = re.findall(r"(?:`|^)make ([a-z-]+)", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(named) <= targets, page.name
    for line in re.findall(r"^\t\$\(BIN\)/(circuitkit .*)$", makefile, re.MULTILINE):
        name, *words = words_of(line)
        known[name].make_context(name, words)


def test_every_name_of_the_package_in_a_page_exists():
    words = re.findall(r'\b(?:Registry|plugged_in)\(\s*"(\w+)"', "".join(map(Path.read_text, SOURCES)))
    groups = {f"circuitkit.{word}" for word in words}  # of entry points
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"`(?:python -m )?(circuitkit(?:\.\w+)+)`", text):
            assert name in groups or is_there(name), f"{page.name} names {name}"


def test_every_file_that_a_page_names_exists():
    """Those with a folder; an upper-case word or dots in the path are a place for names."""
    for page in [*PAGES, ROOT / "CONTRIBUTING.md"]:
        text = _FENCE.sub("", page.read_text(encoding="utf-8"))
        for name in re.findall(r"`([a-z][a-z_\d.-]*/[\w./-]*?(?:/|\.(?:py|yaml|xml|md)))`", text):
            if not re.search(r"[A-Z]{4}", name):
                places = (ROOT, ROOT / "circuitkit", ROOT / "circuitkit" / "base")
                assert any((place / name).exists() for place in places), f"{page.name} names {name}"


@pytest.mark.parametrize("page", TEXTS, ids=[page.relative_to(ROOT).as_posix() for page in TEXTS])
def test_lines_are_at_most_120_columns_wide(page):
    """But for rows of tables, where links lead, and the report that `circuitkit reproduce` writes."""
    if page.parent.name != "report":
        for line in page.read_text(encoding="utf-8").splitlines():
            assert line.startswith("|") or len(re.sub(r"\]\([^)]*\)", "]", line)) <= 120, line


@pytest.mark.parametrize(
    ("page", "name", "command", "mistakes"),
    [
        (
            "README.md",
            "balance.yaml",
            ["validate"],
            {"left, weight: -0.9 s/rad": "left, weight: -0.9", "{right: 10": "{rigth: 10"},
        ),
        (
            "docs/studies.md",
            "push_limits.yaml",
            ["sweep", "--dry-run"],
            {"push.direction:": "push.directoin:", "0.2 s, 0.4 s]": "0.2 s, 0.4 m]"},
        ),
    ],
)
@pytest.mark.usefixtures("folder")
def test_the_mistakes_of_a_page_are_reported_as_it_shows(page, name, command, mistakes, capsys):
    text = (ROOT / page).read_text(encoding="utf-8")
    (file,) = re.findall(
        rf"^```yaml\n((?:# {name}|study: {Path(name).stem})\n.*?)^```", text, re.MULTILINE | re.DOTALL
    )
    for right, wrong in mistakes.items():
        assert right in file
        file = file.replace(right, wrong)
    Path(name).write_text(file, encoding="utf-8")
    assert main([*command, name]) == 1
    shown = re.search(rf"^```text\n({name}:.*?)^```", text, re.MULTILINE | re.DOTALL)[1]
    assert re.sub(r"\n +", " ", shown) in capsys.readouterr().err  # long ones are wrapped on the page


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
