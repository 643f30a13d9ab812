"""Evidence between two cameras' boxes, and boxes slid in time, against formulas in NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from tracker.kernels.consistency import (
    best_share,
    density_ratios,
    meeting_heights,
    pair_evidence,
    slide,
)

SIGMA, HEIGHT_SIGMA, SCATTER = 0.07, 0.12, 0.05
RISE = np.array([0.5, -1.5, 0.6])
"""People stand along no axis of the world."""
NORMAL = RISE / np.linalg.norm(RISE)
FLOOR = -1.4


def directions(towards: ndarray, rng: np.random.Generator, count: int) -> ndarray:
    """(count, 3) unit vectors around a direction."""
    drawn = rng.normal(towards, 0.1, (count, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


@dataclass(frozen=True)
class Boxes:
    """The boxes of one camera at some moments, as the kernels take them."""

    feet: ndarray
    heads: ndarray
    whole: ndarray
    seen: ndarray
    background: ndarray
    starts: ndarray
    rotation: ndarray
    centre: ndarray


def boxes(seed: int, counts: tuple[int, ...]) -> Boxes:
    """People about the point (0.2, 1, 4) as camera 0, 1 or 2 sees them; the second box is cut off,
    the third has no background."""
    rng, size = np.random.default_rng(seed), sum(counts)
    rotation = Rotation.from_euler("yxz", [40.0 * seed, 9.0, -6.0 * seed], degrees=True).as_matrix()
    centre = np.array([[0.0, 0.0, 0.0], [2.0, 0.1, 0.3], [3.5, -0.4, 2.0]])[seed]
    people = rng.normal([0.2, 1.0, 4.0], [0.5, 0.2, 0.5], (size, 3)) - centre
    ends = [people, people + RISE + 0.05 * rng.normal(size=(size, 3))]
    feet, heads = (end / np.linalg.norm(end, axis=1, keepdims=True) for end in ends)
    across = [end @ rotation.T for end in ends]
    seen = np.concatenate([end[:, :2] / end[:, 2:] for end in across], axis=1)
    background = rng.normal(0.0, 1.0, size)
    background[2] = np.nan
    return Boxes(
        feet, heads, np.arange(size) != 1, seen + 0.02 * rng.normal(size=seen.shape), background,
        np.cumsum([0, *counts]), rotation, centre,
    )  # fmt: skip


ROOM = (boxes(0, (3, 0, 2)), boxes(1, (4, 2, 1)), boxes(2, (0, 1, 3)))


def ratios(a: Boxes, b: Boxes) -> ndarray:
    return density_ratios(
        a.feet, a.heads, a.whole, a.starts, a.centre, b.seen, b.background, b.starts, b.rotation,
        b.centre, np.array([*RISE, *NORMAL, FLOOR, SCATTER]), SIGMA, HEIGHT_SIGMA,
    )  # fmt: skip


def stated_density(a: Boxes, i: int, b: Boxes, z: int) -> float:
    """N(z; μ_i, S_i), its derivatives by differences and its intersection by search."""
    foot, head = a.feet[i], a.heads[i]

    def predicted(s: float) -> ndarray:
        points = np.array([s * foot, s * foot + RISE]) + a.centre - b.centre
        camera = points @ b.rotation.T
        return (camera[:, :2] / camera[:, 2:]).ravel()

    s = minimize_scalar(
        lambda s: np.linalg.norm(np.cross(head, s * foot + RISE)),
        bounds=(0.0, 50.0), method="bounded", options={"xatol": 1e-12},
    ).x  # fmt: skip
    variance = s**2 * (HEIGHT_SIGMA**2 + 2.0 * SIGMA**2)
    slope = float(NORMAL @ foot)
    by_floor = (FLOOR - NORMAL @ a.centre) / slope
    floor_variance = (SCATTER**2 + SIGMA**2 * (RISE @ RISE)) / slope**2
    if (s - by_floor) ** 2 < 9.0 * (variance + floor_variance):
        s = (s / variance + by_floor / floor_variance) / (1 / variance + 1 / floor_variance)
        variance = 1.0 / (1.0 / variance + 1.0 / floor_variance)
    mu, gradient = predicted(s), (predicted(s + 1e-6) - predicted(s - 1e-6)) / 2e-6
    eta = float(np.linalg.norm(mu[2:] - mu[:2]))
    along = (mu[2:] - mu[:2]) / eta
    across = np.array([-along[1], along[0]])
    rows = np.array([[*across / 2, *across / 2], [*along, 0, 0], [0, 0, *along]])
    noise = np.diag([SIGMA**2, SIGMA**2, SIGMA**2 + HEIGHT_SIGMA**2 / 4.0]) * eta**2
    j = rows @ gradient
    density = multivariate_normal(cov=noise + variance * np.outer(j, j))
    return float(density.pdf(rows @ (b.seen[z] - mu)))


@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0), (1, 2), (2, 1)])
def test_ratios_are_those_of_the_stated_gaussian(first: int, second: int) -> None:
    a, b = ROOM[first], ROOM[second]
    expected = np.full(len(b.seen), np.nan)
    for m in range(3):
        members = range(a.starts[m], a.starts[m + 1])
        for z in range(b.starts[m], b.starts[m + 1]):
            if len(members):
                densities = [stated_density(a, i, b, z) for i in members if a.whole[i]]
                expected[z] = sum(densities) / len(members) / np.exp(b.background[z])
    assert np.nanmax(expected) > 0.1
    assert_allclose(ratios(a, b), expected, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("upwards", [True, False])
def test_whom_the_other_camera_has_in_front_in_part_alone_explains_nothing(upwards: bool) -> None:
    """The camera is within the body and looks along it: feet or head are behind it."""
    axis = NORMAL if upwards else -NORMAL
    beside = np.cross(axis, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(axis, [0.0, 0.0, 1.0]))
    rotation = np.stack([beside, np.cross(axis, beside), axis])
    foot = np.array([0.2, 1.0, 4.0])
    foot *= FLOOR / (NORMAL @ foot)
    ends = np.array([foot, foot + RISE])
    feet, heads = (ends / np.linalg.norm(ends, axis=1, keepdims=True))[:, None]
    there, starts = np.array([True]), np.array([0, 1])
    centre = ends.mean(axis=0) + 0.1 * beside
    across = (ends - centre) @ rotation.T
    assert sorted(across[:, 2] > 0.0) == [False, True]
    seen = (across[:, :2] / across[:, 2:]).reshape(1, 4)
    first, second = (
        Boxes(feet, heads, there, seen, np.zeros(1), starts, turned, place)
        for turned, place in ((np.eye(3), np.zeros(3)), (rotation, centre))
    )
    assert ratios(first, second).tolist() == [0.0]


@pytest.mark.parametrize("seed", range(4))
def test_the_explained_share_is_the_likeliest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = np.where(rng.random(50) < 0.6, rng.lognormal(3.0, 1.0, 50), 0.0)
    tried = np.linspace(0.0, 0.999, 2000)
    scores = np.log(1.0 - tried[:, None] + tried[:, None] * found).sum(axis=1)
    assert best_share(found) == pytest.approx(tried[scores.argmax()], abs=1e-3)
    assert best_share(np.append(found, np.nan)) == best_share(found)
    assert best_share(0.5 * rng.random(20)) == 0.0


def test_evidence_is_the_sum_of_each_pairs_boxes_by_moment() -> None:
    compared = np.array([[False, True, False], [True, False, True], [False, True, False]])
    firsts = np.cumsum([0, *(len(own.seen) for own in ROOM[:-1])])
    nats, shares = pair_evidence(
        *(
            np.concatenate([getattr(own, name) for own in ROOM])
            for name in ("feet", "heads", "whole", "seen", "background")
        ),
        np.array([first + own.starts for first, own in zip(firsts, ROOM, strict=True)]),
        np.array([own.rotation for own in ROOM]),
        np.array([own.centre for own in ROOM]),
        compared,
        np.array([*RISE, *NORMAL, FLOOR, SCATTER]),
        SIGMA,
        HEIGHT_SIGMA,
    )
    assert not nats[~compared].any()
    assert not shares[~compared].any()
    for a, b in np.argwhere(compared):
        own = ratios(ROOM[a], ROOM[b])
        share = best_share(own)
        terms = np.nan_to_num(np.log(1.0 - share + share * own))
        expected = [terms[i:j].sum() for i, j in pairwise(ROOM[b].starts)]
        assert shares[a, b] == pytest.approx(share)
        assert_allclose(nats[a, b], expected, rtol=1e-9, atol=1e-12)
        assert share > 0.0, "a pair without any evidence would hide what is wrong"


def test_meeting_heights_weigh_each_box_by_its_best_pair() -> None:
    """People of 1 to 1.7 along a tilted axis stand so near that strangers' rays meet as well."""
    rng, base = np.random.default_rng(5), np.array([1.2, -0.3, 0.4])
    axis, steps = NORMAL, np.linspace(np.log(0.8), np.log(2.2), 40)
    tall = np.array([1.0, 1.3, 1.7, 1.3, 1.0, 1.7, 1.2, 1.5])
    feet = rng.normal([0.2, 1.0, 4.0], 0.2, (8, 3))
    heads = feet + tall[:, None] * axis + 0.05 * rng.normal(size=(8, 3))
    starts = np.array([0, 4, 4, 6, 8])

    def seen(points: ndarray) -> ndarray:
        rays = points + 0.03 * rng.normal(size=points.shape)
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)

    one, other = [seen(feet), seen(heads)], [seen(feet - base), seen(heads - base)]
    other[0][4], other[1][4] = -other[0][4], -other[1][4]  # behind
    whole, other_whole = np.arange(8) != 1, np.arange(8) != 0
    largest_gap, spread = 0.4, 0.4
    expected = np.zeros(len(steps))
    weights = []
    for m in range(4):
        for i in range(starts[m], starts[m + 1]):
            best = np.zeros(len(steps))
            for j in range(starts[m], starts[m + 1]):
                ways = [
                    np.linalg.lstsq(np.column_stack([a[i], -b[j]]), base)[0]
                    for a, b in zip(one, other, strict=True)
                ]
                if not (whole[i] and other_whole[j] and np.min(ways) > 0.0):
                    continue
                near = [s * a[i] for (s, _), a in zip(ways, one, strict=True)]
                far = [base + t * b[j] for (_, t), b in zip(ways, other, strict=True)]
                foot, head = (0.5 * (p + q) for p, q in zip(near, far, strict=True))
                height = (head - foot) @ axis
                lean = np.sum((head - foot - height * axis) ** 2) / (height * spread) ** 2
                gaps = [np.sum((p - q) ** 2) for p, q in zip(near, far, strict=True)]
                gap = max(gaps) / (height * largest_gap) ** 2
                if height > 0.0 and gap < 1.0 and lean < 1.0:
                    place = np.searchsorted(steps, np.log(height), "right") - 1
                    weight = (1.0 - gap) * (1.0 - lean)
                    best[place] = max(best[place], weight)
                    weights.append(weight)
            expected += best
    counted = np.flatnonzero(expected)
    assert len(weights) > len(counted) > 4, "a box has several pairs"
    # of all heights, and of those between the smallest and the tallest person
    for some in (slice(None), slice(counted[0] + 1, counted[-1])):
        found = meeting_heights(
            one[0], one[1], whole, starts, other[0], other[1], other_whole, starts, base, axis,
            steps[some], largest_gap, spread,
        )  # fmt: skip
        assert_allclose(found, expected[some], rtol=1e-6, atol=1e-9)


