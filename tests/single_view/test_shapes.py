"""Windows where people can be, the best of those that overlap, channels, and what colours add."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels.pictures.channels import ORIENTATIONS, gradients
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.colour.peaks import PeakFinder, _discount, colour_ratios
from tracker.single_view.colour.trust import templates_suffice
from tracker.single_view.pictures.background import (
    BackgroundModel,
    square_roots,
    tone_curve,
)
from tracker.single_view.protocol import GATES
from tracker.single_view.shape.channels import Channels
from tracker.single_view.shape.finder import (
    ABOVE,
    BELOW,
    CROWNS,
    WIDTH,
    ShapeFinder,
    Shapes,
    Windows,
    strongest,
)

CAMERA = world.look_at("cam", (0.4, -3.4, 2.2), (0.0, 0.0, 1.0), image_size=(640, 400), focal=320.0)
ROOM = world.volume(1.6, 2.2)
HALF = np.array([0.28, 0.28, 0.86])


def test_a_window_hangs_from_the_crown_and_the_targets_box_reaches_the_floor() -> None:
    crowns = np.array([[0.3, 0.2, 1.2], [-0.4, 0.6, 1.8], [0.0, -30.0, 1.7]])
    found, there = Windows.at(CAMERA, crowns, HALF, floor=0.1)
    assert there.tolist() == [True, True, False]
    # of somebody who sits the box is half as high as the crown; who stands is as tall as a target
    sits, _ = upright_boxes(CAMERA, np.array([[0.3, 0.2, 0.65]]), np.array([0.28, 0.28, 0.55]))
    stands, _ = upright_boxes(CAMERA, np.array([[-0.4, 0.6, 0.95]]), np.array([0.28, 0.28, 0.85]))
    assert_allclose(found.boxes[:2], np.concatenate([sits, stands]))
    around = np.array([WIDTH / 2.0, WIDTH / 2.0, (ABOVE + BELOW) / 2.0])
    seen, _ = upright_boxes(CAMERA, crowns[:2] - [0.0, 0.0, (BELOW - ABOVE) / 2.0], around)
    edges = np.concatenate([seen[:, :2] - seen[:, 2:], seen[:, :2] + seen[:, 2:]], axis=1)
    assert_allclose(found.edges[:2], edges)
    assert_allclose(found.sizes[:2], 2.0 * seen[:, 2:] / [WIDTH, ABOVE + BELOW])
    assert_array_equal(found.take(np.array([1])).edges, found.edges[[1]])
    # a head stays as large as it is, wherever it is
    heads, _ = Windows.at(CAMERA, crowns[:1], world.HEAD)
    expected, _ = upright_boxes(CAMERA, crowns[:1] - [0.0, 0.0, 0.12], world.HEAD)
    assert_allclose(heads.boxes, expected)


def test_whoever_reaches_behind_the_lens_has_no_window() -> None:
    """The head and chest of one who stands below a camera that looks up are before it."""
    camera = world.look_at("up", (0.0, 0.0, 1.0), (0.0, 1.0, 2.7), image_size=(640, 400), focal=120)
    crowns = np.array([[0.0, 0.8, 1.9], [0.0, 2.9, 1.9]])
    found, there = Windows.at(camera, crowns, HALF)
    middles = (found.edges[:, :2] + found.edges[:, 2:]) / 2.0
    assert camera.contains(middles).all()
    assert np.isnan(found.boxes[0]).all()
    assert there.tolist() == [False, True]


def test_windows_cover_everybody_in_the_room_and_no_two_are_alike() -> None:
    windows = Windows.of(CAMERA, ROOM, HALF)
    rng = np.random.default_rng(0)
    crowns = np.column_stack([rng.uniform(-1.5, 1.5, (200, 2)), rng.choice(CROWNS, 200)])
    people, there = Windows.at(CAMERA, crowns, HALF, floor=0.0)
    assert there.sum() > 100
    for edges in people.edges[there]:
        away = np.abs(windows.edges - edges) / np.tile(edges[2:] - edges[:2], 2)
        assert away.max(axis=1).min() < 0.2
    # those of one place and size to a grid are one
    spans = windows.edges[:, 2:] - windows.edges[:, :2]
    level = np.round(np.log(spans) / 0.16)
    middles = (windows.edges[:, :2] + windows.edges[:, 2:]) / 2.0
    cells = np.column_stack([np.round(middles / (0.1 * np.exp(0.16 * level))), level])
    assert len(np.unique(cells, axis=0)) == len(cells)
    # a floor narrower than the spacing has one row in its middle
    narrow = replace(ROOM, minimum=np.array([-0.04, 0.2, 0.0]), maximum=np.array([0.06, 0.25, 2.2]))
    few = Windows.of(CAMERA, narrow, HALF)
    expected, seen = Windows.at(
        CAMERA, np.array([[0.01, 0.225, crown] for crown in CROWNS]), HALF, floor=0.0
    )
    assert 3 < len(few.edges) <= seen.sum()
    for edges in few.edges:
        assert np.abs(expected.edges[seen] - edges).max(axis=1).min() < 1e-9


def test_a_finder_is_made_once_for_a_room_and_anew_where_its_walls_are_moved(
    heads: Sequence, reader: FrameReader
) -> None:
    smaller = replace(heads.room, maximum=heads.room.maximum - [0.4, 0.0, 0.0])
    first = ShapeFinder.of(heads, 0, reader)
    assert ShapeFinder.of(heads, 0, reader) is first
    assert ShapeFinder.of(replace(heads, room=smaller), 0, reader) is not first


def test_whoever_only_watches_knows_as_much_of_what_moved(
    heads: Sequence, reader: FrameReader
) -> None:
    finder = ShapeFinder.of(heads, 0, reader)
    looked, watched = finder.start(), finder.start()
    for step in range(3):
        picture = reader.picture(0, step)
        assert picture is not None
        looked, _ = finder.find(looked, picture, 0.5, 0.3)
        watched = finder.watch(watched, picture)
    assert looked is not None
    assert watched is not None
    assert_array_equal(looked.activity, watched.activity)
    for one, other in zip(looked.before, watched.before, strict=True):
        assert_array_equal(one, other)


def test_colours_are_guessed_where_somebody_is_not_taught_in_every_camera_and_twice_in_one(
    heads: Sequence,
) -> None:
    first = heads.templates[0]
    second = replace(heads.views[0], camera=replace(heads.cameras[0], name="cam2"))
    both = replace(heads, views=(heads.views[0], second))
    each = tuple(replace(first, camera=camera.name) for camera in both.cameras)
    assert templates_suffice(replace(both, templates=(*each, first)))
    assert not templates_suffice(replace(both, templates=each))
    assert not templates_suffice(replace(both, templates=each[1:] + each[1:]))
    another = replace(first, name="another")
    assert not templates_suffice(replace(both, templates=(*each, first, another)))


def test_the_best_of_windows_that_overlap_takes_the_others() -> None:
    edges = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [40, 0, 50, 10], [2, 1, 12, 11]], float)
    owners, best = strongest(edges, np.array([1.0, 3.0, 2.0, 0.5]), 0.3)
    assert best.tolist() == [1, 2]
    assert owners.tolist() == [1, 1, 2, 1]
    # what the first has taken the next does not get
    row = np.array([[0, 0, 10, 10], [4, 0, 14, 10], [8, 0, 18, 10]], float)
    owners, best = strongest(row, np.array([3.0, 1.0, 2.0]), 0.3)
    assert best.tolist() == [0, 2]
    assert owners.tolist() == [0, 0, 2]
    nobody = strongest(np.zeros((0, 4)), np.zeros(0), 0.3)
    assert [len(one) for one in nobody] == [0, 0]


def test_a_place_is_the_mean_of_the_likely_windows_of_that_person(
    heads: Sequence, reader: FrameReader, monkeypatch: pytest.MonkeyPatch
) -> None:
    finder = ShapeFinder(heads, 0, reader)
    windows = finder._windows
    one, other = 0, int(np.argmax(np.abs(windows.boxes[:, 0] - windows.boxes[0, 0])))
    scores = np.full(len(windows.boxes), -9.0)
    owners, _ = strongest(windows.edges, np.where(np.arange(len(scores)) == one, 1.0, 0.0), 0.3)
    near, far = np.flatnonzero(owners == one)[1:3]
    # the last is of the same person, and too unlikely to say where that is
    scores[[one, other, near, far]] = 3.0, 7.0, 2.0, 0.5
    monkeypatch.setattr(finder, "_trees", SimpleNamespace(scores=lambda *_: scores))
    picture = reader.picture(0, 0)
    assert picture is not None
    _, found = finder.find(finder.start(), picture, 0.5, 0.3)
    own = np.exp([0.0, -1.0]) @ windows.boxes[[one, near]] / (1.0 + np.exp(-1.0))
    assert found.log_odds.tolist() == [7.0, 3.0]
    assert_allclose(found.boxes, [windows.boxes[other], own])


def test_a_box_is_supported_by_the_best_window_at_its_place() -> None:
    boxes = np.array([[50, 60, 8, 20], [54, 60, 8, 20], [90, 60, 8, 20]], float)
    edges = np.array([[30, 30, 70, 80], [34, 30, 74, 80], [70, 30, 110, 80]], float)
    none = np.zeros((0, 4))
    odds = np.array([1.0, 3.0, -2.0])
    found = Shapes(none, np.zeros(0), none[:, :2], 0, Windows(edges, boxes), odds)
    # 40 pixels a metre: within 0.35 m are 14 pixels
    there = found.support(
        np.array([[51, 60, 9, 9], [91, 61, 9, 9], [70, 60, 9, 9], [51, 90, 9, 9]])
    )
    assert there.tolist() == [3.0, -2.0, -np.inf, -np.inf]
    assert found.support(none).shape == (0,)


def planes_of(sums: ndarray) -> ndarray:
    """Strength of edges, and what follows it, of integral images."""
    return np.diff(np.diff(sums[..., ORIENTATIONS:].astype(int), axis=0), axis=1)


def moved_in_numpy(old: ndarray, new: ndarray) -> ndarray:
    """The change beyond the median's, less twice the median of what is left."""
    shift = [int(np.median(new[::4, ::4, c].astype(int) - old[::4, ::4, c])) for c in range(3)]
    apart = np.abs(new.astype(int) - np.clip(old.astype(int) + shift, 0, 255)).max(axis=2)
    return np.maximum(apart - 2 * int(np.median(apart[::2, ::2])), 0)


