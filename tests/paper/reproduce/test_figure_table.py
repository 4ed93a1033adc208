"""The table of figures in docs/reproduce.md."""

from __future__ import annotations

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_lists_every_figure_as_it_describes_itself():
    script = runpy.run_path(str(DOCS / "figure_table.py"))
    page = (DOCS / "reproduce.md").read_text(encoding="utf-8")
    assert script["page_with_table"](page) == page, "python docs/generate.py figures writes it"
