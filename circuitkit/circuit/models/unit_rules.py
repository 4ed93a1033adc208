"""Units of model declarations: ordinary ones, with the words activation, source and weight among them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from circuitkit.base.errors import UnitError, listing, suggest
from circuitkit.base.units import DIMENSIONLESS, UNIT_SYMBOLS, Unit, parse_unit
from circuitkit.circuit.models.model import UnitRule

NEURON_WORDS = ("activation",)
SYNAPSE_WORDS = ("activation", "source", "weight")
_PIECE = re.compile(r"(?P<word>[A-Za-z]+)(?:\^(?P<power>-?\d))?")


def parse_unit_rule(text: str, words: Iterable[str]) -> tuple[UnitRule, Unit | None]:
    """Read a unit such as `mV`, `activation/s` or `1/activation`.

    Args:
        text: The unit; every `/` divides by the one factor after it.
        words: Those of activation, source and weight that mean something here.

    Returns:
        The rule, and the unit if it has none of the words.

    Raises:
        UnitError: It is no such unit; or one with a prefix beside a word, where only SI units have a meaning.
    """
    allowed = tuple(words)
    powers = dict.fromkeys(SYNAPSE_WORDS, 0)
    pieces = re.split(r"\s*([*/])\s*", text.strip())
    rest = ""
    for sign, piece in zip(["*", *pieces[1::2]], pieces[::2], strict=True):
        match = _PIECE.fullmatch(piece)
        if match is not None and match["word"] in allowed:
            powers[match["word"]] += int(match["power"] or 1) * (-1 if sign == "/" else 1)
            continue
        if (
            match is not None
            and match["word"] not in UNIT_SYMBOLS
            and (hint := suggest(match["word"], allowed))
        ):
            message = f"unknown unit '{match['word']}'; allowed: a unit, or {listing(allowed)}; {hint}"
            raise UnitError(message)
        rest += piece if not rest and sign == "*" else sign + piece
    unit = parse_unit(rest) if rest else DIMENSIONLESS
    if not any(powers.values()):
        return UnitRule(text.strip(), unit.dimension), unit
    if unit.factor != 1:
        example = listing(word for word, power in powers.items() if power)
        message = f"found '{text.strip()}'; allowed: units without a prefix beside {example}, such as s or V"
        raise UnitError(message)
    return UnitRule(text.strip(), unit.dimension, **powers), None
