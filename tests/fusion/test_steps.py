"""One step of the fusion: Bayes' rule where it can be enumerated, order, what changes nothing."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal

from tests import world
from tests.fusion.rooms import (
    CAMERAS,
    METHODS,
    NO_BOXES,
    NO_FRAME,
    ROOM,
    Method,
    Step,
    empty_room,
    exact,
    filtered,
    of_boxes,
    reordered,
)
from tracker.filters import phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.fusion import sequential_phd, trajectories
from tracker.fusion.memory import Memory
from tracker.fusion.model import FusionModel
from tracker.fusion.multi_bernoulli import MultiBernoulli, MultiBernoulliState
from tracker.fusion.protocol import FusionResult
from tracker.fusion.reidentification import IdentityBeliefs
from tracker.fusion.sequential_phd import SequentialPhd, SequentialPhdState
from tracker.kernels.kalman import Expected
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.groups.fusion import FusionParams
from tracker.parameters.values import with_values

both_methods = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__)

PLAIN = FusionParams(
    birth="entrances", posture_share=0.0, occlusion=0.0, memory=0.0, recognition=False
)
"""Only the filter: no newcomer but by the door, nobody hides anybody, no label comes back."""


def known(
    tracks: GaussianMixture, next_label: int = 50, method: Method = MultiBernoulli
) -> MultiBernoulliState | SequentialPhdState:
    """A state with these people."""
    if method is SequentialPhd:
        return SequentialPhdState(tracks, next_label, Memory.start(6))
    nobody = GaussianMixture.empty(6)
    return MultiBernoulliState(tracks, nobody, next_label, Memory.start(6), IdentityBeliefs.none())


def three_walkers(steps: int = 5, misses: float = 0.05, clutter: float = 0.5) -> list[Step]:
    """Boxes of three people who pass each other."""
    ways = [[(-1.5, -0.8), (0.5, -0.6)], [(1.2, 0.9), (-0.6, 0.5)], [(0.2, 1.6), (0.6, -1.2)]]
    paths = world.together(*(world.walk(way, [0.0, 3.0], 10.0) for way in ways), steps=steps)
    rng = np.random.default_rng(3)
    return world.views(world.boxes(CAMERAS, paths, 2.0, rng, misses, clutter))


# ── Bayes


def test_a_labelled_step_is_bayes_over_all_ways_to_share_the_boxes() -> None:
    """Three people and three boxes of one camera, whose gates make a chain: the posterior by
    enumeration of all one-to-one associations."""
    p = PLAIN.model_copy(update={"birth": "measurements", "detection_probability": 0.9})
    whole = empty_room(cameras=CAMERAS[:1])
    model = FusionModel(whole, p)
    across = CAMERAS[0].rotation[0]
    tracks = world.gaussians(
        np.array([0.0, 0.0, 0.85]) + np.outer([-0.8, 0.0, 0.8], across),
        weights=np.array([0.95, 0.7, 0.4]), sigma=0.08, first_label=5,
    )  # fmt: skip
    places = np.array([0.0, 0.0, 0.85]) + np.outer([-0.65, -0.38, 0.42], across)
    view = of_boxes(world.upright(CAMERAS[0], places), 9.0)
    fusion = MultiBernoulli(whole, RunParameters(fusion=p))
    state, result = fusion.step(known(tracks), [view])

    before = model.motion.predict(tracks, p.survival_probability)
    seen = model.expected(0, before)
    chances = model.detection_probabilities(0, seen, before)
    z, noise = model.target.measured(view.boxes, view.sigmas, 1.0)
    odds, updates = np.zeros((3, 3)), {}
    for i, j in itertools.product(range(3), range(3)):
        h, covariance = seen.jacobians[i], before.covariances[i]
        spread = h @ covariance @ h.T + noise[j]
        off = z[j] - seen.values[i]
        if off @ np.linalg.solve(spread, off) <= model.gate:
            density = multivariate_normal(np.zeros(3), spread).pdf(off)
            odds[i, j] = before.weights[i] * chances[i] * density / model.clutter[0]
            gain = covariance @ h.T @ np.linalg.inv(spread)
            updates[i, j] = before.means[i] + gain @ off, covariance - gain @ spread @ gain.T
    assert (odds > 0.0).tolist() == [[True, True, False], [False, True, True], [False, False, True]]
    missed = 1.0 - before.weights * chances
    joint = np.zeros((3, 4))
    for event in itertools.product(range(-1, 3), repeat=3):
        taken = [j for j in event if j >= 0]
        if len(set(taken)) == len(taken):
            weight = np.prod([missed[i] if j < 0 else odds[i, j] for i, j in enumerate(event)])
            for i, j in enumerate(event):
                joint[i, j] += weight  # the last column is the miss
    joint /= joint[0].sum()
    order = np.argsort(result.posterior.labels)
    assert result.posterior.labels[order].tolist() == [5, 6, 7]
    for i, component in enumerate(order):
        parts = [(joint[i, j], *updates[i, j]) for j in range(3) if (i, j) in updates]
        there = joint[i, 3] * before.weights[i] * (1.0 - chances[i]) / missed[i]
        parts.append((there, before.means[i], before.covariances[i]))
        total = sum(weight for weight, _, _ in parts)
        mean = sum(weight * m for weight, m, _ in parts) / total
        spread = sum(w * (c + np.outer(m - mean, m - mean)) for w, m, c in parts) / total
        assert_allclose(result.posterior.weights[component], total, rtol=1e-4)
        assert_allclose(result.posterior.means[component], mean, atol=1e-5)
        assert_allclose(result.posterior.covariances[component], spread, rtol=1e-3, atol=1e-6)
        assert_allclose(result.detection_probabilities[0, component], chances[i], rtol=1e-9)
        assert result.sources[0, component] == joint[i, :3].argmax()
        for j in range(3):
            told = result.associations
            own = (told.components == component) & (told.boxes == j)
            assert_allclose(told.probabilities[own].sum(), joint[i, j], atol=0.011)
    assert state.next_label == 50


@pytest.mark.parametrize("survival", [0.9, 1.0])
@both_methods
def test_where_nothing_is_detected_a_step_only_predicts(method: Method, survival: float) -> None:
    """As p_D goes to 0, boxes or none: weights times p_S, moments by the motion."""
    p = PLAIN.model_copy(
        update={
            "detection_probability": 1e-15,
            "survival_probability": survival,
            "birth_rate": 1e-9,
        }
    )
    tracks = world.gaussians(np.array([[0.3, 0.2, 0.85], [-1.0, 1.0, 0.85]]), weights=0.8)
    model = FusionModel(empty_room(), p)
    before = model.motion.predict(tracks, survival)
    for views in (exact([[0.3, 0.2, 0.85]]), (NO_BOXES,) * 4, (NO_FRAME,) * 4):
        fusion = method(empty_room(), RunParameters(fusion=p))
        _, result = fusion.step(known(tracks, method=method), views)
        people = result.posterior.take(np.flatnonzero(result.posterior.labels < 50))
        order = np.argsort(people.labels)
        assert_allclose(people.weights[order], before.weights, rtol=1e-9)
        assert_allclose(people.means[order], before.means, atol=1e-12)
        assert_allclose(people.covariances[order], before.covariances, atol=1e-12)
        assert (result.sources == -1).all()
        assert (result.detection_probabilities < 1e-9).all()


@both_methods
def test_cameras_without_a_frame_leave_the_others_as_if_they_were_not_there(method: Method) -> None:
    views = three_walkers(3)
    for blind in ((0,), (1, 3)):
        rest = [c for c in range(4) if c not in blind]
        one = filtered(method, [tuple(step[c] for c in rest) for step in views],
                       cameras=[CAMERAS[c] for c in rest])  # fmt: skip
        other = filtered(
            method, [tuple(NO_FRAME if c in blind else v for c, v in enumerate(s)) for s in views]
        )
        for a, b in zip(one, other, strict=True):
            assert_array_equal(a.posterior.weights, b.posterior.weights)
            assert_array_equal(a.posterior.means, b.posterior.means)
            assert_array_equal(a.detection_probabilities, b.detection_probabilities[rest])
            assert_array_equal(a.sources, b.sources[rest])
            assert_array_equal(np.array(rest)[a.associations.cameras], b.associations.cameras)
            assert (b.sources[list(blind)] == -1).all()
            assert not b.detection_probabilities[list(blind)].any()


@both_methods
def test_a_camera_that_looks_elsewhere_has_no_say(method: Method) -> None:
    away = world.look_at("away", (-5.0, -5.2, 2.6), (-15.0, -15.0, 1.0))
    places = np.array([[0.3, 0.2, 0.85], [-1.0, 1.0, 0.85]])
    tracks, views = world.gaussians(places + 0.05), exact(places, CAMERAS[:3])
    results = []
    for cameras, seen in ((CAMERAS[:3], views), ((*CAMERAS[:3], away), (*views, NO_BOXES))):
        fusion = method(empty_room(cameras=cameras), RunParameters(fusion=PLAIN))
        results.append(fusion.step(known(tracks, method=method), seen)[1])
    without, with_it = results
    assert_allclose(with_it.posterior.weights, without.posterior.weights, rtol=1e-9)
    assert_allclose(with_it.posterior.means, without.posterior.means, atol=1e-9)
    assert (with_it.sources[3] == -1).all()
    assert not with_it.detection_probabilities[3].any()


# ── symmetries


def same_people(one: FusionResult, other: FusionResult, tolerance: float) -> ndarray:
    """That two posteriors are the same; which component of the other each of the one is."""
    assert one.posterior.size == other.posterior.size
    order = [np.lexsort(r.posterior.means.round(4).T[:2]) for r in (one, other)]
    place = np.empty(one.posterior.size, dtype=np.int64)
    place[order[0]] = order[1]
    assert_allclose(one.posterior.weights, other.posterior.weights[place], atol=tolerance)
    assert_allclose(one.posterior.means, other.posterior.means[place], atol=tolerance)
    assert_allclose(one.posterior.covariances, other.posterior.covariances[place], atol=tolerance)
    return place


@both_methods
@pytest.mark.parametrize("duplicate_distance", [0.0, 0.5])
def test_the_order_of_a_cameras_boxes_changes_nothing(
    method: Method, duplicate_distance: float
) -> None:
    """Box 0 is a source like any other: of a newcomer, of a track, of what is left over."""
    rng = np.random.default_rng(8)
    views = [
        exact([[0.02 * k - 1.9, 0.05 * k - 1.9, 0.85], [0.5, 0.3, 0.85]], sigma=4.0)
        for k in range(3)
    ]
    orders = [[rng.permutation(2) for _ in step] for step in views]
    mixed = [
        tuple(reordered(view, order) for view, order in zip(step, own, strict=True))
        for step, own in zip(views, orders, strict=True)
    ]
    changes = {"duplicate_distance": duplicate_distance}
    runs = zip(
        filtered(method, views, **changes), filtered(method, mixed, **changes), orders, strict=True
    )
    for one, other, order in runs:
        place = same_people(one, other, 1e-6)
        sure = np.flatnonzero(one.posterior.weights > 0.5)
        assert len(sure) == 2
        for camera in range(4):
            back = np.append(order[camera], -1)
            assert_array_equal(one.sources[camera, sure], back[other.sources[camera, place[sure]]])
            assert (one.sources[camera, sure] >= 0).all()


def test_the_order_of_cameras_and_of_tracks_changes_nothing() -> None:
    places = np.array([[0.3, 0.2, 0.85], [-1.0, 1.0, 0.85], [1.2, -0.9, 0.85]])
    tracks = world.gaussians(places + 0.01, weights=np.array([0.9, 0.8, 0.7]), sigma=0.03)
    views = exact(places, sigma=3.0)
    runs = []
    for cameras, people in itertools.product(([0, 1, 2, 3], [2, 0, 3, 1]), ([0, 1, 2], [2, 0, 1])):
        whole = empty_room(cameras=[CAMERAS[c] for c in cameras])
        fusion = MultiBernoulli(whole, RunParameters(fusion=PLAIN))
        _, result = fusion.step(known(tracks.take(np.array(people))), [views[c] for c in cameras])
        sure = np.flatnonzero(result.posterior.weights > 0.5)
        order = sure[np.argsort(result.posterior.labels[sure])]
        runs.append((result.posterior.take(order), result.sources[np.argsort(cameras)][:, order]))
    for posterior, sources in runs:
        assert posterior.labels.tolist() == [1, 2, 3]
        assert sources.tolist() == [[0, 1, 2]] * 4
        # the projection is straightened where the cameras before led to
        assert_allclose(posterior.means, runs[0][0].means, atol=1e-3)
        assert_allclose(posterior.weights, runs[0][0].weights, atol=1e-3)
        assert_allclose(posterior.covariances, runs[0][0].covariances, atol=1e-4)


class _Millimetres(FusionParams):
    """The constant velocity in millimetres per second."""

    start_velocity: ClassVar[float] = 1000.0 * FusionParams.start_velocity


@both_methods
def test_metres_may_be_millimetres(method: Method) -> None:
    """Lengths times a thousand, pixels as they are: the same people with the same weights."""
    k = 1000.0
    views = three_walkers(5)
    scaled = [replace(camera, translation=k * camera.translation) for camera in CAMERAS]
    room = world.volume(2.2 * k, 2.2 * k, [(-1900.0, -1900.0, 850.0)], (300.0, 300.0, 100.0))
    p = PLAIN.model_copy(update={"birth_rate": 2.0, "merging_threshold": 2.0})
    lengths = ("acceleration_sigma", "motion_sigma", "followed_margin")
    longer = {name: k * getattr(p, name) for name in lengths}
    wide = _Millimetres.model_construct(**{**p.model_dump(), **longer})
    metres, millimetres = (
        method(whole, RunParameters(fusion=own))
        for whole, own in (
            (empty_room(), p),
            (replace(empty_room(cameras=scaled, room=room),
                     target_half_extents=k * world.PERSON), wide),
        )
    )  # fmt: skip
    tracks = world.gaussians(np.array([[-1.5, -0.8, 0.85], [1.2, 0.9, 0.85]]), sigma=0.05)
    large = GaussianMixture(
        tracks.weights, k * tracks.means, k**2 * tracks.covariances, tracks.labels
    )
    one, other = known(tracks, method=method), known(large, method=method)
    for step in views:
        one, found = metres.step(one, step)
        other, again = millimetres.step(other, step)
        assert found.posterior.size >= 2
        assert_allclose(again.posterior.weights, found.posterior.weights, rtol=1e-6, atol=1e-12)
        assert_allclose(again.posterior.means, k * found.posterior.means, rtol=1e-6, atol=1e-3)
        assert_array_equal(again.sources, found.sources)


@both_methods
def test_a_step_is_pure(method: Method) -> None:
    views = three_walkers()
    fusion = method(empty_room(), RunParameters())
    state = fusion.start()
    for step in views[:3]:
        state, _ = fusion.step(state, step)
    before = (
        state.tracks if isinstance(state, MultiBernoulliState) else state.mixture
    ).means.copy()
    once, first = fusion.step(state, views[3])
    twice, second = fusion.step(state, views[3])
    assert_array_equal(first.posterior.means, second.posterior.means)
    assert_array_equal(first.posterior.weights, second.posterior.weights)
    assert once.next_label == twice.next_label
    assert once.next_label > first.posterior.labels.max(), "nobody has a label that is free"
    after = (state.tracks if isinstance(state, MultiBernoulliState) else state.mixture).means
    assert_array_equal(before, after)


# ── who begins


@both_methods
@pytest.mark.parametrize("first", [False, True])
def test_a_newcomer_is_recorded_with_the_boxes_that_began_it(method: Method, first: bool) -> None:
    """Box 0 is one like any; nobody begins otherwise."""
    views = exact([[0.4, -0.3, 0.85]], sigma=4.0)
    if not first:
        aside = np.array([[5.0, 5.0, 4.0, 12.0]])
        views = tuple(of_boxes(np.concatenate([aside, view.boxes]), 4.0) for view in views)
    views = (*views[:2], NO_FRAME, views[3])
    (result,) = filtered(method, [views], birth="measurements")
    (component,) = np.flatnonzero(result.posterior.weights > 0.5)
    assert_allclose(result.posterior.means[component, :3], [0.4, -0.3, 0.85], atol=0.02)
    box = 0 if first else 1
    assert result.sources[:, component].tolist() == [box, box, -1, box]
    assert result.source_weights[:, component].tolist() == [1.0, 1.0, 0.0, 1.0]
    p_d = FusionParams().detection_probability
    assert result.detection_probabilities[:, component].tolist() == [p_d, p_d, 0.0, p_d]


@pytest.mark.parametrize("box", [0, 1])
def test_a_box_that_began_a_newcomer_begins_nobody_at_the_entrance_on_its_ray(box: int) -> None:
    """The entrance lies behind the newcomer, as the first camera sees them; other cameras do not
    take the one for the other. Box 0 is one like any."""
    door = ROOM.entrances[0].position
    place = door + 0.3 * (CAMERAS[0].centre - door)
    views = [
        of_boxes(np.concatenate([np.tile([20.0, 20.0, 4.0, 12.0], (box, 1)), view.boxes]))
        for view in exact([place], CAMERAS[:3])
    ]
    p = {"measurement": "centre", "pruning_threshold": 1e-9, "duplicate_distance": 0.0}
    for birth, count in (("entrances", 1), ("both", 1)):
        (result,) = filtered(MultiBernoulli, [tuple(views)], cameras=CAMERAS[:3], birth=birth, **p)
        made = np.flatnonzero(result.sources[0] == box)
        assert len(made) == count
        at = door if birth == "entrances" else place
        assert np.linalg.norm(result.posterior.means[made[0], :3] - at) < 0.5


def test_who_comes_in_by_the_door_begins_beside_a_newcomer_of_other_boxes() -> None:
    door, place = ROOM.entrances[0].position, [0.4, -0.3, 0.85]
    first, *others = exact([place, door], CAMERAS[:3])  # the first camera alone sees the door
    views = (first, *(reordered(view, np.array([0])) for view in others))
    p = {"pruning_threshold": 1e-9, "duplicate_distance": 0.0}
    (result,) = filtered(MultiBernoulli, [views], cameras=CAMERAS[:3], birth="both", **p)
    for source, where in (([0, 0, 0], place), ([1, -1, -1], door)):
        (component,) = np.flatnonzero((result.sources.T == source).all(axis=1))
        assert np.linalg.norm(result.posterior.means[component, :3] - where) < 0.5


@both_methods
@pytest.mark.parametrize(("gap", "begins"), [(1, True), (4, True), (5, False)])
def test_cameras_that_take_turns_begin_a_track_within_a_fifth_of_a_second(
    method: Method, gap: int, begins: bool
) -> None:
    """Twenty steps a second; only boxes of this step are recorded as sources."""
    one, other = exact([[0.4, -0.3, 0.85]], CAMERAS[:2], sigma=4.0)
    views = [(one, NO_FRAME), *[(NO_FRAME, NO_FRAME)] * (gap - 1), (NO_FRAME, other)]
    result = filtered(method, views, cameras=CAMERAS[:2], fps=20.0, birth="measurements")[-1]
    assert result.sources.T.tolist() == ([[-1, 0]] if begins else [])


@both_methods
def test_one_camera_alone_finds_who_comes_in_by_the_entrance(method: Method) -> None:
    place = ROOM.entrances[0].position
    result = filtered(method, [exact([place], CAMERAS[:1])] * 4, cameras=CAMERAS[:1])[-1]
    best = result.posterior.weights.argmax()
    assert result.posterior.weights[best] > 0.5
    assert_allclose(result.posterior.means[best, :3], place, atol=0.5)
    elsewhere = filtered(method, [exact([[0.4, -0.3, 0.85]], CAMERAS[:1])], cameras=CAMERAS[:1])
    assert elsewhere[0].posterior.weights.max(initial=0.0) < 0.1


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", range(3))
def test_people_are_followed_to_the_margin_around_the_room(axis: int, side: float) -> None:
    margin = FusionParams().followed_margin
    edge = (ROOM.maximum if side > 0 else ROOM.minimum)[axis] + side * margin
    places = np.tile([0.3, 0.2, 0.85], (2, 1))
    places[:, axis] = edge - side * 1e-9, edge + side * 1e-9
    assert FusionModel(empty_room(), FusionParams()).inside_tracked_volume(
        world.gaussians(places)
    ).tolist() == [0]


# ── what every step reports


@both_methods
def test_every_step_reports_what_made_it(method: Method) -> None:
    """A box is at most one person's, a person makes at most one box a camera, and the sources are
    the likeliest of the associations."""
    p = FusionParams()
    views, told = three_walkers(clutter=1.0), 0
    for frame, result in enumerate(filtered(method, views)):
        posterior, said = result.posterior, result.associations
        size = posterior.size
        for name in ("detection_probabilities", "sources", "source_weights", "hidden_by"):
            assert getattr(result, name).shape == (4, size)
        chances = result.detection_probabilities
        assert ((chances >= 0.0) & (chances <= p.detection_probability)).all()
        assert ((result.source_weights >= 0.0) & (result.source_weights <= 1.0 + 1e-9)).all()
        assert not result.source_weights[result.sources < 0].any()
        assert result.source_weights[result.sources >= 0].all()
        assert (posterior.weights >= 0.0).all()
        if size:
            assert np.linalg.eigvalsh(posterior.covariances).min() > 0.0
        assert (said.probabilities >= 0.0099).all()
        for camera, view in enumerate(views[frame]):
            own = said.cameras == camera
            of_box = np.bincount(said.boxes[own], said.probabilities[own], len(view.boxes))
            of_person = np.bincount(said.components[own], said.probabilities[own], size)
            assert of_box.max(initial=0.0) < 1.01
            assert of_person.max(initial=0.0) < 1.01
            for component in np.flatnonzero(
                (posterior.weights > 0.5) & (result.sources[camera] >= 0)
            ):
                # who begins in this step by boxes that nobody explained has no pair yet
                pairs = own & (said.components == component)
                if pairs.any() and isinstance(method, type(MultiBernoulli)):
                    best = said.boxes[pairs][said.probabilities[pairs].argmax()]
                    told += result.sources[camera, component] == best
    assert told > 20


@both_methods
def test_who_is_hidden_is_reported_with_who_hides_him(method: Method) -> None:
    near, far = CAMERAS[0].centre * [0.3, 0.3, 0.0], CAMERAS[0].centre * [-0.2, -0.2, 0.0]
    places = np.array([near, far]) + np.array([0.0, 0.0, 0.85])
    views = exact(places, sigma=4.0)
    first = reordered(views[0], np.array([0]))  # the one in front alone
    result = filtered(method, [(first, *views[1:])] * 6)[-1]
    sure = np.flatnonzero(result.posterior.weights > 0.5)
    one, other = sure[np.argsort(-(result.posterior.means[sure, :3] @ CAMERAS[0].centre))]
    labels = result.posterior.labels
    assert result.hidden_by[0, [one, other]].tolist() == [-1, labels[one]]
    assert result.detection_probabilities[0, other] < 0.6
    assert result.detection_probabilities[0, one] == pytest.approx(0.95, abs=0.01)
    assert result.posterior.weights[other] > 0.9, "it is no miss"


@both_methods
@pytest.mark.parametrize(
    "changes",
    [
        {"detection_probability": 1.0, "survival_probability": 1.0},
        {"detection_probability": 0.05, "merging_threshold": 0.0, "occlusion": 1.0},
        {"measurement": "centre", "motion": "random_walk", "max_components": 5},
        {"measurement": "box_and_width", "update": "unscented", "edge": "hard", "memory": 0.0},
        {"clutter_rate": 0.001, "birth_rate": 10.0, "pruning_threshold": 0.1},
    ],
    ids=["certain", "blind", "published", "bent", "eager"],
)
def test_the_ends_of_the_ranges_give_no_nonsense(
    method: Method, changes: dict[str, object]
) -> None:
    absurd = [[640, 400, 0.5, 0.5], [640, 400, 640, 400], [-500, 400, 600, 900], [640, 400, 640, 1]]
    views = [
        tuple(of_boxes(np.concatenate([view.boxes, absurd]), 3.0) for view in step)
        for step in three_walkers(3, clutter=1.0)
    ]
    views.append((NO_BOXES,) * 4)
    for result in filtered(method, views, **changes):
        posterior = result.posterior
        assert np.isfinite(posterior.weights).all()
        assert np.isfinite(posterior.means).all()
        assert (posterior.weights >= 0.0).all()
        assert posterior.cardinality < 30.0
        if posterior.size:
            assert np.linalg.eigvalsh(posterior.covariances).min() > 0.0


# ── one scene a method


@pytest.mark.parametrize(
    ("method", "preset"),
    [(MultiBernoulli, ""), (SequentialPhd, ""), (SequentialPhd, "published")],
)
def test_three_people_who_pass_each_other_are_three_tracks(method: Method, preset: str) -> None:
    """The error is as large as is stated, and each keeps the id."""
    steps = 26
    ways = [[(-1.9, -1.9), (0.5, -0.6)], [(-1.9, -1.8), (-1.2, 1.0)], [(-1.9, -1.9), (1.2, -1.2)]]
    begins = [0.0, 0.4, 0.8]
    paths = world.together(
        *(world.walk(w, [b, 4.0], 10.0) for w, b in zip(ways, begins, strict=True)), steps=steps
    )
    rng = np.random.default_rng(2)
    small = preset == "published"
    extents = world.HEAD if small else world.PERSON
    seen = world.boxes(CAMERAS, paths, 3.0, rng, 0.0 if small else 0.02, 0.3, half_extents=extents)
    changes = with_values(RunParameters(), PRESETS[preset]).fusion.model_dump() if preset else {}
    whole = replace(empty_room(), target_half_extents=extents)
    fusion = method(whole, RunParameters(fusion=FusionParams(**changes)))
    state, results = fusion.start(), []
    for step in world.views(seen):
        state, result = fusion.step(state, step)
        results.append(result)
    tracks = trajectories.extract(
        results, cameras=4, extraction_threshold=0.5, bounds=trajectories.Bounds(ROOM)
    )
    names, squares = [], []
    for person, begin in enumerate(begins):
        ids = []
        for step in range(round(10 * begin) + 8, steps):
            rows = tracks.at(step)
            off = tracks.positions[rows] - paths[step, person]
            best = np.linalg.norm(off, axis=1).argmin()
            ids.append(int(tracks.ids[rows][best]))
            squares.append(float(((off[best] / tracks.sigmas[rows][best]) ** 2).mean()))
        assert len(set(ids)) == 1
        names.append(ids[0])
    assert len(set(names)) == 3
    assert 0.1 < np.mean(squares) < 2.0


R = 0.04 * np.eye(2)
NO_BIRTHS = range(900, 900)
CLUTTER = 1e-6


def mixture(weights: list[float], means: list[list[float]], labels: list[int]) -> GaussianMixture:
    """Components of the same spread in the plane."""
    covariances = np.tile(0.09 * np.eye(2), (len(weights), 1, 1))
    return GaussianMixture(
        np.array(weights), np.array(means, dtype=float), covariances, np.array(labels)
    )


def plain(
    before: GaussianMixture, boxes: ndarray, p_d: float, clutter: float = CLUTTER
) -> PhdUpdate:
    """The recursion of [VM06] with one linear camera."""
    return phd.update(
        before,
        boxes,
        expected=Expected.of(before.means, np.tile(np.eye(2), (before.size, 1, 1))),
        noise=R[None],
        detection_probability=p_d,
        clutter_intensity=clutter,
        gate=25.0,
    )


def shared(
    before: GaussianMixture,
    boxes: ndarray,
    p_d: float,
    births: range = NO_BIRTHS,
    clutter: float = CLUTTER,
) -> PhdUpdate:
    """The same with one person a label."""
    return sequential_phd.associate_labels(
        before,
        plain(before, boxes, p_d, clutter),
        np.full(before.size, p_d),
        births=births,
        next_label=1000,
    )


def weight_after(order: list[tuple[float, bool]], *, per_person: bool) -> float:
    """Weight of one sure target after cameras of some p_D that hit or miss it, in that order."""
    state = mixture([1.0 if not per_person else 0.999], [[0.0, 0.0]], [1])
    update = shared if per_person else plain
    for p_d, hit in order:
        boxes = state.means[:1] if hit else np.zeros((0, 2))
        after = update(state, boxes, p_d).posterior
        heavy = after.weights > 1e-9
        state = after.take(heavy)
    return state.cardinality


GOOD, POOR = (0.95, True), (0.5, False)


def test_the_plain_recursion_depends_on_the_order_of_the_cameras() -> None:
    # camera A with p_D 0.95 and B with 0.5, as a target that one of them misses feels it
    assert weight_after([GOOD, POOR], per_person=False) == pytest.approx(0.52, abs=0.01)
    assert weight_after([POOR, GOOD], per_person=False) == pytest.approx(1.02, abs=0.01)
    hit_by_poor, missed_by_good = (0.5, True), (0.95, False)
    assert weight_after([hit_by_poor, missed_by_good], per_person=False) == pytest.approx(
        0.075, abs=0.005
    )


@given(st.lists(st.tuples(st.floats(0.1, 0.95), st.booleans()), min_size=2, max_size=4))
def test_one_person_a_label_asks_for_no_order(cameras: list[tuple[float, bool]]) -> None:
    weights = [
        weight_after(list(order), per_person=True) for order in itertools.permutations(cameras)
    ]
    assert max(weights) - min(weights) < 1e-3
    if any(hit for _, hit in cameras):
        assert min(weights) > 0.99


def test_a_label_is_never_more_than_one_person() -> None:
    # two boxes that one component could have made, each by itself
    before = mixture([0.99], [[0.0, 0.0]], [7])
    boxes = np.array([[0.1, 0.0], [-0.1, 0.0]])
    assert plain(before, boxes, 0.98).posterior.cardinality > 1.9
    after = shared(before, boxes, 0.98)
    assert after.posterior.cardinality <= 1.0 + 1e-9
    assert_array_equal(after.posterior.labels, [7, 7, 7])
    assert after.measurement_weights.sum() <= 1.0 + 1e-9


def test_a_newcomer_gets_a_label_of_its_box() -> None:
    # a birth that covers all of the plane, and two boxes far from each other
    births = GaussianMixture(
        np.array([0.1]), np.zeros((1, 2)), 4.0 * np.eye(2)[None], np.array([50])
    )
    boxes = np.array([[-2.0, 0.0], [2.0, 0.0]])
    after = shared(births, boxes, 0.98, births=range(50, 51)).posterior
    assert_array_equal(after.labels, [50, 1000, 1001])
    assert (after.weights[1:] > 0.99).all()
    assert after.weights[0] == pytest.approx(0.1 * 0.02), "what was not seen stays Poisson"


def test_nobody_and_nothing() -> None:
    nobody = GaussianMixture.empty(2)
    assert shared(nobody, np.zeros((0, 2)), 0.9).posterior.size == 0
    assert_array_equal(shared(nobody, np.zeros((3, 2)), 0.9).measurement_weights, np.zeros(3))
    alone = mixture([0.5], [[0.0, 0.0]], [1])
    after = shared(alone, np.zeros((0, 2)), 0.9)
    assert after.posterior.weights[0] == pytest.approx(0.5 * 0.1 / (1 - 0.45))


@pytest.mark.parametrize("clutter", [1.0, 1e-6, 1e-16, 1e-20, 1e-300, 5e-324])
def test_however_little_clutter_there_is_a_box_is_shared_by_its_odds(clutter: float) -> None:
    before = mixture([0.5], [[0.0, 0.0]], [1])
    after = shared(before, before.means, 0.9, clutter=clutter).posterior
    hit = np.exp(np.log(0.45 / (2.0 * np.pi * 0.13)) - np.log(clutter).clip(min=-600.0))
    assert after.cardinality == pytest.approx((hit + 0.05) / (hit + 0.55))


def test_sure_people_are_merged_with_nobody_else() -> None:
    people = mixture([0.4, 0.4, 0.3, 0.9, 0.25, 0.25], [[0.0, 0.0]] * 6, [1, 1, 2, 3, 4, 4])
    assert_array_equal(sequential_phd.merging_owners(people), [1, 1, -1, 3, -1, -1])
