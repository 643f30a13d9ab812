"""Boxes as particles: motion, weights from colours, resampling, clusters, and redistribution.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.

[SG08] Sun, Guo, "Multiple object tracking with a pseudo particle filter", 2008.
[CM02] Comaniciu, Meer, "Mean shift: a robust approach toward feature space analysis",
IEEE TPAMI 24(5), 2002.
[GSS93] Gordon, Salmond, Smith, "Novel approach to nonlinear/non-Gaussian Bayesian state
estimation", IEE Proceedings F 140(2), 1993.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.kernels.pictures import images
from tracker.parameters.groups.colour_phd import ColourBoxParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import box_sigmas
from tracker.single_view.colour.appearance import Appearance, Scene

ITERATIONS = 30
"""Largest number of steps of a climb; most converge well before."""

TOLERANCE = 0.01
"""Length of a step in half sizes below which a climb ends: far below any mode's deviation."""


def log_likelihoods(distances: Float[ndarray, "S G"], sharpness: float) -> Float[ndarray, " S"]:
    """Compute max_g -λ d_g: the log of a particle's weight exp(-λ d), the best over G targets.

    Args:
        distances: d of each particle to the colours of each target, 0 … 1; G ≥ 1.
        sharpness: λ, the decrease of the log weight for each unit of distance.
    """
    return np.asarray((-sharpness * distances).max(axis=1))


def normalised(logarithms: Float[ndarray, " S"]) -> Float[ndarray, " S"]:
    """Normalise weights to the sum 1, from their logarithms, however small; empty for none."""
    if not len(logarithms):
        return np.zeros(0)
    weights = np.exp(logarithms - logarithms.max())
    return np.asarray(weights / weights.sum())


def normalised_by_group(
    logarithms: Float[ndarray, " S"], groups: Int[ndarray, " S"]
) -> Float[ndarray, " S"]:
    """Normalise weights to the sum 1, each group's to its share of the particles.

    A target with slightly less similar colours than another loses no particles to it.

    Args:
        logarithms: Logarithms of the weights, however small.
        groups: Group of each particle, 0, 1, ….
    """
    if not len(logarithms):
        return np.zeros(0)
    largest = np.full(groups.max() + 1, -np.inf)
    np.maximum.at(largest, groups, logarithms)
    weights = np.exp(logarithms - largest[groups])
    sums, members = np.bincount(groups, weights), np.bincount(groups)
    return np.asarray(weights / sums[groups] * members[groups] / len(logarithms))


def effective_number(weights: Float[ndarray, " S"]) -> float:
    """The effective sample size 1 / Σ w²; 0 for no particles."""
    squared = float((weights**2).sum())
    return 1.0 / squared if squared > 0.0 else 0.0


def resample(
    weights: Float[ndarray, " S"], count: int, rng: np.random.Generator
) -> Int[ndarray, " S"]:
    """Draw ``count`` particles multinomially; returns the number for each particle ([GSS93]).

    Args:
        weights: Weights with sum 1; there may be none.
        count: Number of draws, ≥ 0.
        rng: The generator of the draws.
    """
    if not len(weights):
        return np.zeros(0, dtype=np.int64)
    return np.asarray(rng.multinomial(count, weights))


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """The modes of a set of particles, the largest cluster first."""

    modes: Float[ndarray, "M 4"]
    """Fixed points of the mean shift."""
    shares: Float[ndarray, " M"]
    """Share of all particles that climb to each."""
    owners: Int[ndarray, " S"]
    """Index of the mode that each particle climbs to; -1 for particles of count 0."""


def clusters(
    boxes: Float[ndarray, "S 4"],
    counts: Int[ndarray, " S"],
    groups: Int[ndarray, " S"],
    *,
    bandwidth: float,
    merge_distance: float,
) -> Clusters:
    """Compute mean-shift clusters with the Epanechnikov kernel ([CM02], [SG08]).

    Every particle climbs to a fixed point of

        m ← Σ_i c_i [r_i < 1] x_i / Σ_i c_i [r_i < 1],  r_i = |(x_i - m) / (h H_m)|

    with the half sizes H_m of the current box: the bandwidth follows the target's size.

    Args:
        boxes: Particles, each once, pixels.
        counts: Number of draws of each.
        groups: Group of each particle; each group has modes of its own.
        bandwidth: h, in half sizes.
        merge_distance: Distance in half sizes below which fixed points are merged to the densest.

    Returns:
        The modes; none for no particles.
    """
    weights = np.ascontiguousarray(counts, dtype=float)
    climbed = images.epanechnikov_climb(
        np.ascontiguousarray(boxes, dtype=float), weights, groups, bandwidth, ITERATIONS, TOLERANCE
    )
    order = np.argsort(-climbed.densities, kind="stable")
    modes = images.join_modes(climbed.points, weights, order, merge_distance)
    owners, leaders = modes.owners, modes.leaders
    there = owners >= 0
    sums = np.bincount(owners[there], weights[there], minlength=len(leaders))
    by_size = np.argsort(-sums, kind="stable")
    ranks = np.empty(len(leaders) + 1, dtype=np.int64)
    ranks[by_size], ranks[-1] = np.arange(len(leaders)), -1
    shares = sums[by_size] / max(sums.sum(), 1.0)
    return Clusters(climbed.points[leaders[by_size]], shares, ranks[owners])


