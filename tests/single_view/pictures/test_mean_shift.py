"""Mean shift finds the modes of mixtures whose modes are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker.single_view.colour import peaks

CENTRES = np.array([[60.0, 50.0, 10.0, 15.0], [110.0, 52.0, 12.0, 16.0], [62.0, 140.0, 8.0, 12.0]])


def boxes_around(centres: ndarray, counts: list[int], seed: int = 0) -> ndarray:
    """Boxes that scatter by a quarter of their half sizes."""
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [
            centre + rng.normal(0.0, 0.25, (count, 4)) * centre[[2, 3, 2, 3]]
            for centre, count in zip(centres, counts, strict=True)
        ]
    )


def climb(boxes: ndarray, weights: ndarray, most: int = 20) -> tuple[ndarray, ndarray]:
    starts = peaks.heaviest_samples(boxes, weights, most, spread=True)
    return peaks.modes(boxes, weights, boxes[starts], bandwidth=0.6, merge_distance=1.0)


def test_the_modes_of_a_mixture_are_found_densest_first() -> None:
    boxes = boxes_around(CENTRES, [500, 300, 150])
    modes, densities = climb(boxes, np.ones(len(boxes)))
    assert len(modes) == 3
    assert np.all(np.diff(densities) < 0.0)
    assert np.abs((modes - CENTRES) / CENTRES[:, [2, 3, 2, 3]]).max() < 0.1


def test_weights_make_modes_as_numbers_of_samples_do() -> None:
    boxes = boxes_around(CENTRES[:2], [300, 300])
    weights = np.repeat([0.2, 1.0], 300)
    modes, _ = climb(boxes, weights)
    assert np.abs(modes[0, :2] - CENTRES[1, :2]).max() < 1.5


@given(st.floats(0.1, 20.0), st.floats(-300.0, 300.0), st.floats(-300.0, 300.0))
def test_modes_move_and_grow_with_the_samples(scale: float, x: float, y: float) -> None:
    boxes = boxes_around(CENTRES, [60, 40, 20])
    modes, densities = climb(boxes, np.ones(len(boxes)))
    moved, same = climb(boxes * scale + [x, y, 0.0, 0.0], np.ones(len(boxes)))
    np.testing.assert_allclose(moved, modes * scale + [x, y, 0.0, 0.0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(same, densities, rtol=1e-6)


def test_a_mode_is_where_the_weighted_mean_of_its_neighbours_is() -> None:
    boxes = boxes_around(CENTRES, [80, 50, 30], seed=4)
    weights = np.random.default_rng(5).uniform(0.1, 1.0, len(boxes))
    modes, densities = climb(boxes, weights)
    for mode, density in zip(modes, densities, strict=True):
        offsets = (boxes - mode) / (0.6 * mode[[2, 3, 2, 3]])
        kernel = weights * np.exp(-0.5 * (offsets**2).sum(axis=1))
        step = (kernel @ boxes / kernel.sum() - mode) / mode[[2, 3, 2, 3]]
        assert np.linalg.norm(step) < 2 * peaks.TOLERANCE
        assert density == pytest.approx(kernel.sum(), rel=0.03)


def test_spread_starts_reach_the_weak_person_beside_the_strong_one() -> None:
    boxes = boxes_around(CENTRES[:2], [300, 100])
    weights = np.repeat([1.0, 0.01], [300, 100])
    spread = peaks.heaviest_samples(boxes, weights, 20, spread=True)
    heaviest = peaks.heaviest_samples(boxes, weights, 20, spread=False)
    assert (spread >= 300).any()
    assert (heaviest < 300).all()
    assert len(heaviest) == 20


def test_an_empty_sample_has_no_modes() -> None:
    nothing = np.zeros((0, 4))
    assert len(peaks.heaviest_samples(nothing, np.zeros(0), 20, spread=True)) == 0
    for starts in (nothing, CENTRES):
        modes, densities = peaks.modes(
            nothing, np.zeros(0), starts, bandwidth=0.5, merge_distance=1.0
        )
        assert modes.shape == (0, 4)
        assert densities.shape == (0,)


def test_samples_without_weight_have_no_modes() -> None:
    boxes = boxes_around(CENTRES, [10, 10, 10])
    assert len(peaks.heaviest_samples(boxes, np.zeros(30), 20, spread=False)) == 0
    modes, _ = peaks.modes(boxes, np.zeros(30), CENTRES, bandwidth=0.5, merge_distance=1.0)
    assert len(modes) == 0
