"""The tracker by association matrices on painted and rendered pictures, and on what cameras do."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.painted import GREEN, RED, painted_sequence, true_boxes
from tests.engine.synthetic import CAMERAS, HALF_EXTENTS, walk
from tests.papers.clips.clip import Actor, Clip, constant_size, through, wall, write
from tracker import pipeline, single_view
from tracker.parameters import PRESETS, RunParameters, with_values
from tracker.pictures.foreground import unpack
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, View
from tracker.single_view.association_matrix.method import AssociationMatrixState
from tracker.single_view.protocol import ViewResult

STEPS = 40
ROBUST = RunParameters(single_view="association_matrix")
PUBLISHED = with_values(ROBUST, PRESETS["published"])

both = pytest.mark.parametrize("parameters", [ROBUST, PUBLISHED], ids=["robust", "published"])


def method_of(
    sequence: Sequence, reader: FrameReader, parameters: RunParameters = ROBUST
) -> single_view.SingleViewMethod:
    return single_view.create("association_matrix", sequence, 0, parameters, reader)


def run(
    method: single_view.SingleViewMethod, pictures: Many[ndarray | None]
) -> tuple[AssociationMatrixState, list[ViewResult]]:
    state, results = method.start(), []
    for step, picture in enumerate(pictures):
        state, result = method.step(state, step, picture, np.random.default_rng(step))
        results.append(result)
    return state, results


def pictures_of(sequence: Sequence, reader: FrameReader) -> list[ndarray | None]:
    return [reader.picture(0, step) for step in range(sequence.frames)]


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Somebody's head moves through the picture."""
    path = walk((-1.0, 0.0, 1.0), (1.0, 0.2, 1.0), STEPS)
    return painted_sequence(tmp_path_factory.mktemp("walker"), [path], [RED])


@pytest.fixture(scope="module")
def reader(walker: Sequence) -> Iterator[FrameReader]:
    with FrameReader(walker) as opened:
        yield opened


@pytest.fixture(scope="module")
def passing(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sequence, Clip]:
    """Two people of different colours pass each other, the red one in front."""
    steps = 70
    clip = Clip(
        "passing",
        wall((240, 160), seed=3),
        (
            Actor("green", through(steps, [(0, 200, 84), (69, 40, 84)]),
                  constant_size(steps, 11, 30), ((40.0, 150.0, 40.0), (60.0, 90.0, 30.0))),
            Actor("red", through(steps, [(0, 40, 84), (69, 200, 84)]),
                  constant_size(steps, 11, 30), ((40.0, 40.0, 210.0), (130.0, 40.0, 30.0))),
        ),
        np.ones(steps),
    )  # fmt: skip
    return write(clip, tmp_path_factory.mktemp("passing")), clip


def off(box: ndarray, boxes: ndarray) -> float:
    """How far the nearest box's centre is, in half sizes."""
    apart = (boxes[:, :2] - box[:2]) / box[2:]
    return float(np.linalg.norm(apart, axis=1).min()) if len(boxes) else np.inf


@both
def test_a_person_is_followed(
    walker: Sequence, reader: FrameReader, parameters: RunParameters
) -> None:
    _, results = run(method_of(walker, reader, parameters), pictures_of(walker, reader))
    found = [off(true_boxes(walker, k)[0], result.boxes) for k, result in enumerate(results)]
    assert np.mean(np.array(found) < 0.6) > 0.95
    assert np.mean([len(result.boxes) for result in results]) < 1.1
    labels = np.concatenate([result.estimate_labels for result in results])
    assert len(np.unique(labels)) == 1
    told = [event.kind for result in results for event in result.events]
    assert told == ["new"]


@pytest.mark.full
@both
def test_two_who_pass_each_other_keep_their_ids(
    passing: tuple[Sequence, Clip], parameters: RunParameters
) -> None:
    sequence, clip = passing
    # rectangles' edges keep no shape of a head: the objects themselves are wanted
    parameters = with_values(parameters, {"association_matrix.output": "objects"})
    with FrameReader(sequence) as opened:
        _, results = run(method_of(sequence, opened, parameters), pictures_of(sequence, opened))
    told = [event.kind for result in results for event in result.events]
    assert [kind for kind in told if kind != "new"] in (
        ["merged", "split"],
        ["merged", "occluded", "split"],
    )
    for step, left_to_right in ((20, ("red", "green")), (66, ("green", "red"))):
        result = results[step]
        order = np.argsort(result.estimates[:, 0])
        by_place = result.estimate_labels[order].tolist()
        if step == 20:
            names = dict(zip(by_place, left_to_right, strict=True))
        assert [names[label] for label in by_place] == list(left_to_right)
        for box in clip.boxes(step):
            assert off(box, result.boxes) < 0.3


def test_results_have_consistent_shapes(walker: Sequence, reader: FrameReader) -> None:
    _, results = run(method_of(walker, reader), pictures_of(walker, reader)[:8])
    width, height = walker.cameras[0].image_size
    for result in results:
        assert result.boxes.shape == result.sigmas.shape == (len(result.weights), 4)
        assert len(result.labels) == len(result.boxes)
        assert len(result.estimates) == len(result.estimate_labels)
        assert np.all((result.weights > 0.0) & (result.weights <= 1.0))
        assert np.all(result.sigmas > 0.0)
        assert result.gates.shape == (len(result.measurements), 5)
        assert result.foreground is not None
        mask = unpack(result.foreground)
        assert mask.shape == (height, width)
        assert result.information["foreground share"] == pytest.approx(mask.mean())


def test_the_same_pictures_give_the_same_result(walker: Sequence, reader: FrameReader) -> None:
    pictures = pictures_of(walker, reader)[:10]
    (_, first), (_, second) = (run(method_of(walker, reader), pictures) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.boxes, b.boxes)
        np.testing.assert_array_equal(a.estimates, b.estimates)
        assert a.events == b.events


