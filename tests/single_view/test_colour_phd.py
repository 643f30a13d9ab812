"""The single-view filter follows painted heads, repeats itself, and survives what cameras do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.painted import GREEN, RED, painted_sequence, true_boxes, with_templates
from tests.engine.synthetic import CAMERAS, HALF_EXTENTS, walk
from tracker import single_view
from tracker.parameters import PRESETS, RunParameters, with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, View
from tracker.single_view.colour_phd import ColourPhd, ColourPhdState
from tracker.single_view.protocol import ViewResult

STEPS = 50


@pytest.fixture(scope="module")
def one_person(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Somebody walks in by the left entrance and across the room."""
    path = walk((-1.2, 0.0, 1.0), (1.0, 0.3, 1.05), STEPS, sway=0.3)
    return painted_sequence(tmp_path_factory.mktemp("one"), [path], [RED])


@pytest.fixture(scope="module")
def two_people(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Two people in different colours; one half hides the other for most of the time."""
    camera = CAMERAS[0]
    aside = camera.rotation[0] * 0.12
    path = walk((-0.5, 0.0, 1.0), (0.4, 0.2, 1.0), STEPS)
    nearer = path + aside - 0.15 * camera.rotation[2] * [1.0, 1.0, 0.0]
    return painted_sequence(tmp_path_factory.mktemp("two"), [path, nearer], [GREEN, RED])


@pytest.fixture(scope="module")
def reader(one_person: Sequence) -> Iterator[FrameReader]:
    with FrameReader(one_person) as opened:
        yield opened


def method_of(
    sequence: Sequence, reader: FrameReader, **changes: object
) -> single_view.SingleViewMethod:
    keys = {f"colour_phd.{name}": value for name, value in changes.items()}
    parameters = with_values(RunParameters(), keys)
    return single_view.create("colour_phd", sequence, 0, parameters, reader)


def run(
    method: single_view.SingleViewMethod, reader: FrameReader, steps: int, seed: int = 0
) -> list[ViewResult]:
    state, results = method.start(), []
    for step in range(steps):
        rng = np.random.default_rng((seed, step))
        state, result = method.step(state, step, reader.picture(0, step), rng)
        results.append(result)
    return results


def off(box: ndarray, boxes: ndarray) -> float:
    """How far the nearest box's centre is, in half sizes."""
    apart = (boxes[:, :2] - box[:2]) / box[2:]
    return float(np.linalg.norm(apart, axis=1).min()) if len(boxes) else np.inf


def test_a_person_is_followed(one_person: Sequence, reader: FrameReader) -> None:
    results = run(method_of(one_person, reader), reader, STEPS)
    found = [off(true_boxes(one_person, k)[0], result.boxes) for k, result in enumerate(results)]
    assert np.mean(np.array(found) < 0.6) > 0.95
    assert np.mean([len(result.boxes) for result in results]) < 1.1
    estimated = [
        off(true_boxes(one_person, k)[0], result.estimates) for k, result in enumerate(results)
    ]
    assert np.mean(np.array(estimated[5:]) < 1.0) > 0.9
    labels = np.concatenate([result.estimate_labels for result in results[10:]])
    assert len(np.unique(labels)) == 1


def test_the_published_scheme_follows_a_person_in_plain_sight(
    one_person: Sequence, reader: FrameReader
) -> None:
    parameters = with_values(RunParameters(), PRESETS["published"])
    method = single_view.create("colour_phd", one_person, 0, parameters, reader)
    results = run(method, reader, STEPS)
    found = [off(true_boxes(one_person, k)[0], result.boxes) for k, result in enumerate(results)]
    assert np.mean(np.array(found[8:]) < 1.0) > 0.75
    for result in results:
        assert len(result.samples) <= parameters.colour_phd.samples
        assert result.boxes is result.estimates


@pytest.mark.full
def test_two_people_side_by_side_keep_a_peak_each(two_people: Sequence) -> None:
    with FrameReader(two_people) as reader:
        results = run(method_of(two_people, reader), reader, STEPS)
    both = [
        max(off(box, result.boxes) for box in true_boxes(two_people, k)) < 1.0
        for k, result in enumerate(results)
    ]
    assert np.mean(both[3:]) > 0.8


def test_the_same_seed_gives_the_same_result(one_person: Sequence, reader: FrameReader) -> None:
    first, second, other = (
        run(method_of(one_person, reader), reader, 6, seed) for seed in (3, 3, 4)
    )
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.boxes, b.boxes)
        np.testing.assert_array_equal(a.samples, b.samples)
    assert not np.array_equal(first[-1].samples, other[-1].samples)


def test_results_have_consistent_shapes(one_person: Sequence, reader: FrameReader) -> None:
    for result in run(method_of(one_person, reader), reader, 8):
        assert result.boxes.shape == result.sigmas.shape == (len(result.weights), 4)
        assert len(result.labels) == len(result.boxes)
        assert result.samples.dtype == result.sample_weights.dtype == np.float32
        assert len(result.samples) == len(result.sample_weights)
        assert np.all((result.measurement_scores >= 0.0) & (result.measurement_scores <= 1.0))
        assert np.all(result.sigmas > 0.0)
        np.testing.assert_allclose(
            result.sigmas[:, :2] / result.boxes[:, 2:], RunParameters().colour_phd.centre_sigma
        )