def test_channels_are_edges_what_is_no_background_and_what_moved() -> None:
    rng = np.random.default_rng(1)
    empty = cv2.GaussianBlur(rng.integers(0, 256, (48, 64, 3)).astype(np.uint8), (0, 0), 2.0)
    spread = rng.integers(0, 80, (48, 64)).astype(np.uint8)
    channels = Channels(BackgroundModel(empty, spread), 1.0, 12.0, 0.06)
    assert channels.factors == (1.0, 1.0)
    state, smooth, activity = channels.initial(), [], np.zeros((48, 64))
    fading = np.exp(-0.06 / 2.0)
    for step in range(4):
        picture = np.clip(empty * (1.0 + 0.1 * step), 0, 255).astype(np.uint8)
        picture[10:40, 5 + 8 * step : 20 + 8 * step] = (30, 90, 200)
        state, sums = channels.step(state, picture)
        roots = square_roots(picture)
        smooth.append(cv2.GaussianBlur(roots, (0, 0), 1.0))
        motion = moved_in_numpy(smooth[max(0, step - 2)], smooth[-1])  # 0.12 s ago
        activity = fading * activity + (1.0 - fading) * motion
        shown = cv2.LUT(empty, square_roots(tone_curve(empty, picture)))
        difference = np.abs(roots.astype(int) - shown).max(axis=2)
        magnitudes = gradients(roots).magnitudes
        edges = 64.0 * magnitudes / (cv2.blur(magnitudes, (9, 9)) + 4.0)  # 2 · 0.35 · 12 + 1
        expected = [np.minimum(edges, 255), 4 * np.minimum(difference, 63),
                    8 * np.minimum(motion, 31), np.minimum(32.0 * activity, 255),
                    4 * np.minimum(spread.astype(int), 63)]  # fmt: skip
        found = np.moveaxis(planes_of(sums), 2, 0)
        for one, plane in zip(found, expected, strict=True):
            assert_allclose(one, np.floor(plane), atol=1.0)
            assert (one == np.floor(plane)).mean() > 0.99
    assert len(state.before) == 2


