"""What pieces and their links are worth, by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests import world
from tests.smoothing.known import PLAIN, known
from tests.smoothing.test_appearance import noisy, recording
from tests.smoothing.test_boundaries import PRIOR, fitted, standing
from tracker.corrections.kinds import make
from tracker.filters.models import Motion
from tracker.fusion.target_model import inside_probability
from tracker.parameters.groups.fusion import FusionParams
from tracker.parameters.groups.smoothing import SmoothingParams
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.protocol import Smoothed
from tracker.smoothing.smoother import BoxAssociations, Smoother
from tracker.smoothing.tracklets import costs, linking
from tracker.smoothing.tracklets.appearance import AppearanceModel
from tracker.smoothing.tracklets.motion import Ends, Pairs, motion_gains

STEP, FRAMES, SURVIVAL, BIRTH = 0.1, 20, 0.9, 0.4


def smoother(*cameras: object) -> Any:
    """What the odds ask of a smoother: 20 steps of 0.1 s."""
    parameters = FusionParams(survival_probability=SURVIVAL, birth_rate=BIRTH)
    model = SimpleNamespace(step_time=STEP, motion=Motion.of(parameters, STEP), cameras=[])
    return SimpleNamespace(
        parameters=parameters, model=model, frames=FRAMES, cameras=list(cameras), prior=PRIOR,
        log_place=1.5,
    )  # fmt: skip


NOBODYS = Links(*(np.zeros(0, dtype=np.int64) for _ in range(3)), np.zeros(0))
P = SmoothingParams()
"""Two fifths of a step's evidence are new."""
RATES = costs.Rates(BIRTH * STEP, 1.0 - SURVIVAL)


def test_a_piece_is_worth_its_boxes_less_its_misses_and_comes_and_goes_inside_the_recording() -> (
    None
):
    """A piece from the first step on has not come, and one to the last step has not left."""
    paths = standing((1, 0, 18, 0.0), (2, 1, 19, 0.0), (3, 5, 7, 0.0))
    rows = len(paths.states)
    own = fitted(paths)
    own.odds[:] = np.arange(rows) / 10.0
    chances, missed = np.full((2, rows), 0.5), np.zeros((2, rows))
    chances[1], missed[0, 0], missed[1, 20] = 1.0, 1.0, 0.5
    shared = BoxAssociations(NOBODYS, chances, missed, np.full((2, rows), -1))
    worths, births, deaths = costs.tracklet_odds(smoother(), own, shared, P, RATES)
    bounds = ((0, 19), (19, 38), (38, 41))
    expected = [own.odds[a:b].sum() + (b - a) * np.log(SURVIVAL) + 1.5 for a, b in bounds]
    expected[0] += 0.4 * np.log(0.5)
    expected[1] += 0.4 * 0.5 * np.log(1e-6)
    assert_allclose(worths, expected)
    assert_allclose(births, [0.0, *[np.log(BIRTH * STEP)] * 2])
    assert_allclose(deaths, [np.log(1.0 - SURVIVAL), 0.0, np.log(1.0 - SURVIVAL)])
    assert RATES.restart == pytest.approx(np.log(BIRTH * STEP * (1.0 - SURVIVAL)))


