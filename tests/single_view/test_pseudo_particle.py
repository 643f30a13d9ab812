"""The particle filters follow painted heads, tell who comes and goes, and survive bad pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.engine.painted import (
    RED,
    corner_box,
    painted_sequence,
    true_boxes,
    with_templates,
)
from tests.engine.synthetic import CAMERAS, HALF_EXTENTS, walk
from tracker import pipeline, single_view
from tracker.parameters import PRESETS, RunParameters, with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, Template, View
from tracker.single_view.protocol import ViewResult
from tracker.single_view.pseudo_particle.method import PseudoParticle

STEPS = 50

VARIANTS: dict[str, dict[str, object]] = {
    "default": {},
    "published": {
        key.removeprefix("pseudo_particle."): value
        for key, value in PRESETS["published"].items()
        if key.startswith("pseudo_particle.")
    },
    "classical": {"filter": "classical"},
}
every_variant = pytest.mark.parametrize("variant", VARIANTS)


@pytest.fixture(scope="module")
def one_person(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Somebody walks in by the left entrance and across the room."""
    path = walk((-1.2, 0.0, 1.0), (1.0, 0.3, 1.05), STEPS, sway=0.3)
    return painted_sequence(tmp_path_factory.mktemp("one"), [path], [RED])


@pytest.fixture(scope="module")
def two_alike(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """Two people of the same colours walk side by side, well apart in the picture."""
    aside = CAMERAS[0].rotation[0] * 0.5
    path = walk((-0.4, 0.0, 1.0), (0.3, 0.2, 1.0), STEPS)
    return painted_sequence(tmp_path_factory.mktemp("two"), [path - aside, path + aside], [RED] * 2)


@pytest.fixture(scope="module")
def reader(one_person: Sequence) -> Iterator[FrameReader]:
    with FrameReader(one_person) as opened:
        yield opened


def parameters_of(**changes: object) -> RunParameters:
    keys = {f"pseudo_particle.{name}": value for name, value in changes.items()}
    return with_values(RunParameters(single_view="pseudo_particle"), keys)


def method_of(sequence: Sequence, reader: FrameReader, **changes: object) -> PseudoParticle:
    method = single_view.create("pseudo_particle", sequence, 0, parameters_of(**changes), reader)
    assert isinstance(method, PseudoParticle)
    return method


def run(
    method: PseudoParticle, pictures: list[ndarray | None], seed: int = 0, state: object = None
) -> list[ViewResult]:
    state, results = state or method.start(), []
    for step, picture in enumerate(pictures):
        rng = np.random.default_rng((seed, step))
        state, result = method.step(state, step, picture, rng)  # type: ignore[arg-type]
        results.append(result)
    return results


def film(reader: FrameReader, steps: int = STEPS) -> list[ndarray | None]:
    return [reader.picture(0, step) for step in range(steps)]


def off(box: ndarray, boxes: ndarray) -> float:
    """How far the nearest box's centre is, in half sizes."""
    apart = (boxes[:, :2] - box[:2]) / box[2:]
    return float(np.linalg.norm(apart, axis=1).min()) if len(boxes) else np.inf


def within_radius(sequence: Sequence, results: list[ViewResult], boxes: str) -> ndarray:
    """(steps, people): whether each is found within its radius."""
    return np.array(
        [
            [off(box, getattr(result, boxes)) < 1.0 for box in true_boxes(sequence, step)]
            for step, result in enumerate(results)
        ]
    )


def events_of(results: list[ViewResult]) -> Counter[str]:
    return Counter(event.kind for result in results for event in result.events)


@pytest.mark.full
def test_a_person_is_followed_under_one_id(one_person: Sequence, reader: FrameReader) -> None:
    results = run(method_of(one_person, reader), film(reader))
    assert within_radius(one_person, results, "boxes")[2:].mean() > 0.95
    assert within_radius(one_person, results, "estimates")[6:].mean() > 0.95
    assert np.mean([len(result.boxes) for result in results]) < 1.1
    assert events_of(results) == {"new": 1}
    assert set(np.concatenate([r.estimate_labels for r in results[10:]])) == {1}


@pytest.mark.parametrize("variant", ["published", "classical"])
def test_the_other_filters_follow_one_person_in_plain_sight(
    one_person: Sequence, reader: FrameReader, variant: str
) -> None:
    results = run(method_of(one_person, reader, **VARIANTS[variant]), film(reader))
    assert within_radius(one_person, results, "estimates")[12:].mean() > 0.9


@pytest.mark.full
def test_two_alike_are_both_followed_where_the_classical_filter_has_one_mean(
    two_alike: Sequence,
) -> None:
    with FrameReader(two_alike) as reader:
        results = run(method_of(two_alike, reader), film(reader))
        classical = run(method_of(two_alike, reader, filter="classical"), film(reader))
    both = within_radius(two_alike, results, "estimates")[6:]
    assert both.all(axis=1).mean() > 0.95
    for result in results[10:]:
        assert set(result.estimate_labels) == {1, 2}
    alone = within_radius(two_alike, classical, "estimates")
    assert all(len(result.estimates) == 1 for result in classical)
    assert not alone.all(axis=1).any()


@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_resampled_particles_are_few_and_those_drawn_anew_are_shared_out(
    two_alike: Sequence, spread: float
) -> None:
    with FrameReader(two_alike) as reader:
        method = method_of(two_alike, reader, redistribution=spread, resampling="together")
        state = method.start()
        for step, picture in enumerate(film(reader, 12)):
            state, result = method.step(state, step, picture, np.random.default_rng(step))
    assert len(result.estimates) == 2
    count = len(state.particles)
    assert count == round(400 * (1.0 - parameters_of().pseudo_particle.newcomer_share))
    distinct = len(np.unique(state.particles, axis=0))
    if spread == 0.0:
        assert distinct < 0.6 * count
        return
    assert distinct == count
    boxes = result.estimates
    apart = np.linalg.norm(state.particles[:, None, :2] - boxes[None, :, :2], axis=2)
    np.testing.assert_allclose(np.bincount(apart.argmin(axis=1)) / count, [0.5, 0.5], atol=0.02)
    own = state.particles[apart.argmin(axis=1) == 0, :2]
    np.testing.assert_allclose(own.std(axis=0) / boxes[0, 2:], [spread, spread], rtol=0.3)


def test_who_leaves_has_vanished_and_who_comes_back_has_returned(
    one_person: Sequence, reader: FrameReader
) -> None:
    empty = reader.picture(0, 0)
    assert empty is not None
    pictures = film(reader, 30)
    # the wall of the first picture, where nobody is in the part that is filled in
    nobody: list[ndarray | None] = []
    for step in range(30, 45):
        picture, box = reader.picture(0, 30), true_boxes(one_person, 30)[0]
        assert picture is not None
        hidden = picture.copy()
        left, top, width, height = np.rint(corner_box(box) + np.array([-3, -3, 6, 6])).astype(int)
        patch = np.s_[top : top + height, left : left + width]
        hidden[patch] = empty[patch]
        nobody.append(hidden if step else None)
    method = method_of(one_person, reader, patience=0.4)
    results = run(method, pictures + nobody + film(reader, 45)[30:])
    assert events_of(results) == {"new": 1, "vanished": 1, "returned": 1}
    assert len(results[44].estimates) == 0
    np.testing.assert_array_equal(results[-1].estimate_labels, [1])


def test_the_same_seed_gives_the_same_result(one_person: Sequence, reader: FrameReader) -> None:
    first, second, other = (
        run(method_of(one_person, reader), film(reader, 6), seed) for seed in (3, 3, 4)
    )
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.boxes, b.boxes)
        np.testing.assert_array_equal(a.samples, b.samples)
    assert not np.array_equal(first[-1].samples, other[-1].samples)


