"""Vectors of an outside network beside the boxes tell who returns, where nothing else does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.engine.synthetic import CAMERAS, observe, sequence, walk
from tracker import pipeline
from tracker.parameters import RunParameters, with_values
from tracker.sequences.sequence import Detections, Sequence

STEPS, LENGTH = 260, 32
PLAIN = RunParameters(single_view="none", smoothing_method="identities")


def told(noise: float = 0.3) -> Sequence:
    """Two who leave for five seconds and come back on each other's side, with a vector a box."""
    left, right = (walk((x, -0.9, 1.0), (x, 0.9, 1.0), 60) for x in (-0.8, 0.8))
    people = [(0, left), (0, right), (190, right[:60]), (190, left[:60])]
    rng = np.random.default_rng(5)
    looks = rng.normal(size=(2, LENGTH))
    apart = [observe([one], STEPS, CAMERAS, seed=k) for k, one in enumerate(people)]
    whole = sequence(people, STEPS)
    views = []
    for number, view in enumerate(whole.views):
        pieces = [own[number] for own in apart]
        frames = np.concatenate([own.frames for own in pieces])
        order = np.argsort(frames, kind="stable")
        who = np.repeat([0, 1, 0, 1], [len(own.frames) for own in pieces])
        vectors = looks[who] + noise * rng.normal(size=(len(who), LENGTH))
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        views.append(
            replace(
                view,
                detections=Detections(
                    frames[order],
                    np.concatenate([own.boxes for own in pieces])[order],
                    np.ones(len(frames)),
                    vectors[order].astype(np.float16),
                ),
            )
        )
    return replace(whole, views=tuple(views))


def sides(whole: Sequence, weight: float) -> tuple[list[int], list[int]]:
    """The ids from left to right, before and after."""
    tracks = pipeline.compute(whole, with_values(PLAIN, {"smoothing.appearance": weight})).tracks
    found = []
    for step in (30, 220):
        own = tracks.at(step)
        found.append(tracks.ids[own][np.argsort(tracks.positions[own, 0])].tolist())
    return found[0], found[1]


def test_who_returns_on_the_other_side_is_known_by_vectors() -> None:
    before, after = sides(told(), 1.0)
    assert after == before[::-1]


def test_without_weight_they_say_nothing() -> None:
    with_vectors, plain = told(), told()
    plain = replace(
        plain,
        views=tuple(
            replace(view, detections=replace(view.detections, looks=np.zeros((0, 0), np.float16)))
            for view in plain.views
            if view.detections is not None
        ),
    )
    assert sides(with_vectors, 0.0) == sides(plain, 1.0)
    before, after = sides(plain, 1.0)
    assert after != before[::-1]


@pytest.mark.parametrize("method", ["none", "detection_phd"])
def test_vectors_stay_with_their_boxes(method: str) -> None:
    whole = told()
    run = pipeline.compute(
        whole, with_values(RunParameters(), {"single_view": method, "smoothing_method": "none"})
    )
    for step in (0, 30, 200):
        for view, result in zip(whole.views, run.views[step], strict=True):
            own = view.detections
            assert own is not None
            rows = own.at(step)
            middles = own.boxes[rows, :2] + own.boxes[rows, 2:] / 2.0
            assert len(result.looks) == len(result.boxes)
            for box, looks in zip(result.boxes, result.looks, strict=True):
                row = int(np.argmin(np.linalg.norm(middles - box[:2], axis=1)))
                np.testing.assert_array_equal(looks, own.looks[rows][row])
