"""Tracking in one camera by data association: who keeps which id, and what is told of whom."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.papers.clips.clip import (
    Actor,
    Clip,
    constant_size,
    plane_camera,
    through,
    wall,
    write,
)
from tracker import pipeline, single_view
from tracker.parameters import PRESETS, RunParameters, stage_values, with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Detections, Room, Sequence, View
from tracker.single_view.protocol import ViewResult

SIZE, HALF = (160, 120), (6.0, 12.0)
PUBLISHED = {key: value for key, value in PRESETS["published"].items() if key.startswith("jpda.")}
CLOTHES = ((40.0, 45.0, 50.0), (120.0, 140.0, 205.0), (150.0, 60.0, 50.0))


def from_boxes(steps: list[list[tuple[float, ...]]]) -> Sequence:
    """A camera of boxes by an outside detector: centre x and y, and half sizes if not the usual."""
    rows = [(k, (*box, *HALF)[:4] if len(box) == 2 else box)
            for k, boxes in enumerate(steps) for box in boxes]  # fmt: skip
    corners = np.array([[x - a, y - b, 2 * a, 2 * b] for _, (x, y, a, b) in rows])
    detections = Detections(
        np.array([k for k, _ in rows], dtype=np.int64), corners.reshape(-1, 4), np.ones(len(rows))
    )
    return Sequence(
        name="boxes",
        folder=Path(),
        fps=25.0,
        frames=len(steps),
        room=Room(np.array([0.0, -0.1, 0.0]), np.array([1.6, 0.1, 1.2])),
        target_half_extents=np.array([0.06, 0.06, 0.12]),
        views=(View(plane_camera(SIZE), detections=detections),),
    )


def track(
    sequence: Sequence, changes: dict[str, Any] | None = None, camera: int = 0
) -> list[ViewResult]:
    """The results of all steps."""
    parameters = with_values(RunParameters(single_view="jpda"), changes or {})
    with FrameReader(sequence) as reader:
        method = single_view.create("jpda", sequence, camera, parameters, reader)
        state, results = method.start(), []
        for step in range(sequence.frames):
            picture = reader.picture(camera, step)
            state, result = method.step(state, step, picture, np.random.default_rng(step))
            results.append(result)
    return results


BOXES = {
    "jpda.measurements": "detections",
    "jpda.confirmation_steps": 1,
    "detection_boxes.room_tolerance": 100.0,
}


def told(results: list[ViewResult], kind: str) -> list[tuple[int, tuple[int, ...]]]:
    """Step and labels of all events of a kind."""
    return [(k, e.labels) for k, r in enumerate(results) for e in r.events if e.kind == kind]


def walking(steps: int, x: float = 30.0, speed: float = 1.5) -> list[tuple[float, float]]:
    return [(x + speed * k, 60.0) for k in range(steps)]


def test_one_person_is_followed_under_one_label() -> None:
    path = walking(40)
    results = track(from_boxes([[place] for place in path]), BOXES)
    assert told(results, "new") == [(0, (1,))]
    for result, place in zip(results[5:], path[5:], strict=True):
        assert result.labels.tolist() == [1]
        np.testing.assert_allclose(result.estimates[0], (*place, *HALF), atol=1.5)
        assert (result.sigmas > 0.0).all()
        (x, y, xx, _, yy), *_ = result.gates
        assert (x - place[0]) ** 2 / xx + (y - place[1]) ** 2 / yy < 1.0
    assert all(result.gates.shape == (1, 5) for result in results[1:])


def test_a_newcomer_counts_after_some_steps_in_a_row() -> None:
    blink: list = [[], [(80, 60)], [], [(80, 60)], *[[(80.0, 60.0)] for _ in range(6)]]
    results = track(from_boxes(blink), BOXES | {"jpda.confirmation_steps": 4})
    assert told(results, "new") == [(6, (1,))]
    assert [len(result.estimates) for result in results] == [0] * 6 + [1] * 4
    assert results[4].information["newcomers"] == 1.0


def test_who_is_not_measured_for_three_steps_has_vanished() -> None:
    path: list = [[place] for place in walking(12)]
    results = track(from_boxes(path + [[]] * 6), BOXES)
    assert told(results, "vanished") == [(14, (1,))]
    assert [len(result.estimates) for result in results[11:]] == [1, 1, 1, 0, 0, 0, 0]
    # coasting: shown where it was going, but not handed on
    assert [len(result.boxes) for result in results[11:]] == [1, 0, 0, 0, 0, 0, 0]
    assert results[13].estimates[0, 0] > results[11].estimates[0, 0] + 2.0


@pytest.mark.parametrize(("away", "same"), [(5, True), (7, True), (12, False)])
def test_who_comes_back_within_five_steps_is_the_same(away: int, same: bool) -> None:
    path = walking(30 + away, speed=0.6)
    steps: list = [[place] for place in path]
    steps[15 : 15 + away] = [[]] * away
    results = track(from_boxes(steps), BOXES)
    assert told(results, "vanished")[0] == (17, (1,))
    assert (told(results, "returned") == [(15 + away, (1,))]) == same
    assert results[-1].labels.tolist() == ([1] if same else [2])


def meeting(steps: int = 60, merged: range = range(24, 36)) -> list:
    """Two pass each other; where they overlap a detector sees one box around both."""
    boxes: list = []
    for k in range(steps):
        left, right = (30.0 + 1.6 * k, 58.0), (125.0 - 1.6 * k, 62.0)
        if k in merged:
            low, high = sorted((left[0], right[0]))
            middle = (low + high) / 2.0
            boxes.append([(middle, 60.0, 6.0 + (high - low) / 2.0, 14.0)])
        else:
            boxes.append([left, right])
    return boxes


def test_two_who_pass_each_other_keep_their_labels() -> None:
    results = track(from_boxes(meeting()), BOXES)
    assert told(results, "new") == [(0, (1, )), (0, (2,))]  # fmt: skip
    assert not told(results, "vanished")
    occluded = [k for k, labels in told(results, "occluded") if labels == (1, 2)]
    assert set(occluded) >= set(range(26, 36))
    for k in (20, 50):
        places = dict(zip(results[k].labels.tolist(), results[k].estimates[:, 0], strict=True))
        assert places[1] == pytest.approx(30.0 + 1.6 * k, abs=3.0)
        assert places[2] == pytest.approx(125.0 - 1.6 * k, abs=3.0)
    # while nobody knows who is where, nobody is handed on
    assert len(results[26].boxes) == 0
    assert len(results[26].estimates) == 2


def test_as_published_the_occluded_stand_still_in_the_middle_of_what_is_seen() -> None:
    steps = meeting(merged=range(28, 33))
    results = track(from_boxes(steps), BOXES | PUBLISHED | {"jpda.measurements": "detections"})
    assert {k for k, labels in told(results, "occluded") if labels == (1, 2)} >= {29, 30, 31, 32}
    middle = results[30]
    assert len(middle.boxes) == 2
    np.testing.assert_allclose(middle.boxes[0, :2], middle.boxes[1, :2])
    np.testing.assert_allclose(middle.boxes[0, :2], [77.5, 60.0], atol=0.5)
    # after it both are followed apart, who is who is anybody's guess
    assert sorted(results[-1].labels.tolist()) == [1, 2]
    assert np.ptp(results[-1].boxes[:, 0]) == pytest.approx(1.6 * 2 * 59 - 95.0, abs=4.0)


def test_two_pieces_of_one_person_are_one() -> None:
    steps: list = [[place] for place in walking(20)]
    for k in range(10, 20):
        x, y = steps[k][0]
        steps[k] = [(x, y - 4.0, 6.0, 7.0), (x, y + 5.0, 6.0, 6.0)]
    results = track(from_boxes(steps), BOXES)
    assert told(results, "split")
    assert {label for result in results for label in result.estimate_labels.tolist()} == {1}
    assert results[-1].estimates[0, 3] == pytest.approx(HALF[1], abs=1.0), "the size stands"


def test_without_the_five_cases_there_is_neither_occlusion_nor_return() -> None:
    steps = meeting()
    steps[50:55] = [[]] * 5
    results = track(from_boxes(steps), BOXES | {"jpda.five_cases": False})
    kinds = {event.kind for result in results for event in result.events}
    assert kinds == {"new", "vanished"}


@pytest.mark.parametrize("association", ["exact", "murty", "simplified_murty"])
@pytest.mark.parametrize("clutter", ["poisson", "diffuse"])
def test_every_way_of_associating_keeps_two_apart(association: str, clutter: str) -> None:
    rng = np.random.default_rng(3)
    steps: list = [
        [(40.0 + k + rng.normal(), 50.0), (44.0 + k, 72.0 + rng.normal()), (150 * rng.random(), 20)]
        for k in range(40)
    ]
    changes = {"jpda.association": association, "jpda.clutter": clutter}
    result = track(from_boxes(steps), BOXES | changes)[-1]
    places = dict(zip(result.estimate_labels.tolist(), result.estimates, strict=True))
    np.testing.assert_allclose(places[1][:2], [79.0, 50.0], atol=3.0)
    np.testing.assert_allclose(places[2][:2], [83.0, 72.0], atol=3.0)


def test_measurements_can_go_on_instead_of_estimates() -> None:
    steps: list = [[place, (140.0, 20.0 + 7.0 * (k % 9))] for k, place in enumerate(walking(30))]
    changes = {"jpda.output": "measurements", "jpda.confirmation_steps": 3}
    result = track(from_boxes(steps), BOXES | changes)[-1]
    kept = result.boxes[result.labels == 1]
    np.testing.assert_allclose(kept, [(*walking(30)[-1], *HALF)])
    assert len(result.measurements) == 2


def crossing_clip(steps: int = 40) -> Clip:
    """Two small figures cross in front of a wall."""
    paths = [through(steps, [(0, 25, 50), (steps - 1, 135, 66)]),
             through(steps, [(0, 135, 52), (steps - 1, 25, 70)])]  # fmt: skip
    actors = tuple(Actor(f"{i}", path, constant_size(steps, *HALF), CLOTHES)
                   for i, path in enumerate(paths))  # fmt: skip
    return Clip("crossing", wall(SIZE, seed=2), actors, np.ones(steps))


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Clip, Sequence]:
    clip = crossing_clip()
    return clip, write(clip, tmp_path_factory.mktemp("clip"))


@pytest.mark.full
@pytest.mark.parametrize(
    "changes",
    [{}, {"jpda.foreground_box": "piece"}, {"jpda.measurements": "colour"}, PUBLISHED,
     {"foreground.model": "adaptive"}],
    ids=["targets", "pieces", "colour", "published", "adaptive"],
)  # fmt: skip
def test_pictures_are_enough(filmed: tuple[Clip, Sequence], changes: dict[str, Any]) -> None:
    clip, sequence = filmed
    results = track(sequence, {"jpda.confirmation_steps": 2, **changes})
    errors = []
    for step in (8, 9, 10, 33, 35, 37, 39):
        for box in clip.boxes(step):
            errors.append(np.abs(results[step].estimates[:, :2] - box[:2]).max(axis=1).min())
    assert max(errors) < 6.0
    assert results[10].foreground is not None
    assert all(len(result.boxes) == len(result.sigmas) for result in results)


def test_a_missing_picture_is_a_step_without_measurement(filmed: tuple[Clip, Sequence]) -> None:
    _, sequence = filmed
    parameters = RunParameters(single_view="jpda")
    with FrameReader(sequence) as reader:
        method = single_view.create("jpda", sequence, 0, parameters, reader)
        state = method.start()
        for step in range(10):
            state, before = method.step(
                state, step, reader.picture(0, step), np.random.default_rng(0)
            )
        state, result = method.step(state, 10, None, np.random.default_rng(0))
    assert len(before.boxes) == 2
    assert len(result.boxes) == 0
    assert result.estimate_labels.tolist() == before.estimate_labels.tolist()
    assert result.foreground is None


@pytest.mark.parametrize("source", ["foreground", "colour"])
def test_without_templates_the_foreground_says_where_people_are(
    filmed: tuple[Clip, Sequence], source: str
) -> None:
    bare = replace(filmed[1], templates=())
    results = track(bare, {"jpda.measurements": source})
    assert len(results[12].boxes) == 2


PICTURES = {
    "black": lambda picture: np.zeros_like(picture),
    "white": lambda picture: np.full_like(picture, 255),
    "noise": lambda picture: np.random.default_rng(1).integers(
        0, 256, picture.shape, dtype=np.uint8
    ),
}


@pytest.mark.parametrize("kind", sorted(PICTURES))
def test_a_frame_that_shows_nothing_does_no_harm(filmed: tuple[Clip, Sequence], kind: str) -> None:
    clip, sequence = filmed
    with FrameReader(sequence) as reader:
        method = single_view.create("jpda", sequence, 0, RunParameters(single_view="jpda"), reader)
        state = method.start()
        for step in range(clip.steps):
            picture = reader.picture(0, step)
            assert picture is not None
            if step in (15, 16):
                picture = PICTURES[kind](picture)
            state, result = method.step(state, step, picture, np.random.default_rng(step))
            assert np.isfinite(result.estimates).all()
    for box in clip.boxes(clip.steps - 1):
        assert np.abs(result.estimates[:, :2] - box[:2]).max(axis=1).min() < 5.0


def test_a_frozen_camera_keeps_whom_it_shows(filmed: tuple[Clip, Sequence]) -> None:
    _, sequence = filmed
    with FrameReader(sequence) as reader:
        method = single_view.create("jpda", sequence, 0, RunParameters(single_view="jpda"), reader)
        state, picture = method.start(), reader.picture(0, 3)
        for step in range(120):
            state, result = method.step(state, step, picture, np.random.default_rng(step))
    assert sorted(result.labels.tolist()) == [1, 2]
    assert np.abs(state.targets.means[:, [1, 3]]).max() < 1.0, "nobody moves"


def test_a_hundred_frames_without_foreground_leave_nobody(tmp_path: Path) -> None:
    clip = Clip("empty", wall(SIZE), (), np.ones(6))
    sequence = write(replace_actors(clip), tmp_path)
    with FrameReader(sequence) as reader:
        method = single_view.create("jpda", sequence, 0, RunParameters(single_view="jpda"), reader)
        state, picture = method.start(), reader.picture(0, 0)
        for step in range(100):
            state, result = method.step(state, step, picture, np.random.default_rng(step))
            assert len(result.boxes) == len(result.estimates) == len(result.gates) == 0


def replace_actors(clip: Clip) -> Clip:
    """The clip with somebody who never comes, so that there is a size of targets."""
    away = np.full((clip.steps, 2), np.nan)
    return replace(clip, actors=(Actor("away", away, constant_size(clip.steps, *HALF), CLOTHES),))


def test_boxes_of_one_pixel_and_of_none_raise_nothing() -> None:
    steps: list = [
        [(40.0 + k, 60.0, 0.5, 0.5), (80.0, 60.0, 0.01, 0.01), (0.0, 0.0, 0.5, 0.5)]
        for k in range(30)
    ]
    for changes in ({}, {"jpda.five_cases": False}, {"jpda.occlusion": "measurement"}):
        results = track(from_boxes(steps), BOXES | {"detection_boxes.pixel_sigma": 0.0} | changes)
        for result in results:
            assert np.isfinite(result.estimates).all()
            assert np.isfinite(result.gates).all()
            assert np.isfinite(result.sigmas).all()


def test_fifty_in_one_place_raise_nothing() -> None:
    rng = np.random.default_rng(0)
    steps: list = [[tuple(place) for place in rng.normal(80.0, 3.0, (50, 2))] for _ in range(6)]
    for association in ("exact", "murty", "simplified_murty"):
        results = track(from_boxes(steps), BOXES | {"jpda.association": association})
        assert all(np.isfinite(result.estimates).all() for result in results)


def two_cameras(folder: Path, spoilt: str) -> Sequence:
    """The same pictures by two cameras, of which the second's are spoilt half way through."""
    clip = crossing_clip(24)
    one = write(clip, folder / "one")
    other = write(clip, folder / "other")
    for step in range(10, clip.steps):
        path = other.views[0].images[step]
        if spoilt == "missing":
            path.unlink()
        else:
            source = clip.picture(3) if spoilt == "frozen" else np.zeros_like(clip.picture(3))
            cv2.imwrite(str(path), source)
    second = replace(other.views[0], camera=replace(other.views[0].camera, name="second"))
    return replace(one, views=(one.views[0], second))


