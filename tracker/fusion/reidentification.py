"""Re-identification by appearance: each person with a template has one label during the whole
run."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.model import CONFIRMED
from tracker.fusion.protocol import Associations
from tracker.geometry.assignment import linear_sum_assignment
from tracker.parameters.groups.fusion import FusionParams
from tracker.single_view.protocol import ViewResult

_NEVER = -1e3
"""Log score of an inadmissible pair; its exponential is 0 beside any other."""

_UNINFORMATIVE = 0.5
"""ε of :func:`appearance_ratios`: probability that the colours of a box are uninformative at its
step. It is large, since the effect of light on colours lasts for many steps in a row."""

_DEFAULTS = FusionParams()


@dataclass(frozen=True, slots=True, eq=False)
class IdentityBeliefs:
    """The belief of each track over the G people with templates, from the colours of its boxes.

    It is a categorical distribution π, which follows

        π ← (1 − Δt/T) π + Δt/T · 1/G,   log π_g ← log π_g + Δt/τ Σ_c a_c log p_g(z_c)

    for each box z_c with association probability a_c: consecutive images are alike, so the
    exponent Δt/τ makes those of τ seconds count as one independent observation. The first
    track whose odds for a person exceed a bound owns that identity, and a later track with such
    odds for the same person gets its label: each person has one label at a time.
    """

    labels: Int[ndarray, " K"]
    """The labels that have a belief, ascending."""
    log_beliefs: Float[ndarray, "K G"]
    """log π of each label, up to a constant."""
    owners: Int[ndarray, " G"]
    """The label of each person, -1 for none yet."""

    @staticmethod
    def none() -> IdentityBeliefs:
        """The beliefs before the first step: no labels and no people."""
        nothing = np.zeros(0, dtype=np.int64)
        return IdentityBeliefs(nothing, np.zeros((0, 0)), nothing)


def reidentify(
    identities: IdentityBeliefs,
    posterior: GaussianMixture,
    associations: Associations,
    views: Many[ViewResult],
    waiting: Int[ndarray, " L"],
    step_time: float,
    parameters: FusionParams = _DEFAULTS,
) -> tuple[dict[int, int], IdentityBeliefs]:
    """Update the beliefs by this step's boxes and decide which labels change.

    Args:
        identities: The beliefs after the step before.
        posterior: Tracks, one component a label.
        associations: Association probabilities of tracks and boxes at this step.
        views: The boxes of each camera with the likelihood of their colours for each person;
            with fewer than two people nothing changes.
        waiting: Labels of the lost tracks, whose beliefs are carried along.
        step_time: Δt, seconds.
        parameters: The time constants and odds of the recognition.

    Returns:
        New label by old one, each at most once on either side; and the beliefs afterwards.
    """
    people = max((view.likenesses.shape[1] for view in views), default=0)
    if people < 2:
        return {}, identities
    p, seen = parameters, (identities, posterior, associations, views, people, waiting, step_time)
    labels, beliefs = _update_beliefs(*seen, p)
    owners = identities.owners if len(identities.owners) else np.full(people, -1, dtype=np.int64)
    sure = posterior.labels.compress(posterior.weights > CONFIRMED)
    confirmed = beliefs.take(np.searchsorted(labels, sure), 0)
    own_odds = float(np.log(p.recognition_own_odds))
    if _agrees(confirmed, sure, owners, own_odds):
        return {}, IdentityBeliefs(labels, beliefs, owners)
    wanted: dict[int, int] = {}
    owners = owners.copy()
    for track, person in _recognise(confirmed, own_odds, float(np.log(p.recognition_odds))):
        label = int(sure[track])
        if owners[person] < 0 and label not in owners:
            owners[person] = label
        elif owners[person] >= 0:
            wanted[label] = int(owners[person])
    relabelled = _as_permutation(wanted, posterior.labels.tolist())
    own: dict[int, ndarray] = dict(zip(labels.tolist(), beliefs, strict=True))
    after = {relabelled.get(label, label): belief for label, belief in own.items()}
    # a track that takes over the label of a lost one keeps its own belief
    after |= {relabelled[label]: own[label] for label in relabelled}
    order = sorted(after)
    rows = np.array([after[label] for label in order]).reshape(-1, people)
    return relabelled, IdentityBeliefs(np.array(order, dtype=np.int64), rows, owners)


def appearance_ratios(
    identities: IdentityBeliefs, labels: Int[ndarray, " n"], views: Many[ViewResult]
) -> Float[ndarray, "k B"]:
    """Compute the likelihood ratio of each box's appearance, of a track's person against any
    person.

        ε + (1 − ε) G Σ_g π_g p_g(z),   ε = 0.5

    By it, boxes of two people whose rays nearly intersect are not associated with one track at the
    intersection.

    Args:
        identities: The beliefs after the step before.
        labels: Labels of the n tracks.
        views: The results of all cameras, with B boxes altogether.

    Returns:
        One row a track and one column a box, 1 where the appearance is not known; no rows
        (k = 0) where no track has a belief, else k = n.
    """
    if not len(identities.labels):
        return np.ones((0, sum(len(view.boxes) for view in views)))
    people = identities.log_beliefs.shape[1]
    log_beliefs = _known(identities, labels, people)
    beliefs = np.exp(log_beliefs - log_beliefs.max(axis=1, keepdims=True))
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    likenesses = np.concatenate([view.likenesses_of(people) for view in views])
    return np.asarray(_UNINFORMATIVE + (1.0 - _UNINFORMATIVE) * people * (beliefs @ likenesses.T))


def _known(
    identities: IdentityBeliefs, labels: Int[ndarray, " n"], people: int
) -> Float[ndarray, "n G"]:
    """Look up log π of n labels, up to a constant each; 0 for a label without a belief."""
    found = np.zeros((len(labels), people))
    if len(identities.labels):
        place = identities.labels.searchsorted(labels).clip(max=len(identities.labels) - 1)
        known = identities.labels.take(place) == labels
        found[known] = identities.log_beliefs.take(place.compress(known), 0)
    return found


def _update_beliefs(
    identities: IdentityBeliefs,
    posterior: GaussianMixture,
    associations: Associations,
    views: Many[ViewResult],
    people: int,
    waiting: Int[ndarray, " L"],
    step_time: float,
    p: FusionParams,
) -> tuple[Int[ndarray, " K"], Float[ndarray, "K G"]]:
    """The present and the lost labels, ascending, and log π of each after this step."""
    labels = np.unique(np.concatenate([posterior.labels, waiting]))
    leak = min(step_time / p.recognition_swap, 1.0)
    beliefs = np.exp(_known(identities, labels, people))
    updated = np.log((1.0 - leak) * beliefs / beliefs.sum(axis=1, keepdims=True) + leak / people)
    # a camera without an image is left out
    informative = np.array([view.likenesses.shape[1] == people for view in views])
    rows = informative.take(associations.cameras).nonzero()[0]
    if len(rows):
        pairs = zip(
            associations.cameras.take(rows).tolist(),
            associations.boxes.take(rows).tolist(),
            strict=True,
        )
        likeness = np.array([views[camera].likenesses[box] for camera, box in pairs])
        outliers = p.recognition_outlier_probability
        log_likelihood = np.log((1.0 - outliers) * likeness + outliers / people)
        fresh = min(step_time / p.recognition_interval, 1.0)
        share = associations.probabilities.take(rows).astype(float) * fresh
        tracks = labels.searchsorted(posterior.labels.take(associations.components.take(rows)))
        np.add.at(updated, tracks, share[:, None] * log_likelihood)
    return labels, updated


def _agrees(
    beliefs: Float[ndarray, "n G"],
    labels: Int[ndarray, " n"],
    owners: Int[ndarray, " G"],
    own: float,
) -> bool:
    """Whether every track with clear odds has the label of its likeliest person already.

    This is the usual case, in which no assignment is needed.

    Args:
        beliefs: log π of n tracks.
        labels: Label of each track.
        owners: The label of each person, -1 for none.
        own: Log odds of the likeliest person against the second from which a track's odds are
            clear.
    """
    ordered = np.sort(beliefs, axis=1)
    clear = ordered[:, -1] - ordered[:, -2] >= own
    return bool((owners.take(beliefs.argmax(axis=1)) == labels).compress(clear).all())


def _recognise(beliefs: Float[ndarray, "n G"], own: float, odds: float) -> list[tuple[int, int]]:
    """Find the pairs of track and person, one to one, with clear odds against any alternative.

    Args:
        beliefs: log π of n tracks.
        own: Least log odds of a track's person against every other person.
        odds: Least log odds, for each pair, of the best assignment against the best one without
            that pair.
    """
    count = len(beliefs)
    if not count:
        return []
    people = beliefs.shape[1]
    scores = beliefs - beliefs.max(axis=1, keepdims=True)
    # further columns: a dummy for each track, which then is none of the people
    table = np.concatenate([scores, np.full((count, count), _NEVER)], axis=1)
    rows, columns = linear_sum_assignment(-table)
    best = table[rows, columns].sum()
    pairs = []
    for track, person in zip(rows.tolist(), columns.tolist(), strict=True):
        if person >= people or scores[track, person] - np.delete(scores[track], person).max() < own:
            continue
        without = table.copy()
        without[track, person] = 2.0 * _NEVER
        others = linear_sum_assignment(-without)
        if best - without[others].sum() > odds:
            pairs.append((track, person))
    return pairs


def _as_permutation(wanted: dict[int, int], present: list[int]) -> dict[int, int]:
    """Extend wanted renamings to a permutation: a track that loses its label gets a free one."""
    relabelled = {old: new for old, new in wanted.items() if old != new}
    left = sorted(old for old in relabelled if old not in relabelled.values())
    for new in list(relabelled.values()):
        # another track bears this label and is not renamed
        if new in present and new not in relabelled:
            relabelled[new] = new if new in wanted else left.pop()
    if len(set(relabelled.values())) < len(relabelled):
        return {}
    return {old: new for old, new in relabelled.items() if old != new}
