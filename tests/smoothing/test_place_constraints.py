"""Place constraints on rows of paths: their information, their enforcement, the way there and
back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.smoothing.test_boundaries import standing
from tracker.corrections.kinds import make
from tracker.smoothing.place_constraints import ASIDE, PlaceMeasurements

SPREAD = np.diag([0.01, 0.02, 0.03, 0.1, 0.1, 0.1])


def stated(x: float, sigma: float = 0.1, row: int = 0) -> PlaceMeasurements:
    """Somebody is said to be at (x, 0)."""
    one = make(kind="here", places=[[row, x, 0.0, 0.85]], accuracy=sigma)
    return PlaceMeasurements.of(np.array([row]), [one])


def test_a_place_adds_its_precision_to_its_row_alone() -> None:
    matrices, vectors = np.tile(np.eye(3), (3, 1, 1)), np.arange(9.0).reshape(3, 3)
    more, told = stated(2.0, 0.5, row=1).information(matrices, vectors)
    assert_allclose(more[1], 5.0 * np.eye(3))
    assert_allclose(told[1], vectors[1] + np.array([8.0, 0.0, 3.4]))
    for row in (0, 2):
        assert_array_equal(more[row], matrices[row])
        assert_array_equal(told[row], vectors[row])
    assert_array_equal(matrices[1], np.eye(3), "the boxes' own information stays")


def with_place(place: PlaceMeasurements, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The state at the origin, of covariance ``rest``, with a place as it is inflated."""
    mean, origin = np.zeros(6), np.array([0.0, 0.0, 0.85, 0.0, 0.0, 0.0])
    gain = rest[:, :3] @ np.linalg.inv(rest[:3, :3] + place.noises[0])
    mean = origin + gain @ (place.points[0] - origin[:3])
    return mean[None], (rest - gain @ rest[:3])[None]


@pytest.mark.parametrize(("x", "against"), [(0.14, False), (0.15, True), (2.0, True)])
def test_what_all_else_contradicts_is_obeyed_to_within_its_sigma(x: float, against: bool) -> None:
    """Along x all else is known to 0.1 m and the place to 0.1 m: one sigma is √0.02 m."""
    plain = stated(x)
    inflated = plain.inflate(*with_place(plain, SPREAD))
    assert inflated.contradicted is against
    assert not plain.contradicted
    states, spread = with_place(inflated, SPREAD)
    found, after, covariances = inflated.enforce(states, spread)
    if not against:
        assert_array_equal(after, states)
        assert_array_equal(covariances, spread)
        assert not found.asides.any()
        return
    # all else widened along the way until it is one standard deviation off
    square = x**2 / (0.01 + 0.01)
    wide = 0.01 + (1.0 - 1.0 / square) * x**2
    gain = wide / (wide + 0.01)
    assert after[0, :3] == pytest.approx([gain * x, 0.0, 0.85], abs=1e-6)
    assert abs(after[0, 0] - x) <= 0.1
    assert covariances[0, 0, 0] == pytest.approx(gain * 0.01, rel=1e-4)
    assert_allclose(covariances[0, :3, :3], covariances[0, :3, :3].T)
    assert_allclose(found.asides[0], after[0, :3] - states[0, :3])
    assert_array_equal(after[0, 3:], states[0, 3:])


def test_who_is_somewhere_else_leaves_the_way_and_finds_back_as_fast_as_one_walks() -> None:
    """Two metres aside at step 6 of 0.4 s, 0.6 m each: the three steps before and after are led
    there by 1.4, 0.8 and 0.2 m, as far as the path goes, and no other path is."""
    paths = standing((1, 0, 7, 0.0), (2, 0, 3, 5.0))
    one = stated(2.0, row=6)
    aside = np.array([[0.0, 2.0, 0.0]])
    led = PlaceMeasurements(one.rows, one.points, one.sigmas, one.noises, aside).lead(paths, 0.4)
    assert ASIDE == 1.5
    expected = np.zeros(12)
    expected[[3, 4, 5, 7]] = 0.2, 0.8, 1.4, 1.4
    assert_allclose(led.states[:, 1], expected, atol=1e-12)
    assert_array_equal(led.states[:, 0], paths.states[:, 0])
    assert_allclose(led.covariances[:, 1, 1] - paths.covariances[:, 1, 1], expected**2, atol=1e-12)


def test_the_way_to_a_place_ends_at_the_next_one() -> None:
    paths = standing((1, 0, 7, 0.0))
    said = [make(kind="here", places=[[row, 0.0, 0.0, 0.85]]) for row in (1, 3, 5)]
    every = PlaceMeasurements.of(np.array([1, 3, 5]), said)
    asides = np.array([[0.0, 0.7, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    led = PlaceMeasurements(every.rows, every.points, every.sigmas, every.noises, asides).lead(
        paths, 0.4
    )
    assert_allclose(led.states[:, 1], [0.1, 0, 0.1, 0, 1.4, 0, 1.4, 0.8], atol=1e-12)
    # six steps of a third of the way: at exactly nothing left it ends
    third = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.6, 0.0]])
    led = PlaceMeasurements(every.rows, every.points, every.sigmas, every.noises, third).lead(
        paths, 0.4
    )
    assert not led.states[:, 1].any()
