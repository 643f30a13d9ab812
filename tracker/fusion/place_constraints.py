"""Place constraints from a user's corrections: a target is here, no target begins there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.consistency import along


@dataclass(frozen=True, slots=True, eq=False)
class PlaceConstraints:
    """The place constraints of one step."""

    places: Float[ndarray, "K 3"]
    """Positions of targets that are present, world metres."""
    sigmas: Float[ndarray, " K"]
    """Standard deviation of each place along every axis, metres."""
    references: Float[ndarray, "K 3"]
    """Estimated position of the track that a place belongs to, world metres; NaN for any track."""
    empty: Float[ndarray, "E 2"]
    """Centres of the areas in which no track begins, on the ground, world metres."""
    around: Float[ndarray, " E"]
    """Radius of each of these areas, metres."""


def constraints_by_step(corrections: Iterable[Correction]) -> dict[int, PlaceConstraints]:
    """Collect the place constraints of each step, for the steps that have any."""
    present: dict[int, list[tuple[ndarray, float, ndarray]]] = {}
    empty: dict[int, list[tuple[tuple[float, float], float]]] = {}
    for one in corrections:
        if one.accuracy is None:  # it is not about a place
            continue
        if one.kind == "here":
            place, *meant = one.places
            reference = meant[0].point if meant else np.full(3, np.nan)
            present.setdefault(place.step, []).append((place.point, one.accuracy, reference))
        elif one.kind == "nobody":
            first, last = one.steps
            for step in range(first, last + 1):
                if (where := along(one.places, step)) is not None:
                    empty.setdefault(step, []).append((where, one.accuracy))
    return {
        step: PlaceConstraints(
            np.array([place for place, _, _ in present.get(step, [])]).reshape(-1, 3),
            np.array([sigma for _, sigma, _ in present.get(step, [])]),
            np.array([reference for _, _, reference in present.get(step, [])]).reshape(-1, 3),
            np.array([where for where, _ in empty.get(step, [])]).reshape(-1, 2),
            np.array([reach for _, reach in empty.get(step, [])]),
        )
        for step in sorted(present.keys() | empty.keys())
    }
