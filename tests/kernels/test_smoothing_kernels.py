"""Kernels of the smoothing: passes over paths, presence, and what a camera's boxes say of them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.mixtures import random_covariances
from tests.world import PERSON, ring
from tracker.fusion.target_model import TargetModel
from tracker.kernels.association import Convergence, belief_propagation
from tracker.kernels.boxes import Occlusion, hide, inside_probability
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.labelled import CameraRule
from tracker.kernels.smoothing import evidence, passes

seeds = st.integers(0, 2**32 - 1)


# ── passes


class Paths:
    """Two paths of four and one rows, with motion, boxes' information and all in one Gaussian."""

    def __init__(self, seed: int, dimension: int) -> None:
        rng = np.random.default_rng(seed)
        d = dimension
        self.starts = np.array([0, 4, 5])
        self.begins = rng.normal(size=(2, d))
        transition = np.eye(d) + 0.3 * np.eye(d, k=3)
        self.motion = passes.PathMotion(
            transition, random_covariances(rng, 1, d)[0], 4.0 * random_covariances(rng, 1, d)[0]
        )
        slopes = rng.normal(size=(5, 2, 3))
        self.information = slopes.transpose(0, 2, 1) @ slopes  # of rank 2: one camera
        self.information[2] = 0.0
        self.vectors = rng.normal(size=(5, 3)) * (self.information.any(axis=(1, 2))[:, None])
        self.noise_scales = rng.uniform(0.5, 2.0, 5)

    def smoothed(self) -> passes.SmoothedRows:
        """By the kernel."""
        found: passes.SmoothedRows = passes.smooth_paths(
            self.starts, self.begins, self.information, self.vectors, self.motion,
            self.noise_scales,
        )  # fmt: skip
        return found

    def joint(self, path: int, known: int) -> tuple[ndarray, ndarray]:
        """Mean (n, d) and covariance (n, d, n, d) of all rows, by the first ``known``'s boxes."""
        first, last = self.starts[path], self.starts[path + 1]
        f, d, n = self.motion.transition, len(self.motion.prior), last - first
        mean, covariance = np.zeros((n, d)), np.zeros((n, d, n, d))
        mean[0], covariance[0, :, 0] = self.begins[path], self.motion.prior
        for k in range(1, n):
            mean[k] = f @ mean[k - 1]
            for j in range(k):
                covariance[k, :, j] = f @ covariance[k - 1, :, j]
                covariance[j, :, k] = covariance[k, :, j].T
            noise = self.noise_scales[first + k] * self.motion.noise
            covariance[k, :, k] = f @ covariance[k - 1, :, k - 1] @ f.T + noise
        whole, flat = np.zeros((n, d, n, d)), np.zeros((n, d))
        for k in range(known):
            whole[k, :3, k, :3] = self.information[first + k]
            flat[k, :3] = self.vectors[first + k]
        size = n * d
        prior = np.linalg.inv(covariance.reshape(size, size))
        after = np.linalg.inv(prior + whole.reshape(size, size))
        found = after @ (prior @ mean.ravel() + flat.ravel())
        return found.reshape(n, d), after.reshape(n, d, n, d)


