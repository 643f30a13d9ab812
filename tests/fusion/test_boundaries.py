"""Every count and threshold of the fusion at, one below and one above."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal

from tests import world
from tests.fusion.rooms import (
    CAMERAS,
    NO_BOXES,
    NO_FRAME,
    ROOM,
    births,
    empty_room,
    evidence,
    exact,
    of_boxes,
)
from tracker.corrections.kinds import make
from tracker.filters.gaussian_mixture import GaussianMixture, gate_distance
from tracker.fusion import missing_frames
from tracker.fusion.constraint_update import apply_constraints
from tracker.fusion.measurement_births import Newborns
from tracker.fusion.memory import Memory, recall
from tracker.fusion.missing_frames import StepEvidence
from tracker.fusion.model import FusionModel, all_boxes
from tracker.fusion.multi_bernoulli import MultiBernoulli, MultiBernoulliState
from tracker.fusion.protocol import FusionResult, PlaceConstraints, constraints_by_step
from tracker.fusion.record import Ledger, Record, sum_associations
from tracker.fusion.reidentification import IdentityBeliefs
from tracker.fusion.sequential_phd import SequentialPhd, SequentialPhdState
from tracker.fusion.target_model import TargetModel
from tracker.fusion.trajectories import Bounds, by_boxes, extract
from tracker.geometry.camera import stacked
from tracker.kernels import births as kernels
from tracker.kernels.births import Refinement
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.fusion import FusionParams
from tracker.single_view.protocol import ViewResult

PLACE = np.array([0.4, -0.3, 0.85])
ABOVE = 1e-9


def some(views: tuple[ViewResult, ...], *cameras: int) -> tuple[ViewResult, ...]:
    """The boxes of some cameras alone."""
    return tuple(view if c in cameras else NO_BOXES for c, view in enumerate(views))


# ── newcomers


NO_PAIR = np.full((1, 2), -1)
"""A seed that was not found by two boxes."""


@pytest.mark.parametrize(
    ("cameras", "count"), [((), 0), ((0,), 0), ((3,), 0), ((0, 1), 1), ((0, 1, 2, 3), 1)]
)
def test_one_box_is_not_enough_for_a_newcomer_and_two_are(
    cameras: tuple[int, ...], count: int
) -> None:
    found = births().propose(evidence(some(exact([PLACE]), *cameras)))
    assert (0 if found is None else len(found.existences)) == count
    if found is not None:
        assert np.flatnonzero(found.sources[:, 0] == 0).tolist() == list(cameras)
        assert_allclose(found.positions[0], PLACE, atol=1e-3)


def test_where_of_two_boxes_only_one_fits_nobody_begins() -> None:
    """Two rays that pass 0.3 m apart: a box that is known to half a pixel keeps the place on its
    own ray, and the other is beyond the gate there."""
    low, high = exact([PLACE])[0], exact([PLACE + np.array([0.0, 0.0, 0.3])])[1]
    sure = ViewResult.of_boxes(low.boxes, low.weights, low.sigmas * 0.2)
    views = (sure, high, NO_BOXES, NO_BOXES)
    told = evidence(views)
    fitted = kernels.fit_places(
        np.array([PLACE]), NO_PAIR, told.measurements, np.ones(2, dtype=bool), told.starts,
        TargetModel(world.PERSON, "box").target(3), stacked(CAMERAS), Refinement(1.0, 3, 21.0),
    )  # fmt: skip
    assert fitted.sources[:, 0].tolist() == [0, -1, -1, -1]
    assert births().propose(told) is None


@pytest.mark.parametrize("away", [0.6, 1.0, 1.5, 2.0])
def test_a_newcomer_whom_two_cameras_see_is_not_drawn_to_others(away: float) -> None:
    """In a crowd cameras without a box of the newcomer have boxes of people nearby."""
    others = [PLACE + away * np.array([np.cos(a), np.sin(a), 0.0]) for a in (0.4, 2.2)]
    views = list(exact([PLACE]))
    for camera, other in zip((2, 3), others, strict=True):
        views[camera] = exact([other])[camera]
    found = births().propose(evidence(tuple(views)))
    assert found is not None
    one = int(np.flatnonzero(found.sources[0] == 0)[0])
    assert found.sources[:, one].tolist() == [0, 0, -1, -1]
    assert_allclose(found.positions[one], PLACE, atol=1e-3)


@pytest.mark.parametrize("first", [False, True])
def test_of_two_newcomers_that_share_a_box_the_surer_begins(first: bool) -> None:
    """Two people on one ray of the first camera, of whom it has one box; box 0 is one like any."""
    ray = PLACE - CAMERAS[0].centre
    places = np.array([PLACE, PLACE - 0.25 * ray])
    views = list(exact(places))
    shared = views[0].boxes[:1]
    aside = np.array([[20.0, 20.0, 10.0, 30.0]])
    boxes = shared if first else np.concatenate([aside, shared])
    views[0] = of_boxes(boxes, 2.0)
    views[2] = NO_BOXES
    views[3] = of_boxes(views[3].boxes[:1], 2.0)  # another camera sees the one of them
    found = births("centre").propose(evidence(tuple(views), "centre"))
    assert found is not None
    box = 0 if first else 1
    assert found.sources[0].tolist().count(box) == 1
    one = int(np.flatnonzero(found.sources[0] == box)[0])
    assert_allclose(found.positions[one], PLACE, atol=0.1)
    assert (found.sources[:, one] >= 0).tolist() == [True, True, False, True]


@pytest.mark.parametrize(("unexplained", "count"), [(0.5, 0), (0.5 + ABOVE, 1)])
def test_a_box_that_somebody_made_as_likely_as_not_begins_nobody(
    unexplained: float, count: int
) -> None:
    found = births().propose(evidence(exact([PLACE]), unexplained=unexplained))
    assert (0 if found is None else len(found.existences)) == count
    told = evidence(exact([PLACE]))
    told.unexplained[3] = unexplained  # and is no other box of a newcomer
    found = births().propose(told)
    assert found is not None
    assert found.sources[:, 0].tolist() == [0, 0, 0, count - 1]


def test_a_box_belongs_to_a_place_by_the_uncertainty_of_both() -> None:
    """From a seed half a metre off, whose boxes are far beyond their own noise."""
    told = evidence(exact([PLACE], sigma=1.0))
    target, cameras = TargetModel(world.PERSON, "box").target(3), stacked(CAMERAS)
    for seed in (PLACE, PLACE + np.array([0.4, 0.3, 0.1])):
        fitted = kernels.fit_places(
            np.array([seed]), NO_PAIR, told.measurements, np.ones(4, dtype=bool), told.starts,
            target, cameras, Refinement(1.0, 3, 21.0),
        )  # fmt: skip
        assert fitted.sources[:, 0].tolist() == [0, 0, 0, 0]
        assert_allclose(fitted.positions[0], PLACE, atol=5e-3)


def test_the_error_of_a_newcomers_place_is_chi_squared() -> None:
    """NEES of 60 newcomers, and NIS of their boxes: three degrees of freedom each, but for the
    three that the place takes."""
    rng, squares, fits = np.random.default_rng(5), [], []
    plain, sigma = exact([PLACE]), 3.0
    for _ in range(60):
        views = tuple(of_boxes(v.boxes + sigma * rng.normal(size=(1, 4)), sigma) for v in plain)
        told = evidence(views)
        fitted = kernels.fit_places(
            np.array([PLACE]), NO_PAIR, told.measurements, np.ones(4, dtype=bool), told.starts,
            TargetModel(world.PERSON, "box").target(3), stacked(CAMERAS), Refinement(1.0, 2, 50.0),
        )  # fmt: skip
        off = fitted.positions[0] - PLACE
        squares.append(off @ np.linalg.solve(fitted.covariances[0], off))
        normal = [np.linalg.slogdet(2.0 * np.pi * noise)[1] for noise in told.measurements.noises]
        fits.append(float((-2.0 * fitted.fits[:, 0] - normal).sum()))
    assert np.mean(squares) == pytest.approx(3.0, abs=4.0 * np.sqrt(6.0 / 60))
    assert np.mean(fits) == pytest.approx(12.0 - 3.0, abs=4.0 * np.sqrt(18.0 / 60))


@pytest.mark.parametrize(
    ("margin", "x", "count"), [(0.0, 2.15, 1), (0.0, 2.25, 0), (0.1, 2.25, 1), (0.1, 2.35, 0)]
)
def test_nobody_begins_farther_outside_than_is_followed(
    margin: float, x: float, count: int
) -> None:
    found = births(margin=margin).propose(evidence(exact([[x, 0.3, 0.85]], sigma=0.5)))
    assert (0 if found is None else int((found.existences > 0.5).sum())) == count


@pytest.mark.parametrize(("gap", "count"), [(0.11, 1), (0.09, 0)])
def test_rays_that_pass_farther_apart_than_a_target_do_not_meet(gap: float, count: int) -> None:
    low, high = (
        exact([PLACE], sigma=9.0)[0],
        exact([PLACE + np.array([0.0, 0.0, 0.117])], sigma=9.0)[1],
    )
    found = births(gap=gap).propose(evidence((low, high, NO_BOXES, NO_BOXES)))
    assert (0 if found is None else len(found.existences)) == count


def test_a_camera_without_a_frame_misses_no_newcomer_and_one_that_is_sure_never_does() -> None:
    told = evidence(some(exact([PLACE]), 0, 1))
    plain = births().propose(told)
    assert plain is not None
    seeing = replace(told, seeing=np.array([True, True, False, True]))
    blind = births().propose(seeing)
    assert blind is not None
    odds = [np.log(p) - np.log1p(-p) for p in (plain.existences[0], blind.existences[0])]
    assert odds[1] - odds[0] == pytest.approx(-np.log(0.05), abs=1e-6)
    with np.errstate(divide="raise"):
        sure = births(p_d=1.0).propose(told)
    assert sure is not None
    assert sure.existences[0] == 0.0
    every = births(p_d=1.0).propose(evidence(exact([PLACE])))
    assert every is not None
    assert every.existences[0] > 0.99


# ── who is lost, and for how long

MODEL = FusionModel(empty_room(), FusionParams())


def people(*who: tuple[int, float, float]) -> GaussianMixture:
    """Label, weight and x of each."""
    places = np.array([[x, 0.0, 0.85] for _, _, x in who]).reshape(-1, 3)
    found = world.gaussians(
        places, weights=np.array([w for _, w, _ in who]), sigma=0.1, speed_sigma=0.3
    )
    return found.relabelled(dict(zip(found.labels.tolist(), [k for k, _, _ in who], strict=True)))


def lost_for(steps: int) -> Memory:
    """Somebody who was there once and then was not for some steps."""
    _, memory = recall(Memory.start(6), people((1, 0.9, 0.0)), MODEL, 1)
    for number in range(steps):
        _, memory = recall(memory, people(), MODEL, 10 + number)
    return memory


def test_somebody_is_waited_for_as_long_as_is_said_and_no_longer() -> None:
    steps = round(FusionParams().memory * 10)
    for count, there in ((0, 0), (1, 1), (steps, 1), (steps + 1, 0)):
        memory = lost_for(count)
        assert memory.lost.size == there
        if there:
            assert_allclose(memory.ages, count * 0.1)
            assert memory.newer.tolist() == [10]
    expected = people((1, 0.9, 0.0))
    for _ in range(3):
        expected = MODEL.motion.predict(expected, 1.0)
    assert_allclose(lost_for(3).lost.covariances, expected.covariances)
    assert lost_for(3).lost.weights.tolist() == [0.9]


@pytest.mark.parametrize(("label", "back"), [(9, False), (10, True), (11, True)])
def test_only_who_began_after_somebody_was_lost_may_be_him(label: int, back: bool) -> None:
    labels, memory = recall(lost_for(3), people((label, 0.9, 0.05)), MODEL, 13)
    assert labels.tolist() == [1 if back else label]
    assert memory.lost.size == (0 if back else 1)


@pytest.mark.parametrize(("weight", "back"), [(0.5, False), (0.5 + ABOVE, True)])
def test_somebody_returns_once_it_is_likelier_than_not(weight: float, back: bool) -> None:
    labels, _ = recall(lost_for(3), people((12, weight, 0.05)), MODEL, 13)
    assert labels.tolist() == [1 if back else 12]
    _, known = recall(Memory.start(6), people((1, weight, 0.0)), MODEL, 1)
    assert known.known.size == int(back)


def test_who_returns_is_within_the_gate_of_both_uncertainties() -> None:
    memory = lost_for(2)
    where = MODEL.motion.predict(memory.lost, 1.0)
    spread = where.covariances[0, 0, 0] + 0.1**2
    edge = float(np.sqrt(gate_distance(FusionParams().memory_gate_probability, 3) * spread))
    for x, back in ((edge - 1e-6, True), (edge + 1e-6, False)):
        labels, _ = recall(memory, people((12, 0.9, x)), MODEL, 12)
        assert labels.tolist() == [1 if back else 12]


# ── cameras whose frames fall on different steps


def step_evidence(views: tuple[ViewResult, ...], unexplained: float = 1.0) -> StepEvidence:
    seen = all_boxes(views)
    return StepEvidence(
        evidence(views, unexplained=unexplained), seen.boxes, np.array([v.blind for v in views])
    )


@pytest.mark.parametrize(
    ("step_time", "count"), [(0.05, 4), (0.1, 2), (0.2, 1), (0.11, 1), (0.21, 0), (0.04, 5)]
)
def test_what_was_left_unexplained_is_remembered_for_a_fifth_of_a_second(
    step_time: float, count: int
) -> None:
    recent: missing_frames.Recent = ()
    steps = [step_evidence(some(exact([PLACE]), k % 4)) for k in range(7)]
    for one in steps:
        recent = missing_frames.remember(recent, one, step_time)
    assert list(recent) == steps[::-1][:count]


@pytest.mark.parametrize("age", [1, 2])
def test_the_last_frame_of_a_blind_camera_counts_the_less_the_older_it_is(age: int) -> None:
    own = exact([PLACE, PLACE + np.array([0.5, 0.5, 0.0])])
    before = step_evidence(own)
    before.evidence.unexplained[:] = np.tile([0.5, 0.5 + ABOVE], 4)
    now = step_evidence((NO_FRAME, own[1], NO_FRAME, own[3]))
    between = step_evidence((NO_FRAME, own[1], NO_FRAME, own[3]))
    recent = (before,) if age == 1 else (between, before)
    found = missing_frames.with_recent(now, recent, 0.1, 0.85)
    assert found.starts.tolist() == [0, 1, 3, 4, 6]
    assert found.seeing is not None
    assert found.seeing.tolist() == [False, True, False, True]
    assert_allclose(found.centres[[0, 3]], [own[0].boxes[1, :2], own[2].boxes[1, :2]])
    assert_allclose(found.centres[1:3], own[1].boxes[:, :2])
    walked = age * 0.1 * own[0].boxes[1, 3] / 0.85
    extra = found.measurements.noises[0] - before.evidence.measurements.noises[1]
    assert_allclose(extra, walked**2 * np.eye(3), rtol=1e-9)
    assert_allclose(found.measurements.noises[1:3], now.evidence.measurements.noises[:2])
    alone = missing_frames.with_recent(now, (), 0.1, 0.85)
    assert alone.starts.tolist() == [0, 0, 2, 2, 4]


def test_only_a_newcomer_with_a_box_of_this_step_begins_and_old_boxes_are_no_sources() -> None:
    blind = np.array([True, False, True, False])
    sources = np.array([[0, 0, 1], [-1, 2, 0], [3, 0, 1], [-1, -1, 4]])
    found = missing_frames.with_present_boxes(
        Newborns(np.eye(3), np.tile(np.eye(3), (3, 1, 1)), np.ones(3), sources), blind
    )
    assert found.sources.T.tolist() == [[-1, 2, -1, -1], [-1, 0, -1, 4]]
    assert_allclose(found.positions, np.eye(3)[1:])
    views = (NO_FRAME, NO_BOXES, NO_FRAME, NO_BOXES)
    cameras = missing_frames.cameras_with_frame(views)
    assert cameras is not None
    assert cameras.tolist() == [1, 3]
    assert missing_frames.cameras_with_frame((NO_BOXES,)) is None
    part = Record(
        np.array([[0.1], [0.2]]),
        np.array([[4], [5]]),
        np.array([[0.3], [0.4]]),
        np.array([[6], [7]]),
    )
    whole = missing_frames.extend_record(part, cameras, 4)
    assert whole.detection_probabilities.T.tolist() == [[0.0, 0.1, 0.0, 0.2]]
    assert whole.sources.T.tolist() == [[-1, 4, -1, 5]]
    assert whole.source_weights.T.tolist() == [[0.0, 0.3, 0.0, 0.4]]
    assert whole.hidden_by.T.tolist() == [[-1, 6, -1, 7]]
    seen = all_boxes((NO_FRAME, of_boxes(np.ones((2, 4))), NO_FRAME, of_boxes(np.ones((3, 4)))))
    assert missing_frames.boxes_of_cameras(seen, cameras).starts.tolist() == [0, 2, 5]


# ── what is recorded


def test_pairs_are_recorded_from_one_per_cent_on_and_summed_by_label() -> None:
    ledger = Ledger()
    ledger.add(
        2, np.array([7, 8, 7, 9]), np.array([0, 0, 0, 1]), np.array([0.01, 0.3, 0.2, 0.0099])
    )
    ledger.add(0, np.array([8]), np.array([3]), np.array([0.5]))
    found = ledger.associations(np.array([8, 7, 7, 9]))
    rows = sorted(zip(found.cameras.tolist(), found.components.tolist(), found.boxes.tolist(),
                      found.probabilities.round(6).tolist(), strict=True))  # fmt: skip
    assert rows == [(0, 0, 3, 0.5), (2, 0, 0, pytest.approx(0.3)), (2, 1, 0, pytest.approx(0.21))]
    assert len(Ledger().associations(np.array([1])).cameras) == 0
    assert len(ledger.associations(np.zeros(0, dtype=np.int64)).cameras) == 0
    nothing = np.zeros(0, dtype=np.int64)
    assert len(sum_associations(np.array([1]), nothing, nothing, nothing, np.zeros(0)).cameras) == 0
    blank = Record.blank(2, 1).extended(2)
    assert blank.sources.tolist() == [[-1] * 3] * 2
    assert blank.hidden_by.tolist() == [[-1] * 3] * 2
    assert not blank.detection_probabilities.any()
    assert not blank.source_weights.any()


# ── what a person said


@pytest.mark.parametrize(
    ("apart", "label", "born"),
    [(0.5, 9, True), (0.5, 10, False), (0.5 + 1e-6, 10, True), (0.0, 12, False)],
)
def test_nobody_is_born_where_nobody_is(apart: float, label: int, born: bool) -> None:
    told = constraints_by_step(
        [make(kind="nobody", places=[[3, 0.0, 0.0, 1.0], [5, 0.0, 0.0, 1.0]])]
    )
    assert sorted(told) == [3, 4, 5]
    mixture = people((label, 0.9, apart))
    found, record, free = apply_constraints(
        mixture, Record.blank(2, 1), told[5], MODEL, first_new_label=10, next_label=13
    )
    assert (found.size, record.sources.shape[1], free) == (int(born), int(born), 13)


def test_a_stated_place_updates_whom_it_means_or_begins_somebody() -> None:
    """Joseph's form is Kalman's for one who does not contradict; who is beyond the gate, and could
    stand beside it, is somebody else."""
    p = FusionParams()
    mixture = people((3, 0.6, 0.0), (4, 0.9, 1.5))

    def said(x: float, *more: list[float]) -> tuple[GaussianMixture, int]:
        told = constraints_by_step(
            [make(kind="here", places=[[2, x, 0.0, 0.85], *more], accuracy=0.2)]
        )
        found, record, free = apply_constraints(
            mixture, Record.blank(4, 2), told[2], MODEL, first_new_label=9, next_label=9
        )
        assert record.sources.shape[1] == found.size
        return found, free

    found, free = said(0.1)
    assert free == 9
    gain = 0.01 / (0.01 + 0.04)
    assert found.means[0, :3] == pytest.approx([0.1 * gain, 0.0, 0.85])
    assert found.covariances[0, 0, 0] == pytest.approx(0.01 * (1.0 - gain))
    assert found.weights.tolist() == [pytest.approx(0.999), 0.9]
    assert_array_equal(found.means[1], mixture.means[1])
    spread = 0.01 + 0.04
    edge = float(np.sqrt(MODEL.place_gate * spread))
    assert MODEL.near < edge
    for x, size in ((-edge + 1e-3, 2), (-edge - 1e-3, 3)):
        found, free = said(x)
        assert (found.size, free) == (size, 9 + size - 2)
    born = found.take(np.array([2]))
    assert born.weights[0] == pytest.approx(0.999)
    assert born.labels.tolist() == [9]
    assert born.means[0, :3] == pytest.approx([-edge, 0.0, 0.85], abs=2e-3)
    assert np.diag(born.covariances[0]) == pytest.approx([0.04] * 3 + [p.start_velocity**2] * 3)
    # whom it names goes there, however far
    found, free = said(-edge - 1e-3, [2, 1.45, 0.0, 0.85])
    assert (found.size, free) == (2, 9)
    assert abs(found.means[1, 0] + edge) < 0.2
    assert_array_equal(found.means[0], mixture.means[0])


def here(*places: Many[float], accuracy: float = 0.2) -> PlaceConstraints:
    """Somebody is said to be at each of these places."""
    said = [make(kind="here", places=[[0, *place]], accuracy=accuracy) for place in places]
    return constraints_by_step(said)[0]


def constrained(
    mixture: GaussianMixture, told: PlaceConstraints
) -> tuple[GaussianMixture, Record, int]:
    """What a place makes of components; labels from 9 on are free."""
    blank = Record.blank(4, mixture.size)
    return apply_constraints(mixture, blank, told, MODEL, first_new_label=9, next_label=9)


def test_a_place_that_contradicts_widens_whom_it_means_before_and_after() -> None:
    """P + W instead of P along x, W = (1 − 1/a) ν νᵀ, and W is left."""
    found, _, _ = constrained(people((3, 0.6, 0.0)), here([0.6, 0.0, 0.85]))
    a = 0.36 / (0.01 + 0.04)
    widened = (1.0 - 1.0 / a) * 0.36
    wide = 0.01 + widened
    assert found.means[0, 0] == pytest.approx(0.6 * wide / (wide + 0.04))
    assert found.covariances[0, 0, 0] == pytest.approx(wide * 0.04 / (wide + 0.04) + widened)
    assert found.covariances[0, 1, 1] == pytest.approx(0.01 * 0.04 / 0.05)


def test_all_components_of_whom_a_place_means_count_and_new_ones_have_labels_of_their_own() -> None:
    both = people((3, 0.5, 0.0), (3, 0.3, 0.9), (4, 0.9, 2.0))
    found, _, _ = constrained(both, here([0.0, 0.0, 0.85]))
    assert found.weights.tolist() == [pytest.approx(0.999 - 0.3), 0.3, 0.9]
    sure = people((3, 0.9, 0.0), (3, 0.3, 0.9))
    assert constrained(sure, here([0.0, 0.0, 0.85]))[0].weights.tolist() == [0.9, 0.3]
    more, record, free = constrained(both, here([-1.5, 1.5, 0.85], [-1.5, -1.5, 0.85]))
    assert (more.labels.tolist(), free, record.sources.shape) == ([3, 3, 4, 9, 10], 11, (4, 5))


@pytest.mark.parametrize(("beyond", "named"), [(-0.01, True), (0.01, False)])
def test_a_reference_means_who_is_within_its_gate_of_three_tenths_of_a_metre(
    beyond: float, named: bool
) -> None:
    apart = float(np.sqrt(MODEL.place_gate * (0.01 + 0.3**2))) + beyond
    told = constraints_by_step(
        [make(kind="here", places=[[0, -2.0, 0.0, 0.85], [0, apart, 0.0, 0.85]], accuracy=0.2)]
    )[0]
    found, _, _ = constrained(people((3, 0.6, 0.0)), told)
    assert found.size == (1 if named else 2)


@pytest.mark.parametrize("seed", range(5))
def test_a_place_means_the_component_of_the_largest_density_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mixture = people(*((k, float(rng.uniform(0.1, 0.9)), 0.0) for k in range(1, 6)))
    mixture.means[:, :3] += rng.normal(0.0, 0.15, (5, 3))
    mixture.covariances[:] *= rng.uniform(0.5, 20.0, (5, 1, 1))
    place = np.array([0.05, 0.0, 0.85])
    densities = [
        weight * multivariate_normal(mean[:3], spread[:3, :3] + 0.04 * np.eye(3)).pdf(place)
        for weight, mean, spread in zip(
            mixture.weights, mixture.means, mixture.covariances, strict=True
        )
    ]
    found, _, _ = constrained(mixture, here(place.tolist()))
    assert np.flatnonzero(found.weights != mixture.weights).tolist() == [np.argmax(densities)]


def test_after_a_place_components_of_the_phd_filter_are_heaviest_first() -> None:
    tracks = people((3, 0.6, 0.0), (4, 0.9, 1.5))
    p = FusionParams(birth="measurements", memory=0.0)
    fusion = SequentialPhd(empty_room(), RunParameters(fusion=p))
    state = SequentialPhdState(tracks, 50, Memory.start(6))
    told = here([-1.0, 1.0, 0.85])
    _, result = fusion.step(state, (NO_FRAME,) * 4, told)
    assert result.posterior.labels.tolist() == [50, 4, 3]
    assert (np.diff(result.posterior.weights) <= 0.0).all()


def test_who_was_renamed_to_whom_is_waited_for_no_more() -> None:
    memory = Memory(
        people((7, 0.9, 0.0)), people((1, 0.9, 0.0), (2, 0.8, 1.0)), np.array([0.1, 0.2]),
        np.array([5, 6]),
    ).relabelled({7: 1})  # fmt: skip
    assert memory.known.labels.tolist() == [1]
    assert memory.lost.labels.tolist() == [2]
    assert (memory.ages.tolist(), memory.newer.tolist()) == ([0.2], [6])


def test_of_too_many_meeting_points_those_whose_rays_pass_nearest_are_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tracker.fusion.measurement_births._MOST_SEEDS", 1)
    other = PLACE + np.array([-0.9, 0.5, 0.2])  # of whom the second camera is a bit off
    first, second = exact([other, PLACE])[0], exact([other + np.array([0.0, 0.0, 0.05]), PLACE])[1]
    found = births().propose(evidence((first, second, NO_BOXES, NO_BOXES)))
    assert found is not None
    assert found.sources.T.tolist() == [[1, 1, -1, -1]]


@pytest.mark.parametrize(("beyond", "born"), [(-0.01, False), (0.01, True)])
def test_a_place_above_a_person_is_somebody_elses_from_their_height_on(
    beyond: float, born: bool
) -> None:
    """Two people cannot stand in one place, but one may be above the other, as on a gallery."""
    up = MODEL.height + beyond
    told = constraints_by_step(
        [make(kind="here", places=[[0, 0.0, 0.0, 0.85 + up]], accuracy=0.2)]
    )[0]
    assert up**2 / (0.01 + 0.04) > MODEL.place_gate
    found, _, _ = apply_constraints(
        people((3, 0.6, 0.0)), Record.blank(4, 1), told, MODEL, first_new_label=9, next_label=9
    )
    assert found.size == 1 + born


def test_the_heavier_of_two_is_meant_where_both_are_as_near() -> None:
    mixture = people((3, 0.3, -0.1), (4, 0.8, 0.1))
    told = constraints_by_step([make(kind="here", places=[[0, 0.0, 0.0, 0.85]], accuracy=0.1)])[0]
    found, _, _ = apply_constraints(
        mixture, Record.blank(1, 2), told, MODEL, first_new_label=9, next_label=9
    )
    assert found.weights.tolist() == [0.3, pytest.approx(0.999)]
    nobody, record, free = apply_constraints(
        people(), Record.blank(1, 0), told, MODEL, first_new_label=9, next_label=9
    )
    assert (nobody.labels.tolist(), record.sources.shape, free) == ([9], (1, 1), 10)


# ── the label of a component


def stepped(tracks: GaussianMixture, **changes: object) -> tuple[ndarray, ndarray, int]:
    """Weights and labels after a step without frames, and the label that is free then."""
    p = FusionParams(birth="measurements", memory=0.0).model_copy(update=changes)
    fusion = SequentialPhd(empty_room(), RunParameters(fusion=p))
    state, result = fusion.step(SequentialPhdState(tracks, 50, Memory.start(6)), (NO_FRAME,) * 4)
    return result.posterior.weights, result.posterior.labels, state.next_label


@pytest.mark.parametrize(("other", "parted"), [(0.5, False), (0.51, True)])
def test_two_sure_components_of_one_label_are_two_people(other: float, parted: bool) -> None:
    """The one nearest to where the heaviest was goes on under the label."""
    tracks = world.gaussians(
        np.array([[0.0, 0, 0.85], [1.0, 0, 0.85]]), weights=np.array([0.9, other])
    )
    same = tracks.relabelled({2: 1})
    _, labels, free = stepped(same, survival_probability=1.0)
    assert labels.tolist() == [1, 50 if parted else 1]
    assert free == (51 if parted else 50)


# ── tracks


@pytest.mark.parametrize(("weight", "there"), [(0.5, False), (0.5 + ABOVE, True)])
def test_a_target_is_above_the_threshold(weight: float, there: bool) -> None:
    fusion, nobody = MultiBernoulli(empty_room(), RunParameters()), GaussianMixture.empty(6)
    state = MultiBernoulliState(
        people((4, 0.9, 0.0)), nobody, 50, Memory.start(6), IdentityBeliefs.none()
    )
    _, result = fusion.step(state, (NO_FRAME,) * 4)
    exactly = replace(result, posterior=replace(result.posterior, weights=np.array([weight])))
    assert len(extract([exactly], cameras=4, extraction_threshold=0.5)) == int(there)


@pytest.mark.parametrize(
    ("place", "there"),
    [((2.3, 0, 0.85), True), ((2.3 + ABOVE, 0, 0.85), False), ((0, -2.3, 0.85), True),
     ((0, 0, -0.5), True), ((0, 0, -0.51), False), ((0, 0, 2.3), True), ((0, 0, 2.31), False)],
)  # fmt: skip
def test_bounds_are_the_room_its_margin_and_what_is_below_the_floor(
    place: tuple[float, ...], there: bool
) -> None:
    bounds = Bounds(ROOM, 0.1, 0.4)
    assert bounds.contain(np.array([place], dtype=float)).tolist() == [there]


def test_components_that_boxes_made_are_gathered_from_the_last_camera_to_the_first() -> None:
    """Cardinality and the first two moments stay; of each group the heaviest names it."""
    rng = np.random.default_rng(4)
    sources = np.array([[0, 1, 1, 0, -1, -1], [0, -1, -1, 0, 2, -1]])
    mixture = GaussianMixture(rng.uniform(0.1, 1.0, 6), rng.normal(size=(6, 3)),
                              np.tile(0.1 * np.eye(3), (6, 1, 1)), np.arange(6))  # fmt: skip
    nothing = np.zeros((2, 6))
    found, leaders = by_boxes(FusionResult(mixture, nothing, sources, nothing, sources))
    groups = [[4], [0, 3], [1, 2], [5]]
    assert sorted(leaders.tolist()) == sorted(
        max(g, key=lambda k: mixture.weights[k]) for g in groups
    )
    assert found.cardinality == pytest.approx(mixture.cardinality)
    assert_allclose(found.weights @ found.means, mixture.weights @ mixture.means)
    for weight, mean, leader in zip(found.weights, found.means, leaders, strict=True):
        own = next(g for g in groups if leader in g)
        assert weight == pytest.approx(mixture.weights[own].sum())
        assert_allclose(mean, mixture.weights[own] @ mixture.means[own] / weight)
