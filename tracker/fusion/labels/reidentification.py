"""Re-identification: people with templates keep their labels, however long they were away."""

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
from tracker.parameters import FusionParams
from tracker.single_view.protocol import ViewResult

_NEVER = -1e3
"""Instead of the log probability of a pair that may not be: e to this is 0 beside any other."""

_DOUBT_AT_ONCE = 0.5
"""Probability that a box's colours tell nothing of whose it is at its step: where they mislead, as
in another light, they do so step after step."""

_DEFAULTS = FusionParams()


@dataclass(frozen=True, slots=True, eq=False)
class Identities:
    """What the colours said of the tracks so far. G people have templates.

    A track's looks are a categorical distribution over these people, which follows

        π ← (1 − Δt/T) π + Δt/T · 1/G,   log π_g ← log π_g + Δt/τ Σ_c a_c log p_g(z_c)

    for each box z_c with association probability a_c: consecutive pictures are alike, so the
    exponent Δt/τ lets those of τ seconds count as one independent observation. The first
    track that is surely of a person owns that identity, and a later track that is surely of
    the same person gets its label: each person has one label at a time.
    """

    labels: Int[ndarray, " K"]
    looks: Float[ndarray, "K G"]
    """log π of each label, up to a constant."""
    owners: Int[ndarray, " G"]
    """The label of each person, -1 as long as nobody is surely that person."""

    @staticmethod
    def none() -> Identities:
        """Nobody was looked at."""
        nothing = np.zeros(0, dtype=np.int64)
        return Identities(nothing, np.zeros((0, 0)), nothing)


def reidentify(
    identities: Identities,
    posterior: GaussianMixture,
    associations: Associations,
    views: Many[ViewResult],
    waiting: Int[ndarray, " L"],
    step_time: float,
    parameters: FusionParams = _DEFAULTS,
) -> tuple[dict[int, int], Identities]:
    """Look at this step's boxes, and say which labels change.

    Args:
        identities: Of the step before.
        posterior: Tracks, one component a label.
        associations: Which box is whose.
        views: The boxes with their likenesses; of less than two people nothing is told.
        waiting: Labels of people lost from sight, whose looks are kept.
        step_time: Δt, seconds.
        parameters: How much colours count, and from which odds a pair holds.

    Returns:
        New label by old one, each at most once on either side; and the identities after it.
    """
    people = max((view.likenesses.shape[1] for view in views), default=0)
    if people < 2:
        return {}, identities
    p, seen = parameters, (identities, posterior, associations, views, people, waiting, step_time)
    labels, looks = _looked(*seen, p)
    owners = identities.owners if len(identities.owners) else np.full(people, -1, dtype=np.int64)
    sure = posterior.labels.compress(posterior.weights > CONFIRMED)
    told = looks.take(np.searchsorted(labels, sure), 0)
    own_odds = float(np.log(p.recognition_own_odds))
    if _is_settled(told, sure, owners, own_odds):
        return {}, Identities(labels, looks, owners)
    wanted: dict[int, int] = {}
    owners = owners.copy()
    for track, person in _named(told, own_odds, float(np.log(p.recognition_odds))):
        label = int(sure[track])
        if owners[person] < 0 and label not in owners:
            owners[person] = label
        elif owners[person] >= 0:
            wanted[label] = int(owners[person])
    relabelled = _permuted(wanted, posterior.labels.tolist())
    own: dict[int, ndarray] = dict(zip(labels.tolist(), looks, strict=True))
    kept = {relabelled.get(label, label): look for label, look in own.items()}
    # who takes over the label of somebody lost brings his own looks along
    kept |= {relabelled[label]: own[label] for label in relabelled}
    order = sorted(kept)
    rows = np.array([kept[label] for label in order]).reshape(-1, people)
    return relabelled, Identities(np.array(order, dtype=np.int64), rows, owners)


