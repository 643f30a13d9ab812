"""Every threshold of the corrections at, one below and one above: distances, steps, counts.

Lengths are binary fractions where a comparison must meet its threshold exactly.
"""

from __future__ import annotations

import io
from collections.abc import Sequence as Many
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from numpy import ndarray
from pydantic import ValidationError

from tests import world
from tracker.corrections import Correction, CorrectionError, Place
from tracker.corrections.consistency import along, find_repeated, refuse_contradiction
from tracker.corrections.constraints import Constraints
from tracker.corrections.finished_tracks import relabel
from tracker.corrections.kinds import content_of, digest, leeway, make
from tracker.corrections.lookup import TrackIndex, mostly_inside
from tracker.corrections.merging import difference, merge
from tracker.corrections.outcomes import Outcome, names_by_track, outcomes, supporting_corrections
from tracker.corrections.pointing import foot_on_floor, ground_under, stands, triangulate
from tracker.corrections.truth import checked_ranges, write_truth

ABOVE = 1e-6


def at(step: int, x: float = 0.0, y: float = 0.0) -> list[float]:
    """A place as a log has it."""
    return [step, x, y, 1.0]


def standing(
    spans: Many[tuple[int, int, int]], x: Many[float] = (0.0, 5.0, 10.0)
) -> tuple[ndarray, ndarray, ndarray]:
    """Steps, ids and positions: id, first and last step of each span; id k stands at x[k - 1]."""
    steps = np.concatenate([np.arange(first, last + 1) for _, first, last in spans])
    ids = np.repeat([name for name, _, _ in spans], [b - a + 1 for _, a, b in spans])
    places = np.zeros((len(steps), 3))
    places[:, 0], places[:, 2] = np.array(x)[ids - 1], 1.0
    return steps, ids, places


def nobody(first: int, last: int, accuracy: float = 0.5) -> Correction:
    """Nobody is at the origin from a step to a step."""
    places = [at(first)] if first == last else [at(first), at(last)]
    return make(kind="nobody", places=places, accuracy=accuracy)


# ── who is meant


@pytest.mark.parametrize(
    ("inside", "first", "last", "meant"),
    [
        ([1, 1, 0, 0], 0, 3, False),  # exactly half
        ([1, 1, 1, 0], 0, 3, True),
        ([1, 1, 0], 0, 2, True),
        ([1, 0, 0], 0, 2, False),
        ([1, 1, 0, 0], 0, 1, True),  # of the correction's steps alone
        ([0, 1, 1, 0], 1, 2, True),
        ([0, 0, 0, 1], 3, 3, True),  # one step of many, and nothing else was said
        ([0, 0, 0, 1], 3, 9, False),  # one step of many
        ([0, 0, 1, 1], 2, 9, True),  # two are enough
        ([1], 0, 9, True),  # the only one
        ([0, 0, 0, 0], 0, 3, False),
    ],
)
def test_who_is_mostly_inside_is_nobody(
    inside: list[int], first: int, last: int, meant: bool
) -> None:
    steps = np.arange(len(inside))
    owners = np.full(len(inside), 7)
    found = mostly_inside(owners, steps, np.array(inside, dtype=bool), nobody(first, last))
    assert found == ({7} if meant else set())


@pytest.mark.parametrize(
    ("place", "leeway", "found"),
    [
        ((3, 1.0, 0.0), 0, 1),  # at exactly the reach
        ((3, 1.0 + ABOVE, 0.0), 0, None),
        ((4, 0.0, 0.0), 0, None),
        ((5, 0.0, 0.0), 2, 1),  # as long as the leeway lasts, before and after
        ((6, 0.0, 0.0), 2, None),
        ((1, 0.0, 0.0), 2, 0),
        ((0, 0.0, 0.0), 1, None),
        ((5, 0.5, 0.0), 2, 1),  # the whole leeway counts half the reach
        ((5, 0.5 + ABOVE, 0.0), 2, None),
        ((4, 0.75, 0.0), 2, 1),
        ((4, 0.75 + ABOVE, 0.0), 2, None),
        ((4, 0.5, 0.0), 1, 1),
        ((4, 0.5 + ABOVE, 0.0), 1, None),
    ],
)
def test_a_place_means_the_nearest_within_reach_and_leeway(
    place: tuple[int, float, float], leeway: int, found: int | None
) -> None:
    where = TrackIndex(np.array([2, 3]), np.zeros((2, 3)))
    assert where.nearest(Place(*place, 1.0), leeway=leeway) == found


