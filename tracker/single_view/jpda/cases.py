"""Five cases of the association matrix: normal, new, vanished, occluded, split.

A target is updated by its case: by all associations, by one, or behind another target.

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
from tracker.single_view.jpda import targets as kalman
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.targets import Innovations, Targets, X, Y, innovations

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
        return Cases(own, np.full(targets, -1), np.zeros(targets, dtype=bool), missed, new)
    wanted = np.where(own >= 0, own, matrix.argmax(axis=1))
    wanted[missed] = -1
    if every_shared_row:
        together = (positive & (positive.sum(axis=0) > 1)).any(axis=1)
        wanted = _assign_apart(np.where(positive & together[:, None], matrix, 0.0), wanted)
    else:
        together = np.bincount(wanted[~missed], minlength=count)[wanted] > 1
    shared = np.where(~missed & together, wanted, -1)
    largest = np.zeros_like(positive)
    largest[matrix.argmax(axis=0), np.arange(count)] = True
    split = ((positive & largest).sum(axis=1) > 1) & (shared < 0)
    return Cases(own, shared, split, missed, new)


def _assign_apart(shared: Float[ndarray, "n M"], wanted: Int[ndarray, " n"]) -> Int[ndarray, " n"]:
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


@dataclass(frozen=True, slots=True, eq=False)
class CaseUpdates:
    """The n targets after the update of one step, in the same order as before."""

    targets: Targets
    """The updated targets."""
    matrix: Float[ndarray, "n M"]
    """β_tj as used for the update: 0 in the rows of occluded and missed targets."""
    hidden: Bool[ndarray, " n"]
    """Whether a target is occluded by another one."""


def update_by_case(
    targets: Targets,
    found: Innovations,
    matrix: Float[ndarray, "n M"],
    cases: Cases,
    seen: Measured,
    parameters: JpdaParams,
) -> CaseUpdates:
    """Update every target by its case.

    Args:
        targets: n predicted targets.
        found: Innovations of all targets and measurements.
        matrix: β_tj, association probabilities.
        cases: The case of each target.
        seen: The M measurements.
        parameters: The treatment of occluded targets and of those that reappear.
    """
    p = parameters
    hidden = cases.shared >= 0
    if p.occlusion == "inside":
        hidden &= ~((cases.own == cases.shared) & _alike(targets, cases, seen, p.same_size))
    if p.five_cases and p.occlusion == "inside":
        matrix = _one_each(targets, cases, matrix, p.least_probability)
    # occluded and missed targets are not updated by all associations
    matrix = np.where((hidden | cases.missed)[:, None], 0.0, matrix)
    updated = kalman.update(targets, found, matrix)
    updated = replace(updated, half_sizes=_sizes(targets, cases, hidden, matrix, seen, p))
    for t in np.flatnonzero(hidden):
        j = int(cases.shared[t])
        if p.occlusion == "measurement":
            one = _at_rest(targets, int(t), j, seen, p)
        else:
            alone = (hidden & (cases.shared >= 0) & _in_piece(cases.shared, j, seen)).sum() == 1
            one = _behind(targets, int(t), j, seen, p.one_side, alone=bool(alone))
        updated = _put(updated, int(t), one)
    # a target with a measurement of its own is not occluded, even if another has it as well
    lost = hidden & ((cases.own != cases.shared) | (p.occlusion == "inside"))
    return CaseUpdates(
        replace(
            updated,
            hits=np.where(cases.missed, 0, targets.hits + 1),
            misses=np.where(cases.missed, targets.misses + 1, 0),
            hidden=np.where(lost, targets.hidden + 1, 0),
        ),
        matrix,
        hidden,
    )


def _alike(targets: Targets, cases: Cases, seen: Measured, factor: float) -> Bool[ndarray, " n"]:
    """Whether each target's own measurement has a similar size; False for a target without one.

    Args:
        targets: n targets.
        cases: The case of each target.
        seen: The measurements.
        factor: Largest ratio of the half sizes of both, or its inverse, exclusive.
    """
    alike = np.zeros(targets.size, dtype=bool)
    there = np.flatnonzero(cases.own >= 0)
    ratios = np.log(seen.boxes[cases.own[there], 2:] / targets.half_sizes[there])
    alike[there] = (np.abs(ratios) < np.log(factor)).all(axis=1)
    return alike


def _one_each(
    targets: Targets, cases: Cases, matrix: Float[ndarray, "n M"], least_probability: float
) -> Float[ndarray, "n M"]:
    """Replace the rows of targets with exactly one measurement by a single 1.

    These are targets in front of others; targets that reappear after an occlusion; targets whose
    measurement may as well be another's, since for two at one place the mean over all
    associations would keep both between the two (track coalescence); and targets with a
    measurement outside their gate.
    """
    there = np.flatnonzero(cases.own >= 0)
    leapt = matrix[there, cases.own[there]] == 0.0
    contested = ((matrix > least_probability).sum(axis=0) > 1)[cases.own[there]]
    occluded = (targets.hidden[there] > 0) | (cases.shared[there] >= 0)
    alone = there[leapt | contested | occluded]
    result = matrix.copy()
    result[alone] = 0.0
    result[alone, cases.own[alone]] = 1.0
    return result


def _sizes(
    targets: Targets,
    cases: Cases,
    hidden: Bool[ndarray, " n"],
    matrix: Float[ndarray, "n M"],
    seen: Measured,
    p: JpdaParams,
) -> Float[ndarray, "n 2"]:
    """Smooth the half sizes by the measurements of targets that are not occluded."""
    whole = ~(hidden | cases.split | cases.missed)
    shares = matrix.sum(axis=1, keepdims=True)
    measured = matrix @ seen.boxes[:, 2:] + (1.0 - shares) * targets.half_sizes
    followed = targets.half_sizes + p.size_rate * (measured - targets.half_sizes)
    return np.where(whole[:, None], followed, targets.half_sizes)


def _in_piece(shared: Int[ndarray, " n"], j: int, seen: Measured) -> Bool[ndarray, " n"]:
    """Whether the occluder of each target is in the same component as a measurement."""
    return np.asarray((seen.pieces[shared] == seen.pieces[j]).all(axis=1))


def _at_rest(targets: Targets, t: int, j: int, seen: Measured, p: JpdaParams) -> Targets:
    """Put one occluded target at the measurement, with velocity 0."""
    one = targets.take(np.array([t]))
    place = np.concatenate([seen.boxes[j, :2], one.half_sizes[0]])
    rest = Targets.at_rest(place[None], seen.sigmas[[j]], p.velocity_sigma, one.labels)
    return replace(one, means=rest.means, covariances=rest.covariances)


def _behind(
    targets: Targets, t: int, j: int, seen: Measured, one_side: float, *, alone: bool
) -> Targets:
    """Predict one occluded target inside its foreground component.

    Where the boxes measured in a component leave one of its edges free, and only one target is
    occluded there, the target is placed at that edge.

    Args:
        targets: The predicted targets.
        t: Index of the occluded target.
        j: Index of a measurement in the foreground component.
        seen: The measurements.
        one_side: Factor by which the margin at a free edge must exceed that at the opposite edge.
        alone: Whether no other target is occluded in the component.
    """
    one = targets.take(np.array([t]))
    piece, half_sizes = seen.pieces[j], one.half_sizes[0]
    room = np.maximum(piece[2:] - half_sizes, 0.0)
    low, high = piece[:2] - room, piece[:2] + room
    place = np.clip(one.positions[0], low, high)
    # no innovation inside the component; its extent is the measurement noise
    unsure = np.hypot(room, seen.sigmas[j, :2])
    if alone:
        edges = _left_over(
            piece, seen.boxes[(seen.pieces == piece).all(axis=1)], half_sizes, one_side
        )
        known = edges != 0
        place = np.where(known, np.where(edges < 0, low, high), place)
        unsure = np.where(known, seen.sigmas[j, :2], unsure)
    updated = kalman.update(one, innovations(one, place[None], unsure[None]), np.ones((1, 1)))
    means = updated.means.copy()
    means[0, [X, Y]] = np.clip(updated.positions[0], low, high)
    return replace(updated, means=means)


def _left_over(
    piece: Float[ndarray, " 4"],
    shown: Float[ndarray, "S 4"],
    half_sizes: Float[ndarray, " 2"],
    one_side: float,
) -> Int[ndarray, " 2"]:
    """Find the edges of a component that the boxes measured in it leave free for a target.

    Args:
        piece: Box of the component, pixels.
        shown: Boxes of the S measurements in the component, pixels.
        half_sizes: Half width and half height of the occluded target, pixels.
        one_side: Factor by which the margin at one edge must exceed that at the opposite edge.

    Returns:
        For x and y: −1 the lower edge, 1 the upper one; 0 neither, since one target explains
        neither a margin on both sides nor one wider than the target.
    """
    before = (shown[:, :2] - shown[:, 2:]).min(axis=0) - (piece[:2] - piece[2:])
    after = (piece[:2] + piece[2:]) - (shown[:, :2] + shown[:, 2:]).max(axis=0)
    wider, narrower = np.maximum(before, after), np.minimum(before, after)
    clear = (wider > one_side * np.maximum(narrower, 0.0)) & (wider <= 2.0 * half_sizes)
    return np.where(clear, np.where(before > after, -1, 1), 0)


def _put(targets: Targets, t: int, one: Targets) -> Targets:
    """Replace one of the targets."""
    means, covariances = targets.means.copy(), targets.covariances.copy()
    means[t], covariances[t] = one.means[0], one.covariances[0]
    return replace(targets, means=means, covariances=covariances)
