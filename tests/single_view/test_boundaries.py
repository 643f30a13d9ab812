"""At, one below and one above each count and threshold of the methods, and of packed samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tests.single_view.scenery import PUBLISHED, draw, person, play
from tracker.parameters.groups.jpda import JpdaParams
from tracker.single_view.association_matrix.track_transfer import decide, decide_by_distance
from tracker.single_view.jpda.cases import determine_cases, exclude_outside_boxes, search_components
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.targets import Managed, Targets
from tracker.single_view.jpda.targets import manage as manage_jpda
from tracker.single_view.protocol import GATES, Dropped, pack_samples, unpack_samples
from tracker.single_view.pseudo_particle import hypotheses, track_management
from tracker.single_view.pseudo_particle.track_management import Departed, Tracks
from tracker.single_view.rectification.stabilisation import LARGEST, LEAST_CORNERS, consensus_shift
from tracker.single_view.shape.finder import Windows, strongest

JPDA = JpdaParams(confirmation_steps=5)  # vanished after 3, returned within 5

# ── jpda


def standing(labels: list[int], **counts: list[int]) -> Targets:
    """Targets in a row, a hundred pixels apart, with the variance 3 of each coordinate."""
    boxes = np.array([[100.0 * (k + 1), 50.0, 4.0, 9.0] for k in range(len(labels))])
    some = Targets.at_rest(
        boxes.reshape(-1, 4), np.ones((len(labels), 4)), 1.0, np.array(labels, dtype=np.int64)
    )
    some.covariances[:, [0, 2], [0, 2]] = 3.0
    return replace(some, **{name: np.array(values) for name, values in counts.items()})


def measured(*places: tuple[float, float]) -> Measured:
    boxes = np.array([[*place, 5.0, 8.0] for place in places]).reshape(-1, 4)
    return Measured(boxes, np.ones(len(boxes)), np.ones((len(boxes), 4)), boxes)


def managed(
    targets: Targets, vanished: Targets, seen: Measured, p: JpdaParams = JPDA, gate: float = 4.0
) -> Managed:
    new = np.ones(len(seen.boxes), dtype=bool)
    return manage_jpda(targets, vanished, 7, new, seen, p, gate=gate, longest_hidden=6)


@pytest.mark.parametrize(
    ("misses", "hidden", "stays"),
    [(0, 0, True), (2, 0, True), (3, 0, False), (0, 5, True), (0, 6, False), (0, 7, False)],
)
def test_a_target_ends_at_the_last_miss_or_hidden_step(
    misses: int, hidden: int, stays: bool
) -> None:
    done = managed(standing([4], misses=[misses], hidden=[hidden]), Targets.empty(), measured())
    assert (done.targets.labels.tolist() == [4]) == stays
    assert done.stayed.tolist() == ([0] if stays else [])
    assert done.vanished_labels == (() if stays else (4,))
    assert done.vanished.misses.tolist() == ([] if stays else [3])


@pytest.mark.parametrize(("misses", "hidden", "stays"), [(0, 0, 1), (1, 0, 0), (0, 1, 0)])
def test_a_newcomer_that_misses_one_step_is_forgotten(misses: int, hidden: int, stays: int) -> None:
    done = managed(standing([0], misses=[misses], hidden=[hidden]), Targets.empty(), measured())
    assert done.targets.size == stays
    assert done.vanished.size == 0
    assert done.vanished_labels == done.new_labels == ()


def test_newcomers_count_from_the_last_step_of_the_confirmation_on() -> None:
    done = managed(
        standing([0, 0, 0, 2], hits=[4, 5, 6, 5]), Targets.empty(), measured((900.0, 9.0))
    )
    assert done.targets.labels.tolist() == [0, 7, 8, 2, 0]
    assert done.new_labels == (7, 8)
    assert done.next_label == 9
    assert done.sources.tolist() == [0]
    assert done.targets.hits.tolist() == [4, 5, 6, 5, 1]


def test_who_vanished_is_remembered_for_the_steps_of_a_return() -> None:
    gone = standing([1, 2, 3], misses=[6, 7, 8])
    assert managed(Targets.empty(), gone, measured()).vanished.labels.tolist() == [1, 2]


@pytest.mark.parametrize(("gate", "same"), [(4.0, True), (np.nextafter(4.0, 0.0), False)])
def test_who_is_measured_at_the_border_of_the_gate_is_back(gate: float, same: bool) -> None:
    # 4 pixels off, with the variance 3 + 1: the squared distance is 4
    done = managed(
        Targets.empty(),
        standing([5], misses=[4]),
        measured((300.0, 50.0), (104.0, 50.0)),
        gate=gate,
    )
    assert done.targets.labels.tolist() == ([5, 0] if same else [0, 0])
    assert done.returned_labels == ((5,) if same else ())
    assert done.sources.tolist() == ([1, 0] if same else [0, 1])
    assert done.vanished.labels.tolist() == ([] if same else [5])
    if same:  # where it was measured, with the size that it had, and at rest
        assert_array_equal(done.targets.boxes[0], [104.0, 50.0, 4.0, 9.0])
        assert_array_equal(done.targets.means[0], [104.0, 0.0, 50.0, 0.0])
    assert_array_equal(done.targets.boxes[-1], [300.0, 50.0, 5.0, 8.0][:4] if same else
                       [104.0, 50.0, 5.0, 8.0])  # fmt: skip


def test_without_the_five_cases_nobody_returns() -> None:
    done = managed(
        Targets.empty(),
        standing([5], misses=[4]),
        measured((100.0, 50.0)),
        JPDA.model_copy(update={"five_cases": False}),
    )
    assert done.targets.labels.tolist() == [0]


@pytest.mark.parametrize(("least", "counts"), [(0.25, False), (np.nextafter(0.25, 0.0), True)])
def test_an_entry_of_the_least_probability_counts_as_0(least: float, counts: bool) -> None:
    cases = determine_cases(np.array([[0.25]]), np.array([0]), least, every_shared_row=False)
    assert cases.missed.tolist() == [not counts]
    assert cases.new.tolist() == [not counts]
    assert cases.own.tolist() == [0 if counts else -1]


@pytest.mark.parametrize(("x", "strange"), [(10.0, False), (np.nextafter(10.0, 99.0), True)])
def test_a_part_at_the_edge_of_its_target_is_a_part(x: float, strange: bool) -> None:
    matrix = np.array([[0.5, 0.25]])
    cases = determine_cases(matrix, np.array([0]), 0.05, every_shared_row=False)
    boxes = np.array([[0.0, 0.0, 4.0, 4.0], [x, 0.0, 4.0, 4.0]])
    parted, shares = exclude_outside_boxes(cases, matrix, np.array([[0.0, 0.0, 10.0, 9.0]]), boxes)
    assert parted.new.tolist() == [False, strange]
    assert parted.split.tolist() == [not strange]
    assert_array_equal(shares, [[0.75, 0.0]] if strange else matrix)


@pytest.mark.parametrize(
    ("x", "leap", "expected"),
    [
        (20.0, 2.0, (0, -1, False)),  # within the piece and within the leap: its own
        (20.0, np.nextafter(2.0, 0.0), (-1, 0, False)),  # beyond the leap: hidden by it
        (21.0, 9.0, (-1, -1, True)),  # outside the piece: missed
    ],
)
def test_whoever_is_lost_in_a_piece_leaps_so_far(
    x: float, leap: float, expected: tuple[int, int, bool]
) -> None:
    cases = determine_cases(np.zeros((1, 1)), np.array([-1]), 0.1, every_shared_row=False)
    boxes = np.array([[x, 0.0, 5.0, 5.0]])
    found = search_components(
        cases, np.array([[0.0, 0.0, 10.0, 10.0]]), boxes, np.array([[x, 0.0, 20.0, 20.0]]), leap
    )
    assert (found.own[0], found.shared[0], found.missed[0]) == expected
    assert found.new.tolist() == [expected[0] < 0]


# ── pseudo particles


def particle_targets(labels: list[int], **counts: list[int]) -> track_management.Targets:
    size = len(labels)
    whole = track_management.Targets(
        np.array(labels),
        np.zeros(size, dtype=np.int64),
        np.array([[50.0 * (k + 1), 40.0, 5.0, 7.0] for k in range(size)]).reshape(-1, 4),
        np.tile([2.0, -1.0], (size, 1)),
        np.full(size, 9),
        np.zeros(size, dtype=np.int64),
        np.full(size, 0.8),
    )
    return replace(whole, **{name: np.array(values) for name, values in counts.items()})


def step(
    tracks: Tracks, owners: list[int], memory: int = 4, **numbers: int
) -> tuple[Tracks, list[tuple[str, int]]]:
    """One step in which the targets of these columns are found where they are expected."""
    expected = tracks.targets
    after, events = track_management.manage(
        tracks,
        expected,
        expected.boxes[owners] + [3.0, 1.0, 0.0, 0.0],
        np.full(len(owners), 0.5),
        np.array(owners, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
        **{"confirmation": 3, "patience": 3, "newcomer_misses": 2, **numbers},
        memory=memory,
        velocity_memory=0.75,
    )
    return after, [(event.kind, event.labels[0]) for event in events]


def test_a_target_of_particles_is_waited_for_so_long() -> None:
    tracks = Tracks(particle_targets([1, 2, 3, 0, 0], misses=[1, 2, 3, 0, 1]), Departed.none(), 9)
    after, events = step(tracks, [])
    assert after.targets.labels.tolist() == [1, 2, 0]
    assert after.targets.misses.tolist() == [2, 3, 1]
    assert events == [("vanished", 3)]
    assert after.departed.labels.tolist() == [3]
    assert after.departed.ages.tolist() == [0]
    # where it is expected, and fading
    assert_array_equal(after.targets.boxes[:2], tracks.targets.boxes[:2])
    np.testing.assert_allclose(after.targets.existences, 0.8 * np.exp(-0.25))


def test_whoever_departed_is_remembered_up_to_the_memory() -> None:
    departed = Departed(np.array([5, 6, 7]), np.zeros(3, dtype=np.int64), np.array([2, 3, 4]))
    after, _ = step(Tracks(track_management.Targets.none(), departed, 9), [])
    assert after.departed.labels.tolist() == [5, 6]
    assert after.departed.ages.tolist() == [3, 4]
    # of those who look alike the last who vanished is back
    tracks = Tracks(particle_targets([0], hits=[2]), replace(departed, ages=np.array([2, 1, 3])), 9)
    after, events = step(tracks, [0])
    assert events == [("returned", 6)]
    assert after.departed.labels.tolist() == [5, 7]


def test_a_target_of_particles_counts_from_its_last_confirmation_on() -> None:
    tracks = Tracks(particle_targets([0, 0, 0, 4], hits=[1, 2, 3, 9]), Departed.none(), 8)
    after, events = step(tracks, [0, 1, 3])  # the third was found often enough, but not now
    assert after.targets.labels.tolist() == [0, 8, 0, 4]
    assert after.targets.hits.tolist() == [2, 3, 3, 10]
    assert events == [("new", 8)]
    assert after.next_label == 9
    np.testing.assert_allclose(after.targets.velocities[3], 0.75 * np.array([2.0, -1.0]) +
                               0.25 * np.array([3.0, 1.0]))  # fmt: skip


@pytest.mark.parametrize(("separation", "stays"), [(1.5, True), (np.nextafter(1.5, 9.0), False)])
def test_a_newcomer_at_the_separation_itself_stands_apart(separation: float, stays: bool) -> None:
    modes = np.array([[40.0, 60.0, 10.0, 14.0], [55.0, 60.0, 8.0, 14.0]])
    found = hypotheses.apart(modes, np.ones(2), np.array([0, 1]), 1, 3, separation)
    assert found.tolist() == [0, 1 if stays else 3]


# ── association matrices


@pytest.mark.parametrize(("reach", "near"), [(20.0, True), (np.nextafter(20.0, 0.0), False)])
def test_an_object_at_its_reach_is_reached(reach: float, near: bool) -> None:
    found = decide_by_distance(np.array([[20.0]]), np.array([reach]))
    assert found.tolist() == [[near]]


@pytest.mark.parametrize(("area", "same"), [(59, True), (60, False), (61, False)])
def test_an_overlap_must_be_larger_than_its_threshold(area: int, same: bool) -> None:
    situation, _ = play([[person(20, 1)]])
    # 2 of 10 columns of 30 pixels: 60 are shared; the counts differ, so that overlap decides
    seen, _ = draw([person(28, 1), person(120, 1)])
    decision, shared = decide(situation, seen, PUBLISHED.model_copy(update={"overlap_area": area}))
    assert shared.tolist() == [[60.0, 0.0]]
    assert decision.tolist() == [[same, False]]


@pytest.mark.parametrize(
    ("steps", "told"), [(4, ["new", "returned"]), (5, ["new", "vanished", "new"])]
)
def test_an_interrupted_object_ends_after_n_steps(steps: int, told: list[str]) -> None:
    p = PUBLISHED.model_copy(update={"interrupted_steps": 4, "confirmation_steps": 2})
    gone: list = [[]] * steps
    _, events = play([[person(60, 1)]] * 2 + gone + [[person(60, 1)]] * 2, p)
    assert [event.kind for step in events for event in step] == told


@pytest.mark.parametrize(("similarity", "same"), [(0.5, True), (0.51, False)])
def test_whoever_is_as_alike_as_asked_returns(similarity: float, same: bool) -> None:
    # of the red of before a quarter is left: the coefficient is a half
    back = [(60, 20, 4, 30, 1), (64, 20, 12, 30, 2)]
    p = PUBLISHED.model_copy(update={"return_similarity": similarity, "reach": 5.0})
    situation, _ = play([[(60, 20, 16, 30, 1)], [], back], p)
    assert [one.labels for one in situation.objects] == ([(1,)] if same else [(2,)])


@pytest.mark.parametrize(("shift", "same"), [(22, True), (23, False)])
def test_an_interrupted_object_strays_with_every_step(shift: int, same: bool) -> None:
    # 16 pixels wide and high: of size 8; twice gone, it may be 2 · 8 · (1 + 2 · 0.1875) = 22 off
    p = PUBLISHED.model_copy(update={"reach": 2.0, "straying": 0.1875})
    steps: list = [[(60, 20, 16, 16, 1)], [], [], [(60 + shift, 20, 16, 16, 1)]]
    situation, _ = play(steps, p)
    assert [one.labels for one in situation.objects] == ([(1,)] if same else [(2,)])


@pytest.mark.parametrize(("share", "followed"), [(0.74, True), (0.75, False), (0.76, False)])
def test_two_who_show_enough_are_followed_apart(share: float, followed: bool) -> None:
    # two of 300 pixels become one of 450
    p = PUBLISHED.model_copy(update={"mild_share": share})
    steps = [[person(30, 1), person(50, 2)], [person(37, 1, width=8), person(45, 2, width=7)]]
    situation, events = play(steps, p)
    assert situation.objects[0].area == 450
    assert situation.objects[0].followed == followed
    assert [event.kind for event in events[1]] == ["merged"] + ["occluded"] * (not followed)


# ── shapes, and what all share


@pytest.mark.parametrize(("overlap", "owner"), [(0.25, 0), (np.nextafter(0.25, 1.0), 1)])
def test_a_window_that_shares_just_so_much_is_of_the_same_person(
    overlap: float, owner: int
) -> None:
    # 4 of 10 columns are shared: 40 of 160 pixels
    edges = np.array([[0.0, 0.0, 10.0, 10.0], [6.0, 0.0, 16.0, 10.0]])
    owners, best = strongest(edges, np.array([2.0, 1.0]), overlap)
    assert owners.tolist() == [0, owner]
    assert len(best) == 1 + owner


def share_in_picture(edges: ndarray, size: tuple[int, int]) -> ndarray:
    """The part of each window's area that lies in the picture."""
    low = np.maximum(edges[:, :2], -0.5)
    high = np.minimum(edges[:, 2:], np.array(size) - 0.5)
    return np.clip(high - low, 0.0, None).prod(axis=1) / (edges[:, 2:] - edges[:, :2]).prod(axis=1)


