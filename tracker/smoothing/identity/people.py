"""What boxes look like, and which of the people with templates each piece of a track is by it."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.parameters import FusionParams
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.identity import appearance
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.smoother import Smoother

_AS_THE_FILTER = FusionParams()
"""What colours tell is weighed as the filter does by itself, whatever it is set to."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What the boxes of all steps look like, camera by camera; None where nothing is told."""

    looks: Many[Float[ndarray, "B A"]] | None = None
    """A unit vector for each box, 0 where it has none."""
    likenesses: Many[Float[ndarray, "B G"]] | None = None
    """Probability of each of G people with templates for each box, 1/G each where it is unknown."""

    @staticmethod
    def of(views: Many[tuple[ViewResult, ...]]) -> Seen:
        """By stage 1 of each step."""
        return Seen(_looks(views), _likenesses(views))


def _looks(views: Many[tuple[ViewResult, ...]]) -> list[Float[ndarray, "B A"]] | None:
    sizes = {view.looks.shape[1] for step in views for view in step if view.looks.shape[1]}
    if len(sizes) != 1:
        return None
    size = sizes.pop()
    return [
        np.concatenate(
            [
                step[c].looks if step[c].looks.shape[1] else np.zeros((len(step[c].boxes), size))
                for step in views
            ]
        )
        for c in range(len(views[0]))
    ]


def _likenesses(views: Many[tuple[ViewResult, ...]]) -> list[Float[ndarray, "B G"]] | None:
    people = max((view.likenesses.shape[1] for step in views for view in step), default=0)
    if people < 2:  # of one alone colours say nothing
        return None
    return [
        np.concatenate([step[c].likenesses_of(people) for step in views])
        for c in range(len(views[0]))
    ]


def told_of_people(
    pieces: Paths, links: Links, smoother: Smoother, seen: Seen, weight: float
) -> Float[ndarray, "n G"]:
    """How much less likely the colours of each piece are those of each person with templates than
    those of the likeliest: log, at most 0; of one (n, 1) where nothing is told.

        u_g = α Δt/τ Σ_z a(z) log (ε + (1 − ε) G p_g(z)),   less the largest

    over the boxes z of the piece that no other box touches, with association probability a. The
    filter's re-identification weighs the same step by step, when two have just been one blob;
    here whole pieces are weighed. p_g tells which of the templates a box is nearest to and not
    how near: who has none looks like one of them, too, and nobody looks like this one here and
    that one there.

    Args:
        pieces: Of tracks.
        links: Whose box each is.
        smoother: The boxes and the time of a step, Δt.
        seen: p_g of each box.
        weight: α.
    """
    if seen.likenesses is None:
        return np.zeros((len(pieces.labels), 1))
    own = links.take(appearance.clean(links, smoother.cameras))
    owners = pieces.owners[own.rows]
    people = seen.likenesses[0].shape[1]
    told = np.zeros((len(pieces.labels), people))
    doubt = _AS_THE_FILTER.recognition_doubt
    fresh = weight * min(smoother.model.step_time / _AS_THE_FILTER.recognition_interval, 1.0)
    for c, likeness in enumerate(seen.likenesses):
        of_camera = own.cameras == c
        odds = np.log(doubt + (1.0 - doubt) * people * likeness[own.boxes[of_camera]])
        share = fresh * own.shares[of_camera]
        np.add.at(told, owners[of_camera], share[:, None] * odds)
    return np.asarray(told - told.max(axis=1, keepdims=True))


def of_chains(told: Float[ndarray, "n G"], chains: Many[Many[int]]) -> Float[ndarray, "m G"]:
    """The same of chains of pieces."""
    whole = np.array([told[list(chain)].sum(axis=0) for chain in chains]).reshape(-1, told.shape[1])
    return np.asarray(whole - whole.max(axis=1, keepdims=True))
