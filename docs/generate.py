"""Writes the pages, pictures and the schema that follow from the code; `make docs` runs it.

`python docs/generate.py commands models` writes only these parts; tests say when a page is not current.
"""

from __future__ import annotations

import contextlib
import io
import os
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from circuitkit.base.files import write_text
from circuitkit.cli.app import COMMANDS
from circuitkit.cli.main import main

DOCS = Path(__file__).parent
HEAD = """# The commands

Written by `make docs` from what `--help` prints. Exit codes of all: 0 done, 1 the input is wrong, 2 wrong
usage, 3 the run failed, 130 after Ctrl-C. Errors go to stderr as `file:line:column: where: message`;
`--debug` shows the traceback.
"""


def _printed_by(*words: str) -> str:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), mock.patch.dict(os.environ, COLUMNS="100"):
        main(words)
    return printed.getvalue()


def commands_page() -> str:
    """The page with the help of every command."""
    sections = [
        f"## circuitkit {name}\n```text\n{_printed_by(name, '--help').strip()}\n```\n" for name in COMMANDS
    ]
    return "\n".join([HEAD, *sections])


def write_commands() -> None:
    """The help of every command."""
    write_text(DOCS / "reference" / "commands.md", commands_page())


def write_schema() -> None:
    """The schema that the shipped circuits name in their first line."""
    main(["schema", "-o", str(DOCS.parent / "circuits" / "circuit.schema.json")])


def write_robot_pictures() -> None:
    """The pictures of the robots' pages, by the scripts beside these."""
    for script in sorted((DOCS / "robots").glob("*_pictures.py")):
        runpy.run_path(str(script), run_name="__main__")


def _hook(file: str, function: str) -> Callable[[], None]:
    """A function of a script beside this one, which is loaded when it is called."""

    def write() -> None:
        runpy.run_path(str(DOCS / file))[function]()

    return write


PARTS: dict[str, Callable[[], None]] = {
    "commands": write_commands,
    "schema": write_schema,
    "models": _hook("model_pages.py", "write_model_pages"),
    "circuits": _hook("circuit_pictures.py", "write_circuit_pictures"),
    "kinds": _hook("kind_tables.py", "write_kind_tables"),
    "films": _hook("film_pictures.py", "write_film_pictures"),
    "robots": write_robot_pictures,
}


if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        if part not in PARTS:
            sys.exit(f"found '{part}'; allowed: {', '.join(PARTS)}")
        PARTS[part]()
