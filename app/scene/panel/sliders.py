"""How a parameter stands on its slider, and how its number is written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tracker.parameters.catalogue import Parameter

LOG_STEP = 0.01
"""Decades between two places of a logarithmic slider: 2.3 %."""
DIGITS = 3
"""Significant digits of a value that comes from a logarithmic slider."""


@dataclass(frozen=True, slots=True)
class Scale:
    """The places of a slider for one number: linear, or its decimal logarithm."""

    parameter: Parameter

    def __post_init__(self) -> None:
        p = self.parameter
        if p.kind not in ("float", "int") or p.minimum is None or p.maximum is None:
            raise ValueError(f"{p.key}: a slider needs a number with both bounds")
        if p.log and p.minimum <= 0.0:
            raise ValueError(
                f"{p.key}: a logarithmic slider needs a minimum above 0, got {p.minimum}"
            )

    @property
    def minimum(self) -> float | int:
        """Place of the least value."""
        return self.place(self.parameter.minimum or 0)

    @property
    def maximum(self) -> float | int:
        """Place of the greatest value."""
        return self.place(self.parameter.maximum or 0)

    @property
    def step(self) -> float | int:
        """Distance of two places."""
        if self.parameter.log:
            return LOG_STEP
        if self.parameter.kind == "int":
            return max(1, int(self.parameter.step or 1))
        span = float(self.maximum) - float(self.minimum)
        return self.parameter.step or 10.0 ** math.floor(math.log10(span / 50.0))

    def place(self, value: float) -> float | int:
        """Where a value stands."""
        if self.parameter.log:
            return math.log10(value)
        return int(value) if self.parameter.kind == "int" else float(value)

    def value(self, place: float) -> float | int:
        """The value at a place, inside the range; rounded to what the slider can tell apart."""
        p = self.parameter
        assert p.minimum is not None
        assert p.maximum is not None
        number = float(f"{10.0**place:.{DIGITS}g}") if p.log else round(float(place), 9)
        number = min(max(number, p.minimum), p.maximum)
        return round(number) if p.kind == "int" else number

    def stands_at(self, place: float, value: float) -> bool:
        """Whether a place is the one of a value, as near as the slider can tell."""
        if math.isclose(float(place), float(self.place(value)), rel_tol=1e-9, abs_tol=1e-12):
            return True
        if not self.minimum <= place <= self.maximum:
            return False  # the client does not keep to the range
        return math.isclose(float(self.value(place)), float(value), rel_tol=1e-9, abs_tol=1e-12)


def number_text(value: float) -> str:
    """A number as short as it can be read: ``0.02``, ``1e-4``, ``400``."""
    if isinstance(value, int):
        return str(value)
    if value == 0.0 or abs(value) >= 1e-3:
        return f"{value:.{DIGITS + 1}g}"
    mantissa, _, exponent = f"{value:.{DIGITS - 1}e}".partition("e")
    return f"{float(mantissa):g}e{int(exponent)}"


def symbol_parts(symbol: str) -> tuple[str, str]:
    """A symbol's letter and its subscript: ``D_max`` is D with the subscript max.

    What is not a plain letter with a subscript stays as the formulas write it.
    """
    letter, _, index = symbol.partition("_")
    plain = len(letter) <= 2 and (index.isalnum() or index == "+")
    return (letter, index) if plain else (symbol, "")


def label_text(parameter: Parameter, *, changed: bool) -> str:
    """Name and symbol, with a dot in front where the value is not the default.

    The symbol's subscript and the unit are written by the panel's style sheet.
    """
    letter = symbol_parts(parameter.symbol)[0]
    return f"{'• ' if changed else ''}{parameter.label} {letter}"


def manual_places(identifiers: Mapping[str, str]) -> str:
    """Links from each input to its place in the manual, as invisible HTML.

    Args:
        identifiers: Of the inputs in viser's page, by the key of the parameter or method.
    """
    places = (
        f'<i id="help-{identifier}" data-manual="/manual/tuning/#{key}"></i>'
        for key, identifier in identifiers.items()
    )
    return f"<div hidden>{''.join(places)}</div>"


def hint_text(parameter: Parameter) -> str:
    """What a parameter does, its range and its default, and that its label leads on."""
    return f"{_short_help(parameter)} A click opens the manual."


def _short_help(parameter: Parameter) -> str:
    if parameter.kind in ("float", "int"):
        assert parameter.minimum is not None
        assert parameter.maximum is not None
        limits = f"{number_text(parameter.minimum)} … {number_text(parameter.maximum)}"
        unit = f" {parameter.unit}" if parameter.unit else ""
        default = number_text(parameter.default)
        return f"{parameter.help} {limits}{unit}, default {default}."
    if parameter.kind == "bool":
        return f"{parameter.help} Default {'on' if parameter.default else 'off'}."
    return f"{parameter.help} Default {parameter.default}."
