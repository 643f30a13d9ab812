"""Batch estimation with the fusion's models: states given associations, associations given states.

[BH46] Bayley, Hammersley, "The 'effective' number of independent observations in an autocorrelated
time series", Supplement to the Journal of the Royal Statistical Society 8(2), 1946.

[SS82] Shumway, Stoffer, "An approach to time series smoothing and forecasting using the EM
algorithm", Journal of Time Series Analysis 3(4), 1982.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from collections.abc import Sequence as Many
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections import Correction
from tracker.corrections.lookup import TrackIndex
from tracker.fusion.model import FusionModel
from tracker.kernels.kalman import Measurements
from tracker.kernels.measurement import ExpectedBoxes
from tracker.kernels.smoothing import evidence, passes
from tracker.kernels.smoothing.passes import SmoothedRows, drives, sums_around
from tracker.parameters.groups.fusion import FusionParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.bodies import (
    MOST_ROWS,
    BodyPriors,
    BoxTops,
    RowBoxes,
    estimate_bodies,
    standing_heights,
)
from tracker.smoothing.calibration import (
    FEWEST,
    NARROWEST,
    ODD,
    OFFSET_RIDGE,
    OFFSET_SIGMA,
    SIZE_RIDGE,
    SIZE_SIGMA,
    WIDEST,
    Calibration,
    Marks,
    free,
    lower,
    shifts,
    upright,
)
from tracker.smoothing.camera_errors import CameraErrors, estimate_camera_errors
from tracker.smoothing.noise import (
    LEAST_ROWS,
    NoiseModel,
    NoiseSample,
    PersistentErrors,
    SureBoxes,
    choose_rows,
    common_variance,
    estimate_noise,
)
from tracker.smoothing.paths import CameraBoxes, Links, Paths
from tracker.smoothing.place_constraints import PlaceMeasurements
from tracker.steps import Steps

_T = TypeVar("_T")

# The sensitivities below are those of ``tests/papers/rooms/fusion_constants.md``.
START_SIGMA = 10.0
"""Prior standard deviation of a path's first position along each axis, metres. Halved or doubled,
it changes mean recall by at most 0.001, mean IDF1 by 0.002 and the error of positions by 2 mm."""

_AT_ONCE = 1024
"""Number of rows, steps or boxes whose expected boxes are in memory at a time, per thread: with
all their derivatives these take more than the paths."""

_MOST_THREADS = 4
"""Largest number of threads, each of one camera or one block of rows."""

_LEAST_SHARE = 0.01
"""Association probability below which a pair is left out, as in the result of the fusion. Halved,
it changes mean IDF1 by 0.001; with 0.05 recall rises and IDF1 falls, no more than they scatter."""

_CALIBRATION_SHARE = 0.9
"""Least association probability of a box that is used for the self-calibration. From 0.5 to 0.97 it
changes mean recall by at most 0.0003, mean IDF1 by 0.003, and the error of positions by 1 mm."""

_NOISE_SHARE = 0.5
"""Least association probability of a box by which the noise is estimated: it is likelier the
track's than not. At 0.25 and 0.75 the mean share of positions within the reported ellipse of 95 %
changes by 0.004 at most."""

_MEDIAN = 0.4549
"""Median of χ² with one degree of freedom, 0.6745²."""

_SCALE_TIME = 8.0
"""Time constant with which the process-noise scale of a path changes, seconds. Halved or doubled,
it changes mean recall and IDF1 by at most 0.001, and the error of positions by at most 2 mm."""

_SCALE_PRIOR = 0.5
"""Weight of the prior s = 1 of the process-noise scale, seconds of a path. Halved or doubled, it
changes mean recall by at most 0.001, and nothing else by as much."""

_LARGEST_RATIO = 2.0
"""Bound of the contribution of one step, as a factor on the previous scale, so that a single turn
or a wrong association does not raise the scale. With 1.5 mean recall falls by 0.001 and IDF1 by
0.004; without a bound mean recall changes by less than 0.001, and in crowds IDF1 by 0.006, a
quarter of its standard error."""


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Paths fitted to their boxes, with N rows."""

    paths: Paths
    """The smoothed paths."""
    odds: Float[ndarray, " N"]
    """Log likelihood ratio of each row's boxes, given the rows before, against clutter."""
    ahead: Float[ndarray, "N d"]
    """Prediction of each row's state from the rows before, metres and seconds."""
    ahead_covariances: Float[ndarray, "N d d"]
    """Covariance of the prediction."""
    traces: Float[ndarray, " N"]
    """Trace of the position's filtered covariance, before the backward pass, square metres."""
    noise_scales: Float[ndarray, " N"]
    """s: factor on the process noise of the step to each row."""
    places: PlaceMeasurements = field(
        default_factory=lambda: PlaceMeasurements.of(np.zeros(0, dtype=np.int64), ())
    )
    """The constraints of places, with their inflated noise."""

    def without_predictions(self) -> Fitted:
        """The same without the predictions, which take as much memory as the paths."""
        nothing = self.paths.without_states()
        return replace(self, ahead=nothing.states, ahead_covariances=nothing.covariances)

    @property
    def jumps(self) -> Float[ndarray, " N"]:
        """Squared Mahalanobis distance between the estimates from the rows before and from then
        on."""
        paths = self.paths
        found: ndarray = passes.jumps(
            paths.starts, paths.states, paths.covariances, self.ahead, self.ahead_covariances
        )
        return found