@pytest.mark.parametrize(("birth", "death"), [(0.02, 0.01), (0.4, 0.2)])
def test_rates_are_those_of_the_tracks_and_of_the_parameters_where_these_tell_nothing(
    birth: float, death: float
) -> None:
    """Without tracks the parameters hold; from many they are recovered, whatever the prior."""
    steps, rng = 4000, np.random.default_rng(3)
    begins = np.flatnonzero(rng.random(steps) < birth)
    ends = np.minimum(begins + rng.geometric(death, len(begins)) - 1, steps - 1)
    spans = zip(range(1, len(begins) + 1), begins.tolist(), ends.tolist(), strict=True)
    paths = standing(*((label, first, last, 0.0) for label, first, last in spans))
    long = smoother()
    long.frames = steps
    everyone = np.ones(len(begins), dtype=bool)
    found = costs.Rates.of(long, paths, everyone)
    assert found.birth == pytest.approx(birth, rel=0.25)
    assert found.death == pytest.approx(death, rel=0.25)
    few = costs.Rates.of(long, paths, everyone & (np.arange(len(begins)) % 2 > 0))
    assert few.birth == pytest.approx(found.birth / 2.0, rel=0.1)
    assert few.death == pytest.approx(found.death, rel=0.25)
    never = costs.Rates.of(smoother(), standing((1, 0, FRAMES - 1, 0.0)), np.zeros(1, dtype=bool))
    assert never.death == pytest.approx(1.0 - SURVIVAL)
    assert never.birth == pytest.approx(1.0 / (FRAMES + 1.0 / (BIRTH * STEP)))
    assert_allclose(np.exp([found.survival, found.leave]), [1.0 - found.death, found.death])


def test_who_is_there_at_both_ends_of_the_recording_has_neither_come_nor_left() -> None:
    one = np.ones(1, dtype=bool)
    whole, later, earlier = (
        costs.Rates.of(smoother(), standing((1, first, last, 0.0)), one)
        for first, last in ((0, FRAMES - 1), (1, FRAMES - 1), (0, FRAMES - 2))
    )
    assert later.birth == pytest.approx(2.0 * whole.birth)
    assert earlier.birth == whole.birth
    assert whole.death == pytest.approx(1.0 / (FRAMES + 1.0 / (1.0 - SURVIVAL)))
    assert earlier.death == pytest.approx(2.0 / (FRAMES - 1 + 1.0 / (1.0 - SURVIVAL)))


def test_a_link_survives_its_gap_and_its_motion_tells_as_much_as_is_new() -> None:
    paths = standing((1, 0, 4, 0.0), (2, 5, 9, 0.1), (3, 8, 12, 0.2), (4, 26, 28, 0.2))
    known = Ends.alone(fitted(paths), PRIOR)
    found = costs.ShortGapOdds(smoother(), paths, NOBODYS, P, None, RATES).pairs(known)
    pairs = Pairs(np.array([0, 0, 1, 2]), np.array([1, 2, 3, 3]), np.array([1, 4, 17, 14]),
                  np.zeros(4))  # fmt: skip
    for name in ("earlier", "later", "gaps"):
        assert getattr(found, name).tolist() == getattr(pairs, name).tolist()
    motion = motion_gains(
        paths, pairs, known.discounted(0.4), smoother().model.motion, PRIOR, smoother().log_place
    )
    assert_allclose(found.gains, motion + pairs.gaps * np.log(SURVIVAL))


def test_the_longest_gap_is_two_seconds_and_the_fastest_goes_three_metres_in_one() -> None:
    p = SmoothingParams(longest=0.6)
    paths = standing((1, 0, 4, 0.0), (2, 10, 12, 2.8), (3, 10, 12, 2.8001), (4, 11, 12, 0.0))
    found = costs.ShortGapOdds(smoother(), paths, NOBODYS, p, None, RATES).pairs(
        Ends.alone(fitted(paths), PRIOR)
    )
    assert list(zip(found.earlier.tolist(), found.later.tolist(), strict=True)) == [(0, 1)]


def test_who_comes_back_is_one_of_those_who_left() -> None:
    """By the label of the filter alone; by looks as likely as one of all who were gone."""
    paths = standing((5, 0, 2, 0.0), (6, 0, 3, 3.0), (5, 8, 9, 0.0), (7, 3, 4, 0.0), (8, 5, 8, 0.0))
    chains = [[0], [1], [2], [3], [4]]
    found = costs.long_gap_odds(smoother(), paths, NOBODYS, chains, P, None, RATES)
    newcomer = np.log(BIRTH * STEP * (1.0 - SURVIVAL))
    assert list(zip(found.earlier.tolist(), found.later.tolist(), strict=True)) == [(0, 2)]
    assert found.gains == pytest.approx([newcomer + costs.KEEPING])
    assert found.gaps.tolist() == [6]
    # of one chain already, or of two that are both there at a step, nothing is said
    for chains in ([[0, 2], [1]], [[0, 4], [2]]):
        found = costs.long_gap_odds(smoother(), paths, NOBODYS, chains, P, None, RATES)
        assert len(found.gains) == 0


