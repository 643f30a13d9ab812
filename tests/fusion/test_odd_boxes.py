"""What a recording may bring: no doors, one camera, nothing for long, crowds of false boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.standing import (
    CAMERAS,
    METHODS,
    RECOMMENDED,
    ROOM,
    Method,
    empty_room,
    fuse,
    ids_of,
    line,
    watch,
)
from tracker.fusion.protocol import FusionResult
from tracker.parameters import DetectionBoxParams, RunParameters
from tracker.sequences.sequence import Room
from tracker.single_view.detector_boxes import trust
from tracker.single_view.protocol import ViewResult

both_methods = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__)

PATH = line([(-1.8, -1.8), (0.5, 0.3), (1.0, 0.6)], [0, 3, 6], 10.0)

Step = tuple[ViewResult, ...]


def with_boxes(view: ViewResult, more: ndarray) -> ViewResult:
    """A camera's boxes and some more, trusted as a detector's."""
    boxes = np.concatenate([view.boxes, more])
    return ViewResult.of_boxes(boxes, np.ones(len(boxes)), trust(boxes, DetectionBoxParams()))


def results_of(method: Method, views: list[Step], room: Room = ROOM) -> list[FusionResult]:
    """The posterior of every step in some room."""
    fusion = method(replace(empty_room(10.0), room=room), RunParameters(fusion=RECOMMENDED))
    state, results = fusion.start(), []
    for step in views:
        state, result = fusion.step(state, step)
        results.append(result)
    return results


def check_numbers(results: list[FusionResult]) -> None:
    """Finite, positive and few."""
    for result in results:
        posterior = result.posterior
        assert np.isfinite(posterior.means).all()
        assert np.isfinite(posterior.weights).all()
        assert posterior.size <= 3 * RECOMMENDED.max_components
        if posterior.size:
            assert np.linalg.eigvalsh(posterior.covariances).min() > 0.0


@both_methods
def test_a_room_without_entrances(method: Method) -> None:
    results = results_of(method, watch(PATH[:, None], seed=1), Room(ROOM.minimum, ROOM.maximum, ()))
    for result, place in zip(results[15:], PATH[15:], strict=True):
        best = result.posterior.means[result.posterior.weights.argmax(), :3]
        assert np.linalg.norm(best - place) < 0.35


@both_methods
@pytest.mark.parametrize("camera", [0, 2])
def test_a_single_camera_finds_who_comes_in_by_the_door(method: Method, camera: int) -> None:
    views = [(step[camera],) for step in watch(PATH[:, None], seed=1)]
    _, tracks = fuse(method, views, cameras=[CAMERAS[camera]])
    assert (ids_of(tracks, PATH, 0.5)[15:] > 0).mean() > 0.9


@both_methods
def test_a_person_is_found_after_a_long_time_of_nothing(method: Method) -> None:
    nothing = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
    results = results_of(method, [(nothing,) * 4] * 400 + watch(PATH[:, None], seed=1))
    assert all(result.posterior.cardinality < 0.2 for result in results[:400])
    assert (np.array([r.posterior.weights.max() for r in results[420:]]) > 0.5).all()


@both_methods
def test_hundreds_of_false_boxes_lose_nobody_and_break_nothing(method: Method) -> None:
    rng = np.random.default_rng(0)
    low, high = [0.0, 0.0, 10.0, 40.0], [1280.0, 800.0, 60.0, 150.0]
    views = [
        tuple(with_boxes(view, rng.uniform(low, high, (150, 4))) for view in step)
        for step in watch(PATH[:12, None], seed=1)
    ]
    results = results_of(method, views)
    check_numbers(results)
    posterior = results[-1].posterior
    apart = np.linalg.norm(posterior.means[:, :3] - PATH[11], axis=1)
    assert posterior.weights[apart < 0.4].max() > 0.5


@both_methods
@pytest.mark.parametrize("cameras", [1, 4])
def test_boxes_of_a_pixel_and_of_the_whole_picture(method: Method, cameras: int) -> None:
    absurd = np.array(
        [
            [640.0, 400.0, 0.5, 0.5],
            [640.0, 400.0, 640.0, 400.0],
            [0.0, 0.0, 0.5, 0.5],
            [-500.0, 400.0, 600.0, 900.0],
            [640.0, 400.0, 0.5, 400.0],
            [640.0, 400.0, 640.0, 0.5],
        ]
    )
    views = [
        tuple(with_boxes(view, absurd) if c < cameras else view for c, view in enumerate(step))
        for step in watch(PATH[:, None], seed=1)
    ]
    results, tracks = fuse(method, views)
    check_numbers(results)
    assert (ids_of(tracks, PATH, 0.5)[15:] > 0).mean() > 0.9