@given(seeds, st.sampled_from((3, 6)))
def test_smoothed_rows_are_the_marginals_of_one_large_gaussian(seed: int, dimension: int) -> None:
    paths = Paths(seed, dimension)
    found = paths.smoothed()
    for path in range(2):
        first, last = paths.starts[path], paths.starts[path + 1]
        mean, covariance = paths.joint(path, last - first)
        for k in range(last - first):
            row = first + k
            assert_allclose(found.means[row], mean[k], rtol=1e-6, atol=1e-6)
            assert_allclose(found.covariances[row], covariance[k, :, k], rtol=1e-6, atol=1e-6)
            before, spread = paths.joint(path, k)
            assert_allclose(found.ahead[row], before[k], rtol=1e-6, atol=1e-6)
            assert_allclose(found.ahead_covariances[row], spread[k, :, k], rtol=1e-6, atol=1e-6)
            _, now = paths.joint(path, k + 1)
            assert found.traces[row] == pytest.approx(np.trace(now[k, :3, k, :3]), rel=1e-6)
            # log ∫ N(p; m, P) exp(yᵀp − ½ pᵀYp) dp in information form
            m, p = before[k, :3], spread[k, :3, k, :3]
            y, v = paths.information[row], paths.vectors[row]
            precision = np.linalg.inv(p)
            after = precision @ m + v
            fit = 0.5 * (after @ np.linalg.solve(precision + y, after) - m @ precision @ m)
            fit -= 0.5 * np.linalg.slogdet(np.eye(3) + y @ p)[1]
            assert found.fits[row] == pytest.approx(fit, rel=1e-6, abs=1e-6)


@given(seeds)
def test_jumps_compare_what_is_before_with_what_is_from_here_on(seed: int) -> None:
    paths = Paths(seed, 3)
    paths.information += 0.3 * np.eye(3)
    rows = paths.smoothed()
    found = passes.jumps(
        paths.starts, rows.means, rows.covariances, rows.ahead, rows.ahead_covariances
    )
    assert_array_equal(found[[0, 4]], 0.0)
    for k in range(1, 4):
        # by the boxes from here on alone, of variance P⁻(P⁻ − P)⁻¹P⁻ about P⁻'s mean
        before = rows.ahead_covariances[k]
        spread = before @ np.linalg.inv(before - rows.covariances[k]) @ before
        other = rows.ahead[k] + spread @ np.linalg.solve(before, rows.means[k] - rows.ahead[k])
        offset = other - rows.ahead[k]
        assert found[k] == pytest.approx(offset @ np.linalg.solve(spread, offset), rel=1e-3)


def test_where_nothing_is_learnt_a_jump_stays_finite() -> None:
    covariances = np.tile(np.diag([1.0, 2.0, 6.0]), (2, 1, 1))
    means = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 1.0]])
    found = passes.jumps(np.array([0, 2]), means, covariances, np.zeros((2, 3)), covariances)
    # against 1e-9 of the mean variance, which is 3
    assert_allclose(found, [0.0, 5.0 / 3e-9])


@given(seeds)
def test_drives_are_the_trace_of_their_formula(seed: int) -> None:
    paths, axes = Paths(seed, 6), np.array([0, 1, 3, 4])
    rows = paths.smoothed()
    noise = paths.motion.noise[np.ix_(axes, axes)]
    found = passes.drives(rows, noise, axes)
    for k in range(5):
        inverse = np.linalg.inv(rows.ahead_covariances[k])
        pull = inverse @ (rows.means[k] - rows.ahead[k])
        inner = np.outer(pull, pull) + inverse @ rows.covariances[k] @ inverse - inverse
        wanted = np.trace(noise @ inner[np.ix_(axes, axes)])
        assert found[k] == pytest.approx(wanted, rel=1e-6, abs=1e-9)


@given(seeds, st.sampled_from((0.0, 0.7, 1.0)))
def test_sums_around_fade_to_both_sides_within_a_path(seed: int, kept: float) -> None:
    values, starts = np.random.default_rng(seed).normal(size=7), np.array([0, 4, 4, 5, 7])
    path = np.searchsorted(starts[1:], np.arange(7), side="right")
    steps = np.abs(np.subtract.outer(np.arange(7), np.arange(7)))
    weights = np.where(path[:, None] == path, float(kept) ** steps, 0.0)
    assert_allclose(passes.sums_around(starts, values, kept), weights @ values, atol=1e-12)


# ── presence


