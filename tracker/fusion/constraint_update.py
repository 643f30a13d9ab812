"""The posterior of a step as it is with the constraints of places that a person gave."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.corrections.contradictions import NEAR
from tracker.corrections.stating import doubted
from tracker.filters import gaussian_mixture, models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.model import FusionModel
from tracker.fusion.place_constraints import PlaceConstraints
from tracker.fusion.record import Record

_SURE = 0.999
"""Existence of a person who is there because it was said."""


def obey(
    mixture: GaussianMixture,
    record: Record,
    told: PlaceConstraints,
    model: FusionModel,
    *,
    first_new_label: int,
    next_label: int,
) -> tuple[GaussianMixture, Record, int]:
    """The posterior of a step as it is with what a person said of it.

    Who was born in this step where nobody is, is not. A place z of standard deviation σ is a
    measurement that is sure to be made and is no clutter: it goes to the component j of the
    largest w_j N(z; m_j, P_j + σ²I) within the gate, or so near that two people could not both
    stand there, which is there then, and as wide as the place asks for (see
    :func:`tracker.corrections.stating.doubted`); where there is none, somebody begins there.

    Args:
        mixture: Components of this step.
        record: The same ones.
        told: Of this step.
        model: Motion, and the gate.
        first_new_label: The first label that was given in this step.
        next_label: The first that is free.

    Returns:
        The components, their record, and the label that is free now.
    """
    if len(told.empty):
        apart = np.linalg.norm(mixture.means[:, None, :2] - told.empty, axis=2)
        forbidden = (apart <= told.around).any(axis=1) & (mixture.labels >= first_new_label)
        kept = np.flatnonzero(~forbidden)
        mixture, record = mixture.take(kept), record.take(kept)
    for place, sigma, whom in zip(told.places, told.sigmas.tolist(), told.meant, strict=True):
        noise = sigma**2 * np.eye(3)
        best = _meant(mixture, whom, NEAR**2 * np.eye(3), model) if whom[0] == whom[0] else None
        if best is None:
            best = _meant(mixture, place, noise, model)
        if best is None:
            nameless = np.zeros(1, dtype=np.int64)
            one = GaussianMixture(np.array([_SURE]), place[None], noise[None], nameless)
            born = models.label_births(model.motion.at_rest(one), next_label)
            next_label += born.size
            mixture = gaussian_mixture.concatenate([mixture, born])
            record = record.extended(born.size)
        else:
            mixture = _updated(mixture, best, place, noise)
    return mixture, record, next_label


def _meant(
    mixture: GaussianMixture, place: ndarray, noise: ndarray, model: FusionModel
) -> int | None:
    """The component that a place means; None for nobody yet."""
    if not mixture.size:
        return None
    offsets = place - mixture.means[:, :3]
    spread = mixture.covariances[:, :3, :3] + noise
    distances = np.einsum("ja,ja->j", offsets, np.linalg.solve(spread, offsets[..., None])[..., 0])
    _, log_determinants = np.linalg.slogdet(spread)
    score = np.log(np.maximum(mixture.weights, 1e-300)) - 0.5 * (distances + log_determinants)
    too_near = (np.hypot(*offsets[:, :2].T) <= model.near) & (np.abs(offsets[:, 2]) <= model.height)
    score[(distances > model.gate_of_places) & ~too_near] = -np.inf
    best = int(np.argmax(score))
    return best if np.isfinite(score[best]) else None


def _updated(
    mixture: GaussianMixture, component: int, place: ndarray, noise: ndarray
) -> GaussianMixture:
    """One component updated by a place, and its label sure to be there: Joseph's form."""
    mean, covariance = mixture.means[component], mixture.covariances[component].copy()
    sigma = float(np.sqrt(noise[0, 0]))
    doubt = doubted(place - mean[:3], covariance[:3, :3], sigma)
    covariance[:3, :3] += doubt
    gain = np.linalg.solve(covariance[:3, :3] + noise, covariance[:3]).T
    rest = np.eye(len(mean))
    rest[:, :3] -= gain
    means, covariances = mixture.means.copy(), mixture.covariances.copy()
    weights = mixture.weights.copy()
    means[component] = mean + gain @ (place - mean[:3])
    covariances[component] = rest @ covariance @ rest.T + gain @ noise @ gain.T
    # the boxes of the next step err as those of this one do: they are still this person's
    covariances[component, :3, :3] += doubt
    own = mixture.labels == mixture.labels[component]
    weights[component] += max(_SURE - float(weights[own].sum()), 0.0)
    return GaussianMixture(weights, means, covariances, mixture.labels)
