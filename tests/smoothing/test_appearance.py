"""The appearance of tracklets, and which person with templates each of them is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal

from tests.smoothing.test_boundaries import standing
from tracker.kernels import boxes as box_kernels
from tracker.kernels.kalman import Measurements
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.paths import CameraBoxes, Links, Paths
from tracker.smoothing.smoother import Smoother
from tracker.smoothing.tracklets.appearance import (
    AppearanceModel,
    Appearances,
    Means,
    learn_covariances,
    log_ratio_of,
    logistic_slope,
    sum_by_chain,
    template_log_odds,
)
from tracker.steps import Steps

STEP = 0.25

# ── the likelihood ratio


@given(
    st.integers(1, 4),
    st.integers(0, 10_000),
    st.floats(0.05, 400.0),
    st.floats(0.05, 400.0),
)
def test_the_log_ratio_is_that_of_the_full_joint_gaussians(
    size: int, seed: int, n: float, m: float
) -> None:
    """One person's two means are jointly Gaussian with the covariance B; two persons' with 0."""
    rng = np.random.default_rng(seed)
    between = np.exp(rng.normal(size=size))
    x, y = rng.normal(scale=2.0, size=(2, size))
    whole = np.diag(between)
    spreads = [
        1.15 * whole + (1.0 + 0.3 * (count - 1.0)) / count * np.eye(size) for count in (n, m)
    ]
    none = np.zeros((size, size))
    both = np.concatenate([x, y])
    together, apart = (
        multivariate_normal(
            np.zeros(2 * size), np.block([[spreads[0], common], [common, spreads[1]]])
        ).logpdf(both)
        for common in (whole, none)
    )
    one, other = Means(x[None], np.array([n])), Means(y[None], np.array([m]))
    value = log_ratio_of(between, one, other)
    assert_allclose(value, [together - apart], rtol=1e-7, atol=1e-7)
    assert_allclose(log_ratio_of(between, other, one), value, rtol=1e-9, atol=1e-9)


def pairs_of_means(
    rng: np.random.Generator, between: ndarray, counts: ndarray, same: bool
) -> tuple[Means, Means]:
    """Pairs of means drawn from the model, each with as many boxes as ``counts`` says."""
    size = len(counts), len(between)
    person = np.sqrt(between) * rng.normal(size=size)
    other = person if same else np.sqrt(between) * rng.normal(size=size)
    spread = np.sqrt(0.15 * between + Means(person, counts).variances[:, None])
    one, two = (mean + spread * rng.normal(size=size) for mean in (person, other))
    return Means(one, counts), Means(two, counts)


BETWEEN = np.array([3.0, 1.0, 0.4, 0.2])


def test_on_data_of_the_model_the_ratio_is_the_posterior_odds() -> None:
    """Of drawn pairs, half of one person, those with the ratio r are of one person with the
    probability 1 / (1 + exp(−r)); one person has positive ratios on the average, two negative."""
    rng = np.random.default_rng(1)
    counts = rng.uniform(0.5, 30.0, 40_000)
    same, other = (
        log_ratio_of(BETWEEN, *pairs_of_means(rng, BETWEEN, counts, one)) for one in (True, False)
    )
    assert same.mean() > 0.5
    assert other.mean() < -0.5
    ratios = np.concatenate([same, other])
    truth = np.repeat([1.0, 0.0], len(counts))
    stated = 1.0 / (1.0 + np.exp(-ratios))
    for low in np.arange(0.05, 0.95, 0.1):
        own = (stated >= low) & (stated < low + 0.1)
        error = np.sqrt(0.25 / own.sum())
        assert abs(truth[own].mean() - stated[own].mean()) < 4.0 * error
    assert logistic_slope(same, other) > 0.97


@pytest.mark.parametrize("factor", [1.5, 4.0])
def test_ratios_that_are_too_sure_are_scaled_back(factor: float) -> None:
    rng = np.random.default_rng(2)
    counts = np.full(20_000, 5.0)
    same, other = (
        log_ratio_of(BETWEEN, *pairs_of_means(rng, BETWEEN, counts, one)) for one in (True, False)
    )
    assert logistic_slope(factor * same, factor * other) == pytest.approx(1.0 / factor, rel=0.05)
    # what contradicts the truth has no weight, and what is too cautious is left so
    assert logistic_slope(other, same) == pytest.approx(0.0, abs=1e-6)
    assert logistic_slope(same / factor, other / factor) == 1.0


def test_the_slope_is_that_of_the_largest_likelihood() -> None:
    rng = np.random.default_rng(3)
    same, other = rng.normal(1.0, 3.0, 200), rng.normal(-1.5, 3.0, 700)

    def loss(slope: float) -> float:
        return float(
            np.log1p(np.exp(-slope * same)).mean() + np.log1p(np.exp(slope * other)).mean()
        )

    best = minimize_scalar(loss, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-8}).x
    assert logistic_slope(same, other) == pytest.approx(best, abs=1e-5)


# ── what is learnt


def test_the_covariances_are_those_the_data_were_drawn_with() -> None:
    """In other coordinates, of which many tell nothing: there the scatter within is I again."""
    rng = np.random.default_rng(4)
    persons, boxes, mixing = 3000, 16, rng.normal(size=(4, 4)) + 2.0 * np.eye(4)
    parts = np.repeat(np.arange(persons), boxes)
    within = rng.normal(size=(len(parts), 4))
    # as correlated as the model takes boxes to be: a mean has the variance 1/n*
    shared = rng.normal(size=(persons, 4))[parts]
    people = (np.sqrt(BETWEEN) * rng.normal(size=(persons, 4)))[parts]
    drawn = people + np.sqrt((1 + 0.3 * (boxes - 1)) / boxes - 1 / boxes) * shared + within
    learnt = learn_covariances(drawn @ mixing, np.ones(len(parts)), parts)
    assert learnt is not None
    projection, between = learnt
    assert_allclose(np.sort(between)[::-1], BETWEEN, rtol=0.15, atol=0.03)
    assert_allclose(np.cov((within @ mixing @ projection).T), np.eye(4), atol=0.05)


def test_parts_of_less_than_one_box_in_all_do_not_count() -> None:
    """Two boxes that are mostly covered tell nothing of what differs within a part."""
    rng = np.random.default_rng(4)
    parts = np.repeat(np.arange(40), 6)
    vectors = rng.normal(scale=2.0, size=(40, 3))[parts] + rng.normal(size=(240, 3))
    usual = learn_covariances(vectors, np.ones(240), parts)
    covered = rng.normal(scale=9.0, size=(20, 3))
    found = learn_covariances(
        np.concatenate([vectors, covered]),
        np.concatenate([np.ones(240), np.full(20, 0.4)]),
        np.concatenate([parts, 40 + np.repeat(np.arange(10), 2)]),
    )
    assert usual is not None
    assert found is not None
    assert_allclose(found[1], usual[1], rtol=1e-9)
    assert_allclose(np.abs(found[0]), np.abs(usual[0]), rtol=1e-6)


def test_nothing_is_learnt_from_few_parts_or_parts_that_do_not_differ() -> None:
    rng = np.random.default_rng(5)

    def learn(persons: int, boxes: int, spread: float) -> object:
        parts = np.repeat(np.arange(persons), boxes)
        people = spread * rng.normal(size=(persons, 6))[parts]
        return learn_covariances(
            people + rng.normal(size=(len(parts), 6)), np.ones(len(parts)), parts
        )

    assert learn(4, 20, 3.0) is None
    assert learn(5, 20, 3.0) is not None
    assert learn(50, 1, 3.0) is None
    assert learn(400, 40, 0.0) is None  # less than what the correlation of boxes explains


@pytest.mark.parametrize(("persons", "dimensions"), [(5, 4), (9, 8), (40, 12)])
def test_people_differ_in_fewer_dimensions_than_there_are_people(
    persons: int, dimensions: int
) -> None:
    """They differ equally in twelve dimensions."""
    rng = np.random.default_rng(9)
    parts = np.repeat(np.arange(persons), 20)
    vectors = 9.0 * rng.normal(size=(persons, 12))[parts] + rng.normal(size=(len(parts), 12))
    learnt = learn_covariances(vectors, np.ones(len(parts)), parts)
    assert learnt is not None
    assert learnt[0].shape == (12, dimensions)


# ── the whole, on tracklets side by side


def recording(
    angles: list[list[float]], first: int = 0
) -> tuple[Paths, Links, CameraBoxes, ndarray]:
    """Tracklets side by side in one camera, without overlap of boxes.

    Args:
        angles: Direction of the embedding of each tracklet's box at each step, radians.
        first: First step.
    """
    people, steps = len(angles), len(angles[0])
    paths = standing(*((k, first, first + steps - 1, 3.0 * k) for k in range(people)))
    boxes = np.array([[100.0 * k, 50.0, 5.0, 10.0] for _ in range(steps) for k in range(people)])
    starts = np.arange(steps + 1) * people

    def nothing(*_: ndarray) -> Measurements:
        return Measurements(np.zeros((0, 3)), np.zeros((0, 3, 3)))

    camera = CameraBoxes(
        starts, np.zeros(steps, bool), boxes, np.ones_like(boxes), np.ones(len(boxes)), nothing
    )
    rows = np.arange(len(boxes))
    of = np.array([step * people + k for k in range(people) for step in range(steps)])
    links = Links(np.zeros(len(rows), dtype=np.int64), rows, of, np.ones(len(rows)))
    flat = np.array(angles).T.ravel()
    return paths, links, camera, np.stack([np.cos(flat), np.sin(flat)], axis=1)


def noisy(people: int, steps: int = 8, spread: float = 0.25) -> list[list[float]]:
    """Directions of tracklets of two kinds in turn, with noise."""
    rng = np.random.default_rng(people)
    return [list(2.0 * (k % 2) + spread * rng.normal(size=steps)) for k in range(people)]


EVEN, ODD = np.array([0, 0]), np.array([2, 1])
"""The first with one of its own kind, and with one of the other."""


def test_tracklets_that_look_alike_are_likelier_of_one_person() -> None:
    paths, links, camera, embeddings = recording(noisy(6))
    model = AppearanceModel(paths, links, [camera], [embeddings], STEP)
    (alike, different), known = model.log_ratio(EVEN, ODD)
    assert known.all()
    assert alike > 0.0 > different
    assert_allclose(model.log_ratio(ODD, EVEN)[0], [alike, different])


@pytest.mark.parametrize(
    ("people", "away", "known"),
    [(4, (), False), (5, (), True), (5, range(32, 36), False), (5, range(36, 40), False)],
)
def test_of_few_tracklets_nothing_is_said(people: int, away: range, known: bool) -> None:
    """Nor of few that have boxes in both halves: the last lacks its first or its last four."""
    paths, links, camera, embeddings = recording(noisy(people))
    links = links.take(~np.isin(links.rows, away))
    model = AppearanceModel(paths, links, [camera], [embeddings], STEP)
    ratio, seen = model.log_ratio(EVEN, ODD)
    assert seen.tolist() == [known] * 2
    assert (ratio != 0.0).tolist() == [known] * 2


def test_of_a_tracklet_without_embeddings_or_links_nothing_is_said() -> None:
    paths, links, camera, embeddings = recording(noisy(8))
    embeddings[2::8] = 0.0
    links = links.take(links.rows >= 8)
    ratio, seen = AppearanceModel(paths, links, [camera], [embeddings], STEP).log_ratio(
        np.array([0, 1, 1]), np.array([3, 2, 3])
    )
    assert seen.tolist() == [False, False, True]
    assert ratio[:2].tolist() == [0.0, 0.0]
    nothing = links.take(links.rows < 0)
    assert (
        not AppearanceModel(paths, nothing, [camera], [embeddings], STEP)
        .log_ratio(EVEN, ODD)[1]
        .any()
    )


@pytest.mark.parametrize("spread", [0.0, 1e-4, 0.01])
def test_however_clear_the_embeddings_the_ratio_is_at_most_six(spread: float) -> None:
    """Ten people, each with a direction in ten dimensions, with little noise or none."""
    paths, links, camera, _ = recording([[0.0] * 40] * 10)
    rng = np.random.default_rng(8)
    embeddings = np.tile(np.linalg.qr(rng.normal(size=(10, 10)))[0], (40, 1))
    embeddings += spread * rng.normal(size=embeddings.shape)
    i, j = np.triu_indices(10)
    model = AppearanceModel(paths, links, [camera], [embeddings], STEP)
    ratio, known = model.log_ratio(i, j)
    assert known.all()
    assert ratio[i == j].tolist() == [6.0] * 10
    assert (ratio[i != j] < 0.0).all()
    assert ratio.min() >= -6.0


def test_the_order_of_boxes_and_links_has_no_influence() -> None:
    rng = np.random.default_rng(6)
    paths, links, camera, embeddings = recording(noisy(6))
    expected = AppearanceModel(paths, links, [camera], [embeddings], STEP).log_ratio(EVEN, ODD)[0]
    shuffled = links.take(rng.permutation(len(links.rows)))
    value = AppearanceModel(paths, shuffled, [camera], [embeddings], STEP).log_ratio(EVEN, ODD)[0]
    assert_allclose(value, expected, rtol=1e-6)
    # the boxes of each step in another order
    order = np.concatenate([6 * step + rng.permutation(6) for step in range(8)])
    moved = replace(camera, boxes=camera.boxes[order])
    renamed = replace(links, boxes=np.argsort(order)[links.boxes])
    value = AppearanceModel(paths, renamed, [moved], [embeddings[order]], STEP).log_ratio(
        EVEN, ODD
    )[0]
    assert_allclose(value, expected, rtol=1e-6)


def test_covered_boxes_have_less_weight() -> None:
    """Half of a tracklet's boxes are the other kind's: the more of these another box covers, the
    less they change the ratio; covered entirely, they are as if they were not linked."""
    angles = noisy(8)
    angles[0][::2] = angles[1][::2]
    paths, links, camera, embeddings = recording(angles)

    def ratios(shift: float, links: Links = links) -> ndarray:
        """The ratios with the box of another object at this distance, pixels, at those steps."""
        boxes, starts = [], [0]
        index = np.zeros(len(camera.boxes), dtype=np.int64)
        vectors = []
        for step in range(8):
            index[step * 8 : step * 8 + 8] = len(boxes) + np.arange(8)
            boxes += list(camera.boxes[step * 8 : step * 8 + 8])
            vectors += list(embeddings[step * 8 : step * 8 + 8])
            if step % 2 == 0:
                boxes.append(camera.boxes[0] + [shift, 0.0, 0.0, 0.0])
                vectors.append(np.zeros(2))
            starts.append(len(boxes))
        other = replace(camera, boxes=np.array(boxes), starts=np.array(starts))
        own = replace(links, boxes=index[links.boxes])
        model = AppearanceModel(paths, own, [other], [np.array(vectors)], STEP)
        return model.log_ratio(EVEN, ODD)[0]

    clear, some, most, whole = (ratios(shift) for shift in (10.0, 5.0, 2.0, 0.0))
    margins = [float(r[0] - r[1]) for r in (clear, some, most, whole)]
    assert margins == sorted(margins)
    assert margins[0] < margins[-1]
    unlinked = links.take(~((links.rows < 8) & (links.rows % 2 == 0)))
    assert_allclose(whole, ratios(10.0, unlinked), rtol=1e-6)


def test_the_covered_share_is_that_of_the_pixels() -> None:
    rng = np.random.default_rng(7)
    corners = np.sort(rng.integers(0, 20, size=(9, 2, 2)), axis=1)
    corners[:, 1] += 1
    boxes = np.concatenate([corners.sum(axis=1) / 2.0, (corners[:, 1] - corners[:, 0]) / 2.0], 1)
    starts = np.array([0, 4, 4, 5, 9])
    pixels = np.zeros((9, 21, 21), dtype=bool)
    for picture, ((left, top), (right, bottom)) in zip(pixels, corners.tolist(), strict=True):
        picture[top:bottom, left:right] = True
    step = np.searchsorted(starts, np.arange(9), side="right")
    expected = [
        max(
            [(pixels[i] & pixels[j]).sum() / pixels[i].sum()
             for j in range(9) if j != i and step[j] == step[i]],
            default=0.0,
        )
        for i in range(9)
    ]  # fmt: skip
    assert_allclose(box_kernels.covered(boxes, starts), expected, atol=1e-12)


PEOPLE_STEP = 0.2
FIRST, SECOND = [0.9, 0.1], [0.1, 0.9]


def evidence_of(
    likenesses: list[list[float]],
    places: list[list[float]],
    weight: float = 1.0,
    share: float = 1.0,
) -> ndarray:
    """The evidence of one tracklet; its own box is the first of those of each step."""
    steps = len(likenesses)
    boxes = np.array([[x, 50.0, 5.0, 10.0] for own in places for x in own])
    starts = np.cumsum([0, *(len(own) for own in places)])

    def nothing(*_: ndarray) -> Measurements:
        return Measurements(np.zeros((0, 3)), np.zeros((0, 3, 3)))

    camera = CameraBoxes(
        starts, np.zeros(steps, bool), boxes, np.ones_like(boxes), np.ones(len(boxes)), nothing
    )
    smoother = cast(
        Smoother, SimpleNamespace(cameras=[camera], model=SimpleNamespace(step_time=PEOPLE_STEP))
    )
    every = np.full((len(boxes), 2), 0.5)
    every[starts[:-1]] = likenesses
    piece = Paths.of([1], [0], [np.zeros((steps, 6))], [np.zeros((steps, 6, 6))], 6)
    rows = np.arange(steps)
    links = Links(np.zeros(steps, dtype=np.int64), rows, starts[:-1].copy(), np.full(steps, share))
    return template_log_odds(piece, links, smoother, Appearances(None, [every]), weight)[0]


def test_boxes_of_ones_colours_count_by_the_time_that_they_last() -> None:
    found = evidence_of([FIRST] * 10, [[50.0]] * 10)
    own, other = (10 * PEOPLE_STEP * np.log(0.1 + 0.9 * 2.0 * p) for p in (0.9, 0.1))
    assert found == pytest.approx([0.0, other - own])
    assert evidence_of([FIRST] * 10, [[50.0]] * 10, 0.5) == pytest.approx(found / 2.0)
    # and by how surely they are the own
    assert evidence_of([FIRST] * 10, [[50.0]] * 10, share=0.8) == pytest.approx(0.8 * found)
    assert not evidence_of([FIRST] * 10, [[50.0]] * 10, share=0.7).any()


def test_boxes_that_look_now_like_one_and_now_like_the_other_tell_less_but_no_stranger() -> None:
    found = evidence_of([FIRST, FIRST, SECOND], [[50.0]] * 3)
    once = evidence_of([FIRST], [[50.0]])
    assert found.max() == 0.0
    assert found == pytest.approx(once)


def test_what_another_box_touches_says_nothing_of_colours() -> None:
    alone, crowded = [[50.0]] * 5, [[50.0, 56.0]] * 5
    assert evidence_of([SECOND] * 5 + [FIRST] * 5, alone + crowded) == pytest.approx(
        evidence_of([SECOND] * 5, alone)
    )


def test_a_camera_without_a_picture_is_not_asked_and_one_person_alone_tells_nothing() -> None:
    view = ViewResult.of_boxes(np.ones((1, 4)), np.ones(1), np.ones((1, 4)))
    of_two = replace(view, likenesses=np.array([FIRST]))
    seen = Appearances.of(Steps.of([(of_two, view), (view, of_two)], ViewResult, 2)).likenesses
    assert seen is not None
    assert [one.tolist() for one in seen] == [[FIRST, [0.5, 0.5]], [[0.5, 0.5], FIRST]]
    for one in (replace(view, likenesses=np.ones((1, 1))), view):
        assert Appearances.of(Steps.of([(one,)], ViewResult, 1)).likenesses is None


def test_chains_are_the_likeliest_of_all_their_pieces() -> None:
    pieces = np.array([[0.0, -6.0], [-4.0, 0.0], [0.0, 0.0]])
    assert sum_by_chain(pieces, [[0, 1], [2]]).tolist() == [[0.0, -2.0], [0.0, 0.0]]