def test_who_is_not_there_is_meant_where_the_way_leads() -> None:
    """A gap of two steps halves the pace; beyond an end the path goes on as it came."""
    steps, x = np.array([0, 2, 3]), np.array([0.0, 1.0, 3.0])
    places = np.stack([x, np.zeros(3), np.zeros(3)], axis=1)
    where = TrackIndex(steps, places, np.array([4, 4, 4]))
    for step, expected, row in ((1, 0.5, 0), (4, 5.0, 2)):
        reach = 0.5 + ABOVE  # the leeway costs half the reach of 1 m
        assert where.nearest(Place(step, expected, 0.0, 1.0), leeway=1) in (row, 1)
        assert where.nearest(Place(step, expected, reach, 1.0), leeway=1) is None
    assert where.nearest(Place(-1, -0.5, 0.5, 1.0), leeway=1) == 0
    assert where.nearest(Place(4, 5.0, 0.5, 1.0), leeway=1) == 2
    alone = TrackIndex(steps, places, np.array([4, 5, 6]))
    assert alone.nearest(Place(4, 3.0, 0.5, 1.0), leeway=1) == 2
    assert alone.nearest(Place(4, 3.5 + ABOVE, 0.0, 1.0), leeway=1) is None
    repeated = TrackIndex(np.array([2, 2]), places[:2], np.array([4, 4]))  # no time, no pace
    assert repeated.nearest(Place(3, 1.0, 0.0, 1.0), leeway=1) == 1


def test_here_means_who_is_at_the_place_and_else_whom_it_names() -> None:
    where = TrackIndex(np.zeros(2, dtype=int), np.array([[0.0, 0, 0], [4.0, 0, 0]]))

    def meant(x: float, *more: list[float]) -> int | None:
        return where.row_of(make(kind="here", places=[at(0, x), *more]))

    assert meant(0.25, at(0, 4.0)) == 0
    assert meant(0.35, at(0, 4.0)) == 1
    assert meant(0.35) == 0
    assert meant(2.0, at(0, 2.0)) is None


@pytest.mark.parametrize(
    ("step", "x", "inside"),
    [
        (1, 0.0, False), (2, 0.0, True), (2, 0.5, True), (2, 0.5 + ABOVE, False),
        (3, 1.5, True), (3, 1.5 + ABOVE, False), (3, 0.5 - ABOVE, False),
        (4, 2.0, True), (5, 2.0, False),
    ],
)  # fmt: skip
def test_nobody_is_along_its_places_from_the_first_step_to_the_last(
    step: int, x: float, inside: bool
) -> None:
    said = make(kind="nobody", places=[at(2), at(4, 2.0)], accuracy=0.5)
    where = TrackIndex(np.array([step]), np.array([[x, 0.0, 1.0]]))
    assert where.inside(said).tolist() == [inside]
    way = along(said.places, step)
    assert way == (None if step in (1, 5) else (pytest.approx(step - 2.0), 0.0))


# ── what cannot both be true


@pytest.mark.parametrize(
    ("told", "refused"),
    [
        # two places of one step within 0.3 m are one person's
        ([("same", at(1), at(5)), ("different", at(1, 0.3), at(5, 0.3))], True),
        ([("same", at(1), at(5)), ("different", at(1, 0.31), at(5))], False),
        ([("same", at(1), at(5)), ("different", at(2), at(5))], False),
        # of one person they are less than 2 m apart at a step
        ([("same", at(1), at(5)), ("same", at(1), at(5, 2.0))], True),
        ([("same", at(1), at(5)), ("same", at(1), at(5, 1.99))], False),
        ([("same", at(1), at(5)), ("same", at(1), at(6, 2.0))], False),
        # whoever is tied in two steps is tied
        ([("same", at(1), at(5)), ("same", at(5), at(9)), ("different", at(1), at(9))], True),
        ([("exchanged", at(1), at(1, 4.0), at(2), at(2, 4.0)), ("same", at(1), at(2, 4.0))], True),
        ([("exchanged", at(1), at(1, 4.0), at(2), at(2, 4.0)), ("same", at(1), at(2))], False),
        # nobody is where somebody is: within its own reach, and 0.3 m at most
        ([("nobody", at(1), at(5)), ("here", at(3, 0.25))], True),
        ([("nobody", at(1), at(5)), ("here", at(3, 0.35))], False),
        ([("nobody", at(1), at(5)), ("here", at(5))], True),
        ([("nobody", at(1), at(5)), ("here", at(6))], False),
        ([("nobody", at(1), at(5)), ("here", at(0))], False),
        ([("left", at(3)), ("nobody", at(1), at(5))], True),
        ([("came", at(3)), ("nobody", at(1), at(5))], True),
        ([("name", at(3)), ("nobody", at(1), at(5))], True),
        ([("same", at(3), at(4)), ("nobody", at(1), at(5))], False),
    ],
)
def test_two_that_cannot_both_be_true_are_refused(told: list[tuple], refused: bool) -> None:
    *before, new = [
        make(kind=kind, places=places, name="Anna" if kind == "name" else None)
        for kind, *places in told
    ]
    if refused:
        with pytest.raises(CorrectionError, match=f'"{new.words}" contradicts "{before[-1].words}'):
            refuse_contradiction(before, new)
    else:
        refuse_contradiction(before, new)
    refuse_contradiction([*before[:-1], new], new)  # itself is no other one


