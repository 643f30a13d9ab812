"""The compiled updates and births against plain NumPy forms of the same formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.engine.standing import CAMERAS, HALF_EXTENTS, watch
from tracker import association
from tracker.camera import stacked
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.kernels import births as birth_kernels
from tracker.kernels.gating import Measurements
from tracker.kernels.labelled import marginals as marginal_kernels
from tracker.kernels.labelled.marginals import LabelledWeights, PairOdds

seeds = st.integers(0, 10_000)


def reference_shares(
    weights: ndarray,
    labels: ndarray,
    p_d: ndarray,
    births: range,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    boxes: int,
) -> tuple[ndarray, ndarray]:
    """Label by label: the factors of the missed and the weights of the pairs."""
    names = sorted(set(labels.tolist()))
    people = [name for name in names if name not in births]
    scale = {name: 1.0 / max(weights[labels == name].sum(), 1.0) for name in names}
    missed = [
        max(1.0 - (weights * p_d)[labels == name].sum() * scale[name], 1e-9) for name in people
    ]
    odds = np.array([np.exp(o) * scale[labels[j]] for j, o in zip(parents, log_odds, strict=True)])
    table = np.array(
        [
            [odds[(labels[parents] == name) & (measured == z)].sum() for z in range(boxes)]
            for name in people
        ]
    ).reshape(len(people), boxes)
    born = np.isin(labels[parents], list(births))
    nobody = 1.0 + np.array([odds[born & (measured == z)].sum() for z in range(boxes)])
    found = association.marginals(np.array(missed), table, nobody)
    factors = np.array(
        [
            scale[name]
            * (
                found.missed[people.index(name)] / missed[people.index(name)]
                if name in people
                else 1
            )
            for name in labels.tolist()
        ]
    )
    shares = np.zeros(len(parents))
    for pair, (j, z) in enumerate(zip(parents, measured, strict=True)):
        if labels[j] in births:
            shares[pair] = odds[pair] * found.unexplained[z] / nobody[z]
        else:
            row = people.index(labels[j])
            shares[pair] = odds[pair] * found.detected[row, z] / table[row, z]
    return factors, shares


@given(seeds, st.integers(1, 8), st.integers(0, 5))
def test_shared_boxes(seed: int, size: int, boxes: int) -> None:
    rng = np.random.default_rng(seed)
    weights, p_d = rng.uniform(0.01, 0.7, size), rng.uniform(0.0, 0.99, size)
    labels, births = rng.integers(1, 6, size), range(4, 6)
    pairs = [(j, z) for z in range(boxes) for j in range(size) if rng.random() < 0.7]
    parents = np.array([j for j, _ in pairs], dtype=np.int64)
    measured = np.array([z for _, z in pairs], dtype=np.int64)
    log_odds = rng.normal(0.0, 3.0, len(pairs))
    factors, shares, known = marginal_kernels.share_boxes(
        LabelledWeights(weights, labels, p_d),
        births.start,
        births.stop,
        PairOdds(parents, measured, log_odds, boxes),
        600.0,
        association.SETTLING,
    )
    expected = reference_shares(weights, labels, p_d, births, parents, measured, log_odds, boxes)
    assert_allclose(factors, expected[0], rtol=1e-9)
    assert_allclose(shares, expected[1], rtol=1e-9)
    assert_array_equal(known, labels[parents] < births.start)


@given(seeds, st.lists(st.integers(0, 4), min_size=1, max_size=4))
def test_free_boxes_are_those_that_nobody_explains(seed: int, counts: list[int]) -> None:
    unexplained = np.random.default_rng(seed).random(sum(counts))
    starts = np.cumsum([0, *counts])
    free, begins, cameras = birth_kernels.free_boxes(unexplained, starts, 0.5)
    by_camera = [np.flatnonzero(part > 0.5) for part in np.split(unexplained, starts[1:-1])]
    assert_array_equal(free, np.flatnonzero(unexplained > 0.5))
    assert np.diff(begins).tolist() == [len(part) for part in by_camera]
    assert cameras == sum(len(part) > 0 for part in by_camera)


@given(seeds, st.integers(0, 4), st.integers(0, 4))
def test_rays_meet_where_two_lines_are_nearest(seed: int, first: int, second: int) -> None:
    rng = np.random.default_rng(seed)
    rays = rng.normal(size=(first + second, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    centres = rng.uniform(-2.0, 2.0, (2, 3))
    starts = np.array([0, first, first + second])
    points, gaps = birth_kernels.meeting_points(rays, starts, centres, 1.5)
    expected = []
    for u in rays[:first]:
        for v in rays[first:]:
            along, _, _, _ = np.linalg.lstsq(
                np.stack([u, -v], axis=1), centres[1] - centres[0], rcond=None
            )
            on_a, on_b = centres[0] + along[0] * u, centres[1] + along[1] * v
            if (along > 0.1).all() and np.linalg.norm(on_a - on_b) < 1.5:
                expected.append((*(on_a + on_b) / 2.0, np.linalg.norm(on_a - on_b)))
    assert_allclose(np.column_stack([points, gaps]), np.array(expected).reshape(-1, 4), atol=1e-6)


def reference_fit(
    start: ndarray, boxes: list[tuple[ndarray, ndarray, ndarray]], model: TargetModel, gate: float
) -> tuple[ndarray, ndarray, list[int]]:
    """Gauss-Newton of one place, three passes, with NumPy's inverse."""
    place, covariance = start, np.eye(3)
    chosen = [-1] * len(boxes)
    for _ in range(3):
        information, pull = np.eye(3), start.copy()
        for c, (values, noises, free) in enumerate(boxes):
            expected = model.expected(CAMERAS[c], place[None])
            slope, best, chosen[c] = expected.jacobians[0], gate, -1
            for box in np.flatnonzero(free):
                residual = values[box] - expected.values[0]
                spread = noises[box] + slope @ covariance @ slope.T
                distance = residual @ np.linalg.inv(spread) @ residual
                if expected.valid[0] and distance <= best:
                    best, chosen[c] = distance, int(box)
            if chosen[c] >= 0:
                weight = slope.T @ np.linalg.inv(noises[chosen[c]])
                residual = values[chosen[c]] - expected.values[0]
                information = information + weight @ slope
                pull = pull + weight @ (residual + slope @ place)
        covariance = np.linalg.inv(information)
        place = covariance @ pull
    return place, covariance, chosen


