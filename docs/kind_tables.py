"""Writes the tables of what registers itself into the pages; docs/generate.py calls `write_kind_tables`.

A table stands between `<!-- NAME: written by docs/kind_tables.py -->` and `<!-- end -->`, where NAME is a key
of `TABLES`. So no page has a list of kinds that somebody keeps by hand.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from pydantic import BaseModel

from circuitkit.base.catalogue import catalogue, summary
from circuitkit.base.files import write_text
from circuitkit.base.units import UNIT_SYMBOLS
from circuitkit.control.spec import KINDS
from circuitkit.paper.reproduce import FIGURES
from circuitkit.paper.reproduce.figure import select
from circuitkit.robots import Robot
from circuitkit.robots.parts import REFERENCES as PARTS_OF_MJCF
from circuitkit.robots.spec import blocks
from circuitkit.simulation.disturbance import DISTURBANCES
from circuitkit.simulation.measures import MEASURES
from circuitkit.simulation.reductions import REDUCTIONS
from circuitkit.simulation.reference import REFERENCES
from circuitkit.simulation.scenario import scenario_class

DOCS = Path(__file__).parent
_WIDTH = 110
_PLACE = re.compile(r"(<!-- (\w+): written by docs/kind_tables\.py -->\n).*?(<!-- end -->)", re.DOTALL)


def _table(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    headings = tuple(headings)
    lines = [headings, ("---",) * len(headings), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def _keys(model: type[BaseModel], without: Iterable[str] = ()) -> Iterable[tuple[str, str]]:
    for name, field in model.model_fields.items():
        if name not in without:
            yield f"`{field.alias or name}`", field.description or ""


def _kinds(kinds: Mapping[str, type]) -> str:
    return _table(("kind", "what it does"), ((f"`{kind}`", summary(made)) for kind, made in kinds.items()))


def _with_keys(kinds: Mapping[str, type[BaseModel]], without: Iterable[str] = ()) -> str:
    rows = []
    for kind, made in kinds.items():
        rows.append((f"**`{kind}`**", f"**{summary(made)}**"))
        rows += _keys(made, without)
    return _table(("kind, its keys", "what it does"), rows)


def _shipped_controllers() -> str:
    rows = ((f"`{each.name}`", each.description) for each in catalogue("controllers"))
    return _table(("file", "what it is"), rows)


def _figures() -> str:
    """In the order of the report."""
    rows = (
        (f"`{name}`", summary(FIGURES[name]), ", ".join(f"`{study}`" for study in FIGURES[name].studies))
        for name in select()
    )
    return _table(("figure", "what it does", "study"), rows)


def _robot_circuits() -> str:
    """The circuits that robots' pages link to, in the order in which these speak of them."""
    said = {each.name: each.description for each in catalogue("circuits")}
    rows = []
    for page in sorted((DOCS / "robots").glob("[a-z]*.md")):
        found = re.findall(r"\.\./\.\./circuits/(\w+)\.yaml", page.read_text(encoding="utf-8"))
        for name in dict.fromkeys(found):
            robot, circuit = (
                f"[{page.stem}](../robots/{page.name})",
                f"[`{name}`](../../circuits/{name}.yaml)",
            )
            rows.append((robot, circuit, said[name]))
    return _table(("robot", "circuit", "what it does"), rows)


def _listed(words: Iterable[str], between: str) -> str:
    """Words in lines, as code."""
    lines = [""]
    for word in words:
        if len(lines[-1]) + len(word) > _WIDTH:
            lines.append("")
        lines[-1] += word + between
    return "\n".join(["```", *(line.rstrip() for line in lines), "```"])


TABLES: dict[str, Callable[[], str]] = {
    "scenario": lambda: _table(("key", "what it says"), _keys(scenario_class())),
    "references": lambda: _kinds(REFERENCES.kinds),
    "disturbances": lambda: _with_keys(DISTURBANCES.kinds),
    "reductions": lambda: _table(
        ("reduction", "what it gives"), ((f"`{name}`", each.description) for name, each in REDUCTIONS.items())
    ),
    "measures": lambda: _with_keys(MEASURES.kinds),
    "controller_files": _shipped_controllers,
    "controllers": lambda: _with_keys(KINDS.kinds, ("controller", "description")),
    "parts": lambda: _listed((each.usage for each in PARTS_OF_MJCF.values()), "   "),
    "units": lambda: _listed(UNIT_SYMBOLS, " "),
    "figures": _figures,
    "robot_circuits": _robot_circuits,
    "robot_blocks": lambda: _with_keys(blocks.kinds),
    "robot_file": lambda: _table(("key", "what it says"), _keys(Robot)),
}


def page_with_tables(page: str) -> str:
    """The page with its tables as they should be."""
    return _PLACE.sub(lambda found: f"{found[1]}\n{TABLES[found[2]]()}\n\n{found[3]}", page)


def pages() -> list[Path]:
    """The pages that have such tables."""
    return [path for path in sorted(DOCS.rglob("*.md")) if _PLACE.search(path.read_text(encoding="utf-8"))]


def write_kind_tables() -> None:
    """Put the tables into their pages."""
    for path in pages():
        write_text(path, page_with_tables(path.read_text(encoding="utf-8")))
