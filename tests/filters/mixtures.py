"""Random mixtures for property tests, and the plain NumPy forms that kernels are held against."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture


def random_covariances(rng: np.random.Generator, count: int, dimension: int) -> ndarray:
    """Symmetric positive definite, axes at any angle, condition numbers up to about 1e4."""
    spread = np.exp(rng.uniform(-2.3, 2.3, (count, dimension)))
    axes, _ = np.linalg.qr(rng.normal(size=(count, dimension, dimension)))
    covariances = np.einsum("jab,jb,jcb->jac", axes, spread**2, axes)
    return np.asarray((covariances + covariances.transpose(0, 2, 1)) / 2.0)


def random_mixture(
    rng: np.random.Generator, count: int, dimension: int, *, extent: float = 5.0
) -> GaussianMixture:
    """Weights over six orders of magnitude, some labels shared."""
    return GaussianMixture(
        weights=np.exp(rng.uniform(-13.0, 0.8, count)),
        means=rng.uniform(-extent, extent, (count, dimension)),
        covariances=random_covariances(rng, count, dimension),
        labels=rng.integers(1, max(2, count), count),
    )


@st.composite
def mixtures(
    draw: st.DrawFn, *, least: int = 0, most: int = 25, dimensions: tuple[int, ...] = (1, 2, 4, 6)
) -> GaussianMixture:
    """Mixtures of any size and dimension, crowded or far apart."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return random_mixture(
        rng,
        draw(st.integers(least, most)),
        draw(st.sampled_from(dimensions)),
        extent=draw(st.sampled_from((0.0, 1.0, 10.0, 1000.0))),
    )


def first_moment(mixture: GaussianMixture) -> ndarray:
    """Σ w m."""
    return np.asarray(mixture.weights @ mixture.means)


def second_moment(mixture: GaussianMixture) -> ndarray:
    """Σ w (P + m mᵀ)."""
    outer = np.einsum("ja,jb->jab", mixture.means, mixture.means)
    return np.asarray(np.einsum("j,jab->ab", mixture.weights, mixture.covariances + outer))


def assert_positive_definite(covariances: ndarray) -> None:
    """Symmetric to the last bit, and with positive eigenvalues only."""
    np.testing.assert_array_equal(covariances, covariances.transpose(0, 2, 1))
    assert (np.linalg.eigvalsh(covariances) > 0.0).all()


def reference_merge(
    mixture: GaussianMixture, threshold: float
) -> tuple[GaussianMixture, list[int], list[list[int]]]:
    """Table II of [VM06], word by word; also the leader and the members of each group."""
    left = list(range(mixture.size))
    parts: list[tuple[float, ndarray, ndarray]] = []
    leaders: list[int] = []
    members: list[list[int]] = []
    while left:
        leader = max(left, key=lambda i: (mixture.weights[i], -i))
        group = []
        for i in left:
            difference = mixture.means[i] - mixture.means[leader]
            if (
                i == leader
                or difference @ np.linalg.inv(mixture.covariances[i]) @ difference <= threshold
            ):
                group.append(i)
        left = [i for i in left if i not in group]
        w = mixture.weights[group]
        mean = w @ mixture.means[group] / w.sum()
        offset = mixture.means[group] - mean
        covariance = (
            np.einsum(
                "j,jab->ab",
                w,
                mixture.covariances[group] + np.einsum("ja,jb->jab", offset, offset),
            )
            / w.sum()
        )
        parts.append((float(w.sum()), mean, covariance))
        leaders.append(leader)
        members.append(group)
    d = mixture.dimension
    merged = GaussianMixture(
        np.array([w for w, _, _ in parts]),
        np.array([m for _, m, _ in parts]).reshape(-1, d),
        np.array([p for _, _, p in parts]).reshape(-1, d, d),
        mixture.labels[leaders].astype(np.int64),
    )
    return merged, leaders, members


def reference_reduce(
    mixture: GaussianMixture,
    pruning_threshold: float,
    merging_threshold: float,
    max_components: int,
) -> GaussianMixture:
    """Prune, merge and cap by :func:`reference_merge`, keeping the weight of all."""
    heavy = mixture.take(mixture.weights >= pruning_threshold)
    merged, _, _ = reference_merge(heavy, merging_threshold)
    order = sorted(range(merged.size), key=lambda i: -merged.weights[i])[:max_components]
    reduced = merged.take(np.array(order, dtype=np.int64))
    total = sum(reduced.weights.tolist())
    weights = reduced.weights * (sum(merged.weights.tolist()) / total if total else 1.0)
    return GaussianMixture(weights, reduced.means, reduced.covariances, reduced.labels)


def reference_update(
    predicted: GaussianMixture,
    measurements: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    noises: ndarray,
    detection_probability: ndarray,
    clutter_intensity: float | ndarray,
    gate: float = np.inf,
) -> dict[tuple[int, int], tuple[float, ndarray, ndarray]]:
    """Eq. (28)–(33) of [VM06] pair by pair: weight, mean, covariance by (component, measurement).

    Measurement -1 is the miss. The textbook form P - K S Kᵀ stands for the covariance.
    """
    pairs: dict[tuple[int, int], tuple[float, ndarray, ndarray]] = {}
    for j in range(predicted.size):
        missed = (1.0 - detection_probability[j]) * predicted.weights[j]
        pairs[j, -1] = (float(missed), predicted.means[j], predicted.covariances[j])
    for z, measurement in enumerate(measurements):
        noise = noises[z if len(noises) > 1 else 0]
        unnormalised: dict[int, tuple[float, ndarray, ndarray]] = {}
        for j in range(predicted.size):
            p, h = predicted.covariances[j], jacobians[j]
            s = h @ p @ h.T + noise
            innovation = measurement - expected[j]
            distance = innovation @ np.linalg.inv(s) @ innovation
            share = detection_probability[j] * predicted.weights[j]
            if distance > gate or share == 0.0:
                continue
            density = np.exp(-0.5 * distance) / np.sqrt(np.linalg.det(2.0 * np.pi * s))
            gain = p @ h.T @ np.linalg.inv(s)
            unnormalised[j] = (
                float(share * density),
                predicted.means[j] + gain @ innovation,
                p - gain @ s @ gain.T,
            )
        kappa = np.broadcast_to(clutter_intensity, len(measurements))[z]
        total = kappa + sum(weight for weight, _, _ in unnormalised.values())
        for j, (weight, mean, covariance) in unnormalised.items():
            pairs[j, z] = (weight / total, mean, covariance)
    return pairs
