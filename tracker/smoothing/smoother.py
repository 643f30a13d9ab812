"""The fusion's own models over whole paths: best states given boxes, and boxes given states."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.seeking import Whereabouts
from tracker.fusion.model import FusionModel
from tracker.kernels.measurement import ExpectedBoxes as SeenBoxes
from tracker.kernels.smoothing import evidence, passes
from tracker.parameters import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.calibration import (
    FEWEST,
    NARROWEST,
    ODD,
    OFFSET_RIDGE,
    SIZE_RIDGE,
    WIDEST,
    Calibration,
    free,
    lower,
    upright,
)
from tracker.smoothing.marks import Marks, shifts
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.place_constraints import Stated
from tracker.smoothing.process_noise import restlessness
from tracker.smoothing.recording import CameraBoxes

_T = TypeVar("_T")

START_SIGMA = 10.0
"""Metres: how little is known of a path's first place but by its boxes."""

_MOST_THREADS = 4
_LEAST = 0.01  # association probability of a pair worth keeping
_SURE = 0.9  # association probability of a box that tells of its person's size
_MEDIAN = 0.4549  # of a squared standard normal


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Paths fitted to their boxes."""

    paths: Paths
    odds: Float[ndarray, " N"]
    """log of what each row's boxes say, given the rows before, against all being clutter."""
    ahead: Float[ndarray, "N d"]
    """What the rows before say of each row."""
    ahead_covariances: Float[ndarray, "N d d"]
    traces: Float[ndarray, " N"]
    """Of the position's covariance before the backward pass, square metres."""
    restlessness: Float[ndarray, " N"]
    """s: by which the motion's noise is multiplied on the way to each row."""
    places: Stated = field(default_factory=lambda: Stated.of(np.zeros(0, dtype=np.int64), ()))
    """What somebody said of where people are, as weighed against all else."""

    @property
    def jumps(self) -> Float[ndarray, " N"]:
        """Squared Mahalanobis distance between what the rows before and from this one on say."""
        paths = self.paths
        told: ndarray = passes.jumps(
            paths.starts, paths.states, paths.covariances, self.ahead, self.ahead_covariances
        )
        return told


@dataclass(frozen=True, slots=True, eq=False)
class Shared:
    """Who made which box, at all steps and in all C cameras."""

    links: Links
    chances: Float[ndarray, "C N"]
    """p_D of each row."""
    missed: Float[ndarray, "C N"]
    """Probability that the camera missed it."""
    hidden_by: Int[ndarray, "C N"]
    """Label of who hides it, -1 for nobody."""


