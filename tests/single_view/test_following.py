"""Colours of objects, and mean shift over the moving pixels against a plain reference."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tests.single_view.pieces import COLOURS, draw, person
from tracker.single_view.association_matrix.track_transfer import (
    coefficients,
    follow,
    object_histograms,
)

RED, BLUE = 1, 2


def one_colour(colour: int) -> ndarray:
    return np.eye(COLOURS)[colour]


def test_histograms_are_of_the_objects_own_pixels() -> None:
    seen, bins = draw([(10, 10, 4, 10, RED), (14, 10, 12, 10, BLUE), (50, 10, 5, 5, RED)])
    histograms = object_histograms(bins, seen.owners, seen.size, COLOURS)
    np.testing.assert_allclose(histograms[0, [RED, BLUE]], [0.25, 0.75])
    np.testing.assert_allclose(histograms[1], one_colour(RED))
    assert object_histograms(bins, np.full_like(seen.owners, -1), 0, COLOURS).shape == (0, COLOURS)


@given(st.integers(0, 300))
def test_coefficients_are_1_for_equal_and_0_for_disjoint_colours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    histograms = rng.dirichlet(np.ones(COLOURS), 3)
    table = coefficients(histograms, histograms)
    np.testing.assert_allclose(np.diag(table), 1.0)
    np.testing.assert_allclose(table, table.T)
    assert np.all((table >= 0.0) & (table <= 1.0 + 1e-12))
    assert coefficients(one_colour(RED)[None], one_colour(BLUE)[None])[0, 0] == 0.0


def test_each_of_two_in_one_object_is_found_by_his_colours() -> None:
    seen, bins = draw([person(60, RED, width=12), person(70, BLUE, width=12)])
    assert seen.size == 1
    moving = seen.owners == 0
    red = follow(bins, moving, np.array([68.0, 34.5, 6.0, 15.0]), one_colour(RED))
    blue = follow(bins, moving, np.array([72.0, 34.5, 6.0, 15.0]), one_colour(BLUE))
    assert red == pytest.approx([64.5, 34.5], abs=0.6)
    assert blue == pytest.approx([75.5, 34.5], abs=0.6)


def test_what_does_not_move_does_not_count() -> None:
    seen, bins = draw([person(60, RED, width=12)])
    bins[:] = RED  # the wall is red as well
    found = follow(bins, seen.owners == 0, np.array([62.0, 34.5, 6.0, 15.0]), one_colour(RED))
    assert found == pytest.approx([65.5, 34.5], abs=0.6)


@pytest.mark.parametrize("box", [[150.0, 10.0, 5.0, 5.0], [-40.0, -40.0, 5.0, 5.0]])
def test_who_is_not_there_stays_where_he_was(box: list[float]) -> None:
    seen, bins = draw([person(60, RED)])
    found = follow(bins, seen.owners == 0, np.array(box), one_colour(RED))
    np.testing.assert_array_equal(found, box[:2])
    elsewhere = np.array([64.5, 34.5, 5.0, 15.0])
    other = follow(bins, seen.owners == 0, elsewhere, one_colour(BLUE))
    np.testing.assert_array_equal(other, elsewhere[:2])


def test_a_box_of_a_pixel_does_no_harm() -> None:
    seen, bins = draw([person(60, RED)])
    found = follow(bins, seen.owners == 0, np.array([60.0, 30.0, 0.0, 0.0]), one_colour(RED))
    assert np.isfinite(found).all()


def shifted_in_numpy(bins: ndarray, moving: ndarray, box: ndarray, histogram: ndarray) -> ndarray:
    """The mean shift as its equations say."""
    y, x = np.mgrid[: bins.shape[0], : bins.shape[1]]
    centre = box[:2].copy()
    for _ in range(20):
        radius = ((x - centre[0]) / box[2]) ** 2 + ((y - centre[1]) / box[3]) ** 2
        inside = moving & (radius < 1.0)
        if not inside.any():
            break
        here = np.bincount(bins[inside], 1.0 - radius[inside], minlength=len(histogram))
        weights = np.sqrt(histogram[bins[inside]] / (here / here.sum())[bins[inside]])
        if not weights.sum() > 0.0:
            break
        after = np.array([np.average(x[inside], weights=weights),
                          np.average(y[inside], weights=weights)])  # fmt: skip
        shift, centre = np.hypot(*(after - centre)), after
        if shift < 0.1:
            break
    return centre


@given(st.integers(0, 400))
def test_the_mean_shift_agrees_with_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, COLOURS, (30, 40)).astype(np.uint16)
    moving = rng.random((30, 40)) < 0.6
    box = np.concatenate([rng.uniform(0, 30, 2), rng.uniform(2, 12, 2)])
    histogram = rng.dirichlet(np.full(COLOURS, 0.3))
    np.testing.assert_allclose(
        follow(bins, moving, box, histogram),
        shifted_in_numpy(bins, moving, box, histogram),
        atol=1e-6,
    )
