"""People behind people, near people and lost people keep their ids, whatever the frame rate."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.standing import METHODS, RECOMMENDED, Method, fuse, ids_of, line, watch
from tracker.single_view.protocol import ViewResult
from tracker.trajectories import Trajectories

both_methods = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__)
both_rates = pytest.mark.parametrize("fps", [4.0, 25.0])


def one_id(ids: ndarray) -> int:
    """The only id of a person who is always found."""
    assert len(set(ids.tolist())) == 1, ids
    assert ids[0] > 0
    return int(ids[0])


def surplus(tracks: Trajectories, people: int, first: int, last: int) -> int:
    """Estimates beyond one a person, over some steps."""
    rows = (tracks.frames >= first) & (tracks.frames < last)
    return int(rows.sum()) - people * (last - first)


@both_methods
@both_rates
def test_two_people_swap_places_behind_each_other(method: Method, fps: float) -> None:
    # on one line of sight of the first camera; the one behind gives it no box
    a = line([(-1.9, -1.9), (-0.9, 0.0), (0.0, 0.17), (0.9, 0.0), (0.9, 0.0)], [0, 3, 5, 7, 9], fps)
    b = line([(1.9, 1.0), (0.9, 0.0), (0.0, -0.17), (-0.9, 0.0), (-0.9, 0.0)], [0, 3, 5, 7, 9], fps)
    places = np.stack([a, b], axis=1)

    def hidden(camera: int, person: int, step: int) -> bool:
        other = 1 - person
        aligned = abs(places[step, 0, 1] - places[step, 1, 1]) < 0.36
        return camera == 0 and aligned and places[step, person, 0] < places[step, other, 0]

    _, tracks = fuse(method, watch(places, hidden=hidden, seed=1), fps=fps)
    settled = round(2.0 * fps)
    first, second = (one_id(ids_of(tracks, path)[settled:]) for path in (a, b))
    assert first != second
    assert abs(surplus(tracks, 2, settled, len(a))) <= 0.05 * len(a)


@both_methods
@both_rates
def test_two_people_stand_close_together_for_five_seconds(method: Method, fps: float) -> None:
    a = line([(-1.8, -1.8), (-0.2, 0.1), (-0.2, 0.1), (-1.5, 1.5)], [0, 3, 8, 10], fps)
    b = line([(1.8, 1.5), (0.2, 0.1), (0.2, 0.1), (1.5, -1.5)], [0, 3, 8, 10], fps)
    places = np.stack([a, b], axis=1)
    apart = np.linalg.norm(a - b, axis=1)
    assert np.isclose(apart.min(), 0.4)
    results, tracks = fuse(method, watch(places, seed=2), fps=fps)
    settled = round(2.0 * fps)
    first, second = (one_id(ids_of(tracks, path, 0.3)[settled:]) for path in (a, b))
    assert first != second
    assert abs(surplus(tracks, 2, settled, len(a))) <= 0.05 * len(a)
    # each label at most once among the estimates, and no label on top of another
    for step, result in enumerate(results):
        labels = tracks.labels[tracks.at(step)]
        assert len(set(labels.tolist())) == len(labels)
        assert result.posterior.size <= RECOMMENDED.max_components + 10


@both_methods
@both_rates
@pytest.mark.parametrize("seconds", [0.5, 2.0])
def test_who_is_lost_for_up_to_two_seconds_returns_with_the_same_id(
    method: Method, fps: float, seconds: float
) -> None:
    lost = line([(-1.8, -1.8), (0.3, 0.2), (1.3, 0.4)], [0, 4, 9], fps)
    stays = line([(1.6, -1.6), (1.5, -1.5)], [0, 9], fps)
    places = np.stack([lost, stays], axis=1)
    begin, end = round(4.5 * fps), round((4.5 + seconds) * fps)
    views = watch(
        places, hidden=lambda camera, person, step: person == 0 and begin <= step < end, seed=3
    )
    _, tracks = fuse(method, views, fps=fps)
    ids = ids_of(tracks, lost)
    back = end + 1 + round(0.12 * fps)
    before, after = one_id(ids[round(fps) : begin]), one_id(ids[back:])
    assert before == after
    assert one_id(ids_of(tracks, stays)[round(fps) :]) != before


@both_methods
def test_who_leaves_by_the_door_is_not_the_one_who_comes_in_later(method: Method) -> None:
    fps = 10.0
    out = line([(0.0, 0.0), (-2.6, -2.6)], [0, 4], fps)
    into = line([(-1.9, -1.9), (0.5, 0.5)], [0, 4], fps)
    places = np.full((120, 2, 3), np.nan)
    places[: len(out), 0] = out
    places[80 : 80 + len(into), 1] = into
    _, tracks = fuse(method, watch(places, seed=4), fps=fps)
    first = one_id(ids_of(tracks, out)[10:25])
    late = tracks.ids[tracks.frames > 100]
    assert len(set(late.tolist())) == 1
    assert late[0] != first


@both_methods
@pytest.mark.parametrize("hidden_in", [0, 3])
def test_a_person_hidden_in_some_cameras_lives_on(method: Method, hidden_in: int) -> None:
    path = line([(-1.8, -1.8), (0.5, 0.3), (1.0, 0.6)], [0, 5, 12], 10.0)
    views = watch(
        path[:, None],
        hidden=lambda camera, person, step: camera == hidden_in and 60 <= step < 100,
        seed=5,
    )
    _, tracks = fuse(method, views)
    one_id(ids_of(tracks, path)[15:])


@both_methods
def test_double_boxes_make_no_second_person(method: Method) -> None:
    # every detector draws two boxes around the same person, a little apart
    path = line([(-1.8, -1.8), (0.5, 0.3), (1.0, 0.6)], [0, 5, 12], 10.0)
    once = watch(path[:, None], seed=6, clutter_rate=0.0)
    again = watch(path[:, None], seed=7, clutter_rate=0.0)
    views = [
        tuple(
            ViewResult.of_boxes(
                np.concatenate([one.boxes, two.boxes]),
                np.concatenate([one.weights, two.weights]),
                np.concatenate([one.sigmas, two.sigmas]),
            )
            for one, two in zip(first, second, strict=True)
        )
        for first, second in zip(once, again, strict=True)
    ]
    _, tracks = fuse(method, views)
    one_id(ids_of(tracks, path)[15:])
    names, counts = np.unique(tracks.labels, return_counts=True)
    assert counts.max() > 0.85 * len(path)
    assert np.sort(counts)[:-1].max(initial=0) <= 10, "a second label lives for a second at most"
    assert len(names) <= 6


def lying_down(fps: float) -> tuple[ndarray, list[tuple[ViewResult, ...]], slice]:
    """A person walks, falls, lies for three seconds and gets up: path, boxes, when he lies."""
    path = line([(-1.8, -1.8), (0.3, 0.2), (0.3, 0.2), (1.5, 0.8)], [0, 4, 9, 12], fps)
    falls, lies, rises, stands = (round(seconds * fps) for seconds in (4.5, 5.2, 8.0, 9.0))
    path[falls:lies, 2] = np.linspace(0.85, 0.25, lies - falls)
    path[lies:rises, 2] = 0.25
    path[rises:stands, 2] = np.linspace(0.25, 0.85, stands - rises)
    upright = watch(path[:, None], seed=8)
    flat = watch(path[:, None], half_extents=np.array([0.55, 0.55, 0.4]), seed=8)
    views = upright[:lies] + flat[lies:rises] + upright[rises:]
    return path, views, slice(lies, rises)


@both_methods
@both_rates
def test_who_falls_and_lies_is_followed_and_keeps_his_id(method: Method, fps: float) -> None:
    path, views, lying = lying_down(fps)
    _, tracks = fuse(method, views, fps=fps)
    ids = ids_of(tracks, path, 0.6)
    one_id(ids[round(2.0 * fps) :])
    heights = [tracks.positions[tracks.at(step)][0, 2] for step in range(lying.stop)[lying]]
    assert np.mean(heights) < 0.45
    # who may only stand is lost
    stiff = RECOMMENDED.model_copy(update={"posture_share": 0.0})
    _, tracks = fuse(method, views, fps=fps, parameters=stiff)
    assert (ids_of(tracks, path, 0.6)[lying] > 0).mean() < 0.5