def test_a_contradiction_names_the_correction_of_these_places() -> None:
    tie = make(kind="same", places=[at(1), at(5)])
    others = make(kind="same", places=[at(1, 5.0), at(7, 5.0)])  # at the same step, later said
    with pytest.raises(CorrectionError, match=f'contradicts "{tie.words}'):
        refuse_contradiction([tie, others], make(kind="different", places=[at(1), at(5)]))


@pytest.mark.parametrize(("reach", "apart", "refused"), [(0.1, 0.1, True), (0.1, 0.11, False)])
def test_nobody_reaches_no_farther_than_it_says(reach: float, apart: float, refused: bool) -> None:
    here = make(kind="here", places=[at(3, apart)])
    if refused:
        with pytest.raises(CorrectionError, match=r"a person is at \(0.10, 0.00\) at step 3"):
            refuse_contradiction([here], nobody(1, 5, reach))
    else:
        refuse_contradiction([here], nobody(1, 5, reach))


@pytest.mark.parametrize(
    ("accuracy", "step", "apart", "again"),
    [
        (0.1, 3, 0.29, True), (0.1, 3, 0.31, False), (0.1, 4, 0.0, False),
        (0.5, 3, 0.5, True), (0.5, 3, 0.51, False),
    ],
)  # fmt: skip
def test_whoever_is_moved_again_is_found_where_he_was_put(
    accuracy: float, step: int, apart: float, again: bool
) -> None:
    first, last = (
        make(kind="here", places=[at(3), at(3, x)], accuracy=accuracy) for x in (7.0, 8.0)
    )
    new = make(kind="here", places=[at(step, 2.0), at(step, apart)])
    old, meant = find_repeated([first, last], new)
    assert old == (last if again else None)
    assert meant.places[1:] == (last.places[1:] if again else new.places[1:])


# ── whether a run meets them


@pytest.mark.parametrize(("apart", "met"), [(0.0, True), (0.75, True), (0.76, False)])
def test_a_track_passes_a_place_within_three_of_its_sigmas(apart: float, met: bool) -> None:
    steps, ids, places = standing([(1, 0, 9)])
    said = make(kind="here", places=[at(5, apart)], accuracy=0.25)
    assert outcomes(steps, ids, places, [said], leeway=2)[0].met is met


@pytest.mark.parametrize(
    ("kind", "step", "spans", "met"),
    [
        # with a leeway of two steps: there at the third before, and at more than two on the way
        ("came", 5, [(2, 9)], False),
        ("came", 5, [(3, 9)], True),
        ("came", 5, [(2, 2), (4, 9)], False),
        ("came", 5, [(2, 2), (5, 9)], True),
        ("came", 5, [(0, 1), (3, 9)], True),
        ("left", 5, [(0, 8)], False),
        ("left", 5, [(0, 7)], True),
        ("left", 5, [(0, 6), (8, 8)], False),
        ("left", 5, [(0, 5), (8, 8)], True),
        # at the recording's ends it counts as far as there is something
        ("came", 0, [(0, 9)], True),
        ("came", 1, [(0, 9)], False),
        ("left", 9, [(0, 9)], True),
        ("left", 8, [(0, 9)], False),
    ],
)
def test_who_came_was_not_there_before_and_who_left_is_not_after(
    kind: str, step: int, spans: list[tuple[int, int]], met: bool
) -> None:
    steps, ids, places = standing([*((1, *span) for span in spans), (2, 9, 9)])
    found = outcomes(steps, ids, places, [make(kind=kind, places=[at(step)])], leeway=2)[0]
    assert (found.met, found.tracks) == (met, (1,))
    word = "before" if kind == "came" else "after"
    assert found.why == ("" if met else f"track 1 is there {word} it")


@pytest.mark.parametrize(
    ("kind", "places", "tracks", "why"),
    [
        ("same", [at(1), at(5)], (1, 1), ""),
        ("same", [at(1), at(5, 5.0)], (1, 2), "they are two tracks, 1 and 2"),
        ("different", [at(1), at(5, 5.0)], (1, 2), ""),
        ("different", [at(1), at(5)], (1, 1), "they are one track, 1"),
        ("exchanged", [at(1), at(1, 5.0), at(2), at(2, 5.0)], (1, 2, 1, 2), ""),
        ("exchanged", [at(1), at(1, 5.0), at(2, 5.0), at(2)], (1, 2, 2, 1),
         "1 and 2 go on as 2 and 1"),
        ("exchanged", [at(1), at(1), at(2, 5.0), at(2)], (1, 1, 2, 1),
         "only one of the two is there"),
        ("exchanged", [at(1), at(1, 5.0), at(2), at(2)], (1, 2, 1, 1),
         "only one of the two is there"),
        ("nobody", [at(0), at(9)], (1,), "somebody is still tracked there"),
        ("nobody", [at(0, 2.0), at(9, 2.0)], (), ""),
    ],
)  # fmt: skip
def test_what_becomes_of_each_kind(
    kind: str, places: list[list[float]], tracks: tuple[int, ...], why: str
) -> None:
    steps, ids, where = standing([(1, 0, 9), (2, 0, 9)])
    (found,) = outcomes(steps, ids, where, [make(kind=kind, places=places)], leeway=2)
    assert (found.met, found.tracks, found.why) == (not why, tracks, why)


