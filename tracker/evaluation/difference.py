"""The comparison of two evaluations: which figures are better, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from tracker.evaluation.evaluation import Evaluation
from tracker.evaluation.figures import Definition, Direction, Figure, Value

Verdict = Literal["better", "worse", "same", "different", "undefined"]


@dataclass(frozen=True, slots=True)
class Difference:
    """One figure of two evaluations, A the reference and B the new one."""

    definition: Definition[Any]
    """The definition of the figure."""
    unit: str
    """The unit that is displayed; empty for a figure without unit."""
    a: Value
    """The value of A; None if it is undefined."""
    b: Value
    """The value of B; None if it is undefined."""
    difference: Value
    """B − A of the displayed (rounded) values, so that it is 0 if these are equal; None if one of
    them is undefined."""
    verdict: Verdict
    """Whether B is better than A. ``same`` means that the two agree in all displayed decimals;
    ``different`` that neither direction is better; ``undefined`` that one has no value."""
    comparable: bool
    """False where A and B were measured with different settings."""
    measured_with: str
    """The settings that B's value depends on, in words."""


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
    return tuple(_difference(*pair) for pair in zip(a.figures, b.figures, strict=True))


def _difference(a: Figure, b: Figure) -> Difference:
    """Compare the values of one figure."""
    definition, digits = b.definition, b.definition.digits
    before, after = (None if one.value is None else round(one.value, digits) for one in (a, b))
    return Difference(
        definition=definition,
        unit=b.unit,
        a=a.value,
        b=b.value,
        difference=None if before is None or after is None else round(after - before, digits),
        verdict=verdict(definition.direction, digits, a.value, b.value),
        comparable=a.measured_with == b.measured_with,
        measured_with=b.measured_with,
    )
