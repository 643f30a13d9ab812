"""What the rooms in which a case fails have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

WORST = 0.1
"""Share of the rooms that counts as the worst."""


@dataclass(frozen=True, slots=True)
class Cause:
    """A property of rooms, and how it goes with failing."""

    name: str
    value: str
    rooms: int
    """How many rooms have it."""
    worst: int
    """How many of the worst have it."""
    found: float
    """Median share found where it is."""
    elsewhere: float
    """And where it is not; NaN where it is everywhere."""


def worst_of(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The worst tenth by the share of positions found, then by false tracks; at least one."""
    ranked = sorted(rows, key=lambda row: (row["found_share"] or 0.0, -row["false_per_step"]))
    return ranked[: max(1, round(WORST * len(ranked)))] if ranked else []


def causes_of(rows: list[dict[str, Any]]) -> list[Cause]:
    """Every property of the rooms, those first that the worst have more often than all.

    Sorted by how much more often, in rooms: with n rooms in all, w of them the worst, and
    k and j of these that have the property, by j - k w / n.
    """
    worst = worst_of(rows)
    found: list[Cause] = []
    for name in rows[0]["causes"] if rows else ():
        values = [row["causes"][name] for row in rows]
        shares = np.array([row["found_share"] or 0.0 for row in rows])
        for value in sorted(set(values)):
            there = np.array([v == value for v in values])
            among = sum(row["causes"][name] == value for row in worst)
            elsewhere = float(np.median(shares[~there])) if not there.all() else float("nan")
            here = float(np.median(shares[there]))
            found.append(Cause(name, value, int(there.sum()), among, here, elsewhere))
    expected = len(worst) / max(1, len(rows))
    return sorted(found, key=lambda cause: cause.rooms * expected - cause.worst)
