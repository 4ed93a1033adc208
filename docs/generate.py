"""Writes the pages, pictures and the schema that follow from the code; `make docs` runs it."""

from __future__ import annotations

import contextlib
import io
import os
from pathlib import Path
from unittest import mock

from circuitkit.cli.app import COMMANDS
from circuitkit.cli.main import main
from circuitkit.files import write_text

DOCS = Path(__file__).parent
IMAGES = DOCS / "img"
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


def write_pictures() -> None:
    """The pictures that the README shows."""
    main(["draw", "binn_lateral", "-o", str(IMAGES / "binn_lateral.png")])
    curves = str(IMAGES / "binn_lateral_activations.png")
    main(["draw", "binn_lateral", "--what", "activations", "-o", curves])


if __name__ == "__main__":
    write_text(DOCS / "reference" / "commands.md", commands_page())
    main(["schema", "-o", str(DOCS.parent / "circuits" / "circuit.schema.json")])
    write_pictures()
