"""Tracks of foreground objects: decision matrices, each case, colours followed, and outlines."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy import ndarray

from tests.single_view.scenery import (
    COLOURS,
    PUBLISHED,
    Rectangle,
    draw,
    labels_by_place,
    person,
    play,
)
from tests.world import HEAD as HALF_EXTENTS
from tests.world import SMALL_CAMERAS as CAMERAS
from tests.world import SMALL_ROOM as ROOM
from tracker import single_view
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.association_matrix import method as association
from tracker.single_view.association_matrix import track_transfer as matrices
from tracker.single_view.association_matrix.method import _apart, _estimates, _labels_of_fits, join
from tracker.single_view.association_matrix.silhouettes import Fits, Silhouettes
from tracker.single_view.association_matrix.track_transfer import (
    MovingObject,
    Situation,
    Track,
    coefficients,
    follow,
    object_histograms,
)
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.pictures.foreground import blobs
from tracker.single_view.protocol import ViewEvent

decisions = arrays.arrays(np.bool_, st.tuples(st.integers(0, 6), st.integers(0, 6)))

RED, BLUE, GREEN = 1, 2, 3


def test_by_distance_each_goes_to_its_nearest_within_reach() -> None:
    before = np.array([[10.0, 10.0], [50.0, 10.0], [90.0, 10.0]])
    now = np.array([[52.0, 10.0], [12.0, 11.0], [112.0, 10.0]])
    apart = matrices.distances(before, now)
    assert apart[0, 1] == pytest.approx(np.hypot(2.0, 1.0))
    decision = matrices.decide_by_distance(apart, np.full(3, 20.0))
    np.testing.assert_array_equal(decision, [[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    assert not matrices.is_one_to_one(decision)
    assert matrices.is_one_to_one(matrices.decide_by_distance(apart, np.full(3, 60.0)))


def test_by_distance_two_do_not_share_one() -> None:
    """The nearest of both is the same object: only the nearer one gets it."""
    apart = np.array([[3.0, 40.0], [5.0, 45.0]])
    np.testing.assert_array_equal(
        matrices.decide_by_distance(apart, np.full(2, 20.0)), [[1, 0], [0, 0]]
    )


def test_by_boxes_what_overlaps_counts_in_pixels() -> None:
    before = np.array([[10.0, 10.0, 5.0, 10.0], [30.0, 10.0, 5.0, 10.0]])
    now = np.array([[20.0, 10.0, 8.0, 10.0], [60.0, 10.0, 5.0, 10.0]])
    np.testing.assert_allclose(matrices.box_overlaps(before, now), [[60.0, 0.0], [60.0, 0.0]])


def test_by_pixels_what_two_objects_share_counts() -> None:
    before = np.full((6, 8), -1)
    before[1:4, 1:3], before[1:4, 5:7] = 0, 1
    now = np.full((6, 8), -1)
    now[2:5, 1:7], now[0, 0] = 0, 1
    shared = matrices.pixel_overlaps(before, now, 2, 2)
    np.testing.assert_array_equal(shared, [[4, 0], [4, 0]])
    nothing = matrices.pixel_overlaps(before, np.full((6, 8), -1), 2, 3)
    np.testing.assert_array_equal(nothing, np.zeros((2, 3)))


@given(st.integers(0, 1000))
def test_pixels_agree_with_counting(seed: int) -> None:
    rng = np.random.default_rng(seed)
    before, now = rng.integers(-1, 3, (7, 9)), rng.integers(-1, 4, (7, 9))
    shared = matrices.pixel_overlaps(before, now, 3, 4)
    for i in range(3):
        for j in range(4):
            assert shared[i, j] == ((before == i) & (now == j)).sum()


@pytest.mark.parametrize(
    ("decision", "families"),
    [
        ([[1, 0], [0, 1]], [([0], [0]), ([1], [1])]),
        ([[1], [1]], [([0, 1], [0])]),
        ([[1, 1]], [([0], [0, 1])]),
        ([[0, 1]], [([0], [1]), ([], [0])]),
        ([[1], [0]], [([0], [0]), ([1], [])]),
        ([[1, 1], [0, 1]], [([0, 1], [0, 1])]),
    ],
    ids=["continue", "merge", "split", "new", "interrupted", "merge and split at once"],
)
def test_rows_and_columns_of_a_family_name_the_case(
    decision: list[list[int]], families: list
) -> None:
    matrix = np.array(decision, dtype=bool)
    assert sorted(matrices.families(matrix)) == sorted(families)


@given(decisions)
def test_families_are_apart_and_leave_nobody_out(decision: ndarray) -> None:
    families = matrices.families(decision)
    rows = [row for family, _ in families for row in family]
    columns = [column for _, family in families for column in family]
    assert sorted(rows) == list(range(decision.shape[0]))
    assert sorted(columns) == list(range(decision.shape[1]))
    inside = np.zeros_like(decision)
    for family_rows, family_columns in families:
        inside[np.ix_(family_rows, family_columns)] = True
    assert not (decision & ~inside).any()


@given(decisions)
def test_by_distance_nobody_is_shared(decision: ndarray) -> None:
    apart = np.random.default_rng(decision.sum()).uniform(0.0, 50.0, decision.shape)
    found = matrices.decide_by_distance(apart, np.full(decision.shape[0], 30.0))
    assert found.shape == decision.shape
    if found.size:
        assert found.sum(axis=0).max() <= 1
        assert found.sum(axis=1).max() <= 1
        assert np.all(apart[found] <= 30.0)


def one_colour(colour: int) -> ndarray:
    return np.eye(COLOURS)[colour]


def test_histograms_are_of_the_objects_own_pixels() -> None:
    seen, bins = draw([(10, 10, 4, 10, RED), (14, 10, 12, 10, BLUE), (50, 10, 5, 5, RED)])
    histograms = object_histograms(bins, seen.owners, seen.size, COLOURS)
    np.testing.assert_allclose(histograms[0, [RED, BLUE]], [0.25, 0.75])
    np.testing.assert_allclose(histograms[1], one_colour(RED))
    assert object_histograms(bins, np.full_like(seen.owners, -1), 0, COLOURS).shape == (0, COLOURS)


@given(st.integers(0, 300))
def test_coefficients_are_1_for_equal_and_0_for_disjoint_colours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    histograms = rng.dirichlet(np.ones(COLOURS), 3)
    table = coefficients(histograms, histograms)
    np.testing.assert_allclose(np.diag(table), 1.0)
    np.testing.assert_allclose(table, table.T)
    assert np.all((table >= 0.0) & (table <= 1.0 + 1e-12))
    assert coefficients(one_colour(RED)[None], one_colour(BLUE)[None])[0, 0] == 0.0


def test_each_of_two_in_one_object_is_found_by_his_colours() -> None:
    seen, bins = draw([person(60, RED, width=12), person(70, BLUE, width=12)])
    assert seen.size == 1
    moving = seen.owners == 0
    red = follow(bins, moving, np.array([68.0, 34.5, 6.0, 15.0]), one_colour(RED))
    blue = follow(bins, moving, np.array([72.0, 34.5, 6.0, 15.0]), one_colour(BLUE))
    assert red == pytest.approx([64.5, 34.5], abs=0.6)
    assert blue == pytest.approx([75.5, 34.5], abs=0.6)


def test_what_does_not_move_does_not_count() -> None:
    seen, bins = draw([person(60, RED, width=12)])
    bins[:] = RED  # the wall is red as well
    found = follow(bins, seen.owners == 0, np.array([62.0, 34.5, 6.0, 15.0]), one_colour(RED))
    assert found == pytest.approx([65.5, 34.5], abs=0.6)


@pytest.mark.parametrize("box", [[150.0, 10.0, 5.0, 5.0], [-40.0, -40.0, 5.0, 5.0]])
def test_who_is_not_there_stays_where_he_was(box: list[float]) -> None:
    seen, bins = draw([person(60, RED)])
    found = follow(bins, seen.owners == 0, np.array(box), one_colour(RED))
    np.testing.assert_array_equal(found, box[:2])
    elsewhere = np.array([64.5, 34.5, 5.0, 15.0])
    other = follow(bins, seen.owners == 0, elsewhere, one_colour(BLUE))
    np.testing.assert_array_equal(other, elsewhere[:2])


def test_a_box_of_a_pixel_does_no_harm() -> None:
    seen, bins = draw([person(60, RED)])
    found = follow(bins, seen.owners == 0, np.array([60.0, 30.0, 0.0, 0.0]), one_colour(RED))
    assert np.isfinite(found).all()


def shifted_in_numpy(bins: ndarray, moving: ndarray, box: ndarray, histogram: ndarray) -> ndarray:
    """The mean shift as its equations say."""
    y, x = np.mgrid[: bins.shape[0], : bins.shape[1]]
    centre = box[:2].copy()
    for _ in range(20):
        radius = ((x - centre[0]) / box[2]) ** 2 + ((y - centre[1]) / box[3]) ** 2
        inside = moving & (radius < 1.0)
        if not inside.any():
            break
        here = np.bincount(bins[inside], 1.0 - radius[inside], minlength=len(histogram))
        weights = np.sqrt(histogram[bins[inside]] / (here / here.sum())[bins[inside]])
        if not weights.sum() > 0.0:
            break
        after = np.array([np.average(x[inside], weights=weights),
                          np.average(y[inside], weights=weights)])  # fmt: skip
        shift, centre = np.hypot(*(after - centre)), after
        if shift < 0.1:
            break
    return centre


@given(st.integers(0, 400))
def test_the_mean_shift_agrees_with_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bins = rng.integers(0, COLOURS, (30, 40)).astype(np.uint16)
    moving = rng.random((30, 40)) < 0.6
    box = np.concatenate([rng.uniform(0, 30, 2), rng.uniform(2, 12, 2)])
    histogram = rng.dirichlet(np.full(COLOURS, 0.3))
    np.testing.assert_allclose(
        follow(bins, moving, box, histogram),
        shifted_in_numpy(bins, moving, box, histogram),
        atol=1e-6,
    )


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


@pytest.mark.parametrize(("missing", "steps"), [(0, 1), (2, 3), (9, 4)])
def test_who_is_interrupted_is_expected_further_on_for_three_steps(
    missing: int, steps: int
) -> None:
    box, velocity = np.array([50.0, 40.0, 5.0, 15.0]), np.array([3.0, -1.0])
    one = MovingObject((1,), box, 300, velocity, missing)
    assert one.expected.tolist() == [50.0 + 3.0 * steps, 40.0 - steps]


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


CAMERA = CAMERAS[0]
NUMBERS = AssociationMatrixParams(acceptance=-2.0, further_acceptance=-1.4, spare_acceptance=-0.7)


@pytest.fixture(scope="module")
def silhouettes() -> Silhouettes:
    return Silhouettes(CAMERA, ROOM, HALF_EXTENTS)


def standing(*places: tuple[float, float, float]) -> tuple[ndarray, ndarray]:
    """A mask of people whose heads are at these places, shoulders and legs below them; the heads'
    boxes."""
    boxes, _ = upright_boxes(CAMERA, np.array(places), HALF_EXTENTS)
    width, height = CAMERA.image_size
    mask = np.zeros((height, width), np.uint8)
    for x, y, half_x, half_y in boxes:
        cv2.ellipse(mask, (round(x), round(y)), (round(half_x), round(half_y)), 0, 0, 360, 1, -1)
        shoulders = (round(x), round(y + 3.2 * half_y))
        axes = (round(2.4 * half_x), round(2.2 * half_y))
        cv2.ellipse(mask, shoulders, axes, 0, 0, 360, 1, -1)
        cv2.rectangle(mask, (round(x - half_x), shoulders[1]), (round(x + half_x), height), 1, -1)
    return mask, boxes


def found(silhouettes: Silhouettes, mask: ndarray, wanted: int) -> Fits:
    pieces = blobs(mask, 20)
    return silhouettes.fit(mask, pieces, np.full(pieces.size, wanted), NUMBERS)


def test_a_head_is_found_on_top_of_its_body(silhouettes: Silhouettes) -> None:
    mask, heads = standing((0.1, 0.0, 1.0))
    fits = found(silhouettes, mask, 1)
    assert len(fits.boxes) == 1
    off = (fits.boxes[0] - heads[0]) / heads[0, [2, 3, 2, 3]]
    assert np.abs(off).max() < 0.4
    assert fits.scores[0] > -0.7


def test_two_heads_in_one_outline_are_found_apart(silhouettes: Silhouettes) -> None:
    middle, side = np.array([0.0, 0.0, 1.0]), 0.2 * CAMERA.rotation[0]
    mask, heads = standing(tuple(middle - side), tuple(middle + side))
    assert blobs(mask, 20).size == 1
    fits = found(silhouettes, mask, 2)
    assert len(fits.boxes) == 2
    order, heads = fits.boxes[np.argsort(fits.boxes[:, 0])], heads[np.argsort(heads[:, 0])]
    assert np.abs((order - heads)[:, :2] / heads[:, 2:]).max() < 0.6
    np.testing.assert_array_equal(fits.owners, [0, 0])
    assert fits.scores[0] >= fits.scores[1]


def test_boxes_keep_apart_and_no_more_are_taken_than_wanted_or_very_good(
    silhouettes: Silhouettes,
) -> None:
    mask, _ = standing((-0.5, 0.2, 1.0), (0.0, 0.1, 1.05), (0.6, -0.2, 0.95))
    for wanted in range(5):
        fits = found(silhouettes, mask, wanted)
        for owner in range(blobs(mask, 20).size):
            mine = fits.owners == owner
            assert np.all(fits.scores[mine][wanted:] >= -0.7)
            boxes = fits.boxes[mine]
            apart = (boxes[:, None, :2] - boxes[None, :, :2]) / boxes[None, :, 2:]
            np.fill_diagonal(distance := (apart**2).sum(axis=2), np.inf)
            assert np.all(np.maximum(distance, distance.T) >= 1.0 - 1e-9)


@pytest.mark.parametrize("kind", ["nothing", "everything", "a pixel", "a line"])
def test_what_is_no_person_gives_no_error(silhouettes: Silhouettes, kind: str) -> None:
    width, height = CAMERA.image_size
    mask = np.zeros((height, width), np.uint8)
    if kind == "everything":
        mask[:] = 1
    elif kind == "a pixel":
        mask[height // 2, width // 2] = 1
    elif kind == "a line":
        mask[height // 2] = 1
    pieces = blobs(mask, 1)
    fits = silhouettes.fit(mask, pieces, np.ones(pieces.size), NUMBERS)
    assert len(fits.boxes) == len(fits.scores) == len(fits.owners)
    assert len(fits.boxes) <= 1
    assert len(silhouettes.half_heights(pieces.boxes[:, :2])) == pieces.size


def stacked(gap: int, shift: int = 0) -> ndarray:
    mask = np.zeros((80, 60), np.uint8)
    mask[5:20, 20:30] = 1
    mask[20 + gap : 50 + gap, 20 + shift : 30 + shift] = 1
    return mask


def test_a_head_and_its_body_become_one() -> None:
    pieces = blobs(stacked(4), 1)
    joined = join(pieces, np.full(2, 5.0))
    assert joined.size == 1
    np.testing.assert_allclose(joined.boxes, [[24.5, 29.0, 5.0, 24.5]])
    assert joined.areas.tolist() == [450]
    np.testing.assert_array_equal(joined.owners >= 0, stacked(4) > 0)
    assert join(pieces, np.full(2, 3.0)) is pieces


@pytest.mark.parametrize(("shift", "count"), [(0, 1), (4, 1), (7, 2), (15, 2)])
def test_only_what_lies_above_each_other_is_joined(shift: int, count: int) -> None:
    assert join(blobs(stacked(4, shift), 1), np.full(2, 5.0)).size == count


@given(st.integers(0, 300), st.floats(0.0, 12.0))
def test_joining_loses_no_pixel_and_keeps_the_order(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    mask = (cv2.GaussianBlur(rng.random((50, 60)), (0, 0), 1.5) > 0.55).astype(np.uint8)
    pieces = blobs(mask, 1)
    joined = join(pieces, np.full(pieces.size, gap))
    np.testing.assert_array_equal(joined.owners >= 0, pieces.owners >= 0)
    assert joined.areas.sum() == pieces.areas.sum()
    assert joined.size <= pieces.size
    tops = joined.boxes[:, 1] - joined.boxes[:, 3]
    assert np.all(np.diff(tops) >= 0.0)
    for piece in range(joined.size):
        rows, columns = np.nonzero(joined.owners == piece)
        assert len(rows) == joined.areas[piece]
        edges = [columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5]
        x, y, half_x, half_y = joined.boxes[piece]
        np.testing.assert_allclose(edges, [x - half_x, y - half_y, x + half_x, y + half_y])


def test_few_pieces_are_joined_to_nothing() -> None:
    empty = blobs(np.zeros((10, 10), np.uint8), 1)
    assert join(empty, np.zeros(0)) is empty


@pytest.mark.parametrize(("gap", "count"), [(0.0, 2), (1.0, 1)])
def test_pieces_are_joined_where_a_gap_is_said(
    gap: float, count: int, heads: Sequence, reader: FrameReader, monkeypatch: pytest.MonkeyPatch
) -> None:
    mask = np.zeros((72, 96), np.uint8)
    mask[20:30, 40:50] = mask[33:50, 40:50] = 1
    monkeypatch.setattr(association, "blobs", lambda *_: blobs(mask, 1))
    values = {"association_matrix.join_gap": gap, "association_matrix.output": "objects"}
    method = single_view.create(
        "association_matrix", heads, 0, with_values(RunParameters(), values), reader
    )
    _, result = method.step(method.start(), 4, reader.picture(0, 4), np.random.default_rng(0))
    assert len(result.measurements) == count
