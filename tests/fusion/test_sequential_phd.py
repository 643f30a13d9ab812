"""The published fusion in a synthetic room: it follows people, and says by which box."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.engine.synthetic import CAMERAS, ROOM, crossing, look_at, sequence, views_at, walk
from tracker import trajectories
from tracker.fusion.protocol import FusionResult
from tracker.fusion.sequential_phd import SequentialPhd
from tracker.fusion.target_model import TargetModel
from tracker.parameters import PRESETS, FusionParams, RunParameters, with_values
from tracker.sequences.sequence import Entrance, Room, Sequence
from tracker.trajectories import Trajectories

STEPS = 150
PUBLISHED = with_values(RunParameters(), PRESETS["published"]).fusion


def published(**changes: object) -> FusionParams:
    """The published scheme with some values changed."""
    return PUBLISHED.model_copy(update=changes)


def fuse(whole: Sequence, parameters: FusionParams = PUBLISHED) -> list[FusionResult]:
    """The posterior of every step."""
    method = SequentialPhd(whole, RunParameters(fusion=parameters))
    state, results = method.start(), []
    for frame in range(whole.frames):
        state, result = method.step(state, views_at(whole, frame))
        results.append(result)
    return results


def tracked(whole: Sequence, results: list[FusionResult]) -> Trajectories:
    """The tracks of those posteriors."""
    return trajectories.extract(results, cameras=len(whole.views), extraction_threshold=0.5)


def follow(tracks: Trajectories, path: ndarray, first: int = 0) -> tuple[ndarray, ndarray]:
    """The id nearest to a person at each step, and how far off it is; id 0 where there is none."""
    ids, errors = np.zeros(len(path), dtype=int), np.full(len(path), np.inf)
    for step, place in enumerate(path):
        rows = tracks.at(first + step)
        if tracks.frames[rows].size:
            distances = np.linalg.norm(tracks.positions[rows] - place, axis=1)
            ids[step] = tracks.ids[rows][distances.argmin()]
            errors[step] = distances.min()
    return ids, errors


@pytest.mark.parametrize("cameras", [2, 3])
def test_two_people_are_followed_within_centimetres(cameras: int) -> None:
    people = crossing(STEPS)
    whole = sequence(people, STEPS, CAMERAS[:cameras])
    tracks = tracked(whole, fuse(whole))
    settled = slice(5, None)
    followed = []
    for _, path in people:
        ids, errors = follow(tracks, path)
        assert errors[settled].mean() < 0.03
        assert errors[settled].max() < 0.12
        assert len(set(ids[settled].tolist())) == 1, "the id stays through the crossing"
        followed.append(ids[-1])
    assert followed[0] != followed[1]
    late = tracks.frames >= 5
    assert np.bincount(tracks.frames[late])[5:].tolist() == [2] * (STEPS - 5)
    assert tracks.sigmas[late].max() < 0.1


def test_a_stated_sigma_is_as_large_as_the_error() -> None:
    people = [(0, walk((-1.2, 0.0, 1.0), (-1.2, 0.0, 1.0), 400))]
    whole = sequence(people, 400, pixel_noise=1.5)
    tracks = tracked(whole, fuse(whole, published(motion_sigma=0.2)))
    rows = tracks.frames > 20
    normalised = (tracks.positions[rows] - people[0][1][0]) / tracks.sigmas[rows]
    assert 0.3 < (normalised**2).mean() < 1.5


def test_clutter_alone_makes_no_tracks() -> None:
    whole = sequence([], STEPS, clutter_rate=2.0, seed=4)
    boxes = sum(len(view.detections.frames) for view in whole.views if view.detections)
    assert boxes > 800
    assert len(tracked(whole, fuse(whole, published(clutter_rate=2.0)))) == 0


def test_who_is_hidden_in_the_first_camera_lives_on_through_the_others() -> None:
    people, hiding = crossing(STEPS), range(40, 100)
    whole = sequence(people, STEPS, hidden=[(0, 0, hiding)])
    tracks = tracked(whole, fuse(whole))
    ids, errors = follow(tracks, people[0][1])
    assert len(set(ids[5:].tolist())) == 1
    assert errors[5:].max() < 0.12
    for frame in hiding:
        rows = tracks.at(frame)
        own = tracks.ids[rows] == ids[-1]
        assert_array_equal(tracks.seen[rows][own], [[False, True, True]])


def test_who_is_hidden_in_the_last_camera_comes_back_with_the_same_id() -> None:
    # the plain recursion forgets at a camera's miss what the cameras before it saw:
    # a weight of about 1 - p_D is left, too little to be reported, enough to come back
    people, hiding = crossing(STEPS), range(40, 100)
    whole = sequence(people, STEPS, hidden=[(2, 0, hiding)])
    results = fuse(whole)
    tracks = tracked(whole, results)
    ids, errors = follow(tracks, people[0][1])
    shown = errors < 0.12
    assert not shown[40:100].any()
    assert shown[5:40].all()
    assert shown[100:].all()
    assert len(set(ids[5:40].tolist() + ids[100:].tolist())) == 1
    label = int(tracks.labels[tracks.ids == ids[-1]][0])
    for frame in hiding:
        posterior = results[frame].posterior
        own = posterior.labels == label
        assert 0.005 < posterior.weights[own].sum() < 0.1
        heaviest = posterior.means[own][posterior.weights[own].argmax()]
        assert np.linalg.norm(heaviest - people[0][1][frame]) < 0.12


def test_a_miss_judged_per_person_asks_for_no_order_of_the_cameras() -> None:
    people, hiding = crossing(STEPS), range(40, 100)
    for camera in range(3):
        whole = sequence(people, STEPS, hidden=[(camera, 0, hiding)])
        tracks = tracked(whole, fuse(whole, published(misses="per_person")))
        ids, errors = follow(tracks, people[0][1])
        assert len(set(ids[5:].tolist())) == 1
        assert errors[5:].max() < 0.12


def test_a_camera_that_looks_elsewhere_has_no_say() -> None:
    people = crossing(60)
    away = look_at("away", (-3.4, -3.2, 2.6), (-9.0, -9.0, 1.0))
    with_it = sequence(people, 60, (*CAMERAS[:2], away))
    without = sequence(people, 60, CAMERAS[:2])
    for ours, reference in zip(fuse(with_it), fuse(without), strict=True):
        assert not ours.detection_probabilities[2].any()
        assert (ours.sources[2] == -1).all()
        assert_allclose(ours.posterior.weights, reference.posterior.weights, rtol=1e-6)
        assert_allclose(ours.posterior.means, reference.posterior.means, atol=1e-6)


def test_outside_the_picture_a_weight_is_left_alone() -> None:
    # the person walks out of the last camera's picture but stays in the others'
    narrow = look_at("narrow", (-1.2, -4.0, 1.0), (-1.2, 0.0, 1.0), focal=900.0)
    path = walk((-1.2, 0.0, 1.0), (1.1, 0.3, 1.0), 100)
    whole = sequence([(0, path)], 100, (*CAMERAS[1:], narrow))
    results = fuse(whole)
    tracks = tracked(whole, results)
    inside = narrow.sees(path)
    assert inside[:20].all()
    assert not inside[50:].any()
    for frame in range(50, 100):
        rows = tracks.at(frame)
        component = tracks.components[rows]
        assert len(component) == 1
        assert results[frame].detection_probabilities[2, component] < 1e-6
        assert_array_equal(tracks.seen[rows], [[True, True, False]])


def test_the_evidence_points_at_the_box_of_the_person() -> None:
    people = crossing(STEPS)
    whole = sequence(people, STEPS, clutter_rate=1.0, hidden=[(1, 1, range(60, 80))], seed=3)
    results = fuse(whole, published(clutter_rate=1.0))
    tracks = tracked(whole, results)
    told = 0
    for frame in range(10, STEPS):
        views, result = views_at(whole, frame), results[frame]
        size = result.posterior.size
        for name in ("detection_probabilities", "sources", "source_weights", "hidden_by"):
            assert getattr(result, name).shape == (3, size)
        assert ((result.source_weights >= 0.0) & (result.source_weights <= 1.0 + 1e-12)).all()
        assert not result.source_weights[result.sources < 0].any()
        for component in tracks.components[tracks.at(frame)]:
            place = result.posterior.means[component]
            for number, camera in enumerate(CAMERAS):
                source = int(result.sources[number, component])
                if source < 0:
                    continue
                pixel = camera.project(place[None, :3])[0][0]
                assert np.linalg.norm(views[number].boxes[source, :2] - pixel) < 8.0
                told += 1
    assert told > 0.95 * (3 * 2 * (STEPS - 10) - 20)


def test_two_people_born_at_one_entrance_get_two_ids() -> None:
    first = walk((-1.2, 0.0, 1.0), (1.0, 0.9, 1.0), 100)
    second = walk((-1.2, 0.0, 1.05), (1.0, -0.9, 1.0), 100)
    whole = sequence([(0, first), (30, second)], 130)
    tracks = tracked(whole, fuse(whole))
    ids_first, errors_first = follow(tracks, first)
    ids_second, errors_second = follow(tracks, second, first=30)
    assert len(set(ids_first[5:].tolist())) == len(set(ids_second[5:].tolist())) == 1
    assert ids_first[50] != ids_second[50]
    assert max(errors_first[5:].max(), errors_second[5:].max()) < 0.12


def test_two_people_who_come_in_together_end_as_two_tracks() -> None:
    left = walk((-1.2, 0.03, 1.0), (1.0, 1.2, 1.0), STEPS)
    right = walk((-1.2, -0.03, 1.0), (1.0, -1.2, 1.0), STEPS)
    whole = sequence([(0, left), (0, right)], STEPS)
    results = fuse(whole)
    tracks = tracked(whole, results)
    assert results[3].posterior.cardinality == pytest.approx(2.0, abs=0.3)
    ids_left, errors_left = follow(tracks, left)
    ids_right, errors_right = follow(tracks, right)
    late = slice(60, None)
    assert len(set(ids_left[late].tolist())) == len(set(ids_right[late].tolist())) == 1
    assert ids_left[-1] != ids_right[-1]
    assert max(errors_left[late].max(), errors_right[late].max()) < 0.12


def test_nobody_looks_so_the_weights_decay_by_survival_alone() -> None:
    people = crossing(60)
    whole = sequence(people, 60, CAMERAS[:2])
    method = SequentialPhd(whole, RunParameters(fusion=published(birth_rate=1e-4)))
    state = method.start()
    for frame in range(40):
        state, _ = method.step(state, views_at(whole, frame))
    before = state.mixture.cardinality
    # the same room, but both cameras are turned away
    away = look_at("away", (-3.4, -3.2, 2.6), (-9.0, -9.0, 1.0))
    blind = SequentialPhd(
        sequence([], 60, (away, away)), RunParameters(fusion=published(birth_rate=1e-4))
    )
    for _ in range(10):
        state, result = blind.step(state, views_at(sequence([], 1, (away, away)), 0))
        assert not result.detection_probabilities.any()
    births = 10 * 2 * 1e-4 / 25.0
    expected = before * PUBLISHED.survival_probability**10
    assert state.mixture.cardinality == pytest.approx(expected, abs=2 * births + 1e-3)


def test_no_boxes_mean_nobody_after_a_few_steps() -> None:
    people = [(0, path[:40]) for _, path in crossing(80)]
    whole = sequence(people, 60)
    results = fuse(whole)
    assert tracked(whole, results).frames.max() == 39, "who leaves is gone at once"
    assert results[-1].posterior.cardinality < 0.05


def test_no_boxes_at_all_from_the_first_step() -> None:
    whole = sequence([], 5)
    results = fuse(whole)
    assert len(tracked(whole, results)) == 0
    assert all(np.isfinite(result.posterior.weights).all() for result in results)


def test_the_room_of_the_tests_is_seen_by_all_its_cameras() -> None:
    corners = np.array(np.meshgrid(*np.array([ROOM.minimum, ROOM.maximum]).T)).reshape(3, -1).T
    middle = corners * [0.8, 0.8, 0.0] + [0.0, 0.0, 1.0]
    assert all(camera.sees(middle).all() for camera in CAMERAS)


def test_a_person_hides_another_once() -> None:
    front = look_at("front", (0.0, -4.0, 1.0), (0.0, 0.0, 1.0))
    near, far = np.array([-0.05, -0.6, 1.0]), np.array([0.03, 0.6, 1.0])
    whole = sequence(
        [(0, np.tile(near, (60, 1))), (0, np.tile(far, (60, 1)))],
        60,
        (*CAMERAS[1:], front),
        pixel_noise=0.0,
        room=Room(
            ROOM.minimum,
            ROOM.maximum,
            tuple(Entrance(place, np.full(3, 0.25)) for place in (near, far)),
        ),
    )
    parameters = published(
        occlusion=0.5, duplicate_distance=0.1, pruning_threshold=1e-8, misses="per_person"
    )
    model = TargetModel(whole.target_half_extents, "centre")
    behind, before = (model.expected(front, place[None]).boxes[0] for place in (far, near))
    overlap = np.minimum(behind[2:], before[2:]) - np.maximum(behind[:2], before[:2])
    share = overlap.clip(0.0).prod() / (behind[2:] - behind[:2]).prod()
    assert 0.5 < share < 0.9
    results = fuse(whole, parameters)
    tracks = tracked(whole, results)
    for frame in range(10, 60):
        result, rows = results[frame], tracks.at(frame)
        order = np.argsort(tracks.positions[rows][:, 1])  # the near one, the far one
        components, labels = tracks.components[rows][order], tracks.labels[rows][order]
        probability = result.detection_probabilities[2, components]
        assert probability[0] == pytest.approx(0.98, abs=1e-6)
        assert probability[1] == pytest.approx(0.98 * (1.0 - 0.5 * share), abs=0.04)
        assert_array_equal(result.hidden_by[2, components], [-1, labels[0]])
        assert_array_equal(result.hidden_by[:2, components], -1)
