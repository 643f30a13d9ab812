"""The tracker of foreground objects by association matrices: merge, split, new, vanished.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int, UInt8, UInt16
from numpy import ndarray
from scipy.sparse.csgraph import connected_components

from tracker.geometry.boxes import Boxes
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.association_matrix.silhouettes import Fits, Silhouettes
from tracker.single_view.association_matrix.track_transfer import (
    MovingObject,
    Situation,
    advance,
    follow,
    object_histograms,
)
from tracker.single_view.box_sizes import box_sigmas
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.background import ForegroundModel, pack
from tracker.single_view.pictures.colour import BINS
from tracker.single_view.pictures.foreground import Blobs, blobs, learn
from tracker.single_view.protocol import Dropped, ViewEvent, ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


@dataclass(frozen=True, slots=True, eq=False)
class AssociationMatrixState:
    """Objects and tracks after a step, and the foreground model's state."""

    situation: Situation
    """The objects and tracks."""
    foreground: Any
    """The state of the foreground model."""


class AssociationMatrix:
    """Tracks of foreground objects in one camera ([CMQ07]).

    Per step: the foreground components are the objects. A decision matrix R relates the
    objects of the step before to those now: by distance while their number is equal, by
    overlap where it changes. A column of R with sum 0 is new, with sum 1 it continues,
    with a larger sum it is a merge; a row with sum 0 is interrupted, and ended after N
    steps, with a larger sum it is a split. Two people who merge and stay mostly visible are
    followed separately by mean shift on their HSI histograms until their centres meet; else the
    merged object has all its tracks. After a split each object belongs to the track whose
    histogram before the merge is most similar to its own.

    Beyond the paper: a new object may be an interrupted one nearby of similar colours. And an
    object is all of a person, or several, while the fusion needs targets, perhaps only heads:
    the boxes for the fusion are target boxes that fit the outlines of the objects, as many as an
    object has tracks, more where its outline shows them. The preset ``published`` passes on the
    objects themselves.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures,
    ) -> None:
        """Learn the background of one camera.

        Raises:
            ValueError: If the camera has no pictures.
        """
        view = sequence.views[camera_index]
        view.need_pictures(sequence.name, ", or choose single_view none to use its detections")
        self._parameters = parameters.of(AssociationMatrixParams)
        foreground = parameters.foreground
        self._minimum_area = foreground.minimum_area
        self._foreground: ForegroundModel | None = learn(
            sequence, camera_index, reader, foreground, motion=True
        )
        reader.check()
        self._silhouettes = Silhouettes(view.camera, sequence.room, sequence.target_half_extents)

    def start(self) -> AssociationMatrixState:
        """The state without objects, before the first step."""
        state = None if self._foreground is None else self._foreground.start()
        return AssociationMatrixState(Situation.start(), state)

    def step(
        self,
        state: AssociationMatrixState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[AssociationMatrixState, ViewResult]:
        """Process one step; without an image the state does not change and no box is returned."""
        if picture is None or self._foreground is None:
            return state, self._nothing(state.situation)
        background, segmentation = self._foreground.step(state.foreground, picture)
        mask = segmentation.mask
        seen = blobs(mask, self._minimum_area)
        if self._parameters.join_gap > 0.0:
            heights = 2.0 * self._silhouettes.half_heights(seen.boxes[:, :2])
            seen = join(seen, self._parameters.join_gap * heights)
        bins = colour.bin_map(picture, "hsi")
        histograms = object_histograms(bins, seen.owners, seen.size, BINS["hsi"])
        situation, events = advance(state.situation, seen, histograms, self._parameters)
        situation, met = self._follow(situation, seen, bins)
        result = self._result(situation, seen, mask, [*events, *met])
        result.information["threshold"] = float(segmentation.thresholds.mean())
        return AssociationMatrixState(situation, background), result

    def _follow(
        self, situation: Situation, seen: Blobs, bins: UInt16[ndarray, "h w"]
    ) -> tuple[Situation, list[ViewEvent]]:
        """Move tracks that are followed separately; those that cannot be separated are merged."""
        tracks, objects, events = dict(situation.tracks), list(situation.objects), []
        for index, one in enumerate(situation.objects):
            if not one.followed:
                continue
            moving = seen.owners == index
            for label in one.labels:
                track = tracks[label]
                centre = follow(bins, moving, track.box, track.histogram)
                tracks[label] = replace(track, box=np.concatenate([centre, track.box[2:]]))
            first, second = (tracks[label].box for label in one.labels)
            near = self._parameters.occlusion_distance * (first[2] + second[2]) / 2.0
            if np.hypot(*(first[:2] - second[:2])) <= near:
                objects[index] = replace(one, followed=False)
                events.append(ViewEvent("occluded", one.labels))
                for label in one.labels:
                    tracks[label] = replace(tracks[label], box=one.box)
        after = replace(situation, tracks=tracks, objects=tuple(objects))
        return after, events

    def _result(
        self,
        situation: Situation,
        seen: Blobs,
        mask: UInt8[ndarray, "h w"],
        events: list[ViewEvent],
    ) -> ViewResult:
        """Return the result of a step."""
        objects, p = situation.objects, self._parameters
        wanted = np.array([len(one.labels) for one in objects], dtype=np.int64)
        if p.output == "targets":
            fits = self._silhouettes.fit(mask, seen, wanted, p)
            boxes, weights = fits.boxes, np.exp(np.minimum(fits.scores, 0.0))
            labels = _labels_of_fits(fits, situation)
            fitted = np.isin(np.arange(seen.size), fits.owners)
            rejected = {"foreground": ~fits.filled, "outline": fits.filled & ~fitted}
        else:
            boxes, labels = _apart(situation)
            weights = np.ones(len(boxes))
            rejected = {}
        dropped = Dropped.of(seen.boxes, rejected)
        estimates, estimate_labels = _estimates(situation, p.confirmation_steps)
        return ViewResult(
            boxes=boxes,
            weights=weights,
            labels=labels,
            sigmas=self._sigmas(boxes),
            estimates=estimates,
            estimate_weights=np.ones(len(estimates)),
            estimate_labels=estimate_labels,
            measurements=seen.boxes,
            measurement_scores=np.ones(seen.size),
            information={
                **dropped.information(seen.size - len(dropped.gates)),
                "objects": float(len(objects)),
                "merged objects": float(sum(len(one.labels) > 1 for one in objects)),
                "interrupted": float(len(situation.lost)),
                "foreground share": float(mask.mean()),
            },
            dropped=dropped,
            events=tuple(events),
            gates=self._gates(objects),
            foreground=pack(mask),
        )

    def _nothing(self, situation: Situation) -> ViewResult:
        """The result without an image."""
        estimates, labels = _estimates(situation, self._parameters.confirmation_steps)
        return ViewResult.of_estimates(estimates, np.ones(len(labels)), labels)

    def _sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        p = self._parameters
        return box_sigmas(boxes, p.centre_sigma, p.size_sigma)

    def _gates(self, objects: tuple[MovingObject, ...]) -> Float[ndarray, "G 5"]:
        """The gates of the objects in the next step."""
        gates = np.zeros((len(objects), 5))
        for index, one in enumerate(objects):
            gates[index, :2] = one.expected
            gates[index, [2, 4]] = (self._parameters.reach * one.size) ** 2
        return gates


def _estimates(
    situation: Situation, confirmation: int
) -> tuple[Float[ndarray, "E 4"], Int[ndarray, " E"]]:
    """Every confirmed track with an object: its own box if alone, else the merged object's."""
    held = sorted(label for one in situation.objects for label in one.labels)
    labels = [label for label in held if situation.tracks[label].age >= confirmation]
    boxes = np.array([situation.tracks[label].box for label in labels]).reshape(-1, 4)
    return boxes, np.array(labels, dtype=np.int64)


