"""The pieces of a mask against a flood fill written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_array_equal

from tracker.single_view.pictures.blobs import blobs


def flood(mask: ndarray) -> list[set[tuple[int, int]]]:
    """Pieces as sets of (row, column), in the order in which rows meet them."""
    left = set(zip(*np.nonzero(mask), strict=True))
    pieces = []
    for start in zip(*np.nonzero(mask), strict=True):
        if start not in left:
            continue
        left.discard(start)
        piece, edge = {start}, [start]
        while edge:
            row, column = edge.pop()
            for near in ((row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
                if near in left:
                    left.discard(near)
                    piece.add(near)
                    edge.append(near)
        pieces.append(piece)
    return pieces


@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.integers(1, 6))
def test_pieces_agree_with_a_flood_fill(seed: int, share: float, least: int) -> None:
    rng = np.random.default_rng(seed)
    mask = (rng.random((11, 14)) < share).astype(np.uint8) * 255
    found = blobs(mask, least)
    pieces = [piece for piece in flood(mask) if len(piece) >= least]
    assert found.size == len(pieces)
    assert (np.diff(found.boxes[:, 1] - found.boxes[:, 3]) >= 0.0).all()
    seen = set()
    for name in range(found.size):
        pixels = set(zip(*np.nonzero(found.owners == name), strict=True))
        assert pixels in pieces
        seen |= pixels
        rows, columns = np.array(sorted(pixels)).T
        x, y, half_width, half_height = found.boxes[name]
        assert found.areas[name] == len(pixels)
        assert (x - half_width, x + half_width) == (columns.min() - 0.5, columns.max() + 0.5)
        assert (y - half_height, y + half_height) == (rows.min() - 0.5, rows.max() + 0.5)
    assert seen == {pixel for piece in pieces for pixel in piece}


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (4, 4)])
def test_nothing_gives_no_boxes(shape: tuple[int, int]) -> None:
    found = blobs(np.zeros(shape, dtype=np.uint8), 1)
    assert found.boxes.shape == (0, 4)
    assert found.areas.shape == (0,)
    assert (found.owners == -1).all()


def test_one_pixel_is_a_box_of_one_pixel() -> None:
    mask = np.zeros((5, 7), dtype=bool)
    mask[3, 6] = True
    assert_array_equal(blobs(mask, 1).boxes, [[6.0, 3.0, 0.5, 0.5]])
    assert len(blobs(mask, 2).boxes) == 0


def test_a_picture_in_colour_is_no_mask() -> None:
    with pytest.raises(
        ValueError, match=r"mask: expected \(height, width\), got shape \(4, 4, 3\)"
    ):
        blobs(np.zeros((4, 4, 3), dtype=np.uint8), 1)
