"""Boxes of upright targets: sizes at each place and entrance, and the noise of each method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tests.single_view.scenery import CAMERA, detected, run
from tracker import single_view
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.detections import DetectionBoxParams, ShapesParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.jpda import JpdaParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Entrance, Room, Sequence
from tracker.single_view import box_sizes
from tracker.single_view.box_sizes import (
    BoxSizes,
    entrance_boxes,
    outline_share,
    upright_boxes,
    usual_heights,
)
from tracker.single_view.colour.peaks import PeakFinder
from tracker.single_view.detector_boxes import (
    detector_sigmas,
    judge_boxes,
    meets_room,
    standing_range,
)
from tracker.single_view.jpda.crowns import TargetSizes
from tracker.single_view.jpda.measurements import source_of
from tracker.single_view.pseudo_particle.particles import ColourParticles
from tracker.single_view.shape.finder import log_ratios, shape_sigmas

LENS = world.look_at("lens", (-2.9, -2.7, 2.4), focal=300.0, image_size=(320, 240),
                     distortion=world.BARREL)  # fmt: skip
ROOM = world.volume(1.5, 2.0, [(-1.2, 0.0, 1.0), (1.2, 0.3, 1.2)], (0.25, 0.25, 0.1))
HALF = np.array([0.1, 0.2, 0.3])


def places(count: int, seed: int = 0) -> ndarray:
    low, high = np.add(ROOM.minimum, [0.0, 0.0, 0.3]), ROOM.maximum
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def test_an_upright_box_is_half_the_pictures_of_width_and_height() -> None:
    positions = np.concatenate([places(60), [[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0]]])
    boxes, visible = upright_boxes(LENS, positions, HALF)
    ahead = LENS.rotation[2]
    right = np.array([ahead[1], -ahead[0], 0.0]) / np.hypot(*ahead[:2])
    for position, box, seen in zip(positions, boxes, visible, strict=True):
        ends = (
            position
            + np.outer([0, -1, 1, 0, 0], 0.15 * right)
            + np.outer([0, 0, 0, -1, 1], [0.0, 0.0, 0.3])
        )
        pixels, whole = LENS.project(ends)
        assert seen == (whole.all() and LENS.contains(pixels[:1])[0])
        if whole.all():
            expected = [np.linalg.norm(pixels[2] - pixels[1]) / 2.0,
                        np.linalg.norm(pixels[4] - pixels[3]) / 2.0]  # fmt: skip
            assert_allclose(box, [*pixels[0], *expected])
        else:
            assert np.isnan(box).all()
    assert 30 < visible.sum() < 62
    # extents of each
    own = np.tile(HALF, (len(positions), 1)) * np.array([[1.0]] * 30 + [[2.0]] * 32)
    larger, _ = upright_boxes(LENS, positions, own)
    assert_allclose(larger[:30], boxes[:30])
    twice, _ = upright_boxes(LENS, positions, 2.0 * HALF)
    assert_allclose(larger[30:], twice[30:])


def test_a_camera_that_looks_straight_down_has_an_upright_box_too() -> None:
    down = world.look_at("down", (0.0, -0.001, 4.0), (0.0, 0.0, 0.0))
    boxes, visible = upright_boxes(down, np.array([[0.5, 0.5, 1.0]]), HALF)
    assert visible.all()
    assert (boxes[0, 2:] > 1.0).all()


def test_sizes_are_those_of_targets_all_over_the_room() -> None:
    sizes = BoxSizes.of(LENS, ROOM, HALF)
    assert sizes.cell == 320 / 24
    assert (sizes.columns, sizes.rows) == (24, 18)
    positions = places(4000)
    positions = positions[positions[:, 2] > 0.3 - box_sizes.BELOW_FLOOR]
    boxes, visible = upright_boxes(LENS, positions, HALF)
    boxes = boxes[visible]
    # the same distribution by other points: quantiles over all of the picture agree
    for axis in range(2):
        shares = [0.1, 0.5, 0.9]
        own = np.quantile(sizes.sizes[:, axis], shares)
        assert_allclose(own, np.quantile(boxes[:, 2 + axis], shares), rtol=0.05)
    assert sizes.contains(boxes[:, :2]).mean() > 0.97
    assert_array_equal(sizes.smallest, sizes.sizes.min(axis=0))
    assert_array_equal(sizes.largest, sizes.sizes.max(axis=0))
    assert sizes.starts[0] == 0
    assert sizes.starts[-1] == len(sizes.sizes)


def test_what_is_said_of_a_cell_is_of_the_sizes_in_it() -> None:
    sizes = BoxSizes.of(LENS, ROOM, HALF)
    middles = sizes.places()
    assert_array_equal(sizes.cells(middles), np.arange(sizes.rows * sizes.columns))
    table, there = sizes.quantiles(4)
    typical, possible = sizes.typical(middles)
    assert_array_equal(there, possible)
    assert_array_equal(there, sizes.contains(middles))
    rng = np.random.default_rng(0)
    drawn = np.array([sizes.draw(middles, rng)[0] for _ in range(60)])
    for cell in range(len(middles)):
        own = sizes.sizes[sizes.starts[cell] : sizes.starts[cell + 1]]
        if not len(own):
            assert np.isnan(typical[cell]).all()
            assert np.isnan(drawn[:, cell]).all()
            assert not table[cell].any()
            continue
        assert_allclose(typical[cell], np.median(own, axis=0))
        ranks = ((np.arange(4) + 0.5) / 4 * len(own)).astype(int)
        assert_array_equal(table[cell, :, 1], np.sort(own[:, 1])[ranks])
        assert np.isin(drawn[:, cell, 1], own[:, 1]).all()
        if len(own) > 3:
            assert len(np.unique(drawn[:, cell, 1])) > 2
    # half a pixel belongs to the first cell, and what is outside to the nearest one
    edge = np.array([[-0.5, -0.5], [sizes.cell - 0.51, 0.0], [sizes.cell - 0.5, 0.0],
                     [-99.0, 999.0], [999.0, -99.0]])  # fmt: skip
    assert sizes.cells(edge).tolist() == [0, 0, 1, 17 * 24, 23]


def test_with_entrances_most_sizes_are_of_their_heights() -> None:
    anywhere, there = (
        BoxSizes.of(LENS, ROOM, HALF, at_usual_heights=at).quantiles(5) for at in (False, True)
    )
    both = anywhere[1] & there[1]
    spreads = [np.log(t[both][:, 3, 1] / t[both][:, 1, 1]).mean() for t, _ in (anywhere, there)]
    assert spreads[1] < 0.75 * spreads[0]
    low = Room(ROOM.minimum, np.array([1.5, 1.5, 1.2]))  # too low to sit in
    assert_array_equal(
        BoxSizes.of(LENS, low, HALF, at_usual_heights=True).sizes,
        BoxSizes.of(LENS, low, HALF).sizes,
    )
    away = Room(np.array([-51.0, -51.0, 0.0]), np.array([-50.0, -50.0, 2.0]))
    nothing = BoxSizes.of(LENS, away, HALF)
    assert_array_equal([nothing.smallest, nothing.largest], [[1.0, 1.0], [2.0, 2.0]])
    assert not nothing.contains(places(5)[:, :2]).any()


@pytest.mark.parametrize("half_height", [0.125, 0.36, 0.85, 1.1])
def test_without_entrances_sizes_are_those_of_people_on_the_floor(
    half_height: float,
) -> None:
    half = np.array([0.2, 0.2, half_height])
    raised = Room(np.array([-1.5, -1.5, 0.4]), np.array([1.5, 1.5, 2.6]))
    means, sigmas = usual_heights(raised, half_height)
    # from a crown at 1.55 m down, or up from the floor where that is higher
    assert means == pytest.approx([0.4 + max(1.55 - half_height, half_height)])
    assert sigmas == pytest.approx([0.2 if half_height < 0.7 else 0.1])
    doors = replace(
        raised, entrances=(Entrance(np.array([0.0, 0.0, means[0]]), np.full(3, sigmas[0])),)
    )
    as_doors, as_people = (
        BoxSizes.of(LENS, room, half, at_usual_heights=True) for room in (doors, raised)
    )
    assert_array_equal(as_people.sizes, as_doors.sizes)
    middles = [TargetSizes(LENS, room, half, 2.0).middle for room in (doors, raised)]
    assert_allclose(middles[1], middles[0], rtol=0.15)


@given(st.floats(0.02, 1.0), st.floats(0.02, 1.0), st.floats(0.05, 1.2), st.floats(1.01, 2.0))
def test_the_outline_of_a_person_fills_less_of_a_wider_box(
    width: float, depth: float, half_height: float, factor: float
) -> None:
    share = outline_share(np.array([width, depth, half_height]))
    assert 0.0 < share <= 1.0 + 1e-12
    wider = outline_share(np.array([factor * width, factor * depth, half_height]))
    assert share / factor - 1e-12 <= wider <= share + 1e-12, "what is added is empty at most"
    # the same by rows of the outline: head, trunk and legs of somebody as tall as the box at least
    rise = 2.0 * half_height
    down = (np.arange(4000) + 0.5) / 4000 * rise
    stature = max(1.65, rise)
    across = stature * np.select([down < 0.13 * stature, down < 0.47 * stature], [0.1, 0.195], 0.11)
    filled = np.minimum(across, width + depth).mean() / (width + depth)
    assert share == pytest.approx(filled, abs=2e-3)


def test_the_outline_of_a_whole_body_has_the_area_that_is_measured() -> None:
    half = np.array([0.3, 0.3, 0.86])
    area = outline_share(half) * 0.6 * 1.72
    # Fanger 1972: projected area of standing people, 0.23 to 0.35 of an effective area of 1.3 m²
    assert 0.23 * 1.3 < area < 0.35 * 1.3


def test_an_entrance_is_a_gaussian_of_the_boxes_that_come_in_by_it() -> None:
    births = entrance_boxes(LENS, ROOM, HALF, 0.3)
    assert_array_equal(births.weights, [0.3, 0.3])
    assert_array_equal(births.labels, [0, 0])
    rng = np.random.default_rng(1)
    for entrance, mean, covariance in zip(
        ROOM.entrances, births.means, births.covariances, strict=True
    ):
        drawn = entrance.position + entrance.sigma * rng.normal(size=(4000, 3))
        boxes, visible = upright_boxes(LENS, drawn, HALF)
        boxes = boxes[visible]
        deviation = boxes.std(axis=0)
        assert (np.abs(mean - boxes.mean(axis=0)) < 0.15 * deviation).all()
        own = np.diag((0.1 * mean[[2, 3, 2, 3]]) ** 2)
        assert_allclose(
            (covariance - own) / np.outer(deviation, deviation), np.corrcoef(boxes.T), atol=0.15
        )
    away = world.look_at("away", (-2.9, -2.7, 2.4), (-9.0, -9.0, 1.0))
    assert entrance_boxes(away, ROOM, HALF, 0.3).size == 0


def test_targets_are_as_large_as_those_who_walk_and_else_as_those_who_sit() -> None:
    sizes = TargetSizes(LENS, ROOM, HALF, 2.0)
    grid = BoxSizes.of(LENS, ROOM, HALF)
    middles = grid.places()
    # the entrances are 1.0 and 1.2 high, give or take 0.1: from 0.8 to 1.4 people walk
    low, high = np.array([*ROOM.minimum[:2], 0.8]), np.array([*ROOM.maximum[:2], 1.4])
    walked = np.random.default_rng(2).uniform(low, high, (20_000, 3))
    boxes, visible = upright_boxes(LENS, walked, HALF)
    cells = grid.cells(boxes[visible, :2])
    found = sizes.at(middles)
    ratios = [
        found[cell] / np.median(boxes[visible][cells == cell, 2:], axis=0)
        for cell in range(len(middles))
        if (cells == cell).sum() > 60
    ]
    assert len(ratios) > 80
    assert_allclose(np.median(ratios, axis=0), 1.0, atol=0.03)
    assert np.percentile(np.abs(np.array(ratios) - 1.0), 95) < 0.12
    there = np.isfinite(found[:, 0])
    assert_array_equal(sizes.middle, np.median(found[there], axis=0))
    tops = middles[there][::7] - [0.0, 1.0] * found[there][::7]
    under = sizes.under(tops)
    assert_allclose(np.nanmedian(under / found[there][::7]), 1.0, atol=0.05)


# ── which boxes of a detector contradict the room


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.05, 0.5), st.booleans())
def test_a_box_tells_where_its_target_stands(
    x: float, y: float, error: float, upside_down: bool
) -> None:
    place = np.array([[x, y, 0.85]])
    # of somebody straight ahead top and bottom of the box are head and foot, or foot and head
    camera = world.look_at("cam", CAMERA.centre.tolist(), (x, y, 0.85))
    if upside_down:
        turn = np.diag([-1.0, -1.0, 1.0])
        camera = Camera(
            "cam", camera.image_size, camera.intrinsics,
            turn @ camera.rotation, turn @ camera.translation, camera.distortion,
        )  # fmt: skip
    (head, foot), _ = camera.project(np.array([[x, y, 1.7], [x, y, 0.0]]))
    assert (foot[1] < head[1]) == upside_down
    box = np.array([[(head[0] + foot[0]) / 2.0, (head[1] + foot[1]) / 2.0, 9.0,
                     abs(foot[1] - head[1]) / 2.0]])  # fmt: skip
    near, far = standing_range(camera, box, 0.85, np.zeros(1))
    assert_allclose(near, place, atol=1e-6)
    assert_allclose(near, far)
    near, far = standing_range(camera, box, 0.85, np.full(1, error))
    along = place - camera.centre
    assert_allclose(near, camera.centre + along / (1.0 + error), atol=1e-6)
    assert_allclose(far, camera.centre + along / (1.0 - error), atol=1e-6)
    _, far = standing_range(camera, box, 0.85, np.full(1, 3.0))
    assert_allclose(far, camera.centre + along / 0.05, atol=1e-5)


WAYS = [
    # start, end, margin, whether it meets_room the cube from -1 to 1
    ([-3, 0, 0], [3, 0, 0], 0.0, True),  # through it
    ([-3, 0, 0], [-1, 0, 0], 0.0, True),  # ends on its wall
    ([-3, 0, 0], [-1.001, 0, 0], 0.0, False),
    ([-3, 0, 0], [-1.001, 0, 0], 0.01, True),
    ([1, 0, 0], [3, 0, 0], 0.0, True),  # begins on its wall
    ([1.001, 0, 0], [3, 0, 0], 0.0, False),
    ([0, 0, 0], [0.1, 0.1, 0.1], 0.0, True),  # inside
    ([-3, 1, 0], [3, 1, 0], 0.0, True),  # along a wall
    ([-3, 1.001, 0], [3, 1.001, 0], 0.0, False),
    ([-3, -1, 0], [3, -1, 0], 0.0, True),
    ([-3, -3, 0], [3, 3, 0], 0.0, True),
    ([-3, -1, 0], [-1, 3, 0], 0.0, False),  # past an edge
    ([0.5, 0.5, 0.5], [0.5, 0.5, 0.5], 0.0, True),  # a point
    ([1.5, 0.5, 0.5], [1.5, 0.5, 0.5], 0.0, False),
    ([1.5, 0.5, 0.5], [1.5, 0.5, 0.5], 0.5, True),
]


@pytest.mark.parametrize(("start", "end", "margin", "met"), WAYS)
def test_a_way_meets_the_room_where_some_point_of_it_does(
    start: list[float], end: list[float], margin: float, met: bool
) -> None:
    room = Room(-np.ones(3), np.ones(3))
    for turn in range(3):  # in every axis, and backwards
        a, b = np.roll([start], turn, axis=1).astype(float), np.roll([end], turn, axis=1)
        assert meets_room(room, a, b.astype(float), margin).tolist() == [met]
        assert meets_room(room, b.astype(float), a, margin).tolist() == [met]


def test_boxes_end_where_the_picture_ends_and_contradict_a_room_they_are_not_in() -> None:
    place = np.array([[0.5, -0.4, 0.85]])
    good = world.upright(CAMERA, place)[0]
    giant, dwarf = [640.0, 400.0, 150.0, 380.0], [640.0, 305.0, 2.0, 5.0]
    cut, above = [640.0, 760.0, 60.0, 100.0], [640.0, -90.0, 20.0, 50.0]
    boxes = np.array([good, giant, dwarf, cut, above])
    whole = detected([boxes])
    p = DetectionBoxParams(room_tolerance=0.3)
    found = judge_boxes(whole, CAMERA, Boxes(boxes).left_top, np.linspace(0.1, 0.5, 5), p)
    assert found.plausible[:3].tolist() == [True, False, False]
    expected = boxes.copy()
    expected[3] = [640.0, (660.0 + 799.0) / 2.0, 60.0, (799.0 - 660.0) / 2.0]
    assert_allclose(found.boxes, expected)  # what lies wholly outside is left as it is
    # an error of three deviations of its height is forgiven
    nearest, farthest = standing_range(CAMERA, boxes, 0.85, 3.0 * found.sigmas[:, 3] / boxes[:, 3])
    assert_array_equal(found.plausible, meets_room(whole.room, nearest, farthest, 0.3))


def test_boxes_of_a_detector_pass_from_their_least_score_on_with_what_is_told_of_them() -> None:
    boxes = np.array([[300.0, 200.0, 10.0, 30.0], [500.0, 300.0, 20.0, 40.0]])
    whole = detected([boxes, [], boxes[:1]], [0.5, 0.4999, 1.0])
    results = run("none", whole)
    assert [len(result.boxes) for result in results] == [2, 0, 1]
    assert_allclose(results[0].boxes, boxes)
    assert_array_equal(results[0].weights, [0.5, 0.4999])
    values = {"detection_boxes.score_threshold": 0.5, "detection_boxes.room_tolerance": 100.0}
    method = single_view.create(
        "none",
        whole,
        0,
        with_values(RunParameters(), values),
        None,  # type: ignore[arg-type]
    )
    _, result = method.step(None, 0, None, np.random.default_rng(0))
    assert_allclose(result.boxes, boxes[:1])
    tight = with_values(RunParameters(), {"detection_boxes.room_tolerance": 0.0})
    good = world.upright(CAMERA, np.array([[0.2, 0.1, 0.85]]))[0]
    giant = detected([[[640.0, 400.0, 150.0, 380.0], good]], [0.7, 0.9])
    method = single_view.create("none", giant, 0, tight, None)  # type: ignore[arg-type]
    _, result = method.step(None, 0, None, np.random.default_rng(0))
    assert_array_equal(result.weights, [0.9])
    assert_array_equal(result.measurement_scores, [0.7, 0.9])
    assert result.information["dropped for a place outside the room"] == 1.0
    assert len(result.dropped.boxes) == 1


BOXES = np.array([[40.0, 30.0, 4.0, 10.0], [9.0, 8.0, 100.0, 240.0], [5.0, 5.0, 0.0, 0.1]])
"""One of them is large, and one is smaller than a pixel."""
HALF_SIZE = np.array([[4.0, 10.0], [100.0, 240.0], [0.5, 0.5]])
"""Their half sizes, half a pixel at least."""

UNSEEN = {"foreground_weight": 0.0, "surroundings_weight": 0.0, "acceptance_foreground": 0.0}
"""Of colours alone: no background has to be learnt."""


def shares(centre: float, size: float, half: ndarray = HALF_SIZE) -> ndarray:
    return np.column_stack([centre * half, size * half])


def test_a_detectors_noise_is_a_share_of_the_size_and_pixels_in_quadrature() -> None:
    p = DetectionBoxParams(centre_sigma=0.1, size_sigma=0.2, width_sigma=0.5, pixel_sigma=1.5)
    # along and across a box's centre is off by a share of its height
    expected = np.array([[1.0, 1.0, 2.0, 2.0], [24.0, 24.0, 50.0, 48.0], [0.01, 0.01, 0.0, 0.02]])
    assert_allclose(detector_sigmas(BOXES, p), np.sqrt(expected**2 + 1.5**2))
    assert_allclose(detector_sigmas(BOXES, p.model_copy(update={"pixel_sigma": 0.0})), expected)


def test_a_peaks_noise_is_a_share_of_its_width_and_height_and_no_more_of_a_large_one(
    heads: Sequence, reader: FrameReader
) -> None:
    p = ColourPhdParams(
        centre_sigma=0.4, size_sigma=0.3, sigma_height=60.0, shapes="never",
        carry_templates=False, foreground_samples=0.0, **UNSEEN,
    )  # fmt: skip
    finder = PeakFinder(heads, 0, p, ForegroundParams(), reader)
    # 240 pixels high counts as 60, and 100 wide as 25
    assert_allclose(
        finder.sigmas(BOXES), shares(0.4, 0.3, np.array([[4.0, 10.0], [25.0, 60.0], [0.5, 0.5]]))
    )


def test_the_noise_of_particles_is_a_share_of_width_and_height(
    heads: Sequence, reader: FrameReader
) -> None:
    p = PseudoParticleParams(birth="picture")
    colours = ColourPhdParams(centre_sigma=0.4, size_sigma=0.3, **UNSEEN)
    model = ColourParticles(heads, 0, p, colours, ForegroundParams(), reader)
    assert_allclose(model.sigmas(BOXES), shares(0.4, 0.3))


def test_the_noise_of_associated_foreground_adds_pixels_to_its_centre(
    heads: Sequence, reader: FrameReader
) -> None:
    p = JpdaParams(centre_sigma=0.1, size_sigma=0.2, pixel_sigma=3.0, foreground_box="piece")
    source = source_of(heads, 0, RunParameters(jpda=p), reader)
    expected = shares(0.1, 0.2)
    expected[:, :2] = np.hypot(expected[:, :2], 3.0)
    assert_allclose(source.sigmas(BOXES), expected)


def test_a_target_is_occluded_within_so_many_half_sizes_of_a_peak(
    heads: Sequence, reader: FrameReader
) -> None:
    values = {
        "jpda.measurements": "colour", "jpda.cover": 1.75, "foreground.threshold": 30.0,
        "foreground.minimum_area": 4, "colour_phd.shapes": "never",
    }  # fmt: skip
    source = source_of(heads, 0, with_values(RunParameters(), values), reader)
    _, found = source.measure(
        source.start(), 4, reader.picture(0, 4), GaussianMixture.empty(4), np.random.default_rng(0)
    )
    assert len(found.boxes)
    assert_allclose(found.pieces[:, :2], found.boxes[:, :2])
    assert_allclose(found.pieces[:, 2:], 1.75 * found.boxes[:, 2:])


def test_the_noise_of_shapes_is_the_same_in_metres_everywhere() -> None:
    p = ShapesParams(place_sigma=0.06, size_sigma=0.2, pixel_sigma=2.0)
    found = shape_sigmas(BOXES, np.array([0.2, 0.4, 0.6]), p)
    expected = shares(0.06, 0.2)
    expected[:, :2] = np.hypot(expected[:, :2] / [0.3, 0.6], 2.0)
    assert_allclose(found, expected)


def test_odds_speak_for_a_shape_up_to_a_largest_ratio() -> None:
    odds = np.array([-4.0, 2.0, 3.0, 5.0, 9.0])
    assert_allclose(log_ratios(odds, 2.0, 1.5, 4.5), [-9.0, 0.0, 1.5, 4.5, 4.5])


def test_the_stated_noise_is_that_of_the_boxes_it_is_stated_of() -> None:
    """The errors of boxes that are off as the parameters say are standard normal in its units."""
    rng = np.random.default_rng(4)
    p = DetectionBoxParams(centre_sigma=0.06, size_sigma=0.06, width_sigma=0.06, pixel_sigma=2.0)
    cameras = world.ring(3)
    paths = world.together(*(world.wander(rng, 150) for _ in range(3)))
    exact = world.boxes(cameras, paths, sigma=0.0)
    noisy = world.boxes(cameras, paths, sigma=2.0, relative=0.06, rng=rng)
    errors = []
    for one, other in zip(exact, noisy, strict=True):
        truth = {
            (step, person): box
            for step, person, box in zip(one.frames, one.people, one.boxes, strict=True)
        }
        true = np.array([truth[key] for key in zip(other.frames, other.people, strict=True)])
        errors.append((other.boxes - true) / detector_sigmas(true, p))
    # a width is a share of itself, which the noise of the boxes here is not
    standard = np.concatenate(errors)[:, [0, 1, 3]]
    assert len(standard) > 1000
    assert_allclose(standard.std(axis=0), 1.0, atol=0.05)
    assert_allclose(standard.mean(axis=0), 0.0, atol=0.08)


def test_what_a_method_states_is_what_its_boxes_have(heads: Sequence, reader: FrameReader) -> None:
    """Of association matrices, whose noise shows in the result alone."""
    values = {
        "association_matrix.centre_sigma": 0.3, "association_matrix.size_sigma": 0.2,
        "association_matrix.output": "objects", "foreground.minimum_area": 4,
    }  # fmt: skip
    from tracker import single_view

    method = single_view.create(
        "association_matrix", heads, 0, with_values(RunParameters(), values), reader
    )
    _, result = method.step(method.start(), 4, reader.picture(0, 4), np.random.default_rng(0))
    assert len(result.boxes) == 2
    assert_allclose(result.sigmas, shares(0.3, 0.2, result.boxes[:, 2:]))
