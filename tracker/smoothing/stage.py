"""Stage 3: the filter's tracks with hindsight, over all steps of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Sequence as Many
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.fusion import trajectories
from tracker.fusion.model import CONFIRMED
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters, SmoothingParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing import lifetimes, reading
from tracker.smoothing.calibration import Calibration
from tracker.smoothing.identity import identities, pieces
from tracker.smoothing.identity.cutting import Tracked
from tracker.smoothing.identity.people import Seen
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.protocol import Earlier, Nothing
from tracker.smoothing.result import Decision, Joined, Smoothed
from tracker.smoothing.smoother import Fitted, Shared, Smoother

_SEEN = 0.5
"""Association probability from which a camera counts as seeing a person."""


class _Decided(NamedTuple):
    """What was decided of who is who, and between what."""

    decisions: list[Decision]
    joined: Joined | None = None
    limits: Mapping[int, tuple[int, int]] = MappingProxyType({})
    """Of some labels the first and the last step at which corrections let them be."""
    key: str = ""
    """Of what corrections had to be made to hold; empty where that was not asked."""


class _First(NamedTuple):
    """The filter's own tracks, and whose box each was by them."""

    paths: Paths
    shared: Shared


class _Start(NamedTuple):
    """Where the last settling of who is who begins: what nobody's word on that has touched."""

    fitted: Fitted
    shared: Shared
    learnt: Calibration
    contested: Float[ndarray, " N"]
    had: Bool[ndarray, " N"]
    names: Int[ndarray, " N"]
    first: _First


class Positions:
    """Each track of the filter, smoothed over its whole life.

    It is fitted to its boxes, and the boxes are shared out anew by where the tracks lie; gaps
    are filled from both sides, ends cut where the evidence ends, and beginnings drawn back to
    the first box.
    """

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """Prepare for one sequence.

        Args:
            sequence: Cameras and room.
            parameters: Of the fusion, whose models are used, and of the smoothing.
        """
        self._sequence = sequence
        self._parameters = parameters

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: Earlier | None = None,
    ) -> Smoothed:
        """The tracks of some steps from step 0 on, each by the boxes of all of them."""
        p, earlier = self._parameters.smoothing, earlier or Nothing()
        used = self._parameters.method("single_view").used(self._parameters)
        smoother = Smoother(
            self._sequence,
            self._parameters.fusion,
            views,
            corrections,
            learning=p.learning,
            several_boxes=used.finds_people,
        )
        dimension, cameras = smoother.model.motion.dimension, len(smoother.cameras)
        tracks = trajectories.extract(fused, cameras=cameras, extraction_threshold=CONFIRMED)
        if not len(tracks):
            return Smoothed.empty(dimension, cameras)
        paths, had = reading.read_paths(fused, tracks, dimension)
        existences = np.where(had, 1.0, lifetimes.UNSURE)
        links = reading.read_links(fused, paths, smoother.cameras)
        check()
        paths, existences, links, learnt, decided = self._named(
            smoother, paths, existences, links, views, check, corrections, earlier
        )
        known: Smoothed | None = earlier.get(f"smoothed-{decided.key}") if decided.key else None
        if known is not None:
            return known
        turns = p.iterations if learnt is None else 1  # what was settled lies near its boxes
        fitted, shared, learnt = _settled(
            smoother, paths, existences, links, p, learnt, check, turns=turns
        )
        found = _finished(smoother, fitted, shared, learnt, p, decided)
        if decided.key:
            earlier.put(f"smoothed-{decided.key}", found)
        return found

    def _named(
        self,
        smoother: Smoother,
        paths: Paths,
        existences: Float[ndarray, " N"],
        links: Links,
        views: Many[tuple[ViewResult, ...]],
        check: Callable[[], None],
        corrections: Many[Correction],
        earlier: Earlier,
    ) -> tuple[Paths, Float[ndarray, " N"], Links, Calibration | None, _Decided]:
        """The tracks of people, with which existence each row asks for boxes, and what was learnt
        on the way: here the filter's own."""
        return paths, existences, links, None, _Decided([])


