"""Stage 3: the methods that smooth the filter's tracks over all steps of a recording."""

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
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing import lifetimes
from tracker.smoothing.calibration import Calibration
from tracker.smoothing.paths import CameraBoxes, Links, Paths, contested_shares
from tracker.smoothing.protocol import Decision, EmptyStore, LinkedTracklets, ResultStore, Smoothed
from tracker.smoothing.smoother import BoxAssociations, Fitted, Smoother
from tracker.smoothing.tracklets import linking
from tracker.smoothing.tracklets.appearance import Appearances
from tracker.smoothing.tracklets.linking import LinkedTracks
from tracker.smoothing.tracklets.splitting import Tracked
from tracker.steps import Steps

REACH = 1.0
"""Time before the first and after the last box of a track in which further boxes are sought,
seconds. From 0.2 to 3 s, no figure of the random rooms, random crowds and recordings of
``tests/papers/rooms/fusion_ablations.md`` changes by more than 0.002."""

_SEEN = 0.5
"""Association probability above which a camera counts as detecting a track. At 0.25 and 0.75 no
figure of ``tests/papers/rooms/fusion_constants.md`` changes."""

_WIDE = 1.0
"""Initial variance of a state in a gap of the filter's track, m² and (m/s)². From a quarter to four
times as much, no figure there changes by 0.0001."""

_AT_ONCE = 1024
"""Number of steps whose associations are converted at a time."""


class _Resolution(NamedTuple):
    """The resolution of identities."""

    decisions: list[Decision]
    """Differences from the filter's tracks."""
    joined: LinkedTracklets | None = None
    """The tracklets of the tracks."""
    limits: Mapping[int, tuple[int, int]] = MappingProxyType({})
    """First and last step at which corrections let a track exist, by its label."""


class _FilterTracks(NamedTuple):
    """The filter's n tracks as they were in the first round, without their states."""

    paths: Paths
    odds: Float[ndarray, " n"]
    """Log odds of each, of existing at any step."""


class _LastRoundInput(NamedTuple):
    """The input of the last resolution of identities, which does not depend on corrections of
    identity."""

    fitted: Fitted
    """The tracks of the round before, fitted to their boxes."""
    shared: BoxAssociations
    """Association probabilities of their rows."""
    learnt: Calibration
    """The self-calibration of the boxes."""
    contested: Float[ndarray, " N"]
    """Share of each row's boxes that may belong to another track as well, 0 … 1."""
    had: Bool[ndarray, " N"]
    """Whether the filter, or the round before, had a track at each row; other rows fill gaps."""
    names: Int[ndarray, " N"]
    """The filter's label of each row, -1 where it had no track."""
    first: _FilterTracks
    """The filter's own tracks."""


class PositionSmoothing:
    """Each track of the filter, smoothed over its whole duration.

    A track is fitted to its boxes, and the boxes are associated again with the fitted tracks;
    gaps are filled from both sides, the end is moved to that of the evidence, and the beginning
    to the first box.
    """

    def __init__(self, sequence: Sequence, parameters: RunParameters) -> None:
        """Prepare the method for one sequence.

        Args:
            sequence: The cameras and the room.
            parameters: The parameters of the fusion, whose models are used, and of the smoothing.
        """
        self._sequence = sequence
        self._parameters = parameters

    def smooth(
        self,
        views: Many[tuple[ViewResult, ...]],
        fused: Many[FusionResult],
        check: Callable[[], None] = lambda: None,
        corrections: Many[Correction] = (),
        earlier: ResultStore | None = None,
    ) -> Smoothed:
        """Estimate the tracks of some steps from step 0 on, each from the boxes of all steps."""
        p, earlier = self._parameters.smoothing, earlier or EmptyStore()
        used = self._parameters.method("single_view").used(self._parameters)
        seen = Steps.of(views, ViewResult, len(self._sequence.views))
        results = Steps.of(fused, FusionResult)
        smoother = Smoother(
            self._sequence,
            self._parameters.fusion,
            seen,
            corrections,
            learning=p.learning,
            several_boxes=used.finds_people,
        )
        dimension, cameras = smoother.model.motion.dimension, len(smoother.cameras)
        tracks = trajectories.extract(results, cameras=cameras, extraction_threshold=CONFIRMED)
        if not len(tracks):
            return Smoothed.empty(dimension, cameras)
        refinement = _Refinement(smoother, p, check, results, tracks)
        del tracks
        check()
        return self._refine(refinement, seen, corrections, earlier)

    def _refine(
        self,
        tracks: _Refinement,
        views: Steps[tuple[ViewResult, ...]],
        corrections: Many[Correction],
        earlier: ResultStore,
    ) -> Smoothed:
        """Smooth the filter's tracks; here they keep their identities."""
        return tracks.finish(self._parameters.smoothing.iterations, _Resolution([]))


