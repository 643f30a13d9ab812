"""Nothing, too little, and odd data: every answer is defined, none is an exception."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.evaluation.scenes import (
    HALF_EXTENTS,
    Columns,
    columns_of,
    comparison,
    perturbed,
    tracks_of,
    truth_of,
    walks,
)
from tracker.camera import Camera
from tracker.evaluation import EvaluationSettings, evaluate
from tracker.evaluation.measures.matching import to_rows
from tracker.trajectories import Trajectories

CAMERA = Camera(
    "front",
    (640, 480),
    np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]),
    np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    np.array([0.0, 1.0, 5.0]),
    np.zeros(5),
)
NOTHING = tracks_of([])


def scored(truth, tracks, **options):
    """Evaluated with a camera, and checked to be plain JSON."""
    result = evaluate(truth, tracks, half_extents=HALF_EXTENTS, cameras=[CAMERA], **options)
    json.dumps(result.to_json(), allow_nan=False)
    return result


@pytest.mark.parametrize("truth", [None, truth_of([])])
@pytest.mark.parametrize("tracks", [NOTHING, Trajectories.empty(2)])
@pytest.mark.parametrize("steps", [None, 0, 1, 5])
def test_nothing_at_all(truth, tracks, steps: int | None):
    result = scored(truth, tracks, steps=steps)
    assert not result.has_truth
    assert result["mota"] is result["idf1"] is result["hota"] is result["motp"] is None
    assert result["misses"] == result["false_positives"] == 0
    assert result["ospa"] == (0.0 if steps else None)
    assert result["ospa2_whole"] == (0.0 if steps else None)
    assert result.people == result.tracks == ()


def test_no_truth():
    tracks = tracks_of([(0, 1, 0, 0, 1), (1, 1, 0, 0, 1), (1, 2, 1, 0, 1)])
    result = scored(None, tracks, steps=3)
    assert result["mota"] is result["idr"] is result["found_share"] is None
    assert result["false_positives"] == 3
    assert result["idp"] == result["idf1"] == result["hota"] == 0.0
    assert result.series.ospa.tolist() == [1.0, 1.0, 0.0]
    assert result.series.gospa.tolist() == [0.5, 1.0, 0.0]
    assert [row.kind for row in result.tracks] == ["false", "false"]
    assert "no truth" in result.notes[0]


def test_no_tracks():
    truth = truth_of([(0, 1, 0, 0, 1), (1, 1, 0, 0, 1), (1, 2, 1, 0, 1)])
    result = scored(truth, NOTHING)
    assert result["mota"] == result["idr"] == result["idf1"] == result["hota"] == 0.0
    assert result["motp"] is result["idp"] is result["position_error"] is None
    assert result["misses"] == 3
    assert result["mostly_lost"] == 2
    assert result.series.ospa.tolist() == [1.0, 1.0]
    assert result.people[0].error is None
    assert np.isnan(result.errors[1]).all()


def test_one_step():
    result = scored(truth_of([(0, 1, 0, 0, 1)]), tracks_of([(0, 9, 0.2, 0, 1)]))
    assert result.steps == 1
    assert result["mota"] == result["idf1"] == 1.0
    assert result["position_error"] == pytest.approx(0.2)
    assert result["ospa2"] == result["ospa2_whole"] == pytest.approx(0.2)


def test_an_id_that_comes_back_is_no_switch():
    truth = truth_of([(t, 1, 0, 0, 1) for t in range(6)])
    tracks = tracks_of([(t, 4, 0, 0, 1) for t in (0, 1, 4, 5)])
    result = scored(truth, tracks)
    assert result["id_switches"] == 0
    assert result["misses"] == 2
    # steps without any estimate are not part of the memory
    assert result["fragmentations"] == 0
    assert result.people[0].track == 4


def test_rows_that_cannot_be_scored_are_left_out_and_noted():
    truth = truth_of([(t, 1, 0, 0, 1) for t in range(3)])
    tracks = tracks_of(
        [
            (0, 5, 0.1, 0, 1),
            (0, 5, 9.0, 0, 1),  # repeats an id
            (1, 5, np.nan, 0, 1),
            (1, 5, 0.1, 0, 1),  # the first of this id that can be scored
            (7, 5, 0, 0, 1),  # beyond the steps
            (-1, 5, 0, 0, 1),
        ]
    )
    result = scored(truth, tracks, steps=3)
    assert result["false_positives"] == 0
    assert result["misses"] == 1
    assert "4 estimates left out" in result.notes[0]


def test_only_the_steps_done_are_scored():
    truth = walks(1)
    tracks = columns_of(truth)
    part = scored(truth, tracks, steps=10)
    assert part.steps == 10
    assert part["misses"] == part["false_positives"] == 0
    assert len(part.series.ospa) == 10


def test_sorting_keeps_the_first_of_a_repeated_id():
    frames, ids = np.array([2, 0, 2, 0]), np.array([1, 3, 1, 2])
    rows, sources = to_rows(frames, ids, np.arange(12.0).reshape(4, 3), 4)
    assert rows.frames.tolist() == [0, 0, 2]
    assert sources.tolist() == [3, 1, 0]
    assert rows.counts.tolist() == [2, 0, 1, 0]


class TestDontCare:
    """Rows with ``valid = 0``."""

    def test_neither_right_nor_wrong(self):
        truth = truth_of([(0, 1, 0, 0, 1), (0, 2, 3, 0, 1)], valid=[True, False])
        result = scored(truth, tracks_of([(0, 8, 0.1, 0, 1), (0, 9, 3.2, 0, 1)]))
        assert result["mota"] == 1.0
        assert result["false_positives"] == 0
        assert result.series.ignored.tolist() == [1]
        assert result.series.dont_care.tolist() == [1]
        assert [row.kind for row in result.tracks] == ["person", "don't care"]
        assert result["cardinality_error"] == 0.0

    def test_missing_one_is_no_miss(self):
        truth = truth_of([(0, 1, 0, 0, 1), (0, 2, 3, 0, 1)], valid=[True, False])
        result = scored(truth, tracks_of([(0, 8, 0.1, 0, 1)]))
        assert result["misses"] == 0
        assert result["ospa"] == pytest.approx(0.1)

    def test_a_second_estimate_on_one_is_false(self):
        truth = truth_of([(0, 2, 3, 0, 1)], valid=False)
        result = scored(truth, tracks_of([(0, 8, 3.1, 0, 1), (0, 9, 2.9, 0, 1)]))
        assert result["false_positives"] == 1

    def test_a_certain_position_comes_first(self):
        # the estimate is a little nearer to the uncertain one
        truth = truth_of([(0, 1, 0, 0, 1), (0, 2, 0.9, 0, 1)], valid=[True, False])
        assert scored(truth, tracks_of([(0, 8, 0.5, 0, 1)]))["misses"] == 0

    def test_but_not_for_what_is_clearly_the_uncertain_ones(self):
        # less than half as far from the uncertain one: person 1 is missed
        truth = truth_of([(0, 1, 0, 0, 1), (0, 2, 0.9, 0, 1)], valid=[True, False])
        result = scored(truth, tracks_of([(0, 8, 0.85, 0, 1)]))
        assert result["misses"] == 1
        assert result["false_positives"] == 0

    def test_no_switch_through_an_uncertain_neighbour(self):
        # two people side by side, the second uncertain; the first's own track misses step 1
        truth = truth_of(
            [(t, k, 0.8 * k, 0, 1) for t in range(3) for k in (1, 2)], valid=[True, False] * 3
        )
        rows = [(t, k, 0.8 * k, 0, 1) for t in range(3) for k in (1, 2) if (t, k) != (1, 1)]
        result = scored(truth, tracks_of(rows))
        assert result["id_switches"] == 0
        assert result["misses"] == 1

    def test_certain_rows_alone_change_nothing(self):
        truth = walks(5)
        tracks = perturbed(truth, 6)
        scene = comparison(truth, tracks)
        assert not len(scene.ignored)
        assert len(scene.tracks) == len(tracks.frames)


def test_boxes_need_their_size():
    with pytest.raises(ValueError, match="target_half_extents"):
        evaluate(None, NOTHING, EvaluationSettings(distance="box"))
    with pytest.raises(ValueError, match="target_half_extents"):
        evaluate(None, NOTHING, cameras=[CAMERA])


def test_ground_distance_ignores_height():
    truth = truth_of([(0, 1, 0, 0, 1)])
    tracks = Columns(np.array([0]), np.array([1]), np.array([[0.3, 0.4, 9.0]]))
    settings = EvaluationSettings(distance="ground")
    assert scored(truth, tracks, settings=settings)["position_error"] == pytest.approx(0.5)
    assert scored(truth, tracks)["misses"] == 1
