"""The interface of every single-view method: a picture or boxes in, weighted boxes out.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np
from jaxtyping import Float, Float16, Int, UInt8
from numpy import ndarray

from tracker.single_view.dropped import Dropped

TRUST, UNCERTAINTY = "trust in the foreground", "doubt in the background"
"""Names in a result's information: how far the foreground was believed about people with
templates, and how little the background, 0 … 1."""

SHAKE = "shake, pixels"
"""And the standard deviation of a shake of the camera that is undone."""

EventKind = Literal["new", "vanished", "returned", "occluded", "merged", "split"]


@dataclass(frozen=True, slots=True)
class ViewEvent:
    """Something that happened to people in one camera's picture, as the method tells it."""

    kind: EventKind
    labels: tuple[int, ...]
    """Whom it happened to, by their ids within this camera."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewResult:
    """What stage 1 found in one camera at one step: what the fusion gets, and why.

    All boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.
    """

    boxes: Float[ndarray, "N 4"]
    """What goes to the fusion: Y_k^i of [ZW21]."""
    weights: Float[ndarray, " N"]
    """Weight, existence probability or detector's score of each box."""
    labels: Int[ndarray, " N"]
    """Ids within this camera, -1 where the method has none."""
    sigmas: Float[ndarray, "N 4"]
    """Measurement noise: standard deviations of the same four numbers, pixels."""
    estimates: Float[ndarray, "E 4"]
    """The method's own 2D estimates, which it may or may not pass on."""
    estimate_weights: Float[ndarray, " E"]
    estimate_labels: Int[ndarray, " E"]
    measurements: Float[ndarray, "M 4"]
    """What the method's filter was given: peaks, foreground boxes or detections."""
    measurement_scores: Float[ndarray, " M"]
    """Likelihood or detector's score, 0 … 1."""
    samples: Float[ndarray, "S 4"]
    """Samples of the weighted intensity, float32; empty where the method has none."""
    sample_weights: Float[ndarray, " S"]
    """Their weights relative to the largest, float32."""
    information: dict[str, float]
    """Numbers worth showing of this step, by name."""
    dropped: Dropped = field(default_factory=Dropped.none)
    """What was looked at and not believed."""
    events: tuple[ViewEvent, ...] = ()
    """What happened at this step, where the method tells such things."""
    gates: Float[ndarray, "G 5"] = field(default_factory=lambda: np.zeros((0, 5)))
    """Ellipses around where the method expects its targets: centre x and y in pixels, and
    xx, xy, yy of the matrix C with (z − c)ᵀ C⁻¹ (z − c) = 1 on the border, pixels squared."""
    foreground: UInt8[ndarray, " bytes"] | None = None
    """What of the picture the method took for foreground, as
    ``tracker.single_view.pictures.foreground.pack`` makes it; None where it asked for none or there
    was no picture."""
    likenesses: Float[ndarray, "N P"] = field(default_factory=lambda: np.zeros((0, 0)))
    """Probability that the colours of each box are those of each of P people with templates,
    if they are one's; (0, 0) where there was no picture, or fewer than two have templates. A
    method leaves it: :mod:`tracker.single_view.colour.likeness` tells it of all."""
    looks: Float16[ndarray, "N A"] = field(default_factory=lambda: np.zeros((0, 0), np.float16))
    """What each box looks like, as a unit vector: the root of its colour histogram where the
    method is given pictures, an outside network's where its detections have such vectors; (0, 0)
    where there is nothing to see of it."""
    log_ratios: Float[ndarray, " N"] = field(default_factory=lambda: np.zeros(0))
    """Logarithm of how much likelier somebody's box is to look as this one does than a false box,
    beside where it lies: log p(s | person) / p(s | clutter) of a score s, as a target's amplitude
    in Lerro and Bar-Shalom, IEEE TAES 29(2), 1993. Empty where the method does not tell."""
    blind: bool = False
    """Whether the camera had no frame at this step, and so says nothing of who is there."""

    def likenesses_of(self, people: int) -> Float[ndarray, "N P"]:
        """:attr:`likenesses` to so many people; the same to all where nothing is told of them."""
        if self.likenesses.shape[1] == people:
            return self.likenesses
        return np.full((len(self.boxes), people), 1.0 / people)

    @property
    def clutter_factors(self) -> Float[ndarray, " N"]:
        """By how much the intensity of false boxes is lower or higher at each box than at any."""
        return np.exp(-self.log_ratios) if len(self.log_ratios) else np.ones(len(self.boxes))

    @staticmethod
    def of_boxes(
        boxes: Float[ndarray, "N 4"],
        weights: Float[ndarray, " N"],
        sigmas: Float[ndarray, "N 4"],
    ) -> ViewResult:
        """Boxes that are measurement, estimate and result at once, without labels."""
        labels = np.full(len(boxes), -1, dtype=np.int64)
        return ViewResult(
            boxes=boxes,
            weights=weights,
            labels=labels,
            sigmas=sigmas,
            estimates=boxes,
            estimate_weights=weights,
            estimate_labels=labels,
            measurements=boxes,
            measurement_scores=weights,
            samples=np.zeros((0, 4), dtype=np.float32),
            sample_weights=np.zeros(0, dtype=np.float32),
            information={},
        )

    @staticmethod
    def of_no_frame() -> ViewResult:
        """The camera had no frame at this step."""
        nothing = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
        return replace(nothing, blind=True)


class SingleViewMethod(Protocol):
    """One method, prepared for one camera of one sequence.

    A method is made once per camera and run (that is where templates are read and
    the background is learnt); its steps are pure: state in, state out.
    """

    def start(self) -> Any:
        """The state before the first step."""
        ...

    def step(
        self, state: Any, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[Any, ViewResult]:
        """One step.

        Args:
            state: What the step before returned.
            frame: The step, 0-based.
            picture: (height, width, 3) uint8, BGR; None where the method needs none or
                the frame is missing.
            rng: The only source of randomness, made from seed, camera and step.
        """
        ...