def _apart(situation: Situation) -> tuple[Float[ndarray, "N 4"], Int[ndarray, " N"]]:
    """The objects; one followed as two tracks is two; a merged one has no label."""
    boxes: list[ndarray] = []
    labels: list[int] = []
    for one in situation.objects:
        alone = one.followed or len(one.labels) == 1
        boxes += [situation.tracks[label].box for label in one.labels] if alone else [one.box]
        labels += one.labels if alone else [-1]
    return np.array(boxes).reshape(-1, 4), np.array(labels, dtype=np.int64)


def _labels_of_fits(fits: Fits, situation: Situation) -> Int[ndarray, " N"]:
    """The label of each fitted box: that of a single track for its best box; -1 if unknown.

    Of two tracks followed separately each has the box nearest along x, if both have one.
    """
    labels = np.full(len(fits.boxes), -1, dtype=np.int64)
    for index, one in enumerate(situation.objects):
        mine = np.flatnonzero(fits.owners == index)
        if len(one.labels) == 1:
            labels[mine[:1]] = one.labels[0]
        elif one.followed and len(mine) >= 2:
            centres = [situation.tracks[label].box[0] for label in one.labels]
            in_order = mine[:2][np.argsort(fits.boxes[mine[:2], 0], kind="stable")]
            labels[in_order] = np.array(one.labels)[np.argsort(centres, kind="stable")]
    return labels


def join(pieces: Blobs, gaps: Float[ndarray, " N"]) -> Blobs:
    """Merge components that lie above each other.

    Two are merged where they share at least half of the width of the narrower one, and where the
    gap between them is at most the larger of their two bounds.

    Args:
        pieces: N foreground components.
        gaps: Largest gap above or below each component to another of the same person, pixels.
    """
    count = pieces.size
    if count < 2:
        return pieces
    low, high = Boxes(pieces.boxes).low, Boxes(pieces.boxes).high
    common = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    narrower = np.minimum(pieces.boxes[:, None, 2], pieces.boxes[None, :, 2])
    near = (common[..., 0] >= narrower) & (-common[..., 1] <= np.maximum(gaps[:, None], gaps[None]))
    groups, owner = connected_components(near, directed=False)
    if groups == count:
        return pieces
    # the order by top edges remains: a group has the place of its first component
    _, first = np.unique(owner, return_index=True)
    rank = np.empty(groups, dtype=np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(groups)
    owners = rank[owner]
    lows, highs = np.full((groups, 2), np.inf), np.full((groups, 2), -np.inf)
    np.minimum.at(lows, owners, low)
    np.maximum.at(highs, owners, high)
    boxes = Boxes.from_corners(lows, highs).centred
    areas = np.bincount(owners, weights=pieces.areas, minlength=groups).astype(np.int64)
    names = np.append(owners, -1).astype(np.int32)  # -1, the background, is the last of them
    return Blobs(boxes, areas, names[pieces.owners])
