"""Shapes, pictures and colours of the 3D view: pure functions, without a server."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import viser.transforms as tf
from hypothesis import given
from hypothesis import strategies as st

from app import colours
from app.scene import geometry
from app.scene.geometry import dashes, ellipsoids, mass_radius
from app.scene.nodes import linear
from app.scene.standing import StraightView, pose_through
from app.scene.views import between, overview
from tests.app.scene import scene_case

TOKENS = Path(__file__).resolve().parents[3] / "static" / "css" / "tokens.css"

# shapes


@pytest.mark.parametrize("mass", [0.5, 0.9, 0.99])
def test_an_ellipsoid_holds_the_stated_share_of_its_gaussian(mass: float) -> None:
    rng = np.random.default_rng(3)
    factors = rng.normal(size=(6, 3, 3))
    covariances = factors @ factors.transpose(0, 2, 1)
    wxyzs, axes = ellipsoids(covariances, mass)
    count = 20_000
    for covariance, wxyz, half in zip(covariances, wxyzs, axes, strict=True):
        samples = rng.multivariate_normal(np.zeros(3), covariance, count)
        inside = np.linalg.norm(samples @ tf.SO3(wxyz).as_matrix() / half, axis=1) < 1.0
        assert abs(inside.mean() - mass) < 4.0 * np.sqrt(mass * (1.0 - mass) / count)


@pytest.mark.parametrize("mass", [0.0, 1.0, -1.0])
def test_a_mass_must_be_a_probability(mass: float) -> None:
    with pytest.raises(ValueError, match=r"above 0 and below 1"):
        mass_radius(mass)
    wxyzs, axes = ellipsoids(np.zeros((0, 3, 3)))  # and none of no component
    assert (wxyzs.shape, axes.shape) == ((0, 4), (0, 3))


def test_box_edges_have_the_lengths_of_the_box() -> None:
    edges = geometry.box_edges(np.array([[1.0, 2.0, 3.0]]), np.array([0.3, 0.4, 0.8]))
    lengths = np.linalg.norm(edges[0, :, 1] - edges[0, :, 0], axis=1)
    np.testing.assert_allclose(np.sort(lengths), np.repeat([0.6, 0.8, 1.6], 4))
    assert geometry.box_edges(np.zeros((0, 3)), np.ones(3)).shape == (0, 12, 2, 3)


@given(st.floats(0.05, 5.0), st.floats(0.02, 0.5))
def test_dashes_begin_and_end_where_the_segment_does(length: float, dash: float) -> None:
    segment = np.array([[[0.0, 0.0, 0.0], [0.0, length, 0.0]]])
    cut = dashes(segment, dash)
    np.testing.assert_allclose(cut[0, 0], segment[0, 0], atol=1e-12)
    np.testing.assert_allclose(cut[-1, 1], segment[0, 1], atol=1e-12)
    lengths = cut[:, 1, 1] - cut[:, 0, 1]
    np.testing.assert_allclose(lengths, lengths[0])
    if len(cut) > 1:
        np.testing.assert_allclose(cut[1:, 0, 1] - cut[:-1, 1, 1], lengths[0] * 2.0 / 3.0)


def test_trails_fade_end_at_the_step_and_have_a_gap_where_nobody_saw() -> None:
    tracks = scene_case.run(scene_case.sequence()).tracks
    way = geometry.trails(tracks, 30, 4.0, fps=10.0, drop=0.84)
    assert way.ages.min() == 0.0
    assert way.ages.max() <= 4.0
    np.testing.assert_allclose(way.segments[..., 2], 0.0, atol=1e-12)
    # steps 0 … 30; unseen at 20 … 25: the five segments wholly inside the gap are missing
    assert [int((way.ids == track).sum()) for track in (1, 2)] == [25, 30]
    assert len(geometry.trails(tracks, -5, 4.0, fps=10.0).ids) == 0
    past = geometry.trails(tracks, 40, 1.0, 10.0)
    both = geometry.trails(tracks, 40, 1.0, 10.0, ahead=0.5)
    assert (past.ages.min(), both.ages.min()) == (0.0, pytest.approx(-0.5))
    assert past.ages.max() == pytest.approx(1.0)
    assert len(both.segments) == len(past.segments) + 2 * 5  # two walkers


# pictures


def test_a_straight_picture_shows_a_point_where_its_pinhole_says() -> None:
    camera = scene_case.camera(0, 3)
    view = StraightView(camera, 320)
    assert view.picture(None).shape == (*view.pinhole.image_size[::-1], 3)
    points = np.array([[0.0, 0.0, 0.8], [0.6, 0.2, 1.2], [-0.5, 0.7, 0.2], [0.9, -0.8, 0.1]])
    source = np.zeros((288, 360, 3), dtype=np.uint8)
    for x, y in camera.project(points)[0]:
        source[round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3] = 255
    straight = view.picture(source)[:, :, 0]
    for x, y in view.pinhole.project(points)[0]:
        assert straight[round(y), round(x)] > 200


def test_a_straight_picture_is_as_wide_as_the_lens_sees() -> None:
    view = StraightView(scene_case.camera(0, 3), 320)
    filled = view.picture(np.full((288, 360, 3), 255, dtype=np.uint8))[:, :, 0] > 200
    assert filled.mean() > 0.98
    assert filled[filled.shape[0] // 2, 3:-3].all()
    assert filled[3:-3, filled.shape[1] // 2].all()


def test_looking_through_a_camera_fits_its_whole_picture_into_any_window() -> None:
    view = StraightView(scene_case.camera(1, 3), 320)
    for aspect in (0.5, view.aspect, 3.0):
        pose = pose_through(view, 3.0, aspect)
        assert np.tan(pose.fov / 2.0) >= np.tan(view.fov / 2.0)
        assert np.tan(pose.fov / 2.0) * aspect >= np.tan(view.fov / 2.0) * view.aspect
        np.testing.assert_allclose(pose.position, view.camera.centre)


def test_a_flight_begins_and_ends_where_it_should() -> None:
    view = StraightView(scene_case.camera(1, 3), 320)
    start = overview(np.eye(3), np.zeros((0, 3)), np.zeros(3), 1.0)
    goal = pose_through(view, 3.0, 1.0)
    first, last = between(start, goal, 0.0), between(start, goal, 1.0)
    np.testing.assert_allclose(first.position, start.position)
    np.testing.assert_allclose(first.look_at, start.look_at, atol=1e-9)
    assert last is goal


def test_drawn_boxes_leave_a_mark_in_their_colour() -> None:
    of = scene_case.sequence()
    view = StraightView(of.cameras[0], 320)
    picture = view.picture(None)
    plain = picture.copy()
    nobody = np.zeros(0, dtype=np.int64)
    view.draw_boxes(picture, np.zeros((0, 3)), scene_case.HALF, nobody, None)
    assert (picture == plain).all()
    view.draw_boxes(picture, np.array([[0.0, 0.0, 0.84]]), scene_case.HALF, np.array([3]), None)
    assert (picture == np.array(colours.track_colour(3)[::-1])).all(axis=2).sum() > 100


# colours


def test_the_colours_are_those_of_the_page() -> None:
    themes = TOKENS.read_text(encoding="utf-8").split('[data-theme="light"]')
    sets = (colours.TRACK_HEX, colours.LIGHT_HEX)
    for theme, texts, palette in zip(themes, sets, colours.PALETTES.values(), strict=True):
        assert f"--ink-1: #{bytes(palette.ink).hex()};" in theme
        tokens = dict(re.findall(r"--((?:id|on)-\d+): (#\w+);", theme))
        for index, text in enumerate(texts, 1):
            assert tokens[f"id-{index}"] == text
            if texts is colours.TRACK_HEX:  # the only set that tags in pictures have
                assert tokens[f"on-{index}"] == colours.track_ink(index)


@pytest.mark.parametrize("palette", colours.PALETTES.values(), ids=colours.PALETTES)
def test_a_colour_follows_the_id_and_fades_into_the_background(palette: colours.Palette) -> None:
    full = palette.of(np.array([1, 2]))
    np.testing.assert_array_equal(palette.of(np.array([25, 26])), full)
    assert palette.of(np.zeros(0, dtype=np.int64)).shape == (0, 3)
    np.testing.assert_array_equal(palette.fade(full, np.array([1.0, 1.0])), full)
    np.testing.assert_array_equal(palette.fade(full, 0.0), [palette.canvas] * 2)
    np.testing.assert_array_equal(
        palette.error(np.array([0.0, 1.0, 7.0])), [*palette.errors, palette.errors[1]]
    )


@pytest.mark.parametrize("palette", colours.PALETTES.values(), ids=colours.PALETTES)
def test_tracks_stand_out_from_the_background(palette: colours.Palette) -> None:
    def luminance(rgb: np.ndarray) -> np.ndarray:
        share = np.asarray(rgb) / 255.0
        light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
        return light @ [0.2126, 0.7152, 0.0722]

    ground = luminance(np.array(palette.canvas))
    for colour in [*palette.tracks, *palette.errors, palette.truth, palette.pinned]:
        pair = sorted((luminance(np.array(colour)), ground))
        assert (pair[1] + 0.05) / (pair[0] + 0.05) > 3.0


def test_linear_colours_keep_black_and_white() -> None:
    ends = np.array([[0, 0, 0], [255, 255, 255], [188, 188, 188]], dtype=np.uint8)
    np.testing.assert_array_equal(linear(ends)[:, 0], [0, 255, 128])