@dataclass(frozen=True, slots=True, eq=False)
class BoxAssociations:
    """The association of the boxes of all steps and C cameras with the N rows of paths."""

    links: Links
    """Association probabilities of rows and boxes."""
    chances: Float[ndarray, "C N"]
    """p_D of each row in each camera."""
    missed: Float[ndarray, "C N"]
    """Probability that the camera has no box of the path at the row."""
    hidden_by: Int[ndarray, "C N"]
    """Label of the track that occludes the row, -1 for none."""


class _Linearised(NamedTuple):
    """What boxes and constraints say of n paths, with N rows."""

    begins: Float[ndarray, "n d"]
    """Prior mean of each path's first state."""
    information: evidence.BoxInformation
    """The information of the boxes on each row."""
    places: PlaceMeasurements
    """The constraints of places."""


class _Iterated(NamedTuple):
    """One iteration of the fit of paths to their boxes, with N rows."""

    rows: passes.SmoothedRows
    """The smoothed rows."""
    constants: Float[ndarray, " N"]
    """Log likelihood of each row's boxes where they are linearised, against clutter."""
    places: PlaceMeasurements
    """The constraints of places, with their inflated noise."""
    noise_scales: Float[ndarray, " N"]
    """Factor on the process noise of the step to each row."""


class _Residuals(NamedTuple):
    """L boxes of one camera with a clear association, for the self-calibration."""

    rows: Int[ndarray, " L"]
    """Row of the paths of each box."""
    plain: Float[ndarray, "L m"]
    """Measurement less what is expected without calibration, pixels."""
    half_heights: Float[ndarray, " L"]
    """Half height of the expected box, pixels."""
    left: Float[ndarray, "L m"]
    """Residual with the calibration before, half heights."""
    spreads: Float[ndarray, "L m"]
    """Variance of the expected measurement, H P Hᵀ, squared pixels."""
    noises: Float[ndarray, "L m"]
    """Variance of the measurement, R, squared pixels."""


class Reported(NamedTuple):
    """What is reported of N rows of paths: how far their positions may be off."""

    noise: NoiseModel
    """The noise of the boxes."""
    common: float
    """The variance that all cameras have in common, m²."""
    covariances: Float[ndarray, "N d d"]
    """The covariances of the states."""
    learnt: Calibration
    """The self-calibration with the shape of bodies."""
    cameras: CameraErrors
    """The errors of each camera apart."""


