"""Kernels over pixels against NumPy over whole pictures, at, below and above every bound."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tracker.kernels.pictures import channels, foreground, images, silhouettes
from tracker.kernels.pictures.channels import COLUMNS, ORIENTATIONS, ROWS
from tracker.kernels.pictures.images import follow_colours

seeds = st.integers(0, 2**32 - 1)


def grid_boxes(rng: np.random.Generator, count: int, extent: int = 9) -> ndarray:
    """Boxes at whole pixels, so that many lie exactly at a bound of each other."""
    places = rng.integers(0, extent, (count, 2))
    return np.concatenate([places, rng.integers(1, 4, (count, 2))], axis=1).astype(float)


def squares(boxes: ndarray, other: ndarray) -> ndarray:
    """Squared distances of centres, in half sizes of ``other``."""
    return np.asarray((((boxes[:, :2] - other[:2]) / other[2:]) ** 2).sum(axis=1))


# ── colours


def weights_in(shape: tuple[int, int], box: ndarray, longest: int) -> tuple[ndarray, ndarray]:
    """1 − r² on the ellipse, and 1 in the box, of the pixels that a stride leaves."""
    y, x = np.indices(shape)
    half = np.maximum(box[2:], 0.5)
    u, v = (x - box[0]) / half[0], (y - box[1]) / half[1]
    flat = ((np.abs(u) <= 1.0) & (np.abs(v) <= 1.0)).astype(float)
    for axis, (places, limit) in enumerate(zip((x, y), shape[::-1], strict=True)):
        first = max(int(np.ceil(box[axis] - half[axis])), 0)
        flat *= (places - first) % int(np.ceil(2.0 * half[axis] / longest)) == 0
        assert limit > 0
    return np.clip(1.0 - u**2 - v**2, 0.0, None) * flat, flat


@given(seeds, st.booleans(), st.sampled_from((1, 3, 4, 100)))
def test_histograms_are_those_of_the_pixels_that_the_stride_leaves(
    seed: int, epanechnikov: bool, longest: int
) -> None:
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, 40, (11, 13)).astype(np.uint16)
    boxes = grid_boxes(rng, 5, 14) - [1.0, 1.0, 0.0, 0.0]
    boxes = np.concatenate([boxes, [[4.3, 5.6, 0.1, 2.7], [6.0, 6.0, 0.2, 0.1], [90, 5, 3, 3]]])
    wanted = []
    for box in boxes:
        weights = weights_in((11, 13), box, longest)[0 if epanechnikov else 1]
        histogram = np.bincount(bins.ravel(), weights.ravel(), 40)
        wanted.append(histogram / (histogram.sum() or 1.0))
    found = images.box_histograms(bins, boxes, 40, epanechnikov, longest)
    assert_allclose(found, wanted, atol=1e-12)
    templates = np.sqrt(rng.dirichlet(np.ones(40), 3))
    likeness = np.sqrt(wanted) @ templates.T
    nearest = np.stack([likeness[:, [0, 2]].max(axis=1), likeness[:, 1]], axis=1)
    apart = images.template_distances(
        bins, boxes, templates, np.array([0, 1, 0]), epanechnikov, longest
    )
    assert_allclose(apart, np.sqrt(np.maximum(1.0 - nearest, 0.0)), atol=1e-7)


def followed(
    bins: ndarray, moving: ndarray, box: ndarray, histogram: ndarray, most: int, least: float
) -> ndarray:
    """Mean shift of [CRM03] over the whole picture."""
    y, x = np.indices(bins.shape)
    place, half = box[:2].copy(), np.maximum(box[2:], 0.5)
    for _ in range(most):
        r2 = ((x - place[0]) / half[0]) ** 2 + ((y - place[1]) / half[1]) ** 2
        inside = (r2 < 1.0) & moving
        here = np.bincount(bins[inside], 1.0 - r2[inside], len(histogram))
        share = np.sqrt(histogram / np.where(here > 0.0, here / max(here.sum(), 1e-300), np.inf))
        weights = share[bins[inside]]
        if not weights.sum() > 0.0:
            return place
        before = place
        place = np.array([weights @ x[inside], weights @ y[inside]]) / weights.sum()
        if np.hypot(*(place - before)) < least:
            break
    return place


@given(seeds, st.sampled_from((0, 1, 2, 15)), st.sampled_from((0.0, 0.4)))
def test_colours_are_followed_by_the_mean_shift(seed: int, most: int, least: float) -> None:
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, 30, (12, 15)).astype(np.uint16)
    moving = rng.random((12, 15)) < rng.choice([0.3, 0.9])
    histogram = rng.dirichlet(np.ones(30)) * (rng.random(30) < 0.7)
    place = rng.integers([-1, -1], [16, 13]) + rng.choice([0.0, 0.25])
    box = np.append(place, rng.choice([0.2, 2.0, 4.0, 5.0], 2))
    found = follow_colours(bins, moving, box, histogram, most, least)
    assert_allclose(found, followed(bins, moving, box, histogram, most, least), atol=1e-9)


@pytest.mark.parametrize(("least", "x"), [(0.999, 13.0), (1.0, 13.0), (1.001, 11.0)])
def test_a_shift_as_long_as_the_tolerance_is_not_the_last(least: float, x: float) -> None:
    moving = np.zeros((20, 30), dtype=bool)
    moving[10, [11, 15]] = True  # the second comes into reach by the first shift
    box = np.array([10.0, 10.0, 4.5, 4.5])
    found = follow_colours(np.zeros((20, 30), dtype=np.uint16), moving, box, np.ones(1), 9, least)
    assert_array_equal(found, [x, 10.0])


@given(seeds, st.integers(0, 4), st.sampled_from((0.0, 0.3)))
def test_modes_are_climbed_to_by_the_weighted_mean(seed: int, most: int, least: float) -> None:
    rng = np.random.default_rng(seed)
    samples, weights = grid_boxes(rng, 12), rng.random(12) * (rng.random(12) < 0.8)
    starts = grid_boxes(rng, 4)
    starts = np.concatenate([starts, [[500.0, 0.0, 1.0, 1.0]]])
    found = images.mean_shift(samples, weights, starts, 0.5, most, least)
    for k, mode in enumerate(starts):
        density = 0.0
        for _ in range(most):
            # rounded as the kernel does, since samples on a grid lie at the border itself
            u, v, s, t = ((samples - mode) * (1.0 / (0.5 * mode[[2, 3, 2, 3]]))).T
            square = (u * u + v * v) + (s * s + t * t)
            kernel = weights * np.exp(-0.5 * square) * (square <= 12.0)
            density = kernel.sum()
            if not density > 0.0:
                break
            before, mode = mode, kernel @ samples / density
            if np.linalg.norm((mode - before) / before[[2, 3, 2, 3]]) < least:
                break
        assert_allclose(found.boxes[k], mode)
        assert found.densities[k] == pytest.approx(density)


@given(seeds, st.integers(0, 4), st.sampled_from((0.0, 0.5)))
def test_particles_climb_to_the_mean_of_their_group_within_reach(
    seed: int, most: int, least: float
) -> None:
    rng = np.random.default_rng(seed)
    boxes, counts = grid_boxes(rng, 9), rng.integers(0, 3, 9).astype(float)
    groups = rng.integers(0, 2, 9)
    found = images.epanechnikov_climb(boxes, counts, groups, 2.0, most, least)
    for k, place in enumerate(boxes):
        density = 0.0
        for _ in range(most if counts[k] else 0):
            square = squares(boxes, place) / 4.0
            kernel = counts * (groups == groups[k]) * (square < 1.0)
            density = kernel @ (1.0 - square)
            if not kernel.any():
                break
            before, place = place, kernel @ boxes / kernel.sum()
            if squares(place[None], before)[0] < least**2:
                break
        assert_allclose(found.points[k], place)
        assert found.densities[k] == pytest.approx(density)


def test_a_particle_from_which_all_others_shrank_away_stays_where_it_is() -> None:
    # the mean is small, and nobody within reach of it
    boxes = np.array([[0.0, 0.0, 9.0, 9.0], [8.0, 0.0, 0.1, 0.1], [0.0, 8.0, 0.1, 0.1]])
    found = images.epanechnikov_climb(
        boxes, np.array([1.0, 10.0, 10.0]), np.zeros(3, dtype=np.int64), 1.0, 9, 0.0
    )
    assert_allclose(found.points[0], np.array([80.0, 80.0, 11.0, 11.0]) / 21.0)
    assert found.densities[0] == 0.0


@given(seeds, st.sampled_from((1.0, 2.0)))
def test_modes_are_led_by_their_densest_point(seed: int, distance: float) -> None:
    rng = np.random.default_rng(seed)
    points, counts = grid_boxes(rng, 10), rng.integers(0, 3, 10).astype(float)
    order = rng.permutation(10)
    owners, leaders = np.full(10, -1), []
    for i in order[counts[order] > 0.0].tolist():
        near = [
            m for m, j in enumerate(leaders) if squares(points[[i]], points[j])[0] < distance**2
        ]
        owners[i] = near[0] if near else len(leaders)
        leaders += [] if near else [i]
    found = images.join_modes(points, counts, order, distance)
    assert_array_equal(found.owners, owners)
    assert found.leaders.tolist() == leaders


@given(seeds, st.integers(0, 12), st.sampled_from((1.0, 2.0)))
def test_boxes_keep_apart_from_those_before(seed: int, most: int, distance: float) -> None:
    rng = np.random.default_rng(seed)
    boxes = grid_boxes(rng, 12)
    weights = rng.integers(0, 4, 12).astype(float)
    order = np.argsort(-weights, kind="stable")
    kept: list[int] = []
    for i in order[weights[order] > 0.0].tolist():
        if len(kept) < most and all(squares(boxes[[i]], boxes[j])[0] >= distance**2 for j in kept):
            kept.append(i)
    assert images.keep_apart(boxes, weights, order, distance, most).tolist() == kept


@given(seeds)
def test_a_mean_is_over_the_pixels_whose_centres_are_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, 9, (6, 7))
    integral = np.zeros((7, 8))
    integral[1:, 1:] = picture.cumsum(axis=0).cumsum(axis=1)
    edges = rng.integers(-4, 20, (20, 4)) / 2.0
    y, x = np.indices((6, 7))
    wanted = []
    for left, top, right, bottom in edges:
        inside = picture[(x >= left) & (x <= right) & (y >= top) & (y <= bottom)]
        wanted.append(inside.mean() if inside.size else 0.0)
    assert_allclose(images.box_means(integral, edges), wanted)


# ── foreground


@pytest.mark.parametrize(
    ("pixel", "levels", "expected"),
    [
        # 16 √level: 16 apart is within 10 + 6, in either direction and in each channel
        ((9, 9, 9), (4, 4, 4), 0),
        ((10, 9, 9), (4, 4, 4), 1),
        ((4, 4, 4), (9, 9, 9), 0),
        ((3, 4, 4), (9, 9, 9), 1),
        ((9, 9, 10), (4, 4, 4), 1),
        # shares of the light, of (level + 4): 0.6 is dark enough, less is no shadow
        ((56, 56, 56), (96, 96, 96), 0),
        ((55, 56, 56), (96, 96, 96), 1),
        # no channel may be lighter, and they may differ by 0.25
        ((96, 71, 71), (96, 96, 96), 0),
        ((97, 75, 75), (96, 96, 96), 1),
        ((96, 70, 71), (96, 96, 96), 1),
    ],
)
def test_a_shadow_leaves_enough_light_of_nearly_one_colour(
    pixel: tuple[int, ...], levels: tuple[int, ...], expected: int
) -> None:
    picture = np.full((2, 3, 3), 96, dtype=np.uint8)
    learnt = picture // 2  # the curve doubles it
    picture[1, 2], learnt[1, 2] = pixel, [level // 2 if level > 9 else level for level in levels]
    curve = np.repeat(np.arange(256)[:, None], 3, axis=1)
    curve[10:] = np.minimum(2 * curve[10:], 255)
    mask = foreground.foreground_mask(
        picture, learnt, curve[None].astype(np.uint8), np.full((2, 3), 6.0), 10.0, 0.6, 0.25
    )
    assert mask[1, 2] == expected
    assert mask.sum() == expected


@given(seeds, st.sampled_from((0.0, 3.0)))
def test_shadows_are_cleared_by_the_same_rule(seed: int, least: float) -> None:
    rng = np.random.default_rng(seed)
    background = rng.choice([0, 16, 96], (8, 9, 3)).astype(np.uint8)
    shade = rng.choice([0.5, 0.6, 0.75, 1.0, 1.1], (8, 9, 1)) * rng.choice([1.0, 0.9], (8, 9, 3))
    picture = np.clip(np.rint((background + 4.0) * shade - 4.0), 0, 255).astype(np.uint8)
    difference = rng.integers(0, 6, (8, 9, 3)).astype(np.uint8)
    shares = (picture + 4.0) / (background + 4.0)
    low, high = shares.min(axis=2), shares.max(axis=2)
    shadow = (low >= 0.6) & (high <= 1.0) & (high - low <= 0.25) & (difference.max(axis=2) > least)
    wanted = np.where(shadow[:, :, None], 0, difference)
    foreground.clear_shadows(difference, picture, background, 0.6, 0.25, least)
    assert_array_equal(difference, wanted)


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize(("level", "count"), [(26, 0), (27, 1)])
def test_a_difference_at_the_threshold_is_background(channel: int, level: int, count: int) -> None:
    difference = np.zeros((3, 4, 3), dtype=np.uint8)
    difference[1, 2, channel] = level
    found = foreground.two_classes(difference, 6.0, 46.0, 1.0, 1.0, 99, 1)
    assert found.counts.tolist() == [count]
    assert foreground.above(difference, found.thresholds[0]).sum() == count


@pytest.mark.parametrize(("enough", "moved"), [(5, True), (6, True), (7, False)])
def test_a_class_of_too_few_pixels_keeps_its_centres(enough: int, moved: bool) -> None:
    difference = np.zeros((3, 4, 3), dtype=np.uint8)
    difference[:, :2] = [40, 50, 60]  # six of foreground, six of background
    found = foreground.two_classes(difference, 6.0, 46.0, 1.0, 1.0, enough, 3)
    assert_allclose(found.thresholds[0], 26.0)
    assert_allclose(found.thresholds[1], [20.0, 25.0, 30.0] if moved else 26.0)
    assert found.counts.tolist() == ([6, 6, 6] if moved else [6, 6])


@given(seeds)
def test_the_background_follows_still_pixels_within_the_levels_that_there_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shown = rng.choice([0, 3, 128, 252, 255], (6, 8, 3)).astype(np.uint8)
    picture = np.clip(shown + rng.integers(-6, 7, shown.shape), 0, 255).astype(np.uint8)
    background = rng.choice([0, 100, 30000, 65200, 65280], shown.shape).astype(np.uint16)
    still = rng.choice([0, 1, 2, 254, 255], (6, 8)).astype(np.uint8)
    near = (rng.random((6, 8)) < 0.2).astype(np.uint8)
    found = foreground.update_background(background, still, picture, shown, near, 5, 3, 0.3)
    step = picture.astype(int) - shown
    counts = np.where(near == 1, 0, np.minimum(still.astype(int) + 1, 255))
    may = (counts >= 3) & (np.abs(step).max(axis=2) < 5)
    moved = np.clip(background + np.round(76.8 * step), 0, 65280)
    assert_array_equal(found.still, counts)
    assert_array_equal(found.levels, np.where(may[:, :, None], moved, background))


@pytest.mark.parametrize("count", [1, 2, 5, 32])
def test_medians_agree_with_sorting(count: int) -> None:
    rng = np.random.default_rng(count)
    values = rng.choice(np.array([0, 3, 16, 17, 200, 255], dtype=np.uint8), (count, 1100))
    values[:, 900:] = rng.integers(0, 256, (count, 200))
    medians = np.sort(values, axis=0)[count // 2]
    assert_array_equal(foreground.upper_medians(values), medians)


def test_medians_of_levels_agree_with_counting_one_by_one() -> None:
    rng = np.random.default_rng(4)
    source = rng.integers(0, 200, (300, 3), dtype=np.uint8)
    target = rng.integers(0, 256, (300, 3), dtype=np.uint8)
    found = foreground.level_medians(source, target, 16)
    wanted = np.zeros((3, 3, 16))
    for channel in range(3):
        for group in range(16):
            here = source[:, channel] // 16 == group
            values = np.sort(target[here, channel])
            median = values[(len(values) - 1) // 2] if len(values) else 0
            wanted[:, channel, group] = len(values), source[here, channel].sum(), median
    for part, expected in zip(found, wanted, strict=True):
        assert_array_equal(part, expected)
    assert not found.totals[:, 13:].any()


# ── channels and trees


@given(seeds, st.sampled_from((3, 60, 256)))
def test_gradients_are_central_differences_of_the_channel_that_changes_most(
    seed: int, levels: int
) -> None:
    picture = np.random.default_rng(seed).integers(0, levels, (6, 7, 3))
    found = channels.gradients(picture.astype(np.uint8))
    across = picture[1:-1, 2:] - picture[1:-1, :-2]
    down = picture[2:, 1:-1] - picture[:-2, 1:-1]
    most = (across**2 + down**2).argmax(axis=2)[:, :, None]
    across, down = (np.take_along_axis(part, most, 2)[:, :, 0] for part in (across, down))
    sizes = np.hypot(across, down)
    assert_allclose(found.magnitudes[1:-1, 1:-1], 0.5 * sizes, rtol=1e-6)
    turns = np.arctan2(down, across) / np.pi * ORIENTATIONS
    turns = np.floor(turns + ORIENTATIONS + 0.5).astype(int) % ORIENTATIONS
    assert_array_equal(found.bins[1:-1, 1:-1], np.where(sizes > 0.0, turns, 0))
    for whole in found:
        assert not whole[[0, -1]].any()
        assert not whole[:, [0, -1]].any()


def random_windows(rng: np.random.Generator, count: int) -> ndarray:
    """Windows at quarters of a pixel, some beyond the picture or without a pixel in a cell."""
    corners = rng.integers(-40, 120, (count, 2)) / 4.0
    return np.concatenate([corners, corners + rng.integers(0, 160, (count, 2)) / 4.0], axis=1)


@given(seeds)
def test_means_of_cells_and_the_trees_that_ask_for_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planes = rng.integers(0, 256, (22, 26, 2)).astype(np.uint8)
    bins = rng.integers(0, ORIENTATIONS, (22, 26)).astype(np.uint8)
    sizes = rng.integers(0, 256, (22, 26)).astype(np.uint8)
    by_direction = np.where(bins[..., None] == np.arange(ORIENTATIONS), sizes[..., None], 0)
    whole = np.concatenate([by_direction, sizes[..., None], planes], axis=2)
    sums = channels.channel_sums(bins, sizes, planes)
    windows = random_windows(rng, 3)
    means = np.zeros((3, ROWS, COLUMNS, whole.shape[2]), dtype=int)
    for n, (left, top, right, bottom) in enumerate(windows):
        # a pixel belongs to the cell that its centre is in, on a border to the left or upper one
        xs = np.ceil((np.arange(26) - left) / (right - left or np.nan) * COLUMNS) - 1
        ys = np.ceil((np.arange(22) - top) / (bottom - top or np.nan) * ROWS) - 1
        for row in range(ROWS):
            for column in range(COLUMNS):
                part = whole[np.ix_(ys == row, xs == column)].reshape(-1, whole.shape[2])
                if len(part):
                    means[n, row, column] = np.floor(part.mean(axis=0) + 0.5)
    flat = means.reshape(3, -1)
    assert_array_equal(channels.cell_means(sums, windows), flat)

    features = rng.integers(0, flat.shape[1], (4, 7)).astype(np.int32)
    around = flat[rng.integers(0, 3, (4, 7)), features] + rng.integers(-1, 2, (4, 7))
    leaves = (rng.integers(-4, 5, (4, 8)) / 4.0).astype(np.float32)
    least = (rng.integers(-8, 2, 4) / 4.0).astype(np.float32)
    scores = channels.tree_scores(sums, windows, features, around.astype(np.int32), leaves, least)
    for n in range(3):
        total, lost = 0.0, False
        for t in range(4):
            node = 0
            while node < 7:
                node = 2 * node + (1 if flat[n, features[t, node]] <= around[t, node] else 2)
            total += leaves[t, node - 7]
            lost = lost or total < least[t]
        assert scores[n] == (-np.inf if lost else total)


# ── boxes that hang from outlines


@given(seeds, st.integers(1, 3))
def test_candidates_hang_from_the_highest_pixels_of_their_piece(seed: int, stride: int) -> None:
    rng = np.random.default_rng(seed)
    owners = np.full((24, 30), -1, dtype=np.int32)
    pieces = []
    # the last row and column of each are odd, the first column too
    for j, (left, top, right, bottom) in enumerate(((1, 0, 8, 14), (11, 3, 24, 22))):
        part = owners[top:bottom, left:right]
        part[rng.random(part.shape) < (0.3 if seed % 2 else 1.0)] = j
        part[:, rng.integers(right - left)] = -1
        pieces.append([left + right - 1, top + bottom - 1, right - left, bottom - top])
    table, possible = rng.uniform(0.5, 9.0, (20, 2, 2)), rng.random(20) < 0.8
    sizes = silhouettes.SizeTable(table, possible, 4.0, 5, 4)
    found = silhouettes.candidates(owners, np.array(pieces) / 2.0, sizes, 3.5, stride)
    wanted, whose = [], []
    for j, (middle, _, width, _) in enumerate(pieces):
        first = (middle + 1 - width) // 2
        for x in range(first, first + width, stride):
            if not (owners[:, x] == j).any():
                continue
            crown = int(np.argmax(owners[:, x] == j))
            for q in range(2):
                half, place = np.array([0.0, 3.5]), 0
                for _ in range(3):
                    row = np.clip(np.floor((crown + half[1] + 0.5) / 4.0), 0, 3)
                    place = int(row * 5 + np.clip(np.floor((x + 0.5) / 4.0), 0, 4))
                    half = table[place, q] if possible[place] else half
                if possible[place]:
                    wanted.append([x, crown + half[1] - 0.5, *half])
                    whose.append(j)
    assert_allclose(found.boxes, np.reshape(wanted, (-1, 4)))
    assert_array_equal(found.owners, whose)


def chosen(
    boxes: ndarray, owners: ndarray, scores: ndarray, wanted: ndarray, rule: Any, width: float
) -> list[tuple[int, float, ndarray]]:
    """The best of a piece first, averaged with its neighbours, two half sizes apart."""
    found = []
    for j in range(len(wanted)):
        own, taken = np.flatnonzero(owners == j), []
        free = own.tolist()
        while free:
            best = max(free, key=lambda i: (scores[i], -i))
            least = rule.further if taken else rule.first
            if scores[best] < (rule.spare if len(taken) >= wanted[j] else least):
                break
            offsets = (boxes[own] - boxes[best])[:, [0, 1, 3]] / boxes[best, [2, 3, 3]] / width
            square = (offsets**2).sum(axis=1)
            weights = np.exp(scores[own] - scores[best] - 0.5 * square) * (square < 9.0)
            mean = weights @ boxes[own] / weights.sum()
            free.remove(best)
            if all(squares(mean[None], other)[0] >= 4.0 for other in taken):
                taken.append(mean)
                found.append((j, scores[best], mean))
                free = [i for i in free if squares(boxes[[i]], mean)[0] >= 4.0]
    return found


@given(seeds, st.integers(0, 14), st.sampled_from((0.1, 0.5, 1.0)))
def test_the_best_candidates_of_each_piece_are_taken(seed: int, count: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    boxes, owners = grid_boxes(rng, count, 12), np.sort(rng.integers(0, 4, count))
    owners[owners == 2] = 3  # a piece without any
    scores, wanted = rng.integers(0, 7, count).astype(float), rng.integers(0, 4, 4)
    rule = silhouettes.Acceptance(*rng.permutation([2.0, 3.0, 4.0]))
    found = silhouettes.choose(
        silhouettes.Candidates(boxes, owners), scores, wanted, rule, width, 2.0
    )
    expected = chosen(boxes, owners, scores, wanted, rule, width)
    assert found.owners.tolist() == [j for j, _, _ in expected]
    assert found.scores.tolist() == [score for _, score, _ in expected]
    assert_allclose(found.boxes, np.reshape([mean for _, _, mean in expected], (-1, 4)))
