"""The estimate of identity without truth: of runs that agree, and of those that do not."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import spearmanr

from tests import world
from tests.engine.synthetic import crossing, sequence
from tests.random_rooms import random_room
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.review.self_consistency import estimate
from tracker.review.self_consistency.agreement import (
    Difference,
    agreement,
    compare_runs,
    differences,
    disagreements,
)
from tracker.review.self_consistency.estimate import FILE, interval, overlap, reverse_steps
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled
from tracker.single_view.protocol import ViewResult
from tracker.steps.steps import Steps

BOXES = RunParameters(single_view="none")
HALF = np.array([0.3, 0.3, 0.85])
STEPS = 60


def tracks(ids: list[list[int]]) -> Trajectories:
    """People who stand 2 m apart; of each the id at every step, 0 where he is not found."""
    rows = [
        (step, name, 2.0 * place)
        for step in range(len(ids[0]))
        for place, names in enumerate(ids)
        if (name := names[step])
    ]
    count = len(rows)
    frames, names, places = (np.array(column) for column in zip(*rows, strict=True))
    return Trajectories(
        frames=frames,
        ids=names,
        positions=np.stack([places, np.zeros(count), np.ones(count)], axis=1),
        existences=np.ones(count),
        sigmas=np.ones((count, 3)),
        seen=np.ones((count, 1), dtype=bool),
        components=np.full(count, -1),
        labels=names,
        covariances_xy=np.zeros(count),
        heights=np.full(count, np.nan),
        sigma_heights=np.full(count, np.nan),
    )


def test_two_people_who_never_meet_are_sure() -> None:
    run = pipeline.compute(sequence(crossing(STEPS), STEPS, clutter_rate=0.2), BOXES)
    told: list[tuple[int, int]] = []
    found = estimate(run, on_progress=lambda done, total: told.append((done, total)))
    assert found.score > 0.97
    assert len(found.without) == len(found.overlaps) == len(run.sequence.views)
    assert found.score == pytest.approx(found.backwards * np.mean(found.without))
    assert all(one is not None and one > 0.5 for one in found.overlaps)
    assert found.interval[0] <= found.interval[1] <= 1.0
    assert told[-1] == (4 * STEPS, 4 * STEPS)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_it_ends_when_it_is_told_to() -> None:
    run = pipeline.compute(sequence(crossing(STEPS), STEPS), BOXES)
    with pytest.raises(Cancelled):
        estimate(run, cancelled=lambda: True)


def test_one_camera_alone_is_held_against_the_way_back() -> None:
    room = random_room(3, cameras=1, people=2, steps=60)
    found = estimate(pipeline.compute(room, BOXES))
    assert (found.without, found.overlaps) == ((), ())
    assert found.score == found.backwards


def test_seen_backwards_twice_is_the_same() -> None:
    run = pipeline.compute(random_room(5, cameras=3, people=3, steps=80), BOXES)
    twice = reverse_steps(reverse_steps(run.tracks, 80), 80)
    for name in Trajectories.__slots__:
        assert_allclose(getattr(twice, name), getattr(run.tracks, name))


def test_who_is_exchanged_is_told_with_step_and_ids() -> None:
    here = tracks([[1] * 40, [2] * 40])
    there = tracks([[7] * 25 + [8] * 15, [8] * 25 + [7] * 15])
    comparison = compare_runs(here, there, 40, HALF)
    assert agreement(comparison) == pytest.approx(25 / 40)
    found = disagreements([("backwards", differences(comparison, 0.1))], 0.1)
    assert {(one.step, one.ids) for one in found} == {(25, (1, 2)), (25, (2, 1))}
    assert found[0].why == f"{found[0].ids[0]} is taken for {found[0].ids[1]} backwards"


def test_who_is_missed_is_told_after_who_is_another() -> None:
    here = tracks([[1] * 40, [2] * 40, [3] * 40])
    there = tracks([[7] * 20 + [8] * 20, [8] * 20 + [7] * 20, [9] * 10 + [0] * 30])
    comparison = compare_runs(here, there, 40, HALF)
    found = disagreements([("a", differences(comparison, 0.1))], 0.1)
    assert [one.ids[0] for one in found] == [1, 2, 3]
    assert found[-1].why == "3 is not there a"
    # what two runs see otherwise comes first, whatever it is
    other = tracks([[1] * 40, [2] * 40, [3] * 10 + [0] * 30])
    second = differences(compare_runs(here, other, 40, HALF), 0.1)
    both = disagreements([("a", differences(comparison, 0.1)), ("b", second)], 0.1)
    assert (both[0].ids, both[0].variants) == ((3,), ("a", "b"))


def test_a_moment_is_no_difference() -> None:
    here = tracks([[1] * 40])
    there = tracks([[5] * 20 + [0] * 2 + [5] * 18])
    assert differences(compare_runs(here, there, 40, HALF), 0.1) == []


def test_nobody_anywhere_is_agreement() -> None:
    nobody = Trajectories.empty(1)
    assert agreement(compare_runs(nobody, nobody, 10, HALF)) == 1.0


def test_boxes_elsewhere_are_a_veto() -> None:
    run = pipeline.compute(random_room(5, cameras=3, people=3, steps=40), BOXES)
    camera, half = run.sequence.cameras[0], run.sequence.target_half_extents
    own = overlap(run.tracks, camera, half, run.views, 0)
    other = overlap(run.tracks, camera, half, run.views.alike(run.views[::-1]), 0)
    assert own is not None
    assert other is not None
    assert own > other + 0.2
    assert overlap(Trajectories.empty(3), camera, half, run.views.alike([]), 0) is None
    # where it had no frame it contradicts nobody
    blind = run.views.alike([(ViewResult.of_no_frame(),) * 3] * 40)
    assert overlap(run.tracks, camera, half, blind, 0) is None


def test_the_record_is_what_the_interval_is_made_of() -> None:
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    assert len(kept) >= 3
    for name, pairs in kept.items():
        both = np.array(pairs)
        assert len(both) >= 20, name
        assert ((both >= 0.0) & (both <= 1.0)).all(), name
    every = np.concatenate([np.array(pairs) for pairs in kept.values()])
    assert spearmanr(every[:, 0], every[:, 1]).statistic > 0.7
    inside = [low <= truth <= high for (j, truth) in every for low, high in [interval(j)]]
    assert np.mean(inside) > 0.8


@pytest.mark.parametrize(
    ("gone", "told"),
    [((20, 23), None), ((20, 24), (20, 24)), ((0, 4), (0, 4)), ((36, 39), None)],
)
def test_a_difference_lasts_at_least_four_tenths_of_a_second(
    gone: tuple[int, int], told: tuple[int, int] | None
) -> None:
    names = [0 if gone[0] <= step <= gone[1] else 5 for step in range(40)]
    found = differences(compare_runs(tracks([[1] * 40]), tracks([names]), 40, HALF), 0.1)
    assert [(one.first, one.last, one.missing, one.other) for one in found] == (
        [] if told is None else [(*told, True, None)]
    )


@pytest.mark.parametrize(("gap", "count"), [(3, 1), (4, 2)])
def test_a_track_that_pauses_for_longer_is_told_twice(gap: int, count: int) -> None:
    """The track's steps are those of this run: from step to step at most four."""
    names = [1] * 10 + [0] * gap + [1] * 10
    here, there = tracks([names]), tracks([[0] * len(names), [6] * len(names)])
    found = differences(compare_runs(here, there, len(names), HALF), 0.1)
    assert len(found) == count
    assert (found[0].first, found[-1].last) == (0, len(names) - 1)


