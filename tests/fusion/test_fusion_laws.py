"""What holds for both fusion methods: pure steps, bounded states, evidence that adds up."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.engine.standing import (
    CAMERAS,
    METHODS,
    RECOMMENDED,
    Method,
    empty_room,
    fuse,
    ids_of,
    line,
    watch,
)
from tracker.fusion.protocol import FusionResult
from tracker.parameters import RunParameters
from tracker.single_view.protocol import ViewResult

both_methods = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__)

NO_BOXES = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))


def three_people(steps: int = 60) -> ndarray:
    """Walking about, half a metre apart where they pass: (steps, 3, 3)."""
    seconds = steps / 10.0
    paths = [
        line([(-1.8, -1.8), (-0.5, 0.4), (-1.2, 1.0)], [0, seconds / 2, seconds], 10.0),
        line([(1.5, -1.5), (1.0, 1.2)], [0, seconds], 10.0),
        line([(0.0, 1.5), (0.3, -1.2)], [0, seconds], 10.0),
    ]
    return np.stack(paths, axis=1)


@both_methods
def test_people_are_followed_within_decimetres(method: Method) -> None:
    places = three_people()
    results, tracks = fuse(method, watch(places, seed=1))
    assert len({int(ids_of(tracks, places[:, person])[-1]) for person in range(3)}) == 3
    for person in range(3):
        ids = ids_of(tracks, places[:, person], reach=0.3)[12:]
        assert len(set(ids.tolist())) == 1
        assert ids[0] > 0
    errors = [
        np.linalg.norm(places[frame] - place, axis=1).min()
        for frame, place in zip(tracks.frames, tracks.positions, strict=True)
        if frame >= 12
    ]
    assert np.mean(errors) < 0.06
    assert len(results) == len(places)


@both_methods
def test_every_step_tells_what_made_it(method: Method) -> None:
    places = three_people()
    views = watch(places, seed=2, clutter_rate=1.0)
    results, tracks = fuse(method, views)
    told = 0
    for frame, result in enumerate(results):
        size = result.posterior.size
        for name in ("detection_probabilities", "sources", "source_weights", "hidden_by"):
            assert getattr(result, name).shape == (4, size)
        chances = result.detection_probabilities
        assert ((chances >= 0.0) & (chances <= RECOMMENDED.detection_probability)).all()
        assert ((result.source_weights >= 0.0) & (result.source_weights <= 1.0 + 1e-9)).all()
        assert not result.source_weights[result.sources < 0].any()
        said = result.associations
        assert (said.probabilities >= 0.0099).all()
        assert (said.components < size).all()
        for camera in range(4):
            count = len(views[frame][camera].boxes)
            own = said.cameras == camera
            assert (said.boxes[own] < count).all()
            # a box is at most one person's, and a person makes at most one box
            of_box = np.bincount(said.boxes[own], said.probabilities[own], count)
            of_person = np.bincount(said.components[own], said.probabilities[own], size)
            assert of_box.max(initial=0.0) < 1.01
            assert of_person.max(initial=0.0) < 1.01
        for component in tracks.components[tracks.at(frame)]:
            for camera in np.flatnonzero(result.sources[:, component] >= 0):
                pair = (said.cameras == camera) & (said.components == component)
                told += bool(pair.any())
    assert told > 500, "sources are among the associations"


@both_methods
def test_who_is_hidden_is_told_by_whom(method: Method) -> None:
    near, far = (1.2, 0.15, 0.85), (-1.0, -0.05, 0.85)
    places = np.tile([near, far], (30, 1, 1))
    views = watch(
        places, hidden=lambda camera, person, step: camera == 0 and person == 1, miss_rate=0.0
    )
    results, tracks = fuse(method, views)
    rows = tracks.at(29)
    order = np.argsort(-tracks.positions[rows][:, 0])
    components, labels = tracks.components[rows][order], tracks.labels[rows][order]
    assert len(components) == 2
    chances = results[29].detection_probabilities[:, components]
    assert chances[0, 1] < 0.55, "the one behind is hardly detected by the first camera"
    assert chances[0, 0] > 0.94
    assert_array_equal(results[29].hidden_by[0, components], [-1, labels[0]])
    assert_allclose(chances[[1, 3]], 0.95, atol=0.01)


@both_methods
def test_a_step_is_pure_and_repeatable(method: Method) -> None:
    views = watch(three_people(30), seed=3, clutter_rate=2.0)
    fusion = method(empty_room(10.0, frames=30), RunParameters(fusion=RECOMMENDED))
    state = fusion.start()
    for step in views[:20]:
        state, _ = fusion.step(state, step)
    once, first = fusion.step(state, views[20])
    twice, second = fusion.step(state, views[20])
    assert_array_equal(first.posterior.means, second.posterior.means)
    assert_array_equal(first.posterior.weights, second.posterior.weights)
    assert once.next_label == twice.next_label


@both_methods
@pytest.mark.parametrize("birth", ["entrances", "measurements", "both"])
@pytest.mark.parametrize(
    "changes",
    [
        {"detection_probability": 1.0, "survival_probability": 1.0, "gate_probability": 1.0},
        {"detection_probability": 0.05, "merging_threshold": 0.0, "occlusion": 1.0},
        {"measurement": "centre", "motion": "random_walk", "max_components": 5},
        {"measurement": "box_and_width", "update": "unscented", "edge": "hard", "memory": 0.0},
        {"clutter_rate": 0.001, "birth_rate": 10.0, "pruning_threshold": 0.1},
    ],
    ids=["certain", "blind", "published", "bent", "eager"],
)
def test_the_ends_of_the_ranges_give_no_nonsense(
    method: Method, birth: str, changes: dict[str, object]
) -> None:
    parameters = RECOMMENDED.model_copy(update={"birth": birth, **changes})
    views = watch(three_people(25), seed=4, clutter_rate=2.0)
    views[10:13] = [(NO_BOXES,) * 4] * 3
    for result in fuse(method, views, parameters=parameters)[0]:
        posterior = result.posterior
        assert np.isfinite(posterior.weights).all()
        assert np.isfinite(posterior.means).all()
        assert (posterior.weights >= 0.0).all()
        assert posterior.cardinality < 30.0
        assert posterior.size <= parameters.max_components + 20
        if posterior.size:
            assert np.linalg.eigvalsh(posterior.covariances).min() > 0.0


@both_methods
def test_without_boxes_there_is_nobody(method: Method) -> None:
    results, tracks = fuse(method, [(NO_BOXES,) * 4] * 8)
    assert len(tracks) == 0
    assert all(result.posterior.cardinality < 0.2 for result in results)


@both_methods
def test_clutter_alone_is_hardly_ever_somebody(method: Method) -> None:
    nobody = np.full((150, 1, 3), np.nan)
    _, tracks = fuse(method, watch(nobody, clutter_rate=3.0, seed=5))
    assert len(tracks) <= 8


@both_methods
def test_a_camera_that_fails_and_comes_back_loses_nobody(method: Method) -> None:
    places = three_people(80)
    for dead in range(4):
        views = watch(places, seed=6)
        for step in range(25, 50):
            views[step] = tuple(NO_BOXES if c == dead else v for c, v in enumerate(views[step]))
        _, tracks = fuse(method, views)
        found = [ids_of(tracks, places[:, person], 0.4)[12:] for person in range(3)]
        assert all((ids > 0).mean() > 0.97 for ids in found)
        assert len({int(ids[-1]) for ids in found}) == 3
        assert all(ids[-1] == ids[5] for ids in found)


@both_methods
def test_people_outside_the_room_are_followed_and_not_reported(method: Method) -> None:
    places = np.tile([[2.5, 0.3, 0.85], [-0.5, -0.5, 0.85]], (30, 1, 1))
    results, tracks = fuse(method, watch(places, seed=7))
    rows = tracks.at(29)
    assert len(tracks.ids[rows]) == 1
    assert_allclose(tracks.positions[rows][0], [-0.5, -0.5, 0.85], atol=0.15)
    posterior = results[29].posterior
    beyond = np.linalg.norm(posterior.means[:, :3] - places[0, 0], axis=1) < 0.3
    assert posterior.weights[beyond].max() > 0.9


def bytes_held(method: Method, steps: int, *, before: int = 0) -> list[int]:
    """Memory held by a filter that walks on and on, measured ten times.

    What it took in the steps ``before`` is not counted: counting takes five times as long as the
    steps themselves, and what grows does so at the end as well.
    """
    views = watch(three_people(100), seed=8, clutter_rate=1.0)
    fusion = method(empty_room(10.0), RunParameters(fusion=RECOMMENDED))
    state, held = fusion.start(), []
    result: FusionResult | None = None
    for step in range(before):
        state, result = fusion.step(state, views[step % len(views)])
    tracemalloc.start()
    for step in range(before, before + steps):
        state, result = fusion.step(state, views[step % len(views)])
        if (step + 1 - before) % (steps // 10) == 0:
            held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert result is not None
    return held


@both_methods
def test_memory_is_flat(method: Method) -> None:
    held = bytes_held(method, 400)
    assert held[-1] < max(held[1:5]) + 100_000


@pytest.mark.long
@both_methods
def test_memory_is_flat_over_ten_thousand_steps(method: Method) -> None:
    held = bytes_held(method, 2_500, before=7_500)
    assert max(held[5:]) < max(held[:5]) + 25_000


@both_methods
def test_the_cameras_may_come_in_any_order(method: Method) -> None:
    places, order = three_people(), [2, 0, 3, 1]
    views = watch(places, seed=9)
    _, plain = fuse(method, views)
    cameras = [CAMERAS[c] for c in order]
    _, mixed = fuse(method, [tuple(step[c] for c in order) for step in views], cameras=cameras)
    for person in range(3):
        for tracks in (plain, mixed):
            ids = ids_of(tracks, places[:, person], 0.3)[12:]
            assert len(set(ids.tolist())) == 1