@pytest.mark.full
@pytest.mark.parametrize("spoilt", ["missing", "frozen", "black"])
def test_a_spoilt_camera_takes_nothing_from_the_others(tmp_path: Path, spoilt: str) -> None:
    both = two_cameras(tmp_path, spoilt)
    alone = replace(both, views=both.views[:1])
    parameters = RunParameters(single_view="jpda")
    together = pipeline.compute(both, parameters)
    expected = pipeline.compute(alone, parameters)
    assert together.complete
    for step in range(both.frames):
        ours, theirs = together.views[step][0], expected.views[step][0]
        np.testing.assert_array_equal(ours.boxes, theirs.boxes)
        np.testing.assert_array_equal(ours.labels, theirs.labels)
        assert ours.events == theirs.events
    assert len(together.views[-1][0].boxes) == 2


def test_a_camera_without_pictures_is_told_what_to_do() -> None:
    with pytest.raises(ValueError, match=r'camera "clip" of boxes has no pictures; .* detections'):
        track(from_boxes([[(5.0, 5.0)]]))


def test_only_what_the_source_reads_counts() -> None:
    def groups(source: str) -> set[str]:
        chosen = {"single_view": "jpda", "jpda.measurements": source}
        values = stage_values(with_values(RunParameters(), chosen), "single_view")
        return {key.split(".")[0] for key in values}

    assert groups("foreground") == {"single_view", "jpda", "pictures", "foreground"}
    assert groups("colour") == {"single_view", "jpda", "pictures", "foreground", "colour_phd"}
    assert groups("detections") == {"single_view", "jpda", "detection_boxes"}
    chosen = {"single_view": "jpda", "jpda.measurements": "colour"}
    read = stage_values(with_values(RunParameters(), chosen), "single_view")
    assert "colour_phd.bandwidth" in read
    assert "colour_phd.survival_probability" not in read
