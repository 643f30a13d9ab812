"""Peaks of the colour likelihood: where in a picture somebody of the templates' colours is.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray
from scipy.special import expit

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.parameters import ColourPeakParams, ForegroundParams
from tracker.parameters.groups.shapes import ShapesParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.colour.appearance import Appearance, Scene
from tracker.single_view.colour.evidence import colour_ratios
from tracker.single_view.colour.trust import shapes_of_templates, taught_well, template_trust
from tracker.single_view.dropped import Dropped
from tracker.single_view.pictures import mean_shift
from tracker.single_view.protocol import TRUST
from tracker.single_view.shape.evidence import log_ratios, shape_sigmas
from tracker.single_view.shape.finder import SAME_PERSON, ShapeFinder, Shapes

LEAST_LIKELY = 0.02
"""Added to the probability of a person by shape, as to the share of foreground in a box."""

BELIEVED = 0.9
"""A foreground that is trusted less than this about somebody is helped by shapes."""

FITTING = 0.25
"""Mean intersection over union with the templates from which people by shape are where the
templates say: boxes drawn by hand around heads and trunks share 0.4 to 0.5, around bodies 0.6."""

SHAPE_OVERLAP = 0.3
"""Windows of the shapes that share more than this of what both cover are of one person."""

_SHAPES = ShapesParams()


@dataclass(frozen=True, slots=True, eq=False)
class Passed:
    """People by colour and by shape, as the fusion gets them."""

    boxes: Float[ndarray, "N 4"]
    scores: Float[ndarray, " N"]
    """Of the colours, 0 … 1."""
    sigmas: Float[ndarray, "N 4"]
    log_ratios: Float[ndarray, " N"]
    """As :attr:`tracker.single_view.protocol.ViewResult.log_ratios`."""


@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """What was found in one picture, and from which samples."""

    boxes: Float[ndarray, "M 4"]
    scores: Float[ndarray, " M"]
    """Likelihood of each relative to that of a template's own colours, 0 … 1."""
    samples: Float[ndarray, "S 4"]
    sample_weights: Float[ndarray, " S"]
    """Relative to the largest."""
    mask: UInt8[ndarray, "h w"] | None
    """The foreground, where it was asked for."""
    information: dict[str, float]
    dropped: Dropped
    passed: Passed | None = None
    """What the fusion is to get instead of the boxes, where shapes are looked at, too."""