@pytest.mark.parametrize("weight", [1.0, 0.5])
def test_looks_weigh_in_a_link_and_in_a_return(weight: float) -> None:
    _, links, camera, embeddings = recording(noisy(7))
    # the last comes after all others
    pieces = [(k, 0, 7, 3.0 * k) for k in range(6)]
    later = standing(*pieces, (6, 9, 16, 0.1))
    p = SmoothingParams(appearance=weight)
    alike = AppearanceModel(later, links, [camera], [embeddings], STEP)
    ratio, known = alike.log_ratio(np.arange(6), np.full(6, 6))
    assert known.all()
    assert ratio[::2].min() > ratio[1::2].max()
    chains = [[k] for k in range(7)]
    found = costs.long_gap_odds(smoother(camera), later, links, chains, p, [embeddings], RATES)
    newcomer = np.log(BIRTH * STEP * (1.0 - SURVIVAL))
    assert_allclose(found.gains, newcomer - np.log(6.0) + weight * ratio)
    assert found.earlier.tolist() == list(range(6))
    assert found.later.tolist() == [6] * 6
    # who comes in the last step of the others is none of them
    at_once = standing(*pieces, (6, 7, 14, 0.1))
    found = costs.long_gap_odds(smoother(camera), at_once, links, chains, p, [embeddings], RATES)
    assert len(found.gains) == 0


# ── what is told of them


def test_a_cut_is_told_where_a_track_does_not_go_on_as_the_filter_had_it() -> None:
    """Pieces of label 4 in two chains, with rows left out in between for a reason; of label 6 in
    one."""
    before = standing((4, 2, 11, 0.0), (6, 0, 9, 3.0))
    cut = standing((4, 2, 5, 0.0), (4, 8, 11, 0.0), (6, 0, 3, 3.0), (6, 5, 9, 3.0))
    kept = np.array([0, 1, 2, 3, 6, 7, 8, 9, 10, 11, 12, 13, 15, 16, 17, 18, 19])
    for reasons, why in (
        ([0, 0], "past and future do not fit"), ([2, 0], "past and future do not fit"),
        ([3, 2], "nobody saw it, or it was not there"), ([3, 1], "whose boxes these are was near"),
        ([1, 0], "whose boxes these are was near"),
    ):  # fmt: skip
        every = np.full(20, 3)
        every[4:6] = reasons
        every[[3, 6]] = 1  # the pieces' own rows do not count
        found = linking.split_decisions(cut, before, kept, every, [[0], [1], [2, 3]], [4, 9, 6])
        (one,) = found
        assert (one.kind, one.step, one.label, one.other) == ("cut", 8, 4, 4)
        assert one.reason.startswith(why)
    assert linking.split_decisions(cut, before, kept, every, [[1], [2, 3]], [9, 6]) == []


def test_a_join_is_told_with_its_odds_against_the_best_other() -> None:
    cut = standing((4, 0, 5, 0.0), (7, 6, 9, 0.0), (8, 0, 4, 1.0), (9, 11, 14, 0.0), (9, 16, 19, 0))
    pairs = Pairs(np.array([0, 2, 1]), np.array([1, 1, 3]), np.array([1, 2, 2]),
                  np.array([2.0, 1.0, -1.0]))  # fmt: skip
    found = linking.join_decisions(cut, pairs, [[0, 1, 3, 4], [2]], [4, 8], -3.0, set())
    weights = np.exp([2.0, 1.0, -3.0])
    first, second = found
    assert (first.step, first.label, first.other) == (6, 4, 7)
    assert (first.probability, first.against) == pytest.approx(tuple(weights[:2] / weights.sum()))
    assert first.reason == "one person goes on"
    assert (second.step, second.other, second.reason) == (11, 9, "one person")
    assert second.probability == pytest.approx(1.0 / (1.0 + np.exp(-2.0)))
    told = linking.join_decisions(cut, pairs, [[0, 1], [2]], [7, 8], -3.0, {(0, 1)})[0]
    assert (told.other, told.probability, told.reason) == (4, 1.0, "a person said so")
    (tied,) = linking.join_decisions(cut, pairs, [[2, 3]], [8], -3.0, set())
    assert tied.reason == "a person said so"


