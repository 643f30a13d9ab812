"""Where tracks are cut by themselves: at a draw, a change of name, and where nobody saw them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_array_equal

from tests import world
from tests.smoothing.known import Known, known
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.smoothing.tracklets import linking
from tracker.smoothing.tracklets.appearance import Appearances
from tracker.smoothing.tracklets.constraints import ConstraintResolver
from tracker.smoothing.tracklets.costs import Rates
from tracker.smoothing.tracklets.splitting import Splits, Tracked, find_splits, split_tracks

STEPS = 30
P = SmoothingParams(change=20.0)
"""Nobody is away for a moment."""


@pytest.fixture(autouse=True)
def short_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five steps are the longest gap."""
    monkeypatch.setattr("tracker.smoothing.tracklets.splitting.GAP", 0.5)


def tracked(scene: Known, **known_of: ndarray) -> Tracked:
    """Somebody alone, with what is known of the rows."""
    paths, links = scene.paths(sigma=0.05)
    smoother = scene.smoother()
    rows = len(paths.states)
    values = {
        "contested": np.zeros(rows), "had": np.ones(rows, dtype=bool), "names": np.full(rows, 7),
        **known_of,
    }  # fmt: skip
    fitted = smoother.fit(paths, links, 2)
    return Tracked(smoother, fitted, smoother.associate(fitted.paths), **values)


def standing(*hidden: int) -> Known:
    """Somebody who stands, whom no camera shows at some steps."""
    path = world.stand((0.3, 0.2), STEPS)[:, None]
    return known(path, hidden=lambda camera, person, step: step in hidden)


def left_out(found: Splits) -> list[int]:
    """The rows that are in no piece."""
    return np.flatnonzero(~found.clear).tolist()


def test_who_is_seen_at_every_step_is_not_cut() -> None:
    found = find_splits(tracked(standing()), P)
    assert found.clear.all()
    assert not found.reasons.any()
    assert not found.breaks.any()


def test_rows_whose_boxes_are_as_well_anothers_are_left_out_from_the_doubt_on() -> None:
    contested = np.zeros(STEPS)
    contested[[10, 15]] = P.ambiguity_threshold, P.ambiguity_threshold - 1e-9
    found = find_splits(tracked(standing(), contested=contested), P)
    assert left_out(found) == [10]
    assert np.flatnonzero(found.reasons).tolist() == [10]
    assert found.reasons[10] == 1


@pytest.mark.parametrize(("length", "cut_out"), [(5, False), (6, True)])
def test_a_gap_is_left_out_if_it_is_longer_than_the_longest(length: int, cut_out: bool) -> None:
    gap = list(range(12, 12 + length))
    found = find_splits(tracked(standing(*gap)), P)
    assert left_out(found) == (gap if cut_out else [])
    assert found.reasons[gap].tolist() == [3 if cut_out else 0] * length


def test_a_piece_reaches_from_the_first_box_to_the_last() -> None:
    found = find_splits(tracked(standing(0, 1, 28, 29)), P)
    assert left_out(found) == [0, 1, 28, 29]


@pytest.mark.parametrize(("begin", "own", "other"), [(10, 7, 9), (1, 0, 9), (10, 9, 0)])
def test_where_a_path_goes_on_under_another_name_it_is_cut(
    begin: int, own: int, other: int
) -> None:
    names = np.full(STEPS, own)
    names[begin:13], names[13:20] = -1, other
    found = find_splits(tracked(standing(), names=names), P)
    assert left_out(found) == list(range(begin, 13))
    assert np.flatnonzero(found.breaks).tolist() == [13, 20]
    # a gap after which it has the same name is none, nor is one at either end
    names = np.full(STEPS, own)
    names[:2], names[10:13], names[27:] = -1, -1, -1
    found = find_splits(tracked(standing(), names=names), P)
    assert found.clear.all()
    assert not found.breaks.any()


def test_a_gap_that_is_linked_over_is_filled_and_has_no_name() -> None:
    gap = range(12, 18)
    found = linking.link_tracks(tracked(standing(*gap)), P, Appearances())
    assert len(found.paths.labels) == 1
    assert np.flatnonzero(~found.had).tolist() == [*gap]
    assert np.flatnonzero(found.names < 0).tolist() == [*gap]


@pytest.mark.parametrize(("length", "seen", "cut_out"), [(6, False, True), (6, True, False)])
def test_what_the_filter_lost_for_long_holds_if_boxes_lead_through(
    length: int, seen: bool, cut_out: bool
) -> None:
    """Of the filter's gap of eight steps nobody saw six; or all were seen."""
    had = np.ones(STEPS, dtype=bool)
    had[11:19] = False
    gap = [] if seen else list(range(12, 12 + length))
    found = find_splits(tracked(standing(*gap), had=had), P)
    assert left_out(found) == (list(range(11, 19)) if cut_out else [])


def test_before_and_after_a_jump_rows_belong_to_neither_side() -> None:
    """Somebody who stands is at once two metres aside: a fifth of a second around it is left out
    and both sides are pieces of their own."""
    path = world.stand((0.3, 0.2), STEPS)
    path[15:, 0] -= 2.0
    found = find_splits(tracked(known(path[:, None])), replace_p(jump=40.0))
    assert found.breaks[15]
    assert {13, 14, 15, 16} <= set(left_out(found))
    assert set(found.reasons[[13, 14, 15, 16]].tolist()) == {2}
    assert found.clear[:10].all()
    assert found.clear[20:].all()
    calm = find_splits(tracked(known(path[:, None])), replace_p(jump=1e6))
    assert not calm.breaks.any()


def replace_p(**changes: float) -> SmoothingParams:
    """The parameters with some changed."""
    return P.model_copy(update=changes)


def test_short_pieces_beside_longer_ones_are_left_out_and_names_are_the_filters() -> None:
    """Four steps of 0.1 s stand for themselves, three do not."""
    one = tracked(standing(), names=np.repeat([0, 9, -1], 10))
    clear = np.ones(STEPS, dtype=bool)
    clear[[10, 14, 18, 29]] = False
    plain = Splits(
        np.zeros(STEPS, dtype=np.int64), clear, np.zeros(STEPS, dtype=bool), Rates(0.1, 0.1)
    )
    nobody = ConstraintResolver(one.fitted, (), 10)
    pieces, kept = split_tracks(one, plain, nobody)
    assert pieces.firsts.tolist() == [0, 19]
    assert pieces.lasts.tolist() == [9, 28]
    short = np.zeros(STEPS, dtype=bool)
    short[11:14] = short[15:18] = True
    pieces, kept = split_tracks(one, replace(plain, clear=short), nobody)
    assert pieces.firsts.tolist() == [11, 15], "where they are all there is they stay"
    assert_array_equal(kept, [11, 12, 13, 15, 16, 17])
    some = clear.copy()
    some[18] = True
    pieces, _ = split_tracks(one, replace(plain, clear=some), nobody)
    assert pieces.firsts.tolist() == [0, 15]
    assert pieces.labels.tolist() == [0, 9]
    four = clear.copy()
    four[10] = True
    four[9] = False
    pieces, _ = split_tracks(one, replace(plain, clear=four), nobody)
    assert pieces.firsts.tolist() == [0, 10, 19]
    assert pieces.lasts.tolist() == [8, 13, 28]
    assert pieces.labels.tolist() == [0, 9, 9]
    # four in a row are long enough to leave out a shorter one
    three = np.zeros(STEPS, dtype=bool)
    three[1:5] = three[6:9] = True
    assert split_tracks(one, replace(plain, clear=three), nobody)[0].lasts.tolist() == [4]
