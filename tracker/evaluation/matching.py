"""The matching protocol of all figures: which estimate belongs to which true position at a step.

At each step, estimates and people are paired one to one so that

    Σ over pairs (1 − d / (2 gate))  is largest,  d <= gate in every pair:

a pair counts from 1 (no distance) down to 1/2 (at the gate), so a second pair is
nearly always worth more than a closer one. TrackEval scores 3D positions in the same way, with
a zero distance of twice the gate and a threshold of 1/2.

Rows of the truth with ``valid = 0`` are "don't care". At each step, before any figure:

1. estimates are paired with *all* rows, don't-care ones included, as above, but the
   distance of a don't-care row counts double: its score is 1 − d / gate;
2. an estimate paired with a don't-care row is removed: it is neither correct nor false;
3. all don't-care rows are removed: missing one is not a miss.

So an uncertain position is paired with an estimate instead of a certain one only if it is less than
half as far from the estimate. If its distance did not count double, it would often be paired with
an estimate that belongs to a certain position. If certain rows were always paired first, a person
without an estimate would be paired with that of an uncertain neighbour, which would add two
identity switches. All figures are computed from the remaining rows, and pair them by their own
definitions.

Distances: Euclidean in 3D (metres, the default); Euclidean on the ground plane
(metres); or (1 − GIoU)/2 of the two upright boxes, 0 for equal boxes, 1/2 for
touching ones, towards 1 far apart [RTGSRS19].

[RTGSRS19] Rezatofighi et al., "Generalized intersection over union", CVPR 2019.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation.settings import Distance
from tracker.geometry.assignment import linear_sum_assignment
from tracker.sequences.sequence import GroundTruth, LabelledPositions

RowPairs = tuple[Int[ndarray, " M"], Int[ndarray, " M"]]
"""The rows and the columns of the pairs of one step."""

_NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Labelled positions sorted by step and then id, each id at most once a step."""

    frames: Int[ndarray, " N"]
    """The step of each row."""
    ids: Int[ndarray, " N"]
    """The track or person of each row."""
    positions: Float[ndarray, "N 3"]
    """The position of each row, world metres."""
    offsets: Int[ndarray, " S+1"]
    """Rows ``offsets[t]`` up to ``offsets[t + 1]`` are those of step t."""
    names: Int[ndarray, " K"]
    """The distinct ids, ascending."""
    indices: Int[ndarray, " N"]
    """The index of each row's id in :attr:`names`."""

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def steps(self) -> int:
        """The number of steps, those without rows included."""
        return len(self.offsets) - 1

    @property
    def counts(self) -> Int[ndarray, " S"]:
        """The number of rows at each step."""
        return np.diff(self.offsets)

    def at(self, step: int) -> slice:
        """Return the slice of the rows of one step."""
        return slice(int(self.offsets[step]), int(self.offsets[step + 1]))

    def select(self, rows: ndarray) -> Rows:
        """Select rows by mask or ascending index; an id without rows disappears."""
        return _sorted_rows(self.frames[rows], self.ids[rows], self.positions[rows], self.steps)


def _sorted_rows(frames: ndarray, ids: ndarray, positions: ndarray, steps: int) -> Rows:
    names, indices = np.unique(ids, return_inverse=True)
    offsets = np.searchsorted(frames, np.arange(steps + 1))
    return Rows(frames, ids, positions, offsets, names, indices.reshape(-1))


def to_rows(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: Float[ndarray, "N 3"],
    steps: int,
) -> tuple[Rows, Int[ndarray, " M"]]:
    """Sort rows, and leave out those that cannot be scored.

    Left out are rows outside the steps 0 … ``steps`` − 1, rows whose position is
    not finite, and every row after the first that repeats an id within a step.

    Args:
        frames: The step of each row, in any order.
        ids: The track or person of each row.
        positions: The position of each row, world metres.
        steps: Number of steps.

    Returns:
        The sorted rows, and the index of each in the arguments.
    """
    frames = np.asarray(frames, dtype=np.int64).reshape(-1)
    ids = np.asarray(ids, dtype=np.int64).reshape(-1)
    positions = np.asarray(positions, dtype=float).reshape(-1, 3)
    usable = (frames >= 0) & (frames < steps) & np.isfinite(positions).all(axis=1)
    kept = np.flatnonzero(usable)
    kept = kept[np.lexsort((ids[kept], frames[kept]))]
    repeated = np.zeros(len(kept), dtype=bool)
    repeated[1:] = (np.diff(frames[kept]) == 0) & (np.diff(ids[kept]) == 0)
    kept = kept[~repeated]
    return _sorted_rows(frames[kept], ids[kept], positions[kept], steps), kept


