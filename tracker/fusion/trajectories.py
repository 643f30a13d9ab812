"""The labelled tracks of a run, by columns, and their extraction from the posteriors."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from itertools import islice
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.finished_tracks import relabel
from tracker.corrections.kinds import leeway
from tracker.filters import gaussian_mixture
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.protocol import FusionResult
from tracker.kernels import linear_algebra
from tracker.kernels import mixtures as mixture_kernels
from tracker.sequences.sequence import Room
from tracker.steps.table import Table

Rule = Literal["components", "boxes"]
"""Unit of extraction: a component, or all components that one box updated."""

_AT_ONCE = 1024
"""Number of steps whose results are concatenated at a time, which bounds the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectories(Table):
    """Tracks as N rows, one for each target at each step, sorted by step and then id."""

    frames: Int[ndarray, " N"]
    """Step of the row, an index from 0."""
    ids: Int[ndarray, " N"]
    """Number of the track, from 1 in the order of first appearance."""
    positions: Float[ndarray, "N 3"]
    """Position of the target's centre, world metres."""
    existences: Float[ndarray, " N"]
    """Weight (PHD) or existence probability (multi-Bernoulli)."""
    sigmas: Float[ndarray, "N 3"]
    """Standard deviation of the position along x, y and z, metres."""
    seen: Bool[ndarray, "N C"]
    """Whether a box of each camera updated the target at this step; without any it is coasting."""
    components: Int[ndarray, " N"]
    """Index of the component in the step's posterior; -1 where smoothed tracks have none."""
    labels: Int[ndarray, " N"]
    """The label of the component, for which the filter's id is the short form; -1 for none."""
    covariances_xy: Float[ndarray, " N"]
    """Covariance of the position along x and y, square metres."""
    heights: Float[ndarray, " N"]
    """Height of the track's person while standing, metres; NaN where it is not estimated, as in
    the filter's tracks."""
    sigma_heights: Float[ndarray, " N"]
    """Standard deviation of the height, metres; NaN where it is not estimated."""

    def __len__(self) -> int:
        return len(self.frames)

    def at(self, frame: int) -> slice:
        """The rows of one step."""
        first, last = np.searchsorted(self.frames, [frame, frame + 1])
        return slice(int(first), int(last))

    @staticmethod
    def empty(cameras: int) -> Trajectories:
        """The tracks without rows, of ``cameras`` cameras."""
        return Trajectories(
            frames=np.zeros(0, dtype=np.int64),
            ids=np.zeros(0, dtype=np.int64),
            positions=np.zeros((0, 3)),
            existences=np.zeros(0),
            sigmas=np.zeros((0, 3)),
            seen=np.zeros((0, cameras), dtype=bool),
            components=np.zeros(0, dtype=np.int64),
            labels=np.zeros(0, dtype=np.int64),
            covariances_xy=np.zeros(0),
            heights=np.zeros(0),
            sigma_heights=np.zeros(0),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """The volume in which targets are extracted."""

    room: Room
    """The tracked volume."""
    margin: float = np.inf
    """Distance from the room's volume within which a target is still extracted, metres."""
    below: float = 0.0
    """Further distance below its floor, metres: a centre there is an error of height."""

    def contain(self, positions: Float[ndarray, "N 3"]) -> Bool[ndarray, " N"]:
        """Whether each position, world metres, lies in the volume."""
        return self.room.contains(positions, self.margin, self.below)


def extract(
    results: Iterable[FusionResult],
    *,
    cameras: int,
    extraction_threshold: float,
    rule: Rule = "components",
    bounds: Bounds | None = None,
    first_frame: int = 0,
    ids: dict[int, int] | None = None,
) -> Trajectories:
    """Extract the targets of each step: components above the threshold, one for each label.

    The heaviest of several components with one label represents it. With the rule
    ``boxes``, for a PHD intensity, the components that one box updated are merged first;
    see :func:`by_boxes`.

    Args:
        results: The posterior of each step, from ``first_frame`` on.
        cameras: C, the number of cameras.
        extraction_threshold: T_e, the weight above which a component is a target.
        rule: Whether components are extracted each by itself or merged by box.
        bounds: The volume in which targets are extracted; None for everywhere.
        first_frame: The step of the first result.
        ids: The id of each label so far; new labels are added. To continue an earlier
            extraction, pass the same dictionary again.
    """
    ids = {} if ids is None else ids
    remaining, parts = iter(results), []
    while some := list(islice(remaining, _AT_ONCE)):
        parts.append(
            _extract_part(some, cameras, extraction_threshold, rule, bounds, first_frame, ids)
        )
        first_frame += len(some)
    if len(parts) == 1:
        return parts[0]
    return Trajectories.concatenate([Trajectories.empty(cameras), *parts])


def _extract_part(
    results: list[FusionResult],
    cameras: int,
    extraction_threshold: float,
    rule: Rule,
    bounds: Bounds | None,
    first_frame: int,
    ids: dict[int, int],
) -> Trajectories:
    """Extract the targets of some steps, with the arguments of :func:`extract`."""
    if rule == "boxes":
        gathered = [by_boxes(result) for result in results]
    else:
        gathered = [(result.posterior, np.arange(result.posterior.size)) for result in results]
    targets = gaussian_mixture.concatenate([mixture for mixture, _ in gathered])
    steps = np.repeat(np.arange(len(results)), [mixture.size for mixture, _ in gathered])
    chosen = np.flatnonzero(targets.weights > extraction_threshold)
    if bounds is not None:
        chosen = chosen[bounds.contain(targets.means[chosen, :3])]
    if not len(chosen):
        return Trajectories.empty(cameras)
    # step by step, label by label, the heaviest first
    of_step, of_label = steps[chosen], targets.labels[chosen]
    order = np.lexsort((-targets.weights[chosen], of_label, of_step))
    chosen, of_step, of_label = chosen[order], of_step[order], of_label[order]
    first = np.ones(len(chosen), dtype=bool)
    first[1:] = (np.diff(of_step) != 0) | (np.diff(of_label) != 0)
    chosen, of_step, of_label = chosen[first], of_step[first], of_label[first]
    numbers = np.array([ids.setdefault(label, len(ids) + 1) for label in of_label.tolist()])
    order = np.lexsort((numbers, of_step))
    chosen, of_step, of_label = chosen[order], of_step[order], of_label[order]
    components = np.concatenate([leaders for _, leaders in gathered])[chosen]
    sizes = [result.posterior.size for result in results]
    starts = np.cumsum([0, *sizes[:-1]])
    sources = np.concatenate([result.sources for result in results], axis=1)
    covariances = targets.covariances[chosen]
    return Trajectories(
        frames=first_frame + of_step,
        ids=numbers[order],
        positions=targets.means[chosen, :3],
        existences=targets.weights[chosen],
        sigmas=np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, :3]),
        seen=(sources[:, starts[of_step] + components] >= 0).T,
        components=components,
        labels=of_label,
        covariances_xy=covariances[:, 0, 1],
        heights=np.full(len(chosen), np.nan),
        sigma_heights=np.full(len(chosen), np.nan),
    )


