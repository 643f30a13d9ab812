"""How tall and how far from cameras people usually are, by which an unknown unit is found."""

from __future__ import annotations

import math
from typing import get_args

from tracker.geometry.consistency.consensus import Consensus
from tracker.geometry.consistency.suggestion import STANDING
from tracker.io.read.pieces import METRES, Unit


def likely_unit(away: float, agreed: Consensus) -> Unit:
    """The unit in which the usual person is as tall, and as far from the cameras, as people are.

    Args:
        away: The usual distance from a camera to people, in the world's unit.
        agreed: On how tall they are, in the world's unit.
    """
    if agreed.height <= 0.0:
        return "m"

    def fit(unit: Unit) -> float:
        own = METRES[unit]
        return likelihood_of_size(agreed.height * own, away * own)

    units: tuple[Unit, ...] = get_args(Unit)
    return max(units, key=fit)


_STANDING = 2.0 * float(STANDING[2])
_USUAL_HEIGHTS = ((_STANDING, 0.15, 0.0), (1.2, 0.25, -1.5), (0.7, 0.2, -1.5), (0.25, 0.25, -0.5))
"""People standing, seated, head and torso, heads: metres, spread of the logarithm, log weight.
Units differ by factors of ten and more, or of 3.28 for feet, so rough values decide."""

USUAL_HEIGHTS = tuple(height for height, _, _ in _USUAL_HEIGHTS)
"""Metres: of boxes of people who stand, of seated ones, of heads with shoulders, of heads."""

_USUAL_DISTANCE = (6.0, 0.9)
"""Distance from a camera, metres, and spread of its logarithm. Half and twice the distance and the
spread give the same units in the random rooms of seeds 1300 … 1303."""


def likelihood_of_size(height: float, away: float) -> float:
    """The logarithm of how usual people are of that height, that far from a camera, metres."""
    tall = max(w - 0.5 * (math.log(height / h) / s) ** 2 for h, s, w in _USUAL_HEIGHTS)
    if not away > 0.0:
        return tall
    middle, spread = _USUAL_DISTANCE
    return tall - 0.5 * (math.log(away / middle) / spread) ** 2
