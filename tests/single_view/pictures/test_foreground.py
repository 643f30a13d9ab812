"""The background is learnt from the clip, follows the exposure, and gives way to people only."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy import ndarray

from tests.single_view.pictures.furnished import (
    SKIN,
    clip,
    empty_room,
    person_mask,
    photograph,
    with_person,
)
from tracker.kernels.pictures.foreground import foreground_mask
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.background import (
    BackgroundModel,
    LearntForeground,
    pack,
    tone_curve,
    unpack,
)
from tracker.single_view.pictures.foreground import box_shares, integral

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