def test_a_window_that_the_pictures_edge_cuts_is_judged_by_what_is_left() -> None:
    camera = world.look_at("cam", (0.0, -3.0, 1.5), (0.0, 0.0, 1.2), image_size=(640, 400))
    x, y = np.meshgrid(np.linspace(-2.4, 2.4, 97), np.linspace(-2.3, 0.5, 15))
    crowns = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 1.7)])
    found, there = Windows.at(camera, crowns, world.HEAD)
    centres = (found.edges[:, :2] + found.edges[:, 2:]) / 2.0
    visible = camera.contains(centres) | camera.contains(found.boxes[:, :2])
    shares = share_in_picture(found.edges, camera.image_size)
    assert_array_equal(there, visible & (shares > 0.35))
    assert (visible & (shares <= 0.35)).any()
    assert ((shares > 0.35) & (shares < 0.6) & there).any()


def test_corners_agree_from_the_least_number_on_and_up_to_the_largest_shift() -> None:
    places = np.random.default_rng(0).uniform(-50.0, 50.0, (LEAST_CORNERS, 2))
    far = LARGEST * 100.0
    for count, shift, known in (
        (LEAST_CORNERS, 1.0, True),
        (LEAST_CORNERS - 1, 1.0, False),
        (LEAST_CORNERS, far - 1e-6, True),
        (LEAST_CORNERS, far + 1e-6, False),
    ):
        found = consensus_shift(places[:count], np.full((count, 2), [shift, -shift]), 100.0)
        assert (found is not None) == known, (count, shift)
        if found is not None:
            np.testing.assert_allclose(found, [shift, -shift, 0.0], atol=1e-9)


