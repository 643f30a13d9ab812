"""The likelihood of boxes by other cameras' boxes: invariances, and where it is zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from scipy.spatial.transform import Rotation

from tests import world
from tests.random_rooms import random_room
from tracker.geometry.consistency import consensus, sliding
from tracker.geometry.consistency.likelihood import (
    Evidence,
    Moments,
    Scene,
    at_moments,
    evidence,
    fit_floor,
    on_image_plane,
)
from tracker.geometry.consistency.observed import (
    PairsOfBoxes,
    Pose,
    Rays,
    pose_of,
    rays_of,
    uncut,
    upright_rays,
)
from tracker.geometry.consistency.odds import log_odds
from tracker.geometry.consistency.sliding import link_boxes
from tracker.geometry.consistency.standing import ends, turn_of
from tracker.geometry.consistency.suggestion import consensus_of_cameras
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


@pytest.mark.parametrize("there", [True, False])
def test_a_camera_without_boxes_has_no_part_in_the_evidence(there: bool) -> None:
    sequence = random_room(0, cameras=3, people=3)
    boxes, poses = boxes_of(sequence, np.arange(0, 200, 10)), poses_of(sequence)
    two = evidence(boxes[:2], poses[:2], Scene(RISE, 0.0, 0.03))
    empty = boxes_of(sequence, np.full(20, 10**6))[2]  # no step of the recording
    found = evidence([*boxes[:2], empty if there else None], poses, Scene(RISE, 0.0, 0.03))
    assert found.cameras == 2
    np.testing.assert_array_equal(found.by_moment, two.by_moment)


def test_pairs_of_cameras_that_are_not_compared_have_no_part() -> None:
    sequence = random_room(0, cameras=3, people=3)
    boxes, poses = boxes_of(sequence, np.arange(0, 200, 10)), poses_of(sequence)
    among = np.zeros((3, 3), dtype=bool)
    among[0, 2] = among[1, 1] = True
    every = evidence(boxes, poses, Scene(RISE, 0.0, 0.03))
    found = evidence(boxes, poses, Scene(RISE, 0.0, 0.03), among=among)
    assert list(found.terms) == [(0, 2)]
    np.testing.assert_array_equal(found.terms[0, 2], every.terms[0, 2])


def test_the_floor_is_where_most_feet_are() -> None:
    rng = np.random.default_rng(3)
    feet = np.column_stack([rng.uniform(-3.0, 3.0, (200, 2)), 0.4 + 0.02 * rng.normal(size=200)])
    wrong = rng.uniform(-2.0, 2.0, (100, 3))
    scene = fit_floor(RISE, np.concatenate([feet, wrong]))
    assert scene.floor == pytest.approx(0.4, abs=0.02)
    assert 0.01 < scene.scatter < 0.06


def test_the_floor_is_between_two_feet() -> None:
    scene = fit_floor(RISE, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1]]))
    assert scene.floor == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("box", "whole"),
    [
        ((1.5, 100.0, 30.0, 90.0), False),  # at the edge's own width
        ((1.6, 100.0, 30.0, 90.0), True),
        ((100.0, 1.5, 30.0, 90.0), False),
        ((607.5, 100.0, 30.0, 90.0), False),
        ((607.4, 100.0, 30.0, 90.0), True),
        ((100.0, 387.5, 30.0, 90.0), False),
        ((100.0, 100.0, 0.0, 90.0), False),
        ((100.0, 100.0, 30.0, 0.0), False),
        ((100.0, 100.0, np.nan, 90.0), False),
    ],
)
def test_a_box_is_whole_where_it_has_a_size_and_ends_before_the_edge(
    box: tuple[float, ...], whole: bool
) -> None:
    assert uncut(np.array([box]), (640, 480)).tolist() == [whole]
    at_the_edge = box[2] > 0.0 and box[3] > 0.0
    assert uncut(np.array([box]), None).tolist() == [at_the_edge]
    camera = world.ring(4)[0]
    rays = rays_of(np.zeros(1), np.array([box]), replace(camera, image_size=(640, 480)))
    assert rays.whole.tolist() == [whole]


@pytest.mark.parametrize(
    ("up", "size", "length"),
    [
        ((0.0, -1.0), (40.0, 100.0), 100.0),
        ((1.0, 0.0), (100.0, 40.0), 100.0),
        # a diagonal one has an unknown breadth: T = 0.4 L, and w² = h² = (L² + T²) / 2
        ((0.5**0.5, -(0.5**0.5)), (100.0, 100.0), 100.0 * (2.0 / 1.16) ** 0.5),
    ],
)
def test_how_long_a_person_is_in_a_rolled_picture(
    up: tuple[float, float], size: tuple[float, float], length: float
) -> None:
    focal = 2000.0
    camera = world.look_at("level", (0.0, -4.0, 1.0), (0.0, 0.0, 1.0), focal=focal)
    box = np.array([[639.5 - size[0] / 2.0, 399.5 - size[1] / 2.0, *size]])
    for lens in (
        camera,
        replace(camera, translation=np.zeros(3)),  # the pose has no effect
        replace(camera, rotation=np.eye(3)),
    ):
        heads, feet, good = ends(box, lens, np.array([*up, 0.0]))
        assert good.all()
        across = focal * (heads[0] / heads[0, 2] - feet[0] / feet[0, 2])[:2]
        np.testing.assert_allclose(across, length * np.array(up), atol=0.5)


def test_a_box_seen_from_straight_above_shows_neither_head_nor_foot() -> None:
    camera = world.look_at("above", (0.0, 0.0, 4.0), (0.0, 0.01, 0.0))
    middle = np.array(camera.image_size) / 2.0 - 40.0
    boxes = np.array([[*middle, 80.0, 80.0], [100.0, 100.0, 80.0, 80.0]])
    assert upright_rays(np.zeros(2), boxes, camera).whole.tolist() == [False, True]
    assert rays_of(np.zeros(2), boxes, camera).whole.all()


@pytest.mark.parametrize(
    ("target", "change", "expected"),
    [
        ((0.0, -4.0, 2.0), "", True),
        ((0.0, -4.0, 10.25), "", False),  # the foot is below the picture
        ((0.0, -4.0, -9.2), "", False),  # the head is above it
        ((0.0, -4.0, 2.0), "clipped", False),
        ((0.0, -4.0, 2.0), "head below foot", False),
        ((0.0, -4.0, 2.0), "both up", False),
        ((0.0, -4.0, 2.0), "both down", False),
    ],
)
def test_a_box_is_expected_in_another_picture_where_head_and_foot_lie_ahead_and_in_it(
    target: tuple[float, float, float], change: str, expected: bool
) -> None:
    """The other camera is far aside, and has what is before and behind the first one."""
    place = np.array([[0.0, 0.0, 0.85]])
    camera = world.look_at("one", (0.0, -4.0, 2.0), (0.0, 0.0, 1.0))
    other = world.look_at("other", (15.0, -4.0, 2.0), target)
    x, y, half_width, half_height = world.upright(camera, place)[0]
    box = np.array([[x - half_width, y - half_height, 2.0 * half_width, 2.0 * half_height]])
    rays = upright_rays(np.zeros(1, dtype=int), box, camera)
    heads, feet, whole = rays.heads, rays.feet, rays.whole
    if change == "head below foot":
        heads, feet = feet, heads
    elif change == "clipped":
        whole = ~whole
    elif change:  # to either side, at the same height
        up = 0.3 if change == "both up" else -0.3
        heads, feet = (
            np.array([[side, 0.9, up]]) / np.linalg.norm([side, 0.9, up]) @ camera.rotation.T
            for side in (0.2, -0.2)
        )
    linked = link_boxes(camera, replace(rays, heads=heads, feet=feet, whole=whole), box, 1)
    found, _ = sliding._predicted_boxes(other, linked, np.zeros(1, dtype=int), 1.7)
    assert np.isfinite(found).all() == expected
    if expected:
        there = other.project(place + np.array([[0.0, 0.0, 0.85], [0.0, 0.0, -0.85]]))[0]
        np.testing.assert_allclose(found[0], there.ravel(), atol=5.0)


def test_a_box_is_compared_where_it_is_whole_ahead_and_shows_two_directions() -> None:
    boxes = np.array(
        [[100.0, 100.0, 30.0, 90.0], [200.0, 120.0, 35.0, 80.0]] + 4 * [[300.0, 90.0, 30.0, 90.0]]
    )
    boxes[2, 2:] = 1e-20  # head and foot are the same to the last bit
    rays = upright_rays(np.arange(6), boxes, world.ring(4)[0])
    assert rays.whole.all()
    rays.whole[3] = False
    rays.heads[4] *= -1.0
    rays.feet[5] *= -1.0
    _, background = on_image_plane(rays)
    assert np.isfinite(background).tolist() == [True, True] + 4 * [False]
    np.testing.assert_array_equal(background[:2], on_image_plane(rays.take(np.arange(2)))[1])


@pytest.mark.parametrize(
    ("up", "side"),
    [
        ((0.0, -1.0, 0.0), 0), ((1.0, 0.0, 0.0), 1), ((0.0, 1.0, 0.0), 2), ((-1.0, 0.0, 0.0), 3),
        ((0.0, 0.0, 1.0), 0), ((0.6, -0.6, 0.5), 0), ((0.6, 0.6, 0.5), 2),
    ],
)  # fmt: skip
def test_a_head_is_at_the_side_that_is_up_and_at_the_top_where_two_are_alike(
    up: tuple[float, float, float], side: int
) -> None:
    assert turn_of(np.array(up)) == side


@pytest.mark.parametrize(
    ("moved", "following"),
    [
        ([49.0], [0]),
        ([50.0], [None]),  # by half its height
        ([10.0, 20.0], [0]),  # the nearer one
        ([], [None]),
    ],
)
def test_a_box_goes_on_as_the_nearest_one_within_half_its_height(
    moved: list[float], following: list[int | None]
) -> None:
    boxes = np.array([[100.0 + x, 100.0, 40.0, 100.0] for x in (0.0, *moved)])
    frames = np.array([0, *(1 for _ in moved)])
    camera = world.ring(4)[0]
    linked = link_boxes(camera, upright_rays(frames, boxes, camera), boxes, 3)
    nothing = [-1] * len(moved)
    assert linked.following.tolist() == [-1 if k is None else k + 1 for k in following] + nothing


def test_a_box_that_another_one_is_nearer_to_does_not_go_on() -> None:
    boxes = np.array([[100.0 + x, 100.0, 40.0, 100.0] for x in (0.0, 30.0, 25.0)])
    frames = np.array([0, 0, 1])
    camera = world.ring(4)[0]
    linked = link_boxes(camera, upright_rays(frames, boxes, camera), boxes, 2)
    assert linked.following.tolist() == [-1, 2, -1]


def test_log_odds_need_every_part_of_a_recording() -> None:
    rng = np.random.default_rng(0)
    zero = np.zeros(100)
    steady, once = rng.normal(1.0, 0.3, 100), zero.copy()
    once[:3] = 30.0
    assert log_odds(steady, zero) > 7.0 > 1.0 > log_odds(once, zero) > 0.0
    assert log_odds(zero, steady) == -log_odds(steady, zero)
    assert log_odds(steady, steady) == 0.0
    assert log_odds(steady, steady[::-1]) == pytest.approx(0.0, abs=1e-6)
    assert log_odds(zero[:2] + 9.0, zero[:2]) == 0.0  # of two moments nothing follows
    assert log_odds(zero + 1.0, zero) == 100.0  # each part alike
    # mean 2 and spread 1 of three parts: z² = 12, and 3/2 ln(1 + 12/2)
    assert log_odds(np.array([1.0, 2.0, 3.0]), np.zeros(3)) == pytest.approx(1.5 * np.log(7.0))
    assert log_odds(0.01 * steady, zero) == pytest.approx(0.01 * steady.sum())  # never above ΔE


def test_two_boxes_are_one_person_s_where_their_rays_meet_and_both_show_the_height() -> None:
    one, beside, above = (Pose(np.eye(3), np.array(c)) for c in ([0, 0, 1], [3, 0, 1], [1, 2.5, 9]))
    foot, head = np.array([1.0, 3.0, 0.0]), np.array([1.0, 3.0, 1.7])

    def rays(pose: Pose, ends: list[tuple[ndarray, ndarray]]) -> Rays:
        ways = np.array(ends) - pose.centre
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        count = len(ends)
        return Rays(np.zeros(count), ways[:, 0], ways[:, 1], np.ones(count, dtype=bool))

    behind = 2.0 * beside.centre - head, 2.0 * beside.centre - foot
    higher = np.array([0.0, 0.0, 0.5])
    ends = [(head, foot), (behind[0], foot), (head, behind[1]), (head + higher, foot + higher),
            (head + higher, foot)]  # fmt: skip
    pairs = PairsOfBoxes(np.zeros(5, dtype=int), np.arange(5), 5)
    found = consensus.triangulate_pairs(
        pairs, rays(one, [(head, foot)]), rays(beside, ends), one, beside
    )
    assert found.pairs.tolist() == [0]
    np.testing.assert_allclose(found.feet, [foot], atol=1e-12)
    np.testing.assert_allclose(found.rises, [head - foot], atol=1e-12)
    single = PairsOfBoxes(np.zeros(1, dtype=int), np.zeros(1, dtype=int), 1)
    steep = rays(above, [(head, foot)])  # nearly along the person
    found = consensus.triangulate_pairs(single, rays(one, [(head, foot)]), steep, one, above)
    assert not len(found.pairs)


@pytest.mark.parametrize("clipped", [0, 1])
def test_boxes_that_are_clipped_have_no_pairs(clipped: int) -> None:
    sequence = random_room(0, cameras=2, people=3)
    rays = [
        upright_rays(v.detections.frames, v.detections.boxes, v.camera)
        for v in sequence.views
        if v.detections is not None
    ]
    assert consensus_of_cameras(sequence.cameras, rays).agreeing > 100
    none = np.zeros(len(rays[clipped].frames), dtype=bool)
    rays[clipped] = replace(rays[clipped], whole=none)
    assert consensus_of_cameras(sequence.cameras, rays).agreeing == 0


def test_a_pair_of_boxes_counts_where_no_other_pair_of_either_is_closer() -> None:
    """Box 1 of the second camera is closest to a box that is closer to another: it has no pair."""
    first, second = np.array([0, 0, 1, 2]), np.array([1, 0, 1, 2])
    kept = consensus._one_to_one(first, second, np.array([0.2, 0.1, 0.3, 0.4]))
    assert kept.tolist() == [1, 3]


def test_a_depth_is_known_in_front_of_both_cameras_and_by_rays_that_are_not_parallel() -> None:
    base, there = np.array([2.0, 0.0, 0.0]), np.array([1.0, 3.0, 0.5])
    meeting, parallel = there / np.linalg.norm(there), np.array([0.0, 1.0, 0.0])
    back = (there - base) / np.linalg.norm(there - base)
    x, y = np.eye(3)[:2]
    one = np.array([meeting, -meeting, meeting, -meeting, parallel, y, x])
    other = np.array([back, back, -back, -back, parallel, -x, y])  # the last two meet at a camera
    middle, along_one, along_other, gaps, ahead = consensus._between(base, one, other)
    assert ahead.tolist() == [True] + 6 * [False]
    np.testing.assert_allclose(middle[:4], [there] * 4)
    np.testing.assert_allclose(np.abs(along_one[:4]), np.linalg.norm(there))
    np.testing.assert_allclose(np.abs(along_other[:4]), np.linalg.norm(there - base))
    np.testing.assert_allclose(gaps[:4], 0.0, atol=1e-12)
