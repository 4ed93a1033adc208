"""What a tuning searches: ranges and choices of named values, and the texts that candidates set them to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from circuitkit.base.errors import InputError, UnitError
from circuitkit.base.source import Document, FileModel, describe
from circuitkit.base.source.fields import AnyQuantity
from circuitkit.base.units import Quantity, Unit, parse_quantity

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution

_DIGITS = 6


def _text(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        message = f"found {describe(value)}; allowed: a value such as '-2 deg'"
        raise ValueError(message)  # noqa: TRY004 - pydantic collects ValueError, not TypeError
    return str(value)


ValueText = Annotated[str, BeforeValidator(_text)]


class Searched(FileModel):
    """A value that is searched: a range `from` ... `to`, or `choices`.

    A range is searched in the unit in which `from` is written, and every candidate is rounded to six digits
    in it, so that what a result says is what was measured.
    """

    low: AnyQuantity | None = Field(default=None, alias="from", description="Smallest value, with its unit.")
    high: AnyQuantity | None = Field(default=None, alias="to", description="Largest value.")
    log: bool = Field(default=False, description="Search the logarithm; both ends must have one sign.")
    whole: bool = Field(default=False, description="Only whole numbers.")
    choices: tuple[str | int | float, ...] | None = Field(
        default=None, min_length=2, description="Instead of a range: values to choose from."
    )

    @model_validator(mode="after")
    def _is_a_range_or_choices(self) -> Self:
        if self.choices is not None:
            extra = [key for key, given in (("from", self.low), ("to", self.high)) if given is not None]
            extra += [key for key in ("log", "whole") if getattr(self, key)]
            if extra:
                message = (
                    f"found choices together with {' and '.join(extra)}; allowed: choices, or from and to"
                )
                raise ValueError(message)
            return self
        if self.low is None or self.high is None:
            message = "found no range; allowed: from and to, or choices"
            raise ValueError(message)
        low, high = parse_quantity(self.low), parse_quantity(self.high)
        if low.dimension != high.dimension:
            message = f"found {low} ({low.dimension}) to {high} ({high.dimension}); allowed: one dimension"
            raise ValueError(message)
        if not low.value_si < high.value_si:
            message = f"found from {low} to {high}; allowed: the smaller value, then the larger one"
            raise ValueError(message)
        if self.log and low.value_si * high.value_si <= 0:
            message = f"found log with {low} to {high}; allowed: both ends above 0, or both below"
            raise ValueError(message)
        if self.whole and not all(end.is_integer() for end in self.ends):
            message = f"found whole with {low} to {high}; allowed: whole numbers as ends"
            raise ValueError(message)
        if self.whole and self.log and low.value_si < 0:
            message = f"found log and whole with {low} to {high}; allowed: ends above 0"
            raise ValueError(message)
        return self

    @property
    def unit(self) -> Unit:
        """The unit in which a range is searched."""
        return self._low.unit

    @property
    def _low(self) -> Quantity:
        return parse_quantity(self.low or "0")

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the range in its unit."""
        high = parse_quantity(self.high or "0")
        unit = self._low.unit
        return unit.from_si(self._low.value_si), unit.from_si(high.value_si)

    @property
    def _mirrored(self) -> bool:
        """Whether the size is searched instead of the value, for logarithms of what is below 0."""
        return self.log and self._low.value_si < 0

    def distribution(self) -> BaseDistribution:
        """The same for Optuna."""
        from optuna import distributions as optuna  # an extra

        if self.choices is not None:
            return optuna.CategoricalDistribution([str(each) for each in self.choices])
        low, high = sorted(-end for end in self.ends) if self._mirrored else self.ends
        if self.whole:
            return optuna.IntDistribution(round(low), round(high), log=self.log)
        return optuna.FloatDistribution(low, high, log=self.log)

    def text(self, value: Any) -> str:  # noqa: ANN401 - what Optuna's distributions hold
        """What stands in a circuit file or behind `--set` for a value of the distribution."""
        if self.choices is not None:
            return str(value)
        number = -value if self._mirrored else value
        digits = f"{number:d}" if self.whole else f"{number:.{_DIGITS}g}"
        return digits if self.unit.symbol == "1" else f"{digits} {self.unit.symbol}"

    def number(self, text: str) -> Any:  # noqa: ANN401 - as above
        """The value of the distribution for a text.

        Raises:
            UnitError: The text is no quantity of this dimension, outside of the range, or no choice.
        """
        if self.choices is not None:
            words = [str(each) for each in self.choices]
            if text not in words:
                message = f"found '{text}'; allowed: {', '.join(words)}"
                raise UnitError(message)
            return text
        quantity = parse_quantity(text)
        if quantity.dimension != self.unit.dimension:
            message = f"found {quantity} ({quantity.dimension}); allowed: {self.low} to {self.high}"
            raise UnitError(message)
        low, high = self.ends
        value = self.unit.from_si(quantity.value_si)
        if not low <= value <= high or (self.whole and not value.is_integer()):
            message = f"found {quantity}; allowed: {self.low} to {self.high}{', whole' if self.whole else ''}"
            raise UnitError(message)
        value = -value if self._mirrored else value
        return round(value) if self.whole else value

    def middle(self) -> Any:  # noqa: ANN401 - as above
        """The middle of the range, as a value of the distribution; the first choice."""
        if self.choices is not None:
            return str(self.choices[0])
        low, high = self.ends
        middle = math.copysign(math.sqrt(low * high), low) if self.log else (low + high) / 2
        middle = abs(middle) if self._mirrored else middle
        return round(middle) if self.whole else middle

    def plotted(self, text: str) -> float:
        """A value in the unit of the range, or the number of a choice."""
        if self.choices is not None:
            return float([str(each) for each in self.choices].index(text))
        return self.unit.from_si(parse_quantity(text).value_si)


def texts(parameters: Mapping[str, Searched], values: Mapping[str, Any]) -> dict[str, str]:
    """The texts of a candidate by the names of what is searched."""
    return {name: searched.text(values[name]) for name, searched in parameters.items()}


def start_values(
    parameters: Mapping[str, Searched], start: Mapping[str, str], document: Document
) -> dict[str, Any]:
    """The values of the distributions for a start that stands in a file.

    Raises:
        InputError: A value is outside of its range; carries every one.
    """
    found, problems = {}, []
    for name, text in start.items():
        try:
            found[name] = parameters[name].number(text)
        except UnitError as error:
            problems.append(document.problem(("tune", "start", name), str(error)))
    if problems:
        raise InputError(*problems)
    return found
