"""A run without tracks names the stage that lost all people."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.runs.test_gates import film
from tracker.parameters.catalogue import RunParameters
from tracker.runs.outcome import StageCounts, _losing_stage
from tracker.runs.run import Run

ALL = StageCounts(frames=100, found=1000, passed=20, together=5, begun=3, surest=0.4, tracks=0)


@pytest.mark.parametrize(
    ("counts", "cameras", "words"),
    [
        ({"frames": 0}, 2, "not one of the frames of boxes could be read"),
        ({"found": 0}, 2, "lower what a box must have to count"),
        ({"passed": 19}, 2, "nearly none can stand in [room]"),
        ({"together": 0}, 2, "a track begins where boxes of two cameras meet"),
        (
            {"together": 0, "begun": 0},
            1,
            "20 of them passed on to the fusion, 0 tracks begun: the ",
        ),
        ({"together": 0}, 1, "20 of them passed on to the fusion, 3 tracks begun, the surest"),
        ({"begun": 0}, 2, "boxes of different cameras meet nowhere"),
        ({}, 2, "3 tracks begun, the surest with existence 0.40, below the extraction"),
    ],
)
def test_the_first_stage_without_output_is_named(
    counts: dict[str, int], cameras: int, words: str, tmp_path: Path
) -> None:
    sequence = film(tmp_path, stays=False)
    views = sequence.views * cameras
    run = Run(replace(sequence, views=views), RunParameters(), 0, {})
    assert words in _losing_stage(run, replace(ALL, **counts))