@pytest.mark.parametrize(("factor", "size"), [(0.5, (32, 24)), (0.01, (1, 1)), (0.26, (17, 12))])
def test_channels_of_a_reduced_picture_are_as_small(factor: float, size: tuple[int, int]) -> None:
    empty = np.full((48, 64, 3), 90, dtype=np.uint8)
    channels = Channels(BackgroundModel(empty, empty[..., 0]), factor, 12.0, 1.0)
    assert channels.factors == (size[0] / 64, size[1] / 48)
    state, sums = channels.step(channels.initial(), empty)
    assert sums.shape[:2] == (size[1] + 1, size[0] + 1)
    assert len(state.before) == 1


def test_colours_speak_for_a_shape_by_a_peak_and_against_it_by_its_own_box() -> None:
    supported = np.array([[True, False], [False, True], [False, False], [False, False]])
    of_peaks, of_shapes = np.array([0.3, 0.6]), np.array([0.9, 0.9, 0.3, 0.9])
    ratios = colour_ratios(supported, of_peaks, of_shapes, sigma=0.1)
    np.testing.assert_allclose(ratios, [1.5, -1.5, 0.0, -1.0])
    # a wider likelihood tells less
    np.testing.assert_allclose(
        colour_ratios(supported, of_peaks, of_shapes, 0.2)[:2], [0.75, -0.75]
    )
    assert colour_ratios(np.zeros((0, 2), bool), of_peaks, np.zeros(0), 0.1).shape == (0,)
    np.testing.assert_allclose(
        colour_ratios(np.zeros((2, 0), bool), np.zeros(0), of_shapes[2:], 0.1), [0.0, -1.0]
    )


