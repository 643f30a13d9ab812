"""Rendered clips: what is said to be true is what the pictures show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.papers.clips.clip import Actor, Clip, constant_size, plane_camera, through, wall, write
from tracker.sequences.pictures.frames import FrameReader

STEPS, SIZE = 12, (96, 72)
RED, BLUE = ((20.0, 20.0, 220.0),), ((220.0, 40.0, 20.0),)


def actor(name: str, path: ndarray, colours: tuple = RED, **more: object) -> Actor:
    return Actor(name, path, constant_size(STEPS, 8.0, 12.0), colours, **more)  # type: ignore[arg-type]


def clip(*actors: Actor, **more: object) -> Clip:
    grey = np.full((SIZE[1], SIZE[0], 3), 128.0)
    return Clip("test", grey, actors, np.ones(STEPS), **more)  # type: ignore[arg-type]


def straight(y: float = 36.0) -> ndarray:
    return through(STEPS, [(0, 20.3, y), (STEPS - 1, 70.8, y)])


def test_the_box_is_where_the_pixels_are() -> None:
    moving = clip(actor("a", straight()), noise=0.0)
    for step in range(STEPS):
        changed = np.abs(moving.picture(step).astype(float) - 128.0).max(axis=2)
        weights = np.clip(changed / 92.0, 0.0, 1.0)
        y, x = np.mgrid[: SIZE[1], : SIZE[0]]
        centre = [(weights * x).sum() / weights.sum(), (weights * y).sum() / weights.sum()]
        assert_allclose(centre, moving.boxes(step)[0, :2], atol=0.2)
        assert np.ptp(x[changed > 40]) == pytest.approx(15.5, abs=1.0)
        assert np.ptp(y[changed > 40]) == pytest.approx(23.5, abs=1.0)
        assert moving.visible(step)[0] == pytest.approx(1.0, abs=0.02)


def test_the_nearer_hides_the_farther_in_picture_and_truth() -> None:
    here = through(STEPS, [(0, 48.0, 36.0), (STEPS - 1, 48.0, 36.0)])
    first, second = actor("first", here), actor("second", here, BLUE)
    # of who is hidden wholly, the border's pixels still shine through a little
    assert_allclose(clip(first, second).visible(3), [0.0, 1.0], atol=0.05)
    order = np.linspace(1.0, -1.0, STEPS)  # the first is behind, then in front
    turning = clip(replace(first, depth=order), replace(second, depth=-order), noise=0.0)
    assert turning.visible(1).argmax() == 1
    assert turning.visible(STEPS - 2).argmax() == 0
    assert turning.picture(1)[36, 48].argmax() == 0
    assert turning.picture(STEPS - 2)[36, 48].argmax() == 2


def test_who_is_away_is_not_drawn() -> None:
    gone = straight()
    gone[4:] = np.nan
    shown = clip(actor("a", gone), noise=0.0)
    assert np.isnan(shown.boxes(4)).all()
    assert shown.visible(4)[0] == 0.0
    assert (shown.picture(4) == 128).all()
    half_out = through(STEPS, [(0, -0.5, 36.0), (STEPS - 1, -0.5, 36.0)])
    assert clip(actor("a", half_out)).visible(0)[0] == pytest.approx(0.5, abs=0.03)


def test_light_and_noise_are_what_they_are_said_to_be() -> None:
    lit = replace(clip(noise=3.0), light=np.linspace(1.0, 0.5, STEPS))
    for step in (0, STEPS - 1):
        picture = lit.picture(step).astype(float)
        assert picture.mean() == pytest.approx(128.0 * lit.light[step], abs=0.3)
        assert picture.std() == pytest.approx(3.0, abs=0.2)
    assert_array_equal(lit.picture(5), lit.picture(5))
    assert (lit.picture(5) != lit.picture(6)).any()


def test_a_path_goes_through_its_points_and_strays_as_far_as_it_may() -> None:
    points = [(2, 10.0, 20.0), (5, 40.0, 25.0), (9, 12.0, 60.0)]
    plain = through(STEPS, points)
    for step, x, y in points:
        assert_allclose(plain[step], [x, y])
    assert np.isnan(plain[[0, 1, 10, 11]]).all()
    strayed = through(STEPS, points, sway=4.0, seed=3)
    distance = np.abs(strayed - plain)[2:10]
    assert 0.1 < distance.max() <= 4.0


def test_a_wall_is_lit_and_textured_and_the_same_every_time() -> None:
    scene = wall(SIZE, seed=4)
    assert scene.shape == (72, 96, 3)
    assert 5.0 < scene.std() < 60.0
    assert scene.min() >= 0.0
    assert scene.max() <= 255.0
    assert_array_equal(scene, wall(SIZE, seed=4))
    assert (scene != wall(SIZE, seed=5)).any()


def test_a_written_clip_is_a_sequence_with_its_truth(tmp_path: Path) -> None:
    gone = straight(50.0)
    gone[8:] = np.nan
    whole = clip(actor("red", straight(24.0)), actor("blue", gone, BLUE))
    sequence = write(whole, tmp_path / "clip")
    assert sequence.frames == STEPS
    assert [t.name for t in sequence.templates] == ["red", "blue"]
    with FrameReader(sequence) as reader:
        for step in range(STEPS):
            assert_array_equal(reader.picture(0, step), whole.picture(step))
    truth = sequence.ground_truth
    assert truth is not None
    for step in range(STEPS):
        rows = truth.at(step)
        boxes, seen = sequence.cameras[0].project_boxes(
            truth.positions[rows], sequence.target_half_extents
        )
        assert seen.all()
        expected = whole.boxes(step)[truth.ids[rows] - 1]
        assert_allclose(boxes[:, :2] + boxes[:, 2:] / 2.0, expected[:, :2], atol=0.05)
        assert_allclose(boxes[:, 2:] / 2.0, expected[:, 2:], rtol=0.01)
    assert (truth.frames < 8).sum() == 16


def test_the_camera_draws_metres_as_centimetres_a_pixel() -> None:
    pixels, valid = plane_camera(SIZE).project(np.array([[0.30, 0.0, 0.12], [0.0, 0.0, 0.0]]))
    assert valid.all()
    assert_allclose(pixels, [[30.0, 60.0], [0.0, 72.0]], atol=1e-9)


def test_an_actor_of_other_length_is_told() -> None:
    with pytest.raises(ValueError, match=r'actor "a" of test: expected path .* of 12 steps'):
        clip(Actor("a", straight()[:5], constant_size(STEPS, 8.0, 12.0), RED))
