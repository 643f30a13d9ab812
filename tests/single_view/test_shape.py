"""People by their shape: windows where people can be, the best of those that overlap, channels."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.special import logit

from tracker import pipeline
from tracker.boxes import Boxes
from tracker.parameters import RunParameters, with_values
from tracker.pictures.foreground import BackgroundModel
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.rendering import render_random
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.colour.evidence import colour_ratios
from tracker.single_view.colour.peaks import PeakFinder
from tracker.single_view.colour.trust import shapes_of_templates, taught_well
from tracker.single_view.protocol import ViewResult
from tracker.single_view.shape.channels import Channels
from tracker.single_view.shape.finder import ShapeFinder, Shapes, strongest
from tracker.single_view.shape.windows import ABOVE, BELOW, WIDTH, Windows

STEPS = 45


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """One person who walks, in a room that nothing was learnt from."""
    folder = tmp_path_factory.mktemp("rooms") / "39"
    render_random(39, folder, frames=STEPS)
    return read_sequence(folder)


@pytest.mark.full
def test_a_window_hangs_from_the_crown_and_has_the_targets_box_in_it(room: Sequence) -> None:
    camera, half = room.cameras[1], room.target_half_extents
    crowns = np.array([[*(room.room.minimum[:2] + room.room.maximum[:2]) / 2.0, 1.7]])
    found, there = Windows.at(camera, crowns, half)
    assert there[0]
    expected, _ = upright_boxes(camera, crowns - [0.0, 0.0, half[2]], half)
    np.testing.assert_allclose(found.boxes, expected)
    across, down = found.sizes[0]
    assert across == pytest.approx((found.edges[0, 2] - found.edges[0, 0]) / WIDTH)
    assert down == pytest.approx((found.edges[0, 3] - found.edges[0, 1]) / (ABOVE + BELOW))
    # the crown lies that far below the window's upper edge
    (pixel,), _ = camera.project(crowns)
    assert abs(found.edges[0, 1] + ABOVE * down - pixel[1]) < 0.12 * down


def test_windows_cover_everybody_in_the_room_and_no_two_are_alike(room: Sequence) -> None:
    camera = room.cameras[1]
    windows = Windows.of(camera, room.room, room.target_half_extents)
    assert 200 < len(windows.edges) < 20_000
    rng = np.random.default_rng(0)
    low = np.append(room.room.minimum[:2] + 0.3, 1.2)
    high = np.append(room.room.maximum[:2] - 0.3, 1.8)
    people, there = Windows.at(camera, rng.uniform(low, high, (200, 3)), room.target_half_extents)
    for edges in people.edges[there]:
        span = edges[2:] - edges[:2]
        away = np.abs(windows.edges - edges) / np.tile(span, 2)
        assert away.max(axis=1).min() < 0.25


def test_the_best_of_windows_that_overlap_takes_the_others() -> None:
    edges = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [40, 0, 50, 10], [2, 1, 12, 11]], float)
    owners, best = strongest(edges, np.array([1.0, 3.0, 2.0, 0.5]), 0.3)
    assert best.tolist() == [1, 2]
    assert owners.tolist() == [1, 1, 2, 1]
    nobody = strongest(np.zeros((0, 4)), np.zeros(0), 0.3)
    assert [len(one) for one in nobody] == [0, 0]


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


def test_another_exposure_neither_moves_nor_differs_and_a_person_does_both() -> None:
    rng = np.random.default_rng(1)
    empty = cv2.GaussianBlur(rng.integers(40, 160, (80, 100, 3)).astype(np.uint8), (0, 0), 3.0)
    background = BackgroundModel.learn([empty] * 3)
    assert background is not None
    channels = Channels(background, 1.0, 40.0, 0.1)
    state, _ = channels.step(channels.initial(), empty)
    brighter = cv2.convertScaleAbs(empty, alpha=1.25)
    state, sums = channels.step(state, brighter)
    difference, motion, activity, spread = (sums[-1, -1, 7:] / empty[..., 0].size).tolist()
    assert difference < 16.0
    assert motion < 16.0
    person = brighter.copy()
    person[20:60, 40:60] = 250
    _, sums = channels.step(state, person)

    def mean(plane: int) -> float:
        part = sums[55, 55] - sums[25, 55] - sums[55, 45] + sums[25, 45]
        return float(part[plane] / 300.0)

    assert mean(7) > difference + 60.0
    assert mean(8) > motion + 60.0
    assert mean(9) > activity
    assert spread == 0.0


def test_whoever_only_watches_knows_as_much_of_what_moved(room: Sequence) -> None:
    with FrameReader(room) as reader:
        finder = ShapeFinder(room, 0, reader)
        pictures = [
            picture for picture in map(partial(reader.picture, 0), range(20)) if picture is not None
        ]
    looked, watched = finder.start(), finder.start()
    for picture in pictures[:-1]:
        looked, _ = finder.find(looked, picture, 0.5, 0.3)
        watched = finder.watch(watched, picture)
    _, found = finder.find(looked, pictures[-1], 0.5, 0.3)
    _, same = finder.find(watched, pictures[-1], 0.5, 0.3)
    _, fresh = finder.find(finder.start(), pictures[-1], 0.5, 0.3)
    np.testing.assert_array_equal(found.odds, same.odds)
    assert len(found.odds) != len(fresh.odds) or np.abs(found.odds - fresh.odds).max() > 0.1


def test_a_finder_is_made_once_for_a_room_and_anew_where_its_walls_are_moved(
    room: Sequence,
) -> None:
    smaller = replace(room.room, maximum=room.room.maximum - [1.0, 0.0, 0.0])
    with FrameReader(room) as reader:
        first = ShapeFinder.of(room, 0, reader)
        assert ShapeFinder.of(room, 0, reader) is first
        assert ShapeFinder.of(room, 1, reader) is not first
        assert ShapeFinder.of(replace(room, room=smaller), 0, reader) is not first


def test_who_walks_is_found_by_shape_alone(room: Sequence) -> None:
    nobody_marked = replace(room, templates=(), digest=f"{room.digest}-unmarked")
    chosen = with_values(RunParameters(), {"single_view": "shapes"})
    run = pipeline.compute(nobody_marked, chosen)
    truth = Path(room.folder) / "ground_truth.csv"
    rows = np.genfromtxt(truth, delimiter=",", skip_header=1)
    near = 0
    for step in range(20, STEPS):
        there = run.tracks.positions[run.tracks.frames == step]
        place = rows[rows[:, 0] == step][0, 2:5]
        near += bool(len(there)) and np.linalg.norm(there - place, axis=1).min() < 0.5
    assert near > 0.8 * (STEPS - 20)


@pytest.mark.full
def test_what_is_little_in_one_camera_is_passed_on_and_weighed(room: Sequence) -> None:
    nobody_marked = replace(room, templates=(), digest=f"{room.digest}-passed")
    chosen = with_values(RunParameters(), {"single_view": "shapes"})
    views = pipeline.compute(nobody_marked, chosen, steps=25).views
    boxes = [view for step in views for view in step]
    odds = logit(np.concatenate([view.weights for view in boxes]))
    ratios = np.concatenate([view.log_ratios for view in boxes])
    p = chosen.shapes
    assert p.passed_odds <= odds.min() < p.least_odds < odds.max()
    np.testing.assert_allclose(
        ratios, np.minimum(p.odds_weight * (odds - p.even_odds), p.largest_ratio), atol=1e-6
    )
    assert ratios[odds < p.even_odds].max() < 0.0


def test_a_box_ends_at_the_floor(room: Sequence) -> None:
    camera, whole_body = room.cameras[1], np.array([0.28, 0.28, 0.86])
    middle = (room.room.minimum[:2] + room.room.maximum[:2]) / 2.0
    crowns = np.array([[*middle, 1.2], [*middle, 1.8]])
    found, _ = Windows.at(camera, crowns, whole_body, floor=0.0)
    sits, _ = upright_boxes(camera, crowns[:1] / [1.0, 1.0, 2.0], np.array([0.28, 0.28, 0.6]))
    stands, _ = upright_boxes(camera, crowns[1:] - [0.0, 0.0, 0.86], whole_body)
    np.testing.assert_allclose(found.boxes, np.concatenate([sits, stands]))


def test_shape_is_believed_of_whose_template_shows_one(room: Sequence) -> None:
    (template,) = {t.name: t for t in room.templates}.values()
    left, top, width, height = template.box
    camera = next(c for c in room.cameras if c.name == template.camera)
    # the same box where nobody is: on the other side of the picture
    across = left - 3.0 * width if left > camera.image_size[0] / 2.0 else left + 3.0 * width
    nobody = replace(template, name="wall", box=np.array([across, top, width, height]))
    unseen = replace(template, name="elsewhere", camera="none")
    taught = replace(room, templates=(template, nobody, unseen))
    with FrameReader(taught) as reader:
        found = shapes_of_templates(taught, reader)
    trust = found.trust
    assert trust[template.name] > 0.5
    assert trust["wall"] < 0.2
    assert trust["elsewhere"] == 0.0
    # of the three the one shares most of its box with the person by shape, the others nothing
    assert 0.3 / 3.0 < found.fit < 0.45


@pytest.mark.full
def test_where_shapes_fit_the_templates_they_place_whom_colours_find(room: Sequence) -> None:
    def seen(shapes: str) -> list[ViewResult]:
        chosen = with_values(RunParameters(), {"single_view": "colour_phd"})
        chosen = with_values(chosen, {"colour_phd.shapes": shapes})
        run = pipeline.compute(room, chosen, steps=20)
        return [view for step in run.views for view in step]

    alone, both = seen("never"), seen("fitting")
    assert not any(len(view.log_ratios) for view in alone)
    assert all(len(view.log_ratios) == len(view.boxes) for view in both)
    best = [view for view in both if view.log_ratios.max(initial=-np.inf) > 0.0]
    assert len(best) > len(both) / 4
    for view in best:
        surest = int(view.log_ratios.argmax())
        assert view.sigmas[surest, 0] < view.boxes[surest, 2], "placed by shape, not by colour"


def test_a_peak_vouches_for_the_surest_shape_at_its_place_and_says_little_alone(
    room: Sequence,
) -> None:
    parameters = with_values(RunParameters(), {"single_view": "colour_phd"})
    template = room.templates[0]
    camera = [view.camera.name for view in room.views].index(template.camera)
    with FrameReader(room) as reader:
        finder = PeakFinder(room, camera, parameters.colour_phd, parameters.foreground, reader)
        picture = reader.picture(camera, template.frame)
        assert picture is not None
        _, scene = finder._appearance.look(finder._appearance.start(), picture)
    finder._appearance.trust[:] = 1.0  # as if nobody had stayed while the background was learnt
    box = Boxes.from_left_top(template.box[None]).centred
    sizes = np.tile(box[:, 2:] / [0.28, 0.86], (2, 1))  # pixels a metre
    aside = box + [0.3, 0.3, 0.0, 0.0] * np.tile(sizes[0], 2)
    away = box + [3.0, 0.0, 0.0, 0.0] * np.tile(sizes[0], 2)
    none = Windows(np.zeros((0, 4)), np.zeros((0, 4)))
    found = Shapes(np.concatenate([box, aside]), np.array([1.0, 0.0]), sizes, 0, none, np.zeros(0))
    distances, person = np.zeros(2), np.zeros(2, dtype=np.int64)
    passed = finder._passed(scene, found, np.concatenate([box, away]), distances, person)
    without = finder._passed(scene, found, away, distances[:1], person[:1])
    sure, part, lone = passed.log_ratios
    assert sure > without.log_ratios[0]
    assert part == without.log_ratios[1] < 0.0
    # a peak whose colours are hardly a template's speaks against it, on whatever foreground
    poor = finder._passed(scene, found, np.concatenate([box, away]), distances + 0.6, person)
    assert poor.log_ratios[0] < without.log_ratios[0]
    # of a person whom shapes show, a peak without one is little
    assert finder._by_shape[0] > 0.9
    assert lone == without.log_ratios[2] < -2.0


def test_colours_are_guessed_where_somebody_is_not_taught_in_every_camera_and_twice_in_one(
    room: Sequence,
) -> None:
    first = room.templates[0]
    each = tuple(replace(first, camera=camera.name) for camera in room.cameras)
    assert taught_well(replace(room, templates=(*each, first)))
    assert not taught_well(replace(room, templates=each))
    assert not taught_well(replace(room, templates=each[1:] + each[1:]))
    another = replace(first, name="another")
    assert not taught_well(replace(room, templates=(*each, first, another)))


def test_colours_speak_for_a_shape_by_a_peak_and_against_it_by_its_own_box() -> None:
    vouched = np.array([[True, False], [False, True], [False, False], [False, False]])
    of_peaks, of_shapes = np.array([0.3, 0.6]), np.array([0.9, 0.9, 0.3, 0.9])
    ratios = colour_ratios(vouched, of_peaks, of_shapes, sigma=0.1)
    np.testing.assert_allclose(ratios, [1.5, -1.5, 0.0, -1.0])
    # a wider likelihood tells less
    np.testing.assert_allclose(colour_ratios(vouched, of_peaks, of_shapes, 0.2)[:2], [0.75, -0.75])
    assert colour_ratios(np.zeros((0, 2), bool), of_peaks, np.zeros(0), 0.1).shape == (0,)
    np.testing.assert_allclose(
        colour_ratios(np.zeros((2, 0), bool), np.zeros(0), of_shapes[2:], 0.1), [0.0, -1.0]
    )
