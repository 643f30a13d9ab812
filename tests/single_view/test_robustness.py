"""What cameras do besides: no picture, black ones, a view of nothing, targets of a pixel."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests import world
from tests.single_view.test_scenes import (
    SMALL,
    VARIANTS,
    every_variant,
    film,
    method_of,
    numbers,
    run,
)
from tracker import single_view
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, View
from tracker.single_view.pictures.background import unpack
from tracker.single_view.protocol import unpack_samples


@every_variant
def test_results_repeat_and_fit_together(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    first, second = (run(method_of(variant, heads, reader), film(reader, 4))[1] for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert numbers(one) == numbers(other)
        assert one.boxes.shape == one.sigmas.shape == (len(one.weights), 4)
        assert len(one.labels) == len(one.boxes)
        assert one.estimates.shape == (len(one.estimate_labels), 4)
        assert len(one.estimate_weights) == len(one.estimates)
        assert one.measurements.shape == (len(one.measurement_scores), 4)
        centres, weights = unpack_samples(one.samples)
        assert centres.shape == (len(weights), 2)
        assert weights.max(initial=1.0) == 1.0
        assert (one.sigmas > 0.0).all()
        for weights in (one.weights, one.measurement_scores, one.estimate_weights):
            assert ((weights >= 0.0) & (weights <= 1.0 + 1e-9)).all() or "colours" in variant
        assert len(set(one.estimate_labels.tolist())) == len(one.estimates)
        if one.foreground is not None:
            assert unpack(one.foreground).shape == heads.cameras[0].image_size[::-1]


@every_variant
def test_without_a_picture_nothing_is_measured_and_nobody_forgotten(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    method = method_of(variant, heads, reader)
    state, results = run(method, film(reader, 5))
    after, result = method.step(state, 5, None, np.random.default_rng(9))
    assert len(result.measurements) == len(result.samples) == 0
    assert result.foreground is None
    if variant != "particles, classical":  # of whom nobody can tell from where he was
        assert_array_equal(np.sort(result.estimate_labels), np.sort(results[-1].estimate_labels))
    _, back = method.step(after, 6, reader.picture(0, 6), np.random.default_rng(6))
    assert len(back.measurements) > 0 or variant == "shapes"  # to which a head is no person


@every_variant
def test_frames_that_show_nothing_are_survived(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    picture = reader.picture(0, 2)
    assert picture is not None
    noise = np.random.default_rng(1).integers(0, 256, picture.shape, dtype=np.uint8)
    blank = [np.zeros_like(picture), np.full_like(picture, 255), noise]
    _, results = run(method_of(variant, heads, reader), [*film(reader, 3), *blank])
    for result in results:
        for array in (result.boxes, result.weights, result.sigmas, result.estimates, result.gates):
            assert np.isfinite(array).all()
    if variant not in ("particles, classical", "colours, published", "particles, published"):
        assert [len(result.measurements) for result in results[3:5]] == [0, 0]


@every_variant
def test_a_camera_that_sees_nothing_of_the_room_finds_nobody(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    view, around = heads.views[0], np.diag([1.0, -1.0, -1.0])
    away = replace(
        view.camera,
        rotation=around @ view.camera.rotation,
        translation=around @ view.camera.translation,
    )
    turned = replace(heads, views=(replace(view, camera=away),), digest="turned")
    method = method_of(variant, turned, reader, **{"association_matrix.output": "targets"})
    for result in run(method, film(reader, 3))[1]:
        if VARIANTS[variant].get("jpda.foreground_box") != "piece":
            assert len(result.boxes) == 0


@every_variant
def test_targets_of_a_pixel_raise_nothing(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    tiny = replace(heads, target_half_extents=world.HEAD / 40.0)
    for result in run(method_of(variant, tiny, reader), film(reader, 3))[1]:
        assert np.isfinite(result.boxes).all()
        assert np.isfinite(result.sigmas).all()


@every_variant
def test_what_is_missing_is_said_with_what_to_do(
    variant: str, heads: Sequence, reader: FrameReader
) -> None:
    blind = replace(heads, views=(View(heads.cameras[0]),))
    with pytest.raises(ValueError, match=r'"cam1" of world has no pictures; give it a video'):
        method_of(variant, blind, reader)
    lost = replace(heads, views=(replace(heads.views[0], images=(Path("nowhere.png"),) * 8),))
    if VARIANTS[variant]["single_view"] in ("association_matrix", "shapes"):
        with FrameReader(lost) as opened:
            assert all(
                not len(r.boxes) for r in run(method_of(variant, lost, opened), [None] * 2)[1]
            )


def test_a_template_that_cannot_be_used_is_named(heads: Sequence, reader: FrameReader) -> None:
    template = heads.templates[0]
    changed = partial(replace, template)
    cases = {
        r"no template .* add at least one \[\[template\]\]": (),
        r'"red" \(cam9, frame 4\): there is no such camera; expected cam1': (
            changed(camera="cam9"),
        ),
        "its picture cannot be read; choose another frame": (changed(frame=700),),
        r"lies outside the picture of 96x72; move it inside": (
            changed(box=np.array([900.0, 10.0, 20.0, 20.0])),
        ),
    }
    for variant in ("colours", "particles"):
        for message, templates in cases.items():
            with pytest.raises(ValueError, match=message):
                method_of(variant, replace(heads, templates=templates), reader)
    with pytest.raises(ValueError, match=r"one of colour_phd, .*, none, got 'magic'"):
        single_view.create("magic", heads, 0, RunParameters(), reader)


@pytest.mark.parametrize("name", ["colour_phd", "pseudo_particle", "jpda", "association_matrix"])
def test_every_method_with_pictures_tells_whose_colours_its_boxes_have(
    heads: Sequence, name: str
) -> None:
    parameters = with_values(RunParameters(), SMALL | {"single_view": name})
    found = pipeline.compute(heads, parameters, seed=0)
    boxes = [view for views in found.views for view in views if len(view.boxes)]
    assert all(view.likenesses.shape == (len(view.boxes), 2) for view in boxes)
    sure = np.concatenate([view.likenesses for view in boxes]).max(axis=1)
    assert np.median(sure) > 0.9


@pytest.mark.parametrize("spoilt", ["missing", "frozen"])
def test_a_spoilt_camera_takes_nothing_from_the_others(heads: Sequence, spoilt: str) -> None:
    view = heads.views[0]
    images = (Path("nowhere.png"),) * 8 if spoilt == "missing" else view.images[:1] * 8
    second = replace(view, camera=replace(view.camera, name="second"), images=images)
    parameters = with_values(RunParameters(), SMALL | {"single_view": "jpda"})
    alone = pipeline.compute(heads, parameters)
    both = replace(heads, views=(view, second), digest=f"{heads.digest} {spoilt}")
    together = pipeline.compute(both, parameters)
    assert together.complete
    for ours, theirs in zip(alone.views, together.views, strict=True):
        assert numbers(ours[0]) == numbers(theirs[0])