@every_variant
def test_results_have_consistent_shapes(
    one_person: Sequence, reader: FrameReader, variant: str
) -> None:
    changes = VARIANTS[variant]
    method, state = method_of(one_person, reader, **changes), None
    p = parameters_of(**changes).pseudo_particle
    state = method.start()
    for step, picture in enumerate(film(reader, 12)):
        state, result = method.step(state, step, picture, np.random.default_rng(step))
        assert result.boxes.shape == result.sigmas.shape == (len(result.weights), 4)
        assert len(result.labels) == len(result.boxes)
        assert len(result.estimates) == len(result.estimate_labels) == len(result.estimate_weights)
        assert result.samples.dtype == result.sample_weights.dtype == np.float32
        assert result.samples.shape == (len(result.sample_weights), 4)
        assert len(result.samples) <= p.samples
        assert len(state.particles) <= p.samples
        for weights in (result.weights, result.measurement_scores, result.estimate_weights):
            assert np.all((weights >= 0.0) & (weights <= 1.0))
        np.testing.assert_allclose(result.sigmas[:, :2] / result.boxes[:, 2:], p.centre_sigma)
        assert result.gates.shape[1] == 5
        assert np.isfinite(result.gates).all()
        if p.output == "targets":
            assert set(result.labels) <= set(result.estimate_labels)


def test_a_missing_picture_only_spreads_the_particles(
    one_person: Sequence, reader: FrameReader
) -> None:
    method = method_of(one_person, reader)
    state = method.start()
    for step, picture in enumerate(film(reader, 10)):
        state, before = method.step(state, step, picture, np.random.default_rng(step))
    after, result = method.step(state, 10, None, np.random.default_rng(10))
    assert len(result.boxes) == len(result.measurements) == len(result.samples) == 0
    np.testing.assert_array_equal(result.estimates, before.estimates)
    assert after.tracks is state.tracks
    assert after.particles[:, 0].std() > state.particles[:, 0].std()
    found = method.step(after, 11, reader.picture(0, 11), np.random.default_rng(11))[1]
    assert off(true_boxes(one_person, 11)[0], found.estimates) < 1.0


