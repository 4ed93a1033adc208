"""Writes the table of figures in docs/reproduce.md; docs/generate.py calls `write_figure_table`."""

from __future__ import annotations

import re
from pathlib import Path

from circuitkit.base.files import write_text
from circuitkit.paper.reproduce import FIGURES
from circuitkit.paper.reproduce.figure import select

PAGE = Path(__file__).parent / "reproduce.md"
_PLACE = re.compile(r"(<!-- figures: [^\n]*-->\n).*?(<!-- end -->)", re.DOTALL)


def figure_table() -> str:
    """One row for each figure, in the order of the report."""
    rows = ["| figure | what it does | study |", "|---|---|---|"]
    for name in select():
        made = FIGURES[name]
        what = (made.__doc__ or "").partition("\n")[0]
        rows.append(f"| `{name}` | {what} | {', '.join(f'`{study}`' for study in made.studies)} |")
    return "\n".join(rows)


def page_with_table(page: str) -> str:
    """The page with its table as it should be."""
    return _PLACE.sub(lambda found: f"{found[1]}{figure_table()}\n{found[2]}", page)


def write_figure_table() -> None:
    """Put the table into the page."""
    write_text(PAGE, page_with_table(PAGE.read_text(encoding="utf-8")))