SLIDE_SIGMA, DEPTH_SIGMA = 0.1, 0.2
FRAMES = [2, 1, 0, 2, 1]  # boxes of each frame


def scene(seed: int) -> dict[str, np.ndarray]:
    """Three sampled steps with 1, 2 and 0 expected boxes, of which one is unknown."""
    rng = np.random.default_rng(seed)
    head = rng.uniform(0.0, 40.0, (6, 2))
    boxes = np.concatenate([head, head + rng.uniform([0, 30], [3, 60], (6, 2))], axis=1)
    boxes[4] = np.nan  # cut off
    expected = boxes[[0, 2, 3]] + rng.normal(0.0, 4.0, (3, 4))
    expected[2] = np.nan
    return {
        "expected": expected,
        "tangents": rng.normal(0.0, 20.0, (3, 4)),
        "starts": np.array([0, 1, 3, 3]),
        "steps": np.array([0, 1, 4]),
        "boxes": boxes,
        "following": np.array([2, -1, -1, 5, 5, -1]),
        "box_starts": np.cumsum([0, *FRAMES]),
        "offsets": np.array([0.0, 1.0, -1.0, 0.5, 2.75, 3.0]),
    }


@pytest.mark.parametrize("seed", range(6))
def test_each_expected_box_has_its_best_fit(seed: int) -> None:
    s = scene(seed)
    fits, counts = slide(*s.values(), SLIDE_SIGMA, DEPTH_SIGMA)
    for o, offset in enumerate(s["offsets"]):
        whole, part = int(np.floor(offset)), offset % 1.0
        for k, step in enumerate(s["steps"]):
            frame = step + whole
            if frame < 0 or frame >= len(FRAMES) or (part and frame + 1 >= len(FRAMES)):
                assert fits[o, k] == counts[o, k] == 0.0
                continue
            there = []
            for d in range(s["box_starts"][frame], s["box_starts"][frame + 1]):
                after = s["following"][d]
                if part == 0.0:
                    there.append(s["boxes"][d])
                elif after >= 0:
                    there.append((1.0 - part) * s["boxes"][d] + part * s["boxes"][after])
            total, known = 0.0, 0
            for n in range(s["starts"][k], s["starts"][k + 1]):
                if np.isnan(s["expected"][n, 0]):
                    continue
                known += 1
                squares = [18.0]
                for box in there:
                    height = box[3] - box[1]
                    if np.isfinite(height):
                        # r = λ g / height + σ noise, λ = 0 + σ_λ noise, by least squares
                        rows = np.append(s["tangents"][n] / height / SLIDE_SIGMA, 1.0 / DEPTH_SIGMA)
                        right = np.append((box - s["expected"][n]) / height / SLIDE_SIGMA, 0.0)
                        factor = rows @ right / (rows @ rows)
                        squares.append(float(((right - factor * rows) ** 2).sum()))
                total += np.exp(-0.5 * min(squares))
            assert counts[o, k] == known
            assert fits[o, k] == pytest.approx(total, rel=1e-9)
    assert counts.sum() > 6


def test_an_offset_a_hair_below_a_step_is_that_step() -> None:
    s = scene(0)
    exact, _ = slide(*s.values(), SLIDE_SIGMA, DEPTH_SIGMA)
    s["offsets"] = s["offsets"] - np.array([1e-10, 1e-10, -1e-8, 0.0, 0.0, 1e-10])
    near, counts = slide(*s.values(), SLIDE_SIGMA, DEPTH_SIGMA)
    assert_allclose(near, exact)
    assert_array_equal(counts[:, 2] > 0, False)
