"""The tables of a sequence folder: which steps they know."""

from __future__ import annotations

import numpy as np

from tracker.sequences.tables import regular_gap


def test_a_gap_between_frames_is_decided_at_a_thousand_to_one() -> None:
    even = 2 * np.arange(12)  # 2 ** 10 : 1
    assert regular_gap(even) == 2
    assert regular_gap(even[:11]) == 1
    assert regular_gap(even[:7], even[:7]) == 2  # of another camera: five frames more each
    assert regular_gap(even[:7], 3 * np.arange(50)) == 1
    assert regular_gap(np.append(even, 101)) == 1
    assert regular_gap(10 * np.arange(5)) == 10
    assert regular_gap(np.array([3, 90])) == 1
