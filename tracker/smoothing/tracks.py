"""Conversion of the smoothed tracks to the reported trajectories of a run."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Bounds, Trajectories
from tracker.smoothing.result import Smoothed
from tracker.steps import Steps

_FAINT = 0.05
"""Weight below which a component belongs to no track."""


def tracks_of(
    smoothed: Smoothed,
    fused: Many[FusionResult],
    ids: dict[int, int],
    *,
    extraction_threshold: float,
    bounds: Bounds,
    near: float,
) -> Trajectories:
    """Extract the tracks whose existence is above the threshold, inside the room.

    Args:
        smoothed: The smoothed tracks of all steps.
        fused: The result of stage 2 for each step, for the component of each track.
        ids: The id of each label that the filter reported; other labels get the next numbers.
        extraction_threshold: Existence probability above which a row is reported.
        bounds: The volume in which tracks are reported.
        near: Distance within which a component of the filter's posterior is the track's, metres.
    """
    chosen = smoothed.existences > extraction_threshold
    chosen &= bounds.contain(smoothed.means[:, :3])
    rows = np.flatnonzero(chosen)
    known = dict(ids)
    for label in dict.fromkeys(smoothed.labels[rows].tolist()):
        if label not in known:
            known[label] = max(known.values(), default=0) + 1
    numbers = np.array([known[label] for label in smoothed.labels[rows].tolist()], dtype=np.int64)
    rows = rows[np.lexsort((numbers, smoothed.frames[rows]))]
    numbers = np.array([known[label] for label in smoothed.labels[rows].tolist()], dtype=np.int64)
    components, labels = _components(smoothed, rows, fused, near)
    covariances = smoothed.covariances[rows]
    return Trajectories(
        frames=smoothed.frames[rows],
        ids=numbers,
        positions=smoothed.means[rows, :3],
        existences=smoothed.existences[rows],
        sigmas=np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, :3]),
        seen=smoothed.seen[rows],
        components=components,
        labels=labels,
        covariances_xy=covariances[:, 0, 1],
        heights=smoothed.heights[rows],
        sigma_heights=smoothed.sigma_heights[rows],
    )


def names_of(smoothed: Smoothed, tracks: Trajectories) -> dict[int, int]:
    """The id of each label that is reported, for the tracks that were made from ``smoothed``.

    Args:
        smoothed: The result of stage 3 of a run.
        tracks: The result of :func:`tracks_of`; while the run continues they may be others.
    """
    place = {
        (frame, *mean): label
        for frame, mean, label in zip(
            smoothed.frames.tolist(),
            smoothed.means[:, :3].tolist(),
            smoothed.labels.tolist(),
            strict=True,
        )
    }
    ids, rows = np.unique(tracks.ids, return_index=True)
    found = (place.get((int(tracks.frames[row]), *tracks.positions[row].tolist())) for row in rows)
    return {label: int(name) for name, label in zip(ids, found, strict=True) if label is not None}


def _components(
    smoothed: Smoothed, rows: Int[ndarray, " R"], fused: Many[FusionResult], near: float
) -> tuple[Int[ndarray, " R"], Int[ndarray, " R"]]:
    """The nearest component of the step's posterior and its label, -1 where none is near."""
    components = np.full(len(rows), -1, dtype=np.int64)
    labels = np.full(len(rows), -1, dtype=np.int64)
    frames = smoothed.frames[rows]
    column = Steps.of(fused, FusionResult).column
    weights, means = column("posterior.weights"), column("posterior.means")
    own_labels = column("posterior.labels")
    bounds = np.searchsorted(frames, np.arange(len(weights) + 1))
    for step in range(len(weights)):
        own = slice(int(bounds[step]), int(bounds[step + 1]))
        sure = np.flatnonzero(weights[step] > _FAINT)
        if own.stop == own.start or not len(sure):
            continue
        gaps = smoothed.means[rows[own], None, :3] - means[step][None, sure, :3]
        distances = (gaps**2).sum(axis=2)
        best = distances.argmin(axis=1)
        good = distances[np.arange(len(best)), best] <= near * near
        # a component belongs to one track: the nearest of those near it
        closest = distances.argmin(axis=0)[best] == np.arange(len(best))
        components[own] = np.where(good & closest, sure[best], -1)
        labels[own] = np.where(good & closest, own_labels[step][sure[best]], -1)
    return components, labels
