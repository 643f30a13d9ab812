"""Channels of a picture, their sums over cells, and trees that ask for them, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.kernels.pictures import channels as kernels
from tracker.kernels.pictures.channels import COLUMNS, ORIENTATIONS, ROWS


def some_sums(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Integral images of random channels, and the channels."""
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, ORIENTATIONS, (40, 56)).astype(np.uint8)
    sizes = rng.integers(0, 256, (40, 56)).astype(np.uint8)
    planes = rng.integers(0, 256, (40, 56, 2)).astype(np.uint8)
    by_direction = np.where(bins[..., None] == np.arange(ORIENTATIONS), sizes[..., None], 0)
    whole = np.concatenate([by_direction, sizes[..., None], planes], axis=2)
    return kernels.channel_sums(bins, sizes, planes), whole


@pytest.mark.parametrize("turn", range(ORIENTATIONS))
def test_an_edge_has_the_bin_of_its_direction_and_none_of_its_sign(turn: int) -> None:
    angle = np.pi * turn / ORIENTATIONS
    y, x = np.indices((30, 30))
    ramp = 3.0 * (np.cos(angle) * (x - 15.0) + np.sin(angle) * (y - 15.0))
    for sign in (1.0, -1.0):
        picture = np.repeat((128.0 + sign * ramp).round().astype(np.uint8)[..., None], 3, axis=2)
        found = kernels.gradients(picture)
        inner = found.bins[5:-5, 5:-5]
        assert (inner == turn).mean() > 0.9
        np.testing.assert_allclose(found.magnitudes[5:-5, 5:-5], 3.0, atol=0.75)


def test_the_channel_that_changes_most_counts_and_a_plain_picture_has_no_edge() -> None:
    picture = np.full((9, 9, 3), 100, dtype=np.uint8)
    assert not kernels.gradients(picture).magnitudes.any()
    picture[:, 5:, 1] += 10
    picture[5:, :, 2] += 60
    found = kernels.gradients(picture)
    assert found.magnitudes[4, 2] == 30.0
    assert found.bins[4, 2] == ORIENTATIONS // 2
    assert found.magnitudes[2, 4] == 5.0
    assert found.bins[2, 4] == 0


def test_sums_are_those_of_the_channels() -> None:
    sums, whole = some_sums()
    np.testing.assert_array_equal(sums[1:, 1:], whole.cumsum(axis=0).cumsum(axis=1))
    assert not sums[0].any()
    assert not sums[:, 0].any()


def test_cells_have_the_rounded_means_of_what_is_in_the_picture() -> None:
    sums, whole = some_sums()
    inside = [3.5, 2.5, 3.5 + 2.0 * COLUMNS, 2.5 + 3.0 * ROWS]
    beyond = [-8.5, -0.5, -0.5, 2.0 * ROWS - 0.5]
    found = kernels.cell_means(sums, np.array([inside, beyond]))
    cells = found.reshape(2, ROWS, COLUMNS, whole.shape[2])
    for row, column in ((0, 0), (4, 7), (9, 3)):
        part = whole[3 + 3 * row : 6 + 3 * row, 4 + 2 * column : 6 + 2 * column]
        np.testing.assert_array_equal(
            cells[0, row, column], np.floor(part.mean(axis=(0, 1)) + 0.5).astype(np.uint8)
        )
    assert not cells[1].any()


def test_trees_add_up_their_leaves_and_give_up_what_falls_too_low() -> None:
    sums, _ = some_sums(1)
    rng = np.random.default_rng(2)
    windows = np.array([[2.5, 1.5, 26.5, 31.5], [20.5, 5.5, 44.5, 35.5], [9.5, 3.5, 33.5, 33.5]])
    means = kernels.cell_means(sums, windows)
    features = rng.integers(0, means.shape[1], (5, 7)).astype(np.int32)
    thresholds = rng.integers(60, 200, (5, 7)).astype(np.int32)
    leaves = rng.normal(size=(5, 8)).astype(np.float32)
    never = np.full(5, -np.inf, dtype=np.float32)
    expected = np.zeros((3, 5))
    for n, mean in enumerate(means):
        for t in range(5):
            node = 0
            while node < 7:
                left = mean[features[t, node]] <= thresholds[t, node]
                node = 2 * node + (1 if left else 2)
            expected[n, t] = leaves[t, node - 7]
    running = expected.cumsum(axis=1)
    scores = kernels.tree_scores(sums, windows, features, thresholds, leaves, never)
    np.testing.assert_allclose(scores, running[:, -1], rtol=1e-5)
    least = never.copy()
    least[2] = running[:, 2].min() + 1e-3  # after the third tree the lowest end
    given_up = kernels.tree_scores(sums, windows, features, thresholds, leaves, least)
    lost = running[:, 2] < least[2]
    assert 0 < lost.sum() < 3
    assert (given_up[lost] == -np.inf).all()
    np.testing.assert_allclose(given_up[~lost], running[~lost, -1], rtol=1e-5)
