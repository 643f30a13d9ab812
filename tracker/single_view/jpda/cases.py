"""Five cases of the association matrix: normal, new, vanished, occluded, split.

[WW10] Wang, Wan, "Fast tracking of multiple targets in video by joint probabilistic
data association", patent CN101783020A, 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.assignment import linear_sum_assignment

UNREACHED = 1e6
"""Cost of a pair with β = 0, instead of −ln β: more than the sum of all finite costs."""


@dataclass(frozen=True, slots=True, eq=False)
class Cases:
    """The cases of n targets and M measurements, from the rows and columns of a matrix."""

    own: Int[ndarray, " n"]
    """The measurement of each target in the likeliest joint event, -1 for none."""
    shared: Int[ndarray, " n"]
    """For an occluded target the measurement that it shares with others, else -1."""
    split: Bool[ndarray, " n"]
    """Whether a target has several measurements that no other target has."""
    missed: Bool[ndarray, " n"]
    """Whether a target has no measurement; a target that is missed for long has vanished."""
    new: Bool[ndarray, " M"]
    """Whether a measurement has no target, so that it is of a new or a returned one."""


def determine_cases(
    matrix: Float[ndarray, "n M"],
    own: Int[ndarray, " n"],
    least_probability: float,
    *,
    every_shared_row: bool,
) -> Cases:
    """Determine the cases of the association matrix ([WW10]_, with measurements as rows there).

    Entries up to ``least_probability`` count as 0.

    * **New**: a measurement whose row is zero.
    * **Vanished**: a target whose column is zero.
    * **Occluded**: a row with several positive entries. Two targets close together with a
      measurement each have such rows too: as published, they are assigned to the measurements of
      the greatest Π β_tj, one each as far as there are enough; else only rows count with
      a target that has no measurement of its own.
    * **Split**: a column with several positive entries in rows of which it has the largest.
    * **Normal**: all others.

    Args:
        matrix: β_tj, association probabilities.
        own: The measurement of each target in the likeliest joint event.
        least_probability: β_min, the bound for zero.
        every_shared_row: Whether targets with a measurement each can be occluded.
    """
    targets, count = matrix.shape
    positive = np.asarray(matrix > least_probability)
    missed = np.asarray(~positive.any(axis=1))
    new = np.asarray(~positive.any(axis=0))
    own = np.where(missed, -1, own)
    if not targets or not count:
        none = np.full(targets, -1)
        return Cases(own, none, none >= 0, missed, new)
    wanted = np.where(own >= 0, own, matrix.argmax(axis=1))
    wanted[missed] = -1
    if every_shared_row:
        together = (positive & (positive.sum(axis=0) > 1)).any(axis=1)
        wanted = _one_each(np.where(positive & together[:, None], matrix, 0.0), wanted)
    else:
        together = np.bincount(wanted[~missed], minlength=count)[wanted] > 1
    shared = np.where(~missed & together, wanted, -1)
    largest = np.zeros_like(positive)
    largest[matrix.argmax(axis=0), np.arange(count)] = True
    split = ((positive & largest).sum(axis=1) > 1) & (shared < 0)
    return Cases(own, shared, split, missed, new)


def _one_each(shared: Float[ndarray, "n M"], wanted: Int[ndarray, " n"]) -> Int[ndarray, " n"]:
    """Assign as many targets as possible to measurements of their own, with the greatest Π β_tj."""
    possible = shared > 0.0
    cost = np.where(possible, -np.log(np.where(possible, shared, 1.0)), UNREACHED)
    targets, chosen = linear_sum_assignment(cost)
    near = possible[targets, chosen]
    result = wanted.copy()
    result[targets[near]] = chosen[near]
    return result


def exclude_outside_boxes(
    cases: Cases,
    matrix: Float[ndarray, "n M"],
    expected: Float[ndarray, "n 4"],
    boxes: Float[ndarray, "M 4"],
) -> tuple[Cases, Float[ndarray, "n M"]]:
    """Exclude measurements outside a split target's own box, which [WW10]_ does not.

    When two people separate, the weighted state would otherwise remain between them, and its gate
    would widen with their distance. A measurement outside the target's box is of a new target, and
    its probability is added to that of the target's own measurement.

    Args:
        cases: The cases of the matrix.
        matrix: β_tj, association probabilities.
        expected: Predicted boxes of the targets, pixels.
        boxes: Boxes of the measurements, pixels.

    Returns:
        The cases and the matrix after the change.
    """
    matrix, split, new = matrix.copy(), cases.split.copy(), cases.new.copy()
    for t in np.flatnonzero(cases.split & (cases.own >= 0)):
        own = cases.own[t]
        apart = np.abs(boxes[:, :2] - boxes[own, :2]) / np.maximum(expected[t, 2:], 0.5)
        strange = (matrix.argmax(axis=0) == t) & (matrix[t] > 0.0) & (apart.max(axis=1) > 1.0)
        if not strange.any():
            continue
        matrix[t, own] += matrix[t, strange].sum()
        matrix[:, strange] = 0.0
        new[strange] = True
        split[t] = ((matrix.argmax(axis=0) == t) & (matrix[t] > 0.0)).sum() > 1
    return replace(cases, split=split, new=new), matrix


def search_components(
    cases: Cases,
    expected: Float[ndarray, "n 4"],
    boxes: Float[ndarray, "M 4"],
    pieces: Float[ndarray, "M 4"],
    furthest: float,
) -> Cases:
    """Search foreground components for targets without measurements, which [WW10]_ does not.

    The measurement of people who merge may lie outside all gates.

    A target with a zero column, and a predicted centre in the foreground component of a
    measurement, has not vanished. If that measurement has no target and is near, it is the
    target's; all other such targets are occluded there.

    Args:
        cases: The cases of the matrix.
        expected: Predicted boxes of the targets, pixels.
        boxes: Boxes of the measurements, pixels.
        pieces: Box of the foreground component of each measurement, pixels.
        furthest: Largest distance, half sizes of the box, at which a measurement without target may
            be of such a target.
    """
    lost = np.flatnonzero(cases.missed)
    if not len(lost) or not len(boxes):
        return cases
    own, shared = cases.own.copy(), cases.shared.copy()
    missed, new = cases.missed.copy(), cases.new.copy()
    to_piece = np.abs(expected[lost, None, :2] - pieces[None, :, :2]) / pieces[None, :, 2:]
    to_box = np.abs(expected[lost, None, :2] - boxes[None, :, :2]) / expected[lost, None, 2:]
    reach, leap = to_piece.max(axis=2), to_box.max(axis=2)
    for i in np.argsort(leap.min(axis=1), kind="stable"):
        covering = np.flatnonzero(reach[i] <= 1.0)
        if not len(covering):
            continue
        # the nearest of the measurements of one component
        j = int(covering[leap[i, covering].argmin()])
        missed[lost[i]] = False
        if new[j] and leap[i, j] <= furthest:
            own[lost[i]] = j
            new[j] = False
        else:
            shared[lost[i]] = j
    owners = (own >= 0) & (shared < 0) & np.isin(own, shared[shared >= 0])
    shared[owners] = own[owners]
    return replace(
        cases, own=own, shared=shared, missed=missed, new=new, split=cases.split & (shared < 0)
    )
