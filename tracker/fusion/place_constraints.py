"""What a person said of a step: somebody is here, nobody is there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.contradictions import along


@dataclass(frozen=True, slots=True, eq=False)
class PlaceConstraints:
    """Corrections of one step."""

    places: Float[ndarray, "K 3"]
    """Where somebody is, world metres."""
    sigmas: Float[ndarray, " K"]
    """Standard deviations of the places, metres."""
    meant: Float[ndarray, "K 3"]
    """Where who is there was found, world metres; NaN where nobody is meant in particular."""
    empty: Float[ndarray, "E 2"]
    """Where nobody begins, on the ground, world metres."""
    around: Float[ndarray, " E"]
    """How far around, metres."""


def constraints_by_step(corrections: Iterable[Correction]) -> dict[int, PlaceConstraints]:
    """What is said of each step, where anything is."""
    here: dict[int, list[tuple[ndarray, float, ndarray]]] = {}
    empty: dict[int, list[tuple[tuple[float, float], float]]] = {}
    for one in corrections:
        if one.kind == "here":
            place, *meant = one.places
            whom = meant[0].point if meant else np.full(3, np.nan)
            here.setdefault(place.step, []).append((place.point, one.accuracy or 0.0, whom))
        elif one.kind == "nobody":
            first, last = one.steps
            for step in range(first, last + 1):
                if (where := along(one.places, step)) is not None:
                    empty.setdefault(step, []).append((where, one.accuracy or 0.0))
    return {
        step: PlaceConstraints(
            np.array([place for place, _, _ in here.get(step, [])]).reshape(-1, 3),
            np.array([sigma for _, sigma, _ in here.get(step, [])]),
            np.array([whom for _, _, whom in here.get(step, [])]).reshape(-1, 3),
            np.array([where for where, _ in empty.get(step, [])]).reshape(-1, 2),
            np.array([reach for _, reach in empty.get(step, [])]),
        )
        for step in sorted(here.keys() | empty.keys())
    }
