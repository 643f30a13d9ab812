"""Births from unexplained boxes of two or more cameras that agree on a place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.target_model import TargetModel
from tracker.geometry.camera import Camera, stacked
from tracker.kernels import births
from tracker.kernels.births import Refinement
from tracker.kernels.kalman import Measurements
from tracker.sequences.sequence import Room

UNEXPLAINED = 0.5
"""Probability of having no target above which a box may begin a track: it is likelier than not."""

_REFINEMENTS = 3
"""Number of Gauss-Newton steps. With eight, places differ by 0.2 mm in the mean and by at most
4 mm, for people before four cameras whose boxes err by 3 pixels."""

_MOST_SEEDS = 1000
"""Largest number of seeds, those whose rays pass closest to each other. It bounds the time of a
step."""

_LEAST_VOLUME = 1e-250
"""Least volume of a room, cubic metres: it keeps the density finite in a room without height."""

_START_SIGMA = 1.0
"""Prior standard deviation of the refinement around the midpoint of two rays, metres. It is large
beside the error of a midpoint, and bounds the steps where two rays are nearly parallel."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """The B boxes of all cameras at one step, camera after camera, and what explains them."""

    centres: Float[ndarray, "B 2"]
    """Centre (x, y) of each box, pixels."""
    measurements: Measurements
    """The boxes as measurements of the target model, with their noise, pixels."""
    unexplained: Float[ndarray, " B"]
    """Probability that no target made the box."""
    starts: Int[ndarray, " C1"]
    """Index of the first box of each camera, and B at the end."""
    clutter_factors: Float[ndarray, " B"]
    """Factor on κ from each box's appearance: the larger, the likelier the box is false."""
    seeing: Bool[ndarray, " C"] | None = None
    """Which cameras have a frame at this step, and so may miss a target; None where all have."""


@dataclass(frozen=True, slots=True, eq=False)
class Newborns:
    """N newborn targets: position, existence, and the box of each of C cameras."""

    positions: Float[ndarray, "N 3"]
    """World metres."""
    covariances: Float[ndarray, "N 3 3"]
    """Covariance of each position, squared metres."""
    existences: Float[ndarray, " N"]
    """Existence probability, 0 … 1."""
    sources: Int[ndarray, "C N"]
    """Index of the box in each camera, -1 for none."""

    def take(self, indices: ndarray) -> Newborns:
        """Select some of the targets, in that order."""
        return Newborns(
            self.positions[indices],
            self.covariances[indices],
            self.existences[indices],
            self.sources[:, indices],
        )


@dataclass(frozen=True, slots=True, eq=False)
class BirthModel:
    """The model of births, of their detection, and of clutter."""

    birth_rate: float
    """λ_b, expected number of newborn targets per step."""
    detection_probability: float
    """p_D of a target in the picture."""
    clutter: Float[ndarray, " C"]
    """κ of each camera, per unit of the measurement space."""
    gate: float
    """Squared Mahalanobis distance within which a box belongs to a newborn target."""
    margin: float
    """Distance from the room's volume within which targets are born as well, metres."""
    largest_gap: float
    """Largest distance between the rays of two boxes of one target, metres."""