def score(states: tuple[int, ...], votes: ndarray, at_start: bool, at_end: bool) -> float:
    """log weight of a sequence of 1 (there), 0 (away in between) and −1 (not yet, or gone)."""
    total, transitions = 0.0, TRANSITIONS
    there = [k for k, state in enumerate(states) if state == 1]
    if not there:
        return 0.0 if set(states) <= {-1} else -np.inf
    first, last = there[0], there[-1]
    for k, state in enumerate(states):
        if (state == -1) != (k < first or k > last):
            return -np.inf
        total += votes[k] if state == 1 else 0.0
    for one, other in zip(states[first:last], states[first + 1 : last + 1], strict=True):
        total += (
            transitions.stay if one == other == 1 else transitions.change if one != other else 0.0
        )
    total += 0.0 if first == 0 and at_start else transitions.enter
    return total + (0.0 if last == len(states) - 1 and at_end else transitions.enter)


TRANSITIONS = passes.ExistenceTransitions(stay=-0.1, enter=-1.3, change=-0.9)


@given(seeds, st.integers(1, 5), st.sampled_from((-2, 0, 1)), st.integers(-1, 1))
def test_presence_is_the_best_of_all_sequences(
    seed: int, count: int, first: int, beyond: int
) -> None:
    votes = np.random.default_rng(seed).normal(0.0, 2.0, count + 1)
    end = first + count - 1 + beyond
    found = passes.presence(
        np.array([0, count, count + 1]), np.array([first, 99]), votes, TRANSITIONS, end
    )
    best = {}
    for states in product((-1, 0, 1), repeat=count):
        value = score(states, votes, first <= 0, first + count - 1 >= end)
        for k, state in enumerate(states):
            best[k, state == 1] = max(best.get((k, state == 1), -np.inf), value)
        if 1 in states:
            best["some"] = max(best.get("some", -np.inf), value)
    assert found.odds[0] == pytest.approx(best["some"])
    for k in range(count):
        chance = 1.0 / (1.0 + np.exp(best[k, False] - best[k, True]))
        assert found.probabilities[k] == pytest.approx(chance)
    # a path of one row that neither begins nor ends the recording comes and goes
    leaves = 0.0 if end <= 99 else TRANSITIONS.enter
    assert found.odds[1] == pytest.approx(TRANSITIONS.enter + votes[count] + leaves)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_however_sure_the_votes_a_probability_is_a_number(sign: float) -> None:
    found = passes.presence(
        np.array([0, 2]), np.array([0]), np.full(2, sign * 3000.0), TRANSITIONS, 1
    ).probabilities
    assert_allclose(found, 1.0 / (1.0 + np.exp(-sign * 500.0)), rtol=1e-9)


# ── boxes and paths

CAMERA = ring(1)[0]
RULE = CameraRule(
    gate=16.0, soft=True, detection_probability=0.9, confirmed=0.5, near=0.3, strength=0.8,
    reporting_share=0.1, tolerance=1e-9, iterations=500, reporting_threshold=0.01,
)  # fmt: skip


class Scene:
    """Three people at one step and one at the next, each seen, and a box of nobody a step."""

    def __init__(self, seed: int, posture: float, update: str = "extended") -> None:
        rng = np.random.default_rng(seed)
        self.model = TargetModel(PERSON, "box", update, posture)  # type: ignore[arg-type]
        self.states = np.zeros((4, 6))
        self.states[:, :3] = rng.uniform([-1.2, -1.2, 0.8], [1.2, 1.2, 0.9], (4, 3))
        self.states[1, :3] = self.states[0, :3] + 0.35 * (self.states[0, :3] - CAMERA.centre) / 4.0
        self.covariances = np.tile(np.diag([0.02, 0.03, 0.01, 0.1, 0.1, 0.1]), (4, 1, 1))
        self.existences, self.labels = np.array([0.9, 0.8, 0.5, 0.95]), np.array([4, 7, 8, 9])
        self.seen = self.model.expected(CAMERA, self.states, self.covariances)
        values = self.seen.values + rng.normal(0.0, 4.0, (4, 3))
        values = np.insert(values, [0, 4], [values[0] + 9.0, values[3] - 200.0], axis=0)
        noises = random_covariances(rng, 6, 3) + 9.0 * np.eye(3)
        self.measurements = Measurements(values, noises)
        self.starts = np.array([0, 4, 4, 6])
        self.order, self.step_starts = np.array([2, 0, 1, 3]), np.array([0, 3, 3, 4])
        self.clutter = rng.uniform(1e-6, 1e-5, 6)

    def shared(
        self, blind: tuple[bool, ...] = (False,) * 3, rule: CameraRule = RULE, plain: bool = False
    ):
        """By the kernel, or by it as plain Python."""
        s, kernel = self.seen, evidence.share_camera
        return (getattr(kernel, "py_func", kernel) if plain else kernel)(
            evidence.Rows(
                self.states, self.covariances, self.existences, self.labels, self.order,
                self.step_starts,
            ),
            evidence.CameraSteps(self.starts, np.array(blind), self.measurements, self.clutter),
            s,
            CAMERA.calibration.image_size,
            rule,
        )  # fmt: skip


