"""Rejected candidates of one image, with the gates that rejected them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int8
from numpy import ndarray

CANDIDATES, DROPPED = "candidates", "dropped for "
"""Names in a result's information: the number of candidates, and, followed by the name of a gate,
the number that it rejected."""

GATES = (
    "colour", "foreground", "surroundings", "shape", "another at its place", "another's shoulders",
    "outline", "a place outside the room",
)  # fmt: skip
"""All gates that methods may have, by number."""


@dataclass(frozen=True, slots=True, eq=False)
class Dropped:
    """The D rejected candidates of one image."""

    boxes: Float32[ndarray, "D 4"]
    """``centre_x, centre_y, half_width, half_height`` in pixels."""
    gates: Int8[ndarray, " D"]
    """Index into :data:`GATES` of the gate that rejected each."""

    @staticmethod
    def none() -> Dropped:
        """No rejected candidate, as for a method without gates."""
        return Dropped(np.zeros((0, 4), np.float32), np.zeros(0, np.int8))

    @staticmethod
    def of(candidates: Float[ndarray, "M 4"], gates: Mapping[str, Bool[ndarray, " M"]]) -> Dropped:
        """Select the rejected ones of M candidates.

        Args:
            candidates: Boxes of the candidates, pixels.
            gates: Which of them each gate rejected; at most one gate for each.
        """
        numbers = np.full(len(candidates), -1, np.int8)
        for gate, rejected in gates.items():
            numbers[rejected] = GATES.index(gate)
        gone = numbers >= 0
        return Dropped(candidates[gone].astype(np.float32), numbers[gone])

    def information(self, passed: int) -> dict[str, float]:
        """The number of candidates and of those that each gate rejected, by name.

        Args:
            passed: Number of candidates that no gate rejected.
        """
        counts = np.bincount(self.gates, minlength=len(GATES))
        total = {CANDIDATES: float(passed + len(self.gates))}
        return total | {
            DROPPED + gate: float(count)
            for gate, count in zip(GATES, counts.tolist(), strict=True)
            if count
        }