def made_of(*spans: tuple[str, int, int, int, int | None, bool]) -> list[tuple[int, tuple, str]]:
    """Step, variants and words of what is made of differences: variant, person, first, last,
    other and whether the person is missing, of each."""
    every: dict[str, list[Difference]] = {}
    for name, person, first, last, other, missing in spans:
        every.setdefault(name, []).append(Difference(first, last, person, other, missing))
    found = disagreements(list(every.items()), 0.1)
    return [(one.step, one.variants, one.why) for one in found]


def test_what_begins_within_a_second_of_the_first_is_one_moment() -> None:
    a, b = ("a", 1, 10, 30, 2, False), ("b", 1, 20, 30, 3, False)
    assert made_of(a, b) == [(10, ("a", "b"), "1 is taken for 2 or 3 a, b")]
    assert [one[0] for one in made_of(a, ("b", 1, 21, 90, 3, False))] == [21, 10]  # the longer one
    assert [one[0] for one in made_of(a, b, ("c", 1, 21, 30, 3, False))] == [10, 21]
    assert len(made_of(a, ("b", 2, 20, 30, 3, False))) == len(made_of(a, ("b", 1, 20, 30, None,
                                                                         True))) == 2  # fmt: skip
    (nobody,) = made_of(("a", 1, 10, 30, None, False))
    assert nobody[2] == "1 is somebody else a"
    # who is another is worse than who is missing, for however long
    both = made_of(("a", 1, 10, 90, None, True), ("a", 2, 10, 20, 3, False))
    assert [one[2] for one in both] == ["2 is taken for 3 a", "1 is not there a"]


