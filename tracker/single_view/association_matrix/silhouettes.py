"""Target boxes in outlines: where in a piece of foreground a head, or a head and torso, can be.

A piece of foreground shows all of a person, what is tracked may be a part of it: a
target's box begins at the crown, and its size is known from the calibrated camera. How
many targets a piece shows is believed beforehand; of whom nothing is known,
:mod:`~tracker.single_view.jpda.crowns` finds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.blobs import Blobs
from tracker.camera import Camera
from tracker.foreground import integral, shape_scores
from tracker.kernels.compilation import pixel_kernel
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import BoxSizes

SIZES = 6
"""So many sizes of targets are tried at each place."""

STRIDE = 2
"""Pixels between the columns of a piece of foreground in which crowns are looked for."""

INSIDE_WEIGHT, AROUND_WEIGHT = 3.0, 3.0
"""Of the foreground inside the box, and above and beside it, in a box's score."""

LEAST_INSIDE = 0.4
"""A box with a smaller share of foreground is nobody's."""

WIDTH = 0.5
"""Half sizes over which boxes that fit nearly as well are averaged."""

APART = 1.0
"""Half sizes that two boxes keep."""


@dataclass(frozen=True, slots=True, eq=False)
class Fits:
    """Boxes that outlines fit, piece by piece, the best of a piece first."""

    boxes: Float[ndarray, "N 4"]
    """Centre and half sizes, pixels."""
    scores: Float[ndarray, " N"]
    """At most about 0; e raised to it is taken for a likelihood."""
    owners: Int[ndarray, " N"]
    """The piece of foreground that each is in."""


