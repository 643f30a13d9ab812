"""The experiment on data association: its clip, its errors, what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.papers.claims import jpda
from tests.papers.claims.jpda import STEPS, centre_errors
from tracker.single_view.protocol import ViewResult


def result(*estimates: tuple[int, float, float]) -> ViewResult:
    """Estimates by label and place."""
    boxes = np.array([[x, y, 4.0, 9.0] for _, x, y in estimates]).reshape(-1, 4)
    found = ViewResult.of_boxes(boxes, np.ones(len(boxes)), np.ones((len(boxes), 4)))
    return replace(found, estimate_labels=np.array([name for name, *_ in estimates], dtype=int))


def test_errors_are_those_of_the_assignment_of_least_distance() -> None:
    truth = np.array([[[0.0, 0.0], [10.0, 0.0]]] * 4)
    errors, switches = centre_errors(
        truth,
        [
            result((1, 1.0, 0.0), (2, 13.0, 4.0)),
            result((1, 10.0, 0.0)),  # one for both
            result(),
            result((2, 0.0, 2.0), (1, 10.0, 1.0), (9, 300.0, 0.0)),
        ],
    )
    np.testing.assert_allclose(errors, [[1.0, 5.0], [10.0, 0.0], [np.nan] * 2, [2.0, 1.0]])
    assert switches == 2


def test_the_two_cross_walk_together_and_part() -> None:
    scene = jpda.clip(3)
    places = np.array([scene.boxes(step)[:, :2] for step in range(STEPS)])
    apart = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    assert np.isfinite(places).all()
    assert apart[:30].min() > 40.0
    assert (apart < 2.0 * jpda.HALF_SIZES[0]).sum() > 30
    assert apart[-1] > 40.0
    side = np.sign(places[:, 0, 0] - places[:, 1, 0])
    assert (np.diff(side[side != 0]) != 0).sum() >= 3, "they cross more than once"
    first, second = scene.actors
    assert first.colours == second.colours
    assert first.seed == second.seed, "nothing but their paths tells them apart"


def test_the_middle_of_two_is_half_their_distance_from_either() -> None:
    scene = jpda.clip(0)
    step = next(k for k in range(STEPS) if np.linalg.norm(np.diff(scene.boxes(k)[:, :2].T)) < 12.0)
    # one measurement at that step alone
    one, none = replace(result(), measurements=np.zeros((1, 4))), result()
    results = [one if k == step else none for k in range(STEPS)]
    half = np.linalg.norm(np.diff(scene.boxes(step)[:, :2], axis=0)) / 2.0
    assert jpda.error_of_the_middle(scene, results) == pytest.approx(half)