class IdentitySmoothing(PositionSmoothing):
    """Tracks smoothed with their identities resolved: split where ambiguous, and linked at once."""

    def _refine(
        self,
        tracks: _Refinement,
        views: Steps[tuple[ViewResult, ...]],
        corrections: Many[Correction],
        earlier: ResultStore,
    ) -> Smoothed:
        """Split the filter's tracks into tracklets, and smooth the linked ones."""
        p = self._parameters.smoothing
        seen = Appearances.of(views) if p.appearance > 0.0 else Appearances()
        start: _LastRoundInput | None = earlier.get("start")
        if start is None:
            start = self._before_last_round(tracks, seen)
            earlier.put("start", start)
        given = [
            Tracked(
                tracks.smoother, start.fitted, start.shared, start.contested, start.had, start.names
            )
        ]  # nothing else holds them when they are linked for the last time
        learnt, first = start.learnt, start.first
        del start

        def finish(found: LinkedTracks, key: str) -> Smoothed:
            """Smooth linked tracks, unless that was done before."""
            known: Smoothed | None = earlier.get(f"smoothed-{key}")
            if known is not None:
                return known
            tracks.check()
            tracks.learnt = learnt
            tracks.adopt(found)
            gone = np.flatnonzero(~np.isin(first.paths.labels, found.names)).tolist()
            removed = [_removal(first.paths, path, first.odds[path]) for path in gone]
            decided = _Resolution([*found.decisions, *removed], found.joined, found.limits)
            del found
            finished = tracks.finish(1, decided)  # resolved tracks are near their boxes
            earlier.put(f"smoothed-{key}", finished)
            return finished

        return linking.link_with_corrections(given.pop(), p, seen, corrections, earlier, finish)

    def _before_last_round(self, tracks: _Refinement, seen: Appearances) -> _LastRoundInput:
        """Run all rounds but the last resolution, the only one with corrections of identity.

        Args:
            tracks: The filter's tracks, which are taken.
            seen: Appearance of the boxes.
        """
        p, smoother = self._parameters.smoothing, tracks.smoother
        contested = contested_shares(tracks.paths, tracks.links)
        had = tracks.existences == 1.0
        names = np.where(had, tracks.paths.labels[tracks.paths.owners], -1)
        fitted, shared = tracks.fit_and_share(p.iterations)
        _, odds = lifetimes.estimate_lifetimes(smoother, fitted.paths, shared, p)
        first = _FilterTracks(fitted.paths.without_states(), odds)
        for _ in range(p.rounds - 1):
            tracked = Tracked(smoother, fitted, shared, contested, had, names)
            del fitted, shared
            found = linking.link_tracks(tracked, p, seen)
            del tracked
            tracks.check()
            had, names = found.had, found.names
            tracks.adopt(found)
            del found
            # resolved identities improve the association of boxes, and the association identities
            fitted, shared = tracks.fit_and_share(1)
            contested = contested_shares(fitted.paths, shared.links)
        return _LastRoundInput(fitted, shared, tracks.learnt, contested, had, names, first)