class Silhouettes:
    """Finds targets in the foreground of one camera by nothing but its outline.

    In every second column of a piece of foreground its highest pixel may be a crown;
    boxes of the sizes that a target can have there hang from it. A good one is full of
    foreground, with background above and beside it (:func:`shape_scores`); the best
    one, averaged with its neighbours, is taken, those near it are dropped, and so on.

    How large a target is at a place depends on its distance, which one camera does not
    tell. People keep about the height at which they come in, so most of the sizes are
    those at the heights of the entrances.
    """

    def __init__(self, camera: Camera, room: Room, half_extents: Float[ndarray, " 3"]) -> None:
        """Work out the sizes at each place of the picture."""
        self._sizes = BoxSizes.of(camera, room, half_extents, at_entrance_heights=True)
        self._table, self._possible = self._sizes.quantiles(SIZES)
        self._usual = (self._sizes.smallest[1] + self._sizes.largest[1]) / 2.0

    def half_heights(self, centres: Float[ndarray, "N 2"]) -> Float[ndarray, " N"]:
        """The usual half height of a target at each place, pixels."""
        place = self._sizes.cells(centres)
        usual = self._table[place, SIZES // 2, 1]
        return np.asarray(np.where(self._possible[place], usual, self._usual))

    def fit(
        self,
        mask: UInt8[ndarray, "h w"],
        pieces: Blobs,
        wanted: Int[ndarray, " J"],
        *,
        acceptance: float,
        further_acceptance: float,
        spare_acceptance: float,
    ) -> Fits:
        """The targets in each piece of foreground.

        Args:
            mask: Foreground.
            pieces: Its pieces.
            wanted: How many targets each piece is believed to hold.
            acceptance: Least score of a piece's best box.
            further_acceptance: Least score of its others.
            spare_acceptance: Least score of boxes beyond the number that is believed.
        """
        boxes, owners = _candidates(
            pieces.owners,
            pieces.boxes,
            self._table,
            self._possible,
            self._sizes.cell,
            self._sizes.columns,
            self._sizes.rows,
            self._usual,
            STRIDE,
        )
        scores, inside = shape_scores(
            integral(mask), boxes, inside_weight=INSIDE_WEIGHT, around_weight=AROUND_WEIGHT
        )
        good = inside >= LEAST_INSIDE
        return Fits(
            *_choose(
                boxes[good],
                scores[good],
                owners[good],
                np.asarray(wanted, dtype=np.int64),
                acceptance,
                further_acceptance,
                spare_acceptance,
                WIDTH,
                APART,
            )
        )


@pixel_kernel
def _candidates(
    owners: ndarray,
    pieces: ndarray,
    table: ndarray,
    possible: ndarray,
    cell: float,
    columns: int,
    rows: int,
    usual: float,
    stride: int,
) -> tuple[ndarray, ndarray]:
    """Boxes of every size that hang from the highest pixels of each piece.

    A box's size depends on the place of its centre, and that on its size: three
    rounds settle it.

    Args:
        owners: (h, w), the piece of each pixel.
        pieces: (J, 4), their boxes.
        table: (cells, Q, 2), sizes at each place.
        possible: (cells,), whether a target's centre can be there.
        cell: Side of a cell, pixels.
        columns: Cells across.
        rows: Cells down.
        usual: Half height that is tried first.
        stride: Pixels between columns.

    Returns:
        (N, 4) boxes and (N,) their pieces.
    """
    sizes = table.shape[1]
    most = 0
    for j in range(len(pieces)):
        most += (int(2.0 * pieces[j, 2]) // stride + 1) * sizes
    boxes = np.empty((most, 4))
    whose = np.empty(most, dtype=np.int64)
    count = 0
    for j in range(len(pieces)):
        left, right = round(pieces[j, 0] - pieces[j, 2] + 0.5), round(pieces[j, 0] + pieces[j, 2])
        top, bottom = round(pieces[j, 1] - pieces[j, 3] + 0.5), round(pieces[j, 1] + pieces[j, 3])
        for x in range(left, right, stride):
            crown = -1
            for y in range(top, bottom):
                if owners[y, x] == j:
                    crown = y
                    break
            if crown < 0:
                continue
            column = min(max(int((x + 0.5) // cell), 0), columns - 1)
            for q in range(sizes):
                half_x, half_y = 0.0, usual
                found = False
                for _ in range(3):
                    row = min(max(int((crown + half_y + 0.5) // cell), 0), rows - 1)
                    place = row * columns + column
                    found = possible[place]
                    if found:
                        half_x, half_y = table[place, q, 0], table[place, q, 1]
                if found:
                    boxes[count, 0], boxes[count, 1] = float(x), crown + half_y - 0.5
                    boxes[count, 2], boxes[count, 3] = half_x, half_y
                    whose[count] = j
                    count += 1
    return boxes[:count].copy(), whose[:count].copy()


@pixel_kernel
def _choose(
    boxes: ndarray,
    scores: ndarray,
    owners: ndarray,
    wanted: ndarray,
    acceptance: float,
    further_acceptance: float,
    spare_acceptance: float,
    width: float,
    apart: float,
) -> tuple[ndarray, ndarray, ndarray]:
    """The best boxes of each piece, averaged with their neighbours, that keep apart.

    Args:
        boxes: (N, 4), piece by piece.
        scores: (N,).
        owners: (N,), ascending.
        wanted: (J,), boxes of each piece.
        acceptance: Least score of the first.
        further_acceptance: Least score of the others.
        spare_acceptance: Least score beyond that number.
        width: Of the Gaussian that averages, in half sizes.
        apart: Distance that two boxes keep, in half sizes.

    Returns:
        Boxes, scores, owners.
    """
    chosen = np.empty_like(boxes)
    values = np.empty(len(boxes))
    whose = np.empty(len(boxes), dtype=np.int64)
    free = np.ones(len(boxes), dtype=np.bool_)
    count, begin = 0, 0
    for j in range(len(wanted)):
        end = begin
        while end < len(boxes) and owners[end] == j:
            end += 1
        taken = 0
        while True:
            best = -1
            for i in range(begin, end):
                if free[i] and (best < 0 or scores[i] > scores[best]):
                    best = i
            least = acceptance if taken == 0 else further_acceptance
            if taken >= wanted[j]:
                least = spare_acceptance
            if best < 0 or scores[best] < least:
                break
            mean, total = np.zeros(4), 0.0
            for i in range(begin, end):
                u = (boxes[i, 0] - boxes[best, 0]) / (width * boxes[best, 2])
                v = (boxes[i, 1] - boxes[best, 1]) / (width * boxes[best, 3])
                s = (boxes[i, 3] - boxes[best, 3]) / (width * boxes[best, 3])
                square = u * u + v * v + s * s
                if square < 9.0:
                    weight = np.exp(scores[i] - scores[best] - 0.5 * square)
                    total += weight
                    for a in range(4):
                        mean[a] += weight * boxes[i, a]
            for a in range(4):
                mean[a] /= total
            clear = True
            for k in range(count - taken, count):
                u = (mean[0] - chosen[k, 0]) / chosen[k, 2]
                v = (mean[1] - chosen[k, 1]) / chosen[k, 3]
                clear = clear and u * u + v * v >= apart * apart
            free[best] = False
            if not clear:
                continue
            chosen[count], values[count], whose[count] = mean, scores[best], j
            count += 1
            taken += 1
            for i in range(begin, end):
                u = (boxes[i, 0] - mean[0]) / mean[2]
                v = (boxes[i, 1] - mean[1]) / mean[3]
                if u * u + v * v < apart * apart:
                    free[i] = False
        begin = end
    return chosen[:count].copy(), values[:count].copy(), whose[:count].copy()
