"""The interface of every fusion method: from the boxes of all cameras to a 3D posterior.

Place constraints are from a user's corrections: a target is here, no target begins there.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.consistency import along
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.single_view.protocol import ViewResult
from tracker.steps import ROWS_SECOND


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


@dataclass(frozen=True, slots=True, eq=False)
class Associations:
    """Association probabilities of one step: A pairs of component and box, camera after camera."""

    cameras: Int[ndarray, " A"]
    """Index of the camera."""
    components: Int[ndarray, " A"]
    """Index into the posterior; the heaviest of several components with one label."""
    boxes: Int[ndarray, " A"]
    """Index into ``ViewResult.boxes``."""
    probabilities: Float[ndarray, " A"]
    """Probability that this target made the box, float32; pairs below 0.01 are left out."""

    @staticmethod
    def none() -> Associations:
        """The associations without any pair."""
        nothing = np.zeros(0, dtype=np.int32)
        return Associations(nothing, nothing, nothing, np.zeros(0, dtype=np.float32))


@dataclass(frozen=True, slots=True, eq=False)
class FusionResult:
    """The posterior of one step, J components, and the evidence of C cameras for it."""

    posterior: GaussianMixture
    """State: x, y, z in metres, world frame; then, for constant velocity, metres per second.
    Weights are expected targets (PHD) or existence probabilities (multi-Bernoulli)."""
    detection_probabilities: Float[ndarray, "C J"] = field(metadata=ROWS_SECOND)
    """p_D of each component in each camera; 0 outside its image."""
    sources: Int[ndarray, "C J"] = field(metadata=ROWS_SECOND)
    """Index into ``ViewResult.boxes`` of the box associated with each component, -1 for none."""
    source_weights: Float[ndarray, "C J"] = field(metadata=ROWS_SECOND)
    """Association probability of the component and that box, 0 … 1."""
    hidden_by: Int[ndarray, "C J"] = field(metadata=ROWS_SECOND)
    """Label of the target that occludes the component in each camera, -1 for none."""
    associations: Associations = field(default_factory=Associations.none)
    """All association probabilities; ``sources`` holds the box of the greatest."""


class FusionMethod(Protocol):
    """A fusion method, prepared for one sequence; a step is a pure function of its arguments."""

    def start(self) -> Any:
        """The state before the first step."""
        ...

    def step(
        self, state: Any, views: Many[ViewResult], constraints: PlaceConstraints | None = None
    ) -> tuple[Any, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order.

        Args:
            state: The state after the step before.
            views: The result of stage 1 for each camera.
            constraints: Place constraints from a user's corrections of this step, None where there
                are none. The argument is optional in a method: one that does not have it is
                called without, and corrections of places have no effect on it.
        """
        ...
