"""Two evaluations side by side: which figures are better, and by how much."""

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
    name: str
    unit: str
    digits: int
    direction: Direction
    headline: bool
    a: float | int | None
    b: float | int | None
    difference: float | int | None
    """B − A of the values as they are shown, so that it is 0 where they look the same; None
    where one of them is undefined."""
    verdict: Verdict
    """What B is. ``same`` where the two agree in all decimals that are shown;
    ``different`` where neither direction is better; ``undefined`` where one has no value."""
    comparable: bool
    """False where A and B were measured with different settings."""
    stated: str
    """The settings of B beside the figure."""

    def to_json(self) -> dict[str, Any]:
        """As a plain mapping."""
        return asdict(self)


def verdict(direction: Direction, digits: int, a: float | None, b: float | None) -> Verdict:
    """Whether B is better than A.

    Args:
        direction: Which values are better.
        digits: Decimals that matter.
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
    """Every figure of B against A, in the order of the tables.

    Args:
        a: The reference: the pinned or the previous run.
        b: The run in question.
    """
    before = {figure.definition.key: figure for figure in a.figures}
    return tuple(_difference(before[figure.definition.key], figure) for figure in b.figures)


def _difference(a: Figure, b: Figure) -> Difference:
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
        comparable=a.stated == b.stated,
        stated=b.stated,
    )
