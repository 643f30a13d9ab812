"""What was looked at more closely in a picture and not believed, and at which gate it fell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int8
from numpy import ndarray

CANDIDATES, DROPPED = "candidates", "dropped for "
"""Names in a result's information: how many places were looked at more closely, and, followed
by the name of a gate, how many of them fell there."""

GATES = (
    "colour", "foreground", "surroundings", "shape", "another at its place", "another's shoulders",
)  # fmt: skip
"""All that a method may have, by number."""


@dataclass(frozen=True, slots=True, eq=False)
class Dropped:
    """D candidates of one picture that fell."""

    boxes: Float32[ndarray, "D 4"]
    """``centre_x, centre_y, half_width, half_height`` in pixels."""
    gates: Int8[ndarray, " D"]
    """Of each its place in :data:`GATES`."""

    @staticmethod
    def none() -> Dropped:
        """Nothing fell, or the method has no gates."""
        return Dropped(np.zeros((0, 4), np.float32), np.zeros(0, np.int8))

    @staticmethod
    def of(candidates: Float[ndarray, "M 4"], fell: Mapping[str, Bool[ndarray, " M"]]) -> Dropped:
        """Of some candidates those that fell.

        Args:
            candidates: Boxes.
            fell: Which of them, by gate; no two gates take the same one.
        """
        gates = np.full(len(candidates), -1, np.int8)
        for gate, taken in fell.items():
            gates[taken] = GATES.index(gate)
        gone = gates >= 0
        return Dropped(candidates[gone].astype(np.float32), gates[gone])

    def information(self, passed: int) -> dict[str, float]:
        """How many candidates there were and fell where, by name.

        Args:
            passed: How many fell nowhere.
        """
        counts = np.bincount(self.gates, minlength=len(GATES))
        told = {CANDIDATES: float(passed + len(self.gates))}
        return told | {
            DROPPED + gate: float(count)
            for gate, count in zip(GATES, counts.tolist(), strict=True)
            if count
        }
