"""At, just within and just beyond every bound and count that the evaluation compares with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.evaluation.scenes import HALF_EXTENTS, comparison, tracks_of, truth_of
from tracker.evaluation import EvaluationSettings, evaluate
from tracker.evaluation.clear import clear
from tracker.evaluation.hota import ALPHAS, hota
from tracker.evaluation.identity import identity
from tracker.evaluation.matching import assign, match, to_rows
from tracker.evaluation.ospa import gospa_parts, ospa_parts
from tracker.evaluation.pixels import pixels
from tracker.evaluation.positions import positions
from tracker.geometry.camera import Camera

ONE = truth_of([(0, 1, 0, 0, 0)])


def at(distance: float):
    """One person and one estimate, so far apart."""
    return comparison(ONE, tracks_of([(0, 7, distance, 0, 0)]), gate=1.0)


@pytest.mark.parametrize(("distance", "paired"), [(0.999, 1), (1.0, 1), (1.001, 0)])
def test_the_gate_itself_is_within_the_gate(distance: float, paired: int) -> None:
    scene = at(distance)
    assert len(match(scene)) == paired
    assert (result := hota(scene)) is not None
    assert result.within_gate == paired
    assert int(clear(scene).tracked.sum()) == paired
    assert identity(scene).true_positives == paired
    assert identity(scene).track_of.tolist() == [0 if paired else -1]
    assert len(assign(np.array([[distance]]), 1.0)[0]) == paired


def test_two_pairs_at_the_gate_are_worth_more_than_one_without_distance() -> None:
    # 0 to 0 and 1 to 1, or 0 to 1 alone
    rows, columns = assign(np.array([[1.0, 0.01], [1.2, 1.0]]), 1.0)
    assert (rows.tolist(), columns.tolist()) == ([0, 1], [0, 1])
    rows, columns = assign(np.array([[0.4, 0.9], [0.9, 0.1]]), 1.0)
    assert (rows.tolist(), columns.tolist()) == ([0, 1], [0, 1])
    rows, columns = assign(np.array([[1.001, 0.01], [1.2, 1.0]]), 1.0)
    assert (rows.tolist(), columns.tolist()) == ([0], [1])


@pytest.mark.parametrize(("distance", "pairs"), [(0.999, 1), (1.0, 0), (2.0, 0)])
def test_gospa_counts_a_pair_at_the_cut_off_as_missed_and_false(
    distance: float, pairs: int
) -> None:
    near, missed, false = gospa_parts(np.array([[distance]]), cutoff=1.0, order=2.0)
    assert (missed, false) == (1 - pairs, 1 - pairs)
    assert near == pytest.approx(pairs * distance**2)


def test_one_empty_set_is_at_the_cut_off_of_any_other() -> None:
    for shape in ((0, 3), (3, 0)):
        assert ospa_parts(np.zeros(shape), cutoff=0.7, order=2.0) == (0.7, 0.0, 0.7)
        assert gospa_parts(np.zeros(shape), cutoff=0.7, order=2.0)[1:] == shape
    assert ospa_parts(np.zeros((0, 0)), cutoff=0.7, order=2.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("index", [0, 9, 18])
def test_a_pair_counts_for_hota_up_to_its_similarity(index: int) -> None:
    for offset, counts in ((1e-9, False), (0.0, True), (-1e-9, True)):
        score = hota(at(1.0 - float(ALPHAS[index]) + offset))
        assert score is not None
        assert (score.detection[index] > 0.5) == counts
        assert score.detection[: index + counts].tolist() == [1.0] * (index + counts)
        assert not score.detection[index + counts :].any()
        assert score.localisation[index + counts :].tolist() == [1.0] * (19 - index - counts)
    assert ALPHAS == pytest.approx([0.05 * k for k in range(1, 20)])
    assert hota(comparison(None, tracks_of([]))) is None


def tracked_at(paired: int, steps: int = 10):
    """One person who is paired at so many of the steps, from the first on, beside another."""
    truth = truth_of([(t, k, 3.0 * k, 0, 0) for t in range(steps) for k in (1, 2)])
    rows = [(t, 8, 3.0, 0, 0) for t in range(paired)] + [(t, 9, 6.0, 0, 0) for t in range(steps)]
    return truth, tracks_of(rows)


@pytest.mark.parametrize(
    ("paired", "status"),
    [
        (9, "mostly tracked"),
        (8, "partly tracked"),
        (2, "partly tracked"),
        (1, "mostly lost"),
        (0, "mostly lost"),
    ],
)
def test_mostly_is_more_than_four_of_five_steps(paired: int, status: str) -> None:
    result = evaluate(*tracked_at(paired), steps=10)
    assert result.people[0].status == status
    assert result.people[0].tracked == paired
    counts = {
        name: int(name == status) for name in ("mostly tracked", "partly tracked", "mostly lost")
    }
    assert result["mostly_tracked"] == counts["mostly tracked"] + 1
    assert result["partly_tracked"] == counts["partly tracked"]
    assert result["mostly_lost"] == counts["mostly lost"]


@pytest.mark.parametrize(("matched", "kind"), [(1, "false"), (2, "person"), (3, "person")])
def test_a_track_is_a_persons_from_half_of_its_steps_on(matched: int, kind: str) -> None:
    truth = truth_of([(t, 3, 0, 0, 0) for t in range(4)])
    tracks = tracks_of([(t, 5, 0.2 if t < matched else 9.0, 0, 0) for t in range(4)])
    (row,) = evaluate(truth, tracks).tracks
    assert (row.kind, row.matched, row.steps, row.person) == (kind, matched, 4, 3)
    assert row.person_share == matched / 4
    assert row.error == pytest.approx(0.2)
    assert (row.first, row.last) == (0, 3)


def test_of_two_people_with_equal_shares_the_lower_id_is_the_tracks() -> None:
    truth = truth_of([(0, 4, 0, 0, 0), (1, 4, 9, 0, 0), (0, 2, 9, 0, 0), (1, 2, 0, 0, 0)])
    (row,) = evaluate(truth, tracks_of([(0, 5, 0, 0, 0), (1, 5, 0, 0, 0)])).tracks
    assert (row.person, row.person_share) == (2, 0.5)


def test_steps_that_are_set_aside_count_neither_for_nor_against_a_track() -> None:
    truth = truth_of([(t, 1, 0, 0, 0) for t in range(4)], valid=[True, True, False, False])
    tracks = tracks_of([(t, 5, 0.1, 0, 0) for t in range(4)] + [(3, 6, 0.05, 0, 0)])
    first, second = evaluate(truth, tracks).tracks
    assert (first.steps, first.ignored, first.matched, first.person_share) == (4, 1, 2, 2 / 3)
    assert (second.kind, second.ignored, second.person, second.error) == (
        "don't care",
        1,
        None,
        None,
    )


@pytest.mark.parametrize(("distance", "found"), [(0.299, 1), (0.3, 1), (0.301, 0)])
def test_near_itself_is_near(distance: float, found: int) -> None:
    scene = at(distance)
    score = positions(scene, near=0.3)
    assert score.found_by_person.tolist() == [found]
    assert score.false_per_step == 1 - found
    assert score.found_share == found
    assert score.errors.tolist() == [pytest.approx(distance)]


def test_errors_of_a_person_are_means_and_percentiles_of_the_paired_steps() -> None:
    truth = truth_of([(t, 1, 0, 0, 0) for t in range(12)])
    apart = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.25, 5.0]
    result = evaluate(truth, tracks_of([(t, 5, x, 0, 0) for t, x in enumerate(apart)]))
    (person,) = result.people
    assert person.error == pytest.approx(np.mean(apart[:10]))
    assert (
        person.error_95
        == result["position_error_95"]
        == pytest.approx(np.percentile(apart[:10], 95))
    )
    assert (person.first, person.last, person.steps, person.track) == (0, 11, 12, 5)
    assert person.found_share == pytest.approx(4 / 12)
    assert np.isnan(result.errors[1][10:]).all()


@pytest.mark.parametrize(("frame", "counts"), [(-1, 0), (0, 1), (4, 1), (5, 0)])
def test_the_first_and_the_last_step_count(frame: int, counts: int) -> None:
    rows, sources = to_rows(np.array([frame]), np.array([3]), np.zeros((1, 3)), 5)
    assert (len(rows), len(sources)) == (counts, counts)
    assert rows.counts.tolist() == [int(k == frame and counts) for k in range(5)]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_position_of_which_one_number_is_not_finite_is_left_out(value: float, axis: int) -> None:
    place = np.zeros((2, 3))
    place[1, axis] = value
    rows, sources = to_rows(np.array([0, 0]), np.array([1, 2]), place, 1)
    assert (rows.ids.tolist(), sources.tolist()) == ([1], [0])


@pytest.mark.parametrize(
    ("known", "unknown", "misses"),
    [([True, False, True], 1, 1), ([True], 2, 0), ([False, True, True, True, True], 1, 2)],
)
def test_steps_of_which_the_truth_knows_nothing_count_on_neither_side(
    known: list[bool], unknown: int, misses: int
) -> None:
    truth = truth_of([(t, k, 3.0 * k, 0, 0) for t in range(3) for k in (1, 2)])
    truth = replace(truth, known=np.array(known))
    tracks = tracks_of([(t, 5, 3.0, 0, 0) for t in range(3)] + [(0, 6, 6.0, 0, 0)])
    result = evaluate(truth, tracks, steps=3)
    assert result["misses"] == misses
    assert result["false_positives"] == 0
    word = "1 step " if unknown == 1 else "2 steps "
    assert result.notes == (f"Of {word}the truth says nothing: they count on neither side.",)


def test_notes_count_in_words() -> None:
    truth = truth_of([(0, 1, 0, 0, 0), (0, 2, 9, 0, 0)], valid=[True, False])
    tracks = tracks_of([(0, 1, 0, 0, 0), (0, 2, 9, 0, 0), (9, 3, 0, 0, 0)])
    assert evaluate(truth, tracks, steps=1).notes == (
        "1 true position of uncertain place (valid = 0) and 1 estimate that matched one count on "
        "neither side.",
        "1 estimate left out: outside the steps compared, at a position that is not finite, or "
        "repeating an id within a step.",
    )
    assert evaluate(None, tracks, steps=1).notes[0].startswith("There is no truth")
    assert evaluate(ONE, tracks_of([])).notes == ()
    assert evaluate(ONE, tracks_of([])).has_truth
    assert not evaluate(None, tracks).has_truth


def test_as_many_steps_as_either_side_has_are_scored() -> None:
    later = tracks_of([(4, 1, 0, 0, 0)])
    assert evaluate(ONE, later).steps == 5
    assert evaluate(truth_of([(6, 1, 0, 0, 0)]), later).steps == 7
    assert evaluate(None, tracks_of([])).steps == 0


FRONT = Camera(
    "front", (100, 80), np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]]),
    np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), np.zeros(3), np.zeros(5),
)  # fmt: skip


@pytest.mark.parametrize(("overlap", "pairs"), [(0.599, 1), (0.601, 0)])
def test_boxes_are_paired_from_their_least_overlap_on(overlap: float, pairs: int) -> None:
    # at 10 m boxes of 10 × 20 pixels, 1 aside and 3 below: 9 · 17 of 400 − 9 · 17 overlap
    truth, tracks = truth_of([(0, 1, 0, 10, 0)]), tracks_of([(0, 7, 0.1, 10, -0.3)])
    scene = comparison(truth, tracks, half_extents=np.array([0.5, 0.0, 1.0]))
    shared = 9 * 17 / (400 - 9 * 17)
    scale = overlap / 0.6 * shared
    (score,) = pixels(scene, [FRONT], overlap=scale)
    assert (len(score.errors), score.people, score.estimates, score.steps) == (pairs, 1, 1, 1)
    assert score.false_per_step == 1 - pairs
    assert score.found_share == pairs
    if pairs:
        assert score.error == score.error_95 == pytest.approx(np.hypot(1.0, 3.0))
        assert score.overlap == pytest.approx(shared)
    else:
        assert score.error is score.error_95 is score.overlap is None


def test_all_cameras_together_are_the_sum_of_each() -> None:
    truth = truth_of([(t, k, 1.5 * k - 2, 10, 0) for t in range(3) for k in (1, 2)])
    tracks = tracks_of(
        [(0, 7, -0.4, 10, 0), (1, 7, -0.3, 10, 0.1), (2, 8, 1.2, 10, 0.2), (2, 9, 30, 10, 0)]
    )
    half = np.array([0.5, 0.1, 1.0])
    other = replace(FRONT, name="other", translation=np.array([0.5, 0.0, 2.0]))
    result = evaluate(truth, tracks, half_extents=half, cameras=[FRONT, other])
    assert [score.camera for score in result.cameras] == ["front", "other"]
    errors = np.concatenate([score.errors for score in result.cameras])
    overlaps = np.concatenate([score.overlaps for score in result.cameras])
    assert len(errors) == 6
    assert result["pixel_error"] == pytest.approx(errors.mean())
    assert result["pixel_overlap"] == pytest.approx(overlaps.mean())
    assert result["pixel_found"] == pytest.approx(6 / 12)
    for score in result.cameras:
        assert (score.people, score.estimates, score.steps) == (6, 3, 3)
        assert score.error_95 == pytest.approx(np.percentile(score.errors, 95))


def test_the_memory_of_pairs_is_of_the_step_before_alone() -> None:
    # both estimates at the gate's middle: the pair of the step before is kept, whatever is nearer
    truth = truth_of([(t, 1, 0, 0, 0) for t in range(4)])
    tracks = tracks_of(
        [(0, 10, 0.3, 0, 0), (1, 10, 1.0, 0, 0), (1, 20, 0.0, 0, 0), (2, 10, 1.001, 0, 0),
         (2, 20, 0.9, 0, 0), (3, 10, 0.0, 0, 0), (3, 20, 0.9, 0, 0)]
    )  # fmt: skip
    score = clear(comparison(truth, tracks))
    assert score.id_switches.tolist() == [0, 0, 1, 0]
    assert score.motp == pytest.approx((0.3 + 1.0 + 0.9 + 0.9) / 4)
    assert score.switches.tolist() == [1]
    assert score.switch.tolist() == [False, False, True, False]


def test_a_person_is_fragmented_once_for_each_gap() -> None:
    truth = truth_of([(t, k, 4.0 * k, 0, 0) for t in range(7) for k in (1, 2)])
    rows = [(t, 5, 4.0, 0, 0) for t in (1, 3, 4, 6)] + [(t, 6, 8.0, 0, 0) for t in range(7)]
    score = clear(comparison(truth, tracks_of(rows)))
    assert score.fragmentations.tolist() == [2, 0]
    assert score.tracked.tolist() == [4, 7]
    assert score.present.tolist() == [7, 7]


@pytest.mark.parametrize(
    ("certain", "uncertain", "ignored"),
    [(1.0, 0.49, True), (1.0, 0.51, False), (1.5, 0.74, True), (1.5, 0.76, False)],
)
def test_an_uncertain_position_counts_as_twice_as_far(
    certain: float, uncertain: float, ignored: bool
) -> None:
    truth = truth_of([(0, 1, certain, 0, 0), (0, 2, -uncertain, 0, 0)], valid=[True, False])
    result = evaluate(truth, tracks_of([(0, 5, 0.0, 0, 0)]), EvaluationSettings(gate=1.5))
    assert result.series.ignored.tolist() == [int(ignored)]
    assert result["misses"] == int(ignored)


def test_an_uncertain_position_beyond_the_gate_takes_nothing() -> None:
    truth = truth_of([(0, 2, 1.01, 0, 0)], valid=False)
    result = evaluate(truth, tracks_of([(0, 5, 0.0, 0, 0)]))
    assert result["false_positives"] == 1
    truth = truth_of([(0, 2, 0.99, 0, 0)], valid=False)
    assert evaluate(truth, tracks_of([(0, 5, 0.0, 0, 0)]))["false_positives"] == 0


def test_what_is_stated_beside_a_figure_has_its_unit() -> None:
    names = ("distance", "gate", "cutoff", "order", "window", "near", "overlap")
    settings = EvaluationSettings(gate=0.75, cutoff=2.0, order=2.0, window=2, near=0.2, overlap=0.4)
    assert settings.in_words(names) == (
        "3D distance, gate 0.75 m, cut-off 2 m, order 2, window 2 steps, within 0.2 m, IoU ≥ 0.4"
    )
    boxes = EvaluationSettings(distance="box", box_gate=0.4, gate=0.75, cutoff=0.8, window=1)
    assert boxes.in_words(("gate", "cutoff", "window")) == "gate 0.4, cut-off 0.8, window 1 step"
    assert (boxes.unit, settings.unit) == ("", "m")
    assert (boxes.effective_gate, settings.effective_gate) == (0.4, 0.75)


def test_boxes_are_needed_for_pictures_and_for_the_box_distance_alone() -> None:
    for needs in ({"cameras": [FRONT]}, {"settings": EvaluationSettings(distance="box")}):
        with pytest.raises(ValueError, match="half_extents is missing"):
            evaluate(ONE, tracks_of([]), **needs)
        assert evaluate(ONE, tracks_of([]), half_extents=HALF_EXTENTS, **needs).steps == 1
