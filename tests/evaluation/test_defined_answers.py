"""Nothing, too little, and odd data: every answer is defined, none is an exception."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.evaluation.scenes import CAMERA, HALF_EXTENTS, Columns, tracks_of, truth_of
from tracker.evaluation import EvaluationSettings, evaluate
from tracker.evaluation.matching import to_rows
from tracker.fusion.trajectories import Trajectories

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


def test_sorting_keeps_the_first_of_a_repeated_id():
    frames, ids = np.array([2, 0, 2, 0]), np.array([1, 3, 1, 2])
    rows, sources = to_rows(frames, ids, np.arange(12.0).reshape(4, 3), 4)
    assert rows.frames.tolist() == [0, 0, 2]
    assert sources.tolist() == [3, 1, 0]
    assert rows.counts.tolist() == [2, 0, 1, 0]


def test_ground_distance_ignores_height():
    truth = truth_of([(0, 1, 0, 0, 1)])
    tracks = Columns(np.array([0]), np.array([1]), np.array([[0.3, 0.4, 9.0]]))
    settings = EvaluationSettings(distance="ground")
    assert scored(truth, tracks, settings=settings)["position_error"] == pytest.approx(0.5)
    assert scored(truth, tracks)["misses"] == 1
