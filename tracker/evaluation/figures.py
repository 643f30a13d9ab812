"""The definition and the value of a figure: name, unit, direction, meaning, source and function."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from numpy import ndarray

from tracker.evaluation.settings import EvaluationSettings

Direction = Literal["higher", "lower", "zero", "none"]
"""The values that are better: higher, lower, nearer to zero, or none in general."""

Value = float | int | None
"""The value of a figure; None where it is undefined."""

S = TypeVar("S")

GATED = ("distance", "gate")
"""The settings of the figures that pair people and estimates by the gate."""
CUT = ("distance", "cutoff", "order")
"""The settings of OSPA and GOSPA."""


@dataclass(frozen=True, slots=True)
class Definition(Generic[S]):
    """The definition of one figure; it stands beside the measure that the figure is a part of."""

    key: str
    """The key of the figure."""
    name: str
    """The name that is displayed."""
    group: str
    """The name of the group of figures in tables."""
    unit: str
    """The unit; ``{d}`` stands for the unit of the distance, ``{d^p}`` for its p-th power in the
    parts of GOSPA."""
    direction: Direction
    """The values that are better."""
    digits: int
    """The number of decimals that are displayed, and in which values are compared."""
    settings: tuple[str, ...]
    """The names of the settings that the value depends on."""
    help: str
    """The definition in words."""
    function: Callable[[S], Value]
    """The function that takes the value from the result of the measure."""
    source: str = ""
    """The reference; empty where the figure has none."""
    headline: bool = False
    """Whether short tables show the figure."""

    def unit_for(self, settings: EvaluationSettings) -> str:
        """Return the unit with the chosen distance and order."""
        power = f"^{settings.order:g}" if settings.order != 1.0 and settings.unit else ""
        return self.unit.replace("{d^p}", settings.unit + power).replace("{d}", settings.unit)


@dataclass(frozen=True, slots=True)
class Figure:
    """The value of one figure, and the settings it was measured with."""

    definition: Definition[Any]
    """The definition of the figure."""
    value: Value
    """The value; None where it is undefined (see the function that computes it)."""
    unit: str
    """The unit of the value; empty for a figure without unit."""
    measured_with: str
    """The settings that the value depends on, such as gate, cut-off, order and window, in words."""

    @property
    def text(self) -> str:
        """The value as tables display it, without unit; an en dash where undefined."""
        return number(self.value, self.definition.digits)


def figures(
    definitions: Iterable[Definition[S]], result: S, settings: EvaluationSettings
) -> tuple[Figure, ...]:
    """Return the figures of one measure.

    Args:
        definitions: The definitions of the measure.
        result: The result of the measure.
        settings: The settings that it was computed with.
    """
    return tuple(
        Figure(one, one.function(result), one.unit_for(settings), settings.in_words(one.settings))
        for one in definitions
    )


def number(value: Value, digits: int, *, sign: bool = False) -> str:
    """Format a value with fixed decimals and a typographic minus; None becomes an en dash.

    Args:
        value: The value, or None.
        digits: The number of decimals.
        sign: Whether a positive value gets a plus.
    """
    if value is None:
        return "–"
    rounded = round(float(value), digits) + 0.0  # −0.0 + 0.0 is 0.0
    return f"{rounded:{'+' if sign and rounded else ''}.{digits}f}".replace("-", "−")


def mean(values: ndarray) -> float | None:
    """Return the mean of some values; None without values."""
    return float(values.mean()) if len(values) else None


def percentile_95(values: ndarray) -> float | None:
    """Return the 95th percentile of some values; None without values."""
    return float(np.percentile(values, 95)) if len(values) else None
