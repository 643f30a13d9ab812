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


@dataclass(frozen=True, slots=True, eq=False)
class CameraEvidence:
    """What one camera leaves unexplained at one step. M boxes."""

    rays: Float[ndarray, "M 3"]
    """Unit directions through the boxes' centres, world axes."""
    values: Float[ndarray, "M m"]
    """Measurements of the target model, pixels."""
    noises: Float[ndarray, "M m m"]
    unexplained: Float[ndarray, " M"]
    """Probability that no target made the box."""
    clutter_intensity: float
    """κ, per unit of the measurement space."""


@dataclass(frozen=True, slots=True, eq=False)
class Newborn:
    """One newcomer: where, how sure, and which box of each camera says so."""

    position: Float[ndarray, " 3"]
    covariance: Float[ndarray, "3 3"]
    existence: float
    sources: Int[ndarray, " C"]
    """Index of the box in each camera, -1 for none."""


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

    def propose(self, evidence: list[CameraEvidence]) -> list[Newborn]:
        """Newcomers that share no box, the surest first."""
        seeds = self._meeting_points(evidence)
        if not len(seeds):
            return []
        proposals = [self._fit(seed, evidence) for seed in seeds]
        found = sorted(
            (p for p in proposals if p is not None), key=lambda p: p.existence, reverse=True
        )
        taken: set[tuple[int, int]] = set()
        chosen: list[Newborn] = []
        for newborn in found:
            own = {(c, int(j)) for c, j in enumerate(newborn.sources) if j >= 0}
            if own & taken:
                continue
            taken |= own
            chosen.append(newborn)
        return chosen

    def _meeting_points(self, evidence: list[CameraEvidence]) -> Float[ndarray, "N 3"]:
        """Where the rays of unexplained boxes of two cameras pass close by each other."""
        points = []
        for a in range(len(evidence)):
            for b in range(a + 1, len(evidence)):
                free_a = np.flatnonzero(evidence[a].unexplained > 0.5)
                free_b = np.flatnonzero(evidence[b].unexplained > 0.5)
                if not len(free_a) or not len(free_b):
                    continue
                u = evidence[a].rays[free_a][:, None, :]
                v = evidence[b].rays[free_b][None, :, :]
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
        if not points:
            return np.zeros((0, 3))
        all_points = np.concatenate(points)
        return np.asarray(all_points[self._room.contains(all_points, self._margin)])

    def _fit(self, seed: ndarray, evidence: list[CameraEvidence]) -> Newborn | None:
        """The place that fits the seed's best box in every camera, and its odds."""
        position = seed
        precision = np.eye(3) / _START_SIGMA**2
        covariance = np.eye(3) * _START_SIGMA**2
        sources = np.full(len(evidence), -1, dtype=np.int64)
        for refinement in range(_REFINEMENTS):
            information = precision.copy()
            pull = precision @ seed
            fit = np.zeros(len(evidence))
            for c, camera in enumerate(self._cameras):
                expected = self._model.expected(camera, position[None])
                if not expected.valid[0] or not len(evidence[c].values):
                    sources[c] = -1
                    continue
                jacobian = expected.jacobians[0]
                residuals = evidence[c].values - expected.values[0]
                if refinement < _REFINEMENTS - 1 or sources[c] >= 0:
                    spread = evidence[c].noises + (jacobian @ covariance @ jacobian.T)
                    distances = np.einsum(
                        "mi,mi->m", residuals, np.linalg.solve(spread, residuals[..., None])[..., 0]
                    )
                    distances[evidence[c].unexplained <= 0.5] = np.inf
                    best = int(np.argmin(distances))
                    sources[c] = best if distances[best] <= self._gate else -1
                if sources[c] < 0:
                    continue
                weight = jacobian.T @ np.linalg.inv(evidence[c].noises[sources[c]])
                information += weight @ jacobian
                pull += weight @ (residuals[sources[c]] + jacobian @ position)
                fit[c] = 1.0
            if np.count_nonzero(sources >= 0) < 2:
                return None
            covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
            position = covariance @ pull
        if not self._room.contains(position[None], self._margin)[0]:
            return None
        log_odds = self._log_density + 1.5 * np.log(2.0 * np.pi)
        log_odds += 0.5 * np.linalg.slogdet(covariance)[1]
        for c, camera in enumerate(self._cameras):
            expected = self._model.expected(camera, position[None])
            seen = bool(camera.sees(position[None])[0])
            if sources[c] < 0:
                log_odds += self._log_miss if seen else 0.0
                continue
            residual = evidence[c].values[sources[c]] - expected.values[0]
            noise = evidence[c].noises[sources[c]]
            log_odds += self._log_hit - np.log(evidence[c].clutter_intensity)
            log_odds -= 0.5 * (
                residual @ np.linalg.solve(noise, residual)
                + np.linalg.slogdet(2.0 * np.pi * noise)[1]
            )
        return Newborn(position, covariance, float(expit(log_odds)), sources)
