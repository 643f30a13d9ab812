"""Who is meant: the rows of a run's tracks at the places of a correction."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections.contradictions import NEAR, along
from tracker.corrections.kinds import REACH, Correction, Place


class Whereabouts:
    """Where tracks are, to be asked who was at a place."""

    def __init__(
        self,
        steps: Int[ndarray, " N"],
        positions: Float[ndarray, "N 3"],
        owners: Int[ndarray, " N"] | None = None,
    ) -> None:
        """Prepare for N rows of tracks, in any order.

        Args:
            steps: Of each row.
            positions: World metres.
            owners: Whose each row is, by which who is not there at a step is taken to have gone
                straight on; without it, to have stood.
        """
        self._order = np.argsort(steps, kind="stable")
        self._steps = steps[self._order]
        self._ground = positions[self._order, :2]
        self._before = self._after = np.zeros_like(self._ground)
        if owners is not None:
            self._before, self._after = _ways(self._steps, self._ground, owners[self._order])

    def at(self, step: int) -> slice:
        """The rows of a step, as places in the order of steps."""
        low, high = np.searchsorted(self._steps, [step, step + 1])
        return slice(int(low), int(high))

    def nearest(self, place: Place, *, leeway: int = 0, reach: float = REACH) -> int | None:
        """The row that a place means: the nearest on the ground within reach, None for nobody.

        Args:
            place: Step and position.
            leeway: Steps before and after within which somebody counts who is not there at the
                very step, where he would be then; all of them count half as much as ``reach``.
            reach: Metres.
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

    def stated(self, here: Correction) -> int | None:
        """The row of who *is here* says is there: at the place, or where a run had whom it means.

        As long as nobody is at the place itself, it is who is at the second place that goes there.
        """
        place, *meant = here.places
        if not meant:
            return self.nearest(place)
        there = self.nearest(place, reach=NEAR)
        return self.nearest(meant[0]) if there is None else there

    def inside(self, nobody: Correction) -> Bool[ndarray, " N"]:
        """The rows within reach of the way along the places of *nobody*, at its steps."""
        found = np.zeros(len(self._steps), dtype=bool)
        around = nobody.accuracy or 0.0
        first, last = nobody.steps
        for step in range(first, last + 1):
            own = self.at(step)
            where = along(nobody.places, step)
            if own.start < own.stop and where is not None:
                near = np.hypot(*(self._ground[own] - where).T) <= around
                found[self._order[own]] = near
        return found


def _ways(
    steps: Int[ndarray, " N"], ground: Float[ndarray, "N 2"], owners: Int[ndarray, " N"]
) -> tuple[Float[ndarray, "N 2"], Float[ndarray, "N 2"]]:
    """Metres a step by which each row's owner came to it, and went on from it; 0 at an end."""
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
    """The owners who are nobody: whose rows at the steps of the correction are mostly along it.

    Somebody who only passes by is not meant, nor who is there for one step of many alone: where the
    births that were forbidden are allowed again, somebody may begin at the very last of them.
    """
    first, last = one.steps
    during = (steps >= first) & (steps <= last)
    if not inside.any():
        return set()
    count = int(owners.max()) + 1
    there = np.bincount(owners[during], minlength=count)
    along_it = np.bincount(owners[inside], minlength=count)
    whole = np.bincount(owners, minlength=count)
    touches = (along_it == 1) & (whole > 1) & (first < last)
    return set(np.flatnonzero((along_it > 0) & (2 * along_it > there) & ~touches).tolist())
