"""The compiled updates and births against plain NumPy forms of the same formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.world import PERSON, boxes, ring, views
from tracker.filters import association
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.geometry.camera import stacked
from tracker.kernels import bernoulli as marginal_kernels
from tracker.kernels import births as birth_kernels
from tracker.kernels.bernoulli import LabelledWeights, PairOdds
from tracker.kernels.kalman import Measurements

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
    odds = np.exp(np.minimum(log_odds, 600.0)) * [scale[labels[j]] for j in parents]
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
    weights = rng.choice([0.01, 0.3, 0.7, 1.0], size)
    p_d = rng.choice([0.0, 0.5, 0.99, 1.0], size)
    labels, births = rng.integers(1, 7, size), range(4, 6)  # label 6 is a person's again
    pairs = [(j, z) for z in range(boxes) for j in range(size) if rng.random() < 0.7]
    parents = np.array([j for j, _ in pairs], dtype=np.int64)
    measured = np.array([z for _, z in pairs], dtype=np.int64)
    log_odds = rng.normal(0.0, 3.0, len(pairs))
    log_odds[rng.random(len(pairs)) < 0.1] = 650.0  # as good as certain
    factors, shares, known = marginal_kernels.share_boxes(
        LabelledWeights(weights, labels, p_d),
        births.start,
        births.stop,
        PairOdds(parents, measured, log_odds, boxes),
        600.0,
        association.CONVERGENCE,
    )
    expected = reference_shares(weights, labels, p_d, births, parents, measured, log_odds, boxes)
    assert_allclose(factors, expected[0], rtol=1e-9)
    assert_allclose(shares, expected[1], rtol=1e-9)
    assert_array_equal(known, ~np.isin(labels[parents], list(births)))


@given(seeds, st.lists(st.integers(0, 4), min_size=1, max_size=4))
def test_free_boxes_are_those_that_nobody_explains(seed: int, counts: list[int]) -> None:
    unexplained = np.random.default_rng(seed).choice([0.2, 0.5, 0.501, 0.9], sum(counts))
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
    points, gaps, pairs = birth_kernels.meeting_points(rays, starts, centres, 1.5)
    expected = []
    for i, u in enumerate(rays[:first]):
        for j, v in enumerate(rays[first:], first):
            along, _, _, _ = np.linalg.lstsq(
                np.stack([u, -v], axis=1), centres[1] - centres[0], rcond=None
            )
            on_a, on_b = centres[0] + along[0] * u, centres[1] + along[1] * v
            if (along > 0.1).all() and np.linalg.norm(on_a - on_b) < 1.5:
                expected.append((*(on_a + on_b) / 2.0, np.linalg.norm(on_a - on_b), i, j))
    found = np.column_stack([points, gaps, pairs])
    assert_allclose(found, np.array(expected).reshape(-1, 6), atol=1e-6)


@pytest.mark.parametrize(
    ("place", "largest_gap", "meets"),
    [
        # behind a lens or hardly ahead of it nobody stands, before either camera
        ((0.1, -1.0, 0.0), 1.0, False),
        ((0.101, -1.0, 0.0), 1.0, True),
        ((1.0, -0.1, 0.0), 1.0, False),
        ((1.0, -0.101, 0.0), 1.0, True),
        ((1.0, 1.0, 0.0), 1.0, False),
        # so far apart is too far
        ((1.0, -1.0, 0.5), 0.5, False),
        ((1.0, -1.0, -0.5), 0.501, True),
    ],
)
def test_rays_meet_ahead_of_both_lenses_and_close_by(
    place: tuple[float, ...], largest_gap: float, meets: bool
) -> None:
    rays, centres = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0.0] * 3, place])
    points, gaps, _ = birth_kernels.meeting_points(rays, np.arange(3), centres, largest_gap)
    assert gaps.tolist() == ([abs(place[2])] if meets else [])
    assert points.tolist() == ([[place[0], 0.0, place[2] / 2.0]] if meets else [])


def test_nearly_parallel_rays_meet_as_those_a_thousandth_apart_do() -> None:
    half = 2.5e-4  # so sin² of the angle between is a quarter of the millionth that counts
    rays = np.array([[np.cos(half), sign * np.sin(half), 0.0] for sign in (1.0, -1.0)])
    points, _, _ = birth_kernels.meeting_points(
        rays, np.arange(3), np.array([[0.0, 0.0, 0.0], [0.0, 0.001, 0.0]]), 9.0
    )
    # 0.001 / (2 sin ½α) = 2 m ahead, of which a quarter
    assert_allclose(points, [[0.5, 0.0005, 0.0]], rtol=1e-3)


CAMERAS = ring(4, 4.4)
NOTHING = 2
"""The camera that has no box."""

NO_PAIR = np.full((1, 2), -1)
"""A seed that was not found by two boxes."""


def seen_by(camera: int, model: TargetModel, places: ndarray) -> Any:
    """What a camera should measure of people."""
    return model.expected(CAMERAS[camera], places)


def reference_fit(
    start: ndarray,
    pair: list[tuple[int, int]],
    boxes: list[tuple[ndarray, ndarray, ndarray]],
    model: TargetModel,
    refinement: birth_kernels.Refinement,
) -> tuple[ndarray, ndarray, list[int]]:
    """Gauss-Newton of one place, with NumPy's inverse; first by a pair of cameras and boxes."""
    place, bound = start, np.eye(3) / refinement.start_sigma**2
    covariance, chosen = np.linalg.inv(bound), [-1] * len(boxes)
    for turn in range(refinement.passes + 1):
        information, pull = bound.copy(), bound @ start
        for c, (values, noises, free) in enumerate(boxes):
            expected = seen_by(c, model, place[None])
            slope, best, chosen[c] = expected.jacobians[0], refinement.gate, -1
            for box in (
                [one for camera, one in pair if camera == c] if turn == 0 else np.flatnonzero(free)
            ):
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


