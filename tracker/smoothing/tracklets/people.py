"""Embeddings of boxes, and log odds of the people with templates for each tracklet."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.kernels import boxes as box_kernels
from tracker.parameters.groups.fusion import FusionParams
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.recording import CameraBoxes
from tracker.smoothing.smoother import Smoother
from tracker.steps import Steps

_AS_THE_FILTER = FusionParams()
"""The filter's default parameters, by which colours are weighted whatever the filter is set to."""

_OWN = 0.7
"""Association probability above which the colours of a box count."""


@dataclass(frozen=True, slots=True, eq=False)
class Appearances:
    """The appearance of the boxes of all steps, camera by camera; None where none is known."""

    embeddings: Many[Float[ndarray, "B A"]] | None = None
    """A unit vector for each box, 0 where it has none."""
    likenesses: Many[Float[ndarray, "B G"]] | None = None
    """Probability of each of G people with templates for each box, 1/G each where it is unknown."""

    @staticmethod
    def of(views: Steps[tuple[ViewResult, ...]]) -> Appearances:
        """Collect the appearance of boxes from the results of stage 1 for each step."""
        return Appearances(_embeddings(views), _likenesses(views))


def _embeddings(views: Steps[tuple[ViewResult, ...]]) -> list[Float[ndarray, "B A"]] | None:
    """The embeddings of each camera's boxes; None where there are none, or of several sizes."""
    cameras = range(views.width or 0)
    shapes = {shape for c in cameras for shape in views.shapes("embeddings", c)}
    sizes = {size for (size,) in shapes if size}
    if len(sizes) != 1:
        return None
    size = sizes.pop()
    return [
        np.concatenate(
            [
                own if own.shape[1] else np.zeros((count, size))
                for own, count in _with_counts(views, "embeddings", c)
            ]
        )
        for c in cameras
    ]


def _likenesses(views: Steps[tuple[ViewResult, ...]]) -> list[Float[ndarray, "B G"]] | None:
    """The likelihoods of each camera's boxes for G people; None for fewer than two people."""
    cameras = range(views.width or 0)
    shapes = {shape for c in cameras for shape in views.shapes("likenesses", c)}
    people = max((size for (size,) in shapes), default=0)
    if people < 2:  # colours do not discriminate one person alone
        return None
    return [
        np.concatenate(
            [
                own if own.shape[1] == people else np.full((count, people), 1.0 / people)
                for own, count in _with_counts(views, "likenesses", c)
            ]
        )
        for c in cameras
    ]


def _with_counts(
    views: Steps[tuple[ViewResult, ...]], name: str, camera: int
) -> Iterator[tuple[ndarray, int]]:
    """The arrays of a field at each step, and the number of boxes."""
    counts = views.column("boxes", camera).counts.tolist()
    return zip(views.values(name, camera), counts, strict=True)


def template_log_odds(
    tracklets: Paths, links: Links, smoother: Smoother, seen: Appearances, weight: float
) -> Float[ndarray, "n G"]:
    """Compute the log likelihood of each tracklet's colours under each of G people with templates.

        u_g = α Δt/τ Σ_z a(z) log (ε + (1 − ε) G p_g(z)),   less the largest

    over the boxes z of the tracklet that no other box touches, with association probability a. The
    filter's re-identification has the same evidence step by step, also when two people have just
    been one blob; here it is summed over whole tracklets. p_g is the relative likelihood among the
    templates: a person without a template resembles one of them too, but consistently the same.

    Args:
        tracklets: The n tracklets.
        links: Association probabilities of their rows and boxes.
        smoother: The boxes and the time of a step, Δt.
        seen: p_g of each box.
        weight: α, the weight of the appearance.

    Returns:
        Log likelihoods less the largest of each tracklet, at most 0; of shape (n, 1) where no
        box has likelihoods.
    """
    if seen.likenesses is None:
        return np.zeros((len(tracklets.labels), 1))
    own = links.take(_clear(links, smoother.cameras))
    owners = tracklets.owners[own.rows]
    people = seen.likenesses[0].shape[1]
    scores = np.zeros((len(tracklets.labels), people))
    outliers = _AS_THE_FILTER.recognition_outlier_probability
    fresh = weight * min(smoother.model.step_time / _AS_THE_FILTER.recognition_interval, 1.0)
    for c, likeness in enumerate(seen.likenesses):
        of_camera = own.cameras == c
        odds = np.log(outliers + (1.0 - outliers) * people * likeness[own.boxes[of_camera]])
        share = fresh * own.shares[of_camera]
        np.add.at(scores, owners[of_camera], share[:, None] * odds)
    return np.asarray(scores - scores.max(axis=1, keepdims=True))


def _clear(links: Links, cameras: Many[CameraBoxes]) -> Bool[ndarray, " L"]:
    """Select the links of boxes with a clear association that overlap no other box."""
    result = links.shares > _OWN
    for c, camera in enumerate(cameras):
        own = links.cameras == c
        result[own] &= box_kernels.alone(camera.boxes, camera.starts)[links.boxes[own]]
    return np.asarray(result)


def sum_by_chain(scores: Float[ndarray, "n G"], chains: Many[Many[int]]) -> Float[ndarray, "m G"]:
    """Sum the log likelihoods over the tracklets of each chain, less the largest of each chain.

    Args:
        scores: Log likelihood of each of n tracklets under each of G people.
        chains: The tracklets of each of m chains.
    """
    whole = np.array([scores[list(chain)].sum(axis=0) for chain in chains]).reshape(
        -1, scores.shape[1]
    )
    return np.asarray(whole - whole.max(axis=1, keepdims=True))