class _Refinement:
    """Tracks with N rows that are fitted to their boxes and associated with them again.

    The tracks are given away once in every turn, so that nothing holds the states while the fit
    replaces them.
    """

    def __init__(
        self,
        smoother: Smoother,
        parameters: SmoothingParams,
        check: Callable[[], None],
        results: Steps[FusionResult],
        tracks: Trajectories,
    ) -> None:
        """Begin with the filter's tracks, as they are reported.

        Args:
            smoother: The models and the boxes.
            parameters: The parameters of the smoothing.
            check: A function that is called in every turn and raises an exception to stop.
            results: The result of stage 2 for each step.
            tracks: The tracks extracted from these.
        """
        self.smoother, self.check = smoother, check
        self._parameters = parameters
        self.paths, had = read_paths(results, tracks, smoother.model.motion.dimension)
        self.links = read_links(results, self.paths, smoother.cameras)
        """Association probabilities of rows and boxes."""
        self.existences = np.where(had, 1.0, lifetimes.UNSURE)
        """Prior existence probability of each row."""
        self.learnt = smoother.uncalibrated(self.paths)
        """The self-calibration of the boxes so far."""

    def adopt(self, found: LinkedTracks) -> None:
        """Go on with linked tracklets in place of the tracks."""
        self.learnt = self.learnt.of_people(found.origins)
        existences = np.where(found.had, 1.0, lifetimes.UNSURE)
        self.paths, self.existences, self.links = found.paths, existences, found.links

    def _take_paths(self) -> Paths:
        """The tracks, whose states are forgotten here."""
        found, self.paths = self.paths, self.paths.without_states()
        return found

    def _take_links(self) -> Links:
        """The links, which are forgotten here."""
        found, self.links = self.links, Links.none()
        return found

    def _fit(self, turns: int) -> Fitted:
        """Fit the tracks to their boxes in some turns."""
        return self.smoother.fit(self._take_paths(), self._take_links(), turns, self.learnt)

    def fit_and_share(self, turns: int) -> tuple[Fitted, BoxAssociations]:
        """Alternate fitting tracks to their boxes and associating boxes with the tracks.

        Args:
            turns: Number of turns.
        """
        smoother, p = self.smoother, self._parameters
        fitted = self._fit(2)
        shared = smoother.associate(fitted.paths, self.existences, self.learnt)
        for _ in range(turns):
            self.check()
            self.paths = fitted.paths
            del fitted
            self.existences, _ = lifetimes.estimate_lifetimes(smoother, self.paths, shared, p)
            if p.learning:
                self.learnt = smoother.learn(self.paths, shared.links, self.learnt)
            self.links = shared.links
            del shared
            fitted = self._fit(1)
            shared = smoother.associate(fitted.paths, self.existences, self.learnt)
        return fitted, shared

    def finish(self, turns: int, decided: _Resolution) -> Smoothed:
        """Fit tracks with settled identities, estimate their ends, and remove false tracks.

        Args:
            turns: Number of turns of fitting and associating.
            decided: The resolution of identities.
        """
        p, smoother = self._parameters, self.smoother
        fitted, shared = self.fit_and_share(turns)
        del shared
        longer, existences = lifetimes.extend_paths(
            smoother, fitted.paths, round(REACH / smoother.model.step_time)
        )
        del fitted
        away = _outside_spans(longer, decided.limits)
        existences = np.where(away, 0.0, existences)
        shared = smoother.associate(longer, existences, self.learnt)
        self.paths, self.links = longer, shared.links
        del longer
        fitted = self._fit(1).without_predictions()
        if p.learning:
            self.learnt = smoother.with_shifts(fitted.paths, self.learnt)
            if self.learnt.shifts.any():
                fitted = smoother.fit(fitted.paths, shared.links, 1, self.learnt)
                fitted = fitted.without_predictions()
        del shared
        shared = smoother.associate(fitted.paths, existences, self.learnt)
        reported = smoother.reported(fitted, shared.links, self.learnt) if p.learning else None
        there, odds = lifetimes.estimate_lifetimes(smoother, fitted.paths, shared, p)
        there[away] = 0.0
        paths = fitted.places.lead(fitted.paths, smoother.model.step_time)
        noise = None if reported is None else reported.noise
        covariances = paths.covariances if reported is None else reported.covariances
        owners = paths.owners
        heights = np.full((2, len(paths.labels)), np.nan)
        if reported is not None:
            certain = paths.with_states(paths.states, covariances)
            heights[:] = smoother.heights(certain, shared.links, reported.learnt, reported.noise)
        present = odds > 0.0
        removed = [_removal(paths, path, odds[path]) for path in np.flatnonzero(~present).tolist()]
        links = shared.links
        seen = np.zeros((len(there), len(smoother.cameras)), dtype=bool)
        sure = links.shares > _SEEN
        seen[links.rows[sure], links.cameras[sure]] = True
        rows = np.flatnonzero(present[owners])
        rows = rows[np.lexsort((paths.labels[owners[rows]], paths.steps[rows]))]
        return Smoothed(
            paths.steps[rows],
            paths.labels[owners[rows]],
            paths.states[rows],
            covariances[rows],
            there[rows],
            seen[rows],
            tuple(sorted([*decided.decisions, *removed], key=lambda one: (one.step, one.label))),
            self.learnt,
            decided.joined,
            noise,
            0.0 if reported is None else reported.common,
            heights=heights[0, owners[rows]],
            sigma_heights=heights[1, owners[rows]],
            cameras=None if reported is None else reported.cameras,
        )


