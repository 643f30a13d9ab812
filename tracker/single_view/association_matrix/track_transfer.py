"""One step of the objects: the decision matrix, the transfer of tracks, and new tracks.

An object of this method may have several tracks, which it passes on as objects merge and split
([CMQ07]); in the other trackers of one camera a target is one track
(:mod:`tracker.single_view.jpda.targets`). Objects and tracks are immutable values. In a decision
matrix, by distance or by overlap, rows are the objects of the step before, columns those of this
one.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt16
from numpy import ndarray
from scipy.sparse.csgraph import connected_components

from tracker.geometry.assignment import linear_sum_assignment
from tracker.kernels.pictures.images import follow_colours
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.single_view.pictures.foreground import Blobs
from tracker.single_view.protocol import ViewEvent


def distances(before: Float[ndarray, "I 2"], now: Float[ndarray, "J 2"]) -> Float[ndarray, "I J"]:
    """Compute the distances of predicted and present centres, pixels.

    Args:
        before: Predicted centres of the I objects of the step before, pixels.
        now: Centres of this step's J objects, pixels.
    """
    return np.asarray(np.linalg.norm(before[:, None] - now[None, :], axis=2))


def decide_by_distance(
    apart: Float[ndarray, "I J"], reach: Float[ndarray, " I"]
) -> Bool[ndarray, "I J"]:
    """Decide R for an equal number of objects: mutual nearest neighbours within reach.

    Args:
        apart: Distances, pixels.
        reach: Largest distance of each object of the step before, pixels.
    """
    if apart.size == 0:
        return np.zeros(apart.shape, dtype=bool)
    rows, columns = np.indices(apart.shape)
    mutual = (apart.argmin(axis=1)[:, None] == columns) & (apart.argmin(axis=0)[None, :] == rows)
    return np.asarray(mutual & (apart <= reach[:, None]))


def box_overlaps(
    before: Float[ndarray, "I 4"], now: Float[ndarray, "J 4"]
) -> Float[ndarray, "I J"]:
    """Compute the area that the boxes of two objects share, square pixels.

    Args:
        before: Boxes of the objects of the step before: centre and half sizes, pixels.
        now: Boxes of this step's objects.
    """
    low = np.maximum((before[:, :2] - before[:, 2:])[:, None], (now[:, :2] - now[:, 2:])[None, :])
    high = np.minimum((before[:, :2] + before[:, 2:])[:, None], (now[:, :2] + now[:, 2:])[None, :])
    return np.asarray(np.prod(np.clip(high - low, 0.0, None), axis=2))


def pixel_overlaps(
    before: Int[ndarray, "h w"], now: Int[ndarray, "h w"], rows: int, columns: int
) -> Int[ndarray, "I J"]:
    """Count the pixels that two objects share.

    Args:
        before: Object of each pixel at the step before, -1 for none.
        now: Object of each pixel at this step, -1 for none.
        rows: Number of objects before.
        columns: Number of objects now.
    """
    both = (before >= 0) & (now >= 0)
    pairs = before[both].astype(np.int64) * columns + now[both]
    return np.bincount(pairs, minlength=rows * columns).reshape(rows, columns)


def is_one_to_one(decision: Bool[ndarray, "I J"]) -> bool:
    """Whether every object of either step has exactly one of the other."""
    return bool((decision.sum(axis=0) == 1).all() and (decision.sum(axis=1) == 1).all())


def families(decision: Bool[ndarray, "I J"]) -> list[tuple[list[int], list[int]]]:
    """Find the connected components of R; each object is in exactly one family.

    A family of one row and one column continues; without a row it is new; without a column it is
    interrupted; with several rows it merges, with several columns it splits, or both at once.
    """
    rows, columns = decision.shape
    graph = np.zeros((rows + columns, rows + columns), dtype=bool)
    graph[:rows, rows:] = decision
    count, owners = connected_components(graph, directed=False)
    return [
        (
            np.flatnonzero(owners[:rows] == family).tolist(),
            np.flatnonzero(owners[rows:] == family).tolist(),
        )
        for family in range(count)
    ]


ITERATIONS = 20
"""Largest number of mean-shift iterations."""

TOLERANCE = 0.1
"""Length of a shift below which the mean shift ends, pixels."""


def object_histograms(
    bins: UInt16[ndarray, "h w"], owners: Int[ndarray, "h w"], count: int, size: int
) -> Float[ndarray, "N bins"]:
    """Compute the colour histogram of each object, with sum 1.

    Args:
        bins: The histogram bin of each pixel.
        owners: Object of each pixel, -1 for none.
        count: Number of objects.
        size: Number of bins.
    """
    inside = owners >= 0
    pairs = owners[inside].astype(np.int64) * size + bins[inside]
    counted = np.bincount(pairs, minlength=count * size).reshape(count, size)
    totals = np.maximum(counted.sum(axis=1, keepdims=True), 1)
    return np.asarray(counted / totals)


def coefficients(
    first: Float[ndarray, "I bins"], second: Float[ndarray, "J bins"]
) -> Float[ndarray, "I J"]:
    """Compute Bhattacharyya coefficients Σ_u sqrt(p(u) q(u)) of all pairs of histograms ([CRM03]).

    They are 1 for equal, 0 for disjoint histograms, each of which has the sum 1.
    """
    return np.asarray(np.sqrt(first) @ np.sqrt(second).T)


def follow(
    bins: UInt16[ndarray, "h w"],
    moving: Bool[ndarray, "h w"],
    box: Float[ndarray, " 4"],
    histogram: Float[ndarray, " bins"],
) -> Float[ndarray, " 2"]:
    """Track a colour histogram by mean shift over the moving pixels, [CRM03].

        y ← Σ_i w_i x_i / Σ_i w_i,  w_i = sqrt(q(u_i) / p_y(u_i))

    over the moving pixels x_i in the ellipse inscribed in the box at y, u_i being
    their bins; q is the target's histogram, p_y that of the moving pixels there
    under the Epanechnikov kernel.

    Args:
        bins: The histogram bin of each pixel.
        moving: Whether each pixel is in the foreground.
        box: Box of the target before, centre and half sizes, pixels.
        histogram: q, of the last step at which the target was alone.

    Returns:
        The centre, pixels; that of the box if no pixel has the target's colours.
    """
    centre: ndarray = follow_colours(
        bins, moving, np.asarray(box, dtype=float), histogram, ITERATIONS, TOLERANCE
    )
    return centre


_LONGEST_PREDICTION = 3
"""Number of steps for which an interrupted object is predicted to move on; then it is sought where
it would be, in a circle that grows (``straying``)."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The track of a person, with the appearance when last alone in a foreground component."""

    label: int
    """Id of the track."""
    box: Float[ndarray, " 4"]
    """Present box, that of the object or of the mean shift: centre and half sizes, pixels."""
    area: float
    """Smoothed area of the object while the track was alone in it, square pixels."""
    histogram: Float[ndarray, " bins"]
    """Smoothed colour histogram of the object while the track was alone in it, with sum 1."""
    age: int = 1
    """Number of steps alone in an object."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingObject:
    """A foreground component and its tracks."""

    labels: tuple[int, ...]
    """Labels of the object's tracks, ascending; several where people merged."""
    box: Float[ndarray, " 4"]
    """Centre and half sizes of the component's box, pixels."""
    area: int
    """Number of pixels of the component."""
    velocity: Float[ndarray, " 2"]
    """Displacement of the centre, pixels per step: the mean of the last one and of this number a
    step before."""
    missing: int = 0
    """Number of steps since the object was interrupted."""
    followed: bool = False
    """Whether the two tracks of the object are tracked separately by mean shift."""

    @property
    def size(self) -> float:
        """The root of half width times half height, pixels."""
        return float(np.sqrt(np.prod(self.box[2:])))

    @property
    def expected(self) -> Float[ndarray, " 2"]:
        """The predicted centre one step later, pixels."""
        steps = 1 + min(self.missing, _LONGEST_PREDICTION)
        return np.asarray(self.box[:2] + self.velocity * steps)


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """Objects and tracks after a step."""

    tracks: dict[int, Track]
    """Tracks by label; never changed in place."""
    objects: tuple[MovingObject, ...]
    """Objects in the order of the step's components."""
    lost: tuple[MovingObject, ...]
    """Objects that are interrupted and have not ended."""
    owners: Int[ndarray, "h w"] | None
    """Object of each pixel, -1 for none; None before the first image."""
    next_label: int
    """The first label that is free."""

    @staticmethod
    def start() -> Situation:
        """The situation without objects."""
        return Situation({}, (), (), None, 1)