@pytest.mark.parametrize(
    ("first", "last", "against"), [(0, 2, False), (0, 3, True), (6, 9, True), (7, 9, False)]
)
def test_what_stands_against_it_is_the_last_that_holds_of_the_same_steps(
    first: int, last: int, against: bool
) -> None:
    steps, ids, places = standing([(1, 0, 9), (2, 0, 9)])
    holds = make(kind="same", places=[at(3), at(6)])
    other = make(kind="same", places=[at(0, 5.0), at(9, 5.0)])
    unmet = make(kind="different", places=[at(first), at(last)])
    found = outcomes(steps, ids, places, [holds, other, unmet], leeway=2)[2]
    assert (f'; "{holds.words}" holds there' in found.why) is against
    assert other.words not in found.why


def test_a_name_is_the_later_one_that_is_met() -> None:
    named = [make(kind="name", places=[at(k)], name=name) for k, name in enumerate("ABC")]
    told = [Outcome(one.id, k < 2, tracks=(4,)) for k, one in enumerate(named)]
    assert names_by_track(told, named) == {4: "B"}
    assert names_by_track(told, named[:1]) == {4: "A"}


# ── what rests on them, and what was checked


@pytest.mark.parametrize(
    ("spans", "places", "begins"),
    [
        ([(0, 9)], [at(2), at(6)], 6),
        ([(0, 3), (5, 9)], [at(2), at(7)], 5),  # from where he comes back
        ([(0, 3), (5, 6), (8, 9)], [at(2), at(9)], 8),
        ([(0, 3), (5, 9)], [at(4), at(7)], 7),  # the gap before the first place is none of its own
        ([(0, 2), (4, 9)], [at(2), at(4)], 4),
        ([(0, 2), (4, 9)], [at(2), at(6)], 4),  # he leaves right after the first place
    ],
)
def test_a_track_rests_on_a_join_from_where_it_holds(
    spans: list[tuple[int, int]], places: list[list[float]], begins: int
) -> None:
    steps, ids, where = standing([(1, *span) for span in spans])
    said = make(kind="same", places=places)
    rests = supporting_corrections(
        steps, ids, [said], outcomes(steps, ids, where, [said], leeway=2)
    )
    assert [bool(name) for name in rests] == (steps >= begins).tolist()


def test_what_rests_on_what_ends_where_the_next_begins() -> None:
    steps, ids, where = standing([(1, 0, 9), (2, 0, 9)])
    late = make(kind="same", places=[at(1), at(7)])
    early = make(kind="exchanged", places=[at(2), at(2, 5.0), at(3), at(3, 5.0)])
    here = make(kind="here", places=[at(8)])
    other = make(kind="different", places=[at(4), at(5, 5.0)])
    away = make(kind="same", places=[at(4), at(5, 5.0)])
    told = [late, early, here, other, away]
    rests = np.array(
        supporting_corrections(steps, ids, told, outcomes(steps, ids, where, told, leeway=2))
    )
    names = {late.id: "L", early.id: "E", here.id: "H", other.id: "D", "": "."}
    assert "".join(names[one] for one in rests[ids == 1]) == "...EEEELLL"
    assert "".join(names[one] for one in rests[ids == 2]) == "...EEDDDDD"
    assert rests[(ids == 1) & (steps == 8)] == late.id, "a later join goes over a place"
    alone = np.array(
        supporting_corrections(steps, ids, [here], outcomes(steps, ids, where, [here], leeway=2))
    )
    assert steps[alone == here.id].tolist() == [8]


