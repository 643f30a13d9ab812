"""The person who knows the truth and answers the queue."""

from __future__ import annotations

import numpy as np

from tests.papers.laboratory.answering import Truthful
from tracker.corrections import Place
from tracker.fusion.trajectories import Trajectories
from tracker.review.queue import Alternative, ReviewItem
from tracker.review.queue.item import propose
from tracker.sequences.sequence import GroundTruth


def tracks(rows: list[tuple[int, int, float]]) -> Trajectories:
    """Rows of step, id and x."""
    steps, ids, x = (np.array(column) for column in zip(*rows, strict=True))
    count = len(steps)
    return Trajectories(
        frames=steps, ids=ids, positions=np.column_stack([x, np.zeros(count), np.ones(count)]),
        existences=np.ones(count), sigmas=np.ones((count, 3)), seen=np.ones((count, 1), bool),
        components=np.zeros(count, int), labels=ids, covariances_xy=np.zeros(count),
        heights=np.full(count, np.nan), sigma_heights=np.full(count, np.nan),
    )  # fmt: skip


def truth(rows: list[tuple[int, int, float]]) -> GroundTruth:
    steps, ids, x = (np.array(column) for column in zip(*rows, strict=True))
    places = np.column_stack([x, np.zeros(len(x)), np.ones(len(x))])
    return GroundTruth(steps, ids, places, np.ones(len(x), bool))


def at(step: int, x: float) -> Place:
    return Place(step, x, 0.0, 1.0)


def test_in_a_row_of_people_nobody_moves_up_for_a_false_track() -> None:
    people = truth([(0, k, 0.9 * k) for k in range(1, 6)])
    # the fifth is lost, and nobody's track stands before the first
    shown = tracks([(0, 10, 0.0), *((0, 10 + k, 0.9 * k) for k in range(1, 5))])
    person = Truthful(people, 1.0, shown, 0.5)
    assert [person.who(at(0, 0.9 * k)) for k in range(5)] == [None, 1, 2, 3, 4]


def test_what_says_most_is_answered_and_somebody_is_not_nobody() -> None:
    people = truth([(0, 1, 0.0), (0, 2, 5.0), (9, 1, 5.0), (9, 2, 0.0)])
    shown = tracks([(0, 1, 0.0), (0, 2, 5.0), (9, 1, 0.0), (9, 2, 5.0), (9, 3, 20.0)])
    person = Truthful(people, 1.0, shown, 0.5)
    a, b, c, d = at(0, 0.0), at(0, 5.0), at(9, 0.0), at(9, 5.0)

    def asked(*others: Alternative) -> ReviewItem:
        now = Alternative("as it is", 0.5, propose("same", (a, c)))
        return ReviewItem("exchange", "", "", 0, 9, (1, 2), (a, c), 0.5, 1, (now, *others))

    apart = Alternative("two people", 0.3, propose("different", (a, c)))
    exchanged = Alternative("exchanged", 0.2, propose("exchanged", (a, b, d, c)))
    assert person.wrong(asked(apart))
    assert [one.kind for one in person.answer(asked(apart, exchanged))] == ["exchanged"]
    assert person.holds(propose("different", (a, at(9, 20.0)))[0])
    assert not person.holds(propose("same", (a, at(9, 20.0)))[0])


def test_whose_a_track_is_a_film_of_the_moment_tells() -> None:
    # two side by side: at one step the track of the first is nearer to the second
    people = truth([(k, who, x) for k in range(9) for who, x in ((1, 0.0), (2, 0.5))])
    beside = {4: 0.4}
    shown = tracks([(k, 7, beside.get(k, 0.0)) for k in range(9)])
    person = Truthful(people, 1.0, shown, 0.5)
    assert [person.who(at(k, beside.get(k, 0.0))) for k in (3, 4, 5)] == [1, 1, 1]
    # who is somebody else from a step on is so before and after
    shown = tracks([(k, 7, 0.0 if k < 5 else 0.5) for k in range(9)])
    person = Truthful(people, 1.0, shown, 0.5)
    assert [person.who(at(k, x)) for k, x in ((2, 0.0), (7, 0.5))] == [1, 2]
