"""What smoothing must hold whatever the recording: least squares, covariances, symmetries."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from tests.engine.synthetic import CAMERAS, crossing, sequence, walk
from tracker import pipeline
from tracker.filters.models import Motion
from tracker.kernels.smoothing import passes
from tracker.parameters import RunParameters, with_values
from tracker.sequences.sequence import Detections, Sequence
from tracker.smoothing import create
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.smoother import START_SIGMA, Smoother

STEPS = 40
PLAIN = with_values(
    RunParameters(single_view="none"), {"fusion.posture_share": 0.0, "smoothing.learning": False}
)


SETTLED = with_values(RunParameters(single_view="none"), {"smoothing_method": "identities"})


def one_walker(steps: int = STEPS, seed: int = 0) -> Sequence:
    """Somebody who walks through the room alone."""
    return sequence([(0, walk((-1.0, 0.2, 1.0), (0.9, -0.3, 1.1), steps, sway=0.4))], steps,
                    seed=seed)  # fmt: skip


def smoother_of(whole: Sequence, parameters: RunParameters = PLAIN) -> Smoother:
    """With the boxes as stage 1 hands them on."""
    run = pipeline.compute(whole, with_values(parameters, {"smoothing_method": "none"}))
    return Smoother(whole, parameters.fusion, run.views, learning=parameters.smoothing.learning)


def alone(smoother: Smoother) -> tuple[Paths, Links]:
    """A path in the middle of the room, whose every box is its own."""
    rows, boxes, cameras = [], [], []
    for c, camera in enumerate(smoother.cameras):
        for step in range(smoother.frames):
            for box in range(camera.starts[step], camera.starts[step + 1]):
                rows.append(step)
                boxes.append(box)
                cameras.append(c)
    states = np.zeros((smoother.frames, 6))
    states[:, 2] = 1.0
    paths = Paths.of([1], [0], [states], [np.tile(np.eye(6), (len(states), 1, 1))], 6)
    links = Links(np.array(cameras), np.array(rows), np.array(boxes), np.ones(len(rows)))
    return paths, links


def test_a_target_without_clutter_is_where_the_least_squares_over_all_boxes_put_it() -> None:
    smoother = smoother_of(one_walker(12))
    paths, links = alone(smoother)
    found = smoother.fit(paths, links, iterations=8).paths.states
    motion, steps = smoother.model.motion, smoother.frames
    whiten = np.linalg.inv(np.linalg.cholesky(motion.noise))
    prior = np.concatenate([np.full(3, START_SIGMA), np.full(3, motion.start_velocity)])

    def residuals(unknown: ndarray) -> ndarray:
        states = unknown.reshape(steps, 6)
        # the prior's middle is where the last fit began
        parts = [(states[0] - [*found[0, :3], 0.0, 0.0, 0.0]) / prior]
        for before, after in itertools.pairwise(states):
            parts.append(whiten @ (after - motion.transition @ before))
        for c, camera in enumerate(smoother.cameras):
            own = links.take(links.cameras == c)
            expected = smoother.model.target.expected(smoother.model.cameras[c], states[own.rows])
            for value, box in zip(expected.expected.values, own.boxes, strict=True):
                factor = np.linalg.inv(np.linalg.cholesky(camera.measurements.noises[box]))
                parts.append(factor @ (camera.measurements.values[box] - value))
        return np.concatenate(parts)

    best = least_squares(residuals, found.ravel() + 0.01, x_scale="jac", xtol=1e-12).x
    assert_allclose(found[:, :3], best.reshape(steps, 6)[:, :3], atol=2e-5)


def test_looking_back_never_raises_a_covariance() -> None:
    smoother = smoother_of(one_walker())
    paths, links = alone(smoother)
    # half of the boxes are missing, at random
    links = links.take(np.random.default_rng(1).random(len(links.rows)) < 0.5)
    fitted = smoother.fit(paths, links, iterations=3)
    after = np.trace(fitted.paths.covariances[:, :3, :3], axis1=1, axis2=2)
    assert (after <= fitted.traces * (1.0 + 1e-9) + 1e-12).all()
    assert after.sum() < 0.9 * fitted.traces.sum()
    assert np.linalg.eigvalsh(fitted.paths.covariances).min() > 0.0


@pytest.mark.parametrize("seed", range(3))
def test_the_smoothed_people_are_known_better_than_the_filters(seed: int) -> None:
    whole = sequence(crossing(STEPS), STEPS, clutter_rate=0.3, seed=seed)
    run = pipeline.compute(whole, with_values(PLAIN, {"smoothing_method": "positions"}))
    filtered = {
        (f, i): s.sum()
        for f, i, s in zip(
            run.filtered.frames, run.filtered.ids, run.filtered.sigmas**2, strict=True
        )
    }
    smoothed = {
        (f, i): s.sum()
        for f, i, s in zip(run.tracks.frames, run.tracks.ids, run.tracks.sigmas**2, strict=True)
    }
    both = filtered.keys() & smoothed.keys()
    assert len(both) > 60
    assert sum(smoothed[key] for key in both) <= sum(filtered[key] for key in both)


@pytest.mark.parametrize("size", [3, 6])
def test_without_boxes_a_path_is_only_predicted(size: int) -> None:
    rng = np.random.default_rng(0)
    transition = np.eye(size)
    noise, prior = 0.01 * np.eye(size), np.eye(size)
    begin = rng.normal(size=(1, size))
    starts = np.array([0, 5])
    found = passes.smooth_paths(
        starts,
        begin,
        np.zeros((5, 3, 3)),
        np.zeros((5, 3)),
        passes.PathMotion(transition, noise, prior),
        np.ones(5),
    )
    assert_allclose(found.means, np.tile(begin, (5, 1)), atol=1e-12)
    assert_allclose(found.covariances[-1], prior + 4 * noise, atol=1e-12)
    assert not found.fits.any()
    jumps = passes.jumps(
        starts, found.means, found.covariances, found.ahead, found.ahead_covariances
    )
    assert_allclose(jumps, 0.0, atol=1e-9)


def reversed_in_time(whole: Sequence) -> Sequence:
    """The last step first."""
    views = []
    for view in whole.views:
        assert view.detections is not None
        d = view.detections
        frames = whole.frames - 1 - d.frames
        order = np.argsort(frames, kind="stable")
        views.append(
            replace(view, detections=Detections(frames[order], d.boxes[order], d.scores[order]))
        )
    return replace(whole, views=tuple(views), digest=f"{whole.digest}-reversed")


def test_a_path_seen_backwards_is_the_same_path() -> None:
    whole = one_walker()
    found = []
    for one in (whole, reversed_in_time(whole)):
        smoother = smoother_of(one)
        found.append(smoother.fit(*alone(smoother), iterations=5).paths.states[:, :3])
    # only what is known of the first velocity tells the directions apart
    assert_allclose(found[0][3:-3], found[1][::-1][3:-3], atol=2e-3)


def test_cameras_in_another_order_tell_the_same() -> None:
    whole = sequence(crossing(STEPS), STEPS, clutter_rate=0.3)
    run = pipeline.compute(whole, SETTLED)
    shuffled = [2, 0, 1]
    other = replace(whole, views=tuple(whole.views[c] for c in shuffled), digest="shuffled")
    # the filter's order of cameras matters to the filter; the smoothing is given the same tracks
    views = [tuple(step[c] for c in shuffled) for step in run.views]
    fused = [
        replace(
            result,
            sources=result.sources[shuffled],
            source_weights=result.source_weights[shuffled],
            hidden_by=result.hidden_by[shuffled],
            detection_probabilities=result.detection_probabilities[shuffled],
            associations=replace(
                result.associations,
                cameras=np.argsort(shuffled)[result.associations.cameras].astype(np.int32),
            ),
        )
        for result in run.fused
    ]
    one = create(whole, run.parameters).smooth(run.views, run.fused)
    two = create(other, run.parameters).smooth(views, fused)
    assert one is not None
    assert two is not None
    assert one.labels.tolist() == two.labels.tolist()
    assert one.frames.tolist() == two.frames.tolist()
    assert_allclose(one.means, two.means, atol=1e-8)
    assert_allclose(one.existences, two.existences, atol=1e-8)
    assert (one.seen == two.seen[:, np.argsort(shuffled)]).all()


def test_labels_in_another_order_name_the_same_people() -> None:
    whole = sequence(crossing(STEPS), STEPS, clutter_rate=0.3)
    run = pipeline.compute(whole, SETTLED)
    highest = max(int(result.posterior.labels.max(initial=0)) for result in run.fused)

    def other(labels: ndarray) -> ndarray:
        return np.where(labels >= 0, highest + 1 - labels, labels)

    fused = [
        replace(
            result,
            posterior=replace(result.posterior, labels=other(result.posterior.labels)),
            hidden_by=other(result.hidden_by),
        )
        for result in run.fused
    ]
    one = create(whole, run.parameters).smooth(run.views, run.fused)
    two = create(whole, run.parameters).smooth(run.views, fused)
    assert one is not None
    assert two is not None
    rows = np.lexsort((other(two.labels), two.frames))
    assert one.frames.tolist() == two.frames[rows].tolist()
    assert one.labels.tolist() == other(two.labels)[rows].tolist()
    assert_allclose(one.means, two.means[rows], atol=1e-8)


@pytest.mark.parametrize("method", ["positions", "identities"])
@pytest.mark.parametrize("fusion", ["multi_bernoulli", "sequential_phd"])
@pytest.mark.parametrize("cameras", [1, 3])
def test_nobody_is_reported_before_the_first_or_after_the_last_evidence(
    method: str, fusion: str, cameras: int
) -> None:
    path = walk((-1.2, 0.0, 1.0), (1.0, 0.3, 1.0), 30)
    # he is not seen at all in the first and the last steps, nor in the middle
    gone = [(c, 0, range(first, last)) for c in range(cameras)
            for first, last in ((0, 5), (14, 18), (26, 30))]  # fmt: skip
    whole = sequence([(2, path)], 40, CAMERAS[:cameras], hidden=[
        (c, p, range(s.start + 2, s.stop + 2)) for c, p, s in gone])  # fmt: skip
    values = {"smoothing_method": method, "fusion_method": fusion}
    run = pipeline.compute(whole, with_values(RunParameters(single_view="none"), values))
    seen = [
        int(view.detections.frames.min()) for view in whole.views if view.detections is not None
    ]
    last = max(int(v.detections.frames.max()) for v in whole.views if v.detections is not None)
    assert len(run.tracks)
    assert run.tracks.frames.min() >= min(seen)
    assert run.tracks.frames.max() <= last
    if cameras > 1:
        assert run.tracks.frames.min() == min(seen)
        # the gap in the middle is filled from both sides
        assert len(run.tracks) == last - min(seen) + 1
        assert set(run.tracks.ids.tolist()) == {1}


@pytest.mark.parametrize("precision", [1e5, 1e7, 1e9])
@pytest.mark.parametrize("step", [1 / 60, 0.5])
def test_boxes_however_precise_leave_covariances_positive(step: float, precision: float) -> None:
    rng = np.random.default_rng(7)
    motion = Motion.of(PLAIN.fusion, step)
    rule = passes.PathMotion(motion.transition, motion.noise, np.diag([100.0] * 3 + [0.5] * 3))
    for _ in range(20):
        rows, place = 30, rng.uniform(-3.0, 3.0, 3)
        information = np.zeros((rows, 3, 3))
        for row in np.flatnonzero(rng.random(rows) < 0.7):
            for _ in range(int(rng.integers(1, 3))):  # each camera knows nothing along its ray
                ray = rng.normal(size=3)
                ray /= np.linalg.norm(ray)
                information[row] += precision * (np.eye(3) - np.outer(ray, ray))
        begin = np.append(place + rng.normal(size=3), np.zeros(3))
        found = passes.smooth_paths(
            np.array([0, rows]), begin[None], information, information @ place, rule,
            np.full(rows, 10.0 ** rng.uniform(-3.0, 0.0)),
        )  # fmt: skip
        assert np.linalg.eigvalsh(found.covariances).min() > 0.0
        assert_allclose(found.means[:, :3], np.tile(place, (rows, 1)), atol=1.0)
