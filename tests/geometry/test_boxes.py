"""Each way of saying where a box is leads back to the others."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tracker.geometry.boxes import Boxes, box_overlaps, paired_overlaps

CENTRED = np.array([[10.0, 20.0, 3.0, 5.0], [0.5, -1.0, 0.5, 0.25]])
CORNERS = np.array([[7.0, 15.0, 13.0, 25.0], [0.0, -1.25, 1.0, -0.75]])
LEFT_TOP = np.array([[7.0, 15.0, 6.0, 10.0], [0.0, -1.25, 1.0, 0.5]])


def test_one_box_in_three_forms() -> None:
    boxes = Boxes(CENTRED)
    assert_array_equal(boxes.corners, CORNERS)
    assert_array_equal(boxes.left_top, LEFT_TOP)
    assert_array_equal(np.concatenate([boxes.low, boxes.high], axis=1), CORNERS)
    assert_array_equal(np.concatenate([boxes.centres, boxes.half_sizes], axis=1), CENTRED)
    assert_array_equal(Boxes.from_left_top(LEFT_TOP).centred, CENTRED)
    assert_array_equal(Boxes.from_corners(CORNERS[:, :2], CORNERS[:, 2:]).centred, CENTRED)


@pytest.mark.parametrize("shape", [(4,), (0, 4), (7, 4), (3, 2, 4)])
def test_any_number_of_axes_there_and_back(shape: tuple[int, ...]) -> None:
    given = np.random.default_rng(3).uniform(1.0, 500.0, shape)
    boxes = Boxes(given)
    assert boxes.corners.shape == shape
    assert_allclose(Boxes.from_left_top(boxes.left_top).centred, given, rtol=1e-12)
    back = Boxes.from_corners(boxes.corners[..., :2], boxes.corners[..., 2:])
    assert_allclose(back.centred, given, rtol=1e-12, atol=1e-12)


def test_what_is_no_box_is_refused() -> None:
    with pytest.raises(ValueError, match=r"expected four numbers each, got an array of shape \(2,"):
        Boxes(np.zeros((2, 3)))


def test_boxes_share_what_both_cover_of_what_either_covers() -> None:
    first = np.array([[0.0, 0.0, 4.0, 2.0], [10.0, 10.0, 3.0, 3.0], [1.0, 1.0, 0.0, 0.0]])
    second = np.array([[2.0, 1.0, 4.0, 2.0], [4.0, 0.0, 1.0, 2.0], [0.0, 0.0, 4.0, 2.0]])
    # 2 × 1 of 8 + 8 - 2; edge to edge nothing; all of it
    assert_allclose(box_overlaps(first, second), [[2.0 / 14.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3])
    assert_allclose(paired_overlaps(first, second), [2.0 / 14.0, 0.0, 0.0])
    assert box_overlaps(first[:0], second).shape == (0, 3)
    # the area of a mask drawn pixel by pixel, whichever of both comes first
    rng = np.random.default_rng(5)
    boxes = rng.integers(0, 12, (2, 40, 4)).astype(float)
    y, x = np.indices((24, 24)) + 0.5

    def inside(box: ndarray) -> ndarray:
        left, top, width, height = box
        return (x > left) & (x < left + width) & (y > top) & (y < top + height)

    for one, other, share in zip(*boxes, paired_overlaps(*boxes), strict=True):
        a, b = inside(one), inside(other)
        assert share == pytest.approx((a & b).sum() / max((a | b).sum(), 1))
    assert_allclose(paired_overlaps(*boxes), paired_overlaps(*boxes[::-1]))
