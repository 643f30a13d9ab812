"""Target boxes that hang from the outlines of pieces of foreground, compiled.

Boxes are rows of ``centre_x, centre_y, half_width, half_height`` in pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


class SizeTable(NamedTuple):
    """How large a target can be at each place of a picture, cell by cell."""

    table: ndarray
    """(cells, Q, 2), half widths and half heights, pixels."""
    possible: ndarray
    """(cells,), whether a target's centre can be there."""
    cell: float
    """Side of a cell, pixels."""
    columns: int
    """Cells across."""
    rows: int
    """Cells down."""


class Candidates(NamedTuple):
    """N boxes that may be targets'."""

    boxes: ndarray
    """(N, 4)."""
    owners: ndarray
    """(N,), the piece of foreground that each is in, ascending."""


class Acceptance(NamedTuple):
    """Least scores of a piece's boxes."""

    first: float
    """Of its best."""
    further: float
    """Of the others, up to the number that is believed."""
    spare: float
    """Beyond that number."""


class Chosen(NamedTuple):
    """The boxes that are taken for targets', piece by piece, the best of a piece first."""

    boxes: ndarray
    """(N, 4)."""
    scores: ndarray
    """(N,)."""
    owners: ndarray
    """(N,), the piece of each."""


@pixel_kernel
def candidates(
    owners: ndarray,
    pieces: ndarray,
    sizes: SizeTable,
    usual: float,
    stride: int,
) -> Candidates:
    """Boxes of every size that hang from the highest pixels of each piece.

    A box's size depends on the place of its centre, and that on its size: three
    rounds settle it.

    Args:
        owners: (h, w), the piece of each pixel.
        pieces: (J, 4), their boxes.
        sizes: At each place.
        usual: Half height that is tried first.
        stride: Pixels between columns.
    """
    table, possible, cell = sizes.table, sizes.possible, sizes.cell
    tried = table.shape[1]
    most = 0
    for j in range(len(pieces)):
        most += (int(2.0 * pieces[j, 2]) // stride + 1) * tried
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
            column = min(max(int((x + 0.5) // cell), 0), sizes.columns - 1)
            for q in range(tried):
                half_x, half_y = 0.0, usual
                found = False
                for _ in range(3):
                    row = min(max(int((crown + half_y + 0.5) // cell), 0), sizes.rows - 1)
                    place = row * sizes.columns + column
                    found = possible[place]
                    if found:
                        half_x, half_y = table[place, q, 0], table[place, q, 1]
                if found:
                    boxes[count, 0], boxes[count, 1] = float(x), crown + half_y - 0.5
                    boxes[count, 2], boxes[count, 3] = half_x, half_y
                    whose[count] = j
                    count += 1
    return Candidates(boxes[:count].copy(), whose[:count].copy())


@pixel_kernel
def choose(
    candidates: Candidates,
    scores: ndarray,
    wanted: ndarray,
    acceptance: Acceptance,
    width: float,
    apart: float,
) -> Chosen:
    """The best boxes of each piece, averaged with their neighbours, that keep apart.

    Args:
        candidates: Piece by piece.
        scores: (N,), theirs.
        wanted: (J,), boxes of each piece.
        acceptance: The least scores.
        width: Of the Gaussian that averages, in half sizes.
        apart: Distance that two boxes keep, in half sizes.
    """
    boxes, owners = candidates.boxes, candidates.owners
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
            least = acceptance.first if taken == 0 else acceptance.further
            if taken >= wanted[j]:
                least = acceptance.spare
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
    return Chosen(chosen[:count].copy(), values[:count].copy(), whose[:count].copy())