def test_whoever_shares_a_shape_with_somebody_nearer_to_its_middle_is_behind() -> None:
    """Two peaks of one person are one; the other's peak farther from the shape's middle is not."""
    boxes = np.array([[100.0, 60.0, 8.0, 20.0], [200.0, 60.0, 8.0, 20.0]])
    none = np.zeros((0, 4))
    found = Shapes(boxes, np.zeros(2), np.array([[20.0, 40.0]] * 2), none, Windows(none, none),
                   np.zeros(0))  # fmt: skip
    # by its width the first is farther off than the second by the height
    peaks = np.array([[103.0, 60.0, 8, 20], [100.0, 65.0, 8, 20], [101.0, 66.0, 8, 20],
                      [204.0, 60.0, 8, 20]])  # fmt: skip
    supported = np.array([[True, True, True, False], [False, False, False, True]])
    person = np.array([0, 1, 1, 0])
    assert PeakFinder._behind(found, peaks, person, supported).tolist() == [True] + [False] * 3
    assert not PeakFinder._behind(found, peaks, np.zeros(4, dtype=int), supported).any()
    edges = np.array([[106.9, 60.0], [107.1, 60.0], [100.0, 79.9], [100.0, 80.1]])
    near = PeakFinder._near(found, np.column_stack([edges, np.ones((4, 2))]))
    assert near.tolist() == [[True, False, True, False], [False] * 4]


def test_doubt_is_discounted_by_the_share_that_would_not_be_seen_and_belief_is_not() -> None:
    found = _discount(np.array([-3.0, -3.0, -3.0, 2.0]), np.array([0.0, 1.0, 0.25, 0.5]))
    assert_allclose(found, [-3.0, 0.0, np.log(0.25 + 0.75 * np.exp(-3.0)), 2.0], atol=1e-12)