def test_a_camera_says_nothing_of_a_place_far_aside_of_what_it_sees() -> None:
    """The lens's polynomial grows there by the fifth power: a millimetre is many pictures."""
    camera = replace(CAMERAS[0], distortion=np.array([-0.18, 0.03, 0.0, 0.0, 0.0]))
    model = TargetModel(np.array([0.02, 0.02, 0.02]), "box")
    right, _, forward = camera.rotation
    starts = np.array([camera.centre + 2.0 * right + depth * forward for depth in (0.1, 0.15)])
    expected = model.expected(camera, starts)
    assert expected.valid.all()
    assert np.abs(expected.jacobians).max(axis=(1, 2)).min() > 1e7
    box = expected.values[:1] * [0.0, 1.0, 1.0]  # as high, and in the picture
    places, covariances, sources, fits = birth_kernels.fit_places(
        starts,
        Measurements(box, 9.0 * np.eye(3)[None]),
        np.ones(1, dtype=bool),
        np.array([0, 1]),
        model.target(3),
        stacked((camera,)),
        birth_kernels.Refinement(start_sigma=1.0, passes=3, gate=21.0),
    )
    assert (sources == -1).all()
    assert not fits.any()
    assert_allclose(places, starts)
    assert_allclose(covariances, np.broadcast_to(np.eye(3), (2, 3, 3)))


@pytest.mark.parametrize("kind", ["centre", "box", "box_and_width"])
@pytest.mark.parametrize("seed", range(3))
def test_places_are_fitted_as_by_numpy(kind: MeasurementKind, seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = TargetModel(HALF_EXTENTS, kind)
    people = np.append(rng.uniform(-1.8, 1.8, (4, 2)), np.full((4, 1), 0.85), axis=1)
    boxes = []
    for view in watch(people[None], clutter_rate=2.0, seed=seed)[0]:
        values, noises = model.measured(view, 1.0)
        boxes.append((values, noises, rng.random(len(values)) < 0.8))
    starts = people[rng.integers(0, 4, 12)] + rng.normal(0.0, 0.3, (12, 3))
    counts = [len(values) for values, _, _ in boxes]
    places, covariances, sources, fits = birth_kernels.fit_places(
        starts,
        Measurements(*(np.concatenate([one[k] for one in boxes]) for k in range(2))),
        np.concatenate([free for _, _, free in boxes]),
        np.cumsum([0, *counts]),
        model.target(3),
        stacked(CAMERAS),
        birth_kernels.Refinement(start_sigma=1.0, passes=3, gate=21.0),
    )
    for n, start in enumerate(starts):
        place, covariance, chosen = reference_fit(start, boxes, model, 21.0)
        assert_allclose(places[n], place, atol=1e-8)
        assert_allclose(covariances[n], covariance, atol=1e-10)
        assert sources[:, n].tolist() == chosen
        for c, box in enumerate(chosen):
            if box < 0:
                assert fits[c, n] == 0.0
                continue
            residual = boxes[c][0][box] - model.expected(CAMERAS[c], place[None]).values[0]
            noise = boxes[c][1][box]
            _, size = np.linalg.slogdet(2.0 * np.pi * noise)
            fit = -0.5 * (residual @ np.linalg.inv(noise) @ residual + size)
            assert fits[c, n] == pytest.approx(fit, abs=1e-8)
