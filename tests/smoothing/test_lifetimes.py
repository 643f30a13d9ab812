"""Who was there, by cameras that agree, by looks, and beside a track of greater odds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tests.smoothing.known import PLAIN, Known, Step, backwards, known
from tests.smoothing.test_boundaries import standing
from tracker.parameters.catalogue import METHODS, RunParameters, method_of
from tracker.parameters.values import with_values
from tracker.smoothing import create
from tracker.smoothing.lifetimes import (
    UNSURE,
    estimate_lifetimes,
    extend_paths,
    independent_share,
    log_miss_likelihoods,
    select_separate_links,
)
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.smoother import BoxAssociations, Smoother

STEPS = 12
HIT = -np.log(0.05)
"""Log odds by which a camera of p_D = 0.95 votes."""


def odds_of(cameras: int, log_ratio: float | None, *, after: int = 0) -> float:
    """Of somebody whom so many cameras show, whose every box looks so much like a person, and who
    is gone for so many steps at the end of the recording."""
    scene = known(world.stand((0.3, 0.2), STEPS)[:, None], cameras=world.ring(cameras))
    views = scene.views
    if log_ratio is not None:
        views = [
            tuple(replace(view, log_ratios=np.full(len(view.boxes), log_ratio)) for view in step)
            for step in views
        ]
    smoother = Smoother(scene.whole, PLAIN.fusion, views)
    smoother.frames += after
    paths, links = scene.paths()
    nothing = np.zeros((cameras, STEPS))
    shared = BoxAssociations(links, nothing, nothing, nothing.astype(np.int64))
    return float(estimate_lifetimes(smoother, paths, shared, PLAIN.smoothing)[1][0])


@pytest.mark.parametrize(
    ("cameras", "log_ratio", "vote"),
    [
        # where nothing is told of looks every camera votes
        (1, None, HIT), (2, None, 2 * HIT), (3, None, 3 * HIT),
        # of a box in one camera only its looks count
        (1, 0.01, 0.01), (1, -1.0, -1.0), (1, 2.0, 2.0),
        # two meet anyway: each beyond the second outweighs as much doubt as a vote
        (2, 2.0, 2 * HIT + 4.0), (2, -3.5, 2 * HIT - 7.0),
        (3, 2.0, 3 * HIT + 6.0), (3, -3.5, 4 * HIT - 10.5), (3, -0.5, 3 * HIT),
        (4, -3.5, 6 * HIT - 14.0),
    ],
)  # fmt: skip
def test_what_cameras_and_looks_say_of_a_whole_life(
    cameras: int, log_ratio: float | None, vote: float
) -> None:
    """All of a recording's steps, of which a share is new evidence; nobody comes or goes."""
    new = independent_share(0.1, PLAIN.smoothing.memory)
    stays = (STEPS - 1) * np.log(PLAIN.fusion.survival_probability)
    expected = STEPS * new * vote + stays
    if vote < 0.0:  # who is likelier nobody was there for a single step
        assert odds_of(cameras, log_ratio) < 0.0
        return
    assert odds_of(cameras, log_ratio) == pytest.approx(expected, rel=1e-6)


def test_who_leaves_has_a_quarter_of_the_log_odds_of_coming_and_leaving() -> None:
    """Both ends have the same, so that a recording seen backwards in time gives the same."""
    steps = 1.0 / independent_share(0.1, PLAIN.smoothing.memory)
    come = np.log(PLAIN.fusion.birth_rate * steps * 0.1)
    leave = np.log(1.0 - PLAIN.fusion.survival_probability**steps)
    expected = odds_of(2, None) + (come + leave) / 4.0
    assert odds_of(2, None, after=5) == pytest.approx(expected, rel=1e-3)


def test_a_miss_says_as_much_against_somebody_as_the_camera_should_have_seen() -> None:
    nothing = Links(*(np.zeros(0, dtype=np.int64) for _ in range(3)), np.zeros(0))
    chances = np.array([[0.5, 1.0], [0.9, 0.0]])
    missed = np.array([[1.0, 0.5], [0.2, 1.0]])
    found = log_miss_likelihoods(
        BoxAssociations(nothing, chances, missed, np.zeros((2, 2), dtype=np.int64))
    )
    assert found == pytest.approx([np.log(0.5) + 0.2 * np.log(0.1), 0.5 * np.log(1e-6)])


