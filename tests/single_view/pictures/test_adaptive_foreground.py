"""The c-means segmentation finds people under changing light, and its background follows it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tests.single_view.pictures.furnished import (
    SKIN,
    clip,
    empty_room,
    person_mask,
    photograph,
    with_person,
)
from tracker.kernels.pictures.foreground import above
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.adaptive import (
    AdaptiveForeground,
    AdaptiveState,
    choose_iteration,
    clean,
    cluster,
    first_background,
)

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
