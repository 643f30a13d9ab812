"""Decision matrices between the objects of two steps, by distance and by overlap.

Rows are the objects of the step before, columns those of this one.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse.csgraph import connected_components


def distances(before: Float[ndarray, "I 2"], now: Float[ndarray, "J 2"]) -> Float[ndarray, "I J"]:
    """Compute the distances of predicted and present centres, pixels.

    Args:
        before: Predicted centres of the I objects of the step before, pixels.
        now: Centres of this step's J objects, pixels.
    """
    return np.asarray(np.linalg.norm(before[:, None] - now[None, :], axis=2))


def decide_by_distance(
    apart: Float[ndarray, "I J"], reach: Float[ndarray, " I"]
) -> Bool[ndarray, "I J"]:
    """Decide R for an equal number of objects: mutual nearest neighbours within reach.

    Args:
        apart: Distances, pixels.
        reach: Largest distance of each object of the step before, pixels.
    """
    if apart.size == 0:
        return np.zeros(apart.shape, dtype=bool)
    rows, columns = np.indices(apart.shape)
    mutual = (apart.argmin(axis=1)[:, None] == columns) & (apart.argmin(axis=0)[None, :] == rows)
    return np.asarray(mutual & (apart <= reach[:, None]))


def box_overlaps(
    before: Float[ndarray, "I 4"], now: Float[ndarray, "J 4"]
) -> Float[ndarray, "I J"]:
    """Compute the area that the boxes of two objects share, square pixels.

    Args:
        before: Boxes of the objects of the step before: centre and half sizes, pixels.
        now: Boxes of this step's objects.
    """
    low = np.maximum((before[:, :2] - before[:, 2:])[:, None], (now[:, :2] - now[:, 2:])[None, :])
    high = np.minimum((before[:, :2] + before[:, 2:])[:, None], (now[:, :2] + now[:, 2:])[None, :])
    return np.asarray(np.prod(np.clip(high - low, 0.0, None), axis=2))


def pixel_overlaps(
    before: Int[ndarray, "h w"], now: Int[ndarray, "h w"], rows: int, columns: int
) -> Int[ndarray, "I J"]:
    """Count the pixels that two objects share.

    Args:
        before: Object of each pixel at the step before, -1 for none.
        now: Object of each pixel at this step, -1 for none.
        rows: Number of objects before.
        columns: Number of objects now.
    """
    both = (before >= 0) & (now >= 0)
    pairs = before[both].astype(np.int64) * columns + now[both]
    return np.bincount(pairs, minlength=rows * columns).reshape(rows, columns)


def is_one_to_one(decision: Bool[ndarray, "I J"]) -> bool:
    """Whether every object of either step has exactly one of the other."""
    return bool((decision.sum(axis=0) == 1).all() and (decision.sum(axis=1) == 1).all())


def families(decision: Bool[ndarray, "I J"]) -> list[tuple[list[int], list[int]]]:
    """Find the connected components of R; each object is in exactly one family.

    A family of one row and one column continues; without a row it is new; without a column it is
    interrupted; with several rows it merges, with several columns it splits, or both at once.
    """
    rows, columns = decision.shape
    graph = np.zeros((rows + columns, rows + columns), dtype=bool)
    graph[:rows, rows:] = decision
    count, owners = connected_components(graph, directed=False)
    return [
        (
            np.flatnonzero(owners[:rows] == family).tolist(),
            np.flatnonzero(owners[rows:] == family).tolist(),
        )
        for family in range(count)
    ]