@both
def test_missing_pictures_change_nothing(
    walker: Sequence, reader: FrameReader, parameters: RunParameters
) -> None:
    pictures = pictures_of(walker, reader)
    method = method_of(walker, reader, parameters)
    before, results = run(method, pictures[:20])
    after = before
    for step in range(20, 23):
        after, result = method.step(after, step, None, np.random.default_rng(step))
        assert len(result.boxes) == len(result.measurements) == 0
        assert result.foreground is None
        np.testing.assert_array_equal(result.estimates, results[-1].estimates)
    assert after is before
    _, result = method.step(after, 23, pictures[20], np.random.default_rng(23))
    np.testing.assert_array_equal(result.estimate_labels, results[-1].estimate_labels)


@pytest.mark.full
@pytest.mark.parametrize("level", [0, 255])
@both
def test_a_black_or_white_frame_shows_nobody_and_is_survived(
    walker: Sequence, reader: FrameReader, parameters: RunParameters, level: int
) -> None:
    pictures = pictures_of(walker, reader)
    blank = np.full_like(pictures[0], level)
    _, results = run(
        method_of(walker, reader, parameters), [*pictures[:20], blank, blank, *pictures[22:30]]
    )
    assert not any(len(result.boxes) for result in results[20:22])
    np.testing.assert_array_equal(results[-1].estimate_labels, results[19].estimate_labels)


@pytest.mark.full
@both
def test_no_foreground_for_a_hundred_frames(
    walker: Sequence, reader: FrameReader, parameters: RunParameters
) -> None:
    pictures = pictures_of(walker, reader)
    empty = np.median(np.stack(pictures), axis=0).astype(np.uint8)  # type: ignore[arg-type]
    method = method_of(walker, reader, parameters)
    state, results = run(method, [*pictures[:20], *[empty] * 100])
    assert not any(len(result.boxes) for result in results[21:])
    assert not state.situation.tracks
    assert [e.kind for result in results[20:] for e in result.events] == ["vanished"]
    _, result = method.step(state, 120, pictures[20], np.random.default_rng(0))
    assert len(result.boxes) == 1


@pytest.mark.full
@both
def test_a_frozen_camera_sees_nobody(walker: Sequence, parameters: RunParameters) -> None:
    view = walker.views[0]
    frozen = replace(walker, views=(replace(view, images=(view.images[0],) * STEPS),))
    with FrameReader(frozen) as opened:
        _, results = run(method_of(frozen, opened, parameters), pictures_of(frozen, opened)[:6])
    assert not any(len(result.boxes) for result in results)


@pytest.mark.full
@both
def test_a_camera_that_freezes_keeps_whom_it_shows(
    walker: Sequence, reader: FrameReader, parameters: RunParameters
) -> None:
    pictures = pictures_of(walker, reader)
    _, results = run(method_of(walker, reader, parameters), [*pictures[:15], *[pictures[15]] * 60])
    assert all(len(result.estimates) == 1 for result in results[15:])
    assert len({tuple(result.estimate_labels) for result in results[10:]}) == 1


@pytest.mark.full
@both
def test_boxes_of_a_pixel(
    tmp_path_factory: pytest.TempPathFactory, parameters: RunParameters
) -> None:
    path = walk((-0.5, 0.0, 1.0), (0.5, 0.0, 1.0), 8)
    tiny = painted_sequence(
        tmp_path_factory.mktemp("tiny"), [path], [RED], half_extents=HALF_EXTENTS / 40.0
    )
    parameters = with_values(parameters, {"foreground.minimum_area": 1})
    with FrameReader(tiny) as opened:
        _, results = run(method_of(tiny, opened, parameters), pictures_of(tiny, opened))
    for result in results:
        assert np.isfinite(result.boxes).all()
        assert np.all(result.sigmas > 0.0)


def test_no_picture_at_all_finds_nobody(walker: Sequence) -> None:
    view = walker.views[0]
    lost = replace(walker, views=(replace(view, images=(Path("nowhere.png"),) * STEPS),))
    with FrameReader(lost) as opened:
        _, results = run(method_of(lost, opened), [None] * 5)
    assert all(len(result.boxes) == 0 for result in results)


def test_a_camera_without_pictures_is_told_what_to_do(walker: Sequence) -> None:
    blind = replace(walker, views=(View(walker.views[0].camera),))
    with FrameReader(blind) as opened, pytest.raises(ValueError, match="has no pictures; give it"):
        method_of(blind, opened)


@pytest.mark.full
def test_what_one_camera_does_leaves_the_others_alone(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Two cameras; one goes black, freezes or loses its pictures: the other's result stays."""
    path = walk((-0.6, 0.0, 1.0), (0.6, 0.2, 1.0), 12)
    parts = [
        painted_sequence(tmp_path_factory.mktemp("part"), [path], [colours], camera=CAMERAS[number])
        for number, colours in enumerate((RED, GREEN))
    ]
    good, other = parts[0].views[0], parts[1].views[0]
    parameters = with_values(ROBUST, {"fusion_method": "multi_bernoulli"})
    results = []
    for images in (other.images, other.images[:1] * 12, (Path("nowhere.png"),) * 12):
        sequence = replace(
            parts[0],
            views=(good, replace(other, images=images)),
            digest=f"{parts[0].digest} {images[-1]}",
        )
        results.append(pipeline.compute(sequence, parameters))
    for done in results[1:]:
        assert done.complete
        for first, again in zip(results[0].views, done.views, strict=True):
            np.testing.assert_array_equal(first[0].boxes, again[0].boxes)
            np.testing.assert_array_equal(first[0].estimate_labels, again[0].estimate_labels)
