"""The interface of every single-view method: from an image or detections to weighted boxes.

A method also reports the candidates that it rejected, with the gates that rejected them.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np
from jaxtyping import Bool, Float, Float16, Float32, Int, Int8, Int16, UInt8
from numpy import ndarray

CANDIDATES, DROPPED = "candidates", "dropped for "
"""Names in a result's information: the number of candidates, and, followed by the name of a gate,
the number that it rejected."""

OUTSIDE = "a place outside the room"
"""The gate at boxes that are of nobody in the room by their size and place."""

GATES = (
    "colour", "foreground", "surroundings", "shape", "another at its place", "another's shoulders",
    "outline", OUTSIDE,
)  # fmt: skip
"""All gates that methods may have, by number."""


@dataclass(frozen=True, slots=True, eq=False)
class Dropped:
    """The D rejected candidates of one image."""

    boxes: Float32[ndarray, "D 4"]
    """``centre_x, centre_y, half_width, half_height`` in pixels."""
    gates: Int8[ndarray, " D"]
    """Index into :data:`GATES` of the gate that rejected each."""

    @staticmethod
    def none() -> Dropped:
        """No rejected candidate, as for a method without gates."""
        return Dropped(np.zeros((0, 4), np.float32), np.zeros(0, np.int8))

    @staticmethod
    def of(candidates: Float[ndarray, "M 4"], gates: Mapping[str, Bool[ndarray, " M"]]) -> Dropped:
        """Select the rejected ones of M candidates.

        Args:
            candidates: Boxes of the candidates, pixels.
            gates: Which of them each gate rejected; at most one gate for each.
        """
        numbers = np.full(len(candidates), -1, np.int8)
        for gate, rejected in gates.items():
            numbers[rejected] = GATES.index(gate)
        gone = numbers >= 0
        return Dropped(candidates[gone].astype(np.float32), numbers[gone])

    def information(self, passed: int) -> dict[str, float]:
        """The number of candidates and of those that each gate rejected, by name.

        Args:
            passed: Number of candidates that no gate rejected.
        """
        counts = np.bincount(self.gates, minlength=len(GATES))
        total = {CANDIDATES: float(passed + len(self.gates))}
        return total | {
            DROPPED + gate: float(count)
            for gate, count in zip(GATES, counts.tolist(), strict=True)
            if count
        }


TRUST, UNCERTAINTY = "trust in the foreground", "doubt in the background"
"""Names in a result's information: the trust in the foreground at people with templates, and the
uncertainty of the background, 0 … 1."""

SHAKE = "shake, pixels"
"""Name in a result's information: standard deviation of the shake that is compensated, pixels."""

EventKind = Literal["new", "vanished", "returned", "occluded", "merged", "split"]