def decide(
    situation: Situation, seen: Blobs, parameters: AssociationMatrixParams
) -> tuple[Bool[ndarray, "I J"], Float[ndarray, "I J"]]:
    """Decide the matrix R, and count the pixels that the objects of both steps share.

    It is decided by distance for an equal number of objects, and by overlap where the number
    changes or where the distances give no one-to-one matrix.

    Args:
        situation: The I objects of the step before.
        seen: This step's J objects.
        parameters: The bounds of distance and overlap, and the kind of overlap.

    Returns:
        R, and the shared pixels, or square pixels of the boxes where these are compared.
    """
    objects, p = situation.objects, parameters
    before = np.array([one.box for one in objects]).reshape(-1, 4)
    if p.overlap == "boxes" or situation.owners is None:
        shared = box_overlaps(before, seen.boxes)
    else:
        shared = pixel_overlaps(situation.owners, seen.owners, len(objects), seen.size).astype(
            float
        )
    if len(objects) == seen.size:
        expected = np.array([one.expected for one in objects]).reshape(-1, 2)
        reach = p.reach * np.array([one.size for one in objects])
        near = decide_by_distance(distances(expected, seen.boxes[:, :2]), reach)
        if is_one_to_one(near):
            return near, shared
    return shared > p.overlap_area, shared


