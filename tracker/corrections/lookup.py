"""Lookup of the rows of tracks that the places of corrections refer to."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections.consistency import NEAR, along
from tracker.corrections.kinds import REACH, Correction, Place


class TrackIndex:
    """An index of the rows of tracks by step, for finding the track at a place."""

    def __init__(
        self,
        steps: Int[ndarray, " N"],
        positions: Float[ndarray, "N 3"],
        owners: Int[ndarray, " N"] | None = None,
    ) -> None:
        """Index N rows of tracks, in any order.

        Args:
            steps: Step of each row.
            positions: Position of each row, world metres.
            owners: Track of each row, by which positions are extrapolated linearly to steps
                without a row; with None they are constant.
        """
        self._order = np.argsort(steps, kind="stable")
        self._steps = steps[self._order]
        self._ground = positions[self._order, :2]
        self._before = self._after = np.zeros_like(self._ground)
        if owners is not None:
            self._before, self._after = _velocities(self._steps, self._ground, owners[self._order])

    def at(self, step: int) -> slice:
        """Return the slice of one step among the rows sorted by step."""
        low, high = np.searchsorted(self._steps, [step, step + 1])
        return slice(int(low), int(high))

    def nearest(self, place: Place, *, leeway: int = 0, reach: float = REACH) -> int | None:
        """Return the row that a place refers to, the nearest on the ground within reach; else None.

        Args:
            place: Step and position.
            leeway: Number of steps before and after from which rows are extrapolated to the step
                of the place; ``leeway`` steps cost as much as half of ``reach``.
            reach: Largest distance on the ground, metres.
        """
        low = int(np.searchsorted(self._steps, place.step - leeway))
        high = int(np.searchsorted(self._steps, place.step + leeway, side="right"))
        if low == high:
            return None
        later = place.step - self._steps[low:high]
        way = np.where((later > 0)[:, None], self._before[low:high], self._after[low:high])
        ground = self._ground[low:high] + later[:, None] * way
        apart = np.hypot(*(ground - [place.x, place.y]).T)
        cost = apart + np.abs(later) * (0.5 * reach / max(leeway, 1))
        best = int(np.argmin(cost))
        return int(self._order[low + best]) if cost[best] <= reach else None

    def row_of(self, here: Correction) -> int | None:
        """Return the row that a correction of kind ``here`` refers to, None for none.

        It is the row at the place itself or, if there is no track, the row at the second place, at
        which the run had the track when the correction was made.
        """
        place, *meant = here.places
        if not meant:
            return self.nearest(place)
        there = self.nearest(place, reach=NEAR)
        return self.nearest(meant[0]) if there is None else there

    def inside(self, correction: Correction) -> Bool[ndarray, " N"]:
        """The rows within the accuracy of the interpolated places of a *nobody* correction."""
        found = np.zeros(len(self._steps), dtype=bool)
        around = correction.accuracy or 0.0
        first, last = correction.steps
        for step in range(first, last + 1):
            own = self.at(step)
            where = along(correction.places, step)
            if where is not None:
                near = np.hypot(*(self._ground[own] - where).T) <= around
                found[self._order[own]] = near
        return found


def _velocities(
    steps: Int[ndarray, " N"], ground: Float[ndarray, "N 2"], owners: Int[ndarray, " N"]
) -> tuple[Float[ndarray, "N 2"], Float[ndarray, "N 2"]]:
    """Compute the velocity of each row's track before and after the row, metres per step.

    It is 0 at an end of the track.

    Args:
        steps: Step of each of N rows.
        ground: Position of each row on the ground, world metres.
        owners: Track of each row.
    """
    before, after = np.zeros_like(ground), np.zeros_like(ground)
    order = np.lexsort((steps, owners))
    one, other = order[:-1], order[1:]
    same = (owners[one] == owners[other]) & (steps[one] < steps[other])
    one, other = one[same], other[same]
    way = (ground[other] - ground[one]) / (steps[other] - steps[one])[:, None]
    before[other], after[one] = way, way
    return before, after


def mostly_inside(
    owners: Int[ndarray, " N"],
    steps: Int[ndarray, " N"],
    inside: Bool[ndarray, " N"],
    one: Correction,
) -> set[int]:
    """Select the tracks that a *nobody* correction refers to: those with most of their rows inside.

    A track that only passes is left out, and so is a longer one with a single row inside, which may
    be born at the last step of the correction, after which births are allowed again.

    Args:
        owners: Track of each of N rows.
        steps: Step of each row.
        inside: Whether each row is within the accuracy of the correction's places.
        one: The correction.
    """
    first, last = one.steps
    during = (steps >= first) & (steps <= last)
    if not inside.any():
        return set()
    count = int(owners.max()) + 1
    there = np.bincount(owners[during], minlength=count)
    along_it = np.bincount(owners[inside], minlength=count)
    lengths = np.bincount(owners, minlength=count)
    touches = (along_it == 1) & (lengths > 1) & (first < last)
    return set(np.flatnonzero((2 * along_it > there) & ~touches).tolist())
