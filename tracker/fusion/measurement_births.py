"""Newcomers from what nobody explains: boxes of two or more cameras that agree on a place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.special import expit

from tracker.camera import Camera
from tracker.fusion.target_model import TargetModel
from tracker.sequences.sequence import Room

_REFINEMENTS = 3
_START_SIGMA = 1.0  # metres: how loosely the meeting point of two rays binds the refinement
_UNEXPLAINED = 0.5  # a box that somebody made with more than this probability starts nobody


@dataclass(frozen=True, slots=True, eq=False)
class CameraEvidence:
    """What one camera leaves unexplained at one step. M boxes."""

    centres: Float[ndarray, "M 2"]
    """Of the boxes, pixels."""
    values: Float[ndarray, "M m"]
    """Measurements of the target model, pixels."""
    noises: Float[ndarray, "M m m"]
    unexplained: Float[ndarray, " M"]
    """Probability that no target made the box."""
    clutter_intensity: float
    """κ, per unit of the measurement space."""


@dataclass(frozen=True, slots=True, eq=False)
class Newborns:
    """N newcomers: where, how sure, and which box of each of C cameras says so."""

    positions: Float[ndarray, "N 3"]
    covariances: Float[ndarray, "N 3 3"]
    existences: Float[ndarray, " N"]
    sources: Int[ndarray, "C N"]
    """Index of the box in each camera, -1 for none."""

    def take(self, indices: ndarray) -> Newborns:
        """Some of them, in that order."""
        return Newborns(
            self.positions[indices],
            self.covariances[indices],
            self.existences[indices],
            self.sources[:, indices],
        )


class MeasurementBirths:
    """Adaptive birth over several cameras.

    For boxes z_c of two or more cameras, with a birth intensity λ_b spread evenly
    over the room's volume V, the odds that one newcomer made them rather than
    clutter are

        Λ = λ_b/V ∫ Π_{c sees} p_c g(z_c | x) / κ_c  Π_{c misses} (1 − p_c) dx

    and the newcomer's existence is Λ / (1 + Λ): the rule for new tracks of the
    Poisson multi-Bernoulli filter, taken over all cameras at once; the integral
    is Laplace's, around the place that fits the boxes best. After the adaptive
    birth of Ristic, Clark, Vo and Vo (IEEE TAES 48(2), 2012).
    """

    def __init__(
        self,
        cameras: tuple[Camera, ...],
        room: Room,
        model: TargetModel,
        *,
        birth_rate: float,
        detection_probability: float,
        gate: float,
        margin: float,
        largest_gap: float,
    ) -> None:
        """Prepare for one room.

        Args:
            cameras: Their evidence will come in this order.
            room: Newcomers appear evenly in its volume.
            model: Of a target's box.
            birth_rate: λ_b, expected newcomers a step.
            detection_probability: p_D of a target in the picture.
            gate: Squared Mahalanobis distance of a box that belongs to a newcomer.
            margin: Metres outside the volume within which newcomers are taken, too.
            largest_gap: Metres by which the rays of two boxes of one target may miss each other.
        """
        self._cameras = cameras
        self._room = room
        self._model = model
        self._log_density = np.log(birth_rate / np.prod(room.maximum - room.minimum))
        self._log_hit = float(np.log(detection_probability))
        # at p_D = 1 no newcomer is ever missed
        self._log_miss = (
            float(np.log1p(-detection_probability)) if detection_probability < 1.0 else -np.inf
        )
        self._gate = gate
        self._margin = margin
        self._largest_gap = largest_gap

    def propose(self, evidence: list[CameraEvidence]) -> Newborns | None:
        """Newcomers that share no box, the surest first; None for nobody."""
        seeds = self._meeting_points(evidence)
        if not len(seeds):
            return None
        found = self._fit(seeds, evidence)
        taken: set[tuple[int, int]] = set()
        chosen: list[int] = []
        for index in np.argsort(-found.existences, kind="stable").tolist():
            boxes = enumerate(found.sources[:, index].tolist())
            own = {(camera, box) for camera, box in boxes if box >= 0}
            if not own & taken:
                taken |= own
                chosen.append(index)
        return found.take(np.array(chosen)) if chosen else None

    def _meeting_points(self, evidence: list[CameraEvidence]) -> Float[ndarray, "N 3"]:
        """Where the rays of unexplained boxes of two cameras pass close by each other."""
        free = [one.centres[one.unexplained > _UNEXPLAINED] for one in evidence]
        if sum(len(centres) > 0 for centres in free) < 2:
            return np.zeros((0, 3))
        rays = [
            camera.back_project(centres)
            for camera, centres in zip(self._cameras, free, strict=True)
        ]
        points = [np.zeros((0, 3))]
        for a in range(len(rays)):
            for b in range(a + 1, len(rays)):
                if not len(rays[a]) or not len(rays[b]):
                    continue
                u, v = rays[a][:, None, :], rays[b][None, :, :]
                base = self._cameras[b].centre - self._cameras[a].centre
                uv = (u * v).sum(-1)
                denominator = np.maximum(1.0 - uv**2, 1e-6)
                along_a = ((u @ base) - uv * (v @ base)) / denominator
                along_b = (uv * (u @ base) - (v @ base)) / denominator
                on_a = self._cameras[a].centre + along_a[..., None] * u
                on_b = self._cameras[b].centre + along_b[..., None] * v
                gap = np.linalg.norm(on_a - on_b, axis=-1)
                middle = (on_a + on_b) / 2.0
                good = (gap < self._largest_gap) & (along_a > 0.1) & (along_b > 0.1)
                points.append(middle[good])
        all_points = np.concatenate(points)
        return np.asarray(all_points[self._room.contains(all_points, self._margin)])

    def _fit(self, seeds: Float[ndarray, "N 3"], evidence: list[CameraEvidence]) -> Newborns:
        """The places that fit best to the nearest box in every camera, and their odds.

        A seed that ends outside the room or with fewer than two boxes is left out.
        """
        positions, covariances = seeds, np.tile(np.eye(3) * _START_SIGMA**2, (len(seeds), 1, 1))
        for _ in range(_REFINEMENTS):
            information = np.tile(np.eye(3) / _START_SIGMA**2, (len(seeds), 1, 1))
            pull = seeds / _START_SIGMA**2
            sources = np.full((len(evidence), len(seeds)), -1, dtype=np.int64)
            for c, camera in enumerate(self._cameras):
                if not len(evidence[c].values):
                    continue
                expected = self._model.expected(camera, positions)
                slopes = expected.jacobians
                residuals = evidence[c].values[None] - expected.values[:, None]
                own = self._nearest(residuals, slopes, covariances, evidence[c])
                sources[c] = own = np.where(expected.valid, own, -1)
                weights = slopes.transpose(0, 2, 1) @ np.linalg.inv(evidence[c].noises[own])
                weights[own < 0] = 0.0
                residual = residuals[np.arange(len(seeds)), own]
                information += weights @ slopes
                pull = pull + _apply(weights, residual + _apply(slopes, positions))
            covariances = np.asarray(np.linalg.inv(information), dtype=np.float64)
            positions = _apply(covariances, pull)
        found = Newborns(positions, covariances, np.zeros(len(seeds)), sources)
        inside = self._room.contains(positions, self._margin)
        found = found.take(np.flatnonzero(inside & ((sources >= 0).sum(axis=0) >= 2)))
        existences = expit(self._log_odds(found, evidence))
        return Newborns(found.positions, found.covariances, existences, found.sources)

    def _nearest(
        self,
        residuals: Float[ndarray, "N M m"],
        slopes: Float[ndarray, "N m 3"],
        covariances: Float[ndarray, "N 3 3"],
        evidence: CameraEvidence,
    ) -> Int[ndarray, " N"]:
        """The unexplained box that lies nearest, -1 where none is inside the gate."""
        own_spread = slopes @ covariances @ slopes.transpose(0, 2, 1)
        spread = evidence.noises[None] + own_spread[:, None]
        solved = np.linalg.solve(spread, residuals[..., None])[..., 0]
        distances = (residuals * solved).sum(axis=2)
        distances[:, evidence.unexplained <= _UNEXPLAINED] = np.inf
        best = distances.argmin(axis=1)
        close = distances[np.arange(len(best)), best] <= self._gate
        return np.asarray(np.where(close, best, -1))

    def _log_odds(self, found: Newborns, evidence: list[CameraEvidence]) -> Float[ndarray, " N"]:
        """log Λ of each newcomer."""
        log_odds = self._log_density + 1.5 * np.log(2.0 * np.pi)
        log_odds = log_odds + 0.5 * np.linalg.slogdet(found.covariances)[1]
        for c, camera in enumerate(self._cameras):
            hit = found.sources[c] >= 0
            missed = ~hit & camera.sees(found.positions)
            log_odds[missed] += self._log_miss
            if not hit.any():
                continue
            own, expected = found.sources[c][hit], self._model.expected(camera, found.positions)
            residual = evidence[c].values[own] - expected.values[hit]
            noise = evidence[c].noises[own]
            distance = (residual * np.linalg.solve(noise, residual[..., None])[..., 0]).sum(axis=1)
            log_odds[hit] += self._log_hit - np.log(evidence[c].clutter_intensity)
            log_odds[hit] -= 0.5 * (distance + np.linalg.slogdet(2.0 * np.pi * noise)[1])
        return np.asarray(log_odds)


def _apply(matrices: Float[ndarray, "N a b"], vectors: Float[ndarray, "N b"]) -> ndarray:
    """Each matrix times its vector."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
