"""Which boxes are evidence for a track beside a track of greater odds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests import world
from tests.smoothing.known import PLAIN, Known, Step, known
from tracker.parameters.catalogue import METHODS, RunParameters, method_of
from tracker.parameters.values import with_values
from tracker.smoothing import create
from tracker.smoothing.lifetimes import estimate_lifetimes, select_separate_links
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import BoxAssociations, Smoother

WIDTH = 2.0 * float(world.PERSON[0])
STEPS, BEGIN, END = 30, 8, 24
ALONE = world.walk([(-1.0, 0.2), (0.9, -0.3)], [0.0, STEPS / 10.0], 10.0)
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


def test_who_is_gone_takes_nothing_from_who_stands_there_now() -> None:
    smoother, paths, shared = tracked(second(0.6 * WIDTH, 0.9 * WIDTH))
    there = np.where(paths.steps < (BEGIN + END) // 2, 1.0, 0.0)
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
    fused = scene.fused(np.tile([3, 5], (STEPS, 1)))
    smoothed = create(scene.whole, on_pictures).smooth(doubtful(scene), fused)
    assert smoothed is not None
    assert set(smoothed.labels.tolist()) == {3}
    (gone,) = smoothed.decisions
    assert (gone.kind, gone.label, gone.other) == ("removed", 5, 5)
    assert 0.5 < gone.probability <= 1.0
    assert gone.against == pytest.approx(1.0 - gone.probability)
    assert gone.step <= BEGIN
    assert gone.reason == "over its whole life it is likelier nobody"