@pytest.mark.parametrize("kind", ["centre", "box", "box_and_width"])
@pytest.mark.parametrize(("seed", "sigma", "passes"), [(0, 0.6, 3), (1, 1.0, 1), (2, 0.3, 2)])
def test_places_are_fitted_as_by_numpy(
    kind: MeasurementKind, seed: int, sigma: float, passes: int
) -> None:
    rng, model = np.random.default_rng(seed), TargetModel(PERSON, kind)
    people = np.append(rng.uniform(-1.8, 1.8, (4, 2)), np.full((4, 1), 0.85), axis=1)
    seen = boxes(
        CAMERAS, people[None], 3.0, rng, clutter=2.0, hidden=lambda c, person, step: c == NOTHING
    )
    measured = []
    for c, view in enumerate(views(seen, 4.0)[0]):
        values, noises = model.measured(view.boxes, view.sigmas, 1.0)
        noises = noises * rng.uniform(0.5, 2.0, (len(values), 1, 1))
        chosen = np.zeros(len(values)) if c == NOTHING else rng.random(len(values))
        measured.append((values, noises, chosen > 0.2))
    values, noises, free = (np.concatenate([one[k] for one in measured]) for k in range(3))
    starts = people[rng.integers(0, 4, 8)] + rng.normal(0.0, 0.3, (8, 3))
    starts[7] = np.add(CAMERAS[0].centre, [0.5, 0.0, 0.0])  # behind its lens
    counts = np.array([len(one[0]) for one in measured])
    pairs = [[(0, n % 3), (1, n % 4)] if n % 2 else [] for n in range(8)]
    if seed == 1:  # no box at all, rather than none that may be a newcomer's
        keep = np.repeat(np.arange(4), counts) != NOTHING
        values, noises, free = values[keep], noises[keep], free[keep]
        counts[NOTHING], measured[NOTHING] = 0, (values[:0], noises[:0], free[:0])
    refinement = birth_kernels.Refinement(start_sigma=sigma, passes=passes, gate=21.0)
    begins = np.cumsum([0, *counts])
    among_all = np.array(
        [[begins[camera] + box for camera, box in pair] or [-1, -1] for pair in pairs]
    )
    places, covariances, sources, fits = birth_kernels.fit_places(
        starts, among_all, Measurements(values, noises), free, begins, model.target(3),
        stacked(CAMERAS), refinement,
    )  # fmt: skip
    for n, start in enumerate(starts):
        place, covariance, chosen = reference_fit(start, pairs[n], measured, model, refinement)
        assert_allclose(places[n], place, atol=1e-7)
        assert_allclose(covariances[n], covariance, atol=1e-9)
        assert sources[:, n].tolist() == chosen
        for c, box in enumerate(chosen):
            if box < 0:
                assert fits[c, n] == 0.0
                continue
            residual = measured[c][0][box] - seen_by(c, model, place[None]).values[0]
            noise = measured[c][1][box]
            _, size = np.linalg.slogdet(2.0 * np.pi * noise)
            fit = -0.5 * (residual @ np.linalg.inv(noise) @ residual + size)
            assert fits[c, n] == pytest.approx(fit, abs=1e-6)
    assert (sources >= 0).sum() > 8


def fit_one(
    offsets: ndarray, noise: ndarray, sigma: float, gate: float, free: bool = True
) -> list[int]:
    """The box that a place in the middle of the room takes, of those so far off what it should be.

    Far off in the first camera's pixels; with ``sigma`` next to nothing the place is certain.
    """
    model, start = TargetModel(PERSON, "box"), np.array([[0.1, 0.2, 0.85]])
    expected = seen_by(0, model, start).values
    found = birth_kernels.fit_places(
        start, NO_PAIR, Measurements(expected + offsets, np.tile(noise, (len(offsets), 1, 1))),
        np.full(len(offsets), free), np.array([0, len(offsets)]), model.target(3),
        stacked(CAMERAS[:1]), birth_kernels.Refinement(sigma, 1, gate),
    )  # fmt: skip
    return [int(found.sources[0, 0])]


@pytest.mark.parametrize(("gate", "found"), [(15.999, -1), (16.0, 0), (16.001, 0)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_box_at_the_gate_is_within_and_of_two_as_near_the_first_counts(
    gate: float, found: int, axis: int
) -> None:
    offsets = 8.0 * np.array([1.0, -1.0])[:, None] * np.eye(3)[axis]
    assert fit_one(offsets, 4.0 * np.eye(3), 1e-12, gate) == [found]
    assert fit_one(offsets, 4.0 * np.eye(3), 1e-12, gate + 1.0, free=False) == [-1]
    nearer = np.concatenate([offsets, 0.5 * offsets])
    assert fit_one(nearer, 4.0 * np.eye(3), 1e-12, gate) == [2]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("share", "found"), [(0.8, 0), (1.25, -1)])
def test_a_place_too_uncertain_for_a_box_s_noise_takes_none(
    axis: int, share: float, found: int
) -> None:
    slope = seen_by(0, TargetModel(PERSON, "box"), np.array([[0.1, 0.2, 0.85]])).jacobians[0]
    own = np.diag(slope @ slope.T)
    noise = 2.0 * own / birth_kernels.STEEPEST
    noise[axis] = own[axis] / birth_kernels.STEEPEST / share
    assert fit_one(np.zeros((1, 3)), np.diag(noise), 1.0, 9.0) == [found]