@dataclass(frozen=True, slots=True)
class ViewEvent:
    """An event of the tracks in one camera, as a method reports it."""

    kind: EventKind
    """The kind of the event."""
    labels: tuple[int, ...]
    """Ids of the tracks concerned, within this camera."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewResult:
    """The result of stage 1 in one camera at one step: boxes for the fusion, and data for display.

    All boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.
    """

    boxes: Float[ndarray, "N 4"]
    """The boxes for the fusion: Y_k^i of [ZW21]."""
    weights: Float[ndarray, " N"]
    """Weight, existence probability or detector's score of each box."""
    labels: Int[ndarray, " N"]
    """Ids within this camera, -1 where the method has none."""
    sigmas: Float[ndarray, "N 4"]
    """Measurement noise: standard deviations of the four numbers of each box, pixels."""
    estimates: Float[ndarray, "E 4"]
    """The method's own 2D estimates, which need not be the boxes for the fusion."""
    estimate_weights: Float[ndarray, " E"]
    """Weight or existence probability of each estimate."""
    estimate_labels: Int[ndarray, " E"]
    """Id of each estimate within this camera, -1 for none."""
    measurements: Float[ndarray, "M 4"]
    """The measurements of the method's filter: peaks, foreground boxes or detections."""
    measurement_scores: Float[ndarray, " M"]
    """Likelihood, or detector's score, of each measurement, 0 … 1."""
    information: dict[str, float]
    """Numbers about this step for display, by name."""
    samples: Int16[ndarray, "S 3"] = field(default_factory=lambda: np.zeros((0, 3), np.int16))
    """Samples of the weighted intensity for display, packed by :func:`pack_samples`; empty where
    the method has none."""
    dropped: Dropped = field(default_factory=Dropped.none)
    """Candidates that the method rejected, by gate."""
    events: tuple[ViewEvent, ...] = ()
    """Events of the tracks at this step, where the method reports any."""
    gates: Float[ndarray, "G 5"] = field(default_factory=lambda: np.zeros((0, 5)))
    """Ellipses of the gates of the method's targets: centre x and y in pixels, and
    xx, xy, yy of the matrix C with (z − c)ᵀ C⁻¹ (z − c) = 1 on the border, pixels squared."""
    foreground: UInt8[ndarray, " bytes"] | None = None
    """The foreground mask, packed by ``tracker.single_view.pictures.background.pack``; None where
    the method has none or there was no image."""
    likenesses: Float[ndarray, "N P"] = field(default_factory=lambda: np.zeros((0, 0)))
    """Probability that the colours of each box are those of each of P people with templates, given
    that it shows one of them; (0, 0) where there was no image, or fewer than two have templates.
    It is filled in after the method by :mod:`tracker.single_view.colour.templates`."""
    embeddings: Float16[ndarray, "N A"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float16)
    )
    """Embedding of each box's appearance, a unit vector: the root of its colour histogram where the
    method has images, or a detection network's where the detections have such vectors; (0, 0)
    where there is none."""
    log_ratios: Float[ndarray, " N"] = field(default_factory=lambda: np.zeros(0))
    """Log likelihood ratio of each box's appearance, for a person against clutter, without its
    place: log p(s | person) / p(s | clutter) of a score s, as a target's amplitude
    in Lerro and Bar-Shalom, IEEE TAES 29(2), 1993. Empty where the method has none."""
    blind: bool = False
    """Whether the camera had no frame at this step, and so gives no evidence."""

    def likenesses_of(self, people: int) -> Float[ndarray, "N P"]:
        """:attr:`likenesses` for a number of people; equal probabilities where there are none."""
        if self.likenesses.shape[1] == people:
            return self.likenesses
        return np.full((len(self.boxes), people), 1.0 / people)

    @property
    def clutter_factors(self) -> Float[ndarray, " N"]:
        """Factor on the clutter intensity at each box, from its appearance: 1 / Λ."""
        return np.exp(-self.log_ratios) if len(self.log_ratios) else np.ones(len(self.boxes))

    @staticmethod
    def of_boxes(
        boxes: Float[ndarray, "N 4"],
        weights: Float[ndarray, " N"],
        sigmas: Float[ndarray, "N 4"],
    ) -> ViewResult:
        """Make a result whose boxes are measurements and estimates as well, without labels.

        Args:
            boxes: Centre and half sizes of N boxes, pixels.
            weights: Weight or score of each box.
            sigmas: Standard deviations of the four numbers of each box, pixels.
        """
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
            information={},
        )

    @staticmethod
    def of_no_frame() -> ViewResult:
        """The result of a step at which the camera had no frame."""
        return replace(
            ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4))), blind=True
        )

    @staticmethod
    def of_estimates(
        boxes: Float[ndarray, "E 4"], weights: Float[ndarray, " E"], labels: Int[ndarray, " E"]
    ) -> ViewResult:
        """Make a result without boxes for the fusion, as at a step without an image.

        Args:
            boxes: Centre and half sizes of E estimates, pixels.
            weights: Weight or existence probability of each estimate.
            labels: Id of each estimate within this camera, -1 for none.
        """
        none = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
        return replace(none, estimates=boxes, estimate_weights=weights, estimate_labels=labels)


_FRACTION = 4.0
"""Parts of a pixel in which the centre of a packed sample is counted."""

_HEAVIEST = 1000.0
"""The packed weight of the heaviest sample."""


def pack_samples(
    boxes: Float[ndarray, "S D"], weights: Float[ndarray, " S"]
) -> Int16[ndarray, "S 3"]:
    """Pack samples for display: 6 bytes each, where a step has hundreds.

    Args:
        boxes: Centres of S samples, pixels, before any other columns.
        weights: Their weights, not negative.

    Returns:
        Centres in quarters of a pixel, within ±8,191 pixels, and weights in thousandths of the
        largest.
    """
    largest = weights.max(initial=0.0)
    shares = weights / largest if largest > 0.0 else np.zeros(len(weights))
    columns = np.column_stack([boxes[:, :2] * _FRACTION, shares * _HEAVIEST])
    limits = np.iinfo(np.int16)
    packed: ndarray = np.clip(np.rint(columns), limits.min, limits.max).astype(np.int16)
    return packed


def unpack_samples(
    samples: Int16[ndarray, "S 3"],
) -> tuple[Float[ndarray, "S 2"], Float[ndarray, " S"]]:
    """Unpack what :func:`pack_samples` packed.

    Returns:
        Centres, pixels, and weights as shares of the largest.
    """
    return samples[:, :2] / _FRACTION, samples[:, 2] / _HEAVIEST


class SingleViewMethod(Protocol):
    """A single-view method, prepared for one camera of one sequence.

    A method is created once per camera and run, which reads templates and learns the
    background; a step is a pure function of its arguments.
    """

    def start(self) -> Any:
        """The state before the first step."""
        ...

    def step(
        self, state: Any, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[Any, ViewResult]:
        """Process one step.

        Args:
            state: The state that the step before returned.
            frame: Index of the step, from 0.
            picture: (height, width, 3) uint8, BGR; None where the method needs no image or
                the frame is missing.
            rng: The only source of randomness, made from seed, camera and step.
        """
        ...