def advance(
    situation: Situation,
    seen: Blobs,
    histograms: Float[ndarray, "J bins"],
    parameters: AssociationMatrixParams,
) -> tuple[Situation, list[ViewEvent]]:
    """Transfer the tracks of the objects before to the objects now ([CMQ07]).

    Args:
        situation: Objects and tracks after the step before.
        seen: This step's objects.
        histograms: Colour histograms of these objects.
        parameters: The parameters of the method.

    Returns:
        Objects and tracks after this step, in which tracks that are followed separately are still
        at their places before; and the events.
    """
    work = _Step(situation, seen, histograms, parameters)
    for rows, columns in families(work.decision):
        if not columns:
            work.lost += [situation.objects[row] for row in rows]
        elif not rows:
            work.unknown += columns
        else:
            work.transfer(rows, columns)
    work.resume_interrupted()
    work.begin_tracks()
    return work.result()


class _Step:
    """The data of one step while it is computed."""

    def __init__(
        self,
        situation: Situation,
        seen: Blobs,
        histograms: Float[ndarray, "J bins"],
        parameters: AssociationMatrixParams,
    ) -> None:
        self.before = situation
        self.seen = seen
        self.histograms = histograms
        self.parameters = parameters
        self.decision, self.shared = decide(situation, seen, parameters)
        self.labels: list[list[int]] = [[] for _ in range(seen.size)]
        self.sources: list[set[int]] = [set() for _ in range(seen.size)]
        """Indices of the objects of the step before from which the tracks of each object come."""
        self.lost: list[MovingObject] = list(situation.lost)
        self.unknown: list[int] = []
        self.next_label = situation.next_label
        self.events: list[ViewEvent] = []
        self.splits: list[list[int]] = []
        """Indices of the present objects into which each object of the step before split."""

    def add_event(self, kind: str, labels: Iterable[int]) -> None:
        """Record an event of some tracks."""
        self.events.append(ViewEvent(kind, tuple(sorted(set(labels)))))  # type: ignore[arg-type]

    def transfer(self, rows: list[int], columns: list[int]) -> None:
        """Transfer the tracks of a family: all to one object, or each to the one it fits best."""
        owners = [(label, row) for row in rows for label in self.before.objects[row].labels]
        if len(columns) == 1:
            for label, row in owners:
                self.assign(label, row, columns[0])
            return
        benefit = np.array([self.benefit(label, row, columns) for label, row in owners])
        first, own = linear_sum_assignment(benefit, maximize=True)
        chosen = dict(zip(first.tolist(), own.tolist(), strict=True))
        for index, (label, row) in enumerate(owners):
            self.assign(label, row, columns[chosen.get(index, int(benefit[index].argmax()))])
        self.unknown += [column for column in columns if not self.labels[column]]
        for row in rows:
            if self.decision[row].sum() > 1:
                self.splits.append(np.flatnonzero(self.decision[row]).tolist())

    def benefit(self, label: int, row: int, columns: list[int]) -> Float[ndarray, " J"]:
        """Compute how well each of some present objects fits a track, 0 … 1.

        For a track that was alone in its object it is the share of the pixels that both objects
        have in common; for others the Bhattacharyya coefficient of the histograms, since after a
        split an object belongs to the track whose histogram before the merge is most similar to
        that of the object ([CMQ07]).

        Args:
            label: The track.
            row: Index of the track's object at the step before.
            columns: Indices of the present objects.
        """
        if len(self.before.objects[row].labels) == 1:
            pixels = self.shared[row, columns]
            return np.asarray(pixels / max(float(pixels.sum()), 1.0))
        own = self.before.tracks[label].histogram[None, :]
        return np.asarray(coefficients(own, self.histograms[columns])[0])

    def assign(self, label: int, row: int, column: int) -> None:
        """Add a track of the object ``row`` of the step before to the present object ``column``."""
        self.labels[column].append(label)
        self.sources[column].add(row)

    def resume_interrupted(self) -> None:
        """Continue interrupted tracks with free objects nearby of similar colours."""
        if not self.unknown or not self.lost:
            return
        p = self.parameters
        alike = np.array(
            [
                coefficients(
                    np.array([self.before.tracks[label].histogram for label in one.labels]),
                    self.histograms[self.unknown],
                ).max(axis=0)
                for one in self.lost
            ]
        )
        apart = distances(
            np.array([one.expected for one in self.lost]), self.seen.boxes[self.unknown, :2]
        )
        reach = [p.reach * one.size * (1.0 + p.straying * one.missing) for one in self.lost]
        alike[(apart > np.array(reach)[:, None]) | (alike < p.return_similarity)] = -1.0
        rows, columns = linear_sum_assignment(alike, maximize=True)
        found = [(r, c) for r, c in zip(rows.tolist(), columns.tolist(), strict=True)
                 if alike[r, c] >= 0.0]  # fmt: skip
        for row, column in found:
            back = self.lost[row]
            self.labels[self.unknown[column]] += back.labels
            if back.missing:
                self.add_event("returned", back.labels)
        self.lost = [one for row, one in enumerate(self.lost) if row not in {r for r, _ in found}]
        resumed = {column for _, column in found}
        self.unknown = [one for index, one in enumerate(self.unknown) if index not in resumed]

    def begin_tracks(self) -> None:
        """Begin a track at every present object without a track."""
        for column in self.unknown:
            self.labels[column] = [self.next_label]
            self.next_label += 1

    def result(self) -> tuple[Situation, list[ViewEvent]]:
        """Make the objects and tracks after this step, without those interrupted for too long."""
        objects: list[MovingObject] = []
        tracks: dict[int, Track] = {}
        for column in range(self.seen.size):
            self.labels[column] = self._confirmed_tracks(self.labels[column])
            objects.append(self._object(column))
            tracks.update((track.label, track) for track in self._tracks(column, objects[-1]))
        for became in self.splits:
            held = [
                [one for one in self.labels[c] if self._is_confirmed(tracks[one])] for c in became
            ]
            if sum(len(labels) > 0 for labels in held) > 1:
                self.add_event("split", [label for labels in held for label in labels])
        lost = []
        for gone in self.lost:
            known = [self.before.tracks[label] for label in gone.labels]
            if not any(self._is_confirmed(track) for track in known):
                continue
            if gone.missing >= self.parameters.interrupted_steps:
                self.add_event("vanished", gone.labels)
                continue
            lost.append(replace(gone, missing=gone.missing + 1, followed=False))
            tracks.update((track.label, track) for track in known)
        after = Situation(tracks, tuple(objects), tuple(lost), self.seen.owners, self.next_label)
        return after, self.events

    def _is_confirmed(self, track: Track) -> bool:
        """Whether a track was alone in its object for enough steps to be confirmed."""
        return track.age >= self.parameters.confirmation_steps

    def _confirmed_tracks(self, labels: list[int]) -> list[int]:
        """Select the confirmed ones of tracks that merge; if none is, the oldest one alone.

        So a component that splits off a person for a moment does not remain as a second person
        after it has merged again.
        """
        if len(labels) < 2:
            return labels
        known = [self.before.tracks[label] for label in sorted(labels)]
        sure = [track.label for track in known if self._is_confirmed(track)]
        return sure or [max(known, key=lambda track: track.age).label]

    def _object(self, column: int) -> MovingObject:
        """Return the object of a foreground component, with the labels that were assigned to it."""
        labels, p = tuple(sorted(self.labels[column])), self.parameters
        sources = [self.before.objects[row] for row in sorted(self.sources[column])]
        sources = [source for source in sources if set(source.labels) & set(labels)]
        box, area = self.seen.boxes[column], int(self.seen.areas[column])
        velocity, followed = np.zeros(2), False
        if len(sources) == 1 and sources[0].labels == labels:
            velocity = 0.5 * (sources[0].velocity + box[:2] - sources[0].box[:2])
            followed = sources[0].followed
        elif len(sources) > 1:
            self.add_event("merged", labels)
            alone = len(labels) == 2 and all(len(source.labels) == 1 for source in sources)
            both = sum(self.before.tracks[label].area for label in labels)
            followed = p.follow_mild and alone and area > p.mild_share * both
            if not followed:
                self.add_event("occluded", labels)
        return MovingObject(labels, box, area, velocity, followed=followed)

    def _tracks(self, column: int, one: MovingObject) -> list[Track]:
        """The tracks of an object: a single one is updated, separate ones stay, others move."""
        known = [self.before.tracks.get(label) for label in one.labels]
        if len(known) == 1:
            histogram, area, age = self.histograms[column], float(one.area), 1
            if known[0] is not None:
                age, rate = known[0].age + 1, self.parameters.histogram_rate
                histogram = known[0].histogram + rate * (histogram - known[0].histogram)
                area = known[0].area + rate * (area - known[0].area)
            if age == self.parameters.confirmation_steps:
                self.add_event("new", one.labels)
            return [Track(one.labels[0], one.box, area, histogram, age)]
        there = [track for track in known if track is not None]
        return there if one.followed else [replace(track, box=one.box) for track in there]
