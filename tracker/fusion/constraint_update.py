"""The update of a step's posterior by the place constraints of a user's corrections."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.corrections.consistency import NEAR
from tracker.corrections.inflation import inflation
from tracker.filters import gaussian_mixture, models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.model import FusionModel
from tracker.fusion.protocol import PlaceConstraints
from tracker.fusion.record import Record

_EXISTENCE = 0.999
"""Existence probability of a target that a place constraint states to be present; at 1 no miss
would decrease it afterwards."""


def apply_constraints(
    mixture: GaussianMixture,
    record: Record,
    constraints: PlaceConstraints,
    model: FusionModel,
    *,
    first_new_label: int,
    next_label: int,
) -> tuple[GaussianMixture, Record, int]:
    """Apply the place constraints of a step to its posterior.

    Components born in this step within an area that is stated to be empty are removed. A
    place z of standard deviation σ is a measurement with p_D = 1 and without clutter: it
    updates the component j of the largest w_j N(z; m_j, P_j + σ²I) within the gate, or so near
    that two people cannot both stand there (:attr:`FusionModel.near`). The covariance of that
    component is inflated as far as the place requires (see
    :func:`tracker.corrections.inflation.inflation`) and its label's existence raised to 0.999.
    Where there is no such component, a new one begins at the place.

    Args:
        mixture: J components of this step.
        record: The evidence of these J components.
        constraints: The place constraints of this step.
        model: The model of the filter: motion, gates and size of a target.
        first_new_label: The first label that was given in this step.
        next_label: The first label that is free.

    Returns:
        The components, their record, and the first label that is free afterwards.
    """
    if len(constraints.empty):
        apart = np.linalg.norm(mixture.means[:, None, :2] - constraints.empty, axis=2)
        forbidden = (apart <= constraints.around).any(axis=1) & (mixture.labels >= first_new_label)
        allowed = np.flatnonzero(~forbidden)
        mixture, record = mixture.take(allowed), record.take(allowed)
    for place, sigma, reference in zip(
        constraints.places, constraints.sigmas.tolist(), constraints.references, strict=True
    ):
        noise = sigma**2 * np.eye(3)
        best = None
        if reference[0] == reference[0]:  # NaN stands for any track
            best = _component_at(mixture, reference, NEAR**2 * np.eye(3), model)
        if best is None:
            best = _component_at(mixture, place, noise, model)
        if best is None:
            unlabelled = np.zeros(1, dtype=np.int64)
            one = GaussianMixture(np.array([_EXISTENCE]), place[None], noise[None], unlabelled)
            born = models.label_births(model.motion.at_rest(one), next_label)
            next_label += born.size
            mixture = gaussian_mixture.concatenate([mixture, born])
            record = record.extended(born.size)
        else:
            mixture = _update_component(mixture, best, place, noise)
    return mixture, record, next_label


def _component_at(
    mixture: GaussianMixture, place: ndarray, noise: ndarray, model: FusionModel
) -> int | None:
    """Return the index of the component that a place belongs to, None for none.

    Args:
        mixture: J components.
        place: z (3,), world metres.
        noise: σ² I (3, 3), square metres.
        model: Gate and size of a target.
    """
    if not mixture.size:
        return None
    offsets = place - mixture.means[:, :3]
    spread = mixture.covariances[:, :3, :3] + noise
    distances = np.einsum("ja,ja->j", offsets, np.linalg.solve(spread, offsets[..., None])[..., 0])
    _, log_determinants = np.linalg.slogdet(spread)
    score = np.log(np.maximum(mixture.weights, 1e-300)) - 0.5 * (distances + log_determinants)
    too_near = (np.hypot(*offsets[:, :2].T) <= model.near) & (np.abs(offsets[:, 2]) <= model.height)
    score[(distances > model.place_gate) & ~too_near] = -np.inf
    best = int(np.argmax(score))
    return best if np.isfinite(score[best]) else None


def _update_component(
    mixture: GaussianMixture, component: int, place: ndarray, noise: ndarray
) -> GaussianMixture:
    """Update one component by a place, in Joseph's form, and raise its label's existence."""
    mean, covariance = mixture.means[component], mixture.covariances[component].copy()
    sigma = float(np.sqrt(noise[0, 0]))
    extra = inflation(place - mean[:3], covariance[:3, :3], sigma)
    covariance[:3, :3] += extra
    gain = np.linalg.solve(covariance[:3, :3] + noise, covariance[:3]).T
    rest = np.eye(len(mean))
    rest[:, :3] -= gain
    means, covariances = mixture.means.copy(), mixture.covariances.copy()
    weights = mixture.weights.copy()
    means[component] = mean + gain @ (place - mean[:3])
    covariances[component] = rest @ covariance @ rest.T + gain @ noise @ gain.T
    # boxes of the next step have similar errors, and must still lie in the gate of the component
    covariances[component, :3, :3] += extra
    own = mixture.labels == mixture.labels[component]
    weights[component] += max(_EXISTENCE - float(weights[own].sum()), 0.0)
    return GaussianMixture(weights, means, covariances, mixture.labels)