class Identities(Positions):
    """Smoothed, and who is who settled: tracks cut where it was a draw, and joined at once."""

    def _named(
        self,
        smoother: Smoother,
        paths: Paths,
        existences: Float[ndarray, " N"],
        links: Links,
        views: Many[tuple[ViewResult, ...]],
        check: Callable[[], None],
        corrections: Many[Correction],
        earlier: Earlier,
    ) -> tuple[Paths, Float[ndarray, " N"], Links, Calibration | None, _Decided]:
        p = self._parameters.smoothing
        seen = Seen.of(views) if p.appearance > 0.0 else Seen()
        start: _Start | None = earlier.get("start")
        if start is None:
            start = self._start(smoother, paths, existences, links, seen, check)
            earlier.put("start", start)
        tracked = Tracked(
            smoother, start.fitted, start.shared, start.contested, start.had, start.names
        )
        found, key = identities.settle(tracked, p, seen, corrections, earlier)
        check()
        existences = np.where(found.had, 1.0, lifetimes.UNSURE)
        first = start.first
        gone = np.flatnonzero(~np.isin(first.paths.labels, found.names)).tolist()
        removed = []
        if gone:
            _, odds = lifetimes.lifetimes(smoother, first.paths, first.shared, p)
            removed = [_removed(first.paths, path, odds[path]) for path in gone]
        decided = _Decided([*found.decisions, *removed], found.joined, found.limits, key)
        return found.paths, existences, found.links, start.learnt.of_people(found.origins), decided

    def _start(
        self,
        smoother: Smoother,
        paths: Paths,
        existences: Float[ndarray, " N"],
        links: Links,
        seen: Seen,
        check: Callable[[], None],
    ) -> _Start:
        """All rounds but the last settling, which alone obeys what was said of who is who."""
        p = self._parameters.smoothing
        contested = pieces.contested(paths, links)
        fitted, shared, learnt = _settled(
            smoother, paths, existences, links, p, None, check, turns=p.iterations
        )
        first = _First(fitted.paths, shared)
        names = np.where(existences == 1.0, paths.labels[paths.owners], -1)
        for _ in range(p.rounds - 1):
            tracked = Tracked(smoother, fitted, shared, contested, existences == 1.0, names)
            found, _key = identities.settle(tracked, p, seen)
            check()
            existences, names = np.where(found.had, 1.0, lifetimes.UNSURE), found.names
            learnt = learnt.of_people(found.origins)
            # who is who tells whose boxes are whose, and those again who is who
            fitted, shared, learnt = _settled(
                smoother, found.paths, existences, found.links, p, learnt, check, turns=1
            )
            contested = pieces.contested(fitted.paths, shared.links)
        return _Start(fitted, shared, learnt, contested, existences == 1.0, names, first)


def _settled(
    smoother: Smoother,
    paths: Paths,
    existences: Float[ndarray, " N"],
    links: Links,
    p: SmoothingParams,
    learnt: Calibration | None,
    check: Callable[[], None],
    turns: int,
) -> tuple[Fitted, Shared, Calibration]:
    """Tracks fitted to their boxes, boxes shared out by the tracks that are there, in turns."""
    learnt = learnt or smoother.stated(paths)
    fitted = smoother.fit(paths, links, 2, learnt)
    shared = smoother.share(fitted.paths, existences, learnt)
    for _ in range(turns):
        check()
        existences, _ = lifetimes.lifetimes(smoother, fitted.paths, shared, p)
        if p.learning:
            learnt = smoother.learn(fitted.paths, shared.links, learnt)
        fitted = smoother.fit(fitted.paths, shared.links, 1, learnt)
        shared = smoother.share(fitted.paths, existences, learnt)
    return fitted, shared, learnt


def _finished(
    smoother: Smoother,
    fitted: Fitted,
    shared: Shared,
    learnt: Calibration,
    p: SmoothingParams,
    decided: _Decided,
) -> Smoothed:
    """The tracks with their ends settled, and what is nobody left out."""
    longer, existences = lifetimes.extended(
        smoother, fitted.paths, round(p.reach / smoother.model.step_time)
    )
    away = _outside(longer, decided.limits)
    existences = np.where(away, 0.0, existences)
    shared = smoother.share(longer, existences, learnt)
    fitted = smoother.fit(longer, shared.links, 1, learnt)
    if p.learning:
        learnt = smoother.placed(fitted.paths, learnt)
        if learnt.shifts.any():
            fitted = smoother.fit(fitted.paths, shared.links, 1, learnt)
    shared = smoother.share(fitted.paths, existences, learnt)
    there, odds = lifetimes.lifetimes(smoother, fitted.paths, shared, p)
    there[away] = 0.0
    paths = fitted.places.led_to(fitted.paths, smoother.model.step_time)
    owners = paths.owners
    somebody = odds > 0.0
    removed = [_removed(paths, path, odds[path]) for path in np.flatnonzero(~somebody).tolist()]
    links = shared.links
    seen = np.zeros((len(there), len(smoother.cameras)), dtype=bool)
    sure = links.shares > _SEEN
    seen[links.rows[sure], links.cameras[sure]] = True
    rows = np.flatnonzero(somebody[owners])
    rows = rows[np.lexsort((paths.labels[owners[rows]], paths.steps[rows]))]
    return Smoothed(
        paths.steps[rows],
        paths.labels[owners[rows]],
        paths.states[rows],
        paths.covariances[rows],
        there[rows],
        seen[rows],
        tuple(sorted([*decided.decisions, *removed], key=lambda one: (one.step, one.label))),
        learnt,
        decided.joined,
    )


def _removed(paths: Paths, path: int, odds: float) -> Decision:
    """That a track is nobody's: by its odds in its whole life, or as no piece of it is left."""
    nobody = float(1.0 / (1.0 + np.exp(np.clip(odds, -600.0, 600.0))))
    reason = (
        "over its whole life it is likelier nobody"
        if odds <= 0.0
        else "no piece of it stands by boxes of its own"
    )
    label = int(paths.labels[path])
    return Decision("removed", int(paths.firsts[path]), label, label, nobody, 1.0 - nobody, reason)


def _outside(paths: Paths, limits: Mapping[int, tuple[int, int]]) -> Bool[ndarray, " N"]:
    """The rows at which corrections do not let a person be."""
    away = np.zeros(len(paths.states), dtype=bool)
    for path, label in enumerate(paths.labels.tolist()):
        if label in limits:
            first, last = limits[label]
            own = slice(int(paths.starts[path]), int(paths.starts[path + 1]))
            steps = int(paths.firsts[path]) + np.arange(own.stop - own.start)
            away[own] = (steps < first) | (steps > last)
    return away