def _removal(paths: Paths, path: int, odds: float) -> Decision:
    """Make the decision to remove a track, for its log odds or for want of tracklets."""
    absence = float(1.0 / (1.0 + np.exp(np.clip(odds, -600.0, 600.0))))
    reason = (
        "over its whole life it is likelier nobody"
        if odds <= 0.0
        else "no piece of it stands by boxes of its own"
    )
    label = int(paths.labels[path])
    return Decision(
        "removed", int(paths.firsts[path]), label, label, absence, 1.0 - absence, reason
    )


def _outside_spans(paths: Paths, limits: Mapping[int, tuple[int, int]]) -> Bool[ndarray, " N"]:
    """Find the rows at which corrections state that a track does not exist."""
    away = np.zeros(len(paths.states), dtype=bool)
    for path, label in enumerate(paths.labels.tolist()):
        if label in limits:
            first, last = limits[label]
            own = slice(int(paths.starts[path]), int(paths.starts[path + 1]))
            steps = int(paths.firsts[path]) + np.arange(own.stop - own.start)
            away[own] = (steps < first) | (steps > last)
    return away


def read_paths(
    fused: Steps[FusionResult], tracks: Trajectories, dimension: int
) -> tuple[Paths, Bool[ndarray, " N"]]:
    """Convert the fusion's tracks to paths, one a label, from its first box to its last report.

    Where a label was missing for a while, the states are interpolated linearly in the gap.

    Args:
        fused: The result of stage 2 for each step.
        tracks: The tracks extracted from these.
        dimension: d, the size of the state.

    Returns:
        The paths, and whether the fusion had each of their rows.
    """
    order = np.lexsort((tracks.frames, tracks.labels))
    of_label, frames = tracks.labels[order], tracks.frames[order]
    labels, begins = np.unique(of_label, return_index=True)
    ends = np.append(begins[1:], len(order))
    earlier = _steps_before_report(fused, labels, frames[begins])
    known = []
    for label, begin, end in zip(labels.tolist(), begins, ends, strict=True):
        before = np.array(earlier.get(label, ()), dtype=np.int64).reshape(-1, 2)
        steps = np.concatenate([before[:, 0], frames[begin:end]])
        known.append((steps, np.concatenate([before[:, 1], tracks.components[order[begin:end]]])))
    firsts = [int(steps[0]) for steps, _ in known]
    lengths = [int(steps[-1] - steps[0]) + 1 for steps, _ in known]
    paths = Paths.blank(labels.tolist(), firsts, lengths, dimension)
    had = np.zeros(len(paths.states), dtype=bool)
    for path, (steps, components) in enumerate(known):
        within = paths.rows_of(path)
        means = fused.take("posterior.means", steps, components)
        every = np.arange(steps[0], steps[-1] + 1)
        for axis in range(dimension):
            paths.states[within, axis] = np.interp(every, steps, means[:, axis])
        rows = within.start + steps - steps[0]
        paths.covariances[within] = _WIDE * np.eye(dimension)
        paths.covariances[rows] = fused.take("posterior.covariances", steps, components)
        had[rows] = True
    return paths, had