def test_a_candidate_falls_at_the_first_gate_that_it_does_not_pass() -> None:
    """Suggestions follow from colours, foreground and shapes, and name whom each is taken for."""
    rows = [
        # x, score, colour distance, share of foreground, person, gate
        (0.0, -1.0, 0.4, 0.9, 0, None), (5.0, -1.5, 0.4, 0.9, 1, "another at its place"),
        (11.0, -1.6, 0.4, 0.9, 0, None), (8.0, -1.7, 0.4, 0.9, 0, "another at its place"),
        (30.0, -2.0, 0.6, 0.3, 0, None), (40.0, -2.1, 0.6, 0.9, 0, "colour"),
        (50.0, -2.1, 0.5, 0.1, 0, "foreground"), (60.0, -1.0, 0.5, 0.29, 0, "foreground"),
        (70.0, -2.1, 0.5, 0.9, 0, "surroundings"), (80.0, -2.1, 0.5, 0.2, 1, "shape"),
        (90.0, -1.0, 0.6, 0.1, 0, "colour"), (105.0, -1.9, 0.4, 0.15, 1, None),
    ]  # fmt: skip
    x, best, distances, inside, person = (np.array(c) for c in list(zip(*rows, strict=True))[:5])
    scores = np.full((len(rows), 2), -9.0)
    scores[np.arange(len(rows)), person] = best
    p = SimpleNamespace(
        acceptance_distance=0.5, likelihood_sigma=0.25, acceptance_foreground=0.3,
        same_person_distance=1.0, merge_distance=0.6,
    )  # fmt: skip
    trust = np.array([1.0, 0.5])  # half of the foreground is asked of the second
    finder: Any = SimpleNamespace(
        _parameters=p, _instead=np.array([0.9, 0.6]), _trusted=lambda person: trust[person],
        _score=lambda *_: (scores, np.column_stack([distances, distances + 0.1]), inside),
    )  # fmt: skip
    candidates = np.column_stack([x, np.full(len(x), 9.0), np.full((len(x), 2), 10.0)])
    scene: Any = SimpleNamespace(mask=np.zeros((1, 1)))
    boxes, near, whose, dropped = PeakFinder._accept(finder, scene, None, candidates)
    kept = np.flatnonzero([gate is None for *_, gate in rows])
    order = kept[np.argsort(-best[kept], kind="stable")]
    assert_array_equal(boxes, candidates[order])
    assert_array_equal(near, distances[order])
    assert_array_equal(whose, person[order])
    told = [None if gate is None else GATES.index(gate) for *_, gate in rows]
    assert dropped.gates.tolist() == [gate for gate in told if gate is not None]
    assert_array_equal(dropped.boxes[:, 0], np.delete(x, kept))
    scene.mask = None  # without foreground none is asked for
    boxes, *_ = PeakFinder._accept(finder, scene, None, candidates)
    assert {60.0, 90.0} <= set(boxes[:, 0].tolist())


def test_samples_are_drawn_on_the_foreground_as_far_as_it_is_trusted() -> None:
    """A share of 0.6 of the boxes is drawn anywhere, all while nobody is expected; the rest lie at
    people."""
    drawn: dict[str, int] = {}

    def draw(where: str, count: int) -> ndarray:
        drawn[where] = count
        return np.full((count, 4), 5.0)

    finder: Any = SimpleNamespace(
        _parameters=SimpleNamespace(samples=100, foreground_samples=0.6),
        _appearance=SimpleNamespace(
            trust=np.array([1.0, 0.5]), within=lambda boxes: boxes,
            draw_on_foreground=lambda count, *_: draw("foreground", count),
            draw_anywhere=lambda count, *_: draw("anywhere", count),
        ),
    )  # fmt: skip
    scene: Any = None
    one = GaussianMixture(np.array([0.2, 0.6]), np.array([[50.0, 40.0, 4.0, 6.0], [9.0] * 4]),
                          np.tile(1e-12 * np.eye(4), (2, 1, 1)), np.array([1, 2]))  # fmt: skip
    boxes = PeakFinder._sample(finder, one, scene, np.random.default_rng(0))
    assert drawn == {"foreground": 45, "anywhere": 15}
    assert len(boxes) == 100
    near = np.abs(boxes[60:, None] - one.means).max(axis=2) < 1e-3
    assert near.any(axis=1).all()
    assert 0 < near[:, 0].sum() < near[:, 1].sum(), "by weight"
    nobody = GaussianMixture.empty(4)
    boxes = PeakFinder._sample(finder, nobody, scene, np.random.default_rng(0))
    assert drawn == {"foreground": 75, "anywhere": 25}
    assert len(boxes) == 100
