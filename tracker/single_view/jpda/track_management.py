"""Track management of one camera: which targets begin, which end, and which are back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.assignment import linear_sum_assignment
from tracker.parameters import JpdaParams
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.targets import Targets, concatenate, innovations

FAR = 1e9
"""Instead of a distance, where a measurement is out of reach."""


@dataclass(frozen=True, slots=True, eq=False)
class Managed:
    """The targets after the track management of one step, and what it did."""

    targets: Targets
    """Those that were there and still are, then those that are back, then newcomers."""
    vanished: Targets
    next_label: int
    stayed: Int[ndarray, " s"]
    """The indices, before, of those that still are."""
    sources: Int[ndarray, " a"]
    """The measurements that those who are back, and then the newcomers, were found at."""
    new_labels: tuple[int, ...]
    returned_labels: tuple[int, ...]
    vanished_labels: tuple[int, ...]


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
    """End the tracks that have ended, and begin or continue those that a measurement is left for.

    Args:
        targets: After the update of this step.
        vanished: Predicted to this step; their misses count since they were last measured.
        next_label: The next free one.
        new: The measurements of nobody.
        seen: All measurements.
        parameters: How many steps each takes.
        gate: Bound of the squared distance from one who vanished.
        longest_hidden: Steps after which somebody occluded is given up.
    """
    p = parameters
    counts = targets.labels > 0
    gone = np.where(
        counts,
        (targets.misses >= p.vanish_steps) | (targets.hidden >= longest_hidden),
        (targets.misses > 0) | (targets.hidden > 0),  # a newcomer must be seen at every step
    )
    kept, lost = targets.take(np.flatnonzero(~gone)), targets.take(np.flatnonzero(gone & counts))
    places = np.flatnonzero(new)
    back, where = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    if p.five_cases:
        back, where = _same(vanished, seen, places, gate)
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


def _same(
    vanished: Targets, seen: Measured, places: Int[ndarray, " m"], gate: float
) -> tuple[Int[ndarray, " r"], Int[ndarray, " r"]]:
    """Who vanished and is back, and at which measurement: nearest pairs, one to one."""
    found = innovations(vanished, seen.boxes[places, :2], seen.sigmas[places, :2])
    distances: Float[ndarray, "v m"] = np.where(found.squared <= gate, found.squared, FAR)
    rows, columns = linear_sum_assignment(distances)
    near = distances[rows, columns] < FAR
    return rows[near], places[columns[near]]
