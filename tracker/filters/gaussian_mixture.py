"""An intensity as a weighted sum of Gaussians: predict, prune, merge, cap.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.kernels import linear_algebra
from tracker.kernels import mixtures as mixture_kernels
from tracker.kernels.linear_algebra import Gaussians

_NO_OWNERS = np.zeros(0, dtype=np.int64)
"""The owners where no component has one, in the form that the kernels take."""


class _Weighted(Protocol):
    """J components as a compiled kernel returns them: shapes (J,), (J, d) and (J, d, d)."""

    @property
    def weights(self) -> ndarray: ...
    @property
    def means(self) -> ndarray: ...
    @property
    def covariances(self) -> ndarray: ...


@dataclass(frozen=True, slots=True)
class GaussianMixture:
    """An intensity as a weighted sum of J Gaussians over a d-dimensional state.

    The weights are expected numbers of targets, not probabilities: they sum to
    the expected cardinality, and one weight may exceed 1.
    """

    weights: Float[ndarray, " J"]
    """Expected number of targets of each component."""
    means: Float[ndarray, "J d"]
    """Position in metres and, for d = 6, velocity in metres per second, world frame."""
    covariances: Float[ndarray, "J d d"]
    """Covariance of each component, in products of the units of the means."""
    labels: Int[ndarray, " J"]
    """Label of the birth that each component descends from; components may share one."""

    def __post_init__(self) -> None:
        size, dimension = self.means.shape
        if (
            self.weights.shape != (size,)
            or self.labels.shape != (size,)
            or self.covariances.shape != (size, dimension, dimension)
        ):
            raise ValueError(
                "weights, means, covariances and labels must have shapes (J,), (J, d), (J, d, d) "
                f"and (J,), got {self.weights.shape}, {self.means.shape}, "
                f"{self.covariances.shape} and {self.labels.shape}"
            )

    @staticmethod
    def empty(dimension: int) -> GaussianMixture:
        """The intensity without components, over a state of the given dimension."""
        return GaussianMixture(
            weights=np.zeros(0),
            means=np.zeros((0, dimension)),
            covariances=np.zeros((0, dimension, dimension)),
            labels=np.zeros(0, dtype=np.int64),
        )

    @staticmethod
    def of(gaussians: _Weighted, labels: Int[ndarray, " J"]) -> GaussianMixture:
        """The components that a compiled kernel returned, with their labels."""
        return GaussianMixture(gaussians.weights, gaussians.means, gaussians.covariances, labels)

    @property
    def size(self) -> int:
        """The number of components J."""
        return len(self.weights)

    @property
    def dimension(self) -> int:
        """The dimension d of the state."""
        return int(self.means.shape[1])

    @property
    def cardinality(self) -> float:
        """The expected number of targets: the sum of the weights."""
        return float(self.weights.sum())

    @property
    def gaussians(self) -> Gaussians:
        """The components in the form that the compiled kernels take."""
        return Gaussians(self.weights, self.means, self.covariances)

    def take(self, indices: ndarray | slice) -> GaussianMixture:
        """Select the components at ``indices`` (integers, a mask or a slice), in that order."""
        if isinstance(indices, slice):
            return GaussianMixture(
                self.weights[indices],
                self.means[indices],
                self.covariances[indices],
                self.labels[indices],
            )
        if indices.dtype == np.bool_:
            indices = indices.nonzero()[0]
        # cheaper than indexing with brackets, which prepares for any kind of index
        return GaussianMixture(
            self.weights.take(indices),
            self.means.take(indices, 0),
            self.covariances.take(indices, 0),
            self.labels.take(indices),
        )

    def relabelled(self, changed: dict[int, int]) -> GaussianMixture:
        """The same components; each label that is a key of ``changed`` becomes its value."""
        labels = np.array(
            [changed.get(label, label) for label in self.labels.tolist()], dtype=np.int64
        )
        return GaussianMixture(self.weights, self.means, self.covariances, labels)


def concatenate(mixtures: Sequence[GaussianMixture]) -> GaussianMixture:
    """The sum of intensities over the same state: all their components, in order."""
    return GaussianMixture(
        np.concatenate([m.weights for m in mixtures]),
        np.concatenate([m.means for m in mixtures]),
        np.concatenate([m.covariances for m in mixtures]),
        np.concatenate([m.labels for m in mixtures]),
    )


def predict(
    mixture: GaussianMixture,
    transition: Float[ndarray, "d d"],
    noise: Float[ndarray, "*J d d"],
    survival_probability: float | Float[ndarray, " J"],
) -> GaussianMixture:
    """Move every component one step ahead through a linear motion model.

    w ← p_S w,  m ← F m,  P ← F P Fᵀ + Q: eq. (25)–(27) of [VM06]_ without births.

    Args:
        mixture: J components. The labels do not change.
        transition: F, the transition matrix of one step.
        noise: Q, process noise of one step in products of the state's units, (d, d) for all
            components or (J, d, d), one for each.
        survival_probability: p_S of one step, one for all components or one for each.
    """
    moved = mixture_kernels.predict(
        mixture.means,
        mixture.covariances,
        np.ascontiguousarray(transition, dtype=float),
        np.ascontiguousarray(noise, dtype=float).reshape(-1, *transition.shape),
    )
    return GaussianMixture(
        mixture.weights * survival_probability, moved.means, moved.covariances, mixture.labels
    )


def prune(mixture: GaussianMixture, threshold: float) -> Int[ndarray, " K"]:
    """The indices of the components with a weight of at least the threshold T ([VM06]_)."""
    return (mixture.weights >= threshold).nonzero()[0]


def merge(
    mixture: GaussianMixture, threshold: float, owners: Int[ndarray, " J"] | None = None
) -> tuple[GaussianMixture, Int[ndarray, " K"]]:
    """Merge components that lie close to a heavier one, keeping the first two moments.

    Starting from the heaviest component l, every component i with

        (m_i - m_l)ᵀ P_i⁻¹ (m_i - m_l) <= threshold

    is absorbed by it, as in Table II of [VM06]_. The expected cardinality and
    the mean and second moment of the whole mixture do not change. The label is
    the one of the heaviest component.

    Args:
        mixture: J components. An empty mixture is returned as it is.
        threshold: Squared Mahalanobis distance U >= 0, without unit.
        owners: Owner of each component, -1 for none. A component that has one (0 or more) is
            absorbed by components of the same owner only; with None every component may absorb
            every other.

    Returns:
        At most J components, in descending order of their leaders' weights; and for each the index
        of its leader l in ``mixture``, by which other data about the leader can be looked up.

    Raises:
        ValueError: If ``threshold`` is negative.
        numpy.linalg.LinAlgError: If a covariance is not positive definite.
    """
    _check(threshold)
    if mixture.size == 0:
        return mixture, np.zeros(0, dtype=np.int64)
    order = mixture_kernels.heaviest_first(mixture.weights)
    groups = mixture_kernels.merge_groups(
        mixture.means,
        mixture.covariances,
        order,
        _NO_OWNERS if owners is None else owners,
        threshold,
    )
    leaders = groups.leaders
    merged = linear_algebra.merge_moments(
        mixture.weights, mixture.means, mixture.covariances, groups.places, len(leaders)
    )
    return GaussianMixture.of(merged, mixture.labels.take(leaders)), leaders


def reduce(
    mixture: GaussianMixture,
    *,
    pruning_threshold: float,
    merging_threshold: float,
    max_components: int,
    owners: Int[ndarray, " J"] | None = None,
) -> tuple[GaussianMixture, Int[ndarray, " K"]]:
    """Prune, merge and cap: the step that keeps the recursion bounded (Table II of [VM06]_).

    Where more than J_max components are left, the heaviest J_max remain and are scaled to the
    weight of all, so that the expected cardinality does not change. Without that, the weight
    of a crowd that needs more than J_max components would decrease at every step.

    Args:
        mixture: J components.
        pruning_threshold: T, the least weight a component must have.
        merging_threshold: U, the squared Mahalanobis distance of :func:`merge`.
        max_components: J_max, the largest number of components.
        owners: Owner of each component, -1 for none, as in :func:`merge`.

    Returns:
        The reduced mixture, heaviest first, and for each component the index into ``mixture``
        of the one that absorbed the others.
    """
    _check(merging_threshold)
    reduced = mixture_kernels.reduce_mixture(
        mixture.weights,
        mixture.means,
        mixture.covariances,
        _NO_OWNERS if owners is None else owners,
        pruning_threshold,
        merging_threshold,
        max_components,
    )
    leaders = reduced.leaders
    return GaussianMixture.of(reduced, mixture.labels.take(leaders)), leaders


def gate_distance(probability: float, dimension: int) -> float:
    """The squared Mahalanobis distance within which a Gaussian has a share of its mass.

    It is the quantile of χ² with d degrees of freedom, 2 P⁻¹(d/2, P_G), with the regularised
    incomplete gamma function P. (``scipy.stats`` has the quantile too, and is slow to import.)

    Args:
        probability: P_G, the share of the mass, 0 … 1.
        dimension: d, the degrees of freedom.
    """
    from scipy.special import gammaincinv  # slow to import

    return float(2.0 * gammaincinv(dimension / 2.0, probability))


def _check(threshold: float) -> None:
    if threshold < 0.0:
        raise ValueError(f"threshold must be >= 0 (squared Mahalanobis distance), got {threshold}")
