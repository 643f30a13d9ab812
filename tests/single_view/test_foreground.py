"""Foreground: learnt backgrounds, thresholds that adapt, people who stay, pieces of a mask."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy import ndarray
from numpy.testing import assert_array_equal

from tests.single_view.scenery import (
    SKIN,
    clip,
    empty_room,
    person_mask,
    photograph,
    with_person,
)
from tracker.kernels.pictures.foreground import above, foreground_mask
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.adaptive import (
    AdaptiveForeground,
    AdaptiveState,
    choose_iteration,
    clean,
    cluster,
    first_background,
)
from tracker.single_view.pictures.background import (
    BackgroundModel,
    LearntForeground,
    MovingForeground,
    pack,
    tone_curve,
    unpack,
)
from tracker.single_view.pictures.foreground import blobs, box_shares, integral, spread_steps

PLAIN = ForegroundParams(threshold=24.0)


def learnt(gains: ndarray) -> BackgroundModel:
    model = BackgroundModel.learn(clip(gains))
    assert model is not None
    return model


def test_the_background_comes_out_of_pictures_that_all_show_somebody() -> None:
    model = learnt(np.ones(25))
    assert np.abs(model.picture - empty_room()).max() < 8.0
    assert model.spread.mean() < 3.0


@pytest.mark.parametrize("gain", [0.7, 0.85, 1.0, 1.15])
def test_a_person_is_foreground_at_any_exposure_and_the_room_is_not(gain: float) -> None:
    model = learnt(1.0 + 0.15 * np.sin(np.arange(25)))
    picture = photograph(with_person(empty_room(), 70), gain, seed=99)
    mask = model.foreground(picture, PLAIN).astype(bool)
    person = person_mask(70)
    differs = np.abs(empty_room() - np.array(SKIN)).max(axis=2) > 40.0
    assert mask[person & differs].mean() > 0.85
    assert mask[~cv2.dilate(person.astype(np.uint8), np.ones((5, 5))).astype(bool)].mean() < 0.01


def test_a_shadow_is_not_foreground() -> None:
    model = learnt(np.ones(25))
    shaded = empty_room()
    shaded[40:80, 30:70] *= 0.75
    assert model.foreground(photograph(shaded, seed=5), PLAIN).mean() < 0.01


@given(st.floats(0.5, 1.2), st.floats(-10.0, 10.0))
def test_a_tone_curve_maps_one_exposure_to_another(gain: float, offset: float) -> None:
    source = photograph(empty_room(), noise=0.0)
    target = np.clip(np.rint(source * gain + offset), 0, 255).astype(np.uint8)
    curve = tone_curve(source, target)
    assert curve.shape == (1, 256, 3)
    assert np.all(np.diff(curve[0].astype(int), axis=0) >= 0)
    mapped = cv2.LUT(source, curve)
    assert np.abs(mapped.astype(int) - target).mean() < 4.0


def test_a_tone_curve_ignores_a_person_over_a_third_of_the_picture() -> None:
    source = photograph(empty_room(), noise=0.0)
    target = source.copy()
    target[:32] = (30, 60, 170)
    mapped = cv2.LUT(source, tone_curve(source, target))
    assert np.median(np.abs(mapped.astype(int) - source)) <= 5.0


def test_no_pictures_give_no_model() -> None:
    assert BackgroundModel.learn([]) is None


def test_shares_of_boxes_agree_with_counting() -> None:
    rng = np.random.default_rng(8)
    mask = (rng.random((30, 40)) < 0.4).astype(np.uint8)
    corners = rng.uniform(-10, 50, (200, 2, 2))
    edges = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    shares = box_shares(integral(mask), edges)
    y, x = np.mgrid[:30, :40]
    for (left, top, right, bottom), share in zip(edges, shares, strict=True):
        inside = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
        assert share == pytest.approx(mask[inside].mean() if inside.any() else 0.0)
    assert len(box_shares(integral(mask), np.zeros((0, 4)))) == 0


def test_the_mask_agrees_with_numpy() -> None:
    rng = np.random.default_rng(3)
    learnt = rng.integers(0, 256, (20, 30, 3), dtype=np.uint8)
    curve = np.stack([np.arange(256) * part for part in (0.7, 0.85, 1.0)], axis=1)
    curve = np.rint(curve)[None].astype(np.uint8)
    background = cv2.LUT(learnt, curve)
    change = rng.normal(0.0, 25.0, background.shape) * (rng.random((20, 30, 1)) < 0.5)
    shade = np.where(rng.random((20, 30, 1)) < 0.3, 0.75, 1.0)
    picture = np.clip(background * shade + change, 0, 255).astype(np.uint8)
    spread = rng.integers(0, 20, (20, 30), dtype=np.uint8)
    mask = foreground_mask(picture, learnt, curve, spread, 15.0, 0.65, 0.08)
    differs = np.abs(16 * np.sqrt(picture) - 16 * np.sqrt(background)).max(axis=2) > 15.0 + spread
    shares = (picture + 4.0) / (background + 4.0)
    low, high = shares.min(axis=2), shares.max(axis=2)
    shadow = (low >= 0.65) & (high <= 1.0) & (high - low <= 0.08)
    disagreeing = mask != (differs & ~shadow)
    assert disagreeing.mean() < 0.005  # float32 roots of NumPy at the threshold itself
    assert shadow[differs].any()


def test_the_learnt_model_has_the_face_of_all_models() -> None:
    model = learnt(np.ones(9))
    picture = photograph(with_person(empty_room(), 70), seed=99)
    face = LearntForeground(model, PLAIN)
    state, found = face.step(face.start(), picture)
    assert state is None
    np.testing.assert_array_equal(found.mask, model.foreground(picture, PLAIN))
    np.testing.assert_array_equal(found.thresholds, 24.0)


@given(
    arrays.arrays(
        np.uint8, st.tuples(st.integers(1, 40), st.integers(1, 40)), elements=st.integers(0, 1)
    )
)
def test_a_packed_mask_comes_back(mask: ndarray) -> None:
    packed = pack(mask)
    assert packed.dtype == np.uint8
    assert packed.ndim == 1
    np.testing.assert_array_equal(unpack(packed), mask)


def test_a_mask_of_people_is_packed_into_little() -> None:
    mask = np.zeros((288, 360), dtype=np.uint8)
    for x in (60, 150, 260):
        cv2.ellipse(mask, (x, 150), (25, 90), 0, 0, 360, 1, -1)
    assert pack(mask).nbytes < 1500


@pytest.mark.parametrize("size", [0, 5, 8, 60])
def test_what_is_no_packed_mask_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=f"expected a packed mask, got {size} bytes"):
        unpack(np.full(size, 7, dtype=np.uint8))


def test_whoever_is_to_stop_stops_while_a_background_is_learnt() -> None:
    class Stop(Exception):
        pass

    asked = []

    def check() -> None:
        asked.append(True)
        raise Stop

    with pytest.raises(Stop):
        BackgroundModel.learn([np.zeros((4, 5, 3), dtype=np.uint8)] * 3, check)
    assert len(asked) == 1


PUBLISHED = ForegroundParams(
    model="adaptive", least_threshold=0.0, follow_exposure=False, drop_shadows=False
)
ROBUST = ForegroundParams(model="adaptive")

both = pytest.mark.parametrize("parameters", [PUBLISHED, ROBUST], ids=["published", "robust"])


def prepared(parameters: ForegroundParams) -> AdaptiveForeground:
    return over(clip(np.ones(25)), parameters)


def over(pictures: list[ndarray], parameters: ForegroundParams) -> AdaptiveForeground:
    first = first_background(pictures, follow_exposure=parameters.follow_exposure)
    assert first is not None
    return AdaptiveForeground(first, parameters)


def run(model: AdaptiveForeground, pictures: list[ndarray]) -> tuple[AdaptiveState, list[ndarray]]:
    state, masks = model.start(), []
    for picture in pictures:
        state, found = model.step(state, picture)
        masks.append(found.mask)
    return state, masks


@both
def test_a_person_is_found_and_the_room_is_not(parameters: ForegroundParams) -> None:
    picture = photograph(with_person(empty_room(), 70), seed=99)
    _, (mask,) = run(prepared(parameters), [picture])
    person = person_mask(70)
    differs = np.abs(empty_room() - np.array(SKIN)).max(axis=2) > 60.0
    assert mask[person & differs].mean() > 0.85
    assert mask[~cv2.dilate(person.astype(np.uint8), np.ones((5, 5))).astype(bool)].mean() < 0.002


@both
def test_an_empty_room_has_no_foreground(parameters: ForegroundParams) -> None:
    pictures = [photograph(empty_room(), seed=k) for k in range(20)]
    _, masks = run(prepared(parameters), pictures)
    assert not np.any(masks)


@both
def test_the_background_follows_a_slow_change_of_light(parameters: ForegroundParams) -> None:
    gains = np.linspace(1.0, 0.8, 200)
    pictures = [photograph(empty_room(), gain, seed=k) for k, gain in enumerate(gains)]
    state, masks = run(prepared(parameters), pictures)
    assert np.mean(masks[100:]) < 0.001
    late = with_person(empty_room(), 70)
    _, found = prepared(parameters).step(state, photograph(late, 0.8, seed=999))
    assert found.mask[person_mask(70)].mean() > 0.7
    assert found.mask[:, :50].mean() < 0.002


def test_a_sudden_change_of_light_is_met_by_the_exposure_alone() -> None:
    pictures = [photograph(with_person(empty_room(), 70), gain, seed=5) for gain in (1.0, 0.75)]
    away = ~cv2.dilate(person_mask(70).astype(np.uint8), np.ones((5, 5))).astype(bool)
    assert run(prepared(ROBUST), pictures)[1][1][away].mean() < 0.01
    assert run(prepared(PUBLISHED), pictures)[1][1][away].mean() > 0.05


def test_a_shadow_is_mostly_foreground_only_as_published() -> None:
    shaded = empty_room()
    shaded[40:80, 30:70] *= 0.75
    shares = [
        run(prepared(parameters), [photograph(shaded, seed=5)])[1][0][42:78, 32:68].mean()
        for parameters in (ROBUST, PUBLISHED)
    ]
    assert shares[0] < 0.35 < 0.7 < shares[1]


@pytest.mark.parametrize("level", [0, 255])
@both
def test_a_black_or_white_frame_has_no_foreground_and_teaches_nothing(
    parameters: ForegroundParams, level: int
) -> None:
    model = prepared(parameters)
    blank = np.full((96, 128, 3), level, dtype=np.uint8)
    state, masks = run(model, [blank] * 3)
    assert not np.any(masks)
    np.testing.assert_array_equal(state.background, model.start().background)
    _, found = model.step(state, photograph(with_person(empty_room(), 70), seed=9))
    assert found.mask[person_mask(70)].mean() > 0.7


@both
def test_without_a_picture_there_is_no_background(parameters: ForegroundParams) -> None:
    follow = parameters.follow_exposure
    assert first_background([], follow_exposure=follow) is None


@both
def test_whoever_is_to_stop_is_asked_within_a_median(parameters: ForegroundParams) -> None:
    pictures, asked = [np.zeros((480, 640, 3), dtype=np.uint8)] * 3, []
    first_background(
        pictures, follow_exposure=parameters.follow_exposure, check=lambda: asked.append(True)
    )
    assert len(asked) > 15


def test_a_step_leaves_the_state_before_as_it_was() -> None:
    model = prepared(PUBLISHED)
    state = model.start()
    background, still = state.background.copy(), state.still.copy()
    after, _ = model.step(state, photograph(empty_room(), 0.99, seed=3))
    np.testing.assert_array_equal(state.background, background)
    np.testing.assert_array_equal(state.still, still)
    assert not np.array_equal(after.background, background)


@pytest.mark.parametrize(
    ("counts", "chosen"),
    [
        ([10, 20, 24, 40], 2),
        ([10, 20, 24, 28, 60], 2),  # of equal growth the first
        ([40, 30, 20, 20], 3),  # it never grows: where it came to rest
        ([40, 30, 31, 20, 50], 2),
        ([30, 30, 50, 60], 3),  # where it stands still it does not grow
        ([40], 0),
        ([0, 0], 1),
    ],
)
def test_the_iteration_stops_where_the_foreground_grows_least(
    counts: list[int], chosen: int
) -> None:
    assert choose_iteration(np.array(counts)) == chosen


def two_classes_in_numpy(difference: ndarray, parameters: ForegroundParams) -> tuple[list, list]:
    """The iteration, pixel by pixel, as its equations say."""
    p = parameters
    m_b, m_f = np.full(3, 5.0), np.full(3, 50.0)
    thresholds, counts, before = [], [], None
    for _ in range(20):
        t = np.maximum(
            (m_b + p.deviation_ratio * m_f) / (1.0 + p.deviation_ratio), p.least_threshold
        )
        front = (difference > np.floor(t)).any(axis=2)
        thresholds.append(t)
        counts.append(int(front.sum()))
        if before is not None and np.array_equal(before, np.floor(t)):
            break
        before = np.floor(t)
        if front.sum() >= p.minimum_area:
            m_f = difference[front].mean(axis=0)
        if (~front).sum() >= p.minimum_area:
            m_b = difference[~front].mean(axis=0)
    return thresholds, counts


@given(st.integers(0, 50), st.floats(0.2, 6.0), st.floats(0.0, 30.0), st.floats(0.0, 0.3))
def test_the_iteration_agrees_with_numpy(
    seed: int, ratio: float, least: float, share: float
) -> None:
    parameters = PUBLISHED.model_copy(update={"deviation_ratio": ratio, "least_threshold": least})
    rng = np.random.default_rng(seed)
    noise = np.abs(rng.normal(0.0, 4.0, (40, 50, 3)))
    person = (rng.random((40, 50, 1)) < share) * rng.uniform(0, 150, (40, 50, 3))
    difference = np.clip(noise + person, 0, 255).astype(np.uint8)
    found = cluster(difference, parameters)
    thresholds, counts = two_classes_in_numpy(difference, parameters)
    np.testing.assert_allclose(found.thresholds, thresholds, rtol=1e-12)
    np.testing.assert_array_equal(found.counts, counts)
    assert np.all(found.thresholds >= least)
    mask = above(difference, found.thresholds[found.chosen])
    assert mask.sum() == counts[found.chosen]


def test_differences_are_compared_in_units_of_each_classs_deviation() -> None:
    """At the first threshold d is as far from both centres, in their deviations."""
    parameters = ForegroundParams()
    found = cluster(np.zeros((8, 8, 3), dtype=np.uint8), parameters)
    threshold = found.thresholds[0, 0]
    assert (threshold - 5.0) / 3.0 == pytest.approx(50.0 - threshold)


def test_a_pixel_is_background_only_if_all_channels_are() -> None:
    difference = np.zeros((2, 2, 3), dtype=np.uint8)
    difference[0, 0, 0] = difference[0, 1, 1] = difference[1, 0, 2] = 30
    np.testing.assert_array_equal(above(difference, np.array([29.9, 29.9, 29.9])), [[1, 1], [1, 0]])
    assert not above(difference, np.full(3, 30.0)).any()


def test_cleaning_drops_small_pieces_and_closes_cracks() -> None:
    mask = np.zeros((40, 60), dtype=np.uint8)
    mask[5:15, 5:15] = 1
    mask[9, 5:15] = 0  # a crack of one pixel
    mask[20:26, 30:36] = 1  # 36 pixels
    cleaned = clean(mask, 40)
    assert cleaned[5:15, 5:15].all()
    assert not cleaned[18:, 25:].any()
    assert cleaned[20:26, 30:36].sum() == 0
    assert clean(mask, 36)[20:26, 30:36].all()
    assert not clean(np.zeros_like(mask), 1).any()
    full = np.ones_like(mask)
    np.testing.assert_array_equal(clean(full, 1), full)


def test_a_tenth_of_a_grey_level_counts() -> None:
    model = prepared(PUBLISHED)
    state = model.start()
    level = np.rint(state.background / 256.0)
    brighter = np.clip(level + 1, 0, 255).astype(np.uint8)
    for _ in range(60):
        state, _ = model.step(state, brighter)
    np.testing.assert_allclose(state.background / 256.0, brighter, atol=0.51)


def plain(level: int = 100) -> ndarray:
    return np.full((60, 80, 3), level, dtype=np.uint8)


def model(changing_share: float) -> BackgroundModel:
    return BackgroundModel(plain(), np.zeros((60, 80), dtype=np.uint8), changing_share)


def test_doubt_rises_smoothly_with_the_restlessness() -> None:
    p = ForegroundParams(restless_from=0.2, restless_to=0.6)
    found = [model(r).uncertainty(p) for r in (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 1.0)]
    np.testing.assert_allclose(found, [0.0, 0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0])


def test_restless_are_pixels_that_are_away_in_more_than_three_of_ten_pictures() -> None:
    # of patches of 40 pixels that show something else in so many of ten pictures
    pictures = [plain() for _ in range(10)]
    for row, count in enumerate((1, 2, 3, 4)):
        for k in range(count):
            pictures[(2 * k + row) % 10][10 * row : 10 * row + 4, 20:30] = 170
    learnt = BackgroundModel.learn(pictures)
    assert learnt is not None
    assert learnt.changing_share == pytest.approx(1 / 3)
    # a single pixel of thousands says nothing
    few = [plain() for _ in range(10)]
    for k in range(5):
        few[2 * k][30, 40] = 170
    learnt = BackgroundModel.learn(few)
    assert learnt is not None
    assert learnt.changing_share == 0.0


@pytest.mark.parametrize(
    ("memory", "changing_share", "time", "lasting"),
    [(0.4, 1.0, 0.1, 4), (0.4, 0.5, 0.1, 2), (0.5, 1.0, 0.1, 5), (4.0, 1.0, 0.01, 254)],
)
def test_a_change_counts_for_the_length_of_the_memory(
    memory: float, changing_share: float, time: float, lasting: int
) -> None:
    p = ForegroundParams(motion_memory=memory, restless_from=0.0, restless_to=1.0, threshold=128.0)
    moving = MovingForeground(model(changing_share), p, time)
    assert moving.memory == lasting
    if lasting > 10:
        return
    state, seen = moving.start(), []
    for step in range(9):
        picture = plain()
        picture[20:40, 30:50] = 100 if step < 2 else 190
        state, found = moving.step(state, picture)
        assert set(np.unique(found.mask)) <= {0, 1}
        seen.append(bool(found.mask[25:35, 35:45].all()))
        assert not found.mask[:, :20].any()
        assert_array_equal(found.thresholds, 128.0)
    # from the step of the change on
    assert seen == [2 <= step < 2 + lasting for step in range(9)]


def test_pictures_are_compared_over_a_tenth_of_a_second() -> None:
    p = ForegroundParams(restless_from=0.0, restless_to=0.5, threshold=128.0, motion_memory=0.05)
    moving = MovingForeground(model(1.0), p, 0.05)
    state, seen = moving.start(), []
    for step in range(6):
        picture = plain()
        picture[20:40, 30:50] = 100 if step < 2 else 190
        state, found = moving.step(state, picture)
        seen.append(bool(found.mask[25:35, 35:45].all()))
    assert len(state.before) == 2
    assert seen == [False, False, True, True, False, False]  # against two pictures ago


def test_a_change_of_more_than_half_of_the_picture_is_none() -> None:
    p = ForegroundParams(restless_from=0.0, restless_to=0.5, threshold=128.0, motion_memory=0.3)
    for rows, moved in ((27, True), (33, False)):
        moving = MovingForeground(model(1.0), p, 0.1)
        state, _ = moving.step(moving.start(), plain())
        picture = plain()
        picture[:rows] = 190
        _, found = moving.step(state, picture)
        assert found.mask.any() == moved


def test_a_background_is_learnt_from_steps_all_over_the_clip() -> None:
    assert spread_steps(range(5)) == [0, 1, 2, 3, 4]
    assert spread_steps(range(3, 4)) == [3]
    many = spread_steps(range(10, 1000))
    assert (len(many), many[0], many[-1]) == (32, 10, 999)
    assert set(np.diff(many)) <= {31, 32}


def flood(mask: ndarray) -> list[set[tuple[int, int]]]:
    """Pieces as sets of (row, column), in the order in which rows meet them."""
    left = set(zip(*np.nonzero(mask), strict=True))
    pieces = []
    for start in zip(*np.nonzero(mask), strict=True):
        if start not in left:
            continue
        left.discard(start)
        piece, edge = {start}, [start]
        while edge:
            row, column = edge.pop()
            for near in ((row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
                if near in left:
                    left.discard(near)
                    piece.add(near)
                    edge.append(near)
        pieces.append(piece)
    return pieces


@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.integers(1, 6))
def test_pieces_agree_with_a_flood_fill(seed: int, share: float, least: int) -> None:
    rng = np.random.default_rng(seed)
    mask = (rng.random((11, 14)) < share).astype(np.uint8) * 255
    found = blobs(mask, least)
    pieces = [piece for piece in flood(mask) if len(piece) >= least]
    assert found.size == len(pieces)
    assert (np.diff(found.boxes[:, 1] - found.boxes[:, 3]) >= 0.0).all()
    seen = set()
    for name in range(found.size):
        pixels = set(zip(*np.nonzero(found.owners == name), strict=True))
        assert pixels in pieces
        seen |= pixels
        rows, columns = np.array(sorted(pixels)).T
        x, y, half_width, half_height = found.boxes[name]
        assert found.areas[name] == len(pixels)
        assert (x - half_width, x + half_width) == (columns.min() - 0.5, columns.max() + 0.5)
        assert (y - half_height, y + half_height) == (rows.min() - 0.5, rows.max() + 0.5)
    assert seen == {pixel for piece in pieces for pixel in piece}


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (4, 4)])
def test_nothing_gives_no_boxes(shape: tuple[int, int]) -> None:
    found = blobs(np.zeros(shape, dtype=np.uint8), 1)
    assert found.boxes.shape == (0, 4)
    assert found.areas.shape == (0,)
    assert (found.owners == -1).all()


def test_one_pixel_is_a_box_of_one_pixel() -> None:
    mask = np.zeros((5, 7), dtype=bool)
    mask[3, 6] = True
    assert_array_equal(blobs(mask, 1).boxes, [[6.0, 3.0, 0.5, 0.5]])
    assert len(blobs(mask, 2).boxes) == 0


def test_a_picture_in_colour_is_no_mask() -> None:
    with pytest.raises(
        ValueError, match=r"mask: expected \(height, width\), got shape \(4, 4, 3\)"
    ):
        blobs(np.zeros((4, 4, 3), dtype=np.uint8), 1)