def test_the_overlap_is_that_of_the_best_pairs_over_all_boxes_and_tracks() -> None:
    """2 Σ IoU over the boxes and the drawn ones together, by trying all pairs."""
    rng = np.random.default_rng(3)
    camera, half = world.ring(3)[0], world.PERSON
    paths = np.array([[0.0, 0.2, 0.85], [0.5, -0.4, 0.85], [-0.9, 0.3, 0.85]])
    run = world.tracks(np.tile(paths, (3, 1, 1)))
    views, best, count = [], 0.0, 0
    drawn = camera.project_boxes(paths, half)[0]
    for boxes in (2, 4, 0):
        rows = rng.integers(0, 3, boxes)
        own = np.concatenate([drawn[rows, :2] + drawn[rows, 2:] / 2.0, drawn[rows, 2:] / 2.0], 1)
        own += rng.normal(0.0, 8.0, own.shape)
        views.append((ViewResult.of_boxes(own, np.ones(boxes), np.ones((boxes, 4))),))
        shares = np.zeros((3, boxes))
        for i, j in itertools.product(range(3), range(boxes)):
            corner = np.concatenate([own[j, :2] - own[j, 2:], 2.0 * own[j, 2:]])
            sides = np.minimum(drawn[i, :2] + drawn[i, 2:], corner[:2] + corner[2:])
            both = np.maximum(sides - np.maximum(drawn[i, :2], corner[:2]), 0.0).prod()
            shares[i, j] = both / (drawn[i, 2:].prod() + corner[2:].prod() - both)
        few, many = (shares, range(boxes)) if boxes >= 3 else (shares.T, range(3))
        ways = itertools.permutations(many, len(few)) if boxes else [()]
        best += 2.0 * max(sum(few[k, m] for k, m in enumerate(way)) for way in ways)
        count += 3 + boxes
    seen = Steps.of(views, ViewResult, 1)
    assert overlap(run, camera, half, seen, 0) == pytest.approx(best / count)


def test_the_interval_holds_nine_tenths_of_the_errors_of_the_sixty_most_alike() -> None:
    kept = [np.array(pairs) for pairs in json.loads(FILE.read_text(encoding="utf-8")).values()]
    fewest = min(map(len, kept))
    measured = np.concatenate([pairs[:fewest] for pairs in kept])
    for score in (0.2, 0.61, 0.9, 1.0):
        near = sorted(measured.tolist(), key=lambda pair: abs(pair[0] - score))[:60]
        errors = np.sort([truth - stated for stated, truth in near])
        low, high = (np.interp(share * 59, range(60), errors) for share in (0.05, 0.95))
        expected = np.clip([score + low, score + high], 0.0, 1.0)
        assert interval(score) == pytest.approx(tuple(expected))