class MeasurementBirths:
    """Adaptive birth over several cameras.

    For boxes z_c of two or more cameras, with a birth intensity λ_b spread evenly
    over the room's volume V, the odds that one newborn target made them rather than
    clutter are

        Λ = λ_b/V ∫ Π_c (1 − p_c + p_c g(z_c | x) / κ_c) dx

    without the second term for a camera that has no box within the gate, and the existence
    probability of that target is Λ / (1 + Λ): the rule for new tracks of the Poisson
    multi-Bernoulli filter, applied to all cameras at once; p_c is 0 where the camera does not see
    x, and κ_c is multiplied by the box's clutter factor, where stage 1 gives one. The integral is
    approximated by Laplace's method, around the place that fits the boxes best. This follows the
    adaptive birth of Ristic, Clark, Vo and Vo (IEEE TAES 48(2), 2012), with the rule for new tracks
    of Williams (IEEE TAES 51(3), 2015).
    """

    def __init__(
        self, cameras: tuple[Camera, ...], room: Room, target: TargetModel, model: BirthModel
    ) -> None:
        """Prepare the births of one room.

        Args:
            cameras: The C cameras, in the order of the evidence.
            room: The volume over which births are uniform.
            target: The measurement model of a target's box.
            model: The rates of births, detection and clutter.
        """
        self._cameras = cameras
        self._room = room
        self._model = model
        p_d = model.detection_probability
        volume = max(float(np.prod(room.maximum - room.minimum)), _LEAST_VOLUME)
        self._log_density = np.log(model.birth_rate / volume)
        self._log_hit = float(np.log(p_d))
        # at p_D = 1 a miss has probability 0
        self._log_miss = float(np.log1p(-p_d)) if p_d < 1.0 else -np.inf
        self._log_clutter = np.log(model.clutter)
        self._centres = np.array([camera.centre for camera in cameras])
        self._calibrations = stacked(cameras)
        self._target = target.target(3)
        self._refinement = Refinement(_START_SIGMA, _REFINEMENTS, model.gate)

    def propose(self, evidence: Evidence) -> Newborns | None:
        """Propose newborn targets that share no box, by decreasing existence; None for none."""
        seeds, pairs = self._meeting_points(evidence)
        if not len(seeds):
            return None
        found = self._fit(seeds, pairs, evidence)
        used: set[tuple[int, int]] = set()
        chosen: list[int] = []
        for index in np.argsort(-found.existences, kind="stable").tolist():
            boxes = enumerate(found.sources[:, index].tolist())
            own = {(camera, box) for camera, box in boxes if box >= 0}
            if not own & used:
                used |= own
                chosen.append(index)
        return found.take(np.array(chosen)) if chosen else None

    def _meeting_points(
        self, evidence: Evidence
    ) -> tuple[Float[ndarray, "N 3"], Int[ndarray, "N 2"]]:
        """Find midpoints between nearby rays of unexplained boxes of two cameras.

        Returns:
            The points, world metres; the index of both boxes of each.
        """
        free = births.free_boxes(evidence.unexplained, evidence.starts, UNEXPLAINED)
        if free.cameras < 2:
            return np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64)
        centres = evidence.centres.take(free.indices, 0)
        rays = np.concatenate(
            [
                camera.back_project(centres[first:last])
                for camera, first, last in zip(
                    self._cameras, free.starts, free.starts[1:], strict=False
                )
            ]
        )
        met = births.meeting_points(rays, free.starts, self._centres, self._model.largest_gap)
        chosen = np.flatnonzero(self._room.contains(met.points, self._model.margin))
        if len(chosen) > _MOST_SEEDS:
            chosen = chosen[np.argsort(met.gaps[chosen], kind="stable")[:_MOST_SEEDS]]
        return met.points[chosen], free.indices[met.pairs[chosen]]

    def _fit(
        self, seeds: Float[ndarray, "N 3"], pairs: Int[ndarray, "N 2"], evidence: Evidence
    ) -> Newborns:
        """Fit each seed to the nearest box in every camera, and compute its existence probability.

        A seed that ends outside the room or with fewer than two boxes is left out.
        """
        fitted = births.fit_places(
            seeds,
            pairs,
            evidence.measurements,
            evidence.unexplained > UNEXPLAINED,
            evidence.starts,
            self._target,
            self._calibrations,
            self._refinement,
        )
        inside = self._room.contains(fitted.positions, self._model.margin)
        kept = np.flatnonzero(inside & ((fitted.sources >= 0).sum(axis=0) >= 2))
        found = Newborns(
            fitted.positions[kept],
            fitted.covariances[kept],
            np.zeros(len(kept)),
            fitted.sources[:, kept],
        )
        from scipy.special import expit  # a server starts without it

        existences = expit(self._log_odds(found, fitted.fits[:, kept], evidence))
        return Newborns(found.positions, found.covariances, existences, found.sources)

    def _log_odds(
        self, found: Newborns, fits: Float[ndarray, "C N"], evidence: Evidence
    ) -> Float[ndarray, " N"]:
        """Compute log Λ of each newborn target from the log likelihoods ``fits`` of its boxes."""
        log_odds = self._log_density + 1.5 * np.log(2.0 * np.pi)
        log_odds = log_odds + 0.5 * np.linalg.slogdet(found.covariances)[1]
        for c, camera in enumerate(self._cameras):
            sees, hit = camera.sees(found.positions), np.flatnonzero(found.sources[c] >= 0)
            misses = evidence.seeing is None or evidence.seeing[c]
            factor = np.where(sees & misses, self._log_miss, 0.0)
            clutter = evidence.clutter_factors[evidence.starts[c] + found.sources[c][hit]]
            log_ratios = fits[c][hit] - self._log_clutter[c] - np.log(clutter)
            # a box says nothing of a place that its camera does not see
            log_hits = np.where(sees[hit], self._log_hit + log_ratios, -np.inf)
            factor[hit] = np.logaddexp(factor[hit], log_hits)
            log_odds += factor
        return np.asarray(log_odds)
