"""Links that no correction refers to remain those of the result without corrections."""

from __future__ import annotations

import numpy as np

from tracker.corrections.constraints import Constraints
from tracker.smoothing.paths import Paths
from tracker.smoothing.tracklets.linking import PriorLinks
from tracker.smoothing.tracklets.motion import Pairs
from tracker.smoothing.tracklets.solver import TrackletGraph, link_tracklets

PIECES = 6
"""Three people, each in two pieces of two rows: 0 and 3, 1 and 4, 2 and 5."""
WHO = np.repeat([0, 1, 2, 0, 1, 2], 2)

CUT = Paths.of(
    list(range(PIECES)),
    [0, 0, 0, 3, 3, 3],
    [np.zeros((2, 3))] * PIECES,
    [np.tile(np.eye(3), (2, 1, 1))] * PIECES,
    3,
)
EARLIER, LATER = np.array([0, 1, 2, 0, 1]), np.array([3, 4, 5, 4, 5])
PAIRS = Pairs(EARLIER, LATER, np.full(5, 2), np.array([5.0, 5.0, 5.0, 5.5, 5.5]))
"""All three best go on as themselves; two alone, the first as the second and he as the third."""


def joined(gains: np.ndarray, constraints: Constraints) -> list[list[int]]:
    alone = np.full(PIECES, 1.0)
    graph = TrackletGraph(np.full(PIECES, -9.0), alone, alone, EARLIER, LATER, -gains)
    return link_tracklets(graph, constraints)


def test_who_is_parted_takes_nobody_elses_place() -> None:
    rows = np.arange(2 * PIECES)
    plain, prior_links = PriorLinks(), PriorLinks(WHO)
    assert joined(plain.gains(PAIRS, CUT, rows), Constraints()) == [[0, 3], [1, 4], [2, 5]]
    said = Constraints(cannot_link=((0, 3),), targets=frozenset({3}))
    moved = joined(plain.gains(PAIRS, CUT, rows), said)
    assert moved != [[0], [1, 4], [2, 5], [3]], "its own odds would move those nobody spoke of"
    assert joined(prior_links.gains(PAIRS, CUT, rows), said) == [[0], [1, 4], [2, 5], [3]]


def test_what_was_in_no_piece_of_anybody_and_what_was_two_peoples_has_its_own_odds() -> None:
    rows = np.arange(2 * PIECES)
    lost = np.where(WHO == 0, -1, WHO)
    more = PriorLinks(lost).gains(PAIRS, CUT, rows) - PAIRS.gains
    assert (more[[0, 3, 4]] == 0.0).all()
    assert (more[[1, 2]] > 0.0).all()
    # of those who were one person every join stays, the first label's too
    assert ((PriorLinks(WHO).gains(PAIRS, CUT, rows) - PAIRS.gains) > 0.0).tolist() == [
        True, True, True, False, False
    ]  # fmt: skip
    nothing = Pairs(EARLIER[:0], LATER[:0], LATER[:0], np.zeros(0))
    assert len(PriorLinks(WHO).gains(nothing, CUT, rows)) == 0