def test_paths_are_carried_on_to_both_sides_alike_and_within_the_recording() -> None:
    """One who walks and one who is there at both ends; seen backwards it is the same."""
    scene = known(world.stand((0.3, 0.2), 10)[:, None])
    smoother = scene.smoother()
    paths = standing((1, 2, 6, 0.0), (2, 0, 9, 1.0))
    states = paths.states.copy()
    states[:5, 0], states[:5, 3] = 0.1 * np.arange(5), 1.0
    walking = paths.with_states(states, paths.covariances)
    longer, there = extend_paths(smoother, walking, 3)
    assert longer.firsts.tolist() == [0, 0]
    assert longer.lasts.tolist() == [9, 9]
    assert there.tolist() == [UNSURE] * 2 + [1.0] * 5 + [UNSURE] * 3 + [1.0] * 10
    motion = smoother.model.motion
    state, spread = states[4], paths.covariances[4]
    for row in (7, 8, 9):
        state = motion.transition @ state
        spread = motion.transition @ spread @ motion.transition.T + motion.noise
        assert_allclose(longer.states[row], state)
        assert_allclose(longer.covariances[row], spread)
    # the same seen from behind
    turned = states.copy()
    turned[:5], turned[5:] = states[:5][::-1], states[5:][::-1]
    turned[:, 3:] *= -1.0
    back = standing((1, 3, 7, 0.0), (2, 0, 9, 1.0)).with_states(turned, paths.covariances)
    other, _ = extend_paths(backwards(scene).smoother(), back, 3)
    assert other.firsts.tolist() == [0, 0]
    assert_allclose(other.states[:10, :3], longer.states[:10, :3][::-1], atol=1e-12)
    variances = longer.covariances[:, range(3), range(3)]
    assert (np.diff(variances[:3], axis=0) < 0.0).all(), "the farther back the less is known"
    none, _ = extend_paths(smoother, walking, 0)
    assert_allclose(none.states, states)


WIDTH = 2.0 * float(world.PERSON[0])
MANY, BEGIN, END = 30, 8, 24
ALONE = world.walk([(-1.0, 0.2), (0.9, -0.3)], [0.0, MANY / 10.0], 10.0)
DOUBTFUL = -3.5
"""Two cameras cannot outweigh it, a third does."""


def second(offset_at_first: float, offset_at_last: float) -> ndarray:
    """Somebody who is there for a while, so many metres beside the one who is always there."""
    path = np.full_like(ALONE, np.nan)
    path[BEGIN:END] = ALONE[BEGIN:END]
    path[BEGIN:END, 1] += np.linspace(offset_at_first, offset_at_last, END - BEGIN)
    return path


def doubtful(scene: Known) -> list[Step]:
    """Stage 1 with every box looking doubtful."""
    return [
        tuple(replace(view, log_ratios=np.full(len(view.boxes), DOUBTFUL)) for view in step)
        for step in scene.views
    ]


def tracked(
    other: ndarray, *, swapped: bool = False, several: bool = True, embeddings: bool = True
) -> tuple[Smoother, Paths, BoxAssociations]:
    """Both as they were, and whose box each is."""
    scene = known(world.together(*([other, ALONE] if swapped else [ALONE, other])))
    views = doubtful(scene) if embeddings else scene.views
    smoother = Smoother(scene.whole, PLAIN.fusion, views, several_boxes=several)
    paths, _ = scene.paths(sigma=0.03)
    return smoother, paths, smoother.associate(paths)


def everywhere(paths: Paths) -> ndarray:
    """Everybody is there at each of their rows."""
    return np.ones(len(paths.states))


