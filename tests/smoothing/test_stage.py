"""The whole stage: what it reads, its symmetries, what it joins and parts, where tracks end."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tests.random_rooms import random_room
from tests.smoothing.known import CAMERAS, PLAIN, Known, backwards, known
from tests.smoothing.test_boundaries import standing
from tracker.corrections.kinds import make
from tracker.corrections.outcomes import outcomes
from tracker.evaluation import evaluate_sequence
from tracker.fusion import trajectories
from tracker.fusion.protocol import Associations, FusionResult
from tracker.fusion.trajectories import Bounds
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.smoothing import create
from tracker.smoothing.protocol import Smoothed, names_of, tracks_of
from tracker.smoothing.stage import _outside_spans, _removal, read_links, read_paths
from tracker.steps import Steps

SETTLED = with_values(PLAIN, {"smoothing_method": "identities", "smoothing.learning": True})
POSITIONS = with_values(SETTLED, {"smoothing_method": "positions"})
STEPS = 30


def smoothed(scene: Known, labels: ndarray, parameters: RunParameters = SETTLED) -> Smoothed:
    """Stage 3 of the walkers, whom the filter had under some labels, (steps, people)."""
    found = create(scene.whole, parameters).smooth(scene.views, scene.fused(labels))
    assert found is not None
    return found


def passing() -> Known:
    """Two who pass each other at half a metre; the second is not seen for four steps."""
    paths = world.together(
        world.walk([(-1.2, 0.25), (1.2, 0.25)], [0.0, 3.0], 10.0),
        world.walk([(1.2, -0.25), (-1.2, -0.25)], [0.0, 3.0], 10.0),
    )
    return known(paths, hidden=lambda camera, person, step: person == 1 and 20 <= step < 24)


def labels_of(scene: Known) -> ndarray:
    """Each of the filter's labels is one person's until the second is lost for four steps."""
    labels = np.tile([4, 7], (STEPS, 1))
    labels[20:24, 1], labels[24:, 1] = -1, 9
    return labels


def people_of(found: Smoothed) -> set[tuple[int, ...]]:
    """The steps of each track."""
    return {tuple(found.frames[found.labels == k].tolist()) for k in set(found.labels.tolist())}


def test_a_recording_seen_backwards_has_the_same_tracks_links_and_ends() -> None:
    scene = passing()
    labels = labels_of(scene)
    one = smoothed(scene, labels)
    other = smoothed(backwards(scene), labels[::-1])
    assert sorted(set(one.labels.tolist())) == [4, 7]
    assert len(one.frames) == len(other.frames) == 2 * STEPS
    names = dict(zip(one.labels[one.frames == 0], other.labels[other.frames == STEPS - 1],
                     strict=True))  # fmt: skip
    if np.sign(one.means[0, 1]) != np.sign(other.means[-2, 1]):
        names = {4: names[7], 7: names[4]}
    for label, name in names.items():
        a, b = one.labels == label, other.labels == name
        assert_array_equal(one.frames[a], STEPS - 1 - other.frames[b][::-1])
        # what is known of the first velocity alone tells the directions apart
        assert_allclose(one.means[a, :3], other.means[b, :3][::-1], atol=0.02)
        assert_allclose(one.existences[a], other.existences[b][::-1], atol=0.02)
        assert_array_equal(one.seen[a], other.seen[b][::-1])
    assert {(d.kind, d.label, d.other) for d in one.decisions} == {("joined", 7, 9)}
    assert [d.kind for d in other.decisions] == ["joined"]


def test_the_order_of_cameras_and_of_labels_changes_nothing() -> None:
    scene, order = passing(), [2, 0, 1]
    one = smoothed(scene, labels_of(scene))
    seen = [scene.seen[c] for c in order]
    cameras = [CAMERAS[c] for c in order]
    mixed = Known(world.sequence(cameras, scene.places, seen), seen, scene.places)
    other = smoothed(mixed, np.where(labels_of(scene) >= 0, 20 - labels_of(scene), -1))
    names = {4: 16, 7: 13}
    rows = np.lexsort((20 - other.labels, other.frames))
    assert_array_equal(one.frames, other.frames[rows])
    assert [names[k] for k in one.labels.tolist()] == other.labels[rows].tolist()
    assert_allclose(one.means, other.means[rows], atol=1e-6)
    assert_allclose(one.existences, other.existences[rows], atol=1e-6)
    assert_array_equal(one.seen, other.seen[rows][:, np.argsort(order)])


@pytest.mark.parametrize(("gap", "joined"), [(4, True), (5, True), (6, False)])
def test_who_stands_is_joined_over_the_longest_gap_and_no_longer(gap: int, joined: bool) -> None:
    """Of half a second: from the last step of the one to the first of the other five steps."""
    p = with_values(SETTLED, {"smoothing.longest": 0.5})
    path = world.stand((0.3, 0.2), 24)[:, None]
    scene = known(path, hidden=lambda camera, person, step: 10 <= step < 9 + gap)
    labels = np.full((24, 1), 3)
    labels[10 : 9 + gap], labels[9 + gap :] = -1, 5
    found = smoothed(scene, labels, p)
    assert len(set(found.labels.tolist())) == (1 if joined else 2)
    assert [d.kind for d in found.decisions] == (["joined"] if joined else [])


@pytest.mark.parametrize("method", ["positions", "identities"])
@pytest.mark.parametrize(("away", "filled"), [(2, True), (3, False)])
def test_nobody_is_there_before_the_first_or_after_the_last_box(
    method: str, away: int, filled: bool
) -> None:
    """The filter had him later and for longer. At p_D = 0.95 three cameras that miss him tell 0.4
    times 9.0 a step against him, and going and returning cost twice 4: two steps are no absence,
    and three are one."""
    path = world.stand((0.3, 0.2), STEPS)[:, None]
    boxed = [*range(6, 13), *range(13 + away, 24)]
    scene = known(path, hidden=lambda camera, person, step: step not in boxed)
    labels = np.full((STEPS, 1), -1)
    labels[9:27] = 3
    found = smoothed(scene, labels, with_values(SETTLED, {"smoothing_method": method}))
    there = found.existences > 0.5
    assert found.frames[there].tolist() == (list(range(6, 24)) if filled else boxed)
    assert set(found.labels.tolist()) == {3}
    assert_array_equal(found.seen, np.tile(np.isin(found.frames, boxed)[:, None], (1, 3)))


def test_two_whom_the_filter_took_for_each_other_go_on_as_themselves() -> None:
    """Where they pass, the labels are exchanged; both lives as a whole say so."""
    scene = passing()
    labels = np.tile([4, 7], (STEPS, 1))
    labels[15:] = [7, 4]
    found = smoothed(scene, labels)
    assert set(found.labels.tolist()) == {4, 7}
    for label in (4, 7):
        side = np.sign(found.means[found.labels == label, 1])
        assert abs(side.sum()) == len(side) == STEPS
    plain = smoothed(scene, labels, POSITIONS)
    side = np.sign(plain.means[plain.labels == 4, 1])
    assert abs(side.sum()) < len(side), "positions alone leave who is who as it is"


def test_without_tracks_nobody_is_found() -> None:
    scene = known(world.stand((0.3, 0.2), 5)[:, None])
    found = smoothed(scene, np.full((5, 1), -1))
    assert len(found.frames) == 0
    assert found.seen.shape == (0, 3)
    assert found.means.shape == (0, 6)


def test_a_camera_without_a_frame_says_nothing_against_somebody() -> None:
    """One who is seen by two cameras is there while the third has no frame, or has and misses."""
    path = world.stand((0.3, 0.2), 12)[:, None]
    scene = known(path, hidden=lambda camera, person, step: camera == 0)
    labels = np.full((12, 1), 3)
    missed = smoothed(scene, labels, POSITIONS)
    blind = [(replace(step[0], blind=True), *step[1:]) for step in scene.views]
    found = create(scene.whole, POSITIONS).smooth(blind, scene.fused(labels))
    assert found is not None
    assert (found.existences > missed.existences).all()


# ── what a person said holds


def place(scene: Known, person: int, step: int, aside: float = 0.0) -> list[float]:
    """Where somebody is, as a log has it."""
    x, y, z = scene.places[step, person].tolist()
    return [step, x, y + aside, z]


@pytest.mark.parametrize(
    ("kind", "of", "aside"),
    [
        ("came", [(0, 14)], 0.0),
        ("left", [(0, 14)], 0.0),
        ("different", [(0, 4), (0, 25)], 0.0),
        ("exchanged", [(0, 8), (1, 8), (1, 18), (0, 18)], 0.0),
        ("nobody", [(1, 0), (1, 29)], 0.0),
        ("here", [(0, 24), (0, 24)], 1.0),
    ],
)
def test_each_kind_of_correction_holds_where_it_did_not(
    kind: str, of: list[tuple[int, int]], aside: float
) -> None:
    """And taken back it leaves no trace; bit for bit, whatever was kept of earlier runs."""
    scene, labels = passing(), np.tile([4, 7], (STEPS, 1))
    places = [place(scene, *one) for one in of]
    places[0] = place(scene, *of[0], aside)
    said = make(kind=kind, places=places)
    stage = create(scene.whole, SETTLED)
    kept: dict[str, object] = {}
    # runs that differ in where somebody is said to be have nothing in common
    known_earlier = SimpleNamespace(get=kept.get, put=kept.__setitem__)
    earlier = None if kind == "here" else known_earlier
    plain, told, again = (
        stage.smooth(scene.views, scene.fused(labels), corrections=log, earlier=earlier)
        for log in ((), (said,), ())
    )
    assert plain is not None
    assert told is not None
    assert again is not None
    for found, met in ((plain, False), (told, True)):
        there = found.existences > 0.5
        (outcome,) = outcomes(
            found.frames[there], found.labels[there], found.means[there, :3], [said], leeway=10
        )
        assert outcome.met is met, outcome.why
    assert_array_equal(plain.means, again.means)
    assert_array_equal(plain.labels, again.labels)
    alone = stage.smooth(scene.views, scene.fused(labels), corrections=(said,))
    assert alone is not None
    assert_array_equal(alone.means, told.means)
    assert_array_equal(alone.labels, told.labels)
    if kind in ("came", "left"):
        at = (told.frames == 14) & (told.means[:, 1] > 0.0)
        there = told.frames[(told.labels == told.labels[at][0]) & (told.existences > 0.5)]
        assert (there.min() if kind == "came" else there.max()) == 14


def test_what_confirms_a_track_where_only_its_boxes_lead_changes_nothing() -> None:
    """The filter loses one of two neighbours eight steps before his last box. A correction there
    refers to him, and not to the neighbour, who alone has a tracklet at that step."""
    paths = np.stack([world.stand((0.0, 0.0), STEPS), world.stand((0.45, 0.0), STEPS)], axis=1)
    scene = known(paths, hidden=lambda camera, person, step: person == 1 and step > 25)
    labels = np.tile([4, 7], (STEPS, 1))
    labels[18:, 1] = -1
    stage = create(scene.whole, SETTLED)
    said = make(kind="same", places=[place(scene, 1, 4), place(scene, 1, 25)])
    plain, told = (
        stage.smooth(scene.views, scene.fused(labels), corrections=log) for log in ((), (said,))
    )
    assert plain is not None
    assert told is not None
    assert plain.frames[(plain.labels == 7) & (plain.existences > 0.5)].max() == 25
    assert_array_equal(told.labels, plain.labels)
    assert_array_equal(told.means, plain.means)


def test_who_was_away_too_long_is_joined_where_somebody_says_so() -> None:
    path = world.stand((0.3, 0.2), 24)[:, None]
    scene = known(path, hidden=lambda camera, person, step: 8 <= step < 16)
    labels = np.full((24, 1), 3)
    labels[8:16], labels[16:] = -1, 5
    p = with_values(SETTLED, {"smoothing.longest": 0.5})
    said = make(kind="same", places=[place(scene, 0, 4), place(scene, 0, 20)])
    found = create(scene.whole, p).smooth(scene.views, scene.fused(labels), corrections=[said])
    assert found is not None
    assert len(set(found.labels.tolist())) == 1
    assert found.frames[found.existences > 0.5].tolist() == [*range(8), *range(16, 24)]
    (one,) = found.decisions
    assert (one.kind, one.step, one.reason) == ("joined", 16, "a person said so")


@pytest.mark.parametrize("weight", [1.0, 0.0])
def test_who_comes_back_on_the_other_side_is_known_by_looks(weight: float) -> None:
    """Of three, two leave for two and a half seconds and come back in each other's places; a
    network's vectors beside the boxes say who is who."""
    left, right = ([-0.8, 0.2], [0.8, -0.3])
    paths = np.full((45, 3, 3), np.nan)
    paths[:, 2] = world.stand([0.1, 0.9], 45)
    paths[:10, 0], paths[:10, 1] = world.stand(left, 10), world.stand(right, 10)
    paths[35:, 0], paths[35:, 1] = world.stand(right, 10), world.stand(left, 10)
    rng = np.random.default_rng(5)
    vectors = rng.normal(size=(3, 16))
    seen = world.boxes(CAMERAS, paths, 2.0, rng)
    scene = Known(world.sequence(CAMERAS, paths, seen), seen, paths)
    views = []
    for step, own in enumerate(scene.views):
        embeddings = []
        for view, one in zip(own, seen, strict=True):
            noisy = vectors[one.people[one.frames == step]]
            noisy = noisy + 0.3 * rng.normal(size=noisy.shape)
            noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
            embeddings.append(replace(view, embeddings=noisy))
        views.append(tuple(embeddings))
    labels = np.tile([4, 7, 5], (45, 1))
    labels[10:35, :2], labels[35:, :2] = -1, [8, 9]
    p = with_values(SETTLED, {"smoothing.appearance": weight})
    found = create(scene.whole, p).smooth(views, scene.fused(labels))
    assert found is not None

    def of(step: int) -> dict[bool, int]:
        """The label of the one on the left, and of the one on the right."""
        own = (found.frames == step) & (found.labels != 5)
        return dict(zip((found.means[own, 0] < 0.0).tolist(), found.labels[own].tolist(),
                        strict=True))  # fmt: skip

    before, after = of(5), of(40)
    assert (before[True] == after[False] and before[False] == after[True]) is (weight == 1.0)
    assert not weight or {d.kind for d in found.decisions} == {"joined"}
    # where looks count for nothing, nobody is asked whether he is one of those who left
    assert found.joined is not None
    assert len(found.joined.gains) == (4 if weight else 0)


