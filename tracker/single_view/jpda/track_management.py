"""Track management of one camera by place: targets that begin, end, or return ([WW10]).

A measurement without a target continues a vanished target in whose predicted gate it lies. The two
other trackers of published methods decide by other evidence, so each has a track management of its
own: :mod:`~tracker.single_view.pseudo_particle.track_management` by the person whose colours a
target has, and :mod:`~tracker.single_view.association_matrix.track_transfer` by the objects that
several tracks may share.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.assignment import linear_sum_assignment
from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.targets import Targets, concatenate, innovations

FAR = 1e9
"""Squared distance of an inadmissible pair: more than the sum of all distances inside gates."""


@dataclass(frozen=True, slots=True, eq=False)
class Managed:
    """The targets after the track management of one step, and its decisions."""

    targets: Targets
    """The targets that remain, followed by the returned and by the new ones."""
    vanished: Targets
    """The targets that vanished recently."""
    next_label: int
    """The first label that is free."""
    stayed: Int[ndarray, " s"]
    """Indices, before, of the targets that remain."""
    sources: Int[ndarray, " a"]
    """Measurement of each returned and then of each new target."""
    new_labels: tuple[int, ...]
    """Ids of the targets that were confirmed at this step."""
    returned_labels: tuple[int, ...]
    """Ids of the targets that returned."""
    vanished_labels: tuple[int, ...]
    """Ids of the targets that vanished."""


def manage(
    targets: Targets,
    vanished: Targets,
    next_label: int,
    new: Bool[ndarray, " M"],
    seen: Measured,
    parameters: JpdaParams,
    *,
    gate: float,
    longest_hidden: int,
) -> Managed:
    """End targets, and begin or continue targets at measurements without a target.

    Args:
        targets: The targets after the update of this step.
        vanished: Vanished targets, predicted to this step; misses since the last measurement.
        next_label: The first label that is free.
        new: The measurements without a target.
        seen: All measurements.
        parameters: The numbers of steps for confirmation and end.
        gate: Largest squared Mahalanobis distance of a vanished target and its measurement.
        longest_hidden: Number of steps after which an occluded target ends.
    """
    p = parameters
    counts = targets.labels > 0
    gone = np.where(
        counts,
        (targets.misses >= p.vanish_steps) | (targets.hidden >= longest_hidden),
        (targets.misses > 0) | (targets.hidden > 0),  # a new target must be measured at every step
    )
    kept, lost = targets.take(np.flatnonzero(~gone)), targets.take(np.flatnonzero(gone & counts))
    places = np.flatnonzero(new)
    back, where = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    if p.five_cases:
        back, where = _pair_returned(vanished, seen, places, gate)
    fresh = np.setdiff1d(places, where)
    returned = Targets.at_rest(
        np.concatenate([seen.boxes[where, :2], vanished.half_sizes[back]], axis=1),
        seen.sigmas[where],
        p.velocity_sigma,
        vanished.labels[back],
    )
    newcomers = Targets.at_rest(
        seen.boxes[fresh],
        seen.sigmas[fresh],
        p.velocity_sigma,
        np.zeros(len(fresh), dtype=np.int64),
    )
    after = concatenate([kept, returned, newcomers])
    counting = np.flatnonzero((after.labels == 0) & (after.hits >= p.confirmation_steps))
    labels = after.labels.copy()
    labels[counting] = next_label + np.arange(len(counting))
    still = vanished.take(np.setdiff1d(np.arange(vanished.size), back))
    still = still.take(np.flatnonzero(still.misses < p.vanish_steps + p.return_steps))
    lost = replace(lost, misses=np.full(lost.size, p.vanish_steps))
    return Managed(
        targets=replace(after, labels=labels),
        vanished=concatenate([still, lost]),
        next_label=next_label + len(counting),
        stayed=np.flatnonzero(~gone),
        sources=np.concatenate([where, fresh]),
        new_labels=tuple(labels[counting].tolist()),
        returned_labels=tuple(returned.labels.tolist()),
        vanished_labels=tuple(lost.labels.tolist()),
    )


def _pair_returned(
    vanished: Targets, seen: Measured, places: Int[ndarray, " m"], gate: float
) -> tuple[Int[ndarray, " r"], Int[ndarray, " r"]]:
    """Pair vanished targets with measurements, one to one.

    As many pairs as possible are made inside the gates, with the least sum of squared Mahalanobis
    distances.

    Returns:
        Indices of the vanished targets, and the measurement of each.
    """
    found = innovations(vanished, seen.boxes[places, :2], seen.sigmas[places, :2])
    distances: Float[ndarray, "v m"] = np.where(found.squared <= gate, found.squared, FAR)
    rows, columns = linear_sum_assignment(distances)
    near = distances[rows, columns] < FAR
    return rows[near], places[columns[near]]