@pytest.mark.parametrize("swapped", [False, True])
def test_nobody_is_shown_apart_who_never_leaves_the_side_of_who_is_surer(swapped: bool) -> None:
    smoother, paths, shared = tracked(second(0.6 * WIDTH, 0.9 * WIDTH), swapped=swapped)
    surer = 1 if swapped else 0
    odds = np.where(np.arange(2) == surer, 9.0, 4.0)
    of_surer = paths.owners[shared.links.rows] == surer
    assert np.array_equal(
        select_separate_links(smoother, paths, shared, everywhere(paths), odds), of_surer
    )


def test_who_came_from_elsewhere_is_shown_apart_wherever_the_boxes_are() -> None:
    smoother, paths, shared = tracked(second(4.0 * WIDTH, 0.6 * WIDTH))
    apart = select_separate_links(smoother, paths, shared, everywhere(paths), np.array([9.0, 4.0]))
    own = paths.owners[shared.links.rows] == 1
    steps = paths.steps[shared.links.rows]
    assert apart[~own].all()
    assert apart[own & (steps < BEGIN + 5)].all()
    late = own & (steps > END - 4)
    assert apart[late].any()
    assert not apart[late].all(), "one camera sees them one behind the other"


def test_who_is_as_likely_gone_takes_nothing_from_who_stands_there_now() -> None:
    smoother, paths, shared = tracked(second(0.6 * WIDTH, 0.9 * WIDTH))
    there = np.where(paths.steps < (BEGIN + END) // 2, 1.0, 0.5)
    there[paths.owners == 1] = 1.0
    apart = select_separate_links(smoother, paths, shared, there, np.array([9.0, 4.0]))
    late = paths.steps[shared.links.rows] >= (BEGIN + END) // 2
    assert apart[late & (paths.owners[shared.links.rows] == 1)].all()


def test_equals_take_nothing_from_each_other() -> None:
    smoother, paths, shared = tracked(second(0.6 * WIDTH, 0.9 * WIDTH))
    assert select_separate_links(
        smoother, paths, shared, everywhere(paths), np.array([4.0, 4.0])
    ).all()


def test_doubtful_boxes_beside_somebody_are_nobodys_and_elsewhere_somebodys() -> None:
    beside = tracked(second(0.6 * WIDTH, 0.9 * WIDTH))
    elsewhere = tracked(second(4.0 * WIDTH, 5.0 * WIDTH))
    odds = [estimate_lifetimes(*one, PLAIN.smoothing)[1] for one in (beside, elsewhere)]
    assert odds[0][0] > 0.0 > odds[0][1]
    assert (odds[1] > 0.0).all()


def test_what_a_detector_keeps_beside_another_box_shows_somebody_more() -> None:
    other = second(0.6 * WIDTH, 0.9 * WIDTH)
    drawn = tracked(other, embeddings=False)
    kept = tracked(other, embeddings=False, several=False)
    assert estimate_lifetimes(*drawn, PLAIN.smoothing)[1][1] < 0.0, "two boxes around one person"
    assert estimate_lifetimes(*kept, PLAIN.smoothing)[1][1] > 0.0


@pytest.mark.parametrize("name", list(METHODS["single_view"]))
def test_who_looks_at_pictures_by_itself_may_draw_several_boxes(name: str) -> None:
    on_boxes = {"none", "detection_phd", "onnx_detector"}
    used = method_of("single_view", name).used(RunParameters())
    assert used.finds_people == (name not in on_boxes)


def test_whoever_the_filter_had_and_hindsight_has_not_is_told_of() -> None:
    scene = known(world.together(ALONE, second(0.6 * WIDTH, 0.9 * WIDTH)))
    on_pictures = with_values(PLAIN, {"single_view": "shapes", "smoothing_method": "positions"})
    fused = scene.fused(np.tile([3, 5], (MANY, 1)))
    smoothed = create(scene.whole, on_pictures).smooth(doubtful(scene), fused)
    assert smoothed is not None
    assert set(smoothed.labels.tolist()) == {3}
    (gone,) = smoothed.decisions
    assert (gone.kind, gone.label, gone.other) == ("removed", 5, 5)
    assert 0.5 < gone.probability <= 1.0
    assert gone.against == pytest.approx(1.0 - gone.probability)
    assert gone.step <= BEGIN
    assert gone.reason == "over its whole life it is likelier nobody"
