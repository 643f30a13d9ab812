"""The pseudo particle filter: one set of particles whose clusters are the targets.

[SG08] Sun, Guo, "Multiple object tracking with a pseudo particle filter", 2008.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int, Int16, UInt8
from numpy import ndarray
from scipy.special import expit

from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.colour.appearance import Scene
from tracker.single_view.pictures.background import pack
from tracker.single_view.protocol import ViewEvent, ViewResult, pack_samples
from tracker.single_view.pseudo_particle import hypotheses
from tracker.single_view.pseudo_particle import particles as particle_set
from tracker.single_view.pseudo_particle.particles import ColourParticles
from tracker.single_view.pseudo_particle.track_management import (
    UNCONFIRMED,
    Targets,
    Tracks,
    manage,
)

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters

CLASSICAL_LABEL = 1
"""Label of the single estimate of the classical filter."""


@dataclass(frozen=True, slots=True, eq=False)
class PseudoParticleState:
    """The particles and tracks after a step."""

    particles: Float[ndarray, "S 4"]
    """Particles around the targets, or the classical filter's posterior, of equal weights."""
    tracks: Tracks
    """Targets of the pseudo particle filter; the classical one has none."""
    foreground: Any
    """The state of the foreground model."""


class PseudoParticle:
    """Particle filters on colour in one camera ([SG08]).

    A particle is a box; random walk. Its weight is exp(-λ d), d the Bhattacharyya
    distance between its histogram and the nearest of all targets' colours. One
    multinomial resampling for all targets together leaves clusters, whose modes are
    fixed points of the mean shift with the Epanechnikov kernel; small clusters are
    dropped. The hypothesis matrix assigns modes to targets or background, and
    the particles of the next step are drawn around each target anew. Some particles
    search for new targets.

    The classical filter, for contrast, has one posterior and its mean.

    Beyond the paper, and switched off by the preset ``published``: bins of hue and
    saturation; the foreground in the box; new targets searched for on it; each
    target's particles resampled separately, and clusters for each person's colours;
    targets that retain some of their velocity; new targets that keep apart; all modes, not
    the confirmed targets, are passed to the fusion.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures,
    ) -> None:
        """Read the templates and learn the background of one camera.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters = p = parameters.of(PseudoParticleParams)
        self._colours = colours = parameters.of(ColourPhdParams)
        self._model = ColourParticles(
            sequence, camera_index, p, colours, parameters.foreground, reader
        )
        self._step_time = sequence.step_time

    def start(self) -> PseudoParticleState:
        """The state without targets, before the first step."""
        return PseudoParticleState(np.zeros((0, 4)), Tracks.empty(), self._model.appearance.start())

    def step(
        self,
        state: PseudoParticleState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[PseudoParticleState, ViewResult]:
        """Process one step; without an image the particles are only predicted."""
        moved = self._model.move(state.particles, rng)
        if picture is None:
            return replace(state, particles=moved), self._unseen(state)
        foreground, scene = self._model.appearance.prepare(state.foreground, picture)
        if self._parameters.filter == "classical":
            particles, result = self._classical(moved, scene, rng)
            after = PseudoParticleState(particles, state.tracks, foreground)
        else:
            particles, tracks, result = self._pseudo(state.tracks, moved, scene, rng)
            after = PseudoParticleState(particles, tracks, foreground)
        mask = None if scene.mask is None else pack(scene.mask)
        return after, replace(result, foreground=mask)

    def _pseudo(
        self,
        tracks: Tracks,
        moved: Float[ndarray, "S 4"],
        scene: Scene,
        rng: np.random.Generator,
    ) -> tuple[Float[ndarray, "S 4"], Tracks, ViewResult]:
        """Clusters, hypothesis matrix, and new particles: particles, targets and result."""
        p, count = self._parameters, self._colours.samples
        colours = self._model.appearance.model
        samples = np.concatenate([moved, self._model.draw_new(count - len(moved), scene, rng)])
        expected = tracks.targets.moved(p.velocity_share)
        scores, persons = self._model.scores(scene, samples)
        weights = (
            particle_set.normalised(scores)
            if p.resampling == "together"
            else particle_set.normalised_by_group(scores, self._nearest(samples, expected))
        )
        counts = particle_set.resample(weights, count, rng)
        found = particle_set.clusters(
            samples,
            counts,
            persons if p.clusters == "each" else np.zeros_like(persons),
            bandwidth=p.bandwidth,
            merge_distance=p.merge_distance,
        )
        modes = found.modes[found.shares >= p.smallest_cluster]
        distances = colours.distances(scene.bins, modes)
        evidence, inside = self._model.evidence(scene, modes)
        good = inside >= self._colours.acceptance_foreground
        modes, distances, evidence = modes[good], distances[good], evidence[good]

        vacant = hypotheses.vacancies(expected, len(colours.names), p.targets_per_person)
        matrix = hypotheses.hypothesis_matrix(
            modes,
            distances,
            evidence,
            expected,
            vacant,
            sharpness=p.sharpness,
            background_distance=p.acceptance_distance,
            position_sigma=p.position_sigma,
            position_gate=p.position_gate,
        )
        existences = hypotheses.target_probabilities(matrix)
        background = matrix.shape[1] - 1
        columns = hypotheses.apart(
            modes,
            existences,
            hypotheses.best_hypothesis(matrix),
            len(expected),
            background,
            p.separation,
        )
        after, events = manage(
            tracks,
            expected,
            modes,
            existences,
            columns,
            vacant,
            confirmation=p.confirmation,
            patience=self._steps(p.patience),
            memory=self._steps(p.memory),
            newcomer_misses=p.newcomer_misses,
            velocity_memory=p.velocity_memory,
        )
        particles = self._around(after.targets, np.repeat(samples, counts, axis=0), rng)
        detected = columns < background
        labels = np.concatenate([expected.labels, np.full(len(vacant), -1)])[columns[detected]]
        result = self._result(
            after.targets,
            modes=modes[detected],
            scores=existences[detected],
            labels=np.where(labels == UNCONFIRMED, -1, labels),
            samples=pack_samples(samples, weights),
            gates=self._gates(expected),
            events=events,
            information={
                "clusters": float(len(found.modes)),
                "modes": float(len(modes)),
                "effective particles": particle_set.effective_number(weights),
                "foreground share": scene.foreground_share,
            },
        )
        return particles, after, result

    def _classical(
        self, moved: Float[ndarray, "S 4"], scene: Scene, rng: np.random.Generator
    ) -> tuple[Float[ndarray, "S 4"], ViewResult]:
        """Sampling, importance weights and resampling: one posterior, and its mean."""
        p, count = self._parameters, self._colours.samples
        samples = moved if len(moved) else self._model.draw_new(count, scene, rng)
        weights = particle_set.normalised(self._model.scores(scene, samples)[0])
        counts = particle_set.resample(weights, count if len(samples) else 0, rng)
        mean = (weights @ samples)[None] if len(samples) else np.zeros((0, 4))
        scores, _ = self._model.scores(scene, mean)
        existence = expit(scores + p.sharpness * p.acceptance_distance)
        labels = np.full(len(mean), CLASSICAL_LABEL)
        result = ViewResult(
            boxes=mean,
            weights=existence,
            labels=labels,
            sigmas=self._model.sigmas(mean),
            estimates=mean,
            estimate_weights=existence,
            estimate_labels=labels,
            measurements=mean,
            measurement_scores=existence,
            samples=pack_samples(samples, weights),
            information={"effective particles": particle_set.effective_number(weights)},
        )
        return np.repeat(samples, counts, axis=0), result

    def _nearest(self, boxes: Float[ndarray, "S 4"], targets: Targets) -> Int[ndarray, " S"]:
        """The nearest target in whose gate each box lies; T outside all gates."""
        if not len(targets):
            return np.zeros(len(boxes), dtype=np.int64)
        apart = boxes[:, None, :2] - targets.boxes[None, :, :2]
        p = self._parameters
        reach = p.position_gate * p.position_sigma * np.maximum(targets.boxes[:, 2:], 0.5)
        squared = ((apart / reach) ** 2).sum(axis=2)
        return np.asarray(np.where(squared.min(axis=1) < 1.0, squared.argmin(axis=1), len(targets)))

    def _around(
        self, targets: Targets, resampled: Float[ndarray, "S 4"], rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """The particles for the next step: new ones around targets, or the resampled ones."""
        p, colours = self._parameters, self._colours
        if not len(targets):
            return np.zeros((0, 4))
        count = colours.samples - round(p.newcomer_share * colours.samples)
        if p.redistribution == 0.0:
            return np.asarray(rng.permutation(resampled)[:count])
        expected = targets.moved(p.velocity_share)
        # a target that is not detected may be anywhere within its drift since
        strayed = colours.motion_sigma**2 * self._step_time * targets.misses
        spread = np.sqrt(p.redistribution**2 + strayed)
        sigmas = spread[:, None] * expected.boxes[:, 2:]
        return particle_set.redistribute(expected.boxes, sigmas, count, rng)

    def _gates(self, expected: Targets) -> Float[ndarray, "T 5"]:
        """Ellipses of the gates of the targets' modes."""
        p = self._parameters
        variances = (p.position_gate * p.position_sigma * expected.boxes[:, 2:]) ** 2
        across, down = variances.T
        return np.column_stack([expected.boxes[:, :2], across, np.zeros_like(across), down])

    def _steps(self, seconds: float) -> int:
        return round(seconds / self._step_time)

    def _result(
        self,
        targets: Targets,
        *,
        modes: Float[ndarray, "M 4"],
        scores: Float[ndarray, " M"],
        labels: Int[ndarray, " M"],
        samples: Int16[ndarray, "S 3"],
        gates: Float[ndarray, "G 5"],
        events: tuple[ViewEvent, ...],
        information: dict[str, float],
    ) -> ViewResult:
        """Return the result of a step."""
        confirmed = targets.take(targets.confirmed)
        boxes, weights, box_labels = modes, scores, labels
        if self._parameters.output == "targets":
            seen = confirmed.take(confirmed.misses == 0)
            boxes, weights, box_labels = seen.boxes, seen.existences, seen.labels
        return ViewResult(
            boxes=boxes,
            weights=weights,
            labels=box_labels,
            sigmas=self._model.sigmas(boxes),
            estimates=confirmed.boxes,
            estimate_weights=confirmed.existences,
            estimate_labels=confirmed.labels,
            measurements=modes,
            measurement_scores=scores,
            samples=samples,
            information=information,
            events=events,
            gates=gates,
        )

    def _unseen(self, state: PseudoParticleState) -> ViewResult:
        """The result without an image: the targets of the step before, and no boxes."""
        confirmed = state.tracks.targets.take(state.tracks.targets.confirmed)
        return ViewResult.of_estimates(confirmed.boxes, confirmed.existences, confirmed.labels)