class Smoother:
    """Batch estimation of paths over a recording, with the models of the fusion.

    :meth:`fit` estimates the states of paths given the association of boxes (a Kalman smoother),
    :meth:`associate` the association given the states (belief propagation), and :meth:`learn` the
    self-calibration of the boxes. Alternating them is coordinate ascent, as EM [SS82].
    """

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
        """Prepare the boxes of some steps from step 0 on.

        Args:
            sequence: The cameras and the room.
            parameters: The parameters of the fusion.
            views: The results of stage 1 for each step.
            corrections: The user's corrections, of which those of kind ``here`` measure a place.
            learning: Whether the scale of the process noise is estimated; else it is 1.
            several_boxes: Whether stage 1 may give several boxes of a person in one camera.
        """
        self._learning, self.several_boxes = learning, several_boxes
        self._sequence = sequence
        self._marks = Marks.of(sequence)
        self._threads = ThreadPoolExecutor(min(len(sequence.views), _MOST_THREADS))
        self.parameters = parameters
        self._here = [one for one in corrections if one.kind == "here"]
        self.model = model = FusionModel(sequence, parameters)
        seen = Steps.of(views, ViewResult, len(model.cameras))
        self.frames = len(seen)
        self.cameras = [
            CameraBoxes.of(seen, c, model.target, parameters.measurement_sigma)
            for c in range(len(model.cameras))
        ]
        motion = model.motion
        self._rule = model.camera_rule(_LEAST_SHARE)
        self.prior = np.zeros((motion.dimension, motion.dimension))
        self.prior[:3, :3] = START_SIGMA**2 * np.eye(3)
        self.prior[3:, 3:] = max(motion.start_velocity, 1e-6) ** 2 * np.eye(motion.dimension - 3)
        size = model.room.maximum - model.room.minimum
        self.log_place = float(
            1.5 * np.log(2.0 * np.pi) + 3.0 * np.log(START_SIGMA) - np.log(np.prod(size))
        )
        """Log ratio of the uniform density over the room and the prior density of a first position.
        """

    def fit(
        self, paths: Paths, links: Links, iterations: int = 1, learnt: Calibration | None = None
    ) -> Fitted:
        """Estimate the states of every path given its boxes, by iterated Kalman smoothing.

        Each iteration linearises the projection at the states of the one before: the Gauss-Newton
        method for the least-squares solution over the whole path (Bell, "The iterated
        Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4(3), 1994). A box with
        association probability a contributes a times its information, and the process noise has
        the scale that is estimated around each step.

        Args:
            paths: n paths, at whose states the projection is linearised first.
            links: Association probabilities of rows and boxes.
            iterations: Number of iterations, at least 1.
            learnt: The self-calibration of the boxes; None for none.
        """
        learnt = learnt or self.uncalibrated(paths)
        by_camera = self._by_row(links)
        del links
        scales = np.ones(len(paths.states))
        for turn in range(iterations):
            linear = self._linearised(paths, by_camera, learnt)
            # there are the states of one iteration at a time, and one forward pass
            paths = paths.without_states()
            found = self._iterated(paths.starts, linear, scales)
            if turn + 1 < iterations:
                scales = found.noise_scales
                paths = paths.with_states(found.rows.means, found.rows.covariances)
                del found
        return _enforce_places(paths, found)

    def _linearised(self, paths: Paths, by_camera: list[Links], learnt: Calibration) -> _Linearised:
        """What the boxes and constraints say of paths, linearised at their states."""
        begins = paths.states[paths.starts[:-1]].copy()
        begins[:, 3:] = 0.0
        places = PlaceMeasurements.of(*self.rows_with_places(paths))
        return _Linearised(begins, self._information(paths, by_camera, learnt), places)

    def _iterated(
        self, starts: Int[ndarray, " n1"], linear: _Linearised, scales: Float[ndarray, " N"]
    ) -> _Iterated:
        """Smooth paths given their boxes.

        Args:
            starts: Index of each path's first row, and N at the end.
            linear: What boxes and constraints say of them.
            scales: Factor on the process noise of the step to each row, so far.
        """
        motion, places = self.model.motion, linear.places
        rule = passes.PathMotion(motion.transition, motion.noise, self.prior)
        smooth = partial(_smooth_with_places, starts, linear.begins, linear.information, rule)
        found = smooth(places, scales)
        inflated = places.inflate(found.means, found.covariances)
        if inflated.contradicted:
            places = inflated
            del found
            found = smooth(places, scales)
        if self._learning:
            scales = process_noise_scales(starts, found, motion.noise, scales, self.model.step_time)
            del found
            found = smooth(places, scales)
        return _Iterated(found, linear.information.constants, places, scales)

    def _by_row(self, links: Links) -> list[Links]:
        """The links of each camera in the order of their rows, those of one row as they were."""
        found = []
        for camera in range(len(self.cameras)):
            own = np.flatnonzero(links.cameras == camera)
            found.append(links.take(own[np.argsort(links.rows[own], kind="stable")]))
        return found

    def _information(
        self, paths: Paths, by_camera: list[Links], learnt: Calibration
    ) -> evidence.BoxInformation:
        """Compute the information of all boxes on the rows of paths, some rows at a time."""
        rows, owners = len(paths.states), paths.owners
        found = evidence.BoxInformation(np.empty((rows, 3, 3)), np.empty((rows, 3)), np.empty(rows))
        bounds = [
            np.searchsorted(own.rows, range(0, rows + _AT_ONCE, _AT_ONCE)) for own in by_camera
        ]

        def of_block(block: int) -> None:
            within = slice(block * _AT_ONCE, min((block + 1) * _AT_ONCE, rows))
            parts = [
                self._camera_information(
                    paths, owners, own.take(slice(*ends[block : block + 2])), learnt, c, within
                )
                for c, (own, ends) in enumerate(zip(by_camera, bounds, strict=True))
            ]
            for whole, each in zip(found, zip(*parts, strict=True), strict=True):
                whole[within] = np.sum(each, axis=0)

        for _ in self._threads.map(of_block, range(-(-rows // _AT_ONCE))):
            pass
        return found

    def _each_camera(self, work: Callable[[int], _T]) -> list[_T]:
        """Run a function for each camera in threads: the kernels release the interpreter's lock."""
        return list(self._threads.map(work, range(len(self.cameras))))

    def _camera_information(
        self,
        paths: Paths,
        owners: Int[ndarray, " N"],
        own: Links,
        learnt: Calibration,
        camera: int,
        within: slice,
    ) -> evidence.BoxInformation:
        """Compute the information of one camera's boxes on some rows of paths.

        Args:
            paths: The paths, with N rows.
            owners: Path of each row.
            own: The links of these rows to the camera's boxes.
            learnt: The self-calibration of the boxes.
            camera: Index of the camera.
            within: The rows.
        """
        rows, boxes = within.stop - within.start, self.cameras[camera]
        found = evidence.BoxInformation(np.zeros((rows, 3, 3)), np.zeros((rows, 3)), np.zeros(rows))
        if not len(own.rows):
            return found
        seen = self._seen(
            camera, paths.states[own.rows], paths.covariances[own.rows], owners[own.rows], learnt
        )
        # a state behind the lens has no box
        shares = np.where(seen.valid, own.shares, 0.0)
        place = own.rows - within.start
        evidence.add_information(
            evidence.BoxLinks(place, np.arange(len(place)), shares),
            paths.states[within],
            paths.covariances[within],
            seen.expected,
            learnt.measured(camera, boxes.measurements(own.boxes)),
            found,
        )
        clutter = self.model.clutter[camera] * boxes.clutter_factors[own.boxes]
        log_hit = np.log(self.parameters.detection_probability / clutter)
        found.constants[:] += np.bincount(place, own.shares * log_hit, rows)
        return found

    def rows_with_places(self, paths: Paths) -> tuple[Int[ndarray, " K"], list[Correction]]:
        """Find the rows of paths whose position a correction states, and the last correction of
        each."""
        if not self._here:
            return np.zeros(0, dtype=np.int64), []
        whereabouts = TrackIndex(paths.steps, paths.states[:, :3])
        rows: dict[int, Correction] = {}
        for one in self._here:
            row = whereabouts.row_of(one)
            if row is not None:
                rows[row] = one
        return np.array(list(rows), dtype=np.int64), list(rows.values())

    def uncalibrated(self, paths: Paths) -> Calibration:
        """Make the calibration that does not change the boxes of stage 1, for some paths."""
        return Calibration.none(len(paths.labels), len(self.cameras), self.model.target.size)

    def associate(
        self,
        paths: Paths,
        existences: Float[ndarray, " N"] | None = None,
        learnt: Calibration | None = None,
    ) -> BoxAssociations:
        """Associate the boxes of every step with the paths, given their states.

        The result has association marginals by belief propagation, with the fusion's detection
        probabilities, which include occlusion and the edge of the image.

        Args:
            paths: n paths, with N rows.
            existences: Prior existence probability of each row; None for 1.
            learnt: The self-calibration of the boxes; None for none.
        """
        steps = paths.steps
        order = np.argsort(steps, kind="stable")
        starts = np.searchsorted(steps[order], np.arange(self.frames + 1))
        del steps
        learnt = learnt or self.uncalibrated(paths)
        shape = len(self.cameras), len(order)
        found = BoxAssociations(
            Links.none(),
            np.zeros(shape),
            np.ones(shape),
            np.full(shape, -1, dtype=np.int64),
        )

        def of_camera(c: int) -> Links:
            parts = []
            for first in range(0, self.frames, _AT_ONCE):
                last = min(first + _AT_ONCE, self.frames)
                rows = order[starts[first] : starts[last]]
                own = self._share_steps(
                    c, paths, existences, learnt, rows, starts[first : last + 1], first
                )
                found.chances[c, rows] = own.detection_probabilities
                found.missed[c, rows] = own.missed
                found.hidden_by[c, rows] = own.hidden_by
                boxes = own.links.boxes + self.cameras[c].starts[first]
                of_links = np.full(len(boxes), c, dtype=np.int64)
                parts.append(Links(of_links, rows[own.links.rows], boxes, own.links.shares))
            return Links.concatenate([Links.none(), *parts])

        return replace(found, links=Links.concatenate(self._each_camera(of_camera)))

    def _share_steps(
        self,
        camera: int,
        paths: Paths,
        existences: Float[ndarray, " N"] | None,
        learnt: Calibration,
        rows: Int[ndarray, " K"],
        starts: Int[ndarray, " T1"],
        first: int,
    ) -> evidence.SharedCamera:
        """Associate the boxes of one camera with the paths at some steps.

        Args:
            camera: Index of the camera.
            paths: n paths, with N rows.
            existences: Prior existence probability of each row; None for 1.
            learnt: The self-calibration of the boxes.
            rows: The K rows at T steps, step after step.
            starts: Index of the first row of each step, as of all rows.
            first: The first of the steps.
        """
        own, owners = self.cameras[camera], paths.owners_of(rows)
        states, covariances = paths.states[rows], paths.covariances[rows]
        last = first + len(starts) - 1
        boxes = slice(int(own.starts[first]), int(own.starts[last]))
        found: evidence.SharedCamera = evidence.share_camera(
            evidence.Rows(
                states,
                covariances,
                np.ones(len(rows)) if existences is None else existences[rows],
                paths.labels[owners],
                np.arange(len(rows)),
                starts - starts[0],
            ),
            evidence.CameraSteps(
                own.starts[first : last + 1] - boxes.start,
                own.blind[first:last],
                learnt.measured(camera, own.measurements(boxes)),
                self.model.clutter[camera] * own.clutter_factors[boxes],
            ),
            self._seen(camera, states, covariances, owners, learnt),
            self.model.cameras[camera].calibration.image_size,
            self._rule,
        )
        return found

    def _seen(
        self,
        camera: int,
        states: ndarray,
        covariances: ndarray,
        people: ndarray,
        learnt: Calibration,
    ) -> ExpectedBoxes:
        """Predict the boxes of states in one camera, with the calibration of each person."""
        found = self.model.target.expected(self.model.cameras[camera], states, covariances)
        values = found.expected.values + self._shift(learnt, camera, states, people, found)
        return found._replace(expected=found.expected._replace(values=values))

    def _shift(
        self,
        learnt: Calibration,
        camera: int,
        states: ndarray,
        people: ndarray,
        expected: ExpectedBoxes,
    ) -> Float[ndarray, "L m"]:
        """The correction that is added to the expected measurements of states, pixels."""
        shift = learnt.shift(camera, people, expected)
        if learnt.radius > 0.0:
            edges = self._body_shifts(camera, states, learnt.radius)[:, 1:3]
            shift[:, 1:3] += edges * free(expected)[:, 1:3]
        return shift

    def _body_shifts(self, camera: int, states: ndarray, radius: float) -> Float[ndarray, "L 4"]:
        """Compute how far the bounds of bodies are from those of their axes, pixels."""
        return self.model.target.body_shifts(self.model.cameras[camera], states, radius)

    def learn(self, paths: Paths, links: Links, learnt: Calibration) -> Calibration:
        """Estimate the self-calibration of the boxes given the paths: an M-step of EM.

        Sizes and offsets are means of the residuals of boxes with a clear association, shrunk
        towards 0 by their priors; the squared noise factor is the median of r² + H P Hᵀ over R.

        Args:
            paths: n paths, fitted to their boxes.
            links: Association probabilities of rows and boxes.
            learnt: The calibration before.
        """
        size, owners = self.model.target.size, paths.owners
        u, w = upright(size), lower(size)
        people = len(paths.labels)
        witness = np.ones(len(paths.states), dtype=bool)
        witness[self.rows_with_places(paths)[0]] = False  # a correction replaces the boxes there
        size_sums, count = np.zeros(people), np.zeros(people)
        offsets, noises = np.zeros_like(learnt.offsets), learnt.noises.copy()
        for c in range(len(self.cameras)):
            own = links.take(
                (links.cameras == c) & (links.shares > _CALIBRATION_SHARE) & witness[links.rows]
            )
            chosen, plain, half, left, spread, own_noise = self._residuals(c, paths, own, learnt)
            if not len(chosen):
                continue
            rows = owners[chosen]
            shares = plain / half[:, None]
            shares -= learnt.shifts[rows, None] * w
            rest = shares - learnt.sizes[rows, None] * u
            offsets[c] = rest.sum(axis=0) / (len(rest) + OFFSET_RIDGE)
            if size >= 3:
                taller = shares - offsets[c]
                size_sums += np.bincount(rows, (taller @ u) / (u @ u), people)
                count += np.bincount(rows, minlength=people)
            if len(rest) >= FEWEST:
                square = (half[:, None] * left) ** 2
                ratio = np.median(square / own_noise) / _MEDIAN + np.median(spread / own_noise)
                alike = _step_correlation(chosen, owners, left)
                noises[c] = np.clip(
                    np.sqrt(ratio * (1.0 + alike) / (1.0 - alike)), NARROWEST, WIDEST
                )
        return Calibration(size_sums / (count + SIZE_RIDGE), offsets, noises, learnt.shifts)

    def _residuals(self, camera: int, paths: Paths, own: Links, learnt: Calibration) -> _Residuals:
        """Compute the residuals of one camera's boxes of people who stand upright."""
        parts = []
        for rows, expected, measured, half, plain, rest in self._compared(
            camera, paths, own, learnt
        ):
            left = rest / half[:, None]
            whole = expected.valid & free(expected).all(axis=1)
            # a box of another posture does not show the person's height
            whole &= (np.abs(left) < ODD).all(axis=1)
            h = expected.jacobians[whole][:, :, :3]
            p = paths.covariances[rows[whole]][:, :3, :3]
            spread = np.einsum("lpa,lab,lpb->lp", h, p, h)
            own_noise = np.diagonal(measured.noises[whole], axis1=1, axis2=2)
            parts.append((rows[whole], plain[whole], half[whole], left[whole], spread, own_noise))
        return _Residuals(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def reported(self, fitted: Fitted, links: Links, learnt: Calibration) -> Reported | None:
        """Estimate the noise of boxes, and the covariances of paths that follow from it.

        The positions do not change. With the shape of bodies they would be displaced by δ: the
        reported covariance is that of the displaced ones plus δ δᵀ.

        Args:
            fitted: The paths, with N rows.
            links: Association probabilities of rows and boxes.
            learnt: The self-calibration of the boxes.

        Returns:
            None where two cameras see too few rows wholly, near their expected boxes, or boxes have
            no height.
        """
        given = fitted.paths
        sure = links.shares > _NOISE_SHARE
        rows = choose_rows(given, np.bincount(links.rows[sure], minlength=len(given.states)))
        if rows is None or self.model.target.size < 3:
            return None
        learnt = self.with_bodies(given, links, learnt)
        if learnt.radius > 0.0:
            fitted = self.fit(given, links, 1, learnt).without_predictions()
        paths = fitted.paths
        chosen = links.take(sure & np.isin(links.rows, rows))
        parts = [*self._sure_boxes(paths, chosen, learnt)]
        seen = SureBoxes(*(np.concatenate(each) for each in zip(*parts, strict=True)))
        if np.count_nonzero(np.bincount(seen.rows) >= 2) < LEAST_ROWS:
            return None
        sample = NoiseSample(
            paths, rows, seen, self.model.motion, fitted.noise_scales, self.model.step_time
        )
        noise = estimate_noise(sample)
        cameras = estimate_camera_errors(sample, noise, learnt.offsets)
        half_height = float(self._sequence.target_half_extents[2])
        covariances = self.fit(paths, links, 1, replace(learnt, noise=noise)).paths.covariances
        errors = PersistentErrors(noise, len(paths.states), half_height)
        for part in self._sure_boxes(paths, links.take(sure), learnt):
            errors.add(own := SureBoxes(*part))
            for camera in np.unique(own.cameras).tolist():  # one, or none
                shifts = self._body_shifts(camera, paths.states[own.rows], learnt.radius)
                errors.add_bodies(own, shifts[:, 0], learnt.level_sigma * shifts[:, 3])
        covariances[:, :3, :3] += errors.covariances(paths)
        displaced = paths.states[:, :3] - given.states[:, :3]
        covariances[:, :3, :3] += displaced[:, :, None] * displaced[:, None]
        common = common_variance(noise, learnt.offsets, half_height)
        covariances[:, [0, 1], [0, 1]] += common
        # there a correction says how sure a position is
        placed = self.rows_with_places(given)[0]
        covariances[placed] = given.covariances[placed]
        return Reported(noise, common, covariances, learnt, cameras)

    def with_bodies(self, paths: Paths, links: Links, learnt: Calibration) -> Calibration:
        """Add to a calibration the shape of people's bodies (:mod:`tracker.smoothing.bodies`).

        Args:
            paths: n paths, fitted with ``learnt``, which has no radius yet.
            links: Association probabilities of rows and boxes.
            learnt: The calibration.
        """
        target, owners = self.model.target, paths.owners
        usable = links.shares > _CALIBRATION_SHARE
        usable &= ~np.isin(links.rows, self.rows_with_places(paths)[0])
        sure = links.take(usable)
        several = np.flatnonzero(np.bincount(sure.rows, minlength=len(paths.states)) >= 2)
        if target.size < 3 or len(several) < LEAST_ROWS:
            return learnt
        stride = -(-len(several) // MOST_ROWS)
        rows = several[::stride]
        seen = RowBoxes.none(owners[rows], len(self.cameras), target.size)
        alike = 0.0
        for camera, lens in enumerate(self.model.cameras):
            own = sure.take(sure.cameras == camera)
            found = self._residuals(camera, paths, own, learnt)
            alike = max(alike, _step_correlation(found.rows, owners, found.left))
            place = np.minimum(np.searchsorted(rows, found.rows), len(rows) - 1)
            used = np.flatnonzero(rows[place] == found.rows)
            states, tall = paths.states[found.rows[used]], found.half_heights[used, None]
            expected = target.expected(lens, states)
            at = place[used], np.full(len(used), camera)
            seen.residuals[at] = found.plain[used] / tall
            # a displacement of all people cannot be distinguished from the cameras' offsets
            seen.residuals[(*at, 0)] -= learnt.offsets[camera, 0]
            seen.jacobians[at] = expected.jacobians[:, :, :3] / tall[:, :, None]
            own_shifts = self._body_shifts(camera, states, target.half_width)
            seen.edges[at] = own_shifts[:, 1:3] / (target.half_width * tall)
            seen.levels[at] = own_shifts[:, 3] / tall[:, 0]
            seen.there[at] = 1.0
        independent = min(1.0, stride * (1.0 - alike) / (1.0 + alike))
        priors = BodyPriors(target.half_width, OFFSET_SIGMA, SIZE_SIGMA)
        shape = estimate_bodies(seen, upright(target.size), len(paths.labels), independent, priors)
        return replace(
            learnt,
            radius=shape.radius,
            level_sigma=shape.level_sigma,
            offsets=learnt.offsets + shape.offsets,
            sizes=learnt.sizes + shape.sizes,
        )

    def heights(
        self, paths: Paths, links: Links, learnt: Calibration, noise: NoiseModel
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Estimate the heights of people above the floor, and their standard deviations, metres.

        An offset of the boxes of all cameras cannot be distinguished from people's heights: only
        the differences between cameras are subtracted. See
        :func:`tracker.smoothing.bodies.standing_heights`.

        Args:
            paths: n paths with the covariances that are reported.
            links: Association probabilities of rows and boxes.
            learnt: The self-calibration of the boxes.
            noise: The noise of the boxes.
        """
        owners = paths.owners
        half_height = float(self._sequence.target_half_extents[2])
        offsets = learnt.offsets[:, 1] - learnt.offsets[:, 1].mean()
        sure, parts = links.take(links.shares > _NOISE_SHARE), []
        for camera in range(len(self.cameras)):
            own = sure.take(sure.cameras == camera)
            for rows, expected, _, half, plain, _ in self._compared(camera, paths, own, learnt):
                slopes = expected.jacobians[:, 1, :3]
                shown = expected.valid & (np.abs(slopes[:, 2]) > 0.0)
                rows, half, slopes = rows[shown], half[shown], slopes[shown]
                rest = plain[shown, 1] - half * (offsets[camera] + learnt.shifts[owners[rows]])
                tops = paths.states[rows, 2] + half_height + rest / slopes[:, 2]
                aside = np.einsum(
                    "la,lab,lb->l", slopes[:, :2], paths.covariances[rows, :2, :2], slopes[:, :2]
                )
                spread = (noise.variances(half)[:, 1] + aside) / slopes[:, 2] ** 2
                parts.append((rows, tops, spread))
        return standing_heights(
            paths,
            BoxTops(*(np.concatenate(each) for each in zip(*parts, strict=True))),
            noise,
            offsets,
            half_height=half_height,
            floor=float(self._sequence.room.minimum[2]),
            step_time=self.model.step_time,
        )

    def _sure_boxes(
        self, paths: Paths, links: Links, learnt: Calibration
    ) -> Iterator[tuple[ndarray, ...]]:
        """The columns of :class:`tracker.smoothing.noise.SureBoxes`, some boxes at a time."""
        for camera in range(len(self.cameras)):
            own = links.take(links.cameras == camera)
            for rows, expected, _, half, _, left in self._compared(camera, paths, own, learnt):
                whole = expected.valid & free(expected).all(axis=1)
                whole &= (np.abs(left) < half[:, None]).all(axis=1)
                jacobians = expected.jacobians[whole][:, :, :3]
                of_camera = np.full(int(whole.sum()), camera)
                yield of_camera, rows[whole], left[whole], jacobians, half[whole]

    def _compared(
        self, camera: int, paths: Paths, own: Links, learnt: Calibration
    ) -> Iterator[tuple[ndarray, ExpectedBoxes, Measurements, ndarray, ndarray, ndarray]]:
        """Compare one camera's boxes with those that are expected of paths, some at a time.

        Args:
            camera: Index of the camera.
            paths: The paths.
            own: Their links to the camera's boxes.
            learnt: The self-calibration of the boxes.

        Yields:
            The rows, the expected boxes, the measurements, the half heights of the expected boxes,
            and the measurements less what is expected without and with the calibration, pixels.
        """
        owners = paths.owners
        for first in range(0, max(len(own.rows), 1), _AT_ONCE):
            rows, boxes = own.rows[first : first + _AT_ONCE], own.boxes[first : first + _AT_ONCE]
            expected = self.model.target.expected(
                self.model.cameras[camera], paths.states[rows], paths.covariances[rows]
            )
            measured = self.cameras[camera].measurements(boxes)
            half = np.maximum((expected.boxes[:, 3] - expected.boxes[:, 1]) / 2.0, 1.0)
            plain = measured.values - expected.expected.values
            yield (
                rows,
                expected,
                measured,
                half,
                plain,
                plain - self._shift(learnt, camera, paths.states[rows], owners[rows], expected),
            )

    def with_shifts(self, paths: Paths, learnt: Calibration) -> Calibration:
        """Add to a calibration the shifts that hand-marked boxes show.

        Args:
            paths: n paths, fitted with ``learnt``.
            learnt: The calibration.
        """
        half_extents = self._sequence.target_half_extents
        found = shifts(self._marks, self.model.cameras, half_extents, paths)
        return replace(learnt, shifts=learnt.shifts + found)


def _enforce_places(paths: Paths, last: _Iterated) -> Fitted:
    """The result of the last iteration, with the constraints of places enforced."""
    found = last.rows
    places, states, covariances = last.places.enforce(found.means, found.covariances)
    ahead, ahead_covariances = found.ahead, found.ahead_covariances
    if states is not found.means:
        # an enforced place is no jump: predictions move along with their rows
        ahead = ahead + (states - found.means)
        ahead_covariances = ahead_covariances + (covariances - found.covariances)
    return Fitted(
        paths.with_states(states, covariances),
        found.fits + last.constants,
        ahead,
        ahead_covariances,
        found.traces,
        last.noise_scales,
        places,
    )


def _smooth_with_places(
    starts: Int[ndarray, " n1"],
    begins: Float[ndarray, "n d"],
    information: evidence.BoxInformation,
    rule: passes.PathMotion,
    places: PlaceMeasurements,
    scales: Float[ndarray, " N"],
) -> passes.SmoothedRows:
    """Smooth paths given the information of their boxes and the constraints of places."""
    matrices, vectors = places.information(information.matrices, information.vectors)
    found: passes.SmoothedRows = passes.smooth_paths(
        starts, begins, matrices, vectors, rule, scales
    )
    return found


def _step_correlation(
    rows: Int[ndarray, " L"], owners: Int[ndarray, " N"], residuals: Float[ndarray, "L m"]
) -> float:
    """Estimate the correlation ρ of the errors of a path's boxes in consecutive steps, 0 … 0.95.

    The variance of a mean of errors that follow e' = ρ e + v is (1 + ρ)/(1 − ρ) times that of
    independent errors of the same size [BH46]: with this factor on R a filter that takes errors as
    independent has the right covariance. Without it the 95 % ellipses hold the truth in 0.90
    instead of 0.93 of the steps of ``cmc2``; with ρ = 0.9 for all, recall of the crowd in
    ``wildtrack-points-300`` falls by 0.03, and its positions are 3 cm farther off.

    Args:
        rows: Row of each of L boxes.
        owners: Path of each of N rows.
        residuals: Residual of each box, half heights.
    """
    order = np.argsort(rows, kind="stable")
    rows, residuals = rows[order], residuals[order]
    next_step = (np.diff(rows) == 1) & (np.diff(owners[rows]) == 0)
    if next_step.sum() < FEWEST:
        return 0.0
    here, after = residuals[:-1][next_step], residuals[1:][next_step]
    correlation = (here * after).sum() / np.sqrt((here**2).sum() * (after**2).sum() + 1e-300)
    return float(np.clip(correlation, 0.0, 0.95))


def process_noise_scales(
    starts: Int[ndarray, " n1"],
    found: SmoothedRows,
    noise: Float[ndarray, "d d"],
    before: Float[ndarray, " N"],
    step_time: float,
) -> Float[ndarray, " N"]:
    """Estimate the scale s of the process noise Q at every row: an M-step of EM [SS82].

    The process noise of the step to row k is w_k ~ N(0, s Q). Given all boxes its mean and
    covariance are

        ŵ = s Q P⁻⁻¹ (m − m⁻),   W = s Q − s Q (P⁻⁻¹ − P⁻⁻¹ P P⁻⁻¹) s Q

    and s is the mean of tr Q⁻¹ (ŵ ŵᵀ + W) / d over the rows of the path, with weights that decay
    exponentially with time, each row's value clipped at twice the previous scale, and with a prior
    of 1. Only the components along x and y are used.

    Args:
        starts: Index of each path's first row, and N at the end.
        found: The rows, smoothed with the scales ``before``.
        noise: Q, the process noise of one step.
        before: s of each row so far.
        step_time: Time between two steps, seconds.
    """
    dimension = found.means.shape[1]
    ground = np.flatnonzero(np.arange(dimension) % 3 < 2)
    on_ground = noise[np.ix_(ground, ground)]
    size = float(len(ground))
    squares = before * size + before**2 * drives(found, on_ground, ground)
    squares = np.minimum(squares, _LARGEST_RATIO * size * before)
    counts = np.full(len(squares), size)
    begins = starts[:-1]
    squares[begins], counts[begins] = 0.0, 0.0  # no step leads to a first row
    kept = float(np.exp(-step_time / _SCALE_TIME))
    prior = _SCALE_PRIOR * size / step_time
    total, count = sums_around(starts, squares, kept), sums_around(starts, counts, kept)
    return np.asarray((prior + total) / (prior + count))