def test_with_unscented_points_gaps_are_judged_by_the_cameras_as_with_the_linear_update() -> None:
    """The empty places of a gap have no covariance from which points could be drawn."""
    room = random_room(4, cameras=2, people=4, steps=60)
    scores = [
        evaluate_sequence(
            room,
            pipeline.compute(
                room, with_values(RunParameters(), {"single_view": "none", "fusion.update": kind})
            ).tracks,
        )["idf1"]
        for kind in ("extended", "unscented")
    ]
    assert scores[1] == pytest.approx(scores[0], abs=0.01)


@pytest.mark.parametrize("method", [POSITIONS, SETTLED])
def test_a_long_recording_is_read_in_parts(
    method: RunParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = passing()
    whole = smoothed(scene, labels_of(scene), method)
    monkeypatch.setattr("tracker.smoothing.stage._AT_ONCE", 7)
    parts = smoothed(scene, labels_of(scene), method)
    assert_array_equal(parts.labels, whole.labels)
    assert_allclose(parts.means, whole.means, atol=1e-9)
    assert_allclose(parts.covariances, whole.covariances, atol=1e-9)


def test_who_is_removed_is_told_with_the_odds_against_it() -> None:
    paths = standing((4, 3, 9, 0.0), (6, 5, 9, 1.0))
    for odds, reason in (
        (-2.0, "over its whole life it is likelier nobody"),
        (0.0, "over its whole life it is likelier nobody"),
        (1.5, "no piece of it stands by boxes of its own"),
    ):
        found = _removal(paths, 1, odds)
        assert (found.kind, found.step, found.label, found.other) == ("removed", 5, 6, 6)
        assert found.probability == pytest.approx(1.0 / (1.0 + np.exp(odds)))
        assert found.against == pytest.approx(1.0 - found.probability)
        assert found.reason == reason


def test_outside_the_steps_that_are_said_nobody_is_there() -> None:
    paths = standing((4, 3, 9, 0.0), (6, 5, 9, 1.0))
    away = _outside_spans(paths, {4: (5, 8), 6: (0, 9), 7: (0, 0)})
    assert paths.steps[away].tolist() == [3, 4, 9]
    assert set(paths.owners[away].tolist()) == {0}


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
    one = sources.copy()
    one[0, 0] = 0
    single = replace(fused[2], sources=one)  # the first box of one camera did
    for at_second, first in ((fused[2], 2), (nobody, 3), (single, 2)):
        results = [*fused[:2], at_second, *fused[3:]]
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