def test_candidates_are_counted_by_the_gate_where_they_fell() -> None:
    boxes = np.arange(16.0).reshape(4, 4)
    fell = {GATES[0]: np.array([True, False, False, False]),
            GATES[4]: np.array([False, True, False, True])}  # fmt: skip
    dropped = Dropped.of(boxes, fell)
    assert_array_equal(dropped.boxes, boxes[[0, 1, 3]])
    assert dropped.gates.tolist() == [0, 4, 4]
    told = dropped.information(1)
    assert told == {
        "candidates": 4.0,
        f"dropped for {GATES[0]}": 1.0,
        f"dropped for {GATES[4]}": 2.0,
    }
    assert Dropped.none().information(0) == {"candidates": 0.0}


FURTHEST = 8191.75
"""Pixels from the origin that a packed centre can be at."""


@given(
    arrays(float, (7, 4), elements=st.floats(-FURTHEST, FURTHEST)),
    arrays(float, 7, elements=st.floats(0.0, 1e6)),
)
def test_what_is_unpacked_was_packed(boxes: ndarray, weights: ndarray) -> None:
    centres, shares = unpack_samples(pack_samples(boxes, weights))
    assert_allclose(centres, boxes[:, :2], atol=0.125)
    if weights.max() > 1e-6:
        assert_allclose(shares, weights / weights.max(), atol=0.0005)


def test_samples_of_no_weight_and_far_outside_are_kept() -> None:
    packed = pack_samples(np.array([[1e6, -1e6, 3.0, 4.0], [2.0, 3.0, 1.0, 1.0]]), np.zeros(2))
    centres, shares = unpack_samples(packed)
    assert_array_equal(centres, [[FURTHEST, -8192.0], [2.0, 3.0]])
    assert_array_equal(shares, [0.0, 0.0])
    assert pack_samples(np.zeros((0, 4)), np.zeros(0)).shape == (0, 3)