class PeakFinder:
    """Finds the peaks in the pictures of one camera, by mean shift over weighted samples.

    Boxes are sampled from an intensity and weighted by the likelihood, ṽ = l_z(x) v(x);
    the peaks of ṽ that look enough like a person are kept, one at each place. Where
    the parameters ask for it, part of the samples is drawn from the foreground, with
    the sizes that the calibrated camera allows there, and the likelihood is multiplied
    by what the foreground says of the box.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: ColourPeakParams,
        foreground: ForegroundParams,
        reader: Pictures,
        shapes: ShapesParams = _SHAPES,
    ) -> None:
        """Read the templates and learn the background.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters = p = parameters
        self._half_extents = sequence.target_half_extents
        self._appearance = Appearance(
            sequence,
            camera_index,
            reader,
            colour_space=p.colour_space,
            histogram_kernel=p.histogram_kernel,
            size_jitter=p.size_jitter,
            foreground=foreground if p.asks_foreground else None,
            carry_templates=p.carry_templates,
        )
        wanted = p.shapes == "always"
        self._fits = False
        """Whether people by shape lie where the templates are."""
        if p.shapes in ("unsure", "fitting") and p.asks_foreground:
            # who is doubted in one camera is sought by shape in all: one alone tells no place
            wanted = any(
                trust < BELIEVED
                for camera in range(len(sequence.views))
                for trust in template_trust(sequence, camera, reader, foreground).values()
            )
        guessed = p.shapes == "unsure" and not taught_well(sequence)
        if p.shapes == "fitting" or wanted or guessed:
            by_shape = shapes_of_templates(sequence, reader)
            self._fits = by_shape.fit >= FITTING
            wanted = wanted or self._fits
        self._shapes = ShapeFinder.of(sequence, camera_index, reader) if wanted else None
        self._instead = np.zeros(len(self._appearance.model.names))
        """How far the shape stands in for the foreground about each person, 0 … 1."""
        self._shape_numbers = shapes
        self._by_shape = np.zeros(len(self._appearance.model.names))
        """How far the shapes are to be believed about each person, 0 … 1."""
        if self._shapes is not None:
            names = self._appearance.model.names
            self._by_shape = np.array([by_shape.trust[name] for name in names])
            self._instead = (1.0 - self._appearance.trust) * self._by_shape

    @property
    def sizes(self) -> BoxSizes:
        """The sizes that a target can have."""
        return self._appearance.sizes

    def start(self) -> Any:
        """The state of the foreground model and of the shapes before the first picture."""
        shapes = None if self._shapes is None else self._shapes.start()
        return self._appearance.start(), shapes

    def find(
        self,
        state: Any,
        picture: UInt8[ndarray, "h w 3"],
        intensity: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[Any, Peaks]:
        """The peaks of one picture.

        Args:
            state: As :meth:`start` gives it, or the picture before.
            picture: BGR.
            intensity: Where people are expected, over boxes.
            rng: Draws the samples.

        Returns:
            The state for the next picture, and what was found.
        """
        background, shape_state = state
        p, s = self._parameters, self._shape_numbers
        background, scene = self._appearance.look(background, picture)
        shapes: Shapes | None = None
        if self._shapes is not None:
            least = min(s.passed_odds, p.shape_odds) if self._fits else p.shape_odds
            shape_state, shapes = self._shapes.find(shape_state, picture, least, SHAPE_OVERLAP)
        samples = self._sample(intensity, scene, rng)
        scores, _, _ = self._score(scene, shapes, samples)
        candidates = self._climb(samples, scores)
        boxes, distances, person, dropped = self._accept(scene, shapes, candidates)
        passed = None
        if shapes is not None:
            if self._fits:
                passed = self._passed(scene, shapes, boxes, distances, person)
            new = np.flatnonzero(~self._near(shapes, boxes).any(axis=1))
            more = shapes.boxes[new[shapes.log_odds[new] >= p.shape_odds]]
            boxes = np.concatenate([boxes, more])
            distances = np.concatenate([distances, self._nearest(scene, more)])
        return (background, shape_state), Peaks(
            boxes=boxes,
            scores=self._likelihood(distances),
            samples=samples,
            sample_weights=(
                np.exp(scores.max(axis=1) - scores.max()) if len(scores) else np.zeros(0)
            ),
            mask=scene.mask,
            information={
                **dropped.information(len(candidates) - len(dropped.gates)),
                "least distance": float(distances.min()) if len(distances) else 1.0,
                "foreground share": scene.foreground_share,
                TRUST: float(self._appearance.trust.mean()),
            },
            dropped=dropped,
            passed=passed,
        )

    def _passed(
        self,
        scene: Scene,
        found: Shapes,
        peaks: Float[ndarray, "N 4"],
        distances: Float[ndarray, " N"],
        person: Int[ndarray, " N"],
    ) -> Passed:
        """People by shape, surer where a peak is of the same, and peaks where there is no shape.

        A peak vouches for the surest shape at its place: others there are parts of the same
        person. What the colours say of a shape multiplies what the shape says; that they lie on the
        foreground is no excuse for a poor one, for so do parts of people, shadows and plants. Of a
        peak without any shape ln (t Λ + 1 - t) tells what it means that nobody would take it for
        a person, where t says how far the shapes are to be believed about whose colours it has.
        """
        s = self._shape_numbers
        near = self._near(found, peaks)
        surest = np.where(near, found.log_odds[:, None], -np.inf)
        vouched = near & (surest == surest.max(axis=0, initial=-np.inf))
        behind = self._behind(found, peaks, person, vouched)
        alone = np.flatnonzero(~near.any(axis=0) | behind)
        vouched &= ~behind
        own = self._nearest(scene, found.boxes)
        ratios = log_ratios(found.log_odds, s.even_odds, s.odds_weight, s.largest_ratio)
        ratios += colour_ratios(vouched, distances, own, self._parameters.likelihood_sigma)
        least = log_ratios(np.array(s.passed_odds), s.even_odds, s.odds_weight, s.largest_ratio)
        told = self._by_shape[person[alone]]
        of_alone = np.log(told * np.exp(least) + 1.0 - told)
        # of who is hidden behind another's shape the foreground takes the peak for somebody
        seen = np.where(behind[alone], self._trusted(person[alone]), 0.0)
        return Passed(
            np.concatenate([found.boxes, peaks[alone]]),
            self._likelihood(np.concatenate([own, distances[alone]])),
            np.concatenate(
                [
                    shape_sigmas(found.boxes, self._half_extents, s),
                    self.sigmas(peaks[alone]),
                ]
            ),
            np.concatenate([ratios, _at_least(of_alone, seen)]),
        )

    @staticmethod
    def _behind(
        found: Shapes,
        peaks: Float[ndarray, "N 4"],
        person: Int[ndarray, " N"],
        vouched: Bool[ndarray, "K N"],
    ) -> Bool[ndarray, " N"]:
        """Which peaks are of somebody else than the one whose colours are nearest to the shape:
        of two people before each other the picture has one shape."""
        behind = np.zeros(len(peaks), dtype=bool)
        for k in np.flatnonzero(vouched.sum(axis=1) > 1):
            own = np.flatnonzero(vouched[k])
            apart = np.abs(peaks[own, :2] - found.boxes[k, :2]) / found.sizes[k]
            nearest = own[(apart**2).sum(axis=1).argmin()]
            behind[own] |= person[own] != person[nearest]
        return behind

    def _nearest(self, scene: Scene, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, " N"]:
        """The distance of each box to the nearest template."""
        if not len(boxes):
            return np.zeros(0)
        return np.asarray(self._appearance.distances(scene, boxes).min(axis=1))

    def _likelihood(self, distances: Float[ndarray, " N"]) -> Float[ndarray, " N"]:
        return np.asarray(np.exp(-0.5 * (distances / self._parameters.likelihood_sigma) ** 2))

    @staticmethod
    def _near(found: Shapes, boxes: Float[ndarray, "N 4"]) -> Bool[ndarray, "K N"]:
        """Which of some boxes is at the place of each person by shape."""
        apart = (found.boxes[:, None, :2] - boxes[None, :, :2]) / found.sizes[:, None]
        return np.asarray((np.abs(apart) < SAME_PERSON).all(axis=2))

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Standard deviations of peaks: proportional to the box, and no more of a large one."""
        p = self._parameters
        half_sizes = np.maximum(boxes[:, 2:], 0.5)
        half_sizes = half_sizes * np.minimum(1.0, p.sigma_height / half_sizes[:, 1:])
        return np.concatenate([p.centre_sigma * half_sizes, p.size_sigma * half_sizes], axis=1)

    def _sample(
        self, intensity: GaussianMixture, scene: Scene, rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Boxes from the intensity and from the foreground."""
        p = self._parameters
        everywhere = round(p.samples * p.foreground_samples)
        if intensity.size == 0 and p.foreground_samples > 0.0:
            everywhere = p.samples
        on_foreground = round(everywhere * float(self._appearance.trust.mean()))
        parts = [
            self._appearance.draw_on_foreground(on_foreground, scene, rng),
            self._appearance.draw_anywhere(everywhere - on_foreground, rng),
        ]
        count = p.samples - everywhere
        if intensity.size and count:
            chosen = rng.choice(
                intensity.size, count, p=intensity.weights / intensity.weights.sum()
            )
            factors = np.linalg.cholesky(intensity.covariances)
            offsets = np.einsum("nab,nb->na", factors[chosen], rng.standard_normal((count, 4)))
            parts.append(intensity.means[chosen] + offsets)
        return self._appearance.within(np.concatenate(parts))

    def _score(
        self, scene: Scene, shapes: Shapes | None, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, "N G"], Float[ndarray, "N G"], Float[ndarray, " N"]]:
        """Log-likelihood and distance D of each box for each person, and share of foreground.

        About somebody whom the foreground does not see the shape says instead whether there
        is a person: a ln(P + 0.02), with the probability P of one.
        """
        p = self._parameters
        distances = self._appearance.distances(scene, boxes)
        trust, instead = self._appearance.trust[None, :], self._instead[None, :]
        if not p.peaks_per_person:
            trust, instead = (each.min(axis=1, keepdims=True) for each in (trust, instead))
            distances = distances.min(axis=1, keepdims=True)
        scores = -0.5 * (distances / p.likelihood_sigma) ** 2
        factors, inside = self._appearance.shape_scores(
            scene,
            boxes,
            inside_weight=p.foreground_weight,
            around_weight=p.surroundings_weight,
        )
        scores = scores + trust * factors[:, None]
        if shapes is not None and instead.any():
            likely = np.log(expit(shapes.support(boxes)) + LEAST_LIKELY)
            scores += p.foreground_weight * instead * likely[:, None]
        return scores, distances, inside

    def _trusted(self, person: Int[ndarray, " N"]) -> Float[ndarray, " N"]:
        """How far the foreground is believed about each person of some boxes."""
        trust = self._appearance.trust
        if not self._parameters.peaks_per_person:
            trust = np.full(1, trust.min())
        return np.asarray(trust[person])

    def _climb(
        self, samples: Float[ndarray, "S 4"], scores: Float[ndarray, "S G"]
    ) -> Float[ndarray, "M 4"]:
        """The peaks of the weighted samples, by each person's colours for themselves."""
        p = self._parameters
        found = [np.zeros((0, 4))]
        for person in range(scores.shape[1] if len(samples) else 0):
            weights = np.exp(scores[:, person] - scores[:, person].max())
            starts = mean_shift.starts(
                samples, weights, p.mean_shift_starts, spread=p.spread_starts
            )
            peaks, _ = mean_shift.modes(
                samples,
                weights,
                samples[starts],
                bandwidth=p.bandwidth,
                merge_distance=p.merge_distance,
            )
            found.append(peaks)
        return np.concatenate(found)

    def _accept(
        self, scene: Scene, shapes: Shapes | None, candidates: Float[ndarray, "M 4"]
    ) -> tuple[Float[ndarray, "K 4"], Float[ndarray, " K"], Int[ndarray, " K"], Dropped]:
        """The peaks that look enough like a person, their distances, and like whom; one at each
        place. And where the others fell."""
        p = self._parameters
        scores, distances, inside = self._score(scene, shapes, candidates)
        best, nearest, person = scores.max(axis=1), distances.min(axis=1), scores.argmax(axis=1)
        coloured = nearest <= p.acceptance_distance
        likely = best >= -0.5 * (p.acceptance_distance / p.likelihood_sigma) ** 2
        covered = np.ones(len(candidates), dtype=bool)
        if scene.mask is not None:
            covered = inside >= p.acceptance_foreground * self._trusted(person)
        good = likely & covered
        kept: list[int] = []
        for i in np.argsort(-best, kind="stable"):
            apart = (candidates[kept, :2] - candidates[i, :2]) / candidates[kept, 2:]
            least = np.where(person[kept] == person[i], p.same_person_distance, p.merge_distance)
            if good[i] and np.all((apart**2).sum(axis=1) >= least**2):
                kept.append(int(i))
        fell = ~good & coloured & covered
        by_shape = self._instead[person] > self._trusted(person)
        gates = {
            "colour": ~good & ~coloured,
            "foreground": ~good & coloured & ~covered,
            "surroundings": fell & ~by_shape,
            "shape": fell & by_shape,
            "another at its place": good & ~np.isin(np.arange(len(good)), kept),
        }
        return candidates[kept], nearest[kept], person[kept], Dropped.of(candidates, gates)


def _at_least(
    log_ratios: Float[ndarray, " N"], share: Float[ndarray, " N"]
) -> Float[ndarray, " N"]:
    """ln (t + (1 - t) Λ) of the likelihood ratios Λ below 1: with probability t what somebody
    looks like does not speak against him."""
    mixed = np.log(share + (1.0 - share) * np.exp(np.minimum(log_ratios, 0.0)))
    return np.asarray(np.where(log_ratios < 0.0, mixed, log_ratios))
