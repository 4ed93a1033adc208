"""Every shipped circuit has a page with a picture, and stands in the list."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from circuitkit.source import shipped_names

DOCS = Path(__file__).parents[2] / "docs"
OF_THE_README = {"binn_lateral", "binn_lateral_tuned"}
NAMES = [name for name in shipped_names("circuits") if name not in OF_THE_README]


@pytest.mark.parametrize("name", NAMES)
def test_it_has_a_page_with_its_picture_its_source_and_how_to_run_it(name):
    page = (DOCS / "circuits" / f"{name}.md").read_text(encoding="utf-8")
    assert f"](img/{name}.png)" in page
    assert (DOCS / "circuits" / "img" / f"{name}.png").is_file()
    assert f"circuitkit validate {name}" in page
    for part in ("## Source", "## How it behaves", "## Run it"):
        assert part in page
    assert f"[{name}]({name}.md)" in (DOCS / "circuits" / "README.md").read_text(encoding="utf-8")


def test_every_picture_is_drawn_by_the_code():
    figures = runpy.run_path(str(DOCS / "circuit_pictures.py"))["FIGURES"]
    assert sorted(figures) == sorted(NAMES)
