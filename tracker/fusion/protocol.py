"""The face of every fusion method: the boxes of all cameras in, a 3D intensity out."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import Any, Protocol

from jaxtyping import Float, Int
from numpy import ndarray

from tracker.gaussian_mixture import GaussianMixture
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True, eq=False)
class FusionResult:
    """The posterior of one step, and what made it. C cameras, J components."""

    posterior: GaussianMixture
    """State: x, y, z in metres, world frame; then, for constant velocity, metres per second.
    Weights are expected targets (PHD) or existence probabilities (multi-Bernoulli)."""
    detection_probabilities: Float[ndarray, "C J"]
    """p_D that each camera was given for each component; 0 outside its picture."""
    sources: Int[ndarray, "C J"]
    """Index into ``ViewResult.boxes`` of the box that fed each component, -1 for none."""
    source_weights: Float[ndarray, "C J"]
    """The share of the component that its box made: an association probability, 0 … 1."""
    hidden_by: Int[ndarray, "C J"]
    """Label of the target that hides the component in each camera, -1 for none."""


class FusionMethod(Protocol):
    """One method, prepared for one sequence; its steps are pure: state in, state out."""

    def start(self) -> Any:
        """The state before the first step."""
        ...

    def step(self, state: Any, views: Many[ViewResult]) -> tuple[Any, FusionResult]:
        """Predict one step ahead and update with every camera's boxes, in the cameras' order."""
        ...