def redistribute(
    boxes: Float[ndarray, "T 4"],
    sigmas: Float[ndarray, "T 2"],
    count: int,
    rng: np.random.Generator,
) -> Float[ndarray, "S 4"]:
    """Draw new particles around targets, the same number around each ([SG08]).

    Resampling results in copies of a few particles (impoverishment), most of them at the
    target that fits best; the new ones are Gaussian around every target.

    Args:
        boxes: Boxes of the targets, pixels; there may be none.
        sigmas: Standard deviations of the centre, pixels.
        count: Number of particles of all targets together, divided as evenly as possible.
        rng: The generator of the draws.
    """
    if not len(boxes) or count == 0:
        return np.zeros((0, 4))
    target = np.arange(count) % len(boxes)
    drawn = boxes[target].copy()
    drawn[:, :2] += sigmas[target] * rng.standard_normal((count, 2))
    return drawn


class ColourParticles:
    """The models that the pseudo particle filter and the classical one share.

    Motion: a random walk in half sizes. Weight: exp(-λ d), d the Bhattacharyya distance
    between the particle's histogram and the nearest of all targets' colours, times the
    likelihood of the foreground in the box.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: PseudoParticleParams,
        colours: ColourBoxParams,
        foreground: ForegroundParams,
        reader: Pictures,
    ) -> None:
        """Read the templates and learn the background, where it is used.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters, self._colours = parameters, colours
        self.appearance = Appearance(
            sequence,
            camera_index,
            reader,
            colour_space=colours.colour_space,
            histogram_kernel=colours.histogram_kernel,
            size_jitter=colours.size_jitter,
            foreground=foreground if parameters.asks_foreground(colours) else None,
        )
        self._root_time = float(np.sqrt(sequence.step_time))

    def move(
        self, particles: Float[ndarray, "S 4"], rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Predict by a random walk in half sizes; width and height change together.

            x ← x + σ_w √T H n,  H ← H exp(σ_H √T n₃)

        with the time T of a step and standard normal n.

        Args:
            particles: Centre and half sizes of S particles, pixels.
            rng: The generator of n.

        Returns:
            At most S particles: those whose centres are still in the image.
        """
        p, root = self._colours, self._root_time
        noise = rng.standard_normal((len(particles), 3))
        moved = particles.copy()
        moved[:, :2] += p.motion_sigma * root * particles[:, 2:] * noise[:, :2]
        moved[:, 2:] *= np.exp(p.growth_sigma * root * noise[:, 2:])
        return self.appearance.within(moved)

    def draw_new(self, count: int, scene: Scene, rng: np.random.Generator) -> Float[ndarray, "N 4"]:
        """Draw particles where new targets may be: on the foreground, or anywhere.

        Args:
            count: Number of particles; fewer result where no target can be.
            scene: The image.
            rng: The generator of places and sizes.
        """
        if self._parameters.birth == "foreground":
            drawn = self.appearance.draw_on_foreground(count, scene, rng)
        else:
            drawn = self.appearance.draw_anywhere(count, rng)
        return self.appearance.within(drawn)

    def evidence(
        self, scene: Scene, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, " N"], Float[ndarray, " N"]]:
        """Compute the foreground's log factors of the likelihood of boxes, and shares inside.

        Args:
            scene: The image.
            boxes: Centre and half sizes of N boxes, pixels.

        Returns:
            As :func:`tracker.single_view.pictures.foreground.shape_scores`.
        """
        p = self._colours
        return self.appearance.shape_scores(
            scene, boxes, inside_weight=p.foreground_weight, around_weight=p.surroundings_weight
        )

    def scores(
        self, scene: Scene, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, " N"], Int[ndarray, " N"]]:
        """Compute the log weight -λ d of each box, plus that of its foreground.

        Args:
            scene: The image.
            boxes: Centre and half sizes of N boxes, pixels.

        Returns:
            The log weights, and the index of the person whose colours each box fits best.
        """
        distances = self.appearance.model.distances(scene.bins, boxes)
        colours = log_likelihoods(distances, self._parameters.sharpness)
        evidence, _ = self.evidence(scene, boxes)
        return np.asarray(colours + evidence), np.asarray(distances.argmin(axis=1))

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Standard deviations of modes: proportional to the box."""
        p = self._colours
        return box_sigmas(boxes, p.centre_sigma, p.size_sigma)
