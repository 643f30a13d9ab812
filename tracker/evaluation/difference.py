"""The comparison of two evaluations: which figures are better, and by how much."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from tracker.evaluation.figures import Direction, Figure
from tracker.evaluation.result import Evaluation

Verdict = Literal["better", "worse", "same", "different", "undefined"]


@dataclass(frozen=True, slots=True)
class Difference:
    """One figure of two evaluations, A the reference and B the new one."""

    key: str
    """The key of the figure."""
    name: str
    """The name that is displayed."""
    unit: str
    """The unit that is displayed; empty for a figure without unit."""
    digits: int
    """The number of decimals that are displayed."""
    direction: Direction
    """The values that are better."""
    headline: bool
    """Whether short tables show the figure."""
    a: float | int | None
    """The value of A; None if it is undefined."""
    b: float | int | None
    """The value of B; None if it is undefined."""
    difference: float | int | None
    """B − A of the displayed (rounded) values, so that it is 0 if these are equal; None if one of
    them is undefined."""
    verdict: Verdict
    """Whether B is better than A. ``same`` means that the two agree in all displayed decimals;
    ``different`` that neither direction is better; ``undefined`` that one has no value."""
    comparable: bool
    """False where A and B were measured with different settings."""
    measured_with: str
    """The settings that B's value depends on, in words."""

    def to_json(self) -> dict[str, Any]:
        """Return the fields as a plain mapping; the settings are ``stated`` there."""
        values = asdict(self)
        return values | {"stated": values.pop("measured_with")}


def verdict(direction: Direction, digits: int, a: float | None, b: float | None) -> Verdict:
    """Decide whether B is better than A.

    Args:
        direction: Which values are better.
        digits: The number of decimals in which the values are compared.
        a: The reference; None where undefined.
        b: The new value; None where undefined.
    """
    if a is None or b is None:
        return "same" if a is None and b is None else "undefined"
    if direction == "zero":
        a, b = abs(a), abs(b)
    gain = round(b, digits) - round(a, digits)
    if gain == 0.0:
        return "same"
    if direction == "none":
        return "different"
    return "better" if (gain > 0.0) == (direction == "higher") else "worse"


def compare(a: Evaluation, b: Evaluation) -> tuple[Difference, ...]:
    """Compare every figure of two evaluations, in the order of the tables.

    Args:
        a: The reference, for instance the evaluation of the pinned or the previous run.
        b: The evaluation that is compared with it.
    """
    before = {figure.definition.key: figure for figure in a.figures}
    return tuple(_difference(before[figure.definition.key], figure) for figure in b.figures)


def _difference(a: Figure, b: Figure) -> Difference:
    """Compare the values of one figure."""
    definition = b.definition
    before, after = (
        None if figure.value is None else round(figure.value, definition.digits)
        for figure in (a, b)
    )
    return Difference(
        key=definition.key,
        name=definition.name,
        unit=b.unit,
        digits=definition.digits,
        direction=definition.direction,
        headline=definition.headline,
        a=a.value,
        b=b.value,
        difference=None
        if before is None or after is None
        else round(after - before, definition.digits),
        verdict=verdict(definition.direction, definition.digits, a.value, b.value),
        comparable=a.measured_with == b.measured_with,
        measured_with=b.measured_with,
    )