def apply_corrections(
    tracks: Trajectories, corrections: Many[Correction], step_time: float
) -> Trajectories:
    """Apply the corrections of identity to finished tracks, without any image or box.

    See :func:`tracker.corrections.finished_tracks.relabel`.

    Args:
        tracks: The tracks of a run.
        corrections: The corrections in the order in which they were made.
        step_time: Time between two steps, seconds.
    """
    if not len(tracks) or not corrections:
        return tracks
    ids, remaining = relabel(
        tracks.frames, tracks.ids, tracks.positions, corrections, leeway=leeway(step_time)
    )
    changed = replace(tracks, ids=ids).take(remaining)
    return changed.take(np.lexsort((changed.ids, changed.frames)))


def by_boxes(result: FusionResult) -> tuple[GaussianMixture, Int[ndarray, " K"]]:
    """Merge the components that one box updated: W_z of Ristic, Clark and Vo (FUSION 2010).

    The components that one box z of the last camera updated become one, with the weight
    W_z = Σ_j w_j(z), the mean Σ_j w_j(z) m_j / W_z and the label of the heaviest; those
    that this camera missed are merged by the boxes of the camera before, and so on;
    components without any box do not change. So a target whose weight is spread over several
    components is extracted, and no box gives two targets.

    Returns:
        One component for each group, and the index of the heaviest component of each.
    """
    posterior, group = result.posterior, np.full(result.posterior.size, -1, dtype=np.int64)
    count = 0
    for boxes in result.sources[::-1]:
        ungrouped = np.flatnonzero((group < 0) & (boxes >= 0))
        names, which = np.unique(boxes[ungrouped], return_inverse=True)
        group[ungrouped] = count + which
        count += len(names)
    rest = np.flatnonzero(group < 0)
    group[rest] = count + np.arange(len(rest))
    count += len(rest)
    leaders = mixture_kernels.heaviest_of_groups(posterior.weights, group, count)
    merged = linear_algebra.merge_moments(
        posterior.weights, posterior.means, posterior.covariances, group, count
    )
    return GaussianMixture.of(merged, posterior.labels.take(leaders)), leaders


class GrowingTrajectories:
    """Tracks to which rows are appended without copying the earlier ones each time.

    What was returned before never changes: it consists of the first rows of the same arrays.
    """

    def __init__(self, tracks: Trajectories) -> None:
        """Begin with some tracks."""
        self._tracks = self._storage = tracks

    def append(self, more: Trajectories) -> Trajectories:
        """Append the tracks of later steps, and return all."""
        count, total = len(self._tracks), len(self._tracks) + len(more)
        if total > len(self._storage):
            self._storage = Trajectories(
                *(
                    _with_capacity(getattr(self._tracks, name), total)
                    for name in Trajectories.__slots__
                )
            )
        for name in Trajectories.__slots__:
            getattr(self._storage, name)[count:total] = getattr(more, name)
        self._tracks = Trajectories(
            *(getattr(self._storage, name)[:total] for name in Trajectories.__slots__)
        )
        return self._tracks


def _with_capacity(rows: ndarray, least: int) -> ndarray:
    """The rows at the beginning of an array with capacity for at least ``least`` rows."""
    found = np.empty((max(1024, least + least // 2), *rows.shape[1:]), rows.dtype)
    found[: len(rows)] = rows
    return found
