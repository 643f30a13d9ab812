"""Re-identification: people with templates keep their labels, however long they were away."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.optimize import linear_sum_assignment

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.model import CONFIRMED
from tracker.fusion.protocol import Associations
from tracker.single_view.protocol import ViewResult

_DOUBT = 0.1
"""Probability that a box's colours tell nothing of who it is."""

_FRESH = 1.0
"""Seconds after which a look counts as a new one: pictures of one moment agree, right or wrong."""

_SWAP = 30.0
"""Seconds in which a track may come to be of somebody else: no evidence lasts for ever."""

_SURE = float(np.log(20.0))
"""Log odds of the best naming against any without the pair, from which the pair holds."""

_OWN = float(np.log(3.0))
"""Log odds of a track's own looks, from which it may be named: nobody is by exclusion alone."""

_NEVER = -1e3


@dataclass(frozen=True, slots=True, eq=False)
class Identities:
    """What the colours said of the tracks so far. G people have templates.

    A track's looks are a categorical distribution over these people, which follows

        π ← (1 − Δt/T) π + Δt/T · 1/G,   log π_g ← log π_g + Δt/τ Σ_c a_c log p_g(z_c)

    for each box z_c with association probability a_c: the exponent Δt/τ makes of the
    many alike pictures of a second one independent look. The first track that is
    surely of a person owns the name, and whoever is surely of the same person later
    gets that track's label: people are one each.
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
) -> tuple[dict[int, int], Identities]:
    """Look at this step's boxes, and say which labels change.

    Args:
        identities: Of the step before.
        posterior: Tracks, one component a label.
        associations: Which box is whose.
        views: The boxes with their likenesses; of less than two people nothing is told.
        waiting: Labels of people lost from sight, whose looks are kept.
        step_time: Δt, seconds.

    Returns:
        New label by old one, each at most once on either side; and the identities after it.
    """
    people = max((view.likenesses.shape[1] for view in views), default=0)
    if people < 2:
        return {}, identities
    labels, looks = _looked(identities, posterior, associations, views, people, waiting, step_time)
    owners = identities.owners if len(identities.owners) else np.full(people, -1, dtype=np.int64)
    sure = posterior.labels.compress(posterior.weights > CONFIRMED)
    told = looks.take(np.searchsorted(labels, sure), 0)
    if _is_settled(told, sure, owners):
        return {}, Identities(labels, looks, owners)
    wanted: dict[int, int] = {}
    owners = owners.copy()
    for track, person in _named(told):
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


def _looked(
    identities: Identities,
    posterior: GaussianMixture,
    associations: Associations,
    views: Many[ViewResult],
    people: int,
    waiting: Int[ndarray, " L"],
    step_time: float,
) -> tuple[Int[ndarray, " K"], Float[ndarray, "K G"]]:
    """The labels that are there or waited for, ascending, and log π of each after this step."""
    labels = np.unique(np.concatenate([posterior.labels, waiting]))
    before = np.zeros((len(labels), people))
    if len(identities.labels):
        place = identities.labels.searchsorted(labels).clip(max=len(identities.labels) - 1)
        known = identities.labels.take(place) == labels
        before[known] = identities.looks.take(place.compress(known), 0)
    leak = min(step_time / _SWAP, 1.0)
    beliefs = np.exp(before)
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
        told = np.log((1.0 - _DOUBT) * likeness + _DOUBT / people)
        share = associations.probabilities.take(rows).astype(float) * min(step_time / _FRESH, 1.0)
        whose = labels.searchsorted(posterior.labels.take(associations.components.take(rows)))
        np.add.at(looks, whose, share[:, None] * told)
    return labels, looks


def _is_settled(
    looks: Float[ndarray, "n G"], labels: Int[ndarray, " n"], owners: Int[ndarray, " G"]
) -> bool:
    """Whether whoever may be named has that name already: so it is at nearly every step."""
    ordered = np.sort(looks, axis=1)
    clear = ordered[:, -1] - ordered[:, -2] >= _OWN
    return bool((owners.take(looks.argmax(axis=1)) == labels).compress(clear).all())


def _named(looks: Float[ndarray, "n G"]) -> list[tuple[int, int]]:
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
        if (
            person >= people
            or scores[track, person] - np.delete(scores[track], person).max() < _OWN
        ):
            continue
        without = table.copy()
        without[track, person] = 2.0 * _NEVER
        others = linear_sum_assignment(-without)
        if best - without[others].sum() > _SURE:
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
