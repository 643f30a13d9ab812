"""What changes nothing, or changes results as it changes what is seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tests.single_view.scenery import CAMERA, detected, run
from tracker.single_view.protocol import ViewResult

METHODS: dict[str, dict[str, object]] = {
    "none": {},
    "detection_phd": {"detection_boxes.pixel_sigma": 0.0},
    "jpda": {"confirmation_steps": 2, "detection_probability": 0.8},
}
methods = pytest.mark.parametrize("name", METHODS)

Change = Callable[[ndarray], ndarray]

PATHS = world.together(
    world.walk([(-0.9, 0.0), (0.9, 0.3)], [0, 2], 10.0),
    world.walk([(0.9, 0.2), (-0.9, 0.1)], [0, 2], 10.0),
)


def watched() -> tuple[list[ndarray], list[float]]:
    """Two who pass each other, missed at times, among false boxes; and a score of each box."""
    rng = np.random.default_rng(11)
    seen = world.boxes((CAMERA,), PATHS, 2.0, rng, misses=0.1, clutter=1.0)[0]
    steps = [seen.boxes[seen.frames == step] for step in range(seen.steps)]
    return steps, rng.uniform(0.3, 1.0, len(seen.boxes)).tolist()


def results(
    name: str, steps: list[ndarray], scores: list[float], size: tuple[int, int] = CAMERA.image_size
) -> list[ViewResult]:
    camera = replace(CAMERA, image_size=size)
    return run(name, detected(steps, scores, camera=camera), **METHODS[name])


def table(
    result: ViewResult, change: Callable[[ndarray], ndarray] = lambda boxes: boxes
) -> ndarray:
    """Boxes, weights and estimates in an order of their own."""
    rows = [np.column_stack([change(result.boxes), result.weights, np.zeros(len(result.boxes))]),
            np.column_stack([change(result.estimates), result.estimate_weights,
                             np.ones(len(result.estimates))])]  # fmt: skip
    whole = np.concatenate(rows)
    return whole[np.lexsort(np.round(whole, 5).T)]


@methods
def test_the_order_of_the_boxes_changes_nothing(name: str) -> None:
    steps, scores = watched()
    begins = np.cumsum([0, *map(len, steps)])
    turned = [step[::-1] for step in steps]
    turned_scores = [s for a, b in pairwise(begins) for s in scores[a:b][::-1]]
    names: dict[int, int] = {}
    for one, other in zip(
        results(name, steps, scores), results(name, turned, turned_scores), strict=True
    ):
        assert_allclose(table(one), table(other), atol=1e-6)
        # who is who, too, whatever the labels are
        for box, label in zip(one.estimates, one.estimate_labels, strict=True):
            row = np.abs(other.estimates - box).max(axis=1).argmin()
            assert names.setdefault(int(label), int(other.estimate_labels[row])) == int(
                other.estimate_labels[row]
            )
    assert len(set(names.values())) == len(names)


@methods
def test_a_mirrored_picture_gives_mirrored_boxes(name: str) -> None:
    def mirror(boxes: ndarray) -> ndarray:
        return boxes * [-1.0, 1.0, 1.0, 1.0] + [CAMERA.image_size[0] - 1.0, 0.0, 0.0, 0.0]

    steps, scores = watched()
    mirrored = results(name, [mirror(step) for step in steps], scores)
    for one, other in zip(results(name, steps, scores), mirrored, strict=True):
        assert_allclose(table(one, mirror), table(other), atol=1e-6)
        assert_allclose(one.sigmas, other.sigmas)
        assert_allclose(one.gates * [-1.0, 1.0, 1.0, -1.0, 1.0] + [CAMERA.image_size[0] - 1.0,
                        0.0, 0.0, 0.0, 0.0], other.gates, atol=1e-6)  # fmt: skip


@pytest.mark.parametrize("name", ["none", "detection_phd"])
def test_a_picture_of_twice_the_size_gives_boxes_of_twice_the_size(name: str) -> None:
    steps, scores = watched()
    # what lies wholly within the picture: its edges lie half a pixel outside of its pixels
    steps = [np.concatenate([step[:, :1], np.clip(step[:, 1:2], 220.0, 560.0), step[:, 2:]], axis=1)
             for step in steps]  # fmt: skip
    width, height = CAMERA.image_size
    twice = results(name, [2.0 * step for step in steps], scores, (2 * width, 2 * height))
    for one, other in zip(results(name, steps, scores), twice, strict=True):
        assert_allclose(table(one, lambda boxes: 2.0 * boxes), table(other), atol=1e-5)
        if name == "detection_phd":
            assert_allclose(2.0 * one.sigmas, other.sigmas)