@pytest.mark.parametrize(
    ("spans", "ranges"),
    [
        ([], []),
        ([(3, 3)], [(3, 3)]),
        ([(4, 6), (0, 3)], [(0, 6)]),
        ([(5, 6), (0, 3)], [(0, 3), (5, 6)]),
        ([(0, 9), (2, 3), (9, 11)], [(0, 11)]),
    ],
)
def test_checked_steps_are_joined_where_none_lies_between(
    spans: list[tuple[int, int]], ranges: list[tuple[int, int]]
) -> None:
    told = [make(kind="checked", first=first, last=last) for first, last in spans]
    assert checked_ranges([*told, make(kind="here", places=[at(20)])]) == ranges
    tracks = world.tracks(world.stand((1.0, 2.0), 12)[:, None])
    stream = io.StringIO()
    if not ranges:
        with pytest.raises(CorrectionError, match="no step was checked"):
            write_truth(stream, tracks, told)
        return
    write_truth(stream, tracks, told)
    comment, header, *rows = stream.getvalue().splitlines()
    assert comment.endswith(" = " + " ".join(f"{a}-{b}" for a, b in ranges))
    assert header == "frame,id,x,y,z"
    known = [step for first, last in ranges for step in range(first, last + 1)]
    assert rows == [f"{step},1,1.0000,2.0000,0.8500" for step in known]


# ── relabelling by rows alone


@pytest.mark.parametrize(
    ("spans", "said", "names"),
    [
        # who is joined keeps the longer one's number; at once nobody is joined
        ([(1, 0, 3), (2, 4, 9)], ("same", at(3), at(4, 5.0)), {1: [2] * 4, 2: [2] * 6}),
        ([(1, 0, 5), (2, 6, 8)], ("same", at(5), at(6, 5.0)), {1: [1] * 6, 2: [1] * 3}),
        # while both are there neither ends: each turns into the other where they are nearest
        ([(1, 0, 6), (2, 3, 9)], ("same", at(1), at(8, 5.0)), {1: [2] * 3 + [1] * 4, 2: [2] * 7}),
        ([(1, 0, 5), (2, 5, 9)], ("same", at(3), at(7, 5.0)), {1: [1] * 5 + [3], 2: [1] * 5}),
        # and where one goes on after a gap, it gives way as well
        ([(1, 0, 3), (1, 8, 9), (2, 5, 9)], ("same", at(3), at(7, 5.0)),
         {1: [2] * 4 + [1] * 2, 2: [2] * 5}),
        # both miss a step of it, and the rows that are meant do not go forward
        ([(1, 0, 8), (1, 10, 12), (2, 0, 9), (2, 11, 12)],
         ("exchanged", at(9), at(9, 5.0), at(10, 5.0), at(10)), {1: [1] * 12, 2: [2] * 12}),
        # the first of the numbers may be the later one; two that mean one step stay two
        ([(2, 0, 3), (1, 4, 9)], ("same", at(3, 5.0), at(4)), {1: [1] * 6, 2: [1] * 4}),
        ([(1, 4, 9), (2, 0, 4)], ("same", at(3), at(4, 5.0)), {1: [1] * 6, 2: [2] * 5}),
        # parted from the later place on
        ([(1, 0, 9)], ("different", at(3), at(4)), {1: [2] * 4 + [1] * 6}),
        ([(1, 0, 3)], ("different", at(3), at(4)), {1: [1] * 3 + [2]}),  # both mean its last row
        # who came begins at the place, who left ends at it
        ([(1, 0, 9)], ("came", at(4)), {1: [2] * 4 + [1] * 6}),
        ([(1, 0, 9)], ("came", at(0)), {1: [1] * 10}),
        ([(1, 0, 9)], ("left", at(4)), {1: [1] * 5 + [2] * 5}),
        ([(1, 0, 9)], ("left", at(9)), {1: [1] * 10}),
        # nobody finds nobody
        ([(1, 0, 9)], ("came", at(4, 3.0)), {1: [1] * 10}),
        ([(1, 0, 9)], ("different", at(3, 3.0), at(4)), {1: [1] * 10}),
    ],
)  # fmt: skip
def test_each_kind_cuts_and_joins_where_it_says(
    spans: list[tuple[int, int, int]], said: tuple, names: dict[int, list[int]]
) -> None:
    steps, ids, places = standing(spans)
    kind, *of = said
    new, kept = relabel(steps, ids, places, [make(kind=kind, places=of)], leeway=1)
    assert len(kept) == len(steps)
    assert {name: new[ids == name].tolist() for name in names} == names
    assert len(set(zip(steps.tolist(), new.tolist(), strict=True))) == len(steps)


def test_two_turn_into_each_other_where_they_are_nearest_between_both_places() -> None:
    steps = np.tile(np.arange(10), 2)
    ids = np.repeat([1, 2], 10)
    apart = np.array([0.5, 8, 7, 4, 3, 2, 5, 6, 0.6, 9])
    places = np.zeros((20, 3))
    places[10:, 1] = apart
    for first, last, turn in ((2, 7, 5), (1, 4, 4), (5, 7, 6), (7, 9, 8), (0, 9, 8), (0, 2, 2)):
        said = make(kind="same", places=[at(first), at(last, 0.0, apart[last])])
        new, _ = relabel(steps, ids, places, [said], leeway=1)
        one = new[:10]
        assert one[first] == new[10 + last]
        assert (new[10 + turn :] == one[first]).all(), (first, last)
        assert (one[:turn] == one[first]).all()
        assert (one[turn:] != one[first]).all()