def test_an_empty_way_between_two_pieces_counts_against_their_link(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each step of the gap, straight from the one to the other, adds log(1 − p_D) of each camera
    that has a frame and shows the place and no box there."""
    path = world.walk([(-0.4, 0.0), (0.5, 0.3)], [0.0, 3.0], 10.0)[:30, None]
    scene = known(path, hidden=lambda camera, person, step: 10 <= step < 15 and camera != 2)
    views = scene.views
    views[12] = (ViewResult.of_no_frame(), *views[12][1:])
    smoother = Smoother(scene.whole, PLAIN.fusion, views)
    states, spread = np.zeros((30, 6)), np.tile(np.eye(6), (30, 1, 1))
    states[:, :3] = path[:, 0]
    own = [np.arange(10), np.arange(15, 20), np.arange(21, 30)]
    paths = Paths.of(
        [1, 2, 3], [0, 15, 21], [states[rows] for rows in own], [spread[rows] for rows in own], 6
    )
    pairs = Pairs(np.array([0, 0, 1]), np.array([1, 2, 2]), np.array([6, 12, 2]), np.zeros(3))
    expected = []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        begin, end = paths.lasts[i], paths.firsts[j]
        total = 0.0
        for step in range(begin + 1, end):
            share = (step - begin) / (end - begin)
            place = ((1.0 - share) * states[begin] + share * states[end])[None]
            for c, camera in enumerate(scene.whole.cameras):
                seen = smoother.model.target.expected(camera, place)
                chance = 0.95 * inside_probability(camera, seen, np.zeros((1, 6, 6)))[0]
                if not len(views[step][c].boxes) and not views[step][c].blind:
                    total += np.log(1.0 - chance)
        expected.append(total)
    assert max(expected[:2]) < -20.0
    assert_allclose(costs._seen_empty(smoother, paths, pairs, 0.25), 0.4 * np.array(expected))
    monkeypatch.setattr(costs, "_POINTS", 3)
    assert_allclose(costs._seen_empty(smoother, paths, pairs, 0.25), 0.4 * np.array(expected))


# ── corrections that wait until the links without them are known


@pytest.mark.parametrize(
    ("x", "careful", "unmet"),
    [
        # two tracks at 0 and 5 m, and nobody at 9 m; "different" of one track is not met
        ([0.0, 0.0, 5.0], True, [0, 2]), ([0.0, 0.0, 5.0], False, [0, 1, 2]),
        ([9.0, 0.0, 5.0], True, [0]), ([0.0, 9.0, 5.0], True, [0]),
        ([9.0, 0.0, 5.0], False, [0, 1, 2]), ([], True, []),
    ],
)  # fmt: skip
def test_corrections_that_are_not_met_are_applied_one_of_a_track_at_a_time(
    x: list[float], careful: bool, unmet: list[int]
) -> None:
    paths = standing((1, 0, 9, 0.0), (2, 0, 9, 5.0))
    waiting = [
        make(kind="different", places=[[k + 1, at, 0.0, 0.85], [8, at, 0.0, 0.85]])
        for k, at in enumerate(x)
    ]
    tracks = replace(
        Smoothed.empty(6, 0), frames=paths.steps, labels=paths.labels[paths.owners],
        means=paths.states,
    )  # fmt: skip
    found = linking._unmet(tracks, waiting, 2, careful=careful)
    assert found == [waiting[k] for k in unmet]
    met = make(kind="different", places=[[1, 0.0, 0.0, 0.85], [8, 5.0, 0.0, 0.85]])
    assert linking._unmet(tracks, [met, *waiting], 2, careful=careful) == found
