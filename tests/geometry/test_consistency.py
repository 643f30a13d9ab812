"""The likelihood of boxes by other cameras' boxes: invariances, its formula, and its zero."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from tests.random_rooms import random_room
from tracker.geometry.consistency.likelihood import (
    Evidence,
    Moments,
    Scene,
    at_moments,
    evidence,
    fit_floor,
)
from tracker.geometry.consistency.observed import Pose, pose_of, upright_rays
from tracker.geometry.consistency.odds import log_odds
from tracker.kernels.consistency import best_share, density_ratios
from tracker.sequences.sequence import Sequence

RISE = np.array([0.0, 0.0, 1.7])


def boxes_of(sequence: Sequence, moments: ndarray) -> list[Moments | None]:
    return [
        at_moments(upright_rays(v.detections.frames, v.detections.boxes, v.camera), moments)
        for v in sequence.views
        if v.detections is not None
    ]


def poses_of(sequence: Sequence) -> list[Pose]:
    return [pose_of(camera) for camera in sequence.cameras]


def evidence_of(seed: int, poses: list[Pose] | None = None, late: int = 0) -> Evidence:
    sequence = random_room(seed, cameras=3, people=3)
    moments = np.arange(0, 200, 5)
    boxes = boxes_of(sequence, moments)
    boxes[1] = boxes_of(sequence, moments + late)[1]
    return evidence(boxes, poses or poses_of(sequence), Scene(RISE, 0.0, 0.03))


@pytest.mark.parametrize("seed", range(3))
def test_evidence_does_not_change_with_the_axes_origin_and_unit_of_the_world(seed: int) -> None:
    sequence = random_room(seed, cameras=3, people=3)
    boxes = boxes_of(sequence, np.arange(0, 200, 10))
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    scale, shift = rng.uniform(0.01, 100.0), rng.uniform(-5.0, 5.0, 3)
    moved = [
        Pose(pose.rotation @ turn.T, scale * turn @ (pose.centre + shift))
        for pose in poses_of(sequence)
    ]
    rise = scale * turn @ RISE
    floor = scale * float(RISE @ shift / np.linalg.norm(RISE))
    here = evidence(boxes, poses_of(sequence), Scene(RISE, 0.0, 0.03))
    there = evidence(boxes, moved, Scene(rise, floor, 0.03 * scale))
    np.testing.assert_allclose(there.by_moment, here.by_moment, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_the_right_calibration_is_likelier_than_wrong_ones_and_nonsense_has_no_evidence(
    seed: int,
) -> None:
    sequence = random_room(seed, cameras=3, people=3)
    right = evidence_of(seed)
    away = [Pose(-pose.rotation, pose.centre) for pose in poses_of(sequence)]
    assert right.total > 200.0
    assert evidence_of(seed, away).total == 0.0  # everybody is behind every camera
    others = poses_of(sequence)
    others[0], others[1] = others[1], others[0]
    assert 0.0 <= evidence_of(seed, others).total < 0.5 * right.total
    assert 0.0 <= evidence_of(seed, late=40).total < right.total
    parts = sum(right.of_camera(camera).sum() for camera in range(3))
    assert parts == pytest.approx(2.0 * right.total)  # each pair is of two cameras


def test_ratios_are_those_of_the_stated_gaussian() -> None:
    rng = np.random.default_rng(1)
    sigma, height_sigma, scatter = 0.07, 0.12, 0.05
    feet = rng.normal([0.0, 0.4, 1.0], 0.1, (4, 3))
    heads = rng.normal([0.0, -0.1, 1.0], 0.1, (4, 3))
    feet /= np.linalg.norm(feet, axis=1, keepdims=True)
    heads /= np.linalg.norm(heads, axis=1, keepdims=True)
    rotation = Rotation.from_euler("y", 40.0, degrees=True).as_matrix()
    centre, other = np.zeros(3), np.array([2.0, 0.1, 0.3])
    rise, normal, floor = np.array([0.0, -1.7, 0.0]), np.array([0.0, -1.0, 0.0]), -1.5
    seen = rng.normal([0.1, 0.4, 0.1, -0.1], 0.2, (5, 4))
    background = rng.normal(0.0, 1.0, 5)
    background[2] = np.nan
    starts, seen_starts = np.array([0, 3, 3, 4]), np.array([0, 3, 4, 5])
    scene = np.array([*rise, *normal, floor, scatter])
    whole = np.array([True, True, False, True])
    found = density_ratios(feet, heads, whole, starts, centre, seen, background, seen_starts,
                           rotation, other, scene, sigma, height_sigma)  # fmt: skip
    assert np.isnan(found[[2, 3]]).all()  # left out, and at a moment without boxes of camera a

    def predicted(i: int, s: float) -> ndarray:
        points = np.array([s * feet[i], s * feet[i] + rise]) - other
        camera = points @ rotation.T
        return (camera[:, :2] / camera[:, 2:]).ravel()

    expected = np.zeros(5)
    for z, members in ((0, (0, 1, 2)), (1, (0, 1, 2)), (4, (3,))):
        for i in members:
            if not whole[i]:
                continue
            s = minimize_scalar(
                lambda s, i=i: np.linalg.norm(np.cross(heads[i], s * feet[i] + rise)),
                bounds=(0.0, 50.0), method="bounded", options={"xatol": 1e-12},
            ).x  # fmt: skip
            variance = s**2 * (height_sigma**2 + 2.0 * sigma**2)
            slope = float(normal @ feet[i])
            by_floor = (floor - normal @ centre) / slope
            floor_variance = (scatter**2 + (sigma * 1.7) ** 2) / slope**2
            if (s - by_floor) ** 2 < 9.0 * (variance + floor_variance):
                s = (s / variance + by_floor / floor_variance) / (1 / variance + 1 / floor_variance)
                variance = 1.0 / (1.0 / variance + 1.0 / floor_variance)
            mu = predicted(i, s)
            gradient = (predicted(i, s + 1e-6) - predicted(i, s - 1e-6)) / 2e-6
            along = mu[2:] - mu[:2]
            eta = float(np.linalg.norm(along))
            along = along / eta
            across = np.array([-along[1], along[0]])
            rows = np.array([[*across / 2, *across / 2], [*along, 0, 0], [0, 0, *along]])
            noise = np.diag([sigma**2, sigma**2, sigma**2 + height_sigma**2 / 4.0]) * eta**2
            j = rows @ gradient
            density = multivariate_normal(cov=noise + variance * np.outer(j, j))
            expected[z] += density.pdf(rows @ (seen[z] - mu)) / np.exp(background[z]) / len(members)
    np.testing.assert_allclose(found[[0, 1, 4]], expected[[0, 1, 4]], rtol=1e-4, atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_the_explained_share_is_the_likeliest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ratios = np.where(rng.random(50) < 0.6, rng.lognormal(3.0, 1.0, 50), 0.0)
    tried = np.linspace(0.0, 0.999, 2000)
    scores = np.log(1.0 - tried[:, None] + tried[:, None] * ratios).sum(axis=1)
    assert best_share(ratios) == pytest.approx(tried[scores.argmax()], abs=1e-3)
    assert best_share(np.append(ratios, np.nan)) == best_share(ratios)
    assert best_share(0.5 * rng.random(20)) == 0.0


def test_the_floor_is_where_most_feet_are() -> None:
    rng = np.random.default_rng(3)
    feet = np.column_stack([rng.uniform(-3.0, 3.0, (200, 2)), 0.4 + 0.02 * rng.normal(size=200)])
    wrong = rng.uniform(-2.0, 2.0, (100, 3))
    scene = fit_floor(RISE, np.concatenate([feet, wrong]))
    assert scene.floor == pytest.approx(0.4, abs=0.02)
    assert 0.01 < scene.scatter < 0.06


def test_log_odds_need_every_part_of_a_recording() -> None:
    rng = np.random.default_rng(0)
    zero = np.zeros(100)
    steady, once = rng.normal(1.0, 0.3, 100), zero.copy()
    once[:3] = 30.0
    assert log_odds(steady, zero) > 7.0 > 1.0 > log_odds(once, zero) > 0.0
    assert log_odds(zero, steady) == -log_odds(steady, zero)
    assert log_odds(steady, steady) == 0.0
    assert log_odds(0.01 * steady, zero) == pytest.approx(0.01 * steady.sum())  # never above ΔE