def _steps_before_report(
    fused: Steps[FusionResult], labels: Int[ndarray, " n"], reported: Int[ndarray, " n"]
) -> dict[int, list[tuple[int, int]]]:
    """List the steps before each label's first report at which a box updated it, with its
    component.

    Args:
        fused: The result of stage 2 for each step.
        labels: The n labels that are reported, ascending.
        reported: The step of each label's first report.
    """
    found: dict[int, list[tuple[int, int]]] = {}
    if not len(labels):
        return found
    sources, own = fused.column("sources"), fused.column("posterior.labels")
    steps = sources.steps
    index = np.minimum(np.searchsorted(labels, own.values), len(labels) - 1)
    early = (labels[index] == own.values) & (steps < reported[index])
    rows = np.flatnonzero(early & (sources.values >= 0).any(axis=1))
    # of several components with one label the first
    _, first = np.unique(np.stack([steps[rows], index[rows]]), axis=1, return_index=True)
    for row in rows[np.sort(first)].tolist():
        step = int(steps[row])
        place = step, row - int(sources.starts[step])
        found.setdefault(int(own.values[row]), []).append(place)
    return found


def read_links(fused: Steps[FusionResult], paths: Paths, cameras: Many[CameraBoxes]) -> Links:
    """Convert the association probabilities of the fusion to links of the rows of the paths.

    Args:
        fused: The result of stage 2 for each step.
        paths: The fusion's tracks.
        cameras: The boxes of each camera.
    """
    parts = range(0, len(fused), _AT_ONCE)
    found = [_links_of(fused, first, paths, cameras) for first in parts]
    return Links.concatenate([Links.none(), *found])


def _links_of(
    fused: Steps[FusionResult], begin: int, paths: Paths, cameras: Many[CameraBoxes]
) -> Links:
    """The links of some steps, from ``begin`` on."""
    end = begin + _AT_ONCE
    of_pair, components, boxes, probabilities = (
        fused.column(f"associations.{name}", first=begin, last=end)
        for name in ("cameras", "components", "boxes", "probabilities")
    )
    labels = fused.column("posterior.labels", first=begin, last=end)
    if not len(of_pair.values) or not len(paths.labels):
        return Links.none()
    within = of_pair.steps
    named = labels.values[labels.starts[within] + components.values]
    order = np.argsort(paths.labels, kind="stable")
    place = np.searchsorted(paths.labels, named, side="right", sorter=order) - 1
    path = order[np.maximum(place, 0)]
    step = begin + within
    alive = (paths.labels[path] == named) & (paths.firsts[path] <= step)
    alive &= step <= paths.lasts[path]
    path, step, which = path[alive], step[alive], of_pair.values[alive].astype(np.int64)
    starts = np.stack([camera.starts for camera in cameras])
    return Links(
        which,
        paths.starts[path] + step - paths.firsts[path],
        starts[which, step] + boxes.values[alive],
        probabilities.values[alive].astype(float),
    )
