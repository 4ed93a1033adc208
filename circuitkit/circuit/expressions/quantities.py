"""Quantities inside expressions: `40 mV` in `exp(v / 40 mV)` gets a name that stands for it."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from keyword import kwlist

from circuitkit.base.errors import ExpressionError, UnitError
from circuitkit.base.units import UNIT_SYMBOLS, Quantity, parse_quantity, parse_unit

_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,4})?")
_POWER = r"(?:\s*\^\s*-?\d(?!\w))?(?![\w(.])"
_UNIT = re.compile(rf"\s*(?P<over>/\s*|1/)?(?P<symbol>[A-Za-z]+|%){_POWER}")
_FURTHER_UNIT = re.compile(rf"\s*[*/]\s*(?P<symbol>[A-Za-z]+){_POWER}")
_QUOTED = re.compile(r"""\"[^\"\n]*\"|'[^'\n]*'""")
_FIRST_STAND_IN = 0x4E00  # names from one letter that nobody writes


@dataclass
class StandIns:
    """Names that stand for parts of a text, letter for letter.

    Attributes:
        quantities: What the stand-ins for quantities mean.
        texts: What stands between the quotes of those for quoted texts.
        written: What every stand-in stands for, as written.
    """

    quantities: dict[str, Quantity] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    written: dict[str, str] = field(default_factory=dict)

    def add(self, written: str) -> str:
        """Add a new stand-in, as long as what it stands for."""
        name = chr(_FIRST_STAND_IN + len(self.written)).ljust(len(written), "_")
        self.written[name] = written
        return name

    def as_written(self, text: str) -> str:
        """Return a text with what was written instead of the stand-ins."""
        for name, written in self.written.items():
            text = text.replace(name, written)
        return text


def without_quotes(text: str, stand_ins: StandIns) -> str:
    """Put a name in the place of every quoted text, so that nothing in it is taken for anything else."""

    def name_of(match: re.Match[str]) -> str:
        name = stand_ins.add(match[0])
        stand_ins.texts[name] = match[0][1:-1]
        return name

    return _QUOTED.sub(name_of, text)


def with_stand_ins(
    text: str, names: Collection[str] = (), stand_ins: StandIns | None = None
) -> tuple[str, StandIns]:
    """Put a name in the place of every number that is directly followed by a unit.

    Args:
        text: An expression.
        names: Names that are no units there, even if they look like one.
        stand_ins: Names that stand for other parts of the text already.

    Raises:
        ExpressionError: A number is followed by something that is neither a unit nor an operator.
    """
    stand_ins = stand_ins or StandIns()
    pieces, position = [], 0
    for match in _NUMBER.finditer(text):
        end = _end_of_unit(text, match.end(), names)
        if end > match.end():
            written = text[match.start() : end]
            name = stand_ins.add(written)
            stand_ins.quantities[name] = parse_quantity(written)
            pieces += [text[position : match.start()], name]
            position = end
    return "".join((*pieces, text[position:])), stand_ins


def _end_of_unit(text: str, start: int, names: Collection[str]) -> int:
    """Find where the unit behind a number ends; where the number does if there is none."""
    end, pattern, words = start, _UNIT, {*names, *kwlist}
    while (match := pattern.match(text, end)) is not None and match["symbol"] not in words:
        if match["symbol"] not in UNIT_SYMBOLS:
            if end == start and not match["over"]:
                try:
                    parse_unit(match["symbol"])
                except UnitError as error:
                    raise ExpressionError(str(error), match.start("symbol")) from error
            break
        end, pattern = match.end(), _FURTHER_UNIT
    return end
