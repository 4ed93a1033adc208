"""Writes the report: Markdown with the pictures beside it, and one HTML file with everything in it."""

from __future__ import annotations

import base64
import html
import platform
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from itertools import pairwise
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

import circuitkit
from circuitkit.base.errors import InputError
from circuitkit.base.reading import read_bytes
from circuitkit.paper.reproduce.finding import Claim, Finding, Table, Verdict

TITLE = "The paper, figure by figure"
_PAPER = (
    "G. Barros Castro, K. Tamura, A. Kawamura and A. R. Hirakawa: *Biologically-Inspired Neural Network for "
    "Walking Stabilization of Humanoid Robots*"
)
_PACKAGES = ("mujoco", "numpy", "scipy", "matplotlib")
_CLAIM_HEADINGS = ("claim", "where", "the paper", "ours", "how measured", "verdict")


@dataclass(frozen=True)
class Entry:
    """A figure in the report.

    Attributes:
        finding: What was found.
        quick: Whether it was made with --quick.
        version: Of circuitkit, with which it was made.
    """

    finding: Finding
    quick: bool
    version: str

    @property
    def command(self) -> str:
        """What makes it again."""
        return f"circuitkit reproduce {self.finding.figure} -o DIR{' --quick' if self.quick else ''}"


def as_markdown(entries: Sequence[Entry]) -> str:
    """Write the report as Markdown; pictures are named from the folder of the report."""
    return "\n".join([*_head(entries), *_claims(entries), *_figures(entries), *_versions(entries)]) + "\n"


def _head(entries: Sequence[Entry]) -> Iterator[str]:
    yield f"# {TITLE}\n"
    yield f"The paper is {_PAPER}. All of it, and what it left open, is made by one command:\n"
    yield "```text\ncircuitkit reproduce -o DIR\ncircuitkit reproduce -o DIR --quick    # coarser\n```\n"
    if coarse := [entry.finding.figure for entry in entries if entry.quick]:
        yield f"Made with `--quick`, that is with fewer seeds and coarser grids: {', '.join(coarse)}.\n"


def _claims(entries: Sequence[Entry]) -> Iterator[str]:
    claims = [claim for entry in entries for claim in entry.finding.claims]
    yield "## Claims\n"
    if not claims:
        yield "No figure of this report claims anything.\n"
        return
    counts = {verdict: sum(claim.verdict is verdict for claim in claims) for verdict in Verdict}
    yield ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count) + ".\n"
    yield from _table(_CLAIM_HEADINGS, (_row(claim) for claim in claims))
    reasons = [claim for claim in claims if claim.why]
    if reasons:
        yield "### Where ours differs, and why\n"
        yield from (f"- **{claim.claim.rstrip('.')}.** {claim.why}" for claim in reasons)
        yield ""


def _row(claim: Claim) -> tuple[str, ...]:
    return (claim.claim, claim.source, claim.paper, claim.ours, claim.how, claim.verdict.value)


def _figures(entries: Sequence[Entry]) -> Iterator[str]:
    for entry in entries:
        finding = entry.finding
        yield f"## {finding.title}\n"
        if finding.text:
            yield f"{finding.text.strip()}\n"
        for picture in finding.pictures:
            yield f"![{picture.alt}]({finding.figure}/{picture.file})\n"
            yield f"*{picture.caption.strip()}*\n"
        for table in finding.tables:
            yield from _captioned(table)
        yield " ".join(_repeat(entry)) + "\n"


def _captioned(table: Table) -> Iterator[str]:
    yield f"**{table.caption}**\n"
    yield from _table(table.headings, table.rows)


def _repeat(entry: Entry) -> Iterator[str]:
    finding = entry.finding
    yield f"Repeat: `{entry.command}`."
    if finding.studies:
        yield f"Study: {', '.join(f'`{name}`' for name in finding.studies)}."
    if finding.seeds:
        yield f"Random numbers: {finding.seeds}."
    if entry.version != circuitkit.__version__:
        yield f"Made with circuitkit {entry.version}."


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(heading.removeprefix('>') for heading in headings)} |"
    yield f"|{'|'.join('---:' if heading.startswith('>') else '---' for heading in headings)}|"
    for row in rows:
        yield f"| {' | '.join(_cell(text) for text in row)} |"
    yield ""


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|") or "-"


def _versions(entries: Sequence[Entry]) -> Iterator[str]:
    yield "## Versions\n"
    numbers = [f"circuitkit {circuitkit.__version__}", f"Python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            numbers.append(f"{package} {version(package)}")
        except PackageNotFoundError:  # vendored under another name
            continue
    yield f"{', '.join(numbers)}.\n"
    if entries:
        yield "Runs do not depend on the number of workers; only what is timed depends on the machine.\n"


def as_html(markdown: str, folder: Path) -> str:
    """Write the report as one file without anything to load.

    Args:
        markdown: The report.
        folder: Where the pictures that it names lie; one that is not there stays a name.
    """
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(markdown)
    _mark_verdicts(tokens)
    _mark_captions(tokens)
    for token in tokens:
        for child in token.children or ():
            if child.type == "image":
                child.attrSet("src", _inlined(folder / str(child.attrGet("src"))))
    body: str = parser.renderer.render(tokens, parser.options, {})
    body = re.sub(r"<table>.*?</table>", r'<div class="wide">\g<0></div>', body, flags=re.DOTALL)
    return _PAGE.format(title=html.escape(TITLE), style=_STYLE, body=body)


def _mark_verdicts(tokens: Sequence[Token]) -> None:
    """Give cells with a verdict in them its class, for the colour."""
    classes: dict[str, Any] = {
        Verdict.HOLDS.value: "holds",
        Verdict.PARTLY.value: "partly",
        Verdict.FAILS.value: "fails",
    }
    for cell, inside in pairwise(tokens):
        if cell.type == "td_open" and inside.content in classes:
            cell.attrSet("class", classes[inside.content])


def _mark_captions(tokens: Sequence[Token]) -> None:
    """Give paragraphs that are slanted from end to end, as captions are, their class."""
    for paragraph, inside in pairwise(tokens):
        kinds = [child.type for child in inside.children or ()]
        if paragraph.type == "paragraph_open" and kinds[:1] == ["em_open"] and kinds[-1:] == ["em_close"]:
            paragraph.attrSet("class", "caption")


def _inlined(path: Path) -> str:
    try:
        content = base64.b64encode(read_bytes(path, "a picture")).decode("ascii")
    except InputError:
        return path.name
    return f"data:image/png;base64,{content}"


_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 60rem; margin: 2rem auto;
  padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; margin-top: 2rem; }
img { max-width: 100%; display: block; margin: 1rem auto 0.3rem; }
p.caption { color: #555; font-size: 0.9rem; margin-top: 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.85rem; margin: 0.5rem 0 1rem; }
th, td { border-bottom: 1px solid #ccc; padding: 0.3rem 0.6rem; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #666; }
td.holds { background: #dfeede; font-weight: bold; }
td.partly { background: #fbf3d0; font-weight: bold; }
td.fails { background: #f6d5cd; font-weight: bold; }
code, pre { background: #f3f3f3; font-size: 0.9em; }
pre { padding: 0.6rem; overflow-x: auto; }
@media print { body { max-width: none; font-size: 11px; } img { break-inside: avoid; } }
"""

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}</body>
</html>
"""
