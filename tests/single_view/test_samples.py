"""Samples are packed for display: within an eighth of a pixel, and weights against the largest."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tracker.single_view.protocol import pack_samples, unpack_samples

FURTHEST = 8191.75
"""Pixels from the origin that a packed centre can be at."""


@given(
    arrays(float, (7, 4), elements=st.floats(-FURTHEST, FURTHEST)),
    arrays(float, 7, elements=st.floats(0.0, 1e6)),
)
def test_what_is_unpacked_was_packed(boxes: ndarray, weights: ndarray) -> None:
    centres, shares = unpack_samples(pack_samples(boxes, weights))
    assert_allclose(centres, boxes[:, :2], atol=0.125)
    if weights.max() > 1e-6:
        assert_allclose(shares, weights / weights.max(), atol=0.0005)


def test_samples_of_no_weight_and_far_outside_are_kept() -> None:
    packed = pack_samples(np.array([[1e6, -1e6, 3.0, 4.0], [2.0, 3.0, 1.0, 1.0]]), np.zeros(2))
    centres, shares = unpack_samples(packed)
    assert_array_equal(centres, [[FURTHEST, -8192.0], [2.0, 3.0]])
    assert_array_equal(shares, [0.0, 0.0])
    assert pack_samples(np.zeros((0, 4)), np.zeros(0)).shape == (0, 3)
