"""The likelihood of boxes by other cameras' boxes: invariances, and where it is zero."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from scipy.spatial.transform import Rotation

from tests.random_rooms import random_room
from tracker.geometry.consistency import consensus
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
    assert log_odds(zero + 1.0, zero) == 100.0  # each part alike
    # mean 2 and spread 1 of three parts: z² = 12, and 3/2 ln(1 + 12/2)
    assert log_odds(np.array([1.0, 2.0, 3.0]), np.zeros(3)) == pytest.approx(1.5 * np.log(7.0))
    assert log_odds(0.01 * steady, zero) == pytest.approx(0.01 * steady.sum())  # never above ΔE


def test_a_pair_of_boxes_counts_where_no_other_pair_of_either_is_closer() -> None:
    """Box 1 of the second camera is closest to a box that is closer to another: it has no pair."""
    first, second = np.array([0, 0, 1, 2]), np.array([1, 0, 1, 2])
    kept = consensus._one_to_one(first, second, np.array([0.2, 0.1, 0.3, 0.4]))
    assert kept.tolist() == [1, 3]


def test_a_depth_is_known_in_front_of_both_cameras_and_by_rays_that_are_not_parallel() -> None:
    base, there = np.array([2.0, 0.0, 0.0]), np.array([1.0, 3.0, 0.5])
    meeting, parallel = there / np.linalg.norm(there), np.array([0.0, 1.0, 0.0])
    back = (there - base) / np.linalg.norm(there - base)
    one = np.array([meeting, -meeting, meeting, -meeting, parallel])
    other = np.array([back, back, -back, -back, parallel])
    middle, along_one, along_other, gaps, ahead = consensus._between(base, one, other)
    assert ahead.tolist() == [True, False, False, False, False]
    np.testing.assert_allclose(middle[:4], [there] * 4)
    np.testing.assert_allclose(np.abs(along_one[:4]), np.linalg.norm(there))
    np.testing.assert_allclose(np.abs(along_other[:4]), np.linalg.norm(there - base))
    np.testing.assert_allclose(gaps[:4], 0.0, atol=1e-12)
