"""The interface of every fusion method: the boxes of all cameras in, a 3D intensity out."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.place_constraints import PlaceConstraints
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True, eq=False)
class Associations:
    """Association probabilities of one step: pairs of component and box, camera after camera."""

    cameras: Int[ndarray, " A"]
    components: Int[ndarray, " A"]
    """Index into the posterior; of several components with one label its heaviest."""
    boxes: Int[ndarray, " A"]
    """Index into ``ViewResult.boxes``."""
    probabilities: Float[ndarray, " A"]
    """That this target made the box; float32, pairs below one per cent are left out."""

    @staticmethod
    def none() -> Associations:
        """No pair."""
        nothing = np.zeros(0, dtype=np.int32)
        return Associations(nothing, nothing, nothing, np.zeros(0, dtype=np.float32))


@dataclass(frozen=True, slots=True, eq=False)
class FusionResult:
    """The posterior of one step, and what made it. C cameras, J components."""

    posterior: GaussianMixture
    """State: x, y, z in metres, world frame; then, for constant velocity, metres per second.
    Weights are expected targets (PHD) or existence probabilities (multi-Bernoulli)."""
    detection_probabilities: Float[ndarray, "C J"]
    """p_D that each camera was given for each component; 0 outside its picture."""
    sources: Int[ndarray, "C J"]
    """Index into ``ViewResult.boxes`` of the box associated with each component, -1 for none."""
    source_weights: Float[ndarray, "C J"]
    """The share of the component that its box made: an association probability, 0 … 1."""
    hidden_by: Int[ndarray, "C J"]
    """Label of the target that occludes the component in each camera, -1 for none."""
    associations: Associations = field(default_factory=Associations.none)
    """All association probabilities, of which ``sources`` names the greatest."""


class FusionMethod(Protocol):
    """One method, prepared for one sequence; its steps are pure: state in, state out."""

    def start(self) -> Any:
        """The state before the first step."""
        ...

    def step(
        self, state: Any, views: Many[ViewResult], told: PlaceConstraints | None = None
    ) -> tuple[Any, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order.

        Args:
            state: Of the step before.
            views: Stage 1, one result a camera.
            told: What a person said of this step. It is given only where anything was said and
                to methods that take it: to others corrections of places say nothing.
        """
        ...
