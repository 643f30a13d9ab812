"""Who goes on as whom stays as it was, where nobody said anything of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.smoothing.identity.pieces import Pairs
from tracker.smoothing.paths import Paths

_STAYS = 8.0
"""Log odds by which a join that was made before anything was said of people is likelier than what
its model says: who puts one thing right has not said that others are wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class Staying:
    """What was settled of N rows of tracks before anything was said of people.

    To make a sentence hold, the likeliest joining of all pieces may part and join others anew that
    nobody spoke of; each of these joins was the likeliest before, and the odds of many are near
    even. So every join i → j that was made has its gain and s more,

        gain'_ij = gain_ij + s where one person had the end of i and the beginning of j

    and what a sentence takes apart is joined by its own odds. It is one beginning for all that is
    said, in whatever order: the sentences that are left after one is taken back give what they
    alone would give.
    """

    people: Int[ndarray, " N"] | None = None
    """The label of each row, -1 where nobody has it; None where nothing was settled."""

    def gains(self, pairs: Pairs, cut: Paths, kept: Int[ndarray, " M"]) -> Float[ndarray, " P"]:
        """The gains of pairs of pieces, those that were joined with more.

        Args:
            pairs: Of pieces.
            cut: The pieces.
            kept: The row that each of their rows was.
        """
        if self.people is None or not len(pairs.gains):
            return pairs.gains
        first = self.people[kept[cut.starts[:-1]]]
        last = self.people[kept[cut.starts[1:] - 1]]
        stays = (last[pairs.earlier] == first[pairs.later]) & (last[pairs.earlier] >= 0)
        return np.asarray(pairs.gains + _STAYS * stays)
