"""A place that contradicts the estimate: the result is within the accuracy of the place."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from tracker.corrections.inflation import inflation
from tracker.corrections.kinds import make
from tracker.corrections.outcomes import outcomes
from tracker.smoothing.place_constraints import PlaceMeasurements

SIGMAS = st.floats(0.01, 2.0)
WAYS = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


@st.composite
def covariances(draw: st.DrawFn) -> np.ndarray:
    """Of any shape: known to a millimetre one way, to metres another."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    spreads = 10.0 ** rng.uniform(-3.0, 1.0, 3)
    return np.asarray((turned * spreads**2) @ turned.T)


@given(WAYS, covariances(), SIGMAS)
def test_what_is_left_of_the_way_to_a_place_is_its_accuracy_at_most(
    way: np.ndarray, rest: np.ndarray, sigma: float
) -> None:
    widened = inflation(way, rest, sigma)
    total = rest + widened + sigma**2 * np.eye(3)
    plain = way @ np.linalg.solve(rest + sigma**2 * np.eye(3), way)
    assert_allclose(way @ np.linalg.solve(total, way), min(plain, 1.0), rtol=1e-5, atol=1e-12)
    left = sigma**2 * np.linalg.solve(total, way)
    assert np.linalg.norm(left) <= sigma * (1.0 + 1e-6)
    if plain <= 1.0:
        assert not widened.any(), "what does not contradict the place is as sure as it was"


@given(WAYS, covariances(), st.floats(0.02, 1.0))
def test_what_all_else_says_is_found_again_from_everything(
    way: np.ndarray, rest: np.ndarray, sigma: float
) -> None:
    """Kalman's update by the place and the same taken back: the obeyed row is the update by the
    widened rest."""
    place, noise = np.array([1.0, -2.0, 0.9]), sigma**2 * np.eye(3)
    mean = place - way
    gain = rest @ np.linalg.inv(rest + noise)
    states, spreads = (mean + gain @ way)[None], (gain @ noise)[None]
    said = [make(kind="here", places=[[0, *place.tolist()]], accuracy=sigma)]
    stated = PlaceMeasurements.of(np.zeros(1, dtype=np.int64), said).inflate(states, spreads)
    widened = inflation(way, rest, sigma)
    assert_allclose(stated.noises[0], noise + widened, atol=1e-3 * np.trace(noise + widened))


def test_a_track_that_does_not_pass_a_place_does_not_meet_it() -> None:
    frames, ids = np.array([4, 5, 6]), np.array([7, 7, 7])
    positions = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.2, 0.0, 1.0]])
    for accuracy, met in ((0.01, False), (0.09, False), (0.1, True), (0.5, True)):
        said = make(kind="here", places=[[5, 0.1, 0.28, 1.0]], accuracy=accuracy)
        (found,) = outcomes(frames, ids, positions, (said,), leeway=3)
        assert (found.met, found.tracks) == (met, (7,))
        assert ("0.28 m" in found.why and f"{accuracy:g} m" in found.why) is not met
