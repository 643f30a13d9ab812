"""The filter's results as paths and links, and the smoothed rows as tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tests.smoothing.known import known
from tracker.fusion import trajectories
from tracker.fusion.protocol import Associations, FusionResult
from tracker.fusion.trajectories import Bounds
from tracker.smoothing.protocol import Smoothed, names_of, tracks_of
from tracker.smoothing.stage import read_links, read_paths
from tracker.steps import Steps

ROOM = world.volume()


def walkers() -> tuple[list[FusionResult], ndarray]:
    """Label 0 from step 2 on, lost at steps 5 and 6; label 8 from step 1 to 7. Of the first two
    steps of each the filter is not sure."""
    paths = world.together(world.walk([(-1.0, 0.0), (1.0, 0.0)], [0.0, 1.0], 10.0),
                           world.stand((0.5, 1.5), 10))  # fmt: skip
    labels = np.tile([0, 8], (10, 1))
    labels[:2, 0], labels[5:7, 0], labels[:1, 1], labels[8:, 1] = -1, -1, -1, -1
    fused = known(paths).fused(labels)
    unsure = {0: (2, 3), 8: (1, 2)}
    for step, one in enumerate(fused):
        weights = [0.3 if step in unsure[k] else 0.99 for k in one.posterior.labels.tolist()]
        fused[step] = replace(one, posterior=replace(one.posterior, weights=np.array(weights)))
    return fused, paths


def stored(results: list[FusionResult]) -> Steps[FusionResult]:
    """The results as a run has them."""
    return Steps.of(results, FusionResult)


def test_a_path_reaches_from_the_first_box_to_the_last_report_and_through_gaps() -> None:
    fused, places = walkers()
    sources = fused[2].sources.copy()
    sources[:, 0] = -1
    nobody = replace(fused[2], sources=sources)  # no box fed the first there
    for results, first in ((fused, 2), ([*fused[:2], nobody, *fused[3:]], 3)):
        tracks = trajectories.extract(results, cameras=3, extraction_threshold=0.5)
        paths, had = read_paths(stored(results), tracks, 6)
        assert paths.labels.tolist() == [0, 8]
        assert paths.firsts.tolist() == [first, 1]
        assert paths.lasts.tolist() == [9, 7]
        own = paths.owners == 0
        assert paths.steps[own & ~had].tolist() == [5, 6]
        assert had[~own].all()
        # straight through the gap, and of a square metre there
        assert_allclose(paths.states[own, :3], places[first:, 0], atol=1e-12)
        wide = np.isin(paths.steps, [5, 6]) & own
        assert_allclose(paths.covariances[wide], np.tile(np.eye(6), (2, 1, 1)))
        assert_allclose(paths.covariances[~wide][:, 0, 0], 0.05**2)


def test_links_are_the_associations_of_rows_that_there_are() -> None:
    fused, places = walkers()
    scene = known(places)
    tracks = trajectories.extract(fused, cameras=3, extraction_threshold=0.5)
    paths, _ = read_paths(stored(fused), tracks, 6)
    links = read_links(stored(fused), paths, scene.smoother().cameras)
    whose = np.array([0, 1])[paths.owners[links.rows]]
    for camera, one in enumerate(scene.seen):
        own = links.cameras == camera
        assert_array_equal(one.people[links.boxes[own]], whose[own])
        assert_array_equal(one.frames[links.boxes[own]], paths.steps[links.rows[own]])
        assert sorted(paths.steps[links.rows[own & (whose == 0)]]) == [2, 3, 4, 7, 8, 9]
        assert sorted(paths.steps[links.rows[own & (whose == 1)]]) == list(range(1, 8))
    # a path that is shorter than the filter's label, or is not there, takes none of its boxes
    short = paths.firsts + np.array([1, 0])
    cut = replace(paths, firsts=short, starts=np.array([0, 6, 13]), labels=np.array([0, 99]))
    some = read_links(stored(fused), cut, scene.smoother().cameras)
    assert set(cut.owners[some.rows].tolist()) == {0}
    assert sorted(set(cut.steps[some.rows].tolist())) == [3, 4, 7, 8]
    none = [replace(one, associations=Associations.none()) for one in fused]
    assert len(read_links(stored(none), paths, scene.smoother().cameras).rows) == 0


def rows(places: list[tuple[int, int, float, float]]) -> Smoothed:
    """Step, label, x and existence of each row; the variances are 1, 4 and 9 square millimetres."""
    count = len(places)
    means = np.zeros((count, 6))
    means[:, 0], means[:, 2] = [row[2] for row in places], 0.85
    return Smoothed(
        np.array([row[0] for row in places]), np.array([row[1] for row in places]), means,
        np.tile(np.diag([1e-6, 4e-6, 9e-6, 1.0, 1.0, 1.0]), (count, 1, 1)),
        np.array([row[3] for row in places]), np.ones((count, 2), dtype=bool),
        heights=1.7 + means[:, 0], sigma_heights=0.1 + means[:, 0],
    )  # fmt: skip


def told(smoothed: Smoothed, fused: list[FusionResult], ids: dict[int, int],
         near: float = 0.25) -> trajectories.Trajectories:  # fmt: skip
    """The tracks, from a threshold of half on."""
    return tracks_of(
        smoothed, fused, ids, extraction_threshold=0.5, bounds=Bounds(ROOM, 0.0), near=near
    )


def results(*steps: list[tuple[int, float, float]]) -> list[FusionResult]:
    """Label, x and weight of the components of each step."""
    found = []
    for own in steps:
        places = np.array([[x, 0.0, 0.85] for _, x, _ in own]).reshape(-1, 3)
        mixture = world.gaussians(places, weights=np.array([w for _, _, w in own]))
        mixture = replace(mixture, labels=np.array([k for k, _, _ in own], dtype=np.int64))
        nothing = np.zeros((2, len(own)))
        none = np.full(nothing.shape, -1)
        found.append(FusionResult(mixture, nothing, none, nothing, none))
    return found


def test_who_is_likelier_there_than_not_and_in_the_room_is_reported() -> None:
    found = told(rows([(0, 5, 0.0, 0.5), (0, 7, 0.0, 0.5 + 1e-9), (1, 5, 2.2, 0.9),
                       (1, 7, 2.2 + 1e-6, 0.9)]), results([], []), {5: 3})  # fmt: skip
    assert list(zip(found.frames.tolist(), found.ids.tolist(), strict=True)) == [(0, 4), (1, 3)]
    assert_allclose(found.sigmas, [[1e-3, 2e-3, 3e-3]] * 2)
    assert found.components.tolist() == found.labels.tolist() == [-1, -1]


def test_a_label_keeps_its_number_and_others_get_the_next_ones() -> None:
    smoothed = rows([(0, 9, 0.0, 0.9), (0, 8, 1.0, 0.9), (1, 2, -1.0, 0.9), (1, 8, 1.0, 0.9)])
    found = told(smoothed, results([], []), {8: 4, 2: 1})
    assert found.frames.tolist() == [0, 0, 1, 1]
    assert found.ids.tolist() == [4, 5, 1, 4]
    assert found.positions[:, 0].tolist() == [1.0, 0.0, -1.0, 1.0]
    assert_allclose(found.heights, [2.7, 1.7, 0.7, 2.7])
    assert_allclose(found.sigma_heights, [1.1, 0.1, -0.9, 1.1])
    assert told(smoothed, results([], []), {}).ids.tolist() == [1, 2, 2, 3]
    assert names_of(smoothed, found) == {8: 4, 9: 5, 2: 1}
    elsewhere = replace(smoothed, means=smoothed.means + 1e-3)
    assert names_of(elsewhere, found) == {}


@pytest.mark.parametrize(
    ("components", "found"),
    [
        ([(6, -0.25, 0.9)], [(0, 6), (-1, -1)]),  # at exactly the reach
        ([(6, -0.2500001, 0.9)], [(-1, -1), (-1, -1)]),
        ([(6, -0.2, 0.05)], [(-1, -1), (-1, -1)]),  # too faint to stand for anybody
        ([(6, -0.2, 0.0500001)], [(0, 6), (-1, -1)]),
        ([(6, 0.6, 0.9), (3, 0.1, 0.9)], [(1, 3), (0, 6)]),
        ([(6, 0.24, 0.9), (3, -0.2, 0.9)], [(1, 3), (-1, -1)]),  # of two the nearest has it
        ([], [(-1, -1), (-1, -1)]),
    ],
)
def test_a_component_stands_for_the_person_next_to_it(
    components: list[tuple[int, float, float]], found: list[tuple[int, int]]
) -> None:
    """Two people half a metre apart."""
    smoothed = rows([(1, 1, 0.0, 0.9), (1, 2, 0.5, 0.9)])
    tracks = told(smoothed, results([], components), {})
    assert list(zip(tracks.components.tolist(), tracks.labels.tolist(), strict=True)) == found


def test_a_component_within_reach_of_two_tracks_is_of_the_nearer_alone() -> None:
    smoothed = rows([(1, 1, 0.0, 0.9), (1, 2, 0.5, 0.9)])
    tracks = told(smoothed, results([], [(6, 0.2, 0.9)]), {}, near=1.0)
    assert tracks.components.tolist() == [0, -1]
    assert tracks.labels.tolist() == [6, -1]
