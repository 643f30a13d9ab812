"""The height of people, by the upper edges of boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.random_rooms import random_room
from tests.smoothing.known import given, known
from tracker.runs.pipeline import compute, default_parameters
from tracker.smoothing.bodies import BoxTops, standing_heights
from tracker.smoothing.noise import NoiseModel
from tracker.smoothing.paths import Paths

STEP = 0.1
HALF_HEIGHT, FLOOR = 0.9, 0.3
EACH = 0.04
"""Standard deviation of the top of one box, metres."""


def noise(white: float, persistent: float, time: float = 1.0) -> NoiseModel:
    each = np.array([0.0, white, 0.0])
    lasting = np.array([0.0, persistent, 0.0])
    return NoiseModel(each, 0.0, lasting, time, 1.0)


def estimate(
    tops: list[np.ndarray], model: NoiseModel, offsets: tuple[float, ...] = (0.0,)
) -> tuple[np.ndarray, np.ndarray]:
    """Heights of people whose tops are given row by row, NaN where there is no box."""
    lengths = [len(one) for one in tops]
    rows, every = sum(lengths), np.concatenate(tops)
    paths = Paths.of(
        list(range(len(tops))), [0] * len(tops), [np.zeros((k, 3)) for k in lengths],
        [np.tile(np.eye(3), (k, 1, 1)) for k in lengths], 3,
    )  # fmt: skip
    shown = np.flatnonzero(np.isfinite(every))
    assert rows == len(every)
    seen = BoxTops(shown, every[shown], np.full(len(shown), EACH**2))
    return standing_heights(
        paths, seen, model, np.array(offsets),
        half_height=HALF_HEIGHT, floor=FLOOR, step_time=STEP,
    )  # fmt: skip


@pytest.mark.parametrize("standing", [1.0, 0.15])
def test_who_sits_for_most_of_the_time_has_the_height_of_standing(standing: float) -> None:
    rng = np.random.default_rng(3)
    tops = FLOOR + np.where(np.arange(2000) < standing * 2000, 1.75, 1.25)
    heights, sigmas = estimate([tops + rng.normal(0.0, EACH, 2000)], noise(0.04, 0.001))
    assert heights[0] == pytest.approx(1.75, abs=0.012)
    assert 0.0 < sigmas[0] < 0.01


def test_people_are_apart_and_one_without_boxes_has_none() -> None:
    one, other = np.full(50, FLOOR + 1.6), np.full(70, FLOOR + 1.9)
    one[::3] = np.nan
    heights, sigmas = estimate([one, np.full(20, np.nan), other], noise(0.04, 0.001))
    assert heights == pytest.approx([1.6, np.nan, 1.9], nan_ok=True)
    assert np.isnan(sigmas).tolist() == [False, True, False]


def test_errors_that_persist_do_not_average() -> None:
    """Of K rows σ is as of K independent errors, or as of one in twice the time they persist."""
    tops = [np.full(400, FLOOR + 1.7)]
    white = estimate(tops, noise(0.05, 1e-9))[1][0]
    assert white == pytest.approx(EACH / np.sqrt(400.0), rel=1e-3)
    brief = estimate(tops, noise(1e-9, 1e-6, time=2.0))[1][0]
    assert brief == pytest.approx(EACH * np.sqrt(2.0 * 2.0 / 40.0), rel=1e-3)
    whole = estimate(tops, noise(1e-9, 1e-6, time=60.0))[1][0]
    assert whole == pytest.approx(EACH, rel=1e-3), "never more than that of a row"


def test_what_all_boxes_have_in_common_stays() -> None:
    """κ (q² + b²) h² with κ = 1.5, however long the track."""
    tops = [np.full(100_000, FLOOR + 1.7)]
    sigma = estimate(tops, noise(0.03, 0.04), offsets=(0.02, -0.02))[1][0]
    common = 1.5 * (0.04**2 + 0.02**2) * HALF_HEIGHT**2
    assert sigma == pytest.approx(np.sqrt(common), rel=0.01)


def test_heights_are_those_of_the_people_in_the_room() -> None:
    """Of people between 1.56 and 1.84 m, of whom the target's size says 1.7."""
    room = random_room(3, cameras=3, people=3, steps=120)
    tracks = compute(room, default_parameters(room)).tracks
    truth = room.ground_truth
    assert truth is not None
    heights = {}
    for track in np.unique(tracks.ids):
        rows = np.flatnonzero(tracks.ids == track)
        assert len(np.unique(tracks.heights[rows])) == 1, "one of a track"
        at = truth.at(int(tracks.frames[rows[0]]))
        apart = np.linalg.norm(truth.positions[at] - tracks.positions[rows[0]], axis=1)
        person = at.start + int(apart.argmin())
        heights[int(truth.ids[person])] = (
            tracks.heights[rows[0]], tracks.sigma_heights[rows[0]], 2.0 * truth.positions[person, 2]
        )  # fmt: skip
    assert len(heights) == 3
    assert np.ptp([true for *_, true in heights.values()]) > 0.05
    for height, sigma, true in heights.values():
        assert height == pytest.approx(true, abs=0.02)
        assert abs(height - true) < 4.0 * sigma
        assert sigma < 0.02


def test_a_height_is_where_the_tops_of_boxes_are_but_for_what_cameras_and_marks_explain() -> None:
    """Boxes as they are expected, their tops moved by what is known of each camera and person, and
    by the persons' own heights."""
    places = np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (12, 1, 1))
    scene = known(places, sigma=1.0)
    smoother, (paths, links) = scene.smoother(), scene.paths(sigma=0.01)
    offsets, marks, taller = np.array([0.03, -0.01, 0.05]), [0.02, -0.04], [0.08, -0.1]
    for c, camera in enumerate(smoother.cameras):
        own = links.take(links.cameras == c)
        seen = smoother.model.target.expected(
            smoother.model.cameras[c], paths.states[own.rows], paths.covariances[own.rows]
        )
        half = (seen.boxes[:, 3] - seen.boxes[:, 1]) / 2.0
        values, who = seen.values.copy(), paths.owners[own.rows]
        values[:, 1] += half * (offsets[c] - offsets.mean() + np.array(marks)[who])
        values[:, 1] += seen.jacobians[:, 1, 2] * np.array(taller)[who]
        smoother.cameras[c] = given(camera, own.boxes, values)
    learnt = replace(smoother.uncalibrated(paths), shifts=np.array(marks))
    learnt.offsets[:, 1] = offsets
    model = NoiseModel(np.full(3, 0.02), 1.0, np.full(3, 0.01), 1.0, 1.0)
    heights, sigmas = smoother.heights(paths, links, learnt, model)
    assert_allclose(heights, 1.7 + np.array(taller), atol=1e-6)
    # of rows that agree: white and lasting errors of a box, and of where the person stands
    low = np.linalg.norm(sigmas)
    loose = paths.with_states(paths.states, 100.0 * paths.covariances)
    assert np.linalg.norm(smoother.heights(loose, links, learnt, model)[1]) > low
    none = replace(links, shares=np.full(len(links.shares), 0.5))
    assert np.isnan(smoother.heights(paths, none, learnt, model)[0]).all()
