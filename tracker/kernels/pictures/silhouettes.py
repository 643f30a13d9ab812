"""Candidate boxes of targets from the outlines of foreground components, compiled.

Boxes are rows of ``centre_x, centre_y, half_width, half_height`` in pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


class SizeTable(NamedTuple):
    """Possible sizes of a target at each place of an image, by the cells of a grid."""

    table: ndarray
    """(cells, Q, 2), half widths and half heights of Q sizes, pixels."""
    possible: ndarray
    """(cells,), whether a target's centre can be there."""
    cell: float
    """Side of a cell, pixels."""
    columns: int
    """Number of cells across."""
    rows: int
    """Number of cells down."""


class Candidates(NamedTuple):
    """N candidate boxes of targets."""

    boxes: ndarray
    """(N, 4), pixels."""
    owners: ndarray
    """(N,), the foreground component of each box, ascending."""


class Acceptance(NamedTuple):
    """Least scores of the boxes of a foreground component."""

    first: float
    """Least score of the best box."""
    further: float
    """Least score of further boxes, up to the estimated number of targets."""
    spare: float
    """Least score of boxes beyond that number."""


class Chosen(NamedTuple):
    """The accepted boxes, component by component, the best of each first."""

    boxes: ndarray
    """(N, 4), pixels."""
    scores: ndarray
    """(N,), scores."""
    owners: ndarray
    """(N,), the foreground component of each box."""


@pixel_kernel
def candidates(
    owners: ndarray,
    pieces: ndarray,
    sizes: SizeTable,
    usual: float,
    stride: int,
) -> Candidates:
    """Make boxes of every size at the topmost pixels of each foreground component.

    The size of a box depends on the place of its centre, and that on its size: three
    iterations determine both.

    Args:
        owners: (h, w), the foreground component of each pixel.
        pieces: (J, 4), boxes of the components, pixels.
        sizes: The possible sizes at each place.
        usual: Half height of the first iteration, pixels.
        stride: Distance between columns, pixels.
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
    """Select the best boxes of each component, averaged with their neighbours, that keep apart.

    A box's neighbours are the candidates of its component within three standard deviations of the
    average's weights, in place and in height.

    Args:
        candidates: The candidate boxes, component by component.
        scores: (N,), their scores.
        wanted: (J,), estimated number of targets of each component.
        acceptance: The least scores.
        width: Standard deviation of the Gaussian weights of the average, in half sizes.
        apart: Least distance of two boxes, in half sizes.
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
        accepted = 0
        while True:
            best = -1
            for i in range(begin, end):
                if free[i] and (best < 0 or scores[i] > scores[best]):
                    best = i
            least = acceptance.first if accepted == 0 else acceptance.further
            if accepted >= wanted[j]:
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
            for k in range(count - accepted, count):
                u = (mean[0] - chosen[k, 0]) / chosen[k, 2]
                v = (mean[1] - chosen[k, 1]) / chosen[k, 3]
                clear = clear and u * u + v * v >= apart * apart
            free[best] = False
            if not clear:
                continue
            chosen[count], values[count], whose[count] = mean, scores[best], j
            count += 1
            accepted += 1
            for i in range(begin, end):
                u = (boxes[i, 0] - mean[0]) / mean[2]
                v = (boxes[i, 1] - mean[1]) / mean[3]
                if u * u + v * v < apart * apart:
                    free[i] = False
        begin = end
    return Chosen(chosen[:count].copy(), values[:count].copy(), whose[:count].copy())