@pytest.mark.full
@every_variant
@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_frames_are_survived(
    one_person: Sequence, reader: FrameReader, level: int, variant: str
) -> None:
    method = method_of(one_person, reader, **VARIANTS[variant])
    width, height = one_person.cameras[0].image_size
    blank = np.full((height, width, 3), level, dtype=np.uint8)
    results = run(method, [blank] * 4)
    assert all(np.isfinite(result.estimates).all() for result in results)
    if variant != "classical":
        assert all(len(result.boxes) == 0 for result in results)
    # and in the middle of a film they hide people, for as long as one waits for them
    film_with_gap = [*film(reader, 20), blank, blank, *film(reader, 40)[22:]]
    results = run(method, film_with_gap)
    assert within_radius(one_person, results[:40], "estimates")[28:].mean() > 0.9


@pytest.mark.full
@every_variant
def test_a_frozen_camera_is_survived(one_person: Sequence, variant: str) -> None:
    view = one_person.views[0]
    frozen = replace(one_person, views=(replace(view, images=(view.images[0],) * STEPS),))
    frozen = with_templates(frozen, Template("p", "left", 3, np.array([100.0, 100.0, 20.0, 30.0])))
    with FrameReader(frozen) as reader:
        # for a hundred steps and more there is no foreground
        results = run(method_of(frozen, reader, **VARIANTS[variant]), film(reader, 8) * 13)
    assert all(np.isfinite(result.estimates).all() for result in results)
    if variant == "default":
        # all is background, whatever the templates show
        assert all(len(result.boxes) == 0 for result in results)


@every_variant
def test_targets_of_a_pixel(tmp_path_factory: pytest.TempPathFactory, variant: str) -> None:
    path = walk((-0.5, 0.0, 1.0), (0.5, 0.0, 1.0), 8)
    tiny = painted_sequence(
        tmp_path_factory.mktemp("tiny"), [path], [RED], half_extents=HALF_EXTENTS / 40.0
    )
    with FrameReader(tiny) as reader:
        results = run(method_of(tiny, reader, **VARIANTS[variant]), film(reader, 8))
    assert all(np.isfinite(result.boxes).all() for result in results)


@every_variant
def test_a_camera_that_looks_away_finds_nobody(
    one_person: Sequence, reader: FrameReader, variant: str
) -> None:
    view = one_person.views[0]
    away = replace(
        view.camera,
        rotation=np.diag([1.0, -1.0, -1.0]) @ view.camera.rotation,
        translation=np.diag([1.0, -1.0, -1.0]) @ view.camera.translation,
    )
    turned = replace(one_person, views=(replace(view, camera=away),))
    results = run(method_of(turned, reader, **VARIANTS[variant]), film(reader, 3))
    assert all(len(result.boxes) == 0 for result in results)


@pytest.mark.full
def test_a_camera_without_pictures_to_read_takes_nothing_from_the_others(
    one_person: Sequence, reader: FrameReader
) -> None:
    view = one_person.views[0]
    short = replace(view, camera=replace(view.camera, name="short"), images=view.images[:20])
    both = replace(one_person, views=(view, short), digest="both")
    chosen = parameters_of()
    alone = pipeline.compute(one_person, chosen, steps=30)
    together = pipeline.compute(both, chosen, steps=30)
    for step in range(30):
        np.testing.assert_array_equal(
            alone.views[step][0].estimates, together.views[step][0].estimates
        )
    assert len(together.views[29][1].boxes) == 0


def test_what_is_missing_is_said_with_what_to_do(one_person: Sequence, reader: FrameReader) -> None:
    cases = {
        r"no template .* add at least one \[\[template\]\]": with_templates(one_person),
        "has no pictures; give it a video or images": replace(
            one_person, views=(View(one_person.cameras[0]),)
        ),
    }
    for message, sequence in cases.items():
        with pytest.raises(ValueError, match=message):
            method_of(sequence, reader)


def test_every_option_runs(two_alike: Sequence) -> None:
    options: list[dict[str, object]] = [
        {"redistribution": 0.0, "resampling": "together"},
        {"targets_per_person": 1, "output": "targets", "confirmation": 1},
        {"samples": 20, "newcomer_share": 1.0},
        {"newcomer_share": 0.0, "smallest_cluster": 0.5},
        {"sharpness": 200.0, "patience": 0.0, "memory": 0.0},
        {"filter": "classical", "birth": "picture", "samples": 20},
    ]
    with FrameReader(two_alike) as reader:
        for option in options:
            results = run(method_of(two_alike, reader, **option), film(reader, 8))
            assert len(results) == 8
            for result in results:
                labels = result.estimate_labels
                assert len(set(labels)) == len(labels)