def kinds_of(expected: Expected, j: int) -> list[tuple[float, ndarray, ndarray, ndarray]]:
    """Share, value, H and what is added to noise (beside H P Hᵀ) of each posture."""
    spread = expected.spreads[j] if len(expected.spreads) else np.zeros((3, 3))
    first = (1.0, expected.values[j], expected.jacobians[j], spread)
    if not len(expected.posture_values):
        return [first]
    e, h = expected.posture_share, expected.posture_jacobians[j]
    drift = h @ expected.posture_drift @ h.T
    other = (e, expected.posture_values[j], h, expected.posture_spreads[j] + drift)
    return [(1.0 - e, *first[1:]), other]


def log_normal(offset: ndarray, spread: ndarray) -> float:
    """log N(offset; 0, spread)."""
    square = offset @ np.linalg.solve(spread, offset)
    return -0.5 * float(square + np.linalg.slogdet(2.0 * np.pi * spread)[1])


@pytest.mark.parametrize("plain", [True, False])
def test_links_of_no_box_are_indices_too(plain: bool) -> None:
    links = Scene(1, 0.0).shared(blind=(True,) * 3, plain=plain).links
    assert len(links.shares) == 0
    assert links.rows.dtype == links.boxes.dtype == np.int64


@pytest.mark.parametrize("posture", [0.0, 0.2])
@pytest.mark.parametrize("update", ["extended", "unscented"])
@pytest.mark.parametrize("strength", [0.8, 0.0])
def test_who_made_which_box_is_the_association_at_each_step(
    posture: float, update: str, strength: float
) -> None:
    scene, rule = Scene(1, posture, update), RULE._replace(strength=strength)
    found, e = scene.shared(rule=rule), scene.seen.expected
    shares = np.zeros((4, 6))
    shares[found.links.rows, found.links.boxes] = found.links.shares
    for step, own in ((0, np.array([2, 0, 1])), (2, np.array([3]))):
        boxes = np.arange(scene.starts[step], scene.starts[step + 1])
        inside = 0.9 * inside_probability(
            scene.seen.boxes[own], e.jacobians[own], scene.covariances[own],
            scene.seen.valid[own], CAMERA.calibration.image_size, True,
        )  # fmt: skip
        hiding = np.flatnonzero(scene.existences[own] > 0.5) if strength else np.zeros(0, int)
        hidden = hide(
            inside, scene.seen.boxes[own], scene.seen.depths[own], scene.states[own],
            scene.labels[own], hiding, scene.existences[own][hiding],
            Occlusion(0.3, strength, 0.1),
        )  # fmt: skip
        chances = hidden.detection_probabilities
        weights = np.zeros((len(own), len(boxes)))
        for i, j in enumerate(own):
            for k, z in enumerate(boxes):
                for share, value, h, more in kinds_of(e, j):
                    noise = h @ scene.covariances[j] @ h.T + scene.measurements.noises[z] + more
                    offset = scene.measurements.values[z] - value
                    if offset @ np.linalg.solve(noise, offset) <= rule.gate:
                        likelihood = np.exp(log_normal(offset, noise))
                        weights[i, k] += scene.existences[j] * chances[i] * share * likelihood
        rows = belief_propagation(
            1.0 - scene.existences[own] * chances, weights, scene.clutter[boxes],
            Convergence(1e-9, 500),
        ).rows  # fmt: skip
        assert_allclose(found.detection_probabilities[own], chances)
        assert_allclose(found.missed[own], rows[:, 0])
        assert_array_equal(found.hidden_by[own], hidden.hidden_by)
        told = np.where(rows[:, 1:] >= 0.01, rows[:, 1:], 0.0)
        assert_allclose(shares[np.ix_(own, boxes)], told, atol=1e-9)
    assert shares.any(axis=1).sum() >= 3
    assert (found.hidden_by[1] == 4) == (strength > 0.0)