def test_one_path_is_parted_before_its_longest_way_in_between() -> None:
    x = np.cumsum([0.0, 0.1, 0.9, 0.1, 0.6, 0.1, 0.1, 0.95])
    places = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    steps, ids = np.arange(8), np.ones(8, dtype=np.int64)
    for first, last, cut in ((0, 7, 7), (0, 6, 2), (2, 6, 4), (1, 2, 2), (4, 6, 5), (1, 5, 2)):
        said = make(kind="different", places=[at(first, x[first]), at(last, x[last])])
        new, _ = relabel(steps, ids, places, [said], leeway=1)
        assert np.flatnonzero(np.diff(new)).tolist() == [cut - 1], (first, last)


def test_who_was_nobody_is_gone_from_the_first_row_along_it_to_the_last() -> None:
    steps, ids, places = standing([(1, 0, 9), (2, 0, 9)])
    places[(ids == 1) & (steps == 4), 0] = 3.0  # a step aside in between is nobody, too
    new, kept = relabel(steps, ids, places, [nobody(2, 6)], leeway=1)
    gone = np.setdiff1d(np.arange(20), kept)
    assert steps[gone].tolist() == [2, 3, 4, 5, 6]
    assert set(ids[gone]) == {1}
    assert (new == ids).all()


# ── clicks


@pytest.mark.parametrize(
    ("feet", "half", "ground"),
    [(0.25, 0.75, 0.0), (0.25 + ABOVE, 0.75, 0.25 + ABOVE), (-0.25, 0.75, 0.0),
     (0.3, 3.0, 0.0), (0.3 + ABOVE, 3.0, 0.3 + ABOVE), (None, 0.75, 0.0)],
)  # fmt: skip
def test_what_is_near_the_floor_stands_on_it(
    feet: float | None, half: float, ground: float
) -> None:
    assert ground_under(feet, floor=0.0, half_height=half) == ground


@pytest.mark.parametrize(
    ("height", "there"),
    [(0.75, True), (0.75 - ABOVE, False), (2.75, True), (2.75 + ABOVE, False), (1.5, True)],
)
def test_a_target_reaches_from_its_ground_to_its_head(height: float, there: bool) -> None:
    assert stands(height, ground=1.0, half_height=0.75) is there


def test_a_ray_must_go_down_to_a_floor_below_the_camera() -> None:
    camera = world.look_at("one", (0.0, -4.0, 1.0), (0.0, 0.0, 1.0))
    below = camera.project(np.array([[0.0, 44.0, 0.0]]))[0][0]  # an angle of 1 to 48
    flat = camera.project(np.array([[0.0, 47.5, 0.0]]))[0][0]  # and of 1 to 51.5
    found = foot_on_floor(camera, tuple(below.tolist()), floor=0.0, half_height=0.9)
    assert found == pytest.approx([0.0, 44.0, 0.9], abs=1e-6)
    for floor, pixel in ((0.0, flat), (1.0, below), (2.0, below)):
        with pytest.raises(CorrectionError, match="does not show the floor"):
            foot_on_floor(camera, tuple(pixel.tolist()), floor=floor, half_height=0.9)


