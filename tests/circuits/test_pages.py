"""Every shipped circuit has a page with a picture, and stands in the list."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from circuitkit.base.source import shipped_names

DOCS = Path(__file__).parents[2] / "docs"
SHIPPED = shipped_names("circuits")
OF_THE_README = "binn_lateral"


def family_of(name):
    """The shipped circuit that it is a variant of: of binn_sagittal_tuned, binn_sagittal; or itself."""
    return min((each for each in SHIPPED if f"{name}_".startswith(f"{each}_")), key=len)


ROBOT_PAGES = "\n".join(page.read_text(encoding="utf-8") for page in sorted((DOCS / "robots").glob("*.md")))
# A circuit that was made for a robot stands on the robot's page.
OF_ROBOTS = {name for name in SHIPPED if f"circuits/{name}.yaml" in ROBOT_PAGES}


NAMES = [name for name in SHIPPED if family_of(name) == name != OF_THE_README and name not in OF_ROBOTS]
VARIANTS = [
    name for name in SHIPPED if family_of(name) not in {name, OF_THE_README} and name not in OF_ROBOTS
]


@pytest.mark.parametrize("name", NAMES)
def test_it_has_a_page_with_its_picture_its_source_and_how_to_run_it(name):
    page = (DOCS / "circuits" / f"{name}.md").read_text(encoding="utf-8")
    assert f"](img/{name}.png)" in page
    assert (DOCS / "circuits" / "img" / f"{name}.png").is_file()
    assert f"circuitkit validate {name}" in page
    for part in ("## Source", "## How it behaves", "## Run it"):
        assert part in page
    assert f"[{name}]({name}.md)" in (DOCS / "circuits" / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_has_a_part_of_its_family_s_page(name):
    page = (DOCS / "circuits" / f"{family_of(name)}.md").read_text(encoding="utf-8")
    heading = next(line for line in page.splitlines() if line.startswith("## ") and f"`{name}`" in line)
    assert f"](../../circuits/{name}.yaml)" in page[page.index(heading) :]
    assert f"`{name}`" in (DOCS / "circuits" / "README.md").read_text(encoding="utf-8")


def test_the_list_names_every_circuit():
    page = (DOCS / "circuits" / "README.md").read_text(encoding="utf-8")
    assert set(SHIPPED) <= set(re.findall(r"\w+", page))


def test_every_picture_is_drawn_by_the_code():
    figures = runpy.run_path(str(DOCS / "circuit_pictures.py"))["FIGURES"]
    assert sorted(figures) == sorted(path.stem for path in (DOCS / "circuits" / "img").iterdir())
    assert set(NAMES) <= set(figures)
