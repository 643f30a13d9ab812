"""The background is learnt from the clip, follows the exposure, and gives way to people only."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker import foreground, image_kernels
from tracker.foreground import BackgroundModel, tone_curve


def empty_room(height: int = 96, width: int = 128) -> ndarray:
    """Walls from dark to light with a few pieces of furniture."""
    rng = np.random.default_rng(0)
    ramp = np.linspace(40, 210, width)[None, :, None] * np.array([0.9, 1.0, 1.05])
    room = np.broadcast_to(ramp, (height, width, 3)).copy()
    for _ in range(12):
        x, y = rng.integers(0, width - 30), rng.integers(0, height - 30)
        room[y : y + 25, x : x + 20] = rng.uniform(20, 230, 3)
    return cv2.GaussianBlur(room, (0, 0), 1.0)


def photograph(room: ndarray, gain: float = 1.0, noise: float = 1.5, seed: int = 0) -> ndarray:
    """The room as a camera with noise and its own exposure shows it."""
    seen = room * gain + np.random.default_rng(seed).normal(0.0, noise, room.shape)
    return np.clip(np.rint(seen), 0, 255).astype(np.uint8)


def with_person(room: ndarray, x: int, y: int = 30) -> ndarray:
    peopled = room.copy()
    cv2.ellipse(peopled, (x, y), (9, 14), 0, 0, 360, (30.0, 60.0, 170.0), -1)
    return peopled


def clip(gains: ndarray) -> list[ndarray]:
    """Somebody walks through the picture; no picture is empty."""
    room = empty_room()
    return [photograph(with_person(room, 10 + 4 * k), gain, seed=k) for k, gain in enumerate(gains)]


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
    mask = model.foreground(picture, 24.0).astype(bool)
    person = with_person(np.zeros_like(empty_room()), 70).any(axis=2)
    differs = np.abs(empty_room() - np.array([30.0, 60.0, 170.0])).max(axis=2) > 40.0
    assert mask[person & differs].mean() > 0.85
    assert mask[~cv2.dilate(person.astype(np.uint8), np.ones((5, 5))).astype(bool)].mean() < 0.01


def test_a_shadow_is_not_foreground() -> None:
    model = learnt(np.ones(25))
    shaded = empty_room()
    shaded[40:80, 30:70] *= 0.75
    assert model.foreground(photograph(shaded, seed=5), 24.0).mean() < 0.01


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


@pytest.mark.parametrize("level", [0, 255])
def test_a_black_or_white_frame_has_no_foreground(level: int) -> None:
    model = learnt(np.ones(9))
    assert model.foreground(np.full((96, 128, 3), level, dtype=np.uint8), 24.0).mean() < 0.01


def test_a_frozen_camera_has_no_foreground() -> None:
    picture = clip(np.ones(1))[0]
    model = BackgroundModel.learn([picture] * 5)
    assert model is not None
    assert not model.foreground(picture, 24.0).any()


def test_no_pictures_give_no_model() -> None:
    assert BackgroundModel.learn([]) is None


def test_shares_of_boxes_agree_with_counting() -> None:
    rng = np.random.default_rng(8)
    mask = (rng.random((30, 40)) < 0.4).astype(np.uint8)
    corners = rng.uniform(-10, 50, (200, 2, 2))
    edges = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    shares = foreground.box_shares(foreground.integral(mask), edges)
    y, x = np.mgrid[:30, :40]
    for (left, top, right, bottom), share in zip(edges, shares, strict=True):
        inside = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
        assert share == pytest.approx(mask[inside].mean() if inside.any() else 0.0)
    assert len(foreground.box_shares(foreground.integral(mask), np.zeros((0, 4)))) == 0


def test_the_mask_agrees_with_numpy() -> None:
    rng = np.random.default_rng(3)
    background = rng.integers(0, 256, (20, 30, 3), dtype=np.uint8)
    change = rng.normal(0.0, 25.0, background.shape) * (rng.random((20, 30, 1)) < 0.5)
    shade = np.where(rng.random((20, 30, 1)) < 0.3, 0.75, 1.0)
    picture = np.clip(background * shade + change, 0, 255).astype(np.uint8)
    spread = rng.integers(0, 20, (20, 30), dtype=np.uint8)
    mask = image_kernels.foreground_mask(picture, background, spread, 15.0, 0.65, 0.08)
    differs = np.abs(16 * np.sqrt(picture) - 16 * np.sqrt(background)).max(axis=2) > 15.0 + spread
    shares = (picture + 4.0) / (background + 4.0)
    low, high = shares.min(axis=2), shares.max(axis=2)
    shadow = (low >= 0.65) & (high <= 1.0) & (high - low <= 0.08)
    disagreeing = mask != (differs & ~shadow)
    assert disagreeing.mean() < 0.005  # float32 roots of NumPy at the threshold itself
    assert shadow[differs].any()