@pytest.mark.parametrize(("apart", "refused"), [(0.495, False), (0.5, False), (0.505, True)])
def test_rays_that_miss_each_other_by_half_a_metre_show_two_points(
    apart: float, refused: bool
) -> None:
    """Two cameras that look at each other's right angle: the points lie one above the other."""
    cameras = [world.look_at("a", (-4.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
               world.look_at("b", (0.0, -4.0, 1.0), (0.0, 0.0, 1.0))]  # fmt: skip
    points = np.array([[0.0, 0.0, 1.0 - apart / 2.0], [0.0, 0.0, 1.0 + apart / 2.0]])
    cameras = [
        replace(camera, translation=-camera.rotation @ (camera.centre + point - [0.0, 0.0, 1.0]))
        for camera, point in zip(cameras, points, strict=True)
    ]
    clicks = [
        (camera, tuple(camera.project(point[None])[0][0].tolist()))
        for camera, point in zip(cameras, points, strict=True)
    ]
    if refused:
        with pytest.raises(CorrectionError, match=r"0\.5 m apart"):
            triangulate(clicks)
    else:
        assert triangulate(clicks) == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)


def test_the_place_of_clicks_is_nearest_to_all_rays() -> None:
    cameras = world.ring(3)
    rng = np.random.default_rng(3)
    clicks = [
        (
            camera,
            tuple(
                (camera.project(np.array([[0.4, -0.3, 1.1]]))[0][0] + rng.normal(0, 3, 2)).tolist()
            ),
        )
        for camera in cameras
    ]
    found = triangulate(clicks)

    def miss(place: ndarray) -> float:
        total = 0.0
        for camera, pixel in clicks:
            ray = camera.back_project(np.array([pixel]))[0]
            total += float(np.linalg.norm(np.cross(place - camera.centre, ray)) ** 2)
        return total

    for way in np.vstack([np.eye(3), -np.eye(3)]):
        assert miss(found) < miss(found + 1e-3 * way)


# ── what a correction is


@pytest.mark.parametrize(
    ("step_time", "steps"), [(0.1, 10), (0.04, 25), (0.66, 2), (0.67, 1), (1.0, 1), (5.0, 1)]
)
def test_a_second_in_steps_is_at_least_one(step_time: float, steps: int) -> None:
    assert leeway(step_time) == steps


@pytest.mark.parametrize(
    ("values", "wrong"),
    [
        ({"kind": "same", "places": [at(3), at(3)]}, "forward in time"),
        ({"kind": "same", "places": [at(3), at(4)]}, ""),
        ({"kind": "different", "places": [at(4), at(3)]}, "forward in time"),
        ({"kind": "same", "places": [at(3)]}, "same has 2, found 1"),
        ({"kind": "here", "places": [at(3)] * 3}, "here has 1 to 2, found 3"),
        ({"kind": "nobody", "places": []}, "nobody has 1 or more, found 0"),
        ({"kind": "exchanged", "places": [at(3), at(4), at(4), at(5)]}, "two before and then two"),
        ({"kind": "exchanged", "places": [at(3), at(4), at(5), at(5)]}, ""),
        ({"kind": "here", "places": [at(3), at(4)]}, "one step"),
        ({"kind": "here", "places": [at(3), at(3)]}, ""),
        ({"kind": "nobody", "places": [at(3), at(3)]}, "one place a step"),
        ({"kind": "nobody", "places": [at(4), at(3)]}, "one place a step"),
        ({"kind": "came", "places": [at(-1)]}, "from 0 on"),
        ({"kind": "came", "places": [at(0)]}, ""),
        ({"kind": "checked", "first": 3, "last": 2}, "from 3 on, found 2"),
        ({"kind": "checked", "first": 3, "last": 3}, ""),
        ({"kind": "checked", "first": 3}, "last: checked needs it"),
        ({"kind": "checked", "first": -1, "last": 3}, "first"),
        ({"kind": "came", "places": [at(0)], "accuracy": 0.1}, "accuracy: came has none"),
        ({"kind": "name", "places": [at(0)]}, "name: name needs it"),
        ({"kind": "here", "places": [at(0)], "accuracy": 0.01}, ""),
        ({"kind": "here", "places": [at(0)], "accuracy": 0.0099}, "accuracy"),
        ({"kind": "here", "places": [at(0)], "accuracy": 5.0}, ""),
        ({"kind": "here", "places": [at(0)], "accuracy": 5.01}, "accuracy"),
        ({"kind": "here", "places": [at(0, float("nan"))]}, "places"),
        ({"kind": "name", "places": [at(0)], "name": "x" * 81}, "name"),
        ({"kind": "name", "places": [at(0)], "name": "x" * 80}, ""),
        ({"kind": "hear", "places": [at(0)]}, "kind: Input should be 'same'"),
        ({"places": [at(0)]}, "kind: Field required$"),
        ({"kind": "here", "places": [3]}, "^places.0: .*, found 3$"),
        ({"kind": "here", "places": [[]]}, "^places.0"),
        ({"kind": "here", "places": [{"step": 3}]}, "^places.0.x: Field required$"),
    ],
)  # fmt: skip
def test_a_correction_is_complete_or_refused(values: dict, wrong: str) -> None:
    if not wrong:
        make(**values)
        return
    with pytest.raises(CorrectionError, match=wrong):
        make(**values)


def test_what_is_no_table_is_no_correction() -> None:
    with pytest.raises(ValidationError, match="valid dictionary"):
        Correction.model_validate(["same"])


def test_a_correction_speaks_of_its_places() -> None:
    one = make(kind="exchanged", places=[at(4, 1.0), at(3, 2.0), at(6, 3.0), at(5, 4.0)])
    a, b, c, d = one.places
    assert (one.constraints.must_link, one.constraints.cannot_link, one.steps) == (
        ((a, c), (b, d)),
        ((a, d), (b, c)),
        (3, 6),
    )
    assert one.words == "exchanged from here, steps 3 – 6"
    same, different = (make(kind=kind, places=[at(1), at(4)]) for kind in ("same", "different"))
    assert same.constraints == Constraints(must_link=(same.places,))
    earlier, later = same.places
    assert not same.constraints.mapped({earlier: 1})
    assert same.constraints.mapped({earlier: 1, later: 2}).must_link == ((1, 2),)
    assert different.constraints == Constraints(cannot_link=(different.places,))
    own = frozenset({Place(*at(7))})
    assert make(kind="came", places=[at(7)]).constraints == Constraints(firsts=own)
    assert make(kind="left", places=[at(7)]).constraints == Constraints(lasts=own)
    assert make(kind="nobody", places=[at(7)]).constraints == Constraints(clutter=own)
    assert make(kind="here", places=[at(7), at(7, 2.0)]).constraints == Constraints(targets=own)
    assert not make(kind="name", places=[at(7)], name="Anna").constraints
    here = make(kind="here", places=[at(7)])
    assert (here.words, here.accuracy, here.steps) == ("is here, step 7", 0.1, (7, 7))
    assert make(kind="nobody", places=[at(7)]).accuracy == 0.5
    assert make(kind="name", places=[at(7)], name="Anna").words == "Anna, step 7"
    checked = make(kind="checked", first=2, last=9)
    assert (checked.words, checked.steps) == ("steps 2 – 9 checked", (2, 9))
    assert a.words == "(1.00, 0.00) at step 4"
    assert a.point.tolist() == [1.0, 0.0, 1.0]


def test_a_place_is_kept_to_a_tenth_of_a_millimetre_and_an_id_is_its_content() -> None:
    when = datetime(2026, 1, 2, tzinfo=UTC)
    one = make(kind="came", places=[[3, 1.00004, 2.0, 1.0]], time=when)
    same = make(kind="came", places=[[3, 1.00001, 2.0, 1.0]], time=when)
    other = make(kind="came", places=[[3, 1.0001, 2.0, 1.0]], time=when)
    assert one.places[0].x == 1.0
    assert one == same
    assert one.id == same.id != other.id
    assert len(one.id) == 12
    assert make(kind="came", id="own", places=[at(3)]).id == "own"


# ── logs: what a run depends on, and two as one


def test_a_run_depends_on_content_and_order_and_not_on_who_said_it_when() -> None:
    one, other = make(kind="came", places=[at(1)]), make(kind="left", places=[at(2)])
    renamed = one.model_copy(
        update={"note": "x", "id": "y", "time": datetime(2020, 1, 1, tzinfo=UTC)}
    )
    checked = make(kind="checked", first=0, last=1)
    kinds = ("came", "left")
    assert digest([one, other], kinds) == digest([renamed, checked, other], kinds)
    assert digest([one, other], kinds) != digest([other, one], kinds)
    assert digest([one, other], kinds) != digest([one], kinds)
    assert digest([checked], kinds) == ""
    assert len(digest([one], kinds)) == 16
    assert content_of(one) == content_of(renamed) != content_of(other)


def test_two_logs_are_merged_by_time_and_only_then_by_id() -> None:
    begin = datetime(2026, 1, 2, tzinfo=UTC)
    names = {"b": 0, "a": 60, "d": 30, "c": 60, "e": 90}
    told = {
        name: make(kind="came", id=name, places=[at(k)], time=begin + timedelta(seconds=seconds))
        for k, (name, seconds) in enumerate(names.items())
    }
    first, second = [told[k] for k in "bae"], [told[k] for k in "dc"]
    assert [one.id for one in merge(first, second)] == ["b", "d", "a", "c", "e"]
    assert merge(first, second) == merge(second, first)
    assert merge(first, first) == merge(first, ()) == tuple(first)
    gone = difference(first, second)
    assert (gone.only_first, gone.only_second) == (tuple(first), tuple(second))
    assert not gone.empty
    assert not difference(first, ()).empty
    assert not difference((), first).empty
    assert difference(first, first).empty
    changed = told["b"].model_copy(update={"note": "other"})
    assert difference(first, [changed, *first[1:]]).changed == ((told["b"], changed),)
    assert not difference(first, [changed, *first[1:]]).empty


def test_what_is_said_twice_in_one_log_stays_twice() -> None:
    begin = datetime(2026, 1, 2, tzinfo=UTC)
    twice = [make(kind="came", id=k, places=[at(1)], time=begin) for k in "ab"]
    other = make(kind="left", id="c", places=[at(9)], time=begin)
    assert len(merge(twice, [other])) == 3
    assert len(merge(twice, [other, twice[0].model_copy(update={"id": "d"})])) == 2


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"kind": "here", "places": [at(1)], "accuracy": 9.0},
         "accuracy: Input should be less than or equal to 5, found 9.0"),
        ({"kind": "came", "places": [[1, "x", 0.0, 1.0]]},
         "places.0.1: Input should be a valid number, unable to parse string as a number, "
         "found 'x'"),
        ({"kind": "came", "places": []}, "places: came has 1, found 0"),
        ({"kind": "came", "places": 3}, "places: Input should be a valid tuple, found 3"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_sentence(values: dict, sentence: str) -> None:
    with pytest.raises(CorrectionError) as error:
        make(**values)
    assert str(error.value) == sentence
