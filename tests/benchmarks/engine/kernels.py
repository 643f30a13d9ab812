"""The compiled kernels against their plain NumPy references, in one run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy import ndarray

from tests.benchmarks.measure import Measurement, ratio, seconds
from tests.filters.mixtures import random_mixture, reference_merge, reference_update
from tracker.filters import gaussian_mixture, phd
from tracker.kernels.kalman import Expected
from tracker.single_view.pictures import colour
from tracker.single_view.pseudo_particle import particles


def reference_climb(boxes: ndarray, counts: ndarray, start: ndarray, bandwidth: float) -> ndarray:
    """Mean shift as its definition says, one box at a time."""
    point = start.copy()
    for _ in range(particles.ITERATIONS):
        offsets = (boxes[:, :2] - point[:2]) / (bandwidth * point[2:])
        inside = counts * ((offsets**2).sum(axis=1) < 1.0)
        if not inside.any():
            break
        mean = inside @ boxes / inside.sum()
        step = np.linalg.norm((mean - point)[:2] / point[2:])
        point = mean
        if step < particles.TOLERANCE:
            break
    return point


def run(short: bool) -> Iterator[Measurement]:
    """Update and merging of a mixture of a single view's size; colour distances of its samples."""
    rng = np.random.default_rng(1)
    mixture = random_mixture(rng, 30, 4)
    jacobians = np.tile(np.eye(4), (30, 1, 1))
    measurements = mixture.means[:8] + rng.normal(0.0, 0.3, (8, 4))
    noise = np.eye(4)[None]
    p_d = np.full(30, 0.9)

    def update() -> object:
        return phd.update(
            mixture,
            measurements,
            expected=Expected.of(mixture.means, jacobians),
            noise=noise,
            detection_probability=p_d,
            clutter_intensity=1e-3,
        )

    def reference() -> object:
        return reference_update(mixture, measurements, mixture.means, jacobians, noise, p_d, 1e-3)

    pairs = 3 if short else 9
    yield Measurement(
        "PHD update, 30 × 8, kernel against NumPy",
        ratio(update, reference, pairs=pairs),
        "×",
        "≥ 5",
        5.0,
    )
    posterior = phd.update(
        mixture,
        measurements,
        expected=Expected.of(mixture.means, jacobians),
        noise=noise,
        detection_probability=p_d,
        clutter_intensity=1e-3,
    ).posterior
    yield Measurement(
        f"merging of {posterior.size} components, kernel against NumPy",
        ratio(
            lambda: gaussian_mixture.merge(posterior, 4.0),
            lambda: reference_merge(posterior, 4.0),
            pairs=pairs,
        ),
        "×",
        "≥ 5",
        5.0,
    )
    yield from _colour(rng)
    yield from _clusters(rng, pairs)


def _clusters(rng: np.random.Generator, pairs: int) -> Iterator[Measurement]:
    """Mean shift of the particles that a resampling left of 400 on three people."""
    centres = np.array([[60.0, 50.0, 10.0, 15.0], [110.0, 52, 12, 16], [62.0, 140, 8, 12]])
    boxes = np.repeat(centres, 50, axis=0)
    boxes[:, :2] += rng.normal(0.0, 5.0, (150, 2))
    counts = rng.multinomial(400, np.full(150, 1 / 150))
    groups = np.repeat([0, 1, 2], 50)

    def compiled() -> object:
        return particles.clusters(boxes, counts, groups, bandwidth=1.0, merge_distance=1.0)

    def reference() -> object:
        weights = counts.astype(float)
        return [reference_climb(boxes, weights, start, 1.0) for start in boxes[counts > 0]]

    yield Measurement(
        "mean-shift clusters of 400 particles, kernel against NumPy",
        ratio(compiled, reference, pairs=pairs),
        "×",
        "≥ 5",
        5.0,
    )


def _colour(rng: np.random.Generator) -> Iterator[Measurement]:
    """Boxes a second: 400 samples a camera, head-sized boxes, 272 bins."""
    for width, height, half in ((360, 288, 12.0), (1920, 1080, 60.0)):
        picture = rng.integers(0, 255, (height, width, 3), dtype=np.uint8)
        boxes = np.stack(
            [
                rng.uniform(half, width - half, 400),
                rng.uniform(half, height - half, 400),
                np.full(400, half),
                np.full(400, 1.4 * half),
            ],
            axis=1,
        )
        bins = colour.bin_map(picture, "hue_saturation")
        templates = colour.histograms(bins, boxes[:6], "hue_saturation", "epanechnikov")
        model = colour.ColourModel.of(templates, "aabbcc", "hue_saturation", "epanechnikov")
        taken = seconds(lambda: model.distances(bins, boxes))  # noqa: B023
        yield Measurement(f"colour distances at {width}×{height}", 400.0 / taken, "boxes/s")
