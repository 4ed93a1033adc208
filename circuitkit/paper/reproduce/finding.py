"""Holds what a figure of the report consists of: pictures, claims, tables, a text, and its numbers.

Below them is what judges a claim, and what writes numbers as texts, tables and claims have them.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from circuitkit.base.errors import InputError
from circuitkit.base.files import SEAL, DamagedFileError, replacing, seal, verified

_LOG = logging.getLogger("circuitkit")
FINDING_FILE = "finding.json"


class Verdict(StrEnum):
    """What became of a claim; the value is the word in the report."""

    HOLDS = "holds"
    PARTLY = "holds in part"
    FAILS = "does not hold"


@dataclass(frozen=True)
class Claim:
    """A row of the table of claims.

    Attributes:
        claim: What is claimed, in a sentence or less.
        paper: The paper's figure, with its unit; `-` where the paper has none.
        ours: What was measured, with its unit.
        how: How: circuit, study, seeds, what counts as survived.
        verdict: Whether it holds.
        why: By how much and why ours differs; empty where it does not.
        source: Where it is claimed, such as `section 5.2`; `beyond the paper` for what the paper left open.
    """

    claim: str
    paper: str
    ours: str
    how: str
    verdict: Verdict
    why: str = ""
    source: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture of a figure.

    Attributes:
        file: Name of a .png in the figure's folder; a .pdf of the same name may lie beside it, for print.
        caption: A sentence or two below it.
        alt: What it shows, for those who do not see it.
    """

    file: str
    caption: str
    alt: str


@dataclass(frozen=True)
class Table:
    """A table of a figure.

    Attributes:
        caption: Above it.
        headings: One for each column; one that starts with `>` makes the column flush right.
        rows: Texts, one for each column.
    """

    caption: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Finding:
    """A finished figure.

    Attributes:
        figure: Its name, such as `fig11`.
        title: Its heading in the report.
        claims: Its rows of the table of claims.
        pictures: Its pictures, in order.
        tables: Its tables.
        text: Markdown without headings: what was done, what is seen, where and why ours differs.
        seeds: Which seeds were used, in words; empty if none.
        studies: Names of the study files behind it.
        data: Numbers behind pictures and claims, for machines; what JSON can hold, SI units in the names.
    """

    figure: str
    title: str
    claims: tuple[Claim, ...] = ()
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    text: str = ""
    seeds: str = ""
    studies: tuple[str, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)

    def save(self, folder: Path, **stamp: object) -> Path:
        """Write `finding.json` into the figure's folder.

        Args:
            folder: The figure's folder, in which its pictures lie.
            stamp: What else to note, such as the version.

        Raises:
            OutputError: The file cannot be written.
        """
        path = folder / FINDING_FILE
        content = {"checksum": SEAL, "stamp": stamp, "finding": _for_json(asdict(self))}
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        with replacing(path) as part:
            part.write_bytes(text.encode())
            seal(part)
        return path

    @staticmethod
    def load(folder: Path) -> tuple[Finding, dict[str, Any]] | None:
        """Read the finding of a folder and its stamp; None without one, or without all of its pictures."""
        try:
            content = json.loads(verified(folder / FINDING_FILE, "the figure is made anew"))
            finding = _finding(content["finding"])
        except DamagedFileError as error:
            _LOG.warning("%s", error)
            return None
        except (InputError, ValueError, KeyError, TypeError, RecursionError):
            return None
        if not all((folder / picture.file).is_file() for picture in finding.pictures):
            return None
        return finding, dict(content["stamp"])


def _finding(raw: Mapping[str, Any]) -> Finding:
    claims = (Claim(**{**claim, "verdict": Verdict(claim["verdict"])}) for claim in raw["claims"])
    tables = (
        Table(table["caption"], tuple(table["headings"]), tuple(tuple(row) for row in table["rows"]))
        for table in raw["tables"]
    )
    return Finding(
        **{
            **raw,
            "claims": tuple(claims),
            "pictures": tuple(Picture(**picture) for picture in raw["pictures"]),
            "tables": tuple(tables),
            "studies": tuple(raw["studies"]),
        }
    )


def _for_json(value: Any) -> Any:  # noqa: ANN401 - any tree of JSON
    """Copy a tree with null for numbers that are not finite, and plain numbers for numpy's."""
    if isinstance(value, Mapping):
        return {str(key): _for_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_for_json(item) for item in value]
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        return _for_json(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def agrees(ours: float | None, paper: float, within: float) -> Verdict:
    """Judge whether a number is the paper's: it holds within a part of it, in part within three times that.

    Args:
        ours: What was measured; None or not a number if it could not be.
        paper: What the paper has, in the same unit; not 0.
        within: Part of the paper's number, such as 0.1.
    """
    if ours is None or not math.isfinite(ours):
        return Verdict.FAILS
    off = abs(ours / paper - 1.0)
    return Verdict.HOLDS if off <= within else Verdict.PARTLY if off <= 3 * within else Verdict.FAILS


def reaches(ours: float | None, target: float, at_least: float = math.inf) -> Verdict:
    """Judge whether a number is as large as claimed: it holds from `target` on, in part above `at_least`.

    Args:
        ours: What was measured; None or not a number if it could not be.
        target: What is claimed, in the same unit.
        at_least: What still speaks for the claim, such as 1 for a ratio that is claimed to be 1.5; nothing by
            default.
    """
    if ours is None or math.isnan(ours):
        return Verdict.FAILS
    if ours >= target:
        return Verdict.HOLDS
    return Verdict.PARTLY if ours > at_least else Verdict.FAILS


def all_hold(*parts: bool) -> Verdict:
    """Judge whether all, some or none of several things that a claim says are so."""
    return Verdict.HOLDS if all(parts) else Verdict.PARTLY if any(parts) else Verdict.FAILS


def one_line(text: str) -> str:
    """Join a text that is broken into lines in its source into one line."""
    return " ".join(text.split())


def median_range(values: Sequence[float | None], unit: str, digits: int = 2) -> str:
    """Write median and range, such as `0.03 s (0.01 to 0.35 s)`, and how many values there are if some lack.

    Args:
        values: None where there is no value.
        unit: Stands behind each.
        digits: Significant digits.
    """
    known = [value for value in values if value is not None]
    if not known:
        return "never"
    low, middle, high = (plain(float(value), digits) for value in (min(known), np.median(known), max(known)))
    text = f"{middle} {unit}" if low == high else f"{middle} {unit} ({low} to {high} {unit})"
    return text if len(known) == len(values) else f"{text}, in {len(known)} of {len(values)} runs"


def seeds_in_words(seeds: Sequence[int]) -> str:
    """Name consecutive seeds, such as `seeds 0 to 11`."""
    return f"seeds {seeds[0]} to {seeds[-1]}"


def plain(value: float | None, digits: int = 3) -> str:
    """Write a number with so many significant digits, never in powers of ten; `-` for none."""
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "unlimited" if value > 0 else "-"
    if value == 0:
        return "0"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{decimals}f}"


def signed_percent(ratio: float) -> str:
    """Write how much more or less than one a ratio is, such as `+52.6 %`."""
    return "-" if math.isnan(ratio) else f"{(ratio - 1) * 100:+.1f} %".replace("-", "\N{MINUS SIGN}")


def count(stood: int, runs: int) -> str:
    """Write how many of all, such as `20 of 20`."""
    return f"{stood} of {runs}"