class Smoother:
    """Batch estimation over a recording with the fusion's motion, measurement and visibility."""

    def __init__(
        self,
        sequence: Sequence,
        parameters: FusionParams,
        views: Many[tuple[ViewResult, ...]],
        corrections: Many[Correction] = (),
        *,
        learning: bool = True,
        several_boxes: bool = False,
    ) -> None:
        """Prepare for the boxes of some steps from step 0 on.

        Args:
            sequence: Cameras and room.
            parameters: Of the fusion.
            views: Stage 1 of each step.
            corrections: Of them *is here* is a measurement of the place.
            learning: Whether people's restlessness is learnt; else they move as stated.
            several_boxes: Whether stage 1 may draw several boxes of one camera around a person.
        """
        self._learning, self.several_boxes = learning, several_boxes
        self._sequence = sequence
        self._marks = Marks.of(sequence)
        self._threads = ThreadPoolExecutor(min(len(sequence.views), _MOST_THREADS))
        self.parameters = parameters
        self._here = [one for one in corrections if one.kind == "here"]
        self.model = model = FusionModel(sequence, parameters)
        self.frames = len(views)
        self.cameras = [
            CameraBoxes.of([step[c] for step in views], model.target, parameters.measurement_sigma)
            for c in range(len(model.cameras))
        ]
        motion = model.motion
        self._rule = model.camera_rule(_LEAST)
        self.prior = np.zeros((motion.dimension, motion.dimension))
        self.prior[:3, :3] = START_SIGMA**2 * np.eye(3)
        self.prior[3:, 3:] = max(motion.start_velocity, 1e-6) ** 2 * np.eye(motion.dimension - 3)
        size = model.room.maximum - model.room.minimum
        self.log_place = float(
            1.5 * np.log(2.0 * np.pi) + 3.0 * np.log(START_SIGMA) - np.log(np.prod(size))
        )
        """What turns the density of a first place under the prior into one over the room."""

    def fit(
        self, paths: Paths, links: Links, iterations: int = 1, learnt: Calibration | None = None
    ) -> Fitted:
        """The most likely states of every path given its boxes: iterated Kalman smoothing.

        Each iteration straightens the projection at the states of the one before: Gauss and
        Newton's way to the least-squares solution over the whole path (Bell, "The iterated
        Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4(3), 1994). A box that
        is a path's with probability a counts with a times its information, and the motion's
        noise with how restless the person is about that time.

        Args:
            paths: Their states are where the projection is straightened first.
            links: Whose box each is.
            iterations: At least 1.
            learnt: Of the boxes; as stated, if none.
        """
        motion, owners = self.model.motion, paths.owners
        learnt = learnt or self.stated(paths)
        rule = passes.PathMotion(motion.transition, motion.noise, self.prior)
        restless = np.ones(len(paths.states))
        for _ in range(iterations):
            told = self._each_camera(partial(self._told, paths, owners, links, learnt))
            information = evidence.BoxInformation(
                *(np.sum(parts, axis=0) for parts in zip(*told, strict=True))
            )
            begins = paths.states[paths.starts[:-1]].copy()
            begins[:, 3:] = 0.0
            places = Stated.of(*self.pinned(paths))
            smooth = partial(_smoothed, paths, begins, information, rule)
            found = smooth(places, restless)
            weighed = places.weighed(found.means, found.covariances)
            if weighed.contradicted:
                places = weighed
                found = smooth(places, restless)
            if self._learning:
                restless = restlessness(
                    paths.starts, found, motion.noise, restless, self.model.step_time
                )
                found = smooth(places, restless)
            paths = paths.with_states(found.means, found.covariances)
        places, states, covariances = places.obeyed(found.means, found.covariances)
        # who is said to be off his way jumps no farther than his boxes do
        return Fitted(
            paths.with_states(states, covariances),
            found.fits + information.constants,
            found.ahead + (states - found.means),
            found.ahead_covariances + (covariances - found.covariances),
            found.traces,
            restless,
            places,
        )

    def _each_camera(self, work: Callable[[int], _T]) -> list[_T]:
        """What some work gives of each camera: the kernels let go of the interpreter."""
        return list(self._threads.map(work, range(len(self.cameras))))

    def _told(
        self,
        paths: Paths,
        owners: Int[ndarray, " N"],
        links: Links,
        learnt: Calibration,
        camera: int,
    ) -> evidence.BoxInformation:
        """What a camera's boxes say of the rows of paths."""
        rows = len(paths.states)
        found = evidence.BoxInformation(np.zeros((rows, 3, 3)), np.zeros((rows, 3)), np.zeros(rows))
        own = links.take(links.cameras == camera)
        seen = self._seen(
            camera, paths.states[own.rows], paths.covariances[own.rows], owners[own.rows], learnt
        )
        # who stands behind the lens cannot have made the box
        shares = np.where(seen.valid, own.shares, 0.0)
        evidence.add_information(
            evidence.BoxLinks(own.rows, own.boxes, shares),
            paths.states,
            paths.covariances,
            seen.expected,
            learnt.measured(camera, self.cameras[camera].measurements),
            found,
        )
        clutter = self.model.clutter[camera] * self.cameras[camera].clutter_factors[own.boxes]
        log_hit = np.log(self.parameters.detection_probability / clutter)
        found.constants[:] += np.bincount(own.rows, own.shares * log_hit, rows)
        return found

    def pinned(self, paths: Paths) -> tuple[Int[ndarray, " K"], list[Correction]]:
        """The rows of paths that somebody said is there, each of one correction: of two the
        later."""
        if not self._here:
            return np.zeros(0, dtype=np.int64), []
        whereabouts = Whereabouts(paths.steps, paths.states[:, :3])
        rows: dict[int, Correction] = {}
        for one in self._here:
            row = whereabouts.stated(one)
            if row is not None:
                rows[row] = one
        return np.array(list(rows), dtype=np.int64), list(rows.values())

    def stated(self, paths: Paths) -> Calibration:
        """The boxes as stage 1 states them, for some paths."""
        return Calibration.none(len(paths.labels), len(self.cameras), self.model.target.size)

    def share(
        self,
        paths: Paths,
        existences: Float[ndarray, " N"] | None = None,
        learnt: Calibration | None = None,
    ) -> Shared:
        """Which path made which box, at every step, given where all paths lie.

        Association marginals by belief propagation, with the fusion's detection probabilities:
        people behind people, the picture's edge.
        """
        steps, owners = paths.steps, paths.owners
        order = np.argsort(steps, kind="stable")
        learnt = learnt or self.stated(paths)
        rows = evidence.Rows(
            paths.states,
            paths.covariances,
            np.ones(len(steps)) if existences is None else existences,
            paths.labels[owners],
            order,
            np.searchsorted(steps[order], np.arange(self.frames + 1)),
        )

        def of_camera(c: int) -> evidence.SharedCamera:
            camera = self.cameras[c]
            found: evidence.SharedCamera = evidence.share_camera(
                rows,
                evidence.CameraSteps(
                    camera.starts,
                    camera.blind,
                    learnt.measured(c, camera.measurements),
                    self.model.clutter[c] * camera.clutter_factors,
                ),
                self._seen(c, paths.states, paths.covariances, owners, learnt),
                self.model.cameras[c].calibration.image_size,
                self._rule,
            )
            return found

        shared = self._each_camera(of_camera)
        return Shared(
            Links.joined(
                [
                    Links(np.full(len(one.links.rows), c, dtype=np.int64), *one.links)
                    for c, one in enumerate(shared)
                ]
            ),
            np.array([one.detection_probabilities for one in shared]),
            np.array([one.missed for one in shared]),
            np.array([one.hidden_by for one in shared]),
        )

    def _seen(
        self,
        camera: int,
        states: ndarray,
        covariances: ndarray,
        people: ndarray,
        learnt: Calibration,
    ) -> SeenBoxes:
        """What a camera should give of states that are those of ``people``."""
        found = self.model.target.expected(self.model.cameras[camera], states, covariances)
        values = found.expected.values + learnt.shift(camera, people, found)
        return SeenBoxes(
            found.expected._replace(values=values), found.boxes, found.depths, found.valid
        )

    def learn(self, paths: Paths, links: Links, learnt: Calibration) -> Calibration:
        """What the boxes say of themselves, given where the paths lie: a step of EM.

        Sizes and offsets are means of the residuals of boxes that are somebody's, drawn
        towards 0 by their priors; the noise is the median of r² + H P Hᵀ over its stated value.
        """
        size, owners = self.model.target.size, paths.owners
        u, w = upright(size), lower(size)
        people = len(paths.labels)
        witness = np.ones(len(paths.states), dtype=bool)
        witness[self.pinned(paths)[0]] = False  # somebody knows better than the boxes there
        told, count = np.zeros(people), np.zeros(people)
        offsets, noises = np.zeros_like(learnt.offsets), learnt.noises.copy()
        for c, camera in enumerate(self.cameras):
            own = links.take((links.cameras == c) & (links.shares > _SURE) & witness[links.rows])
            expected = self.model.target.expected(
                self.model.cameras[c], paths.states[own.rows], paths.covariances[own.rows]
            )
            half = np.maximum((expected.boxes[:, 3] - expected.boxes[:, 1]) / 2.0, 1.0)
            plain = camera.measurements.values[own.boxes] - expected.expected.values
            whole = expected.valid & free(expected).all(axis=1)
            left = (plain - learnt.shift(c, owners[own.rows], expected)) / half[:, None]
            # a box of another posture is no witness of a person's height
            whole &= (np.abs(left) < ODD).all(axis=1)
            if not whole.any():
                continue
            rows, plain, half = owners[own.rows[whole]], plain[whole], half[whole]
            shares = plain / half[:, None]
            shares -= learnt.shifts[rows, None] * w
            rest = shares - learnt.sizes[rows, None] * u
            offsets[c] = rest.sum(axis=0) / (len(rest) + OFFSET_RIDGE)
            if size >= 3:
                taller = shares - offsets[c]
                told += np.bincount(rows, (taller @ u) / (u @ u), people)
                count += np.bincount(rows, minlength=people)
            if len(rest) >= FEWEST:
                h = expected.jacobians[whole][:, :, :3]
                p = paths.covariances[own.rows[whole]][:, :3, :3]
                spread = np.einsum("lpa,lab,lpb->lp", h, p, h)
                own_noise = np.diagonal(
                    camera.measurements.noises[own.boxes[whole]], axis1=1, axis2=2
                )
                square = (half[:, None] * left[whole]) ** 2
                ratio = np.median(square / own_noise) / _MEDIAN + np.median(spread / own_noise)
                alike = _alike(own.rows[whole], owners, left[whole])
                noises[c] = np.clip(
                    np.sqrt(ratio * (1.0 + alike) / (1.0 - alike)), NARROWEST, WIDEST
                )
        return Calibration(told / (count + SIZE_RIDGE), offsets, noises, learnt.shifts)

    def placed(self, paths: Paths, learnt: Calibration) -> Calibration:
        """What marked boxes say of paths that were fitted with it: how low each one's boxes lie."""
        half_extents = self._sequence.target_half_extents
        found = shifts(self._marks, self.model.cameras, half_extents, paths)
        return replace(learnt, shifts=learnt.shifts + found)


