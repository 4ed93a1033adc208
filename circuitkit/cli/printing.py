"""How commands print: tables for persons, JSON for programs, notes and errors on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence

WIDTH_OF_A_PIPE = 160  # characters; a table that no terminal limits is not cut at 80


def examples(*commands: str) -> str:
    """The end of a command's help: its examples, one a line; the mark keeps the lines as they are."""
    return "\b\nExamples:\n" + "\n".join(f"  {command}" for command in commands)


def counted(number: int, what: str) -> str:
    """Such as `1 error` or `2 errors`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def print_json(value: object) -> None:
    """Print JSON; what is not a finite number becomes `null`, for JSON has no other word for it."""
    print(json.dumps(_finite(value), indent=2, ensure_ascii=False, allow_nan=False))


def _finite(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table, as wide as the terminal allows.

    Args:
        title: Stands above the table.
        headings: One for each column; a heading that starts with `>` makes the column flush right.
        rows: One text for each column.
    """
    from rich import box  # late: see cli/__init__.py
    from rich.console import Console  # the same
    from rich.table import Table  # the same

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for heading in headings:
        table.add_column(heading.removeprefix(">"), justify="right" if heading.startswith(">") else "left")
    for row in rows:
        table.add_row(*row)
    width = None if sys.stdout.isatty() else WIDTH_OF_A_PIPE
    Console(width=width, markup=False, highlight=False, emoji=False).print(table)


def note(text: object) -> None:
    """Say something beside the result, on stderr."""
    print(text, file=sys.stderr)
