"""Tracks of foreground objects: each case of the association matrices, and what follows of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.single_view.pieces import PUBLISHED, Rectangle, labels_by_place, person, play
from tracker.single_view.association_matrix.method import _apart, _estimates, _labels_of_fits
from tracker.single_view.association_matrix.silhouettes import Fits
from tracker.single_view.association_matrix.track_transfer import MovingObject, Situation, Track
from tracker.single_view.protocol import ViewEvent

RED, BLUE, GREEN = 1, 2, 3


def kinds(events: list[ViewEvent]) -> list[str]:
    return [event.kind for event in events]


def meeting() -> list[list[Rectangle]]:
    """Red comes from the left, blue from the right; they touch, pass and part."""
    steps = [[person(20 + 5 * k, RED), person(80 - 5 * k, BLUE)] for k in range(13)]
    assert steps[6] == [person(50, RED), person(50, BLUE)]
    return steps


def test_who_appears_is_new_and_goes_on() -> None:
    steps = [[person(20 + 3 * k, RED), person(120 - 3 * k, BLUE)] for k in range(5)]
    situation, told = play(steps)
    assert told[0] == [ViewEvent("new", (1,)), ViewEvent("new", (2,))]
    assert not any(told[1:])
    assert labels_by_place(situation) == [(1,), (2,)]
    np.testing.assert_allclose(situation.tracks[1].box, [36.5, 34.5, 5.0, 15.0])
    np.testing.assert_allclose(situation.objects[0].velocity, [3.0, 0.0], atol=0.4)
    assert situation.tracks[1].area == pytest.approx(300.0)
    assert situation.tracks[1].histogram[RED] == pytest.approx(1.0)


def test_who_goes_is_interrupted_and_has_ended_after_n_steps() -> None:
    parameters = PUBLISHED.model_copy(update={"interrupted_steps": 4})
    here, gone = [person(20, RED), person(120, BLUE)], [person(20, RED)]
    situation, told = play([here, here, *[gone] * 4], parameters)
    assert [one.labels for one in situation.lost] == [(2,)]
    assert 2 in situation.tracks
    assert not any(told[1:])
    situation, told = play([gone], parameters, situation)
    assert told == [[ViewEvent("vanished", (2,))]]
    assert not situation.lost
    assert set(situation.tracks) == {1}


def test_who_comes_back_near_and_in_his_colours_is_the_same() -> None:
    steps = [[person(60, RED)], [], [], [person(64, RED)]]
    situation, told = play(steps)
    assert told[3] == [ViewEvent("returned", (1,))]
    assert labels_by_place(situation) == [(1,)]


@pytest.mark.parametrize("back", [person(64, BLUE), person(150, RED)], ids=["other", "elsewhere"])
def test_who_comes_in_other_colours_or_elsewhere_is_new(back: Rectangle) -> None:
    situation, told = play([[person(60, RED)], [], [], [back]])
    assert told[3] == [ViewEvent("new", (2,))]
    assert labels_by_place(situation) == [(2,)]
    assert [one.labels for one in situation.lost] == [(1,)]


def test_two_who_touch_are_merged_and_followed_apart_while_both_show() -> None:
    _, told = play(meeting()[:6])
    assert told[5] == [ViewEvent("merged", (1, 2))]
    situation, _ = play(meeting()[:6])
    (one,) = situation.objects
    assert one.labels == (1, 2)
    assert one.followed
    # where each was, until the mean shift says more
    np.testing.assert_allclose(situation.tracks[1].box, [44.5, 34.5, 5.0, 15.0])
    np.testing.assert_allclose(situation.tracks[2].box, [64.5, 34.5, 5.0, 15.0])


def test_two_who_hide_each_other_at_once_are_one_object() -> None:
    steps = [[person(22, RED), person(38, BLUE)], [person(28, RED), person(30, BLUE)]]
    situation, told = play(steps, PUBLISHED.model_copy(update={"reach": 0.1}))
    assert kinds(told[1]) == ["merged", "occluded"]
    (one,) = situation.objects
    assert one.labels == (1, 2)
    assert not one.followed
    np.testing.assert_array_equal(situation.tracks[1].box, one.box)
    np.testing.assert_array_equal(situation.tracks[2].box, one.box)


def test_without_the_mean_shift_a_merged_object_carries_both() -> None:
    parameters = PUBLISHED.model_copy(update={"follow_mild": False})
    situation, told = play(meeting()[:6], parameters)
    assert kinds(told[5]) == ["merged", "occluded"]
    assert not situation.objects[0].followed


def test_after_a_split_each_goes_to_his_colours() -> None:
    situation, told = play(meeting())
    assert labels_by_place(situation) == [(2,), (1,)]  # they changed sides
    split = [step for step, events in enumerate(told) if "split" in kinds(events)]
    assert len(split) == 1
    assert told[split[0]] == [ViewEvent("split", (1, 2))]
    assert set(situation.tracks) == {1, 2}
    assert situation.tracks[1].histogram[RED] > 0.99


def test_colours_are_those_before_the_merge() -> None:
    situation, _ = play(meeting()[:7])
    assert situation.tracks[1].histogram[RED] == pytest.approx(1.0)
    assert situation.tracks[2].histogram[BLUE] == pytest.approx(1.0)


def test_a_large_merge_splits_into_smaller_ones() -> None:
    apart = [person(38, RED), person(55, BLUE), person(74, GREEN)]
    together = [person(46, RED, width=12), person(56, BLUE, width=12), person(66, GREEN, width=12)]
    two_and_one = [person(40, RED), person(49, BLUE), person(72, GREEN)]
    steps = [apart, together, two_and_one, apart]
    situation, told = play(steps)
    assert told[1] == [ViewEvent("merged", (1, 2, 3)), ViewEvent("occluded", (1, 2, 3))]
    assert told[2] == [ViewEvent("split", (1, 2, 3))]
    between, _ = play(steps[:3])
    assert labels_by_place(between) == [(1, 2), (3,)]
    assert labels_by_place(situation) == [(1,), (2,), (3,)]


def test_who_comes_in_behind_another_is_new_when_he_shows() -> None:
    steps = [[person(60, RED)], [person(60, RED), person(66, BLUE)],
             [person(60, RED), person(72, BLUE)]]  # fmt: skip
    situation, told = play(steps)
    assert labels_by_place(situation) == [(1,), (2,)]
    assert ViewEvent("new", (2,)) in told[2]
    assert ViewEvent("split", (1, 2)) in told[2]


def test_a_piece_that_comes_off_for_a_moment_is_nobody() -> None:
    robust = PUBLISHED.model_copy(update={"confirmation_steps": 5, "overlap": "pixels"})
    whole = [person(60, RED)]
    broken = [person(60, RED, height=12), person(60, RED, top=34, height=16)]
    situation, told = play([*[whole] * 6, broken, broken, whole, whole], robust)
    assert [events for events in told if events] == [[ViewEvent("new", (1,))]]
    assert labels_by_place(situation) == [(1,)]
    assert set(situation.tracks) == {1}
    # as published it is a second person, whom the first one carries from then on
    situation, told = play([*[whole] * 6, broken, broken, whole, whole])
    assert labels_by_place(situation) == [(1, 2)]


def test_the_distance_decides_where_the_count_stays_and_the_overlap_where_it_changes() -> None:
    """Side by side, box over box: alone the overlap would merge and split them all the time."""
    steps = [[person(60, RED), person(72, BLUE)], [person(64, RED), person(76, BLUE)]]
    situation, told = play(steps)
    assert not told[1]
    assert labels_by_place(situation) == [(1,), (2,)]
    third = [*steps[0], person(150, GREEN)]
    situation, told = play([steps[0], third])
    assert told[1] == [ViewEvent("new", (3,))]


def test_nobody_for_a_hundred_steps() -> None:
    situation, told = play([[person(60, RED)], *[[]] * 100])
    assert not situation.objects
    assert not situation.lost
    assert not situation.tracks
    assert sum(kinds(events).count("vanished") for events in told) == 1


def test_a_step_leaves_the_situation_before_as_it_was() -> None:
    before, _ = play(meeting()[:4])
    tracks = dict(before.tracks)
    box = before.tracks[1].box.copy()
    play(meeting()[4:], situation=before)
    assert before.tracks == tracks
    np.testing.assert_array_equal(before.tracks[1].box, box)


# ── what is handed on of them


def situation_of(*objects: tuple[tuple[int, ...], bool], ages: dict[int, int]) -> Situation:
    """Objects by their labels and whether both are followed apart; tracks of label k at 10 k."""
    tracks = {
        k: Track(k, np.array([10.0 * k, 5.0, 2.0, 3.0]), 9.0, np.ones(1), age)
        for k, age in ages.items()
    }
    found = tuple(
        MovingObject(labels, np.array([100.0 + k, 5.0, 8.0, 3.0]), 9, np.zeros(2), 0, followed)
        for k, (labels, followed) in enumerate(objects)
    )
    return Situation(tracks, found, (), None, 9)


FIVE = situation_of(
    ((2,), False), ((5, 1), True), ((3, 4), False), ages={1: 4, 2: 3, 3: 2, 4: 9, 5: 3}
)


def test_who_is_followed_apart_has_a_box_of_his_own_and_who_is_hidden_that_of_both() -> None:
    boxes, labels = _apart(FIVE)
    assert labels.tolist() == [2, 5, 1, -1]
    assert boxes[:, 0].tolist() == [20.0, 50.0, 10.0, 102.0]
    boxes, labels = _estimates(FIVE, 3)
    assert labels.tolist() == [1, 2, 4, 5]
    assert boxes[:, 0].tolist() == [10.0, 20.0, 40.0, 50.0]
    nobody = _estimates(Situation.start(), 1), _apart(Situation.start())
    assert [one.shape for one, _ in nobody] == [(0, 4)] * 2


def test_fits_in_an_object_are_named_if_it_is_one_persons_or_from_left_to_right() -> None:
    owners = np.array([0, 0, 1, 1, 1, 2, 2])
    boxes = np.array([[x, 5.0, 2.0, 3.0] for x in (1, 2, 60, 40, 50, 3, 4)], dtype=float)
    fits = Fits(boxes, np.zeros(7), owners, np.ones(3, dtype=bool))
    # the likeliest comes first: of two people the first two, and 1 is on the left of 5
    assert _labels_of_fits(fits, FIVE).tolist() == [2, -1, 5, 1, -1, -1, -1]
    one = Fits(boxes[2:3], np.zeros(1), owners[2:3], np.ones(3, dtype=bool))
    assert _labels_of_fits(one, FIVE).tolist() == [-1]


pieces = st.lists(
    st.tuples(
        st.integers(0, 180), st.integers(0, 60), st.integers(1, 30), st.integers(1, 30),
        st.integers(0, 7),
    ),
    max_size=6,
)  # fmt: skip


@pytest.mark.full
@given(st.lists(pieces, min_size=1, max_size=12), st.sampled_from(["pixels", "boxes"]),
       st.integers(1, 4))  # fmt: skip
def test_whatever_shows_every_object_carries_tracks_and_no_track_is_in_two(
    steps: list[list[Rectangle]], overlap: str, confirmation: int
) -> None:
    parameters = PUBLISHED.model_copy(
        update={"overlap": overlap, "confirmation_steps": confirmation, "interrupted_steps": 3}
    )
    situation: Situation = Situation.start()
    for rectangles in steps:
        before = situation
        situation, (events,) = play([rectangles], parameters, situation)
        held = [label for one in situation.objects for label in one.labels]
        lost = [label for one in situation.lost for label in one.labels]
        assert all(one.labels for one in situation.objects)
        assert len({*held, *lost}) == len(held) + len(lost)
        assert set(situation.tracks) == {*held, *lost}
        assert situation.next_label > max(situation.tracks, default=0)
        assert all(one.missing <= 3 for one in situation.lost)
        for event in events:
            known = {*before.tracks, *situation.tracks}
            assert set(event.labels) <= known
            assert event.labels == tuple(sorted(event.labels))