@dataclass(frozen=True, slots=True, eq=False)
class GatedDistance:
    """A distance between positions, and its gate."""

    distance: Distance
    """The kind of distance."""
    gate: float
    """The largest distance of a pair, in the unit of the distance."""
    half_extents: Float[ndarray, " 3"]
    """Half width, depth and height of the upright boxes, metres, for the box distance."""

    def between(
        self, first: Float[ndarray, "N 3"], second: Float[ndarray, "N 3"]
    ) -> Float[ndarray, " N"]:
        """Compute the distances between two arrays of positions (world metres), row by row."""
        apart = first - second
        if self.distance == "ground":
            return np.asarray(np.hypot(apart[:, 0], apart[:, 1]))
        if self.distance == "position":
            return np.asarray(np.sqrt(np.einsum("nk,nk->n", apart, apart)))
        apart, size = np.abs(apart), 2.0 * self.half_extents
        shared = np.maximum(size - apart, 0.0).prod(axis=1)
        union, hull = 2.0 * size.prod() - shared, (size + apart).prod(axis=1)
        return np.asarray((1.0 - (shared / union - (hull - union) / hull)) / 2.0)


def distances_by_step(
    truth: Rows, tracks: Rows, measure: GatedDistance
) -> tuple[Float[ndarray, "G E"], ...]:
    """Compute the distance of every person to every estimate, a matrix for each step."""
    rows, columns = truth.counts, tracks.counts
    sizes = rows * columns
    ends = np.cumsum(sizes)
    step = np.repeat(np.arange(truth.steps), sizes)
    place = np.arange(len(step)) - np.repeat(ends - sizes, sizes)
    first = truth.positions[truth.offsets[step] + place // columns[step]]
    second = tracks.positions[tracks.offsets[step] + place % columns[step]]
    flat = measure.between(first, second)
    return tuple(
        flat[end - size : end].reshape(g, e)
        for end, size, g, e in zip(
            ends.tolist(), sizes.tolist(), rows.tolist(), columns.tolist(), strict=True
        )
    )


def assign(
    distances: Float[ndarray, "G E"], gate: float, bonus: Float[ndarray, "G E"] | float = 0.0
) -> RowPairs:
    """Pair people and estimates of one step by the module's protocol.

    Args:
        distances: The distance of every person (rows) to every estimate (columns).
        gate: Largest distance of a pair, in the same unit.
        bonus: What is added to the score of each pair within the gate, at least 0.

    Returns:
        The row and the column of each pair; empty if there are no people or no estimates.
    """
    if not distances.size:
        return _NONE, _NONE
    score = np.where(distances <= gate, bonus + 1.0 - distances / (2.0 * gate), 0.0)
    rows, columns = linear_sum_assignment(score, maximize=True)
    paired = score[rows, columns] > 0.0
    return rows[paired], columns[paired]


def _on_dont_care(
    certain: Float[ndarray, "G E"], uncertain: Float[ndarray, "D E"], gate: float
) -> Int[ndarray, " I"]:
    """Return the estimates (columns) of one step that are paired with a don't-care row.

    Args:
        certain: The distance of every certain person (rows) to every estimate (columns).
        uncertain: The distance of every don't-care row to every estimate.
        gate: Largest distance of a pair, in the same unit.
    """
    score = np.concatenate([1.0 - certain / (2.0 * gate), 1.0 - uncertain / gate])
    score[np.concatenate([certain, uncertain]) > gate] = 0.0
    rows, columns = linear_sum_assignment(score, maximize=True)
    return np.asarray(columns[(rows >= len(certain)) & (score[rows, columns] > 0.0)])


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Truth and estimates that the figures are computed from, with "don't care" removed."""

    truth: Rows
    """The valid true positions."""
    tracks: Rows
    """The estimates that count."""
    distances: tuple[Float[ndarray, "G E"], ...]
    """The distance of every person (rows) to every estimate (columns), a matrix for each step."""
    measure: GatedDistance
    """The distance and its gate."""
    ignored: Rows
    """The estimates that matched a don't-care row."""
    dont_care: Rows
    """The true positions that are not certain."""
    unknown: int
    """The number of steps that the truth does not cover."""
    left_out: int
    """The number of estimates that could not be scored (see :func:`to_rows`)."""

    @property
    def steps(self) -> int:
        """The number of steps compared."""
        return self.truth.steps

    def by_step(
        self,
    ) -> Iterator[tuple[Int[ndarray, " G"], Int[ndarray, " E"], Float[ndarray, "G E"]]]:
        """Yield the indices of the people and of the tracks of each step, and their distances."""
        truth, tracks = self.truth, self.tracks
        for step, distances in enumerate(self.distances):
            yield truth.indices[truth.at(step)], tracks.indices[tracks.at(step)], distances

    def apart(self, matches: Matches, measure: GatedDistance | None = None) -> Float[ndarray, " M"]:
        """Compute the distance of each pair, by another measure if one is named."""
        return (measure or self.measure).between(
            self.truth.positions[matches.truth_rows], self.tracks.positions[matches.track_rows]
        )


def prepare(
    truth: GroundTruth | None,
    tracks: LabelledPositions,
    measure: GatedDistance,
    *,
    steps: int,
) -> Comparison:
    """Sort truth and estimates, and remove what is "don't care" by the module's protocol.

    Args:
        truth: The ground truth; None is a truth without rows.
        tracks: The estimates, in any order.
        measure: Distance and gate.
        steps: Steps 0 … ``steps`` − 1 are compared; on steps that the truth does not cover
            neither side counts.
    """
    everyone, sources = to_rows(
        truth.frames if truth else np.zeros(0),
        truth.ids if truth else np.zeros(0),
        truth.positions if truth else np.zeros((0, 3)),
        steps,
    )
    valid = np.asarray(truth.valid, dtype=bool)[sources] if truth else np.zeros(0, dtype=bool)
    people, dont_care = everyone.select(valid), everyone.select(~valid)
    estimates, _ = to_rows(tracks.frames, tracks.ids, tracks.positions, steps)
    left_out = len(np.asarray(tracks.frames)) - len(estimates)
    unknown = 0
    if truth is not None and truth.known is not None:
        known = np.zeros(steps, dtype=bool)
        known[: len(truth.known)] = truth.known[:steps]
        people, dont_care = (
            people.select(known[people.frames]),
            dont_care.select(known[dont_care.frames]),
        )
        estimates = estimates.select(known[estimates.frames])
        unknown = int((~known).sum())
    distances = distances_by_step(people, estimates, measure)
    keep = np.ones(len(estimates), dtype=bool)
    if len(dont_care):
        uncertain = distances_by_step(dont_care, estimates, measure)
        for step in np.flatnonzero(dont_care.counts * estimates.counts):
            ignored = _on_dont_care(distances[step], uncertain[step], measure.gate)
            keep[estimates.offsets[step] + ignored] = False
        distances = tuple(
            matrix[:, keep[estimates.at(step)]] for step, matrix in enumerate(distances)
        )
    return Comparison(
        truth=people,
        tracks=estimates.select(keep),
        distances=distances,
        measure=measure,
        ignored=estimates.select(~keep),
        dont_care=dont_care,
        unknown=unknown,
        left_out=left_out,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Pairs of a person and an estimate, by columns, sorted by step."""

    truth_rows: Int[ndarray, " M"]
    """Rows of :attr:`Comparison.truth`."""
    track_rows: Int[ndarray, " M"]
    """Rows of :attr:`Comparison.tracks`."""

    def __len__(self) -> int:
        return len(self.truth_rows)


def gather(comparison: Comparison, pairs: Sequence[RowPairs]) -> Matches:
    """Convert the pairs of each step (rows, columns) to rows of the whole sequence."""
    columns = []
    for side, rows in enumerate((comparison.truth, comparison.tracks)):
        offsets = rows.offsets[:-1].tolist()
        parts = [pair[side] + offset for pair, offset in zip(pairs, offsets, strict=True)]
        columns.append(np.concatenate([_NONE, *parts]))
    return Matches(*columns)


def match(comparison: Comparison) -> Matches:
    """Pair people and estimates at each step on its own."""
    gate = comparison.measure.gate
    return gather(comparison, [assign(distances, gate) for distances in comparison.distances])
