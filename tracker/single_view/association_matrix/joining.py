"""Pieces of one person put together again: a shirt like the wall parts head and legs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.csgraph import connected_components

from tracker.geometry.boxes import Boxes
from tracker.single_view.pictures.blobs import Blobs


def join(pieces: Blobs, gaps: Float[ndarray, " N"]) -> Blobs:
    """Put pieces together that lie above each other, one after the other.

    Two are put together where the narrower one has at least half of its width in
    common with the other, and where no more than the larger one's gap is between them.

    Args:
        pieces: Of the foreground.
        gaps: How far below or above each piece another one of the same person may be, pixels.
    """
    count = pieces.size
    if count < 2:
        return pieces
    low, high = Boxes(pieces.boxes).low, Boxes(pieces.boxes).high
    common = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    narrower = np.minimum(pieces.boxes[:, None, 2], pieces.boxes[None, :, 2])
    near = (common[..., 0] >= narrower) & (-common[..., 1] <= np.maximum(gaps[:, None], gaps[None]))
    groups, owner = connected_components(near, directed=False)
    if groups == count:
        return pieces
    # the order of their top edges stays: a group stands where its first piece stood
    _, first = np.unique(owner, return_index=True)
    rank = np.empty(groups, dtype=np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(groups)
    owners = rank[owner]
    lows, highs = np.full((groups, 2), np.inf), np.full((groups, 2), -np.inf)
    np.minimum.at(lows, owners, low)
    np.maximum.at(highs, owners, high)
    boxes = Boxes.from_corners(lows, highs).centred
    areas = np.bincount(owners, weights=pieces.areas, minlength=groups).astype(np.int64)
    names = np.append(owners, -1).astype(np.int32)  # -1, the background, is the last of them
    return Blobs(boxes, areas, names[pieces.owners])