def test_a_missing_picture_only_predicts(one_person: Sequence, reader: FrameReader) -> None:
    method = method_of(one_person, reader)
    state = method.start()
    for step in range(10):
        state, _ = method.step(
            state, step, reader.picture(0, step), np.random.default_rng((0, step))
        )
    before: ColourPhdState = state
    after, result = method.step(before, 10, None, np.random.default_rng(10))
    assert len(result.measurements) == len(result.samples) == 0
    person = before.mixture.weights.argmax()
    np.testing.assert_allclose(
        after.mixture.weights.max(), 0.99 * before.mixture.weights[person], rtol=0.05
    )
    np.testing.assert_allclose(after.mixture.means[0], before.mixture.means[person], atol=0.5)
    assert np.trace(after.mixture.covariances[0]) > np.trace(before.mixture.covariances[person])


@pytest.mark.parametrize("preset", ["robust", "published"])
@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_frames_show_nobody(
    one_person: Sequence, reader: FrameReader, level: int, preset: str
) -> None:
    parameters = with_values(RunParameters(), PRESETS[preset])
    method = single_view.create("colour_phd", one_person, 0, parameters, reader)
    state = method.start()
    height, width = one_person.cameras[0].image_size[::-1]
    blank = np.full((height, width, 3), level, dtype=np.uint8)
    for step in range(4):
        state, result = method.step(state, step, blank, np.random.default_rng(step))
        assert np.isfinite(state.mixture.weights).all()
        if preset == "robust":
            assert len(result.boxes) == 0


@pytest.mark.full
def test_in_a_frozen_picture_who_was_taught_is_found_and_nobody_else(one_person: Sequence) -> None:
    view, step = one_person.views[0], one_person.templates[0].frame
    frozen = replace(one_person, views=(replace(view, images=(view.images[step],) * STEPS),))
    with FrameReader(frozen) as reader:
        results = run(method_of(frozen, reader), reader, 10)
    assert [len(result.boxes) for result in results[2:]] == [1] * 8
    there = true_boxes(one_person, step)[0]
    assert max(off(there, result.boxes) for result in results[2:]) < 0.6


def test_targets_of_a_pixel(tmp_path_factory: pytest.TempPathFactory) -> None:
    path = walk((-0.5, 0.0, 1.0), (0.5, 0.0, 1.0), 8)
    tiny = painted_sequence(
        tmp_path_factory.mktemp("tiny"), [path], [RED], half_extents=HALF_EXTENTS / 40.0
    )
    with FrameReader(tiny) as reader:
        for preset in PRESETS.values():
            parameters = with_values(RunParameters(), preset)
            method = single_view.create("colour_phd", tiny, 0, parameters, reader)
            assert len(run(method, reader, 8)) == 8


def test_a_camera_that_looks_away_finds_nobody(one_person: Sequence, reader: FrameReader) -> None:
    view = one_person.views[0]
    away = replace(
        view.camera,
        rotation=np.diag([1.0, -1.0, -1.0]) @ view.camera.rotation,
        translation=np.diag([1.0, -1.0, -1.0]) @ view.camera.translation,
    )
    turned = replace(one_person, views=(replace(view, camera=away),))
    for preset in PRESETS.values():
        parameters = with_values(RunParameters(), preset)
        method = single_view.create("colour_phd", turned, 0, parameters, reader)
        assert all(len(result.boxes) == 0 for result in run(method, reader, 3))


def test_what_is_missing_is_said_with_what_to_do(one_person: Sequence, reader: FrameReader) -> None:
    template = one_person.templates[0]
    cases = {
        r"no template .* add at least one \[\[template\]\]": with_templates(one_person),
        r'"person1" \(cam9, frame 25\): there is no such camera; expected left': with_templates(
            one_person, replace(template, camera="cam9")
        ),
        "its picture cannot be read; choose another frame": with_templates(
            one_person, replace(template, frame=STEPS + 7)
        ),
        "lies outside the picture of 360x288; move it inside": with_templates(
            one_person, replace(template, box=np.array([900.0, 10.0, 20.0, 20.0]))
        ),
        "has no pictures; give it a video or images": replace(
            one_person, views=(View(one_person.cameras[0]),)
        ),
    }
    for message, sequence in cases.items():
        with pytest.raises(ValueError, match=message):
            method_of(sequence, reader)
    with pytest.raises(ValueError, match=r"one of colour_phd, .*, none, got 'magic'"):
        single_view.create("magic", one_person, 0, RunParameters(), reader)


def test_every_option_runs(one_person: Sequence, reader: FrameReader) -> None:
    options = [
        {"birth": "both", "output": "estimates"},
        {"birth": "entrances", "foreground_samples": 0.0},
        {"colour_space": "rgb", "histogram_kernel": "flat", "spread_starts": False},
        {"foreground_samples": 1.0, "samples": 20, "mean_shift_starts": 1},
        {"peaks_per_person": False, "max_components": 1},
    ]
    for option in options:
        method = method_of(one_person, reader, **option)
        assert isinstance(method, ColourPhd)
        assert len(run(method, reader, 4)) == 4