def test_a_camera_without_a_frame_says_nothing() -> None:
    found = Scene(1, 0.0).shared((True, False, False))
    assert_array_equal(found.detection_probabilities[:3], 0.0)
    assert_array_equal(found.missed[:3], 1.0)
    assert_array_equal(found.hidden_by[:3], -1)
    assert set(found.links.rows.tolist()) == {3}
    assert found.links.boxes.min() >= 4


def test_at_its_threshold_a_track_hides_nobody_and_a_pair_is_returned() -> None:
    scene = Scene(1, 0.0)  # the first, of existence 0.9, stands before the second
    for confirmed, by in ((0.9, -1), (0.899, 4)):
        assert scene.shared(rule=RULE._replace(confirmed=confirmed)).hidden_by[1] == by
    every = scene.shared().links
    least = float(np.sort(every.shares)[1])
    for bound in (least, np.nextafter(least, 1.0)):
        found = scene.shared(rule=RULE._replace(reporting_threshold=bound)).links
        assert_array_equal(found.shares, every.shares[every.shares >= bound])


@pytest.mark.parametrize(("share", "counts"), [(0.99e-6, False), (1e-6, True)])
def test_a_box_of_next_to_no_share_is_left_out(share: float, counts: bool) -> None:
    scene = Scene(1, 0.0)
    information = evidence.BoxInformation(np.zeros((4, 3, 3)), np.zeros((4, 3)), np.zeros(4))
    evidence.add_information(
        evidence.BoxLinks(np.array([0]), np.array([1]), np.array([share])), scene.states,
        scene.covariances, scene.seen.expected, scene.measurements, information,
    )  # fmt: skip
    assert all(part[0].any() == counts and not part[1:].any() for part in information)


@given(seeds, st.sampled_from((0.0, 0.3)), st.sampled_from(("extended", "unscented")))
def test_what_boxes_say_is_added_by_its_formula(seed: int, posture: float, update: str) -> None:
    scene = Scene(seed, posture, update)
    rows, boxes = np.array([0, 0, 1, 3, 2]), np.array([1, 0, 2, 4, 3])
    shares = np.array([0.7, 0.2, 1.0, 0.6, 1e-7])
    e = scene.seen.expected
    picked = Expected(
        *(part[rows] if len(part) else part for part in e[:6]), e.posture_drift, e.posture_share
    )
    start = np.random.default_rng(seed).normal(size=(4, 3, 3))
    information = evidence.BoxInformation(
        start + start.transpose(0, 2, 1), start[:, 0].copy(), start[:, 0, 0].copy()
    )
    matrices, vectors, constants = (part.copy() for part in information)
    evidence.add_information(
        evidence.BoxLinks(rows, boxes, shares), scene.states, scene.covariances, picked,
        scene.measurements, information,
    )  # fmt: skip
    for link in range(4):
        j, z = rows[link], boxes[link]
        value, noise = scene.measurements.values[z], scene.measurements.noises[z]
        kinds = kinds_of(e, j)
        likely = [
            np.log(share) + log_normal(value - h_of, h @ scene.covariances[j] @ h.T + noise + more)
            for share, h_of, h, more in kinds
        ]
        chances = np.exp(np.array(likely) - np.logaddexp.reduce(likely))
        for chance, (_, expected, h, more) in zip(chances, kinds, strict=True):
            a, h = shares[link] * chance, h[:, :3]
            if a < 1e-6:
                continue
            offset = value - expected + h @ scene.states[j, :3]
            weighted = h.T @ np.linalg.inv(noise + more)
            matrices[j] += a * weighted @ h
            vectors[j] += a * weighted @ offset
            constants[j] += a * log_normal(offset, noise + more)
    assert_allclose(information.matrices, matrices, rtol=1e-6, atol=1e-6)
    assert_allclose(information.vectors, vectors, rtol=1e-6, atol=1e-6)
    assert_allclose(information.constants, constants, rtol=1e-6, atol=1e-6)