def resemblance(
    identities: Identities, labels: Int[ndarray, " n"], views: Many[ViewResult]
) -> Float[ndarray, "k B"]:
    """By how much likelier the person of each track is to look as each box does than anybody:

        ε + (1 − ε) G Σ_g π_g p_g(z)

    with ε = 0.5, so that the boxes of two people whose rays meet somewhere are not taken for one
    person's there; 1 where nothing is told, and without rows where of no track anything is known.

    Args:
        identities: Of the step before.
        labels: Of the tracks.
        views: The boxes of all cameras, one after another.
    """
    count = sum(len(view.boxes) for view in views)
    people = identities.looks.shape[1]
    if not people or not len(identities.labels) or not count:
        return np.ones((0, count))
    looks = _known(identities, labels, people)
    told = np.exp(looks - looks.max(axis=1, keepdims=True))
    told /= told.sum(axis=1, keepdims=True)
    likenesses = np.concatenate([view.likenesses_of(people) for view in views])
    return np.asarray(_DOUBT_AT_ONCE + (1.0 - _DOUBT_AT_ONCE) * people * (told @ likenesses.T))


def _known(
    identities: Identities, labels: Int[ndarray, " n"], people: int
) -> Float[ndarray, "n G"]:
    """log π of some labels, up to a constant each; 0 where nothing is known of one."""
    found = np.zeros((len(labels), people))
    if len(identities.labels):
        place = identities.labels.searchsorted(labels).clip(max=len(identities.labels) - 1)
        known = identities.labels.take(place) == labels
        found[known] = identities.looks.take(place.compress(known), 0)
    return found


def _looked(
    identities: Identities,
    posterior: GaussianMixture,
    associations: Associations,
    views: Many[ViewResult],
    people: int,
    waiting: Int[ndarray, " L"],
    step_time: float,
    p: FusionParams,
) -> tuple[Int[ndarray, " K"], Float[ndarray, "K G"]]:
    """The labels that are there or waited for, ascending, and log π of each after this step."""
    labels = np.unique(np.concatenate([posterior.labels, waiting]))
    leak = min(step_time / p.recognition_swap, 1.0)
    beliefs = np.exp(_known(identities, labels, people))
    looks = np.log((1.0 - leak) * beliefs / beliefs.sum(axis=1, keepdims=True) + leak / people)
    # a camera without a picture tells nothing
    tellers = np.array([view.likenesses.shape[1] == people for view in views])
    rows = tellers.take(associations.cameras).nonzero()[0]
    if len(rows):
        pairs = zip(
            associations.cameras.take(rows).tolist(),
            associations.boxes.take(rows).tolist(),
            strict=True,
        )
        likeness = np.array([views[camera].likenesses[box] for camera, box in pairs])
        doubt = p.recognition_doubt
        told = np.log((1.0 - doubt) * likeness + doubt / people)
        fresh = min(step_time / p.recognition_interval, 1.0)
        share = associations.probabilities.take(rows).astype(float) * fresh
        whose = labels.searchsorted(posterior.labels.take(associations.components.take(rows)))
        np.add.at(looks, whose, share[:, None] * told)
    return labels, looks


def _is_settled(
    looks: Float[ndarray, "n G"], labels: Int[ndarray, " n"], owners: Int[ndarray, " G"], own: float
) -> bool:
    """Whether whoever may be named has that name already: so it is at nearly every step."""
    ordered = np.sort(looks, axis=1)
    clear = ordered[:, -1] - ordered[:, -2] >= own
    return bool((owners.take(looks.argmax(axis=1)) == labels).compress(clear).all())


def _named(looks: Float[ndarray, "n G"], own: float, odds: float) -> list[tuple[int, int]]:
    """The pairs of track and person that hold: one to one, with sure odds against any other."""
    count = len(looks)
    if not count:
        return []
    people = looks.shape[1]
    scores = looks - looks.max(axis=1, keepdims=True)
    # beside the people stands a place for each track that is none of them
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


def _permuted(wanted: dict[int, int], present: list[int]) -> dict[int, int]:
    """Renamings in which no label is there twice: who loses his label takes one that is free."""
    relabelled = {old: new for old, new in wanted.items() if old != new}
    left = sorted(old for old in relabelled if old not in relabelled.values())
    for new in list(relabelled.values()):
        # somebody else wears it and asks for no other
        if new in present and new not in relabelled:
            relabelled[new] = new if new in wanted else left.pop()
    if len(set(relabelled.values())) < len(relabelled):
        return {}
    return {old: new for old, new in relabelled.items() if old != new}