def _smoothed(
    paths: Paths,
    begins: Float[ndarray, "n d"],
    information: evidence.BoxInformation,
    rule: passes.PathMotion,
    places: Stated,
    restless: Float[ndarray, " N"],
) -> passes.SmoothedRows:
    """The rows of paths by their boxes and by what somebody said of their places."""
    matrices, vectors = places.information(information.matrices, information.vectors)
    found: passes.SmoothedRows = passes.smooth_paths(
        paths.starts, begins, matrices, vectors, rule, restless
    )
    return found


def _alike(
    rows: Int[ndarray, " L"], owners: Int[ndarray, " N"], residuals: Float[ndarray, "L m"]
) -> float:
    """ρ, the correlation of the errors of a path's boxes in consecutive steps, 0 … 0.95.

    A mean of errors that follow e' = ρ e + v varies (1 + ρ)/(1 − ρ) times as much as one of
    independent errors of the same size: that factor on R lets a filter that takes them as
    independent trust the boxes as far as they deserve.
    """
    order = np.argsort(rows, kind="stable")
    rows, residuals = rows[order], residuals[order]
    next_step = (np.diff(rows) == 1) & (np.diff(owners[rows]) == 0)
    if next_step.sum() < FEWEST:
        return 0.0
    here, after = residuals[:-1][next_step], residuals[1:][next_step]
    correlation = (here * after).sum() / np.sqrt((here**2).sum() * (after**2).sum() + 1e-300)
    return float(np.clip(correlation, 0.0, 0.95))