def test_another_posture_that_cannot_be_seen_counts_for_nothing() -> None:
    scene = Scene(2, 0.3)
    e = scene.seen.expected
    unseen = e._replace(posture_values=np.full((4, 3), np.inf))
    upright = e._replace(
        posture_values=np.empty((0, 3)), posture_jacobians=np.empty((0, 3, 6)),
        posture_spreads=np.empty((0, 3, 3)),
    )  # fmt: skip
    found = []
    for expected in (unseen, upright):
        information = evidence.BoxInformation(np.zeros((4, 3, 3)), np.zeros((4, 3)), np.zeros(4))
        links = evidence.BoxLinks(np.arange(4), np.array([1, 2, 3, 4]), np.full(4, 0.9))
        evidence.add_information(
            links, scene.states, scene.covariances, expected, scene.measurements, information
        )
        found.append(information)
    for one, other in zip(*found, strict=True):
        assert_allclose(one, other)


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        # a box that touches in one axis only, or just at the border, does not hide anybody
        ((15.0, 20.0, 5.0, 5.0), 0.0),
        ((40.0, 20.0, 5.0, 5.0), np.log(0.2)),
        ((15.0, 60.0, 5.0, 5.0), np.log(0.2)),
        ((25.0, 20.0, 5.0, 5.0), np.log(0.2)),
        ((5.0, 20.0, 5.0, 5.0), np.log(0.2)),
        ((15.0, 45.0, 5.0, 5.0), np.log(0.2)),
        ((15.0, -5.0, 5.0, 5.0), np.log(0.2)),
        ((24.9, 44.9, 5.0, 5.0), 0.0),
        ((5.1, -4.9, 5.0, 5.0), 0.0),
    ],
)
def test_a_place_is_seen_empty_where_no_box_touches_the_expected_one(
    box: tuple[float, ...], expected: float
) -> None:
    # the expected box spans 10 … 20 and 0 … 40
    found = evidence.seen_empty(
        np.array([[10.0, 0.0, 20.0, 40.0]]), np.array([True]), np.array([0.8]), np.array([1]),
        np.array([0, 1, 2, 3]), np.array([[15.0, 20.0, 9.0, 9.0], box, [15.0, 20.0, 9.0, 9.0]]),
    )  # fmt: skip
    assert found[0] == pytest.approx(expected)


def test_who_cannot_be_seen_is_not_missed_and_a_sure_miss_stays_finite() -> None:
    found = evidence.seen_empty(
        np.zeros((4, 4)), np.array([True, False, True, True]), np.array([0.0, 0.9, 1.0, 0.9]),
        np.array([0, 0, 0, 0]), np.array([0, 0]), np.zeros((0, 4)),
    )  # fmt: skip
    assert_allclose(found, [0.0, 0.0, np.log(1e-6), np.log(0.1)])
